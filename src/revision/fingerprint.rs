//! Which data a revision was fitted to.

use std::fmt::Debug;
use std::path::Path;

use super::Domain;
use crate::campaign::{Campaign, LinkTolerances};
use crate::{Error, Result};

/// FNV-1a, 64 bits (Fowler, Noll & Vo): notices a change; it need not resist anyone who wants to deceive himself.
struct Fnv(u64);

impl Fnv {
    fn new() -> Self {
        Fnv(0xcbf2_9ce4_8422_2325)
    }

    fn bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
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
        let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
        self.part(&bytes);
        Ok(())
    }
}

/// Fingerprint of all that the structural fit rests on: robot, postures, points, and the content of the FRF files. Where
/// the folder lies, what its files are called and what else is in it do not matter.
///
/// # Errors
/// A file that cannot be read.
pub fn structure_fingerprint(campaign: &Campaign) -> Result<String> {
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
    for frf in &campaign.frfs {
        hash.value(&(frf.posture, frf.quantity, frf.force_level_n));
        hash.file(&frf.file)?;
    }
    Ok(format!("{:016x}", hash.0))
}

/// Fingerprint of all that the fit of the force records rests on: tool, dynamometer, cuts and the content of the records.
///
/// # Errors
/// A file that cannot be read.
pub fn cutting_fingerprint(campaign: &Campaign) -> Result<String> {
    let mut hash = Fnv::new();
    hash.value(&campaign.tool);
    hash.value(&campaign.dynamometer);
    for cut in &campaign.cuts {
        hash.value(&(cut.spindle_rpm, &cut.geometry, cut.order, cut.steady_s));
        hash.file(&cut.file)?;
    }
    Ok(format!("{:016x}", hash.0))
}

/// Fingerprint of one side of a campaign.
///
/// # Errors
/// A file that cannot be read.
pub fn fingerprint(campaign: &Campaign, domain: Domain) -> Result<String> {
    match domain {
        Domain::Structure => structure_fingerprint(campaign),
        Domain::Cutting => cutting_fingerprint(campaign),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_values() {
        for (text, expected) in [("", 0xcbf2_9ce4_8422_2325), ("foobar", 0x8594_4171_f739_67e8)] {
            let mut hash = Fnv::new();
            hash.bytes(text.as_bytes());
            assert_eq!(hash.0, expected, "{text}");
        }
    }
}
