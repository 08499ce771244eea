//! A simulated campaign and its truth, on disk.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::files::{rename, write_new};
use crate::{Error, InputError, Result};

/// A simulated campaign, not yet on disk.
#[derive(Debug, Clone, PartialEq)]
pub struct LabCampaign {
    /// Path within the folder, content.
    pub files: Vec<(String, Vec<u8>)>,
    /// What was hidden.
    pub truth: Value,
}

/// Where a simulated campaign was written.
#[derive(Debug, Clone, PartialEq)]
pub struct Written {
    /// The campaign folder.
    pub dir: PathBuf,
    /// Truth file, outside `dir` unless asked for otherwise.
    pub truth: PathBuf,
}

/// Refuses a folder and a truth file that something stands in already. Called before the work as well as by
/// [`LabCampaign::write`].
///
/// # Errors
/// One that names the path and says what to do.
pub fn check_target(dir: &Path, truth: &Path) -> Result<()> {
    let taken = |path: &Path, problem: &str| -> Result<()> {
        Err(InputError::new(problem)
            .file(path)
            .remedy("name another folder with --out, or remove it yourself")
            .into())
    };
    match std::fs::read_dir(dir).map(|mut entries| entries.next().is_none()) {
        Ok(true) => {}
        Ok(false) => return taken(dir, "the folder is not empty; nothing was touched"),
        Err(_) if dir.symlink_metadata().is_ok() => {
            return taken(dir, "is there already and is no folder that can be used");
        }
        Err(_) => {}
    }
    if truth.symlink_metadata().is_ok() {
        return taken(truth, "there is a truth file already; nothing was touched");
    }
    Ok(())
}

/// Where the truth of a campaign folder goes: `DIR.truth.json` next to it.
///
/// # Errors
/// A path that has no name, such as `..`.
pub fn truth_beside(dir: &Path) -> Result<PathBuf> {
    let Some(name) = dir.file_name() else {
        return Err(
            InputError::new(format!("{} is no name for a new folder", dir.display()))
                .key("--out")
                .remedy("give the path of a folder that does not exist yet")
                .into(),
        );
    };
    let mut name = name.to_os_string();
    name.push(".truth.json");
    Ok(dir.with_file_name(name))
}

impl LabCampaign {
    /// Writes the truth and the folder (to a temporary one, then renamed): both or none.
    ///
    /// # Errors
    /// What [`check_target`] refuses, and what the file system does.
    pub fn write(&self, dir: &Path, truth: &Path) -> Result<Written> {
        check_target(dir, truth)?;
        let parent_of = |path: &Path| match path.parent() {
            Some(p) if !p.as_os_str().is_empty() => p.to_path_buf(),
            _ => PathBuf::from("."),
        };
        let parent = parent_of(dir);
        std::fs::create_dir_all(&parent).map_err(|e| Error::io(&parent, e))?;
        let staging = tempfile::Builder::new()
            .prefix(".lobestone-")
            .tempdir_in(&parent)
            .map_err(|e| Error::io(&parent, e))?;
        // A folder of its own inside the private temporary one gets the rights that new folders usually have.
        let staged = staging.path().join("campaign");
        for (name, content) in &self.files {
            let path = staged.join(name);
            let folder = parent_of(&path);
            std::fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, e))?;
            write_new(&path, content)?;
        }
        let text = format!("{:#}\n", self.truth);
        // Asked for inside the folder, the truth comes with it.
        let inside = truth.strip_prefix(dir).ok();
        let own = inside.map_or_else(|| truth.to_path_buf(), |name| staged.join(name));
        let truth_folder = parent_of(&own);
        std::fs::create_dir_all(&truth_folder).map_err(|e| Error::io(&truth_folder, e))?;
        if !write_new(&own, text.as_bytes())? {
            check_target(dir, truth)?;
            return Err(Error::io(truth, std::io::ErrorKind::AlreadyExists.into()));
        }
        // Only an empty folder gives way.
        let renamed = match dir.is_dir() {
            true => std::fs::remove_dir(dir).and_then(|()| rename(&staged, dir)),
            false => rename(&staged, dir),
        };
        if let Err(e) = renamed {
            let _ = std::fs::remove_file(&own);
            return Err(Error::io(dir, e));
        }
        Ok(Written {
            dir: dir.to_path_buf(),
            truth: truth.to_path_buf(),
        })
    }
}
