//! Files read by name.

use std::path::{Path, PathBuf};

use super::contents::MeasurementFile;
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
    })
}

/// FRFs of a file, and its warnings.
///
/// # Errors
/// As [`read_file`], and a file without FRFs.
pub fn read_frfs(path: &Path) -> Result<(Vec<FrfRecord>, Vec<String>)> {
    frfs_of(read_file(path)?)
}

/// As [`read_frfs`], where the content of the file is `bytes`.
///
/// # Errors
/// As [`read_frfs`].
pub fn read_frfs_in(path: &Path, bytes: &[u8]) -> Result<(Vec<FrfRecord>, Vec<String>)> {
    frfs_of(long::decoded(path, bytes)?)
}

fn frfs_of(file: MeasurementFile) -> Result<(Vec<FrfRecord>, Vec<String>)> {
    if file.contents.frfs.is_empty() {
        return Err(no_such(&file, "FRF", "give a UFF 58 file or a CSV with FRFs"));
    }
    Ok((file.contents.frfs, file.warnings))
}

/// The whole content of a file.
///
/// # Errors
/// The operating system's; a folder, pipe or device, by its path.
pub fn read_content(path: &Path) -> Result<Vec<u8>> {
    long::regular_file(path)?;
    std::fs::read(path).map_err(|e| Error::io(path, e))
}

/// The time record of a file, and its warnings.
///
/// # Errors
/// As [`read_file`], and a file without time signals or with several that do not share one time axis.
pub fn read_time(path: &Path) -> Result<(TimeRecord, Vec<String>)> {
    let mut file = read_file(path)?;
    match (file.contents.times.pop(), file.contents.times.len()) {
        (Some(record), 0) => Ok((record, file.warnings)),
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
