//! Faults that time records show: clipping, stuck samples, spikes, no air time. Few and sure: a warning that is
//! wrong half the time is read never.

use super::{Channel, ChannelRole, TimeRecord};

/// What looks wrong with a record. Works on the samples alone; dropped samples are found while reading.
pub fn quality_warnings(record: &TimeRecord) -> Vec<String> {
    let mut warnings = Vec::new();
    let time = |sample: usize| record.start_s + sample as f64 / record.sample_rate_hz;
    for channel in &record.channels {
        let name = &channel.name;
        let Some((low, high)) = range(&channel.samples) else {
            continue;
        };
        if low == high {
            warnings.push(format!(
                "{name}: the same value in every sample, the channel is dead"
            ));
            continue;
        }
        if let Some(at) = clipped(&channel.samples, low, high) {
            warnings.push(format!(
                "{name}: clipped (first at {:.4} s): the range of the channel is too small",
                time(at)
            ));
        }
        if let Some((at, length)) = stuck(&channel.samples, low, high) {
            warnings.push(format!(
                "{name}: {length} samples stuck at one value from {:.4} s on",
                time(at)
            ));
        }
        let spikes = spikes(&channel.samples);
        if let Some(first) = spikes.first() {
            warnings.push(format!(
                "{name}: {} single-sample spikes (first at {:.4} s)",
                spikes.len(),
                time(*first)
            ));
        }
    }
    warnings.extend(no_air(record));
    warnings
}

fn range(samples: &[f64]) -> Option<(f64, f64)> {
    let first = *samples.first()?;
    Some(
        samples
            .iter()
            .fold((first, first), |(low, high), v| (low.min(*v), high.max(*v))),
    )
}

/// Runs of equal samples: start and length.
fn runs(samples: &[f64]) -> impl Iterator<Item = (usize, usize)> + '_ {
    let mut at = 0;
    samples.chunk_by(|a, b| a == b).map(move |run| {
        at += run.len();
        (at - run.len(), run.len())
    })
}

/// Samples in a row at the extreme value that make a plateau.
const PLATEAU: usize = 3;

/// First sample of a clipped peak: at least two plateaus at an extreme value.
fn clipped(samples: &[f64], low: f64, high: f64) -> Option<usize> {
    // Signals of few digits repeat values by nature: nothing can be said about plateaus there.
    let repeats = samples
        .windows(2)
        .filter(|w| w[0] == w[1] && w[0] != low && w[0] != high)
        .count();
    if 10 * repeats > samples.len() {
        return None;
    }
    for extreme in [high, low] {
        let plateaus: Vec<(usize, usize)> = runs(samples)
            .filter(|&(at, n)| n >= PLATEAU && samples[at] == extreme)
            .collect();
        let total: usize = plateaus.iter().map(|p| p.1).sum();
        // A single long one is a stuck channel rather than a peak cut off.
        if plateaus.len() >= 2 && total >= 2 * PLATEAU {
            return plateaus.first().map(|p| p.0);
        }
    }
    None
}

/// Samples in a row without any change that mean a stuck channel.
const STUCK: usize = 20;

fn stuck(samples: &[f64], low: f64, high: f64) -> Option<(usize, usize)> {
    let longest = runs(samples).max_by_key(|r| r.1)?;
    let (at, length) = longest;
    // Quiet stretches of a coarse channel repeat too; leave them out of the count of repeats.
    let others = samples[..at].windows(2).chain(samples[at + length..].windows(2));
    let (repeats, all) = others.fold((0, 0), |(r, n), w| (r + usize::from(w[0] == w[1]), n + 1));
    let clipping = (samples[at] == low || samples[at] == high) && length < 2 * STUCK;
    (length >= STUCK && !clipping && 10 * repeats < all).then_some((at, length))
}

/// Single samples far out of line with both neighbours.
fn spikes(samples: &[f64]) -> Vec<usize> {
    if samples.len() < 200 {
        return Vec::new();
    }
    let bend = |i: usize| (samples[i] - 0.5 * (samples[i - 1] + samples[i + 1])).abs();
    let mut bends: Vec<f64> = (1..samples.len() - 1).map(bend).collect();
    let rank = (bends.len() as f64 * 0.998) as usize;
    let (_, &mut usual, _) = bends.select_nth_unstable_by(rank.min(samples.len() - 3), f64::total_cmp);
    if usual == 0.0 {
        return Vec::new();
    }
    let alone = |i: &usize| {
        let (before, after) = (samples[i - 1] - samples[*i], samples[i + 1] - samples[*i]);
        bend(*i) > 8.0 * usual && before * after > 0.0 && before.abs().min(after.abs()) > 6.0 * usual
    };
    (1..samples.len() - 1).filter(alone).collect()
}

/// Pieces a force record is cut into to see when the tool cuts.
const PIECES: usize = 40;

/// Distance (of means in spreads, or of the logarithms of spreads) up to which a piece looks like the middle of the
/// record: in the cut it is about 0.2, air before and after a cut gave 2.9 and more on 251 records.
const LIKE_THE_MIDDLE: f64 = 0.7;

