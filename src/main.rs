use std::io::Write;
use std::process::ExitCode;

use clap::Parser;
use lobestone::commands::{self, Cli};

fn main() -> ExitCode {
    let cli = Cli::parse();
    let as_json = cli.json;
    match commands::run(cli) {
        Ok(outcome) => {
            let text = if as_json {
                format!("{:#}\n", outcome.json)
            } else {
                outcome.text
            };
            // A closed pipe (`lobestone … | head`) is no failure of ours.
            let _ = std::io::stdout().write_all(text.as_bytes());
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
