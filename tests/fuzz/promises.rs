//! What every reader promises, whatever the bytes: shared by the mutation runner of the tests and the targets of cargo-fuzz.

use std::path::Path;

use lobestone::campaign::Campaign;
use lobestone::data::RobotSpec;
use lobestone::ingest::{self, Contents};
use lobestone::revision::RevisionLog;

/// A measurement file of any format; true where it was read.
pub fn reads_measurements(bytes: &[u8]) -> bool {
    match ingest::read_memory(bytes) {
        Ok(file) => {
            assert_sound(&file.contents);
            true
        }
        Err(error) => {
            let shown = error.to_string();
            assert!(
                !shown.contains(|c: char| c.is_control() && c != '\t' && c != '\n'),
                "{shown:?}"
            );
            false
        }
    }
}

/// A `campaign.toml` of `folder`; true where it was read.
pub fn reads_campaign(folder: &Path, bytes: &[u8]) -> bool {
    Campaign::from_text(folder, &String::from_utf8_lossy(bytes)).is_ok()
}

/// Puts empty files where a `campaign.toml` names some: a campaign whose files are missing is not read to its end.
pub fn put_files(folder: &Path, toml: &str) {
    for file in toml.lines().filter_map(|l| l.strip_prefix("file = ")) {
        let file = folder.join(file.split('"').nth(1).unwrap());
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(file, "").unwrap();
    }
}

/// A robot file; true where it was read.
pub fn reads_robot(bytes: &[u8]) -> bool {
    RobotSpec::from_text(Path::new("robot.toml"), &String::from_utf8_lossy(bytes)).is_ok()
}

/// The log of revisions of `folder`; true where it was read.
pub fn reads_revisions(folder: &Path, bytes: &[u8]) -> bool {
    RevisionLog::from_bytes(folder, bytes).is_ok()
}

/// The promise of every reader to its callers.
fn assert_sound(contents: &Contents) {
    for frf in &contents.frfs {
        assert_eq!(frf.frequency_hz.len(), frf.value.len());
        assert!(!frf.value.is_empty());
        assert!(frf.frequency_hz.windows(2).all(|w| w[0] < w[1]));
        assert!(frf.frequency_hz.iter().all(|f| f.is_finite() && *f >= 0.0));
        assert!(frf.value.iter().all(|v| v.norm() <= 1e15));
        let coherence = frf.coherence.iter().flatten();
        assert!(coherence.clone().all(|c| (0.0..=1.0).contains(c)));
        assert!(frf.coherence.as_ref().is_none_or(|c| c.len() == frf.value.len()));
        assert!(
            !frf.name.contains(|c: char| c.is_control() && c != '\t'),
            "{:?}",
            frf.name
        );
    }
    for record in &contents.times {
        assert!(
            record.sample_rate_hz > 0.0 && record.sample_rate_hz.is_finite() && record.start_s.is_finite()
        );
        for channel in &record.channels {
            assert_eq!(channel.samples.len(), record.len());
            assert!(channel.samples.iter().all(|v| v.abs() <= 1e15));
            assert!(
                !channel.name.contains(|c: char| c.is_control() && c != '\t'),
                "{:?}",
                channel.name
            );
        }
        let _ = ingest::quality_warnings(record);
    }
    for other in &contents.others {
        assert!(other.abscissa.iter().all(|v| v.is_finite()) && other.value.iter().all(|v| v.is_finite()));
    }
}
