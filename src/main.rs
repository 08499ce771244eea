use std::io::Write;
use std::process::ExitCode;

use clap::Parser;
use lobestone::commands::{self, Cli};

fn main() -> ExitCode {
    lobestone::sums_in_order();
    let cli = Cli::parse();
    let as_json = cli.json;
    match commands::run(cli) {
        Ok(outcome) => {
            // A closed pipe (`lobestone … | head`) is no failure of ours.
            let _ = match as_json {
                true if outcome.json.is_null() => Ok(()),
                true => print_json(&outcome.json),
                // Colours go to a terminal only, and not where NO_COLOR is set.
                false => anstream::stdout().write_all(outcome.text.as_bytes()),
            };
            ExitCode::SUCCESS
        }
        Err(error) => {
            anstream::eprintln!("{} {error}", commands::error_label());
            ExitCode::FAILURE
        }
    }
}

fn print_json(json: &serde_json::Value) -> std::io::Result<()> {
    let mut text = serde_json::to_vec_pretty(json)?;
    text.push(b'\n');
    std::io::stdout().write_all(&text)
}
