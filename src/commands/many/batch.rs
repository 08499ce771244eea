//! `lobestone batch`: many campaigns, in shards.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use crate::analysis::Shard;
use crate::analysis::many::batch::{
    BatchStep, Manifest, ManifestEntry, Record, Status, Steps, WarmStart, examine, fingerprint,
};
use crate::commands::Outcome;
use crate::commands::text::{Emphasis, number, wrapped};
use crate::progress::Progress;
use crate::report::stores::batch_folder::BatchFolder;
use crate::report::stores::batch_table::{BatchTable, reserved};
use crate::text::shell_word;
use crate::{InputError, Result};

#[derive(clap::Args)]
#[command(
    after_help = "MANIFEST is a CSV table with a column campaign (folders, from the manifest's own), and as you have them robot, \
                  date and others that are carried along.\n\n\
                  Examples:\n  lobestone batch nights.csv --out results                 # everything\n  \
                  lobestone batch nights.csv --out results --shard 3/20    # one of twenty parts\n  \
                  lobestone batch nights.csv --out results --shard slurm   # of a Slurm array\n  \
                  lobestone fleet results                                  # the worst first\n\
                  What is done is not done again, unless a file, the steps or the program changed. The campaign folders stay as \
                  they are.\nscripts/batch holds a Slurm array script and a Snakemake workflow."
)]
pub struct BatchArgs {
    /// The list of campaigns.
    manifest: PathBuf,
    /// Where results go: campaigns/ (a file each), shards/ (tables).
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// What is done with each, with commas between.
    #[arg(
        long = "do",
        value_enum,
        value_delimiter = ',',
        default_value = "calibrate,diagnose",
        value_name = "STEPS"
    )]
    steps: Vec<BatchStep>,
    /// Only this part of the list, such as 3/20: the third line and every twentieth after it; slurm: as the job array says.
    #[arg(long, value_name = "K/N")]
    shard: Option<String>,
    /// Start each calibration from that of the robot's last campaign above it in this part of the list (list the nights in their
    /// order).
    #[arg(long)]
    warm_start: bool,
    /// Work again on campaigns that failed although nothing changed.
    #[arg(long)]
    retry: bool,
}

pub fn run(args: BatchArgs) -> Result<Outcome> {
    let shard = match args.shard.as_deref() {
        None => Shard { number: 1, of: 1 },
        Some("slurm") => Shard::of_slurm(|name| std::env::var(name).ok())?,
        Some(text) => text.parse()?,
    };
    let manifest = Manifest::read(&args.manifest, reserved())?;
    if args.warm_start && !manifest.columns.iter().any(|c| c == "robot") {
        return Err(
            InputError::new("--warm-start has to know which campaigns are of one robot")
                .file(&args.manifest)
                .remedy("add a column robot that names it")
                .into(),
        );
    }
    let steps = Steps::new(args.steps);
    let folder = BatchFolder::begin(&args.out)?;
    let begun = Instant::now();
    let mine: Vec<&ManifestEntry> = shard
        .rows(manifest.entries.len())
        .map(|i| &manifest.entries[i])
        .collect();
    let progress = Progress::new("campaigns", mine.len());
    let mut skipped = 0;
    let mut work: Vec<(&ManifestEntry, Record)> = Vec::new();
    // Of each robot. Within a shard, which is done line by line: a run that was broken off goes on from the same.
    let mut last: HashMap<String, WarmStart> = HashMap::new();
    for entry in mine {
        let robot = manifest.cell(entry, "robot").filter(|_| args.warm_start);
        let start = robot.and_then(|robot| last.get(robot));
        let fingerprint = fingerprint(&entry.dir, &steps, start);
        let kept = folder.kept(&entry.campaign, &fingerprint);
        let kept = kept.filter(|record| !(args.retry && failure(record).is_some()));
        skipped += usize::from(kept.is_some());
        let record = match kept {
            Some(record) => record,
            None => folder.keep(&examine(entry, &steps, start, &fingerprint))?,
        };
        last.extend(robot.map(str::to_string).zip(WarmStart::of(&record)));
        work.push((entry, record));
        progress.step();
    }
    drop(progress);
    let tables = folder.write_shard(shard, &BatchTable::new(&manifest, &work))?;
    let failures: Vec<(&ManifestEntry, &str)> =
        work.iter().filter_map(|(e, r)| Some((*e, failure(r)?))).collect();
    let seconds = begun.elapsed().as_secs_f64();
    let document = Document {
        manifest: &args.manifest,
        shard: shard.number,
        shards: shard.of,
        command: steps.name(),
        campaigns: work.len(),
        done: work.len() - failures.len(),
        failed: failures.len(),
        skipped,
        failures: failures
            .iter()
            .map(|(entry, error)| CampaignFailed {
                campaign: &entry.campaign,
                error,
            })
            .collect(),
        seconds,
        tables: &tables,
    };
    let mut text = format!(
        "shard {} of {}: {} campaigns, {skipped} of them were there already, {} in {} s\n",
        shard.number,
        shard.of,
        work.len(),
        match failures.len() {
            0 => "none failed".to_string(),
            n => Emphasis::Bad.on(format!("{n} failed")),
        },
        number(seconds, 3)
    );
    for (entry, error) in &failures {
        text += &wrapped(&format!("{}: {error}", entry.campaign), "  ");
    }
    for table in &tables {
        text += &format!("  {}\n", table.display());
    }
    let fleet = format!("`lobestone fleet {}`", shell_word(&args.out));
    let next = match shard.of {
        1 => format!("run {fleet}"),
        _ => format!("when every shard is there, run {fleet}"),
    };
    Ok(Outcome::new(document, text, Some(next)))
}

/// What `batch` did.
#[derive(Serialize)]
struct Document<'a> {
    manifest: &'a Path,
    shard: usize,
    shards: usize,
    command: String,
    campaigns: usize,
    done: usize,
    failed: usize,
    skipped: usize,
    failures: Vec<CampaignFailed<'a>>,
    seconds: f64,
    tables: &'a [PathBuf],
}

#[derive(Serialize)]
struct CampaignFailed<'a> {
    campaign: &'a str,
    error: &'a str,
}

/// Why a campaign, or a side of it, could not be worked on.
fn failure(record: &Record) -> Option<&str> {
    let failed = record.sides.iter().find(|s| s.status == Status::Failed)?;
    Some(failed.error.as_deref().unwrap_or("failed"))
}
