//! The one error type of the crate: every message names what is wrong, where, and what to do about it.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Result of whatever can fail in this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Why a piece of work could not be done. Cheap to pass on to everyone who asked for it.
#[derive(Debug, Clone, thiserror::Error)]
pub enum Error {
    /// A file or a request of the user's does not say what it should.
    #[error("{0}")]
    Input(Box<InputError>),
    /// The operating system refused to read or write.
    #[error("{}: {source}", crate::text::shown(&path.display().to_string()))]
    Io {
        /// What was to be read or written.
        path: PathBuf,
        /// Why it could not be.
        source: Arc<std::io::Error>,
    },
    /// The input is well formed but the numbers allow no answer (singular system, no mode in the band, …).
    #[error("{0}")]
    Computation(String),
}

impl Error {
    /// The operating system refused to read or write `path`.
    pub fn io(path: impl Into<PathBuf>, source: std::io::Error) -> Self {
        Error::Io {
            path: path.into(),
            source: Arc::new(source),
        }
    }

    /// The numbers allow no answer, for the reason that `message` says.
    pub fn computation(message: impl Into<String>) -> Self {
        Error::Computation(message.into())
    }
}

/// What is wrong with an input: problem, place and remedy.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct InputError {
    /// The file that is wrong.
    pub file: Option<PathBuf>,
    /// 1-based line in the file.
    pub line: Option<usize>,
    /// Dotted key in the file, such as `cut[3].feed_per_tooth_mm`.
    pub key: Option<String>,
    /// What is wrong, in plain words.
    pub problem: String,
    /// What to do about it.
    pub remedy: Option<String>,
}

impl InputError {
    /// A problem, without its place yet.
    pub fn new(problem: impl Into<String>) -> Self {
        InputError {
            problem: problem.into(),
            ..Default::default()
        }
    }

    /// Says which file is wrong.
    pub fn file(mut self, file: impl AsRef<Path>) -> Self {
        self.file = Some(file.as_ref().to_path_buf());
        self
    }

    /// Says which line (from 1) is wrong.
    pub fn line(mut self, line: impl Into<Option<usize>>) -> Self {
        self.line = line.into();
        self
    }

    /// Says which dotted key is wrong.
    pub fn key(mut self, key: impl Into<String>) -> Self {
        self.key = Some(key.into());
        self
    }

    /// Says what to do about it.
    pub fn remedy(mut self, remedy: impl Into<String>) -> Self {
        self.remedy = Some(remedy.into());
        self
    }
}

impl fmt::Display for InputError {
    /// What files say is shown, not obeyed: control characters become visible.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        use crate::text::shown;
        if let Some(file) = &self.file {
            write!(f, "{}", shown(&file.display().to_string()))?;
            if let Some(line) = self.line {
                write!(f, ":{line}")?;
            }
            write!(f, ": ")?;
        }
        if let Some(key) = &self.key {
            write!(f, "{}: ", shown(key))?;
        }
        write!(f, "{}", shown(&self.problem))?;
        if let Some(remedy) = &self.remedy {
            write!(f, "\n  remedy: {}", shown(remedy))?;
        }
        Ok(())
    }
}

impl std::error::Error for InputError {}

impl From<InputError> for Error {
    fn from(error: InputError) -> Self {
        Error::Input(Box::new(error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_input_error_names_file_line_key_and_remedy() {
        let error = InputError::new("unknown key")
            .file("cell7/campaign.toml")
            .line(12)
            .key("cut[0].feeed_per_tooth_mm")
            .remedy("did you mean feed_per_tooth_mm?");
        assert_eq!(
            error.to_string(),
            "cell7/campaign.toml:12: cut[0].feeed_per_tooth_mm: unknown key\n  remedy: did you mean feed_per_tooth_mm?"
        );
    }
}
