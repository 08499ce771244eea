//! Where in a campaign's folder the program keeps its own files.

use std::path::{Path, PathBuf};

/// What the program keeps of a campaign, next to the measurements.
pub(super) const FOLDER: &str = "lobestone";

/// Where a campaign's log is, whether or not there is one.
pub fn log_file(campaign_dir: &Path) -> PathBuf {
    campaign_dir.join(FOLDER).join("revisions.json")
}
