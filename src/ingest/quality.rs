//! Faults that time records show, in words: clipping, stuck samples, spikes, channels that are alike or far too small, drift,
//! no air time.

use std::ops::Range;

use rayon::prelude::*;

use super::units::figures;
use crate::data::{Channel, ChannelRole, TimeRecord};
use crate::signal::{self, DriftLine, Spindle, find_faults, find_phases, fit_drift, least_and_greatest};

/// What looks wrong with a record. Works on the samples alone; dropped samples are found while reading.
pub fn quality_warnings(record: &TimeRecord) -> Vec<String> {
    let mut check = QualityCheck::default();
    check.add(record);
    check.warnings()
}

/// Looks at a record piece by piece, so that one of any length is looked at in little memory: samples by the piece, what
/// needs the whole record on a thinned copy.
#[derive(Debug, Default)]
pub struct QualityCheck {
    channels: Vec<Found>,
    /// Every n-th sample.
    thinned: Option<TimeRecord>,
    every: usize,
    seen: usize,
}

/// What was found in one channel so far.
#[derive(Debug, Default)]
struct Found {
    alive: bool,
    clipped: Stretches,
    stuck: Stretches,
    spikes: Stretches,
    range: Option<(f64, f64)>,
    /// Every sample so far equals that of this channel before it.
    same_as: Option<usize>,
}

/// Places of one kind of fault.
#[derive(Debug, Default)]
struct Stretches {
    count: usize,
    samples: usize,
    /// Time and value of the first, and its length.
    first: Option<(f64, f64, usize)>,
}

impl Stretches {
    fn add(&mut self, ranges: &[Range<usize>], time: impl Fn(usize) -> f64, value: impl Fn(usize) -> f64) {
        self.count += ranges.len();
        self.samples += ranges.iter().map(Range::len).sum::<usize>();
        if let (None, Some(first)) = (self.first, ranges.first()) {
            self.first = Some((time(first.start), value(first.start), first.len()));
        }
    }
}

/// Samples kept for what needs the whole record.
const THINNED: usize = 1 << 19;

impl QualityCheck {
    /// For a record of about `samples` in all.
    pub fn for_length(samples: usize) -> Self {
        QualityCheck {
            every: samples.div_ceil(THINNED).max(1),
            ..Self::default()
        }
    }

    /// The next piece, with the same channels as those before.
    pub fn add(&mut self, piece: &TimeRecord) {
        let every = self.every.max(1);
        let channels = &piece.channels;
        self.channels
            .resize_with(channels.len().max(self.channels.len()), Found::default);
        let first_piece = self.seen == 0;
        let look = |(i, (channel, found)): (usize, (&Channel, &mut Found))| {
            let samples = &channel.samples;
            let alike = |j: usize| channels[j].role != ChannelRole::Other && channels[j].samples == *samples;
            let twin = (channel.role != ChannelRole::Other)
                .then(|| (0..i).find(|j| alike(*j)))
                .flatten();
            found.same_as = twin.filter(|j| first_piece || found.same_as == Some(*j));
            let faults = find_faults(samples);
            let before = found.range;
            found.range = range(samples)
                .into_iter()
                .chain(before)
                .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
            if faults.dead && found.range.is_some_and(|r| r.0 == r.1) {
                return;
            }
            let time = |sample: usize| piece.start_s + sample as f64 / piece.sample_rate_hz;
            let value = |sample: usize| samples[sample];
            if faults.dead && !first_piece && !samples.is_empty() {
                let whole = 0..samples.len();
                found.stuck.add(std::slice::from_ref(&whole), time, value);
            }
            found.alive = true;
            found.spikes.add(&faults.spikes, time, value);
            found.stuck.add(&faults.stuck, time, value);
            if let Some(clipping) = &faults.clipping {
                found.clipped.add(&clipping.plateaus, time, |_| clipping.level);
            }
        };
        channels
            .par_iter()
            .zip(&mut self.channels)
            .enumerate()
            .for_each(look);
        let from = self.seen.next_multiple_of(every) - self.seen;
        let thin = |c: &Channel| {
            c.samples
                .iter()
                .copied()
                .skip(from)
                .step_by(every)
                .collect::<Vec<f64>>()
        };
        match &mut self.thinned {
            Some(whole) => {
                let more: Vec<Vec<f64>> = channels.par_iter().map(thin).collect();
                for (kept, more) in whole.channels.iter_mut().zip(more) {
                    kept.samples.extend(more);
                }
            }
            None => {
                let copy = |c: &Channel| Channel {
                    samples: thin(c),
                    name: c.name.clone(),
                    file_unit: c.file_unit.clone(),
                    role: c.role,
                };
                self.thinned = Some(TimeRecord {
                    sample_rate_hz: piece.sample_rate_hz / every as f64,
                    start_s: piece.start_s,
                    channels: channels.iter().map(copy).collect(),
                    filled: Vec::new(),
                });
            }
        }
        self.seen += piece.len();
    }

