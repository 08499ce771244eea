//! The report of a campaign: which sections there are, and what the first page says.

use std::path::{Path, PathBuf};

use super::parts::{failed, paragraph};
use super::words::count;
use super::{Block, Page, ReportSection, ReportTable, TableColumn, VerdictCard, verdict_card};
use crate::Result;
use crate::analysis::{CampaignFindings, DiagnosisFindings, StructureFindings, Workbench};
use crate::campaign::Campaign;
use crate::discrepancy::setup::{SetupCheck, SetupFinding};
use crate::identify::StructureCase;
use crate::report::parts::made;
use crate::report::sections::{
    cutting_section, diagnosis_section, error_map_section, history_section, lobes_section, modal_section,
    structure_section, thesis_section, waveform_section,
};
use crate::revision::Side;
use crate::text::listed;
use crate::thesis::ThesisFindings;

/// Folder of the tables next to the page.
#[cfg(feature = "parquet")]
const TABLES: &str = "tables";

/// What [`write()`] left on the disk.
#[derive(Debug, Clone)]
pub(crate) struct ReportFiles {
    pub html: PathBuf,
    pub images: Vec<PathBuf>,
    /// Empty where the program was built without the feature `parquet`.
    pub tables: Vec<PathBuf>,
}

/// Writes `page` and the tables of `findings` into `folder`. Everything is made before the first file is written.
///
/// # Errors
/// What the file system refuses, naming the file.
pub(crate) fn write(page: &Page, findings: &CampaignFindings, folder: &Path) -> Result<ReportFiles> {
    #[cfg(feature = "parquet")]
    let tables = crate::report::stores::tables::tables(findings)?;
    #[cfg(not(feature = "parquet"))]
    let _ = findings;
    let written = page.write(folder)?;
    Ok(ReportFiles {
        html: written.html,
        images: written.images,
        #[cfg(feature = "parquet")]
        tables: crate::report::stores::tables::write(&tables, &folder.join(TABLES))?,
        #[cfg(not(feature = "parquet"))]
        tables: Vec::new(),
    })
}

/// The report on `findings`, with the case study at its end where wanted.
pub fn page(findings: &CampaignFindings, thesis: Option<&ThesisFindings>) -> Page {
    let mut sections = vec![summary(findings)];
    sections.extend(parts(findings));
    sections.extend(thesis.map(thesis_section::section));
    Page {
        title: findings.campaign.name.clone(),
        subtitle: format!("Lobestone report on {}", contents(findings)),
        origin: origin(&findings.bench),
        cards: cards(findings),
        sections,
        ..Page::default()
    }
}

/// Who measured and when, when the page was made, and which data it is of.
fn origin(campaign: &Workbench) -> Vec<(String, String)> {
    let entry = |name: &str, value: String| (name.to_string(), value);
    let mut origin = Vec::new();
    origin.extend(campaign.date.clone().map(|date| entry("measured", date)));
    origin.extend(campaign.operator.clone().map(|who| entry("by", who)));
    origin.extend(made());
    for (there, name, domain) in [
        (!campaign.frfs.is_empty(), "FRF data", Side::Structure),
        (!campaign.cuts.is_empty(), "force data", Side::Cutting),
    ] {
        let hash = there.then(|| campaign.fingerprint(domain).ok()).flatten();
        origin.extend(hash.map(|hash| entry(name, hash)));
    }
    origin
}

/// The answers, one a side.
fn cards(findings: &CampaignFindings) -> Vec<VerdictCard> {
    let campaign = findings.campaign;
    let (structure, cutting) = (findings.structure(), findings.cutting_diagnosis());
    let own = |check: Option<&SetupCheck>| -> Vec<SetupFinding> {
        let all = check.into_iter().flat_map(|c| c.still_there());
        all.filter(|f| f.is_likely()).cloned().collect()
    };
    // Without diagnoses nobody knows which side a mistake belongs to: it stands on the first card.
    let mut left: Vec<SetupFinding> = findings.likely_mistakes().cloned().collect();
    let mut of_side = |check: Option<&SetupCheck>| match check {
        Some(check) => {
            let own = own(Some(check));
            left.retain(|f| !own.contains(f));
            own
        }
        None => std::mem::take(&mut left),
    };
    let mut cards = Vec::new();
    if structure.is_some() || findings.diagnosis().is_some() {
        let files = of_side(findings.diagnosis().map(|d| &d.setup));
        cards.extend(verdict_card::structure(
            campaign,
            &files,
            structure,
            findings.diagnosis(),
        ));
    }
    if let Some(found) = cutting {
        cards.push(verdict_card::cutting(
            campaign,
            &of_side(Some(&found.setup)),
            found,
        ));
    } else if let Some(result) = findings.cutting() {
        cards.push(verdict_card::coefficients(campaign, result, &of_side(None)));
    }
    cards
}

