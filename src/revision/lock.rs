//! Who may write a campaign's log.

use std::fs::{File, TryLockError};
use std::path::Path;

use super::folder::FOLDER;
use crate::{Error, Result};

/// Waits until nobody writes the log of a campaign; while what is returned lives nobody begins to. `None` where nothing
/// was ever written.
///
/// # Errors
/// What the file system refuses.
pub fn hold(campaign_dir: &Path) -> Result<Option<File>> {
    let folder = campaign_dir.join(FOLDER);
    match folder.is_dir() {
        true => lock(&folder),
        false => Ok(None),
    }
}

/// Held until it is dropped, or until the process ends however it ends.
pub(super) fn lock(folder: &Path) -> Result<Option<File>> {
    let path = &folder.join("revisions.lock");
    let file = File::options()
        .create(true)
        .append(true)
        .open(path)
        .map_err(|e| Error::io(path, e))?;
    match file.try_lock() {
        Ok(()) => return Ok(Some(file)),
        Err(TryLockError::WouldBlock) => {}
        // Some network file systems know no locks; the comparison with what was loaded must do there.
        Err(TryLockError::Error(e)) if e.kind() == std::io::ErrorKind::Unsupported => return Ok(None),
        Err(TryLockError::Error(e)) => return Err(Error::io(path, e)),
    }
    // Others hold it for the time of one small write.
    file.lock().map_err(|e| Error::io(path, e))?;
    Ok(Some(file))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_held_log_makes_writers_wait() {
        let dir = tempfile::tempdir().unwrap();
        assert!(hold(dir.path()).unwrap().is_none());
        let folder = dir.path().join(FOLDER);
        std::fs::create_dir(&folder).unwrap();
        let held = hold(dir.path()).unwrap();
        assert!(held.is_some());
        let (told, tell) = std::sync::mpsc::channel();
        std::thread::scope(|scope| {
            scope.spawn(move || {
                let own = lock(&folder).unwrap();
                told.send(own.is_some()).unwrap();
            });
            let early = tell.recv_timeout(std::time::Duration::from_millis(100));
            assert!(early.is_err(), "{early:?}");
            drop(held);
            assert_eq!(tell.recv_timeout(std::time::Duration::from_secs(60)), Ok(true));
        });
    }
}
