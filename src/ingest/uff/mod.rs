//! Universal files (UFF, UNV): dataset 58 and its binary form 58b, with 164 (units); all others are skipped.
//!
//! Source: Universal Dataset Number 58, Structural Dynamics Research Laboratory, University of Cincinnati
//! (revision of 23 April 1993), as kept in the repository tekniskakustik/readunv; dataset 164 of the same series.

mod binary;
mod dataset58;
mod interpret;
#[cfg(test)]
mod round_trip;
#[cfg(test)]
mod tests;
mod write;

use super::number;
use super::text::{Lines, Notes, decode};
use super::{Contents, InputError};

pub use dataset58::{Abscissa, Dataset58, EntityDof, Ordinate, UnitAxis};
pub use write::{
    ByteOrder, Encoding58, frf_dataset, time_datasets, uff58_bytes, write_datasets58, write_uff58,
};

/// Factors of dataset 164: values in the file divided by these are SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FileUnits {
    pub length: f64,
    pub force: f64,
}

impl FileUnits {
    fn is_si(self) -> bool {
        (self.length - 1.0).abs() < 1e-6 && (self.force - 1.0).abs() < 1e-6
    }
}

/// One dataset 58 with the units that were in force where it stood.
#[derive(Debug)]
pub(super) struct Found {
    pub dataset: Dataset58,
    pub units: Option<FileUnits>,
}

/// What a universal file holds, as it stands there.
#[derive(Debug, Default)]
pub(super) struct UniversalFile {
    pub found: Vec<Found>,
    pub ascii: usize,
    pub binary: usize,
    /// Numbers of datasets that were passed over.
    pub skipped: Vec<u32>,
}

/// True where the file starts like a universal file: `-1`, then a dataset number.
pub(super) fn looks_like(bytes: &[u8]) -> bool {
    let mut lines = Lines::new(bytes).filter(|l| !l.trim_ascii().is_empty());
    is_separator(lines.next().unwrap_or_default())
        && lines
            .next()
            .is_some_and(|line| is_separator(line) || dataset_number(line).is_some())
}

pub(super) fn is_separator(line: &[u8]) -> bool {
    line.trim_ascii() == b"-1"
}

/// Number of a dataset and whether it is the binary form.
fn dataset_number(line: &[u8]) -> Option<(u32, bool)> {
    let line = line.trim_ascii();
    let digits = line.iter().take_while(|b| b.is_ascii_digit()).count();
    let number = std::str::from_utf8(&line[..digits.min(6)]).ok()?.parse().ok()?;
    match line.get(digits) {
        None => Some((number, false)),
        Some(b) if b.is_ascii_whitespace() => Some((number, false)),
        Some(b'b' | b'B') => Some((number, true)),
        Some(_) => None,
    }
}

/// Reads all datasets 58 of a file.
pub(super) fn read(bytes: &[u8], notes: &mut Notes) -> Result<UniversalFile, InputError> {
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
                    file.found.push(Found { dataset, units });
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
pub(super) fn contents(
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
pub(super) struct UniversalFileSummary {
    pub ascii: usize,
    pub binary: usize,
    pub skipped: Vec<u32>,
}
