//! Files that are files, and are never seen half written.

use std::io::Write;
use std::path::Path;

use tempfile::NamedTempFile;

use crate::{Error, InputError, Result};

/// Refuses what is no file, before it is opened: a pipe would wait for a writer, a device never end.
///
/// # Errors
/// The operating system's; a folder, pipe or device, by its path.
pub fn regular_file(path: &Path) -> Result<()> {
    let kind = std::fs::metadata(path).map_err(|e| Error::io(path, e))?;
    if kind.is_file() {
        return Ok(());
    }
    let what = if kind.is_dir() {
        "a folder"
    } else {
        "a pipe or device"
    };
    Err(InputError::new(format!("{what}, not a file"))
        .file(path)
        .remedy("give a file; what comes through a pipe, save to one first")
        .into())
}

/// Writes beside the target and renames: a reader sees the old file or the new one, never half of it.
///
/// # Errors
/// What the file system refuses, naming the file.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<()> {
    replace(path, bytes, ".lobestone-", false)
}

/// As [`write_atomically`], and on the disk when it returns: a power cut leaves the old file or the new one, too. The
/// temporary file's name begins with `prefix`.
///
/// # Errors
/// What the file system refuses, naming the file.
pub fn write_durably(path: &Path, bytes: &[u8], prefix: &str) -> Result<()> {
    replace(path, bytes, prefix, true)
}

/// Writes a file that is not there yet, whole or not at all; of several writers at once one wins. Whether it was this one.
///
/// # Errors
/// What the file system refuses, naming the file.
pub fn write_new(path: &Path, bytes: &[u8]) -> Result<bool> {
    match beside(path, bytes, ".lobestone-")?.persist_noclobber(path) {
        Ok(_) => Ok(true),
        Err(e) if e.error.kind() == std::io::ErrorKind::AlreadyExists => Ok(false),
        Err(e) => Err(Error::io(path, e.error)),
    }
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// A temporary file in the folder of `path` that holds `bytes`.
fn beside(path: &Path, bytes: &[u8], prefix: &str) -> Result<NamedTempFile> {
    let folder = folder_of(path);
    let mut file = tempfile::Builder::new();
    // Temporary files are private by default; results are to be read by whoever may read the folder.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        file.permissions(std::fs::Permissions::from_mode(0o644));
    }
    let mut file = file
        .prefix(prefix)
        .tempfile_in(folder)
        .map_err(|e| Error::io(folder, e))?;
    file.write_all(bytes).map_err(|e| Error::io(path, e))?;
    Ok(file)
}

fn replace(path: &Path, bytes: &[u8], prefix: &str, durable: bool) -> Result<()> {
    let file = beside(path, bytes, prefix)?;
    if durable {
        file.as_file().sync_all().map_err(|e| Error::io(path, e))?;
    }
    file.persist(path).map_err(|e| Error::io(path, e.error))?;
    if durable {
        // The rename itself. Where folders cannot be opened (Windows) the system sees to it.
        if let Ok(folder) = std::fs::File::open(folder_of(path)) {
            let _ = folder.sync_all();
        }
    }
    Ok(())
}