/// A step of the demo as its page tells it: name, what it found, what to type for the same.
pub(crate) type StepRow = [String; 3];

/// The demo's second campaign.
pub(crate) struct SecondCell<'a> {
    pub campaign: &'a Campaign,
    /// The model without what is missing.
    pub before: &'a StructureFindings,
    pub diagnosis: &'a DiagnosisFindings,
    /// With the revision that added it.
    pub after: &'a StructureCase,
}

/// The demo's page: a campaign that the model explains, and one that it does not.
pub(crate) fn demo_page(findings: &CampaignFindings, second: &SecondCell, steps: &[StepRow]) -> Page {
    // Most of the work is drawing figures.
    let (mut page, second_sections) = rayon::join(|| page(findings, None), || second_cell(second));
    page.title = "Lobestone demo".into();
    page.subtitle = "Two simulated robot cells".into();
    page.opening = "Something was hidden in one of two simulated cells, and the program was not told what. This is what it \
                    found:"
        .into();
    page.cards = verdict_card::structure(second.campaign, &[], None, Some(second.diagnosis))
        .into_iter()
        .collect();
    for section in &mut page.sections {
        section.title = format!("First cell: {}", lower_first(&section.title));
    }
    let first = std::mem::take(&mut page.sections);
    page.sections.push(demo_story(steps));
    page.sections.extend(second_sections);
    page.sections.extend(first);
    for section in &mut page.sections {
        section.blocks.retain(|block| !is_further_frf(block));
    }
    page.open_sections = Some(1);
    page
}

/// The demo's paper shows the worst and the best FRF of each cell; the second and the third worst are, like all others, in the
/// explorer.
fn is_further_frf(block: &Block) -> bool {
    let further = ["frf-worst-2", "frf-worst-3"];
    matches!(block, Block::Figure(figure) if further.iter().any(|name| figure.file_name.ends_with(name)))
}

fn demo_story(steps: &[StepRow]) -> ReportSection {
    let intro = "The first cell is a robot whose joints are up to 27 % off its data sheet, and a series of milling cuts with a \
                 drifting dynamometer: the model can explain all of it. The second has something that the model does not.";
    ReportSection {
        id: "story".into(),
        title: "How it got there, and how to do the same with files of your own".into(),
        blocks: vec![
            paragraph(intro),
            Block::Table(ReportTable {
                caption: "What each step found, and its command".into(),
                columns: vec![
                    TableColumn::text("step"),
                    TableColumn::text("found"),
                    TableColumn::text("command"),
                ],
                rows: steps.iter().map(|row| row.to_vec()).collect(),
                notes: vec![],
            }),
        ],
        ..ReportSection::default()
    }
}

fn lower_first(title: &str) -> String {
    let mut letters = title.chars();
    letters
        .next()
        .map_or(String::new(), |c| c.to_lowercase().chain(letters).collect())
}

fn second_cell(cell: &SecondCell) -> Vec<ReportSection> {
    let mut frfs = structure_section::frf_section(cell.before);
    frfs.blocks
        .insert(0, paragraph(structure_section::summary(cell.before)));
    let mut sections = vec![
        frfs,
        error_map_section::map_section(cell.before),
        diagnosis_section::section(cell.campaign, cell.diagnosis),
    ];
    sections.extend(history_section::section(&cell.after.revisions, &[]));
    for section in &mut sections {
        section.title = format!("Second cell: {}", lower_first(&section.title));
    }
    for section in &mut sections {
        section.id = format!("second-{}", section.id);
        for block in &mut section.blocks {
            if let Block::Figure(figure) = block {
                figure.file_name = format!("second-{}", figure.file_name);
            }
        }
    }
    sections
}

fn contents(findings: &CampaignFindings) -> String {
    let campaign = findings.campaign;
    let mut parts = Vec::new();
    if !campaign.frfs.is_empty() {
        parts.push(count(campaign.frfs.len(), "FRF file", "FRF files"));
    }
    if !campaign.cuts.is_empty() {
        parts.push(count(campaign.cuts.len(), "cut", "cuts"));
    }
    if parts.is_empty() {
        parts.push("a model alone, nothing measured".into());
    }
    listed(&parts)
}

