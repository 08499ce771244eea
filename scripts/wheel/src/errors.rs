//! Errors of the library as exceptions of `lobestone.errors`.

use lobestone::Error;
use pyo3::prelude::*;

/// The exception for an error of the library; where even that cannot be made, the exception that says why.
pub fn raised(py: Python<'_>, error: &Error) -> PyErr {
    exception(py, error).unwrap_or_else(|failed| failed)
}

fn exception(py: Python<'_>, error: &Error) -> PyResult<PyErr> {
    let classes = py.import("lobestone.errors")?;
    let message = error.to_string();
    let instance = match error {
        Error::Input(input) => classes.getattr("InputError")?.call1((
            message,
            input.file.as_ref().map(|f| f.display().to_string()),
            input.line,
            input.key.as_deref(),
            input.problem.as_str(),
            input.remedy.as_deref(),
        ))?,
        Error::Io { path, .. } => classes
            .getattr("FileError")?
            .call1((message, path.display().to_string()))?,
        Error::Computation(_) => classes.getattr("ComputationError")?.call1((message,))?,
    };
    Ok(PyErr::from_value(instance))
}
