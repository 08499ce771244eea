//! Output-only modal analysis of recorded responses: which channels of a file move, and what they say.

use std::path::Path;

use crate::ingest::units;
use crate::ingest::{self, Channel, TimeRecord};
use crate::modal::operational::{
    OperationalModes, OperationalRecord, OperationalSettings, operational_modes,
};
use crate::{Error, InputError, Result};

/// One file (records of the same channels in it are one record) and its modes.
#[derive(Debug, Clone)]
pub struct OperationalSet {
    /// Path of the file, as given.
    pub file: String,
    /// Names of the channels, in the order of the shapes.
    pub channels: Vec<String>,
    /// Length of the record that was used, s.
    pub length_s: f64,
    /// The modes in it.
    pub modes: OperationalModes,
    /// What was noticed while reading and fitting.
    pub warnings: Vec<String>,
}

/// Modes of every file. `rate_hz`: sampling rate of records that say neither times nor a rate.
///
/// # Errors
/// A file that cannot be read, holds no responses, or too few samples of them.
pub fn of_files(
    files: &[impl AsRef<Path>],
    rate_hz: Option<f64>,
    settings: &OperationalSettings,
) -> Result<Vec<OperationalSet>> {
    files
        .iter()
        .map(|f| of_file(f.as_ref(), rate_hz, settings))
        .collect()
}

fn of_file(path: &Path, rate_hz: Option<f64>, settings: &OperationalSettings) -> Result<OperationalSet> {
    let file = ingest::read_file_at(path, rate_hz)?;
    let mut warnings = file.warnings;
    // Of several records the longest: correlations must not reach over the seam.
    let record = file.contents.times.iter().max_by_key(|r| r.len());
    let Some(record) = record else {
        return Err(
            InputError::new(format!("no time record in this {} file", file.format))
                .file(path)
                .remedy("output-only analysis needs recorded accelerations; FRFs go to `lobestone modal` without it")
                .into(),
        );
    };
    if file.contents.times.len() > 1 {
        warnings.push(format!(
            "{} time records in the file: the longest, {:.1} s, is used",
            file.contents.times.len(),
            record.len() as f64 / record.sample_rate_hz
        ));
    }
    let moving = responses(record, &mut warnings);
    if moving.is_empty() {
        return Err(InputError::new("no response channel in the record")
            .file(path)
            .remedy("give the sensors' channels a unit: m/s² or g, m/s, m or µm")
            .into());
    }
    let samples: Vec<&[f64]> = moving.iter().map(|c| c.samples.as_slice()).collect();
    let responses = OperationalRecord {
        sample_rate_hz: record.sample_rate_hz,
        channels: &samples,
        differentiations: &differentiations(&moving),
    };
    let modes = operational_modes(&responses, settings).map_err(|e| match e {
        Error::Input(e) => (*e).file(path).into(),
        other => other,
    })?;
    warnings.extend(modes.warnings.iter().cloned());
    Ok(OperationalSet {
        file: path.display().to_string(),
        channels: moving.iter().map(|c| c.name.clone()).collect(),
        length_s: record.len() as f64 / record.sample_rate_hz,
        modes,
        warnings,
    })
}

/// How often each channel has to be differentiated in time to be what the one is that is differentiated most (displacement, velocity,
/// acceleration); nothing where a unit is not known.
fn differentiations(channels: &[&Channel]) -> Vec<u8> {
    let derivative = |c: &&Channel| Some(units::parse(&c.file_unit)?.dimension.motion()?.derivatives());
    let Some(found) = channels.iter().map(derivative).collect::<Option<Vec<u8>>>() else {
        return Vec::new();
    };
    let highest = found.iter().copied().max().unwrap_or(0);
    found.iter().map(|derivative| highest - derivative).collect()
}

