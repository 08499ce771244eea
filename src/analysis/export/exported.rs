//! The parts of a campaign that can be exported, each in the forms that it has.

use super::cutting_tables::{coefficient_table, record_files};
use super::frf_tables::{frf_file, model_files};
use super::lobe_table::lobe_table;
use super::mode_tables::mode_files;
use crate::analysis::forces::force_records::identify_forces;
use crate::analysis::stability::lobes::LobeAnalysis;
use crate::analysis::workbench::Workbench;
use crate::cutting::CfcOptions;
use crate::ingest::ColumnTable;
use crate::{InputError, Result};

/// A part of a campaign.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum ExportPart {
    /// The measured FRFs, as receptance.
    Frf,
    /// The same by the model: as the robot file has it, and calibrated with what was added.
    Model,
    /// Calibrated model less measurement.
    Residual,
    /// Modes of the measured FRFs, and their shapes.
    Modes,
    /// Depth limits over spindle speed.
    Lobes,
    /// Cutting force coefficients.
    Coefficients,
    /// Force records as they were recorded.
    Records,
}

impl ExportPart {
    /// All of them.
    pub const ALL: [ExportPart; 7] = [
        ExportPart::Frf,
        ExportPart::Model,
        ExportPart::Residual,
        ExportPart::Modes,
        ExportPart::Lobes,
        ExportPart::Coefficients,
        ExportPart::Records,
    ];

    /// As the command line names it.
    pub fn name(self) -> &'static str {
        match self {
            ExportPart::Frf => "frf",
            ExportPart::Model => "model",
            ExportPart::Residual => "residual",
            ExportPart::Modes => "modes",
            ExportPart::Lobes => "lobes",
            ExportPart::Coefficients => "coefficients",
            ExportPart::Records => "records",
        }
    }

    /// Why the campaign cannot have it; `None` where it can.
    fn lacks(self, campaign: &Workbench) -> Option<(&'static str, &'static str)> {
        let frfs = campaign
            .frfs
            .is_empty()
            .then_some(("no measured FRFs", "add [[frf]] tables"));
        let cuts = campaign
            .cuts
            .is_empty()
            .then_some(("no cuts", "add [[cut]] tables"));
        match self {
            ExportPart::Frf | ExportPart::Modes => frfs,
            ExportPart::Model | ExportPart::Residual => frfs.or_else(|| {
                campaign
                    .robot
                    .is_none()
                    .then_some(("no robot, so no model", "add a [robot] table"))
            }),
            ExportPart::Lobes => campaign
                .lobes
                .is_none()
                .then_some(("no [lobes] table", "add one with process, source and spindle_rpm")),
            ExportPart::Coefficients | ExportPart::Records => cuts,
        }
    }
}

/// What a file holds; what it is written as is another matter.
pub enum ExportForm {
    /// Columns, or arrays: CSV, NPZ, MAT, XLSX, Parquet.
    Table(ColumnTable),
    /// The bytes of a universal file.
    Universal(Vec<u8>),
}

/// A file to be written.
pub struct ExportFile {
    /// What of the campaign it holds.
    pub part: ExportPart,
    /// Without its ending.
    pub name: String,
    /// What it holds.
    pub form: ExportForm,
}

/// All that was asked for.
#[derive(Default)]
pub struct Exported {
    /// By part.
    pub files: Vec<ExportFile>,
    /// What was noticed on the way.
    pub warnings: Vec<String>,
}

impl Exported {
    fn table(&mut self, part: ExportPart, table: ColumnTable) {
        self.files.push(ExportFile {
            part,
            name: table.name.clone(),
            form: ExportForm::Table(table),
        });
    }

    fn universal(&mut self, part: ExportPart, (name, bytes): (String, Vec<u8>)) {
        self.files.push(ExportFile {
            part,
            name,
            form: ExportForm::Universal(bytes),
        });
    }
}

/// Tables and universal files of these parts; of all that the campaign holds where none is named.
///
/// # Errors
/// A part that the campaign cannot have; what its analysis reports.
pub fn exported(campaign: &Workbench, wanted: &[ExportPart]) -> Result<Exported> {
    let missing = |(what, remedy): (&str, &str), part: ExportPart| {
        InputError::new(format!("nothing to export as {}: {what}", part.name()))
            .file(campaign.dir.join("campaign.toml"))
            .remedy(remedy)
    };
    let parts: Vec<ExportPart> = match wanted {
        [] => ExportPart::ALL
            .into_iter()
            .filter(|part| part.lacks(campaign).is_none())
            .collect(),
        wanted => {
            let mut parts = wanted.to_vec();
            parts.dedup();
            parts
        }
    };
    for part in &parts {
        if let Some(lacks) = part.lacks(campaign) {
            return Err(missing(lacks, *part).into());
        }
    }
    if parts.is_empty() {
        return Err(
            InputError::new("nothing to export: no FRFs, no cuts and no lobes")
                .file(campaign.dir.join("campaign.toml"))
                .remedy("add [[frf]] or [[cut]] tables")
                .into(),
        );
    }
    let mut out = Exported::default();
    for part in parts {
        match part {
            ExportPart::Frf => {
                let (table, universal) = frf_file(campaign)?;
                out.table(part, table);
                out.universal(part, universal);
            }
            ExportPart::Model | ExportPart::Residual => {
                let (table, universal) = model_files(campaign, part == ExportPart::Residual)?;
                out.table(part, table);
                out.universal(part, universal);
            }
            ExportPart::Modes => {
                let (tables, universal) = mode_files(campaign)?;
                tables.into_iter().for_each(|t| out.table(part, t));
                universal.into_iter().for_each(|u| out.universal(part, u));
            }
            ExportPart::Lobes => {
                let analysis = LobeAnalysis::on(campaign)?;
                out.warnings.extend(analysis.warnings.iter().cloned());
                out.table(part, lobe_table(&analysis));
            }
            ExportPart::Coefficients => {
                let result = identify_forces(campaign, CfcOptions::default())?;
                out.warnings.extend(result.warnings.iter().cloned());
                out.table(part, coefficient_table(&result));
            }
            ExportPart::Records => {
                for (table, universal, warnings) in record_files(campaign)? {
                    out.table(part, table);
                    out.universal(part, universal);
                    out.warnings.extend(warnings);
                }
            }
        }
    }
    Ok(out)
}
