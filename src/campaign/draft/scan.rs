//! What lies in a folder: every file read as `inspect` reads it.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Read;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::names::{Facts, facts_of, facts_of_header, posture_of};
use crate::campaign::campaign_file;
use crate::campaign::robot_spec::RobotSpec;
use crate::ingest::{ChannelRole, Quantity, survey};
use crate::{Error, InputError, Result};

/// A folder's measurement files, in the order of their paths (from the folder, with forward slashes).
#[derive(Debug, Default)]
pub struct Scan {
    pub frfs: Vec<FoundFrf>,
    pub forces: Vec<FoundForce>,
    /// A robot file, where there is exactly one.
    pub robot: Option<String>,
    /// Path, and why it goes into no campaign.
    pub not_used: Vec<(String, String)>,
}

#[derive(Debug)]
pub struct FoundFrf {
    pub path: String,
    pub posture: String,
    /// `None` where the file does not say for every FRF.
    pub quantity: Option<Quantity>,
    pub nodes: BTreeSet<i64>,
    pub facts: Facts,
}

#[derive(Debug)]
pub struct FoundForce {
    pub path: String,
    pub from_name: Facts,
    pub from_header: Facts,
}

/// Files looked at.
const MOST_FILES: usize = 5000;
/// Folders deep.
const DEEPEST: usize = 8;
/// Endings of files that nobody exports measurements to.
const OTHERS: [&str; 16] = [
    "html", "png", "jpg", "jpeg", "pdf", "md", "json", "docx", "xlsx", "zip", "xz", "py", "m", "svg",
    "parquet", "log",
];

enum Seen {
    Frf(FoundFrf),
    Force(FoundForce),
    NotUsed(String, String),
}

/// Looks through `dir` and the folders below. Hidden files, the folder `report` and campaigns of their own are passed
/// over; links are followed to files inside the folder only.
///
/// # Errors
/// A folder that cannot be read, or holds more files than anybody measures.
pub fn scan(dir: &Path) -> Result<Scan> {
    let root = dir.canonicalize().map_err(|e| Error::io(dir, e))?;
    let mut files = Vec::new();
    collect(dir, &root, 0, &mut files)?;
    files.sort();
    let mut scan = Scan::default();
    let mut robots = Vec::new();
    let mut measurements = Vec::new();
    for file in files {
        let name = relative(dir, &file);
        let ending = file
            .extension()
            .map(|e| e.to_string_lossy().to_lowercase())
            .unwrap_or_default();
        if ending == "toml" {
            if RobotSpec::load(&name, dir).is_ok() {
                robots.push(name);
            }
        } else if !OTHERS.contains(&ending.as_str()) && file != campaign_file(dir) {
            measurements.push((name, file));
        }
    }
    if let [robot] = &robots[..] {
        scan.robot = Some(robot.clone());
    }
    // In parallel, but collected in order: the result does not depend on the threads.
    let seen: Vec<Seen> = measurements
        .into_par_iter()
        .map(|(name, file)| look(name, &file))
        .collect();
    for one in seen {
        match one {
            Seen::Frf(frf) => scan.frfs.push(frf),
            Seen::Force(force) => scan.forces.push(force),
            Seen::NotUsed(path, why) => scan.not_used.push((path, why)),
        }
    }
    // Several FRF files in each of several folders: a folder is a posture.
    let mut folders: BTreeMap<String, usize> = BTreeMap::new();
    for frf in &scan.frfs {
        let folder = frf.path.rsplit_once('/').map_or("", |(folder, _)| folder);
        *folders.entry(folder.to_string()).or_default() += 1;
    }
    let in_folders = folders.len() > 1 && !folders.contains_key("");
    for frf in &mut scan.frfs {
        frf.posture = posture_of(&frf.path, in_folders);
    }
    Ok(scan)
}

fn relative(dir: &Path, file: &Path) -> String {
    let inside = file.strip_prefix(dir).unwrap_or(file);
    let parts: Vec<String> = inside
        .components()
        .map(|c| c.as_os_str().to_string_lossy().into_owned())
        .collect();
    parts.join("/")
}