    /// All that was found.
    pub fn warnings(&self) -> Vec<String> {
        let Some(record) = &self.thinned else {
            return Vec::new();
        };
        let mut warnings = Vec::new();
        // Few records have spikes, and only those need the hammer.
        let hammer = self.channels.iter().any(|c| c.spikes.first.is_some()).then(|| {
            let samples: Vec<&[f64]> = record.channels.iter().map(|c| c.samples.as_slice()).collect();
            signal::pulsed_channel(&samples)
        });
        let hammer = hammer.flatten();
        for (k, (channel, found)) in record.channels.iter().zip(&self.channels).enumerate() {
            warnings.extend(found.warnings(channel, &record.channels, hammer == Some(k)));
        }
        warnings.extend(far_too_small(record, &self.channels));
        warnings.extend(no_air(record));
        warnings.extend(drift(record));
        warnings
    }
}

impl Found {
    /// `hammer`: its pulses are hits, not spikes.
    fn warnings(&self, channel: &Channel, all: &[Channel], hammer: bool) -> Vec<String> {
        let (name, unit) = (&channel.name, channel.quantity_and_unit().1);
        let mut warnings = Vec::new();
        if !self.alive && self.range.is_some() {
            return vec![format!(
                "{name}: the same value in every sample, the channel is dead: check its plug and amplifier"
            )];
        }
        if let Some(twin) = self.same_as.and_then(|j| all.get(j)) {
            warnings.push(format!(
                "{name}: the same samples as {}: one column was exported twice, so that a channel is missing; export again",
                twin.name
            ));
        }
        if let Some((at, level, _)) = self.clipped.first {
            warnings.push(format!(
                "{name}: clipped at {} {unit}: {} peaks cut off ({} samples, the first at {at:.4} s); the true values \
                 are larger. Choose a larger range at the amplifier and measure again",
                figures(level, 4), self.clipped.count, self.clipped.samples
            ));
        }
        if let Some((at, value, length)) = self.stuck.first {
            let more = match self.stuck.count {
                1 => String::new(),
                n => format!(
                    ", and {} more stretches ({} samples in all)",
                    n - 1,
                    self.stuck.samples
                ),
            };
            warnings.push(format!(
                "{name}: {length} samples stuck at {} {unit} from {at:.4} s on{more}: look at plug, cable and \
                 recorder; cfc puts the revolutions beside in their place",
                figures(value, 4)
            ));
        }
        if let Some((at, value, _)) = self.spikes.first.filter(|_| !hammer) {
            warnings.push(format!(
                "{name}: {} spikes of up to three samples (the first at {at:.4} s, {} {unit}): electrical \
                 disturbance; cfc leaves them out",
                self.spikes.count,
                figures(value, 4)
            ));
        }
        warnings
    }
}

fn range(samples: &[f64]) -> Option<(f64, f64)> {
    (!samples.is_empty()).then(|| least_and_greatest(samples))
}

