//! Is what looks like air air? It must hold hardly any of the content that the teeth put into the cut, or, where the cut shows
//! none above its noise, stand far from the cut's level.

use std::ops::Range;

use super::blocks::{Spindle, line, mean, robust_std};
use super::mains::without_hum;
use crate::data::Sample;

/// Part of the cut's tooth-passing power that air may hold: unbalance and what resonates with it stay below a third of
/// the cut's amplitude, a cut that wanders never falls there.
const CONTENT_OF_AIR: f64 = 0.1;
/// Where nothing repeats: part of the cut's fluctuation that air may hold.
const SCATTER_OF_AIR: f64 = 0.35;
/// The same of air too short to be looked at in halves.
const CONTENT_OF_SHORT_AIR: f64 = 0.01;
/// Content of the half next to the cut over that of the other half from which on the tool enters or leaves there.
const GROWS: f64 = 3.0;
/// Part of the cut's fluctuation that must come back turn after turn for its content to be judged by.
const REPEATS: f64 = 0.3;
/// Standard deviations of turn means, and turns' ripples, by which the level of air must stand off that of a cut without
/// content.
const LEVEL_SIGMAS: f64 = 8.0;
/// The level of a cut that merely changes goes on changing: a step from air to cut is this many times what happens on either
/// side of it.
const LEVEL_OVER_CHANGE: f64 = 3.0;
/// Part of the cut's force that is next to none, and times its fluctuation that air may have.
const NEXT_TO_NONE: f64 = 0.05;
const NO_LOUDER: f64 = 1.2;
/// Turns looked at, at most: those nearest to where air and cut meet.
const MOST_TURNS: usize = 60;

/// What comes back one turn later (covariance of neighbouring turns, each less its mean and the drift of all), and all
/// fluctuation within turns; both summed over the channels. `None` with less than two turns.
pub(super) fn content<S: Sample>(channels: &[&[S]], range: &Range<usize>, turn: f64) -> Option<(f64, f64)> {
    // Ranges are rounded to samples.
    let turns = ((range.len() as f64 + 0.5) / turn).floor() as usize;
    let length = turn.floor() as usize;
    if turns < 2 || length < 2 {
        return None;
    }
    let (mut repeated, mut all) = (0.0, 0.0);
    for samples in channels {
        // A ramp comes back in every turn as well.
        let drift = level(samples, range, turn).1 / (turns as f64 * turn);
        let of_turn = |k: usize| -> Vec<f64> {
            let from = range.start as f64 + k as f64 * turn;
            let value = |i: usize| {
                let at = from + i as f64;
                let (low, share) = (at.floor() as usize, at - at.floor());
                let at = |i: usize| samples[i.min(samples.len() - 1)].value();
                at(low) * (1.0 - share) + at(low + 1) * share - drift * i as f64
            };
            let values: Vec<f64> = (0..length).map(value).collect();
            let m = mean(&values);
            values.into_iter().map(|v| v - m).collect()
        };
        let mut previous = of_turn(0);
        for k in 1..turns {
            let this = of_turn(k);
            let n = length as f64;
            repeated += previous.iter().zip(&this).map(|(a, b)| a * b).sum::<f64>() / n;
            all += 0.5 * previous.iter().chain(&this).map(|v| v * v).sum::<f64>() / n;
            previous = this;
        }
    }
    let pairs = (turns - 1) as f64;
    Some((repeated / pairs, all / pairs))
}

/// Level of each turn of one channel, off a line through them: (mean, change along the line, scatter about it).
fn level<S: Sample>(samples: &[S], range: &Range<usize>, turn: f64) -> (f64, f64, f64) {
    let turns = ((range.len() as f64 / turn + 1e-6).floor() as usize).max(1);
    let of = |k: usize| {
        let from = range.start + (k as f64 * turn).round() as usize;
        let to = (range.start + ((k + 1) as f64 * turn).round() as usize).min(range.end);
        mean(&samples[from.min(to)..to])
    };
    let means: Vec<f64> = (0..turns).map(of).collect();
    let at = || (0..turns).map(|k| k as f64);
    let (centre, slope, middle) = line(at(), means.iter().copied());
    let residual: Vec<f64> = means
        .iter()
        .zip(at())
        .map(|(m, k)| m - centre - slope * (k - middle))
        .collect();
    (centre, slope * turns as f64, robust_std(&residual))
}