fn collect(dir: &Path, root: &Path, depth: usize, files: &mut Vec<PathBuf>) -> Result<()> {
    let entries = std::fs::read_dir(dir).map_err(|e| Error::io(dir, e))?;
    for entry in entries {
        let path = entry.map_err(|e| Error::io(dir, e))?.path();
        // What has no Unicode name cannot stand in a campaign file.
        let Some(name) = path.file_name().and_then(|n| n.to_str()) else {
            continue;
        };
        let Ok(kind) = std::fs::symlink_metadata(&path).map(|m| m.file_type()) else {
            continue;
        };
        if name.starts_with('.') || (name == "report" && kind.is_dir()) {
            continue;
        }
        if kind.is_dir() {
            if depth < DEEPEST && !campaign_file(&path).is_file() {
                collect(&path, root, depth + 1, files)?;
            }
        } else if kind.is_file()
            || (kind.is_symlink()
                && path
                    .canonicalize()
                    .is_ok_and(|real| real.starts_with(root) && real.is_file()))
        {
            files.push(path);
        }
        if files.len() > MOST_FILES {
            return Err(InputError::new(format!("holds more than {MOST_FILES} files"))
                .file(root)
                .remedy("give the folder of one campaign, not the drive that all lie on")
                .into());
        }
    }
    Ok(())
}

fn look(name: String, file: &Path) -> Seen {
    let read = match survey(file) {
        Ok(survey) => survey.file,
        Err(Error::Input(error)) => {
            let why = match error.remedy {
                Some(remedy) => format!("{} ({remedy})", error.problem),
                None => error.problem.clone(),
            };
            return Seen::NotUsed(name, why);
        }
        Err(error) => return Seen::NotUsed(name, error.to_string()),
    };
    let contents = read.contents;
    if !contents.frfs.is_empty() {
        let placed = contents
            .frfs
            .iter()
            .all(|f| f.response.is_some() && f.reference.is_some());
        if !placed {
            let why = "does not say at which node and in which direction it was measured (name the columns \
                       re(1X/1X),im(1X/1X): response / excitation)";
            return Seen::NotUsed(name, why.into());
        }
        let quantities: Vec<Option<Quantity>> = contents.frfs.iter().map(|f| f.quantity).collect();
        let all_say = quantities.iter().all(Option::is_some);
        let dofs = contents.frfs.iter().flat_map(|f| [f.response, f.reference]);
        return Seen::Frf(FoundFrf {
            posture: String::new(),
            quantity: quantities[0].filter(|_| all_say),
            nodes: dofs.flatten().map(|d| d.node).collect(),
            facts: facts_of(stem(&name)),
            path: name,
        });
    }
    let mut channels = contents.times.iter().flat_map(|t| &t.channels);
    if channels.any(|c| c.role != ChannelRole::Other) {
        return Seen::Force(FoundForce {
            // The whole path: folders are named by what was cut, too.
            from_name: facts_of(name.rsplit_once('.').map_or(name.as_str(), |(stem, _)| stem)),
            from_header: header(file),
            path: name,
        });
    }
    let why = match contents.times.is_empty() {
        true => format!("holds {}", contents.describe()),
        false => {
            "a time record without cutting forces (a tap test? `lobestone modal` makes FRFs of it)".into()
        }
    };
    Seen::NotUsed(name, why)
}

/// Name without folders and ending.
pub(super) fn stem(path: &str) -> &str {
    let file = path.rsplit('/').next().unwrap_or(path);
    file.rsplit_once('.').map_or(file, |(stem, _)| stem)
}

fn header(file: &Path) -> Facts {
    let mut start = Vec::new();
    let read = std::fs::File::open(file).and_then(|f| f.take(4096).read_to_end(&mut start));
    match read {
        Ok(_) => facts_of_header(&start),
        Err(_) => Facts::new(),
    }
}
