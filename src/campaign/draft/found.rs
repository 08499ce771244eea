//! What was found in a folder.

use std::collections::BTreeSet;
use std::path::PathBuf;

use super::names::Facts;
use crate::data::Quantity;

/// A folder's measurement files, in the order of their paths (from the folder, with forward slashes).
#[derive(Debug, Default, Clone)]
pub struct Scan {
    pub frfs: Vec<FoundFrf>,
    pub forces: Vec<FoundForce>,
    pub robots: Vec<String>,
    /// Tables that look like lists of cuts.
    pub cut_lists: Vec<PathBuf>,
    /// Path, and why it goes into no campaign.
    pub not_used: Vec<(String, String)>,
}

#[derive(Debug, Clone)]
pub struct FoundFrf {
    pub path: String,
    pub posture: String,
    /// How the posture was concluded, where that is a guess.
    pub posture_guess: Option<&'static str>,
    /// `None` where the file does not say for every FRF.
    pub quantity: Option<Quantity>,
    pub nodes: BTreeSet<i64>,
    pub facts: Facts,
}

#[derive(Debug, Clone)]
pub struct FoundForce {
    pub path: String,
    pub from_name: Facts,
    pub from_header: Facts,
}

/// Name without folders and ending.
pub(super) fn stem(path: &str) -> &str {
    let file = path.rsplit('/').next().unwrap_or(path);
    file.rsplit_once('.').map_or(file, |(stem, _)| stem)
}