/// The part of `candidate` that is air next to the cut in `cutting`, if any: as the record is, or without the hum of the mains, which
/// at many speeds comes back turn after turn and in air is all that does; or all of it, where its force is next to none.
pub(super) fn air_in<S: Sample>(
    channels: &[&[S]],
    candidate: &Range<usize>,
    cutting: &Range<usize>,
    spindle: Spindle,
) -> Option<Range<usize>> {
    // What was followed from either end may overlap.
    if cutting.is_empty() {
        return None;
    }
    let turn = spindle.samples_per_revolution;
    let is_before = candidate.end <= cutting.start;
    let (near, cut) = (nearest(candidate, is_before, turn), core(cutting, turn));
    air_as_it_is(channels, candidate, cutting, turn)
        .or_else(|| {
            let found = air_without_hum(channels, [&near, &cut], spindle)?;
            // Of what lies further from the cut than was looked at, what was looked at speaks.
            Some(match is_before {
                true => candidate.start..found.end,
                false => found.start..candidate.end,
            })
        })
        .or_else(|| is_next_to_none(channels, &near, &cut, turn).then(|| candidate.clone()))
}

/// The part of `near` that without hum is air next to a `cut` without hum.
fn air_without_hum<S: Sample>(
    channels: &[&[S]],
    [near, cut]: [&Range<usize>; 2],
    spindle: Spindle,
) -> Option<Range<usize>> {
    let turn = spindle.samples_per_revolution;
    let tooth_hz = spindle.sample_rate_hz / turn * spindle.teeth.max(1) as f64;
    let clean = |range: &Range<usize>| {
        let parts: Vec<&[S]> = channels.iter().map(|c| &c[range.clone()]).collect();
        without_hum(&parts, spindle.sample_rate_hz, tooth_hz)
    };
    // One next to the other, in their order.
    let [first, second] = if near.start < cut.start {
        [near, cut]
    } else {
        [cut, near]
    };
    let joined = clean(first)?.into_iter().zip(clean(second)?);
    let joined: Vec<Vec<f64>> = joined.map(|(first, second)| [first, second].concat()).collect();
    let joined: Vec<&[f64]> = joined.iter().map(Vec::as_slice).collect();
    let ends = [0..first.len(), first.len()..first.len() + second.len()];
    let [own, of_cut] = if near.start < cut.start {
        [&ends[0], &ends[1]]
    } else {
        [&ends[1], &ends[0]]
    };
    let found = air_as_it_is(&joined, own, of_cut, turn)?;
    Some(near.start + (found.start - own.start)..near.start + (found.end - own.start))
}

/// Is the force in `air` next to none against that of the `cut`? An amplifier is reset before it, and what repeats there (hum at the
/// tooth passing frequency) is no more than in the cut.
fn is_next_to_none<S: Sample>(channels: &[&[S]], air: &Range<usize>, cut: &Range<usize>, turn: f64) -> bool {
    let size = |range: &Range<usize>, less: Option<&Range<usize>>| -> f64 {
        let of = |c: &&[S]| level(c, range, turn).0 - less.map_or(0.0, |less| level(c, less, turn).0);
        channels.iter().map(|c| of(c).powi(2)).sum::<f64>().sqrt()
    };
    let is_quieter = content(channels, air, turn)
        .zip(content(channels, cut, turn))
        .is_some_and(|(air, cut)| air.1 < NO_LOUDER * cut.1);
    is_quieter
        && size(air, None) < NEXT_TO_NONE * size(cut, Some(air))
        && stands_off(channels, air, cut, turn)
}

/// Samples that are looked at, at most. `turn`: samples a revolution.
fn most_samples(turn: f64) -> usize {
    (MOST_TURNS as f64 * turn) as usize
}

/// What of `air` lies nearest to the cut.
fn nearest(air: &Range<usize>, is_before: bool, turn: f64) -> Range<usize> {
    let length = air.len().min(most_samples(turn));
    match is_before {
        true => air.end - length..air.end,
        false => air.start..air.start + length,
    }
}

