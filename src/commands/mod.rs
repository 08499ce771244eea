//! The command line: one file a subcommand, each reads its arguments, calls the library and hands back
//! an [`Outcome`]. Nothing is computed here.

use std::path::PathBuf;

use clap::{Parser, Subcommand, ValueEnum};

use crate::Result;
use crate::campaign::Campaign;

mod add;
mod calibrate;
mod cfc;
mod compare;
mod demo;
mod diagnose;
mod explain;
mod history;
mod hole;
mod init;
mod inspect;
mod lobe_tool;
mod lobes;
mod localise;
mod modal;
mod modal_files;
mod model;
mod next_step;
mod operational;
mod plan;
mod report;
mod serve;
mod shell;
mod simulate;
mod sweep;
mod text;
mod thesis;
mod undo;
mod workbench;

/// What a command has to say: the document of the contract, and the same for a person.
pub struct Outcome {
    /// Printed with `--json`; null where there is nothing to say (any more).
    pub json: serde_json::Value,
    /// Printed without; may be coloured.
    pub text: String,
}

impl Outcome {
    /// With the next sensible step: `next_step` in the document, the last line of the text.
    pub fn new(mut json: serde_json::Value, mut text: String, next_step: Option<String>) -> Self {
        if let Some(step) = &next_step {
            text += &format!("\n{} {step}\n", text::Emphasis::Strong.on("Next:"));
        }
        json["next_step"] = next_step.into();
        Outcome { json, text }
    }
}

/// What an error message begins with on a terminal.
pub fn error_label() -> String {
    text::Emphasis::Bad.on("error:")
}

#[derive(Parser)]
#[command(name = "lobestone", version, about, long_about = None)]
pub struct Cli {
    /// Print one JSON document on stdout and nothing else there.
    #[arg(long, global = true)]
    pub json: bool,
    #[command(subcommand)]
    pub command: Command,
}

/// Which side of a campaign a command looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Domain {
    Structure,
    Cutting,
}

#[derive(Subcommand)]
pub enum Command {
    /// Make a campaign of a folder of measurement files.
    Init(Box<init::Args>),
    /// Say what measurement files are: format, channels, units, quality.
    Inspect(inspect::Args),
    /// Cutting force coefficients from dynamometer records.
    Cfc(cfc::Args),
    /// Modal parameters from FRFs.
    Modal(modal::Args),
    /// What the robot model says, before and after calibration.
    Model(model::Args),
    /// Tune the model to the measured FRFs.
    Calibrate(calibrate::Args),
    /// Model against measurement: where it fails.
    Compare(SideArgs),
    /// Which physical effect the model lacks.
    Diagnose(SideArgs),
    /// Where the missing part sits and what it does, drawn from the data alone.
    Localise(localise::Args),
    /// What a campaign would show before it is measured, and what to measure besides.
    Plan(plan::Args),
    /// What an effect is, how it shows, how to check it in the lab.
    Explain(explain::Args),
    /// Add an effect to the model, refit everything, record a revision.
    Add(add::Args),
    /// The error falling, revision by revision.
    History(SideArgs),
    /// Take the last revision back.
    Undo(SideArgs),
    /// Stability lobes.
    Lobes(lobes::Args),
    /// A map of limits and stiffness over the workspace, in shards.
    Sweep(Box<sweep::Args>),
    /// HTML and PNG report of a campaign.
    Report(report::Args),
    /// The campaign as a page in a browser: diagnose, add, undo, and watch the error fall.
    Serve(serve::Args),
    /// A virtual lab: write a campaign with chosen (or random) physics and noise, and its truth.
    Simulate(Box<simulate::Args>),
    /// The source thesis put right: published model, measurement and this model side by side.
    Thesis(thesis::Args),
    /// The whole story on built-in campaigns.
    Demo(demo::Args),
    /// A script that completes commands and options in your shell.
    Completions(shell::CompletionArgs),
    /// The manual page.
    Man(shell::ManArgs),
}

/// A command on the side of the campaign that was asked for; without that on what the campaign holds, both sides as two
/// documents under `structure` and `cutting`.
fn by_domain(
    campaign: &Campaign,
    domain: Option<Domain>,
    structure: impl Fn(&Campaign) -> Result<Outcome>,
    cutting: impl Fn(&Campaign) -> Result<Outcome>,
) -> Result<Outcome> {
    match domain {
        Some(Domain::Structure) => structure(campaign),
        Some(Domain::Cutting) => cutting(campaign),
        None if campaign.cuts.is_empty() => structure(campaign),
        None if campaign.frfs.is_empty() => cutting(campaign),
        None => {
            let (structure, cutting) = (structure(campaign)?, cutting(campaign)?);
            let next_step = &structure.json["next_step"];
            Ok(Outcome {
                json: serde_json::json!({
                    "next_step": next_step,
                    "structure": structure.json,
                    "cutting": cutting.json,
                }),
                text: format!("{}\n{}", structure.text, cutting.text),
            })
        }
    }
}

/// The side whose revisions are meant: the one asked for, else that which the campaign holds (both: the structure).
fn side(campaign: &Campaign, domain: Option<Domain>) -> crate::revision::Domain {
    match domain {
        Some(Domain::Cutting) => crate::revision::Domain::Cutting,
        None if campaign.frfs.is_empty() && !campaign.cuts.is_empty() => crate::revision::Domain::Cutting,
        _ => crate::revision::Domain::Structure,
    }
}

/// A campaign folder.
#[derive(clap::Args)]
pub struct CampaignArg {
    /// The campaign folder (with campaign.toml in it).
    pub dir: PathBuf,
}

/// A campaign folder, and which side of it.
#[derive(clap::Args)]
pub struct SideArgs {
    #[command(flatten)]
    pub campaign: CampaignArg,
    /// Side of the campaign to look at.
    #[arg(long, value_enum)]
    pub domain: Option<Domain>,
}

pub fn run(cli: Cli) -> Result<Outcome> {
    match cli.command {
        Command::Init(args) => init::run(*args, cli.json),
        Command::Inspect(args) => inspect::run(args),
        Command::Cfc(args) => cfc::run(args),
        Command::Modal(args) => modal::run(args),
        Command::Model(args) => model::run(args),
        Command::Calibrate(args) => calibrate::run(args),
        Command::Compare(args) => compare::run(args),
        Command::Localise(args) => localise::run(args),
        Command::Diagnose(args) => diagnose::run(args),
        Command::Plan(args) => plan::run(args),
        Command::Explain(args) => explain::run(args),
        Command::Add(args) => add::run(args),
        Command::History(args) => history::run(args),
        Command::Undo(args) => undo::run(args),
        Command::Lobes(args) => lobes::run(args),
        Command::Sweep(args) => sweep::run(*args),
        Command::Report(args) => report::run(args),
        Command::Serve(args) => serve::run(args, cli.json),
        Command::Simulate(args) => simulate::run(*args),
        Command::Thesis(args) => thesis::run(args),
        Command::Demo(args) => demo::run(args),
        Command::Completions(args) => shell::completions(args),
        Command::Man(args) => shell::man(args),
    }
}
