use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(lobestone::commands::program(std::env::args_os()))
}
