//! MATLAB files: [`v4`], [`v5`] (to v7) and v7.3 ([`hdf5`]). All become a list of named arrays; [`interpret`] says which of them
//! are FRFs, coherences and time signals.

use crate::InputError;
use crate::ingest::budget::Budget;
use crate::ingest::contents::Contents;
use crate::ingest::text::Notes;

mod hdf5;
mod interpret;
mod testlab;
mod v4;
mod v5;
mod variable;
mod write;

use variable::Labels;
pub(crate) use variable::Variable;
pub use write::{MatArray, mat5_bytes};

pub(crate) fn looks_like_v5(bytes: &[u8]) -> bool {
    bytes.starts_with(b"MATLAB 5.0 MAT-file")
}

/// An HDF5 file with MATLAB's block before it, or bare.
pub(crate) fn looks_like_v73(bytes: &[u8]) -> bool {
    hdf5::looks_like(bytes)
}

pub(crate) fn looks_like_v4(bytes: &[u8]) -> bool {
    v4::looks_like(bytes)
}

/// Named arrays, and labels of their rows and columns where the format has such.
pub(crate) struct NamedArrays {
    variables: Vec<Variable>,
    labels: Vec<Labels>,
}

impl From<Vec<Variable>> for NamedArrays {
    fn from(variables: Vec<Variable>) -> Self {
        NamedArrays {
            variables,
            labels: Vec::new(),
        }
    }
}

impl NamedArrays {
    pub(crate) fn of_v4(bytes: &[u8], budget: &mut Budget, notes: &mut Notes) -> Result<Self, InputError> {
        v4::read(bytes, budget, notes).map(NamedArrays::from)
    }

    pub(crate) fn of_v5(bytes: &[u8], budget: &mut Budget, notes: &mut Notes) -> Result<Self, InputError> {
        v5::read(bytes, budget, notes).map(|(variables, labels)| NamedArrays { variables, labels })
    }

    pub(crate) fn of_v73(bytes: &[u8], budget: &mut Budget, notes: &mut Notes) -> Result<Self, InputError> {
        hdf5::read(bytes, budget, notes).map(NamedArrays::from)
    }

    /// What the arrays hold. `rate_hz`: of the samples, if the campaign says it.
    pub(crate) fn contents(
        self,
        rate_hz: Option<f64>,
        budget: &mut Budget,
        notes: &mut Notes,
    ) -> Result<Contents, InputError> {
        interpret::contents(with_rate(self.variables, rate_hz), &self.labels, budget, notes)
    }
}

/// A rate that the campaign says stands beside the arrays as if the file had it.
fn with_rate(mut variables: Vec<Variable>, rate_hz: Option<f64>) -> Vec<Variable> {
    variables.extend(rate_hz.map(|rate| Variable {
        name: "fs".into(),
        size: vec![1, 1],
        re: vec![rate],
        im: None,
    }));
    variables
}
