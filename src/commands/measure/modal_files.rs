//! What `lobestone modal` writes: a report, files for other programs, the comparison with a model.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::analysis::ModalAnalysis;
use crate::analysis::modes::modal_export::export;
use crate::analysis::modes::shape_comparison::{ShapeComparison, compare};
use crate::campaign::Campaign;
use crate::commands::text::table;
use crate::ingest::read_geometry;
use crate::report::modal_page::{self, Extras};
use crate::revision::{Side, files_fingerprint, fingerprint};
use crate::text::shell_word;
use crate::{InputError, Result};

/// Folders and files of the request.
pub struct Files<'a> {
    pub report: Option<&'a Path>,
    pub export: Option<&'a Path>,
    pub geometry: Option<&'a Path>,
    pub model: Option<&'a Path>,
    pub inputs: &'a [PathBuf],
    pub together: bool,
    pub band_hz: Option<[f64; 2]>,
    pub window_tau_s: Option<f64>,
    pub rate_hz: Option<f64>,
}

impl Files<'_> {
    /// The command line that repeats the analysis, without poles.
    fn command(&self) -> String {
        let mut line = "lobestone modal".to_owned();
        // Writing to a String cannot fail.
        for path in self.inputs {
            let _ = write!(line, " {}", shell_word(path));
        }
        if self.together {
            line += " --together";
        }
        if let Some([low, high]) = self.band_hz {
            let _ = write!(line, " --band {low}:{high}");
        }
        if let Some(rate) = self.rate_hz {
            let _ = write!(line, " --rate {rate}");
        }
        if let Some(tau) = self.window_tau_s {
            let _ = write!(line, " --window-tau {tau}");
        }
        for (option, path) in [
            ("geometry", self.geometry),
            ("model", self.model),
            ("report", self.report),
        ] {
            if let Some(path) = path {
                let _ = write!(line, " --{option} {}", shell_word(path));
            }
        }
        line
    }
}

/// What came of the request; what nobody asked for is left out.
#[derive(Serialize)]
pub struct FilesWritten {
    /// By set; null where nothing could be compared.
    #[serde(skip_serializing_if = "Option::is_none")]
    model: Option<Vec<Option<ShapeComparison>>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    exported: Option<Vec<PathBuf>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    report: Option<ReportWritten>,
}

#[derive(Serialize)]
struct ReportWritten {
    html: PathBuf,
    images: Vec<PathBuf>,
}

/// Writes what is asked for, and says so.
pub fn write(files: &Files, analysis: &ModalAnalysis, said: &mut String) -> Result<FilesWritten> {
    let geometry = files
        .geometry
        .map(read_geometry)
        .transpose()?
        .map(|found| found.0);
    let mut model: Option<Vec<Option<ShapeComparison>>> = None;
    if let Some(path) = files.model {
        let mut comparisons = Vec::new();
        let (nodes, shapes) = read_geometry(path)?;
        if shapes.is_empty() {
            return Err(InputError::new("a model without mode shapes (dataset 55)")
                .file(path)
                .remedy("export the model's modes as universal dataset 55")
                .into());
        }
        for set in &analysis.sets {
            let comparison = compare(set, geometry.as_ref(), &nodes, &shapes);
            match &comparison {
                Some(found) => *said += &pairs(&set.set, found),
                None => {
                    let _ = writeln!(
                        said,
                        "{}: fewer than two degrees of freedom in common with the model: nothing to compare",
                        set.set
                    );
                }
            }
            comparisons.push(comparison);
        }
        model = Some(comparisons);
    }
    let mut exported = None;
    if let Some(folder) = files.export {
        let written = export(&analysis.sets, geometry.as_ref(), folder)?;
        let _ = writeln!(said, "export   {} files in {}", written.len(), folder.display());
        exported = Some(written);
    }
    let mut report = None;
    if let Some(folder) = files.report {
        let fingerprint = match files.inputs {
            [dir] if dir.is_dir() => Campaign::load(dir).and_then(|c| fingerprint(&c, Side::Structure)),
            inputs => files_fingerprint(inputs),
        };
        let extras = Extras {
            inputs: files.inputs.iter().map(|p| p.display().to_string()).collect(),
            // The page is worth having without it.
            fingerprint: fingerprint.ok(),
            geometry: geometry.as_ref(),
            comparisons: model.as_deref().unwrap_or_default(),
            command: files.command(),
        };
        let first = files.inputs.first().and_then(|p| p.file_name());
        let title = first.map_or("Modal analysis".into(), |name| {
            format!("Modal analysis of {}", name.to_string_lossy())
        });
        let written = modal_page::page(analysis, &extras, &title).write(folder)?;
        let _ = writeln!(
            said,
            "report   {}\nfigures  {} PNG files next to it",
            written.html.display(),
            written.images.len()
        );
        report = Some(ReportWritten {
            html: written.html,
            images: written.images,
        });
    }
    Ok(FilesWritten {
        model,
        exported,
        report,
    })
}

fn pairs(set: &str, found: &ShapeComparison) -> String {
    let rows: Vec<Vec<String>> = found
        .pairs
        .iter()
        .map(|p| {
            vec![
                format!("{:.2}", p.measured_hz),
                format!("{:.2}", p.model_hz),
                format!("{:+.1}", 100.0 * p.frequency_error),
                format!("{:.3}", p.mac),
            ]
        })
        .collect();
    format!(
        "\n{set}: against the model, {} degrees of freedom in common (nodes by {})\n{}",
        found.common_dofs,
        found.matched_by,
        table(&["measured Hz", "model Hz", "off by %", "MAC"], &rows)
    )
}