/// The middle of a cut.
fn core(cutting: &Range<usize>, turn: f64) -> Range<usize> {
    let spare = cutting.len().saturating_sub(most_samples(turn)) / 2;
    cutting.start + spare..cutting.end - spare
}

/// The part of `candidate` that is air next to the cut in `cutting`, if any. `turn`: samples a revolution.
fn air_as_it_is<S: Sample>(
    channels: &[&[S]],
    candidate: &Range<usize>,
    cutting: &Range<usize>,
    turn: f64,
) -> Option<Range<usize>> {
    let is_before = candidate.end <= cutting.start;
    let core = core(cutting, turn);
    let (cut, cut_all) = content(channels, &core, turn)?;
    let mut air = candidate.clone();
    loop {
        let nearest = nearest(&air, is_before, turn);
        let (own, own_all) = content(channels, &nearest, turn)?;
        if cut <= REPEATS * cut_all {
            let scatter_tells = own_all < SCATTER_OF_AIR * cut_all;
            return (scatter_tells || stands_off(channels, &nearest, &core, turn)).then_some(air);
        }
        if own > CONTENT_OF_AIR * cut || own_all > cut_all {
            return None;
        }
        // A tool that enters or leaves: content that grows towards the cut. What is further away may be air.
        let half = ((0.5 * nearest.len() as f64 / turn).floor() * turn).ceil() as usize;
        let (near, far) = match is_before {
            true => (nearest.end - half..nearest.end, nearest.start..nearest.end - half),
            false => (
                nearest.start..nearest.start + half,
                nearest.start + half..nearest.end,
            ),
        };
        let halves = (content(channels, &near, turn), content(channels, &far, turn));
        let (Some((near, _)), Some((far_content, _))) = halves else {
            return (own < CONTENT_OF_SHORT_AIR * cut).then_some(air);
        };
        if near < CONTENT_OF_SHORT_AIR * cut || near < GROWS * far_content.max(0.0) {
            return Some(air);
        }
        air = match is_before {
            true => air.start..far.end,
            false => far.start..air.end,
        };
    }
}