/// Says where a force record starts or ends in the cut: there drift cannot be told from edge force.
fn no_air(record: &TimeRecord) -> Option<String> {
    let forces: Vec<&Channel> = record
        .channels
        .iter()
        .filter(|c| {
            matches!(
                c.role,
                ChannelRole::ForceX | ChannelRole::ForceY | ChannelRole::ForceZ
            )
        })
        .collect();
    if forces.len() < 2 || record.len() < 20 * PIECES {
        return None;
    }
    let width = record.len() / PIECES;
    // Mean and spread of each piece, in units of how much these differ over the record.
    let mut distance_of_ends = [0.0_f64; 2];
    for channel in forces {
        let pieces: Vec<(f64, f64)> = channel
            .samples
            .chunks_exact(width)
            .take(PIECES)
            .map(mean_and_spread)
            .collect();
        let typical = |pick: fn(&(f64, f64)) -> f64| {
            let mut values: Vec<f64> = pieces[PIECES / 4..3 * PIECES / 4].iter().map(pick).collect();
            values.sort_by(f64::total_cmp);
            values[values.len() / 2]
        };
        let (mean, spread) = (typical(|p| p.0), typical(|p| p.1));
        for (end, piece) in distance_of_ends.iter_mut().zip([pieces[0], pieces[PIECES - 1]]) {
            let differs = ((piece.0 - mean).abs() / spread.max(f64::MIN_POSITIVE))
                .max((spread / piece.1.max(f64::MIN_POSITIVE)).max(1e-9).ln().abs());
            *end = end.max(differs);
        }
    }
    let in_cut = distance_of_ends.map(|d| d < LIKE_THE_MIDDLE);
    let text = match in_cut {
        [true, true] => "no air time seen before and after the cut",
        [true, false] => "no air time seen before the cut",
        [false, true] => "no air time seen after the cut",
        [false, false] => return None,
    };
    Some(format!("{text}: drift cannot be told from edge force"))
}

fn mean_and_spread(samples: &[f64]) -> (f64, f64) {
    let n = samples.len() as f64;
    let mean = samples.iter().sum::<f64>() / n;
    let spread = (samples.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
    (mean, spread)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Two force channels at 1 kHz with noise, cutting from `from` to `to` s of 4 s.
    fn record(from: f64, to: f64) -> TimeRecord {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let mut force = |level: f64| {
            (0..4000)
                .map(|i| {
                    let t = f64::from(i) * 1e-3;
                    let cut = if (from..to).contains(&t) {
                        level * (1.2 + (t * 400.0).sin())
                    } else {
                        0.0
                    };
                    cut + 3.0 * t + random.random_range(-5.0..5.0)
                })
                .collect()
        };
        let channel = |name: &str, role, samples| Channel {
            name: name.into(),
            file_unit: "N".into(),
            role,
            samples,
        };
        let channels = vec![
            channel("Fx", ChannelRole::ForceX, force(100.0)),
            channel("Fy", ChannelRole::ForceY, force(-60.0)),
        ];
        TimeRecord {
            sample_rate_hz: 1000.0,
            start_s: 0.0,
            channels,
        }
    }

    fn warnings(change: impl Fn(&mut [f64])) -> Vec<String> {
        let mut record = record(0.8, 3.2);
        change(&mut record.channels[0].samples);
        quality_warnings(&record)
    }

    #[test]
    fn a_good_record_gives_no_alarm() {
        assert_eq!(warnings(|_| ()), Vec::<String>::new());
        // Coarse digits: values repeat all the time.
        assert_eq!(
            warnings(|v| v.iter_mut().for_each(|v| *v = (*v / 20.0).round())),
            Vec::<String>::new()
        );
    }

    #[test]
    fn faults_are_found_where_they_are() {
        for (found, what) in [
            (
                warnings(|v| v.iter_mut().for_each(|v| *v = v.min(180.0))),
                "Fx: clipped",
            ),
            (
                warnings(|v| v[1000..1050].fill(12.0)),
                "Fx: 50 samples stuck at one value from 1.0000 s",
            ),
            (warnings(|v| v.fill(1.0)), "Fx: the same value"),
            (
                warnings(|v| v[500] += 5000.0),
                "Fx: 1 single-sample spikes (first at 0.5000 s)",
            ),
        ] {
            assert!(
                found.len() == 1 && found[0].starts_with(what),
                "{what}: {found:?}"
            );
        }
    }

    #[test]
    fn records_without_air_time_are_told() {
        for (from, to, what) in [
            (0.0, 3.0, "before"),
            (1.0, 4.0, "after"),
            (0.0, 4.0, "before and after"),
        ] {
            let found = quality_warnings(&record(from, to));
            assert!(
                found.len() == 1 && found[0].contains(&format!("no air time seen {what} the cut")),
                "{found:?}"
            );
        }
    }
}
