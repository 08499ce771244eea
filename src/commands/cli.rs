//! Subcommands and options of the program.

use clap::{CommandFactory, Parser, Subcommand, ValueEnum};

use super::campaign_args::SideArgs;
use super::outcome::Outcome;
use crate::Result;
use crate::commands::begin::{demo, init, inspect, serve};
use crate::commands::find::{calibrate, compare, diagnose, explain, localise, plan};
use crate::commands::grow::{add, history, model, undo};
use crate::commands::many::{batch, fleet};
use crate::commands::measure::{cfc, lobes, modal, sweep};
use crate::commands::write::{export, report, schema, shell, simulate, thesis};

/// The commands in groups, with an example each. Part of the template, whose lines are left as they are: an example that is
/// broken in two cannot be pasted.
const TEMPLATE: &str = "\
{about}

{usage-heading} {usage}

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
  batch        Calibrate and diagnose a list of campaigns        lobestone batch list.csv --out all
  fleet        Robots over time, the worst first                 lobestone fleet results

Write and try out
  report       HTML and PNG report of a campaign                 lobestone report cell7
  export       FRFs, modes, lobes, records for other programs    lobestone export cell7 --out data
  simulate     A virtual lab with chosen (or random) physics     lobestone simulate --out lab
  thesis       The source thesis put right                       lobestone thesis
  schema       The form of campaign.toml, for editors            lobestone schema campaign
  completions  Completions for your shell                        lobestone completions bash
  man          The manual page                                   lobestone man

Options:
{options}

`lobestone COMMAND --help` says more of a command.";

/// When colours are used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum ColorChoice {
    /// On a terminal, unless NO_COLOR is set.
    Auto,
    Always,
    Never,
}

/// The program's command line, as clap reads it.
#[derive(Parser)]
#[command(name = "lobestone", version, about, long_about = None, help_template = TEMPLATE)]
pub struct Cli {
    /// Print one JSON document on stdout and nothing else there.
    #[arg(long, global = true)]
    pub(super) json: bool,
    /// When to use colours.
    #[arg(long, global = true, value_enum, default_value_t = ColorChoice::Auto, value_name = "WHEN")]
    pub(super) color: ColorChoice,
    /// Only the answer: no progress, no next step.
    #[arg(short, long, global = true)]
    pub(super) quiet: bool,
    /// Threads to work with [default: one a processor].
    #[arg(short, long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(super) jobs: Option<u16>,
    #[command(subcommand)]
    pub(super) command: Command,
}

#[derive(Subcommand)]
pub(super) enum Command {
    /// Make a campaign of a folder of measurement files.
    Init(Box<init::InitArgs>),
    /// Say what measurement files are: format, channels, units, quality.
    Inspect(inspect::InspectArgs),
    /// Cutting force coefficients from dynamometer records.
    Cfc(cfc::CfcArgs),
    /// Modal parameters from FRFs.
    Modal(modal::ModalArgs),
    /// What the robot model says, before and after calibration.
    Model(model::ModelArgs),
    /// Tune the model to the measured FRFs.
    Calibrate(calibrate::CalibrateArgs),
    /// Model against measurement: where it fails.
    Compare(SideArgs),
    /// Which physical effect the model lacks.
    Diagnose(SideArgs),
    /// Where the missing part sits and what it does, drawn from the data alone.
    Localise(localise::LocaliseArgs),
    /// What a campaign would show before it is measured, and what to measure besides.
    Plan(plan::PlanArgs),
    /// What an effect is, how it shows, how to check it in the lab.
    Explain(explain::ExplainArgs),
    /// Add an effect to the model, refit everything, record a revision.
    Add(add::AddArgs),
    /// The error falling, revision by revision.
    History(SideArgs),
    /// Take the last revision back.
    Undo(SideArgs),
    /// Stability lobes.
    Lobes(lobes::LobesArgs),
    /// A map of limits and stiffness over the workspace, in shards.
    Sweep(Box<sweep::SweepArgs>),
    /// Calibrate and diagnose a list of campaigns, in shards.
    Batch(batch::BatchArgs),
    /// What a batch found, robot by robot over time: new verdicts, values that moved.
    Fleet(fleet::FleetArgs),
    /// HTML and PNG report of a campaign.
    Report(report::ReportArgs),
    /// FRFs, model, modes, lobes, coefficients and records as files for other programs.
    Export(export::ExportArgs),
    /// The campaign as a page in a browser: diagnose, add, undo, and watch the error fall.
    Serve(serve::ServeArgs),
    /// A virtual lab: write a campaign with chosen (or random) physics and noise, and its truth.
    Simulate(Box<simulate::SimulateArgs>),
    /// The source thesis put right: published model, measurement and this model side by side.
    Thesis(thesis::ThesisArgs),
    /// The whole story on built-in campaigns.
    Demo(demo::DemoArgs),
    /// The form of campaign.toml or of a robot file as JSON Schema, for editors that complete and check.
    Schema(schema::SchemaArgs),
    /// A script that completes commands and options in your shell.
    Completions(shell::CompletionArgs),
    /// The manual page.
    Man(shell::ManArgs),
}

/// Does what the command line says and hands back the answer.
///
/// # Errors
/// What the command reports: bad input, a file that cannot be read or written, a fit that fails.
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
        Command::Export(args) => export::run(args),
        Command::Serve(args) => serve::run(args, cli.json),
        Command::Simulate(args) => simulate::run(*args),
        Command::Thesis(args) => thesis::run(args),
        Command::Demo(args) => demo::run(args),
        Command::Schema(args) => schema::run(args),
        Command::Completions(args) => shell::completions(args, Cli::command()),
        Command::Man(args) => shell::man(args, Cli::command()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every command that a help text shows, lines that go on put together.
    fn examples() -> Vec<String> {
        let help = |c: &clap::Command| c.get_after_help().map(ToString::to_string).unwrap_or_default();
        let mut lines = Vec::new();
        for text in Cli::command().get_subcommands().map(help) {
            let shown: Vec<&str> = text.lines().filter(|l| l.starts_with("  ")).collect();
            for line in &shown {
                assert!(
                    line.chars().count() <= 80,
                    "broken in two on a terminal of 80 columns: {line}"
                );
            }
            lines.extend(shown.join("\n").replace("\\\n", "").lines().map(String::from));
        }
        let of_groups = TEMPLATE.lines().filter(|l| l.starts_with("  "));
        lines.extend(of_groups.filter_map(|l| Some(l[l.find("lobestone ")?..].to_string())));
        lines.retain(|l| l.trim_start().starts_with("lobestone "));
        lines
    }

    #[test]
    fn examples_can_be_pasted() {
        let examples = examples();
        assert!(examples.len() > 40, "{examples:?}");
        for example in examples {
            let command = example.split(['#', '|', '>']).next().unwrap_or_default();
            let read = Cli::try_parse_from(command.split_whitespace());
            assert!(
                read.is_ok(),
                "{example}: {}",
                read.err().map(|e| e.to_string()).unwrap_or_default()
            );
        }
    }
}
