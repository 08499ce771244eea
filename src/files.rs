//! Files that are files, and are never seen half written. Whatever this crate writes is written here, so that what a full disk, a
//! failing one or an interrupted call leaves behind is decided, and tested, in one place.

use std::io::{self, ErrorKind, Write};
use std::path::Path;

use tempfile::{NamedTempFile, PersistError};

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

#[cfg(test)]
pub(crate) mod faults;

/// Writes next to the target and renames: a reader sees the old file or the new one, never half of it.
///
/// # Errors
/// What the file system refuses, naming the file; then the old one is there as it was.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<()> {
    replace(path, bytes, ".lobestone-", false)
}

/// As [`write_atomically`], for a file too long to be held whole: `write` is given what the bytes go into, one after the other.
///
/// # Errors
/// What the file system refuses, naming the file, or what `write` comes to; then the old one is there as it was.
// Only a Parquet table is that long.
#[cfg_attr(not(feature = "parquet"), allow(dead_code))]
pub fn write_streamed<T>(path: &Path, write: impl FnOnce(&mut dyn Write) -> Result<T>) -> Result<T> {
    let mut pieces = Pieces {
        file: temporary(path, ".lobestone-")?,
        refused: None,
    };
    let done = write(&mut pieces);
    // The system's own words, and not what became of them on the way through `write`.
    if let Some(refused) = pieces.refused {
        return Err(Error::io(path, refused));
    }
    let done = done?;
    renamed(pieces.file, |file| persisted(file, path)).map_err(|e| Error::io(path, e))?;
    Ok(done)
}

/// As [`write_atomically`], and on the disk when it returns: a power cut leaves the old file or the new one, too. The
/// temporary file's name begins with `prefix`.
///
/// # Errors
/// What the file system refuses, naming the file; then the old one is there as it was, or the error says that the new one is.
pub fn write_durably(path: &Path, bytes: &[u8], prefix: &str) -> Result<()> {
    replace(path, bytes, prefix, true)
}

/// Writes a file that is not there yet, whole or not at all; of several writers at once one wins. Whether it was this one.
///
/// # Errors
/// What the file system refuses, naming the file.
pub fn write_new(path: &Path, bytes: &[u8]) -> Result<bool> {
    match renamed(beside(path, bytes, ".lobestone-")?, |file| {
        file.persist_noclobber(path)
    }) {
        Ok(_) => Ok(true),
        Err(e) if e.kind() == ErrorKind::AlreadyExists => Ok(false),
        Err(e) => Err(Error::io(path, e)),
    }
}

/// Renames a file or a folder.
///
/// # Errors
/// What the file system refuses.
pub fn rename(from: &Path, to: &Path) -> io::Result<()> {
    call(Call::Rename, || std::fs::rename(from, to))
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// What a write asks of the operating system, one after the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Call {
    Create,
    Write,
    Sync,
    Rename,
    SyncFolder,
}

/// Asks, and asks again where a signal interrupted that. Tests let single calls fail.
fn call<T>(which: Call, mut ask: impl FnMut() -> io::Result<T>) -> io::Result<T> {
    loop {
        match fails(which).and_then(|()| ask()) {
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            done => return done,
        }
    }
}

#[cfg(not(test))]
fn fails(_: Call) -> io::Result<()> {
    Ok(())
}

#[cfg(test)]
use self::faults::fails;

/// An empty temporary file in the folder of `path`.
fn temporary(path: &Path, prefix: &str) -> Result<NamedTempFile> {
    let folder = folder_of(path);
    let mut options = tempfile::Builder::new();
    // Temporary files are private by default; results are to be read by whoever may read the folder.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        options.permissions(std::fs::Permissions::from_mode(0o644));
    }
    options.prefix(prefix);
    call(Call::Create, || options.tempfile_in(folder)).map_err(|e| Error::io(path, e))
}

/// A temporary file in the folder of `path` that holds `bytes`.
fn beside(path: &Path, bytes: &[u8], prefix: &str) -> Result<NamedTempFile> {
    let mut pieces = Pieces {
        file: temporary(path, prefix)?,
        refused: None,
    };
    pieces.write_all(bytes).map_err(|e| Error::io(path, e))?;
    Ok(pieces.file)
}

/// A file that is written in pieces, as the system takes them: a disk that is full has some of them already.
struct Pieces {
    file: NamedTempFile,
    /// Why the system took no more.
    refused: Option<io::Error>,
}

impl Write for Pieces {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let piece = &bytes[..bytes.len().min(PIECE)];
        let taken = match call(Call::Write, || self.file.write(piece)) {
            Ok(0) if !piece.is_empty() => Err(ErrorKind::WriteZero.into()),
            taken => taken,
        };
        taken.inspect_err(|e| {
            let same = e.raw_os_error().map(io::Error::from_raw_os_error);
            self.refused
                .get_or_insert(same.unwrap_or_else(|| e.kind().into()));
        })
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Bytes that are written at once.
const PIECE: usize = 1 << 20;

/// Gives a temporary file its name.
fn renamed(
    file: NamedTempFile,
    rename: impl Fn(NamedTempFile) -> std::result::Result<std::fs::File, PersistError>,
) -> io::Result<std::fs::File> {
    let mut file = Some(file);
    call(Call::Rename, || match file.take().map(&rename) {
        Some(Ok(done)) => Ok(done),
        Some(Err(failed)) => {
            file = Some(failed.file);
            Err(failed.error)
        }
        None => Err(ErrorKind::NotFound.into()),
    })
}

/// In the place of what has the name. Windows refuses that while a reader, an indexer or a scanner of viruses has the old file open,
/// which passes within a moment.
fn persisted(file: NamedTempFile, path: &Path) -> std::result::Result<std::fs::File, PersistError> {
    let mut file = file;
    let mut tries = if cfg!(windows) { 40 } else { 0 };
    while tries > 0 {
        tries -= 1;
        match file.persist(path) {
            Err(failed) if failed.error.kind() == ErrorKind::PermissionDenied => file = failed.file,
            done => return done,
        }
        std::thread::sleep(std::time::Duration::from_millis(25));
    }
    file.persist(path)
}

fn replace(path: &Path, bytes: &[u8], prefix: &str, durable: bool) -> Result<()> {
    let failed = |e| Error::io(path, e);
    let file = beside(path, bytes, prefix)?;
    if durable {
        call(Call::Sync, || file.as_file().sync_all()).map_err(failed)?;
    }
    renamed(file, |file| persisted(file, path)).map_err(failed)?;
    if durable {
        // The rename itself. Where folders cannot be opened (Windows) or flushed (some network disks) the system sees to it.
        if let Ok(folder) = std::fs::File::open(folder_of(path))
            && let Err(e) = call(Call::SyncFolder, || folder.sync_all())
            && !matches!(e.kind(), ErrorKind::InvalidInput | ErrorKind::Unsupported)
        {
            let told = format!("{e}: the file is written, but a power cut now may bring back the old one");
            return Err(failed(io::Error::new(e.kind(), told)));
        }
    }
    Ok(())
}
