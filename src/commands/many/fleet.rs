//! `lobestone fleet`: what a batch found, robot by robot over time.

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::Result;
use crate::analysis::many::fleet::{Attention, Fleet, Night, RobotHistory};
use crate::commands::Outcome;
use crate::commands::text::{Emphasis, number, percent, table, warnings, wrapped};
use crate::report::fleet_page;
use crate::report::stores::batch_folder::{self, BatchFolder};

#[derive(clap::Args)]
#[command(after_help = "Example:\n  lobestone fleet results\n\
                  It writes fleet/report.html (with images next to it) and fleet/all.csv, the tables of all shards as one.")]
pub struct FleetArgs {
    /// The folder of `lobestone batch --out`.
    results: PathBuf,
    /// Where page and table are written [default: the folder fleet in the results].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Robots shown to a person; all are in the JSON and on the page.
const SHOWN: usize = 20;
/// Missing shards that are named.
const NAMED: usize = 12;

pub fn run(args: FleetArgs) -> Result<Outcome> {
    let shards = BatchFolder::shards(&args.results)?;
    let rows = shards.table.fleet_rows();
    let failed = rows.iter().filter(|r| r.error.is_some()).count();
    let counts = [rows.len(), failed];
    let fleet = Fleet::new(rows);
    let missing: Vec<String> = shards
        .missing
        .iter()
        .map(|s| format!("{}/{}", s.number, s.of))
        .collect();
    let mut remarks = fleet.warnings.clone();
    if !missing.is_empty() {
        let more = missing.len().saturating_sub(NAMED);
        let names = missing[..missing.len().min(NAMED)].join(", ");
        let more = if more > 0 {
            format!(" and {more} more")
        } else {
            String::new()
        };
        remarks.insert(
            0,
            format!(
                "{} of {} shards are missing: {names}{more}",
                missing.len(),
                shards.of
            ),
        );
    }
    let folder = args.out.unwrap_or_else(|| args.results.join("fleet"));
    let page = fleet_page::page(&fleet, "Fleet", counts, &remarks);
    let written = page.write(&folder)?;
    let tables = batch_folder::write(&shards.table, |ending| folder.join(format!("all.{ending}")))?;
    let document = Document {
        rows: counts[0],
        failed,
        shards: shards.of,
        missing_shards: &missing,
        robots: fleet.robots.iter().map(RobotTold::of).collect(),
        limits: fleet_page::ABOUT_LIMITS,
        html: &written.html,
        images: &written.images,
        tables: &tables,
        warnings: &remarks,
    };
    let mut text = overview(&fleet) + &reasons(&fleet) + &warnings(&remarks);
    text += &format!("\npage     {}\n", written.html.display());
    for table in &tables {
        text += &format!("table    {}\n", table.display());
    }
    Ok(Outcome::new(document, text, None))
}

/// What `fleet` found.
#[derive(Serialize)]
struct Document<'a> {
    rows: usize,
    failed: usize,
    shards: usize,
    missing_shards: &'a [String],
    robots: Vec<RobotTold<'a>>,
    limits: &'static str,
    html: &'a Path,
    images: &'a [PathBuf],
    tables: &'a [PathBuf],
    warnings: &'a [String],
}

#[derive(Serialize)]
struct RobotTold<'a> {
    #[serde(flatten)]
    history: &'a RobotHistory,
    last: Option<&'a Night>,
}

impl<'a> RobotTold<'a> {
    fn of(history: &'a RobotHistory) -> Self {
        RobotTold {
            history,
            last: history.last(),
        }
    }
}

fn overview(fleet: &Fleet) -> String {
    let rows: Vec<Vec<String>> = fleet
        .robots
        .iter()
        .take(SHOWN)
        .map(|robot| {
            let last = robot.last();
            let verdict = last.and_then(|n| n.verdict.as_ref());
            let attention = robot.attention.name();
            vec![
                robot.robot.clone(),
                robot.domain.clone(),
                last.map_or(String::new(), |n| {
                    n.date.clone().unwrap_or_else(|| n.campaign.clone())
                }),
                verdict.map_or("–".into(), |v| v.words()),
                last.and_then(|n| n.nrms).map_or("–".into(), percent),
                last.and_then(|n| n.noise).map_or("–".into(), percent),
                match robot.charts.iter().any(|c| c.last_sigmas.is_some()) {
                    true => number(robot.farthest(), 2),
                    false => "–".into(),
                },
                match robot.attention {
                    Attention::None => Emphasis::Good.on(attention),
                    Attention::Known => Emphasis::Doubtful.on(attention),
                    _ => Emphasis::Bad.on(attention),
                },
            ]
        })
        .collect();
    let mut text = table(
        &[
            "robot",
            "side",
            "last",
            "missing",
            "error",
            "noise",
            "farthest σ",
            "look at",
        ],
        &rows,
    );
    let more = fleet.robots.len().saturating_sub(SHOWN);
    if more > 0 {
        text += &format!("  and {more} more\n");
    }
    text
}

fn reasons(fleet: &Fleet) -> String {
    let asking = fleet.robots.iter().filter(|r| r.attention > Attention::Known);
    let mut text = String::new();
    for robot in asking.take(SHOWN) {
        text += &format!("\n{}\n", Emphasis::Strong.on(&robot.robot));
        for reason in &robot.reasons {
            text += &wrapped(reason, "  ");
        }
    }
    text
}
