//! What was found in a folder.

use std::collections::BTreeSet;
use std::path::PathBuf;

use super::names::Facts;
use crate::data::Quantity;
use crate::ingest::{NamedCut, NamedForce, PlainColumn};

/// A folder's measurement files, in the order of their paths (from the folder, with forward slashes).
#[derive(Debug, Default, Clone)]
pub struct Scan {
    /// Files with FRFs.
    pub frfs: Vec<FoundFrf>,
    /// Files with cutting forces over time.
    pub forces: Vec<FoundForce>,
    /// What the columns of the force files hold, where none of them says which are the forces: all have as many.
    pub columns: Vec<PlainColumn>,
    /// What the channels of the force files are (`fx`) and how they are called, where none of the files says its times or
    /// sampling rate: all have the same.
    pub timeless: Vec<(&'static str, String)>,
    /// The same, with their unit, where their values are volts or charges: what the amplifier makes of them is not in the files.
    pub electric: Vec<(NamedForce, String)>,
    /// Robot files, as paths.
    pub robots: Vec<String>,
    /// Tables that look like lists of cuts.
    pub cut_lists: Vec<PathBuf>,
    /// Path, and why it goes into no campaign.
    pub not_used: Vec<(String, String)>,
}

/// A file with FRFs, all of them at known nodes.
#[derive(Debug, Clone)]
pub struct FoundFrf {
    /// From the folder, with forward slashes.
    pub path: String,
    /// Id of the posture that its name or folder tells.
    pub posture: String,
    /// How the posture was concluded, where that is a guess.
    pub posture_guess: Option<&'static str>,
    /// `None` where the file does not say for every FRF.
    pub quantity: Option<Quantity>,
    /// Node numbers of its responses and references.
    pub nodes: BTreeSet<i64>,
    pub(crate) facts: Facts,
}

/// A file with cutting forces over time.
#[derive(Debug, Clone)]
pub struct FoundForce {
    /// From the folder, with forward slashes.
    pub path: String,
    pub(crate) from_name: Facts,
    pub(crate) from_header: Facts,
    /// Id and channels, where the file holds several cuts and this is one of them.
    pub part: Option<NamedCut>,
    /// The file says its times, or how fast it was sampled.
    pub says_times: bool,
}

/// Name without folders and ending.
pub(super) fn stem(path: &str) -> &str {
    let file = path.rsplit('/').next().unwrap_or(path);
    file.rsplit_once('.').map_or(file, |(stem, _)| stem)
}

/// Ids of the cuts: the number in the file's name where that tells them apart, else the name.
pub(super) fn cut_ids(forces: &[FoundForce]) -> Vec<String> {
    if forces.iter().any(|f| f.part.is_some()) {
        let part = |f: &FoundForce| f.part.as_ref().map(|(id, _)| id.clone());
        let short: Vec<String> = forces
            .iter()
            .map(|f| part(f).unwrap_or_else(|| stem(&f.path).to_string()))
            .collect();
        let all_differ = short.iter().collect::<BTreeSet<_>>().len() == short.len();
        let long = |f: &FoundForce| stem(&f.path).to_string() + "-" + &part(f).unwrap_or_default();
        return if all_differ {
            short
        } else {
            forces.iter().map(long).collect()
        };
    }
    let number = |force: &FoundForce| -> String {
        let name = stem(&force.path);
        let first = name.split(['_', '-', ' ']).next().unwrap_or(name);
        first
            .trim_start_matches(|c: char| !c.is_ascii_digit())
            .to_string()
    };
    let unique = |ids: &[String]| {
        let plain = |id: &String| !id.is_empty() && id.bytes().all(|b| b.is_ascii_digit());
        ids.iter().all(plain) && ids.iter().collect::<BTreeSet<_>>().len() == ids.len()
    };
    let names = |name: fn(&str) -> &str| -> Vec<String> {
        forces.iter().map(|f| name(&f.path).to_string()).collect()
    };
    let numbers: Vec<String> = forces.iter().map(number).collect();
    if unique(&numbers) {
        return numbers;
    }
    let stems = names(stem);
    match stems.iter().collect::<BTreeSet<_>>().len() == stems.len() {
        true => stems,
        false => names(|path| path),
    }
}
