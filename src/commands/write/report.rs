use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::analysis::CampaignFindings;
use crate::campaign::Campaign;
use crate::commands::next_step::Guide;
use crate::commands::text::warnings;
use crate::commands::{CampaignArg, Outcome};
use crate::discrepancy::EffectCandidate;
use crate::report::campaign::{self, ReportFiles};
use crate::thesis::ThesisFindings;
use crate::{Error, Result};

#[derive(clap::Args)]
pub struct ReportArgs {
    #[command(flatten)]
    campaign: CampaignArg,
    /// Where to write [default: the folder report in the campaign's folder].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Add the case study of the IRB 6640 (as the command thesis).
    #[arg(long)]
    thesis: bool,
    /// Leave out which physics is missing (what `diagnose` does takes most of the time).
    #[arg(long)]
    no_diagnosis: bool,
    /// Images only, no figures for the mouse: a smaller file without scripts.
    #[arg(long = "static")]
    without_scripts: bool,
    /// Write the report although parts of it are missing because their files cannot be used.
    #[arg(long)]
    partial: bool,
}

pub fn run(args: ReportArgs) -> Result<Outcome> {
    let campaign = Campaign::load(&args.campaign.dir)?;
    let findings = CampaignFindings::run(&campaign, !args.no_diagnosis)?;
    let unusable = findings.input_errors();
    if !args.partial && !unusable.is_empty() {
        // A report that lost a part must not take the place of a whole one without anybody noticing.
        return Err(Error::computation(format!(
            "{}\nNo report was written, and an earlier one is as it was. To write it without what failed: lobestone report \
             {} --partial",
            unusable.join("\n"),
            campaign.dir.display()
        )));
    }
    let thesis = args.thesis.then(ThesisFindings::run).transpose()?;
    let folder = args.out.unwrap_or_else(|| campaign.dir.join("report"));
    let mut page = campaign::page(&findings, thesis.as_ref());
    page.without_scripts = args.without_scripts;
    let files = campaign::write(&page, &findings, &folder)?;
    let missing = findings.errors();
    let untold: Vec<String> = missing
        .iter()
        .map(|e| format!("a part is missing from the report: {e}"))
        .collect();
    let next = Guide::structure(&campaign).reported(&files.html, missing_effect(&findings).as_deref());
    Ok(Outcome::new(
        Document {
            files: FilesOfReport::of(&files),
            missing: &missing,
        },
        describe(&files) + &warnings(&untold),
        Some(next),
    ))
}

/// `effect@site` that the report says is missing.
fn missing_effect(findings: &CampaignFindings<'_>) -> Option<String> {
    let structure = findings.diagnosis.as_ref().and_then(|d| d.as_ref().ok());
    let cutting = findings.cutting_diagnosis.as_ref().and_then(|d| d.as_ref().ok());
    let of_structure = structure.and_then(|d| d.diagnosis.winner().map(EffectCandidate::label));
    of_structure.or_else(|| cutting.and_then(|d| d.diagnosis.winner().map(EffectCandidate::label)))
}

/// What `report` wrote.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    files: FilesOfReport<'a>,
    missing: &'a [String],
}

/// The page and what belongs to it.
#[derive(Serialize)]
pub(crate) struct FilesOfReport<'a> {
    html: &'a Path,
    images: &'a [PathBuf],
    /// Where they were built in.
    #[serde(skip_serializing_if = "Option::is_none")]
    tables: Option<&'a [PathBuf]>,
}

impl<'a> FilesOfReport<'a> {
    pub fn of(files: &'a ReportFiles) -> Self {
        FilesOfReport {
            html: &files.html,
            images: &files.images,
            tables: cfg!(feature = "parquet").then_some(&files.tables),
        }
    }
}

fn describe(files: &ReportFiles) -> String {
    let mut text = format!(
        "report   {}\nfigures  {} PNG files next to it\n",
        files.html.display(),
        files.images.len()
    );
    if let Some(folder) = files.tables.first().and_then(|t| t.parent()) {
        text += &format!(
            "tables   {} Parquet files in {}\n",
            files.tables.len(),
            folder.display()
        );
    }
    text
}
