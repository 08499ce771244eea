//! Files read by name.

use std::path::{Path, PathBuf};

use super::contents::{Digest, MeasurementFile, TimeFile};
use super::decode::read_bytes;
use super::long;
use super::text::Notes;
use crate::data::{FrfRecord, TimeRecord};
use crate::{Error, InputError, Result};

/// Reads a measurement file of any known format, decided by its content.
///
/// # Errors
/// The operating system's; an unknown or unreadable format, or a damaged file, with file, line and remedy.
pub fn read_file(path: &Path) -> Result<MeasurementFile> {
    match long::open(path)? {
        long::Opened::Read(file) => Ok(file),
        long::Opened::Long(record) => record.whole(),
    }
}

/// As [`read_file`], on the bytes of a file; errors name no file.
///
/// # Errors
/// As [`read_file`].
pub fn read_memory(bytes: &[u8]) -> std::result::Result<MeasurementFile, InputError> {
    let mut notes = Notes::default();
    let (format, why, contents) = read_bytes(bytes, false, &mut notes)?;
    Ok(MeasurementFile {
        path: PathBuf::new(),
        format,
        why,
        contents,
        warnings: notes.into_warnings(),
        digest: Digest::of(bytes),
    })
}

/// FRFs of a file, and its warnings.
///
/// # Errors
/// As [`read_frf_file`].
pub fn read_frfs(path: &Path) -> Result<(Vec<FrfRecord>, Vec<String>)> {
    let file = read_frf_file(path)?;
    Ok((file.contents.frfs, file.warnings))
}

/// A file that holds FRFs.
///
/// # Errors
/// As [`read_file`], and a file without FRFs.
pub fn read_frf_file(path: &Path) -> Result<MeasurementFile> {
    let file = read_file(path)?;
    if file.contents.frfs.is_empty() {
        return Err(no_such(&file, "FRF", "give a UFF 58 file or a CSV with FRFs"));
    }
    Ok(file)
}

/// The time record of a file, and its warnings.
///
/// # Errors
/// As [`read_file`], and a file without time signals or with several that do not share one time axis.
pub fn read_time(path: &Path) -> Result<(TimeRecord, Vec<String>)> {
    let read = read_time_file(path)?;
    Ok((read.record, read.warnings))
}

pub(super) fn read_time_file(path: &Path) -> Result<TimeFile> {
    one_time_record(path, read_file(path)?)
}

pub(super) fn one_time_record(path: &Path, mut file: MeasurementFile) -> Result<TimeFile> {
    match (file.contents.times.pop(), file.contents.times.len()) {
        (Some(record), 0) => Ok(TimeFile {
            record,
            warnings: file.warnings,
            digest: file.digest,
        }),
        (None, _) => Err(no_such(
            &file,
            "time signal",
            "give a DynoWare export or a CSV with a time column",
        )),
        (Some(_), more) => Err(InputError::new(format!(
            "{} time records with different time axes",
            more + 1
        ))
        .file(path)
        .remedy("keep the channels of one record in one file")
        .into()),
    }
}

pub(super) fn no_such(file: &MeasurementFile, what: &str, remedy: &str) -> Error {
    let mut problem = format!(
        "no {what} in this {} file, but {}",
        file.format,
        file.contents.describe()
    );
    if let Some(first) = file.warnings.first() {
        problem.push_str(&format!(" ({first})"));
    }
    InputError::new(problem).file(&file.path).remedy(remedy).into()
}
