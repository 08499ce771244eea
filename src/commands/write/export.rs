//! `lobestone export DIR`: what a campaign measured and what became of it, as files for other programs.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use serde::Serialize;

use crate::analysis::Workbench;
use crate::analysis::export::{ExportForm, ExportPart, exported};
use crate::campaign::Campaign;
use crate::commands::text::{table, warnings};
use crate::commands::{CampaignArg, Outcome};
use crate::files::write_atomically;
use crate::ingest::{ColumnTable, csv_bytes, mat_bytes, npz_bytes, xlsx_bytes};
use crate::{Error, Result};

#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  lobestone export cell7 --what frf,model --format npz --out cell7-numbers"
)]
pub struct ExportArgs {
    #[command(flatten)]
    campaign: CampaignArg,
    /// Which parts [default: all that the campaign holds].
    #[arg(long, value_delimiter = ',', value_name = "PART", value_enum)]
    what: Vec<ExportPart>,
    /// As what: CSV, universal files, MATLAB, NumPy, Parquet, Excel.
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "FORMAT",
        value_enum,
        default_value = "csv"
    )]
    format: Vec<FormatArg>,
    /// The folder to write into.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum FormatArg {
    Csv,
    Uff,
    Mat,
    Npz,
    Parquet,
    Xlsx,
}

impl FormatArg {
    fn ending(self) -> &'static str {
        match self {
            FormatArg::Csv => "csv",
            FormatArg::Uff => "uff",
            FormatArg::Mat => "mat",
            FormatArg::Npz => "npz",
            FormatArg::Parquet => "parquet",
            FormatArg::Xlsx => "xlsx",
        }
    }

    /// `None` where this form has nothing of the kind.
    fn bytes(self, form: &ExportForm) -> Result<Option<Vec<u8>>> {
        Ok(match (self, form) {
            (FormatArg::Uff, ExportForm::Universal(bytes)) => Some(bytes.clone()),
            (FormatArg::Uff, _) | (_, ExportForm::Universal(_)) => None,
            (FormatArg::Csv, ExportForm::Table(table)) => Some(csv_bytes(table)?),
            (FormatArg::Mat, ExportForm::Table(table)) => Some(mat_bytes(table)),
            (FormatArg::Npz, ExportForm::Table(table)) => Some(npz_bytes(table)?),
            (FormatArg::Xlsx, ExportForm::Table(table)) => Some(xlsx_bytes(table)?),
            (FormatArg::Parquet, ExportForm::Table(table)) => Some(parquet(table)?),
        })
    }
}

#[cfg(feature = "parquet")]
fn parquet(table: &ColumnTable) -> Result<Vec<u8>> {
    crate::report::stores::parquet_columns::parquet_bytes(table)
}

#[cfg(not(feature = "parquet"))]
fn parquet(_: &ColumnTable) -> Result<Vec<u8>> {
    Err(Error::computation(
        "this program was built without Parquet: choose csv, npz, mat or xlsx, or build it with the feature parquet, which \
         is on by default: cargo build --release",
    ))
}

pub fn run(args: ExportArgs) -> Result<Outcome> {
    let campaign = Campaign::load(&args.campaign.dir)?;
    let found = exported(&Workbench::new(&campaign), &args.what)?;
    // Everything is made before the first file is written.
    let mut made = Vec::new();
    let mut left_out = Vec::new();
    let mut formats = args.format.clone();
    formats.dedup();
    for format in formats {
        for part in ExportPart::ALL {
            let mut files = found.files.iter().filter(|f| f.part == part).peekable();
            if files.peek().is_none() {
                continue;
            }
            let before = made.len();
            for file in files {
                if let Some(bytes) = format.bytes(&file.form)? {
                    let path = args.out.join(format!("{}.{}", file.name, format.ending()));
                    made.push((part, format, path, bytes));
                }
            }
            if made.len() == before {
                left_out.push(PartLeftOut {
                    what: part,
                    format: format.ending(),
                    why: "universal files have no dataset for it",
                });
            }
        }
    }
    if made.is_empty() {
        return Err(Error::computation(
            "nothing was written: universal files have no dataset for lobes and coefficients; choose csv, npz, mat or xlsx",
        ));
    }
    std::fs::create_dir_all(&args.out).map_err(|e| Error::io(&args.out, e))?;
    for (_, _, path, bytes) in &made {
        write_atomically(path, bytes)?;
    }
    let rows: Vec<Vec<String>> = made
        .iter()
        .map(|(part, _, path, bytes)| {
            let kilobytes = format!("{:.1}", bytes.len() as f64 / 1000.0);
            vec![part.name().into(), path.display().to_string(), kilobytes]
        })
        .collect();
    let files = made.iter();
    let document = Document {
        out: &args.out,
        files: files
            .map(|(part, format, path, _)| FileExported {
                what: *part,
                format: format.ending(),
                path,
            })
            .collect(),
        left_out,
        warnings: &found.warnings,
    };
    let next = format!("open {}: units are in the names", args.out.display());
    Ok(Outcome::new(
        document,
        table(&["what", "file", "kB"], &rows) + &warnings(&found.warnings),
        Some(next),
    ))
}

/// What `export` wrote.
#[derive(Serialize)]
struct Document<'a> {
    out: &'a Path,
    files: Vec<FileExported<'a>>,
    left_out: Vec<PartLeftOut>,
    warnings: &'a [String],
}

#[derive(Serialize)]
struct FileExported<'a> {
    what: ExportPart,
    format: &'static str,
    path: &'a Path,
}

#[derive(Serialize)]
struct PartLeftOut {
    what: ExportPart,
    format: &'static str,
    why: &'static str,
}
