//! Turning an interrupted surface: a groove, a keyway or a flat takes the edge out of the work in every turn, and a mean over whole
//! turns counts that air as cutting.

use std::ops::Range;

use crate::cutting::force_model::force_axis::axis_of;
use crate::cutting::measured::cut_analysis::{ChannelAnalysis, CutAnalysis};
use crate::data::{Sample, TimeRecord};
use crate::statistics::quantile;

pub(crate) const INTERRUPTED: &str = "the edge leaves the work within every turn, as over a groove, a keyway or a flat: the forces are \
     those of the part of the turn in which it cuts";
/// The force while the edge cuts: a quantile of the samples, so that up to this part of a turn may be air.
const CUTTING_QUANTILE: f64 = 0.8;
/// Parts of a turn in air that are looked for; less is a spike, more is no turning.
const SHARE_OF_AIR: Range<f64> = 0.01..0.7;
/// Part of the force below which the edge is out, and part of the samples that may lie between (0.25 and 0.75 of the force) for each
/// that does: a force that swings is no air.
const HALF: f64 = 0.5;
const BETWEEN: [f64; 2] = [0.25, 0.75];
const FEW_BETWEEN: f64 = 0.5;
/// Part of the turns in which there is air for at least half of what it is on average.
const NEARLY_EVERY_TURN: f64 = 0.8;
/// Part of the samples between in and out by which the share may be wrong: filters make both edges alike.
const UNSURE_OF_BETWEEN: f64 = 0.25;

/// Of a turn, the part in which the edge cuts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TurnContact {
    pub share: f64,
    /// Standard error of `share`.
    pub std: f64,
}

/// How much of each turn the edge cuts, from the `samples` of the channel that carries most of the force, less its zero; `None` where it
/// does not leave the work.
pub(crate) fn interrupted(samples: &[f64], samples_per_turn: f64) -> Option<TurnContact> {
    let turns = (samples.len() as f64 / samples_per_turn + 1e-6).floor() as usize;
    let sign = samples.iter().sum::<f64>().signum();
    let force = quantile(samples.iter().map(|v| sign * v), CUTTING_QUANTILE)?;
    if turns < 3 || !(force > 0.0) {
        return None;
    }
    let share = |samples: &[f64], is: &dyn Fn(f64) -> bool| {
        samples.iter().filter(|v| is(sign * **v / force)).count() as f64 / samples.len().max(1) as f64
    };
    let is_out = |part: f64| part < HALF;
    let out = share(samples, &is_out);
    let between = share(samples, &|part| (BETWEEN[0]..BETWEEN[1]).contains(&part));
    let edge = |k: usize| ((k as f64 * samples_per_turn).round() as usize).min(samples.len());
    let with_air = (0..turns).filter(|k| share(&samples[edge(*k)..edge(k + 1)], &is_out) > HALF * out);
    let every_turn = with_air.count() as f64 >= NEARLY_EVERY_TURN * turns as f64;
    (SHARE_OF_AIR.contains(&out) && between < FEW_BETWEEN * out && every_turn).then_some(TurnContact {
        share: 1.0 - out,
        std: UNSURE_OF_BETWEEN * between,
    })
}

/// `channels` with the means of the part of the turn in which the edge cuts.
pub(crate) fn at_full_contact(channels: &mut [ChannelAnalysis], contact: TurnContact) {
    for mean in channels.iter_mut().map(|c| &mut c.mean) {
        let unsure = mean.average.value * contact.std / contact.share;
        mean.average.value /= contact.share;
        mean.average.std_error = mean.average.std_error.hypot(unsure) / contact.share;
        mean.turn_std = mean.turn_std.map(|std| std / contact.share);
        mean.zero_std = mean.zero_std.hypot(unsure) / contact.share;
    }
}

/// The record with forces above their zero as large as if the edge cut all the turn: what its turns are on average then is what the
/// edge carries.
pub(crate) fn record_at_full_contact<S: Sample>(
    record: &TimeRecord<S>,
    analysis: &CutAnalysis,
) -> TimeRecord<S> {
    let mut record = record.clone();
    for channel in &mut record.channels {
        let own = axis_of(channel.role).and_then(|axis| analysis.channels.iter().find(|c| c.axis == axis));
        let Some(own) = own else { continue };
        for (i, sample) in channel.samples.iter_mut().enumerate() {
            let zero = own.drift.at(record.start_s + i as f64 / record.sample_rate_hz);
            *sample = S::of(zero + (sample.value() - zero) / analysis.contact_share);
        }
    }
    record
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use rand::SeedableRng;

    /// Twenty turns of 200 samples: `force` over the turn (0 to 1), and noise of 2 % of 900 N.
    fn turns(force: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let at = |i: usize| (i % 200) as f64 / 200.0;
        (0..4000)
            .map(|i| -900.0 * force(at(i)) + 18.0 * crate::statistics::nearly_normal(&mut random))
            .collect()
    }

    #[test]
    fn a_groove_leaves_its_share_of_the_turn() {
        for groove in [0.05, 0.2, 0.6] {
            let found = interrupted(&turns(|at| f64::from(u8::from(at >= groove))), 200.0).unwrap();
            assert_relative_eq!(found.share, 1.0 - groove, epsilon = 1e-3);
        }
        // A filter that takes a tenth of the turn to follow: known a little less well, and no less right.
        let slow = |at: f64| (10.0 * (at - 0.4).abs() - 1.0).clamp(0.0, 1.0);
        let found = interrupted(&turns(slow), 200.0).unwrap();
        assert!((found.share - 0.7).abs() < 0.01 && found.std > 0.01, "{found:?}");
    }

    #[test]
    fn a_force_that_swings_or_falls_once_is_not_interrupted() {
        assert_eq!(interrupted(&turns(|_| 1.0), 200.0), None);
        let swings = |at: f64| 1.0 + 0.9 * (std::f64::consts::TAU * 3.0 * at).sin();
        assert_eq!(interrupted(&turns(swings), 200.0), None);
        let mut once = turns(|_| 1.0);
        once[2000..2400].fill(0.0);
        assert_eq!(interrupted(&once, 200.0), None);
        assert_eq!(interrupted(&[], 200.0), None);
    }
}
