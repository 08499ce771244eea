//! Which data a revision was fitted to.

use std::fmt::Debug;
use std::hash::Hasher;
use std::path::Path;

use fnv::FnvHasher;

use super::folder::log_file;
use crate::Result;
use crate::campaign::form::paths;
use crate::campaign::{Campaign, LinkTolerances, campaign_file, named_files};
use crate::identify::model_history::Side;
use crate::ingest::Digest;

/// FNV-1a, 64 bits (Fowler, Noll & Vo): notices a change; it need not resist anyone who wants to deceive himself.
#[derive(Default)]
struct Fnv(FnvHasher);

impl Fnv {
    fn new() -> Self {
        Fnv::default()
    }

    fn bytes(&mut self, bytes: &[u8]) {
        self.0.write(bytes);
    }

    /// 16 hexadecimal digits.
    fn text(&self) -> String {
        format!("{:016x}", self.0.finish())
    }

    /// With its length, so that two parts cannot run into each other.
    fn part(&mut self, bytes: &[u8]) {
        self.bytes(&(bytes.len() as u64).to_le_bytes());
        self.bytes(bytes);
    }

    fn value(&mut self, value: &impl Debug) {
        self.part(format!("{value:?}").as_bytes());
    }

    fn file(&mut self, path: &Path) -> Result<()> {
        self.value(&Digest::read(path)?);
        Ok(())
    }

    /// A file of any size, or that it cannot be read.
    fn file_or_absence(&mut self, path: &Path) {
        match Digest::read(path) {
            Ok(digest) => self.value(&digest),
            Err(_) => self.part(b"absent"),
        }
    }
}

/// Of each file, as it was read; of the file as it lies on the disk where that is not known.
fn known_or_read(known: Option<Digest>, path: &Path) -> Result<Digest> {
    known.map_or_else(|| Digest::read(path), Ok)
}

/// Fingerprint of all that the structural fit rests on: robot, postures, points, and the content of the FRF files. Where
/// the folder lies, what its files are called and what else is in it do not matter.
///
/// `frfs`: what is known of the FRF files, in the order of the campaign; a file beyond its end is read.
///
/// # Errors
/// A file that cannot be read.
pub fn structure_fingerprint(campaign: &Campaign, frfs: &[Digest]) -> Result<String> {
    let mut hash = Fnv::new();
    if let Some(robot) = &campaign.robot {
        hash.value(&(robot.mass_tolerance, robot.stiffness_tolerance));
        if robot.links != LinkTolerances::default() {
            hash.value(&robot.links);
        }
        let file = campaign.dir.join(&robot.model);
        if file.is_file() {
            hash.file(&file)?;
        } else {
            // Built in.
            hash.part(robot.model.as_bytes());
        }
    }
    for posture in &campaign.postures {
        hash.value(&posture.joints_deg);
    }
    for point in &campaign.points {
        hash.value(&(point.node, point.body, point.position_m, point.axes));
    }
    for (i, frf) in campaign.frfs.iter().enumerate() {
        hash.value(&(frf.posture, frf.quantity, frf.force_level_n));
        hash.value(&known_or_read(frfs.get(i).copied(), &frf.file)?);
    }
    Ok(hash.text())
}

/// Fingerprint of all that the fit of the force records rests on: tool, dynamometer, cuts and the content of the records.
///
/// `records`: what is known of the record of each cut.
///
/// # Errors
/// A file that cannot be read.
pub fn cutting_fingerprint(campaign: &Campaign, records: &[Option<Digest>]) -> Result<String> {
    let mut hash = Fnv::new();
    hash.value(&campaign.tool);
    hash.value(&campaign.dynamometer);
    for (i, cut) in campaign.cuts.iter().enumerate() {
        hash.value(&(cut.spindle_rpm, &cut.geometry, cut.order, cut.steady_s));
        hash.value(&known_or_read(records.get(i).copied().flatten(), &cut.file)?);
    }
    Ok(hash.text())
}

/// Fingerprint of one side of a campaign.
///
/// # Errors
/// A file that cannot be read.
pub fn fingerprint(campaign: &Campaign, side: Side) -> Result<String> {
    match side {
        Side::Structure => structure_fingerprint(campaign, &[]),
        Side::Cutting => cutting_fingerprint(campaign, &[]),
    }
}

/// Fingerprint of the content of files, in the order given; what they are called does not matter.
///
/// # Errors
/// A file that cannot be read.
pub fn files_fingerprint(files: &[impl AsRef<Path>]) -> Result<String> {
    let mut hash = Fnv::new();
    for file in files {
        hash.file(file.as_ref())?;
    }
    Ok(hash.text())
}

/// Fingerprint of a campaign's folder as it lies on the disk, and of `options`: the text of `campaign.toml`, the revisions,
/// and every file that it names, under its name. A campaign that cannot be loaded has one, too: a file that is not there
/// counts as such, so that it makes a difference when it comes.
pub fn folder_fingerprint(dir: &Path, options: &[&str]) -> String {
    let mut hash = Fnv::new();
    hash.value(&options);
    let file = campaign_file(dir);
    hash.file_or_absence(&file);
    hash.file_or_absence(&log_file(dir));
    let text = match crate::files::regular_file(&file) {
        Ok(()) => std::fs::read_to_string(&file).unwrap_or_default(),
        Err(_) => String::new(),
    };
    for name in named_files(&text) {
        hash.part(name.as_bytes());
        match paths::inside(dir, &name) {
            Ok(path) => hash.file_or_absence(&path),
            Err(_) => hash.part(b"absent"),
        }
    }
    hash.text()
}

/// FNV-1a of a text, 16 hexadecimal digits: a file name for whatever characters are in it.
pub fn text_fingerprint(text: &str) -> String {
    let mut hash = Fnv::new();
    hash.bytes(text.as_bytes());
    hash.text()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_has_another_fingerprint_when_a_file_comes_or_changes() {
        let folder = tempfile::tempdir().unwrap();
        let dir = folder.path();
        let write = |name: &str, text: &str| std::fs::write(dir.join(name), text).unwrap();
        let mut seen = vec![folder_fingerprint(dir, &["a"])];
        let mut note = |what: &str, options: &[&str]| {
            let now = folder_fingerprint(dir, options);
            assert_eq!(now, folder_fingerprint(dir, options));
            assert!(!seen.contains(&now), "{what}");
            seen.push(now);
        };
        write("campaign.toml", "[[frf]]\nfile = 'p.uff'\n");
        note("campaign.toml came", &["a"]);
        note("other options", &["b"]);
        write("p.uff", "1");
        note("the file came", &["a"]);
        write("p.uff", "2");
        note("the file changed", &["a"]);
        std::fs::create_dir(dir.join("lobestone")).unwrap();
        std::fs::write(log_file(dir), "{}").unwrap();
        note("a revision came", &["a"]);
        write("other.uff", "1");
        assert_eq!(
            &folder_fingerprint(dir, &["a"]),
            seen.last().unwrap(),
            "a file that is not named"
        );
    }

    #[test]
    fn published_values() {
        for (text, expected) in [("", 0xcbf2_9ce4_8422_2325), ("foobar", 0x8594_4171_f739_67e8)] {
            let mut hash = Fnv::new();
            hash.bytes(text.as_bytes());
            assert_eq!(hash.0.finish(), expected, "{text}");
        }
    }
}
