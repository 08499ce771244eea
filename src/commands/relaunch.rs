//! How this program is started once more, for work in a process of its own.

use std::ffi::OsString;
use std::sync::OnceLock;

static STARTED_BY: OnceLock<Vec<OsString>> = OnceLock::new();

/// Says how this program is started once more (program and first arguments) where that is not by the executable that runs:
/// within an interpreter. The first word counts.
pub fn started_by(command: Vec<OsString>) {
    let _ = STARTED_BY.set(command);
}

/// Program and first arguments that start this program once more.
///
/// # Errors
/// The operating system does not tell.
pub(super) fn once_more() -> std::io::Result<std::process::Command> {
    let Some([program, first @ ..]) = STARTED_BY.get().map(Vec::as_slice) else {
        return Ok(std::process::Command::new(std::env::current_exe()?));
    };
    let mut command = std::process::Command::new(program);
    command.args(first);
    Ok(command)
}
