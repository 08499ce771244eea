//! Orders that are not taken.

use crate::Error;

/// Why an order is not taken, in a sentence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Refusal {
    /// Something else is being done, or was done since the page was looked at.
    Late(String),
    /// It cannot be done.
    Impossible(String),
}

impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        Refusal::Impossible(error.to_string())
    }
}

impl From<Refusal> for Error {
    fn from(refusal: Refusal) -> Self {
        match refusal {
            Refusal::Late(why) | Refusal::Impossible(why) => Error::Computation(why),
        }
    }
}
