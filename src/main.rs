use std::io::{ErrorKind, Write};
use std::process::ExitCode;

use clap::Parser;
use lobestone::commands::{self, Cli, Color};

fn main() -> ExitCode {
    lobestone::sums_in_order();
    let cli = Cli::parse();
    match cli.color {
        Color::Auto => {}
        Color::Always => anstream::ColorChoice::Always.write_global(),
        Color::Never => anstream::ColorChoice::Never.write_global(),
    }
    let as_json = cli.json;
    let failed = match commands::run(cli) {
        Ok(outcome) => {
            let printed = match as_json {
                true if outcome.json.is_null() => Ok(()),
                true => print_json(&outcome.json),
                false => print_text(&outcome.text),
            };
            match printed {
                // A closed pipe (`lobestone … | head`) is no failure of ours.
                Err(e) if e.kind() != ErrorKind::BrokenPipe => {
                    Some(format!("stdout: cannot be written ({e}); what was found is lost"))
                }
                _ => outcome.failed.map(|error| error.to_string()),
            }
        }
        Err(error) => Some(error.to_string()),
    };
    match failed {
        None => ExitCode::SUCCESS,
        Some(error) => {
            anstream::eprintln!("{} {}", commands::error_label(), commands::shown(&error));
            ExitCode::FAILURE
        }
    }
}

/// Colours go to a terminal only, and not where NO_COLOR is set, unless somebody asked for them.
fn print_text(text: &str) -> std::io::Result<()> {
    let mut stdout = anstream::stdout().lock();
    stdout.write_all(commands::shown(text).as_bytes())?;
    stdout.flush()
}

fn print_json(json: &serde_json::Value) -> std::io::Result<()> {
    let text = serde_json::to_string_pretty(json)?;
    let mut stdout = std::io::stdout().lock();
    stdout.write_all(commands::shown_json(&text).as_bytes())?;
    stdout.write_all(b"\n")?;
    stdout.flush()
}
