//! Files that are never seen half written.

use std::io::Write;
use std::path::Path;

use crate::{Error, Result};

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

fn replace(path: &Path, bytes: &[u8], prefix: &str, durable: bool) -> Result<()> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
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
    if durable {
        file.as_file().sync_all().map_err(|e| Error::io(path, e))?;
    }
    file.persist(path).map_err(|e| Error::io(path, e.error))?;
    if durable {
        // The rename itself. Where folders cannot be opened (Windows) the system sees to it.
        if let Ok(folder) = std::fs::File::open(folder) {
            let _ = folder.sync_all();
        }
    }
    Ok(())
}
