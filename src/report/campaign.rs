//! The report of a campaign: which sections there are, and what the first page says.

use std::path::{Path, PathBuf};

use super::parts::{count, failed, paragraph};
use super::{
    Block, Column, Page, Section, Table, cutting_section, diagnosis_section, error_map_section,
    history_section, lobes_section, modal_section, structure_section, thesis_section, waveform_section,
};
use crate::Result;
use crate::analysis::{CampaignFindings, DiagnosisFindings, StructureFindings, ThesisFindings};
use crate::campaign::Campaign;
use crate::identify::StructureCase;

/// Folder of the tables beside the page.
#[cfg(feature = "parquet")]
const TABLES: &str = "tables";

/// What [`write()`] left on the disk.
#[derive(Debug, Clone)]
pub struct ReportFiles {
    pub html: PathBuf,
    pub images: Vec<PathBuf>,
    /// Empty where the program was built without the feature `parquet`.
    pub tables: Vec<PathBuf>,
}

/// Writes `page` and the tables of `findings` into `folder`. Everything is made before the first file is written.
///
/// # Errors
/// What the file system refuses, naming the file.
pub fn write(page: &Page, findings: &CampaignFindings, folder: &Path) -> Result<ReportFiles> {
    #[cfg(feature = "parquet")]
    let tables = super::tables::tables(findings)?;
    #[cfg(not(feature = "parquet"))]
    let _ = findings;
    let written = page.write(folder)?;
    Ok(ReportFiles {
        html: written.html,
        images: written.images,
        #[cfg(feature = "parquet")]
        tables: super::tables::write(&tables, &folder.join(TABLES))?,
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
        sections,
        ..Page::default()
    }
}

/// A step of the demo as its page tells it: name, what it found, what to type for the same.
pub type StepRow = [String; 3];

/// The demo's second campaign.
pub struct SecondCell<'a> {
    pub campaign: &'a Campaign,
    /// The model without what is missing.
    pub before: &'a StructureFindings,
    pub diagnosis: &'a DiagnosisFindings,
    /// With the revision that added it.
    pub after: &'a StructureCase,
}

/// The demo's page: a campaign that the model explains, one that it does not, and the case study.
pub fn demo_page(
    findings: &CampaignFindings,
    second: &SecondCell,
    thesis: &ThesisFindings,
    steps: &[StepRow],
) -> Page {
    let mut page = page(findings, None);
    page.title = "Lobestone demo".into();
    page.subtitle = "Two simulated campaigns, and the thesis that this program started from".into();
    for section in &mut page.sections {
        section.title = format!("First cell: {}", lower_first(&section.title));
    }
    page.sections.insert(0, demo_story(steps));
    page.sections.extend(second_cell(second));
    page.sections.push(thesis_section::section(thesis));
    page
}

fn demo_story(steps: &[StepRow]) -> Section {
    let intro = "Both campaigns are simulated, so that what the program finds can be checked against what was put in. The \
                 first cell is a robot whose joints are up to 27 % off its data sheet, with noise on the FRFs, and a \
                 series of milling cuts with a drifting dynamometer: the model can explain all of it. In the second cell \
                 something was added that the model does not have, and the program is not told what: it finds the missing \
                 physics, adds it to the model, and the error falls.";
    Section {
        id: "story".into(),
        title: "The story".into(),
        lead:
            "Raw files in; calibrated model, cutting coefficients, stability lobes and an honest error out."
                .into(),
        blocks: vec![
            paragraph(intro),
            Block::Table(Table {
                caption: "What each step found, and the command that does the same on files of your own"
                    .into(),
                columns: vec![
                    Column::text("step"),
                    Column::text("found"),
                    Column::text("command"),
                ],
                rows: steps.iter().map(|row| row.to_vec()).collect(),
                notes: vec![],
            }),
        ],
    }
}

fn lower_first(title: &str) -> String {
    let mut letters = title.chars();
    letters
        .next()
        .map_or(String::new(), |c| c.to_lowercase().chain(letters).collect())
}

fn second_cell(cell: &SecondCell) -> Vec<Section> {
    let mut frfs = structure_section::frf_section(cell.before);
    frfs.blocks
        .insert(0, paragraph(structure_section::summary(cell.before)));
    let mut sections = vec![
        frfs,
        error_map_section::map_section(cell.before),
        diagnosis_section::section(cell.campaign, cell.diagnosis),
    ];
    sections.extend(history_section::section(cell.after));
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
    super::parts::listed(&parts)
}

/// Every part that the campaign holds, in the order of the story.
fn parts(findings: &CampaignFindings) -> Vec<Section> {
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
    match &findings.lobes {
        Some(Ok(lobes)) => sections.push(lobes_section::section(lobes, findings.structure())),
        Some(Err(error)) => sections.push(failed("lobes", "Stability lobes", error)),
        None => {}
    }
    sections
}

fn summary(findings: &CampaignFindings) -> Section {
    let mistakes = findings
        .setup
        .iter()
        .map(|f| Block::Warning(format!("Setup: {}", f.sentence())));
    let mut blocks: Vec<Block> = mistakes.collect();
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
    blocks.extend(warnings(findings).into_iter().map(Block::Warning));
    Section {
        id: "summary".into(),
        title: "Summary".into(),
        lead: String::new(),
        blocks,
    }
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
