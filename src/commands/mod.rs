//! The command line: one file a subcommand, each reads its arguments, calls the library and hands back
//! an [`Outcome`]. Nothing is computed here.

use std::path::PathBuf;

use clap::{Parser, Subcommand, ValueEnum};

use crate::Result;
use crate::campaign::Campaign;

mod add;
mod batch;
mod bench_worker;
mod calibrate;
mod cfc;
mod compare;
mod demo;
mod diagnose;
mod entrance;
mod explain;
mod fleet;
mod history;
mod hole;
mod init;
mod init_robot;
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
mod printed;
mod program;
mod progress_bar;
mod range;
mod report;
mod schema;
mod serve;
mod shell;
mod simulate;
mod sweep;
mod text;
mod thesis;
mod undo;
mod workbench;

/// What a command has to say: the document of docs/json.md, and the same for a person.
pub struct Outcome {
    /// Printed with `--json`; null where there is nothing to say (any more).
    pub json: serde_json::Value,
    /// Printed without; may be coloured.
    pub text: String,
    /// What failed although there is something to say: told on stderr, and the status is 1.
    pub failed: Option<crate::Error>,
}

impl Outcome {
    /// With the next sensible step: `next_step` in the document, the last line of the text.
    pub fn new(mut json: serde_json::Value, mut text: String, next_step: Option<String>) -> Self {
        if let Some(step) = next_step.as_ref().filter(|_| !crate::progress::is_silent()) {
            text += &format!("\n{} {step}\n", text::Emphasis::Strong.on("Next:"));
        }
        json["next_step"] = next_step.into();
        Outcome {
            json,
            text,
            failed: None,
        }
    }
}

pub use printed::{shown, shown_json};
pub use program::{program, started_by};

/// What an error message begins with on a terminal.
pub fn error_label() -> String {
    text::Emphasis::Bad.on("error:")
}

/// The commands in groups, with an example each.
const GROUPS: &str = "\
Begin
  demo         The whole story on built-in campaigns             lobestone demo
  inspect      What measurement files are                        lobestone inspect cell7/frf
  init         Make a campaign of a folder of measurements       lobestone init cell7
  serve        Everything as a page in a browser                 lobestone serve --open

Find what the model lacks
  calibrate    Tune the model to the measured FRFs               lobestone calibrate cell7
  compare      Model against measurement: where it fails         lobestone compare cell7
  diagnose     Which physical effect the model lacks             lobestone diagnose cell7
  localise     Where the missing part sits, from the data alone  lobestone localise cell7
  explain      What an effect is, how to check it in the lab     lobestone explain payload
  plan         What a campaign would show, before measuring      lobestone plan cell7

Grow the model
  add          Add an effect, fit everything anew                lobestone add cell7 payload
  undo         Take the last revision back                       lobestone undo cell7
  history      The error falling, revision by revision           lobestone history cell7
  model        What the robot model says                         lobestone model cell7

Measure and cut
  modal        Modal parameters from FRFs                        lobestone modal frf/*.uff
  cfc          Cutting force coefficients from records           lobestone cfc cell7
  lobes        Stability lobes                                   lobestone lobes cell7
  sweep        Limits and stiffness over the workspace           lobestone sweep cell7 --out map

Many campaigns
  batch        Calibrate and diagnose a list of campaigns        lobestone batch nights.csv --out results
  fleet        Robots over time, the worst first                 lobestone fleet results

Write and try out
  report       HTML and PNG report of a campaign                 lobestone report cell7
  simulate     A virtual lab with chosen (or random) physics     lobestone simulate lab --random 7
  thesis       The source thesis put right                       lobestone thesis
  schema       The form of campaign.toml, for editors            lobestone schema campaign
  completions  Completions for your shell                        lobestone completions bash
  man          The manual page                                   lobestone man
";

const TEMPLATE: &str = "{about}\n\n{usage-heading} {usage}\n\n{after-help}\n\nOptions:\n{options}\n\n\
    `lobestone COMMAND --help` says more of a command.";

/// When colours are used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Color {
    /// On a terminal, unless NO_COLOR is set.
    Auto,
    Always,
    Never,
}

#[derive(Parser)]
#[command(name = "lobestone", version, about, long_about = None, help_template = TEMPLATE, after_help = GROUPS)]
pub struct Cli {
    /// Print one JSON document on stdout and nothing else there.
    #[arg(long, global = true)]
    pub json: bool,
    /// When to use colours.
    #[arg(long, global = true, value_enum, default_value_t = Color::Auto, value_name = "WHEN")]
    pub color: Color,
    /// Only the answer: no progress, no next step.
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Threads to work with [default: one a processor].
    #[arg(short, long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
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
    /// Calibrate and diagnose a list of campaigns, in shards.
    Batch(batch::Args),
    /// What a batch found, robot by robot over time: new verdicts, values that moved.
    Fleet(fleet::Args),
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
    /// The form of campaign.toml or of a robot file as JSON Schema, for editors that complete and check.
    Schema(schema::Args),
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
                failed: None,
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
    if let Some(jobs) = cli.jobs {
        rayon::ThreadPoolBuilder::new()
            .num_threads(jobs.into())
            .build_global()
            .map_err(|e| crate::Error::computation(format!("{jobs} threads cannot be had: {e}")))?;
    }
    if cli.quiet {
        crate::progress::silence();
    }
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
        Command::Batch(args) => batch::run(args),
        Command::Fleet(args) => fleet::run(args),
        Command::Report(args) => report::run(args),
        Command::Serve(args) => serve::run(args, cli.json),
        Command::Simulate(args) => simulate::run(*args),
        Command::Thesis(args) => thesis::run(args),
        Command::Demo(args) => demo::run(args),
        Command::Schema(args) => schema::run(args),
        Command::Completions(args) => shell::completions(args),
        Command::Man(args) => shell::man(args),
    }
}
