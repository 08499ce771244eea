//! Bad samples of a force record put out of the way before anything is computed from it.

use std::ops::Range;

use crate::cutting::force_model::force_axis::axis_of;
use crate::cutting::measured::cut_analysis::Notice;
use crate::data::{ChannelRole, Sample, TimeRecord};
use crate::signal::find_faults;
use crate::text::figures;

const SPIKES: &str = "spikes of single samples, left out: the revolutions beside stand in their place; electrical \
     disturbance, look at cables and earth";
const STUCK: &str =
    "stuck samples, left out: the revolutions beside stand in their place; look at plug, cable and recorder";
const TOO_MANY: &str = "so much of the channel is bad that it is left out of this cut: repair plug, cable or recorder \
     (stuck at its largest force: choose a larger range at the amplifier) and cut again";
/// More than this part of a channel bad, and it is not used at all.
const BAD_AT_MOST: f64 = 0.1;
/// Revolutions to either side that are looked at for good samples.
const TURNS: usize = 50;

/// Replaces spikes, stuck and dropped samples of the force channels by the same angle of the nearest good revolutions.
/// (Clipped peaks are clipped in every revolution: nothing can stand in for them.)
pub fn repair_record<S: Sample>(record: &mut TimeRecord<S>, spindle_rpm: f64) -> Vec<Notice> {
    let per_turn = record.sample_rate_hz * 60.0 / spindle_rpm;
    let (start_s, rate, filled) = (record.start_s, record.sample_rate_hz, record.filled.clone());
    let time = |r: &Range<usize>| start_s + r.start as f64 / rate;
    let mut notices = Vec::new();
    for channel in &mut record.channels {
        let Some(axis) = axis_of(channel.role) else {
            continue;
        };
        let values = &channel.samples;
        let faults = find_faults(values);
        let (label, unit) = (axis.label(), axis.unit());
        let told = |ranges: &[Range<usize>], what: &dyn Fn(&Range<usize>) -> String| {
            let first = ranges.first()?;
            let more = match ranges.len() {
                1 => String::new(),
                n => format!(", and {} more", n - 1),
            };
            Some(format!("{label}: {}{more}", what(first)))
        };
        let stuck = told(&faults.stuck, &|r| {
            format!(
                "{} samples stuck at {} {unit} from {:.3} s",
                r.len(),
                figures(values[r.start].value(), 4),
                time(r)
            )
        });
        let spikes = told(&faults.spikes, &|r| {
            format!(
                "spike to {} {unit} at {:.3} s",
                figures(values[r.start].value(), 4),
                time(r)
            )
        });
        let ranges = || faults.spikes.iter().chain(&faults.stuck).chain(&filled);
        if ranges().next().is_none() {
            continue;
        }
        let mut bad = vec![false; values.len()];
        ranges().for_each(|r| bad[r.clone()].fill(true));
        let count = bad.iter().filter(|b| **b).count();
        let notice = |kind, detail: String| Notice { kind, detail };
        if count as f64 > BAD_AT_MOST * values.len() as f64 {
            channel.role = ChannelRole::Other;
            let share = 100.0 * count as f64 / values.len() as f64;
            let worst = stuck.or(spikes).unwrap_or_else(|| label.to_owned());
            notices.push(notice(
                TOO_MANY,
                format!("{worst}, {share:.0} % of the record bad"),
            ));
            continue;
        }
        notices.extend(stuck.map(|detail| notice(STUCK, detail)));
        notices.extend(spikes.map(|detail| notice(SPIKES, detail)));
        substitute(&mut channel.samples, &bad, per_turn);
    }
    notices
}

/// Puts in the place of bad samples the mean of those one revolution before and after (or two, …, where these are bad too).
fn substitute<S: Sample>(values: &mut [S], bad: &[bool], per_turn: f64) {
    // Only good samples are looked at, and those stay what they are.
    let at = |values: &[S], position: f64| -> Option<f64> {
        let low = position.floor();
        if !(low >= 0.0 && low + 1.0 < values.len() as f64) {
            return None;
        }
        let (i, share) = (low as usize, position - low);
        let [here, next] = [values[i].value(), values[i + 1].value()];
        (!bad[i] && !bad[i + 1]).then_some(here + share * (next - here))
    };
    let beside = |values: &[S], i: usize| {
        (1..=TURNS).find_map(|k| {
            let away = k as f64 * per_turn;
            match (at(values, i as f64 - away), at(values, i as f64 + away)) {
                (Some(before), Some(after)) => Some(0.5 * (before + after)),
                (one, other) => one.or(other),
            }
        })
    };
    let mut last_good = 0.0;
    for i in 0..values.len() {
        if bad[i] {
            values[i] = S::of(beside(values, i).unwrap_or(last_good));
        } else {
            last_good = values[i].value();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_samples_become_those_of_the_revolutions_beside() {
        let per_turn = 50.5;
        let wave =
            |i: usize| 200.0 + 90.0 * (std::f64::consts::TAU * i as f64 / per_turn).sin() + 0.02 * i as f64;
        let truth: Vec<f64> = (0..2000).map(wave).collect();
        let (mut values, mut bad) = (truth.clone(), vec![false; 2000]);
        for range in [0..1, 700..820, 1999..2000] {
            values[range.clone()].fill(9999.0);
            bad[range].fill(true);
        }
        let mut mended = values;
        substitute(&mut mended, &bad, per_turn);
        for (i, (a, b)) in mended.iter().zip(&truth).enumerate() {
            assert!((a - b).abs() < 2.0, "{i}: {a} {b}");
        }
    }
}
