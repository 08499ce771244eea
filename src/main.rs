//! The program `lobestone`: everything it does is in the library, from [`lobestone::commands`] on.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(lobestone::commands::program(std::env::args_os()))
}
