//! All datasets of a universal file.

use crate::InputError;
use crate::ingest::contents::Contents;
use crate::ingest::formats::uff::dataset58;
use crate::ingest::formats::uff::interpret::{self, FileUnits, FoundDataset};
use crate::ingest::formats::uff::separator::{dataset_number, is_separator};
use crate::ingest::tables::number;
use crate::ingest::text::{Lines, Notes, decode};

/// What a universal file holds, as it stands there.
#[derive(Debug, Default)]
pub(crate) struct UniversalFile {
    pub found: Vec<FoundDataset>,
    pub ascii: usize,
    pub binary: usize,
    /// Numbers of datasets that were passed over.
    pub skipped: Vec<u32>,
}

/// Reads all datasets 58 of a file.
pub(crate) fn read(bytes: &[u8], notes: &mut Notes) -> Result<UniversalFile, InputError> {
    let mut file = UniversalFile::default();
    let mut units = None;
    let mut lines = Lines::new(bytes);
    while let Some(line) = lines.next() {
        if !is_separator(line) {
            continue;
        }
        let opening = lines.number;
        // Two separators in a row close one dataset and open the next.
        let Some(header) = lines
            .by_ref()
            .find(|l| !l.trim_ascii().is_empty() && !is_separator(l))
        else {
            break;
        };
        let Some((number, binary)) = dataset_number(header) else {
            return Err(InputError::new(format!(
                "a dataset number is expected after the separator of line {opening}, not {:?}",
                decode(header).trim().chars().take(40).collect::<String>()
            ))
            .line(lines.number));
        };
        match number {
            58 => {
                let header = decode(header);
                if let Some(dataset) = dataset58::read(&mut lines, binary.then_some(header.as_str()), notes)?
                {
                    file.found.push(FoundDataset { dataset, units });
                }
                if binary {
                    file.binary += 1;
                } else {
                    file.ascii += 1;
                }
            }
            other => {
                let body: Vec<&[u8]> = lines.by_ref().take_while(|l| !is_separator(l)).collect();
                if other == 164 {
                    units = read_units(&body, notes);
                } else if !file.skipped.contains(&other) {
                    file.skipped.push(other);
                }
            }
        }
    }
    Ok(file)
}

/// Dataset 164, record 2: `FORMAT(3D25.17)`, length, force, temperature.
fn read_units(body: &[&[u8]], notes: &mut Notes) -> Option<FileUnits> {
    let line = body.get(1)?;
    let numbers = line.split(|b| b.is_ascii_whitespace()).filter(|f| !f.is_empty());
    let mut factors = numbers
        .map_while(|f| number::field(f, b'.'))
        .filter(|f| f.is_finite() && *f > 0.0);
    match (factors.next(), factors.next()) {
        (Some(length), Some(force)) => Some(FileUnits { length, force }),
        _ => {
            notes.file("dataset 164 (units) cannot be read and is ignored");
            None
        }
    }
}

/// Reads a universal file into records.
pub(crate) fn contents(
    bytes: &[u8],
    notes: &mut Notes,
) -> Result<(UniversalFileSummary, Contents), InputError> {
    let file = read(bytes, notes)?;
    let summary = UniversalFileSummary {
        ascii: file.ascii,
        binary: file.binary,
        skipped: file.skipped.clone(),
    };
    if file.found.is_empty() {
        return Err(
            InputError::new(match (summary.ascii + summary.binary, file.skipped.as_slice()) {
                (0, []) => "a universal file without any dataset".to_owned(),
                (0, skipped) => format!(
                    "a universal file without measurement data (dataset 58); it holds {}",
                    skipped
                        .iter()
                        .map(|n| format!("dataset {n}"))
                        .collect::<Vec<_>>()
                        .join(", ")
                ),
                _ => "a universal file whose datasets 58 hold no values".to_owned(),
            })
            .remedy("export the FRFs or time signals as dataset 58 (functions at nodal DOF)"),
        );
    }
    Ok((summary, interpret::contents(file.found, notes)?))
}

/// How many datasets of which form a file held.
#[derive(Debug)]
pub(crate) struct UniversalFileSummary {
    pub ascii: usize,
    pub binary: usize,
    pub skipped: Vec<u32>,
}
