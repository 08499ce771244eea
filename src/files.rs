//! Files that are never seen half written. Whatever this crate writes is written here, so that what a full disk, a failing one or
//! an interrupted call leaves behind is decided, and tested, in one place.

use std::io::{self, ErrorKind, Write};
use std::path::Path;

use tempfile::{NamedTempFile, PersistError};

use crate::{Error, Result};

/// Writes beside the target and renames: a reader sees the old file or the new one, never half of it.
///
/// # Errors
/// What the file system refuses, naming the file; then the old one is there as it was.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<()> {
    replace(path, bytes, ".lobestone-", false)
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
use tests::fails;

/// A temporary file in the folder of `path` that holds `bytes`.
fn beside(path: &Path, bytes: &[u8], prefix: &str) -> Result<NamedTempFile> {
    let folder = folder_of(path);
    let mut options = tempfile::Builder::new();
    // Temporary files are private by default; results are to be read by whoever may read the folder.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        options.permissions(std::fs::Permissions::from_mode(0o644));
    }
    options.prefix(prefix);
    let mut file = call(Call::Create, || options.tempfile_in(folder)).map_err(|e| Error::io(path, e))?;
    // In pieces, as the system takes them: a disk that is full has some of them already.
    let mut left = bytes;
    while !left.is_empty() {
        let taken = call(Call::Write, || file.write(&left[..left.len().min(PIECE)]));
        let taken = taken.and_then(|taken| match taken {
            0 => Err(ErrorKind::WriteZero.into()),
            taken => Ok(taken),
        });
        left = &left[taken.map_err(|e| Error::io(path, e))?..];
    }
    Ok(file)
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

fn replace(path: &Path, bytes: &[u8], prefix: &str, durable: bool) -> Result<()> {
    let failed = |e| Error::io(path, e);
    let file = beside(path, bytes, prefix)?;
    if durable {
        call(Call::Sync, || file.as_file().sync_all()).map_err(failed)?;
    }
    renamed(file, |file| file.persist(path)).map_err(failed)?;
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

#[cfg(test)]
pub(crate) mod tests {
    use std::cell::RefCell;
    use std::collections::VecDeque;

    use super::*;

    /// What the next calls of this thread come to; those behind them succeed.
    struct Plan {
        fate: VecDeque<Option<io::Error>>,
        made: Vec<Call>,
    }

    thread_local! {
        static PLAN: RefCell<Option<Plan>> = const { RefCell::new(None) };
    }

    pub(super) fn fails(which: Call) -> io::Result<()> {
        PLAN.with_borrow_mut(|plan| {
            let Some(plan) = plan else { return Ok(()) };
            plan.made.push(which);
            plan.fate.pop_front().flatten().map_or(Ok(()), Err)
        })
    }

    /// Numbers of errors on Linux: disk full, disk broken, quota, interrupted by a signal.
    const ENOSPC: i32 = 28;
    const EIO: i32 = 5;
    const EDQUOT: i32 = 122;
    const EINTR: i32 = 4;

    /// Does `work` with the call behind the first `before` of them failing as `errno` says; what it came to, and the calls made.
    fn with_fault<T>(before: usize, errno: i32, work: impl FnOnce() -> T) -> (T, Vec<Call>) {
        let fate = (0..before)
            .map(|_| None)
            .chain([Some(io::Error::from_raw_os_error(errno))]);
        let plan = Plan {
            fate: fate.collect(),
            made: Vec::new(),
        };
        PLAN.set(Some(plan));
        let done = work();
        (done, PLAN.take().map_or_else(Vec::new, |plan| plan.made))
    }

    /// Lets every call of `work` fail in turn, in every way. `work` gets a folder that `prepare` made; `is_old` and `is_new` say
    /// what it holds.
    pub(crate) fn every_fault<T>(
        prepare: impl Fn(&Path),
        work: impl Fn(&Path) -> Result<T>,
        is_old: impl Fn(&Path) -> bool,
        is_new: impl Fn(&Path) -> bool,
        named: &str,
    ) {
        let mut calls = usize::MAX;
        for errno in [ENOSPC, EIO, EDQUOT, EINTR] {
            for at in 0.. {
                let folder = tempfile::tempdir().unwrap();
                let dir = folder.path();
                prepare(dir);
                let (done, made) = with_fault(at, errno, || work(dir));
                calls = calls.min(made.len());
                if at >= made.len() {
                    // The fault lies behind the last call.
                    assert!(done.is_ok() && is_new(dir));
                    break;
                }
                let failed = made[at];
                match done {
                    Ok(_) => assert!(errno == EINTR && is_new(dir), "{failed:?} {errno}"),
                    Err(error) => {
                        let said = error.to_string();
                        assert!(errno != EINTR, "{failed:?}: {said}");
                        assert!(said.contains(named), "{said}");
                        assert_eq!(
                            is_new(dir),
                            failed == Call::SyncFolder,
                            "{failed:?} {errno}: {said}"
                        );
                        assert_eq!(
                            is_old(dir),
                            failed != Call::SyncFolder,
                            "{failed:?} {errno}: {said}"
                        );
                        assert_eq!(
                            said.contains("the file is written"),
                            failed == Call::SyncFolder,
                            "{said}"
                        );
                    }
                }
            }
        }
        assert!((3..100).contains(&calls), "{calls} calls");
    }

    fn names(dir: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(dir).unwrap();
        entries
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect()
    }

    /// Three pieces.
    fn new() -> Vec<u8> {
        vec![b'n'; 2 * PIECE + 5]
    }

    fn holds(dir: &Path, content: &[u8]) -> bool {
        names(dir) == ["f"] && std::fs::read(dir.join("f")).unwrap() == content
    }

    #[test]
    fn a_fault_leaves_the_old_file_or_the_new_one_and_nothing_beside_it() {
        let old = |dir: &Path| std::fs::write(dir.join("f"), "old").unwrap();
        let (is_old, is_new) = (|dir: &Path| holds(dir, b"old"), |dir: &Path| holds(dir, &new()));
        every_fault(
            old,
            |dir| write_atomically(&dir.join("f"), &new()),
            is_old,
            is_new,
            "f: ",
        );
        every_fault(
            old,
            |dir| write_durably(&dir.join("f"), &new(), ".x-"),
            is_old,
            is_new,
            "f: ",
        );
    }

    #[test]
    fn a_fault_leaves_no_file_where_there_was_none() {
        let none = |dir: &Path| names(dir).is_empty();
        let is_new = |dir: &Path| holds(dir, &new());
        every_fault(
            |_| {},
            |dir| write_new(&dir.join("f"), &new()),
            none,
            is_new,
            "f: ",
        );
    }

    #[test]
    fn a_file_that_is_there_already_stays() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("f");
        assert!(write_new(&file, b"one").unwrap());
        assert!(!write_new(&file, b"two").unwrap());
        assert!(holds(dir.path(), b"one"));
    }

    #[test]
    fn a_write_asks_for_what_it_promises() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("f");
        let made = |write: &dyn Fn() -> Result<()>| {
            let (done, made) = with_fault(99, EIO, write);
            done.unwrap();
            made
        };
        use Call::*;
        assert_eq!(made(&|| write_atomically(&file, b"x")), [Create, Write, Rename]);
        assert_eq!(
            made(&|| write_durably(&file, b"x", ".x-")),
            [Create, Write, Sync, Rename, SyncFolder]
        );
    }
}