fn forces(record: &TimeRecord) -> impl Iterator<Item = (usize, &Channel)> {
    let is_force = |role| {
        matches!(
            role,
            ChannelRole::ForceX | ChannelRole::ForceY | ChannelRole::ForceZ
        )
    };
    record
        .channels
        .iter()
        .enumerate()
        .filter(move |(_, c)| is_force(c.role))
}

/// Ratio of the spans of two force channels of one dynamometer beyond which their units differ: noise alone makes a
/// hundredth, kN for N a thousandth.
const SAME_UNIT: f64 = 400.0;

fn far_too_small(record: &TimeRecord, found: &[Found]) -> Vec<String> {
    let span = |i: usize| found.get(i).and_then(|f| f.range).map_or(0.0, |r| r.1 - r.0);
    let largest = forces(record).map(|(i, _)| span(i)).fold(0.0, f64::max);
    let small = forces(record).filter(|(i, _)| span(*i) > 0.0 && span(*i) * SAME_UNIT < largest);
    small
        .map(|(i, c)| {
            format!(
                "{}: spans {:.2e} N, {:.0} times less than the largest force channel: kN called N, or the amplifier's range is \
                 set wrongly; correct the unit in the file",
                c.name,
                span(i),
                largest / span(i)
            )
        })
        .collect()
}

/// Blocks that a record is cut into to find its air without knowing the spindle.
const DRIFT_BLOCKS: f64 = 200.0;
/// Change of the zero over the record, as a part of the largest cutting force in it, that is worth telling.
const DRIFT_WORTH_TELLING: f64 = 0.75;
/// Bend of the zero off a line, as a part of the channel's own force, that is worth telling.
const BEND_WORTH_TELLING: f64 = 0.03;

/// Says which force channels drift far between the air before and after the cut, along a line or a curve.
fn drift(record: &TimeRecord) -> Vec<String> {
    let samples: Vec<&[f64]> = forces(record).map(|(_, c)| c.samples.as_slice()).collect();
    let spindle = Spindle {
        samples_per_revolution: record.len() as f64 / DRIFT_BLOCKS,
        sample_rate_hz: record.sample_rate_hz,
        teeth: 1,
    };
    if samples.is_empty() || spindle.samples_per_revolution < 4.0 {
        return Vec::new();
    }
    let Some(phases) = find_phases(&samples, spindle, None) else {
        return Vec::new();
    };
    let (Some(before), Some(after)) = (&phases.air.before, &phases.air.after) else {
        return Vec::new();
    };
    let length_s = record.len() as f64 / record.sample_rate_hz;
    let lines: Vec<(&Channel, DriftLine, f64)> = forces(record)
        .map(|(_, channel)| {
            let drift = fit_drift(
                &channel.samples,
                record.sample_rate_hz,
                record.start_s,
                &phases.air,
            );
            let time = |i: usize| record.start_s + i as f64 / record.sample_rate_hz;
            let steady = &channel.samples[phases.steady.clone()];
            let (mean, spread) = mean_and_spread(steady);
            let level = mean - drift.at(time((phases.steady.start + phases.steady.end) / 2));
            (channel, drift, level.abs().max(spread))
        })
        .collect();
    let largest = lines.iter().map(|l| l.2).fold(0.0, f64::max);
    let told = lines.into_iter().filter_map(|(channel, drift, size)| {
        let means = [before, after].map(|r| signal::mean(&channel.samples[r.clone()]));
        let change = means[1] - means[0];
        if drift.bend > BEND_WORTH_TELLING * size {
            return Some(format!(
                "{}: the zero drifts along a curve{}, {} N off the straight line through the air, {change:+.1} N over the record: \
                 let the amplifier warm up and reset it before each cut; `lobestone diagnose` can fit it (nonlinear-drift)",
                channel.name,
                drift.shape(),
                figures(drift.bend, 3)
            ));
        }
        let steep = change.abs() > DRIFT_WORTH_TELLING * largest && change.abs() > 6.0 * drift.offset_std;
        steep.then(|| {
            format!(
                "{}: the zero drifts along a line by {:+.2} N/s, {:+.1} N over the record, much beside the cutting force: cfc takes the \
                 line through the air off; let the amplifier warm up and reset it before each cut",
                channel.name,
                drift.slope_per_s,
                drift.slope_per_s * length_s
            )
        })
    });
    told.collect()
}