/// The channel of one sensor's record that is at every sample the root of the sum of squares of the other two or three, as telephones
/// write beside the directions ("absolute acceleration"): it rectifies, so its frequencies are none of the structure.
fn total_of_the_others(channels: &[&Channel]) -> Option<usize> {
    if !(3..=4).contains(&channels.len()) {
        return None;
    }
    (0..channels.len()).find(|at| {
        let total = &channels[*at].samples;
        let others = || {
            channels
                .iter()
                .enumerate()
                .filter(|(k, _)| k != at)
                .map(|(_, c)| c)
        };
        let largest = total.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        // Two others at least move, or a channel would be the total of one beside a dead one.
        let moving = others()
            .filter(|c| c.samples.iter().any(|v| v.abs() > 0.01 * largest))
            .count();
        moving >= 2
            && total.iter().enumerate().all(|(k, total)| {
                let square: f64 = others().filter_map(|c| c.samples.get(k)).map(|v| v * v).sum();
                (square.sqrt() - total).abs() <= 2e-3 * largest
            })
    })
}

/// Channels in a unit of motion; where none has one, all that are no force and no moment. A channel that rests is left
/// out and named.
fn responses<'a>(record: &'a TimeRecord, warnings: &mut Vec<String>) -> Vec<&'a Channel> {
    let dimension = |c: &Channel| units::parse(&c.file_unit).map(|u| u.dimension);
    let motion = |c: &&Channel| dimension(c).is_some_and(|d| d.motion().is_some());
    let unknown = |c: &&Channel| dimension(c).is_none_or(|d| d.describe().is_none());
    let mut found: Vec<&Channel> = record.channels.iter().filter(motion).collect();
    if found.is_empty() {
        found = record.channels.iter().filter(unknown).collect();
        if !found.is_empty() {
            warnings.push(format!(
                "the file gives no unit of motion: {} taken as responses as they stand",
                found
                    .iter()
                    .map(|c| c.name.as_str())
                    .collect::<Vec<_>>()
                    .join(", ")
            ));
        }
    }
    let left: Vec<&str> = record
        .channels
        .iter()
        .filter(|c| !found.iter().any(|f| std::ptr::eq(*f, *c)))
        .map(|c| c.name.as_str())
        .collect();
    if !left.is_empty() {
        warnings.push(format!("no responses, left out: {}", left.join(", ")));
    }
    if let Some(total) = total_of_the_others(&found) {
        warnings.push(format!(
            "channel {} is the size of the other {} together (root of the sum of squares), no motion along a direction: left out",
            found[total].name,
            found.len() - 1
        ));
        found.remove(total);
    }
    found.retain(|c| {
        let moves = c.samples.windows(2).any(|w| w[0] != w[1]);
        if !moves {
            warnings.push(format!("channel {} does not move: left out", c.name));
        }
        moves
    });
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel(name: &str, value: impl Fn(f64) -> f64) -> Channel {
        Channel {
            name: name.into(),
            file_unit: "m/s^2".into(),
            role: crate::data::ChannelRole::Other,
            samples: (0..400).map(|k| value(f64::from(k))).collect(),
        }
    }

    #[test]
    fn a_total_beside_its_directions_is_no_response() {
        let (x, y, z) = (
            |k: f64| (0.3 * k).sin(),
            |k: f64| (0.11 * k).cos(),
            |k: f64| 9.81 + (0.7 * k).sin(),
        );
        let of = |channels: Vec<Channel>| {
            let record = TimeRecord {
                sample_rate_hz: 100.0,
                start_s: 0.0,
                channels,
                filled: Vec::new(),
            };
            let mut warnings = Vec::new();
            let names: Vec<String> = responses(&record, &mut warnings)
                .iter()
                .map(|c| c.name.clone())
                .collect();
            (names, warnings)
        };
        let total = move |k: f64| x(k).hypot(y(k)).hypot(z(k));
        let (names, warnings) = of(vec![
            channel("x", x),
            channel("y", y),
            channel("z", z),
            channel("abs", total),
        ]);
        assert_eq!(names, ["x", "y", "z"]);
        assert!(
            warnings[0].contains("channel abs is the size of the other 3"),
            "{warnings:?}"
        );
        // A sensor of its own, and one beside a dead channel, stay.
        let (names, _) = of(vec![
            channel("x", x),
            channel("y", y),
            channel("z", z),
            channel("other", y),
        ]);
        assert_eq!(names.len(), 4);
        let (names, _) = of(vec![
            channel("z", z),
            channel("same", z),
            channel("dead", |_| 0.0),
        ]);
        assert_eq!(names, ["z", "same"]);
    }
}
