//! What belongs to the shell around the program: completions and the manual page.

use std::path::{Path, PathBuf};

use clap_complete::Shell;
use serde::Serialize;

use crate::commands::outcome::Outcome;
use crate::files::write_atomically;
use crate::{Error, Result};

#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  lobestone completions bash \\\n    > ~/.local/share/bash-completion/completions/lobestone\n  \
                        lobestone completions zsh > ~/.zfunc/_lobestone\n  \
                        lobestone completions fish > ~/.config/fish/completions/lobestone.fish\n  \
                        lobestone completions powershell >> $PROFILE"
)]
pub struct CompletionArgs {
    shell: Shell,
}

#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  lobestone man | man -l -\n  lobestone man --out ~/.local/share/man/man1"
)]
pub struct ManArgs {
    /// Write lobestone.1 and a page for each command into this folder, instead of printing the first.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// The script for a shell; `command`: the whole program's.
pub fn completions(args: CompletionArgs, mut command: clap::Command) -> Result<Outcome> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, "lobestone", &mut script);
    let script = String::from_utf8_lossy(&script).into_owned();
    Ok(Outcome::new(
        Script {
            shell: args.shell.to_string(),
            script: &script,
        },
        script.clone(),
        None,
    ))
}

/// The manual pages; `command`: the whole program's.
pub fn man(args: ManArgs, command: clap::Command) -> Result<Outcome> {
    let mut command = command.disable_help_subcommand(true);
    command.build();
    let pages = pages(command)?;
    let Some(dir) = args.out else {
        let (name, page) = pages.into_iter().next().unwrap_or_default();
        let document = ManualPage {
            name: &name,
            page: &page,
        };
        return Ok(Outcome::new(document, page.clone(), None));
    };
    std::fs::create_dir_all(&dir).map_err(|e| Error::io(&dir, e))?;
    let mut files = Vec::new();
    for (name, page) in pages {
        let file = dir.join(name);
        write_atomically(&file, page.as_bytes())?;
        files.push(file);
    }
    Ok(Outcome::new(
        ManualPages {
            dir: &dir,
            files: &files,
        },
        format!("{} manual pages in {}\n", files.len(), dir.display()),
        Some(format!("run `man {}`", first_page(&dir).display())),
    ))
}

/// What `completions` prints.
#[derive(Serialize)]
struct Script<'a> {
    shell: String,
    script: &'a str,
}

/// What `man` prints.
#[derive(Serialize)]
struct ManualPage<'a> {
    name: &'a str,
    page: &'a str,
}

/// What `man --out` writes.
#[derive(Serialize)]
struct ManualPages<'a> {
    dir: &'a Path,
    files: &'a [PathBuf],
}

fn first_page(dir: &Path) -> PathBuf {
    dir.join("lobestone.1")
}

/// File name and text of the program's page, then of each command's.
fn pages(command: clap::Command) -> Result<Vec<(String, String)>> {
    let mut pages = Vec::new();
    let commands: Vec<clap::Command> = command.get_subcommands().cloned().collect();
    for command in std::iter::once(command).chain(commands) {
        let man = clap_mangen::Man::new(command);
        let mut page = Vec::new();
        man.render(&mut page)
            .map_err(|e| Error::computation(format!("the manual page cannot be written: {e}")))?;
        pages.push((man.get_filename(), String::from_utf8_lossy(&page).into_owned()));
    }
    Ok(pages)
}
