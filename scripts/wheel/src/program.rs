//! The command line, within the interpreter.

use std::ffi::OsString;

use pyo3::prelude::*;

/// Runs the command line: `arguments` without the program's name; `again`: program and first arguments with which
/// `lobestone` is started once more. The exit status.
#[pyfunction]
pub fn command(py: Python<'_>, arguments: Vec<OsString>, again: Vec<OsString>) -> u8 {
    py.detach(|| {
        lobestone::commands::started_by(again);
        let name = OsString::from("lobestone");
        lobestone::commands::program(std::iter::once(name).chain(arguments))
    })
}