/// Every part that the campaign holds, in the order of the story.
fn parts(findings: &CampaignFindings) -> Vec<ReportSection> {
    let mut sections = Vec::new();
    match &findings.structure {
        Some(Ok(structure)) => sections.extend(structure_section::sections(structure)),
        Some(Err(error)) => sections.push(failed("frfs", "Model against measured FRFs", error)),
        None => {}
    }
    match &findings.diagnosis {
        Some(Ok(diagnosis)) => sections.push(diagnosis_section::section(findings.campaign, diagnosis)),
        Some(Err(error)) => sections.push(failed(diagnosis_section::ID, diagnosis_section::TITLE, error)),
        None => {}
    }
    match &findings.postures {
        Some(Ok(postures)) => sections.push(structure_section::posture_section(postures)),
        Some(Err(error)) => sections.push(failed("postures", "The robot at the postures", error)),
        None => {}
    }
    match &findings.modal {
        Some(Ok(modal)) => sections.push(modal_section::section(modal, &findings.mode_shapes)),
        Some(Err(error)) => sections.push(failed("modes", "Modes of the measured FRFs", error)),
        None => {}
    }
    match &findings.cutting {
        Some(Ok(result)) => sections.extend(cutting_section::sections(findings.campaign, result)),
        Some(Err(error)) => sections.push(failed("records", "Force records", error)),
        None => {}
    }
    match &findings.cutting_diagnosis {
        Some(Ok(found)) => sections.extend(waveform_section::sections(findings.campaign, found)),
        Some(Err(error)) => sections.push(failed(waveform_section::ID, waveform_section::TITLE, error)),
        None => {}
    }
    sections.extend(history_section::cutting_section(&findings.cutting_revisions));
    match &findings.lobes {
        Some(Ok(lobes)) => sections.push(lobes_section::section(lobes, findings.structure())),
        Some(Err(error)) => sections.push(failed("lobes", "Stability lobes", error)),
        None => {}
    }
    sections
}

fn summary(findings: &CampaignFindings) -> ReportSection {
    let mistakes = findings
        .likely_mistakes()
        .map(|f| Block::Warning(format!("Setup: {}", f.sentence())));
    let mut blocks: Vec<Block> = mistakes.collect();
    let of_files = noticed_of_files(findings);
    blocks.extend(of_files.iter().map(|w| Block::Warning(format!("Files: {w}"))));
    blocks.extend(
        findings
            .structure()
            .map(|s| paragraph(structure_section::summary(s))),
    );
    blocks.extend(
        findings
            .diagnosis()
            .map(|d| paragraph(diagnosis_section::summary(d))),
    );
    blocks.extend(findings.modal().and_then(modal_section::summary).map(paragraph));
    blocks.extend(findings.cutting().map(|c| paragraph(cutting_section::summary(c))));
    blocks.extend(
        findings
            .cutting_diagnosis()
            .map(|d| paragraph(waveform_section::summary(d))),
    );
    blocks.extend(findings.lobes().map(|l| paragraph(lobes_section::summary(l))));
    if blocks.is_empty() {
        blocks.push(paragraph(
            "Nothing measured is in this report: it says what the robot file says.",
        ));
    }
    let lost = findings
        .errors()
        .into_iter()
        .map(|e| Block::Warning(format!("A part is missing from this report. {e}")));
    blocks.extend(lost);
    let of_fits = warnings(findings).into_iter().filter(|w| !of_files.contains(w));
    blocks.extend(of_fits.map(Block::Warning));
    ReportSection {
        id: "summary".into(),
        title: "Summary".into(),
        blocks,
        ..ReportSection::default()
    }
}

/// What was guessed and noticed of the files: whoever reads on should know it first.
fn noticed_of_files(findings: &CampaignFindings) -> Vec<String> {
    let of_frfs = findings
        .structure()
        .map_or(&[][..], |s| &s.analysis.case.warnings);
    let of_cuts = findings
        .cutting()
        .and_then(|_| findings.campaign.guesses.of_cutting_told());
    of_frfs.iter().cloned().chain(of_cuts).collect()
}

/// What was noticed while reading and fitting; the sections on modes and lobes bear their own.
fn warnings(findings: &CampaignFindings) -> Vec<String> {
    let structure = findings.structure().map(|s| &s.analysis.warnings);
    let cutting = findings.cutting().map(|c| &c.warnings);
    let mut warnings: Vec<String> = Vec::new();
    for warning in structure.into_iter().chain(cutting).flatten() {
        if !warnings.contains(warning) {
            warnings.push(warning.clone());
        }
    }
    warnings
}