/// Does the level of `air` stand off that of `core` in some channel?
fn stands_off<S: Sample>(channels: &[&[S]], air: &Range<usize>, core: &Range<usize>, turn: f64) -> bool {
    // Its entry and exit are no scatter of the cut.
    let middle = core.start + core.len() / 4..core.end - core.len() / 4;
    channels.iter().any(|samples| {
        let (a, change_a, scatter_a) = level(samples, air, turn);
        let (c, change_c, scatter_c) = level(samples, &middle, turn);
        let distance = (a - c).abs();
        distance > LEVEL_SIGMAS * scatter_a.max(scatter_c)
            && distance > LEVEL_OVER_CHANGE * change_a.abs().max(change_c.abs())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    const TURN: f64 = 60.3;
    const SPINDLE: Spindle = Spindle {
        samples_per_revolution: TURN,
        sample_rate_hz: 50.0 * TURN,
        teeth: 2,
    };

    /// Pulses of two teeth, the second with `second` times the force of the first, times `force`, and noise.
    fn record(length: usize, seed: u64, second: f64, noise: f64, force: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..length)
            .map(|i| {
                let angle = std::f64::consts::TAU * i as f64 / TURN;
                let pulse = angle.sin().max(0.0).powi(2) + second * (-angle.sin()).max(0.0).powi(2);
                let gauss: f64 = crate::statistics::nearly_normal(&mut rng);
                5.0 + 200.0 * force(i as f64 / TURN) * pulse + noise * gauss
            })
            .collect()
    }

    fn found(samples: &[f64], air_turns: f64) -> Option<Range<usize>> {
        let split = (air_turns * TURN) as usize;
        air_in(&[samples], &(0..split), &(split..samples.len()), SPINDLE)
    }

    #[test]
    fn a_piece_of_a_cut_is_no_air_whatever_its_force_does() {
        for seed in 0..10 {
            for second in [1.0, 0.6, 0.1] {
                let wander = |t: f64| 1.0 + 0.2 * (t / 5.0).sin();
                assert_eq!(found(&record(3000, seed, second, 6.0, wander), 12.0), None);
                let step = |t: f64| if t < 12.0 { 0.6 } else { 1.0 };
                assert_eq!(found(&record(3000, seed, second, 6.0, step), 12.0), None);
            }
        }
    }

    #[test]
    fn air_with_unbalance_and_drift_is_air_and_a_ramp_out_of_it_is_left_out() {
        for seed in 0..10 {
            let cut = |t: f64| if t < 12.0 { 0.0 } else { 1.0 };
            let mut samples = record(3000, seed, 0.6, 6.0, cut);
            for (i, v) in samples.iter_mut().enumerate() {
                *v += 0.05 * i as f64 + 6.0 * (std::f64::consts::TAU * i as f64 / TURN).sin();
            }
            assert_eq!(found(&samples, 12.0), Some(0..(12.0 * TURN) as usize));
            let ramp = |t: f64| ((t - 12.0) / 12.0).clamp(0.0, 1.0);
            let part = found(&record(3000, seed, 0.6, 6.0, ramp), 16.0).unwrap();
            assert!(part.start == 0 && part.end <= (13.5 * TURN) as usize, "{part:?}");
        }
    }

    #[test]
    fn a_steep_ramp_does_not_make_a_cut_of_air() {
        for seed in 0..10 {
            let mut samples = record(3000, seed, 0.6, 6.0, |t| if t < 12.0 { 0.0 } else { 1.0 });
            samples
                .iter_mut()
                .enumerate()
                .for_each(|(i, v)| *v += 5.0 * i as f64);
            assert_eq!(found(&samples, 12.0), Some(0..(12.0 * TURN) as usize));
        }
    }

    #[test]
    fn without_content_the_level_tells() {
        for seed in 0..10 {
            let mut samples = record(3000, seed, 0.0, 6.0, |_| 0.0);
            assert_eq!(found(&samples, 12.0), None);
            for v in samples.iter_mut().skip((12.0 * TURN) as usize) {
                *v += 80.0;
            }
            assert!(found(&samples, 12.0).is_some());
        }
        assert_eq!(found(&record(100, 0, 0.0, 1.0, |_| 0.0), 1.0), None);
    }

    /// Hum that comes back turn after turn, twice as strong as what the teeth do.
    #[test]
    fn hum_does_not_make_a_cut_of_air_nor_air_of_a_cut() {
        let hum = |i: usize, hz: f64| {
            400.0 * (std::f64::consts::TAU * hz * i as f64 / SPINDLE.sample_rate_hz).sin()
        };
        for seed in 0..10 {
            for hz in [50.0, 150.0, 60.0] {
                let air = |t: f64| if t < 12.0 { 0.0 } else { 1.0 };
                let step = |t: f64| if t < 12.0 { 0.6 } else { 1.0 };
                let with_hum = |force: &dyn Fn(f64) -> f64| -> Vec<f64> {
                    let record = record(3000, seed, 1.0, 6.0, force);
                    record
                        .into_iter()
                        .enumerate()
                        .map(|(i, v)| v + hum(i, hz))
                        .collect()
                };
                let end = (12.0 * TURN) as usize;
                assert_eq!(found(&with_hum(&air), 12.0), Some(0..end), "{seed} {hz}");
                assert_eq!(found(&with_hum(&step), 12.0), None, "{seed} {hz}");
            }
        }
    }

    /// Hum at the tooth passing frequency: the force is next to none in air, and in no piece of a cut.
    #[test]
    fn hum_that_looks_like_teeth_is_told_by_the_force() {
        let hum = |i: usize| 60.0 * (std::f64::consts::TAU * 2.0 * i as f64 / TURN).sin();
        for seed in 0..10 {
            let with_hum = |least: f64| -> Vec<f64> {
                let force = |t: f64| if t < 12.0 { least } else { 1.0 };
                let record = record(3000, seed, 1.0, 6.0, force);
                record
                    .into_iter()
                    .enumerate()
                    .map(|(i, v)| v - 5.0 + hum(i))
                    .collect()
            };
            assert!(found(&with_hum(0.0), 12.0).is_some());
            assert_eq!(found(&with_hum(0.2), 12.0), None);
            assert_eq!(found(&with_hum(0.6), 12.0), None);
        }
    }
}
