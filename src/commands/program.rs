//! The program as a whole: arguments in, answer on stdout, exit status out.

use std::ffi::OsString;
use std::io::{ErrorKind, Write};

use clap::Parser;

use super::cli::{Cli, ColorChoice, run};
use super::printed::{shown, shown_json};
use super::text::error_label;

/// Does what `arguments` say (the first of them is the program's name) and returns the exit status.
pub fn program<A: Into<OsString> + Clone>(arguments: impl IntoIterator<Item = A>) -> u8 {
    crate::sums_in_order();
    crate::progress::shown_by(super::progress_bar::progress_bar);
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(said) => {
            // Help and version come this way, too.
            let status = u8::try_from(said.exit_code()).unwrap_or(2);
            return match lost(said.print(), "help").filter(|_| !said.use_stderr()) {
                Some(error) => fail(&error),
                None => status,
            };
        }
    };
    match cli.color {
        ColorChoice::Auto => {}
        ColorChoice::Always => anstream::ColorChoice::Always.write_global(),
        ColorChoice::Never => anstream::ColorChoice::Never.write_global(),
    }
    let as_json = cli.json;
    let failed = match run(cli) {
        Ok(outcome) => {
            let printed = match as_json {
                true if outcome.json.is_null() => Ok(()),
                true => print_json(&outcome.json),
                false => print_text(&outcome.text),
            };
            lost(printed, "what was found").or(outcome.failed.map(|error| error.to_string()))
        }
        Err(error) => Some(error.to_string()),
    };
    match failed {
        None => 0,
        Some(error) => fail(&error),
    }
}

/// What to say of a failed write of `what`. A closed pipe (`lobestone … | head`) is no failure of ours.
fn lost(printed: std::io::Result<()>, what: &str) -> Option<String> {
    let error = printed.err().filter(|e| e.kind() != ErrorKind::BrokenPipe)?;
    Some(format!("stdout: cannot be written ({error}); {what} is lost"))
}

fn fail(error: &str) -> u8 {
    anstream::eprintln!("{} {}", error_label(), shown(error));
    1
}

/// Colours go to a terminal only, and not where NO_COLOR is set, unless somebody asked for them.
fn print_text(text: &str) -> std::io::Result<()> {
    let mut stdout = anstream::stdout().lock();
    stdout.write_all(shown(text).as_bytes())?;
    stdout.flush()
}

fn print_json(json: &serde_json::Value) -> std::io::Result<()> {
    let text = serde_json::to_string_pretty(json)?;
    let mut stdout = std::io::stdout().lock();
    stdout.write_all(shown_json(&text).as_bytes())?;
    stdout.write_all(b"\n")?;
    stdout.flush()
}