/// Pieces a force record is cut into to see when the tool cuts.
const PIECES: usize = 40;

/// Distance (of means in spreads, or of the logarithms of spreads) up to which a piece looks like the middle of the
/// record: in the cut it is about 0.2, air before and after a cut gave 2.9 and more on 251 records.
const LIKE_THE_MIDDLE: f64 = 0.7;

/// Says where a force record starts or ends in the cut: there drift cannot be told from edge force.
fn no_air(record: &TimeRecord) -> Option<String> {
    let forces: Vec<&Channel> = forces(record).map(|(_, c)| c).collect();
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
            filled: Vec::new(),
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
                "Fx: clipped at 180.0 N: ",
            ),
            (
                warnings(|v| v[1000..1050].fill(12.0)),
                "Fx: 50 samples stuck at 12.00 N from 1.0000 s",
            ),
            (warnings(|v| v.fill(1.0)), "Fx: the same value"),
            (
                warnings(|v| v[500] += 5000.0),
                "Fx: 1 spikes of up to three samples (the first at 0.5000 s",
            ),
        ] {
            assert!(
                found.len() == 1 && found[0].starts_with(what),
                "{what}: {found:?}"
            );
        }
    }

    #[test]
    fn channels_that_are_alike_or_in_another_unit_are_told() {
        let mut twice = record(0.8, 3.2);
        twice.channels[1].samples = twice.channels[0].samples.clone();
        let found = quality_warnings(&twice);
        assert!(
            found.len() == 1 && found[0].starts_with("Fy: the same samples as Fx"),
            "{found:?}"
        );
        let found = warnings(|v| v.iter_mut().for_each(|v| *v /= 1000.0));
        assert!(
            found.len() == 1 && found[0].contains("times less than the largest"),
            "{found:?}"
        );
        assert!(
            found[0].starts_with("Fx: ") && found[0].contains("kN called N"),
            "{found:?}"
        );
    }

    #[test]
    fn drift_is_told_with_its_shape_and_size() {
        let add = |f: fn(f64) -> f64| warnings(|v| (0..v.len()).for_each(|i| v[i] += f(i as f64 * 1e-3)));
        let found = add(|t| 60.0 * t);
        assert!(
            found.len() == 1 && found[0].starts_with("Fx: the zero drifts along a line by +63."),
            "{found:?}"
        );
        let found = add(|t| -150.0 * (-t / 0.6).exp());
        assert!(
            found.len() == 1 && found[0].starts_with("Fx: the zero drifts along a curve"),
            "{found:?}"
        );
        let text = found[0].split("time constant about ").nth(1).expect(&found[0]);
        let tau: f64 = text.split(' ').next().unwrap().parse().unwrap();
        assert!((tau / 0.6 - 1.0).abs() < 0.2, "{tau}");
    }

    /// The pieces of a long record say what the whole says.
    #[test]
    fn a_record_in_pieces_is_the_same_record() {
        let mut whole = record(0.0, 3.2);
        whole.channels[0].samples[500] += 5000.0;
        whole.channels[1].samples[2100..2150].fill(3.3);
        let mut check = QualityCheck::default();
        for k in 0..4 {
            let mut piece = whole.clone();
            piece.start_s = k as f64;
            for channel in &mut piece.channels {
                channel.samples = channel.samples[1000 * k..1000 * (k + 1)].to_vec();
            }
            check.add(&piece);
        }
        let found = quality_warnings(&whole);
        assert_eq!(found.len(), 3, "{found:?}");
        assert_eq!(check.warnings(), found);
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
