//! Where in a record the tool cuts air, enters, cuts steadily and leaves.
//!
//! The record is looked at in blocks of whole tool revolutions: their means show the force level, their
//! fluctuation the tooth-passing energy. From each end, the state found there is followed until blocks stop
//! fitting it; the states are then told apart by fluctuation (milling) or level (drilling). Inside the cut,
//! the steady part is grown outwards from its middle until entry or exit shows.

use std::ops::Range;

use super::blocks::{Blocks, line, median, quantile, robust_std};
use super::drift::Air;

/// What turns, and how the record is sampled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spindle {
    pub samples_per_revolution: f64,
    pub teeth: usize,
}

/// The parts of a record, as sample ranges.
#[derive(Debug, Clone, PartialEq)]
pub struct Phases {
    pub air: Air,
    /// First contact to last.
    pub cutting: Range<usize>,
    /// Full engagement, a whole number of revolutions.
    pub steady: Range<usize>,
}

/// Too few blocks for a state to be told from noise.
const MIN_STATE_BLOCKS: usize = 4;
/// More blocks than this are merged: finer ones would make a drill's slow entry too gentle to notice.
const MAX_BLOCKS: f64 = 250.0;
/// A block departs when its mean leaves the local line by this many standard deviations…
const DEPARTURE_SIGMA: f64 = 6.0;
/// …and by this part of the channel's range (slow bends of the drift stay below it).
const DEPARTURE_OF_RANGE: f64 = 0.02;
/// Two states differ in kind when their distance is beyond this part of the largest distance.
const SAME_STATE: f64 = 0.35;

/// Air before and air after have the same noise, up to this ratio of energies.
const QUIET: f64 = 1.6;

/// Finds the phases of a record from its channels (all of one length; those that carry the cutting force).
/// `entry_samples`: travel from first contact to full engagement where geometry tells it (drilling);
/// otherwise entry is detected. `None` where the record holds less than a few revolutions, or no steady cut.
pub fn find_phases(channels: &[&[f64]], spindle: Spindle, entry_samples: Option<f64>) -> Option<Phases> {
    let samples = channels.iter().map(|c| c.len()).min()?;
    let per_block = block_length(samples, spindle)?;
    let blocks: Vec<Blocks> = channels
        .iter()
        .map(|c| Blocks::new(&c[..samples], per_block))
        .collect();
    let count = blocks.first()?.len();
    if count < 2 * MIN_STATE_BLOCKS {
        return None;
    }
    let start_end = departure(&blocks, count, false);
    let last_start = count - departure(&blocks, count, true);
    let entry_blocks = entry_samples.map(|entry| entry / per_block);
    let (before, after) = air_states(&blocks, count, start_end, last_start, entry_blocks);

    // Guard blocks: the departure is noticed a little late.
    let sample = |block: f64| ((block * per_block).round().max(0.0) as usize).min(samples);
    let guard = 2.0;
    let lo = if before { start_end } else { 0 };
    let hi = if after { last_start } else { count };
    if lo + MIN_STATE_BLOCKS > hi {
        return None;
    }
    let air = Air {
        before: before
            .then(|| 0..sample(lo as f64 - guard))
            .filter(|r| r.len() as f64 >= 2.0 * per_block),
        after: after
            .then(|| sample(hi as f64 + guard)..samples)
            .filter(|r| r.len() as f64 >= 2.0 * per_block),
    };
    let cutting = sample(lo as f64)..sample(hi as f64);
    let contact = cutting.start as f64;
    let full = entry_samples
        .filter(|_| before)
        .map(|entry| {
            // The contact may have been noticed a block early.
            let start = contact + 1.03 * entry + guard * per_block;
            (start / per_block).ceil() as usize
        })
        .filter(|&start| start + MIN_STATE_BLOCKS < hi);
    let found = steady_blocks(&blocks, full.unwrap_or(lo)..hi);
    let span = found.start as f64 * per_block..found.end as f64 * per_block;
    let steady = whole_revolutions(span, spindle.samples_per_revolution, samples);
    (!steady.is_empty()).then_some(Phases { air, cutting, steady })
}

/// The largest whole number of revolutions inside `span`, centred in it, rounded to samples. Less than one
/// revolution gives an empty range.
pub fn whole_revolutions(span: Range<f64>, samples_per_revolution: f64, samples: usize) -> Range<usize> {
    let (from, to) = (span.start.max(0.0), span.end.min(samples as f64));
    let turns = ((to - from) / samples_per_revolution + 1e-6).floor();
    if !turns.is_finite() || turns < 1.0 {
        return 0..0;
    }
    let length = (turns * samples_per_revolution).round() as usize;
    let start = (from + 0.5 * (to - from - turns * samples_per_revolution)).round() as usize;
    let end = (start + length).min(samples);
    end - length.min(end)..end
}

/// One revolution, or several where there are very many, or a tooth period where there are few.
fn block_length(samples: usize, spindle: Spindle) -> Option<f64> {
    let turn = spindle.samples_per_revolution;
    if !turn.is_finite() || turn < 2.0 {
        return None;
    }
    let turns = samples as f64 / turn;
    let per_block = if turns < 24.0 {
        turn / spindle.teeth.max(1) as f64
    } else {
        turn * (turns / MAX_BLOCKS).ceil().max(1.0)
    };
    (per_block >= 2.0).then_some(per_block)
}

/// Blocks behind a line that a departure is judged by.
const TRAIL: usize = 12;
/// Blocks whose mean residual shows a slow departure, such as a drill's entry.
const AHEAD: usize = 6;
/// A slow departure must reach this part of the channel's range.
const SLOW_DEPARTURE_OF_RANGE: f64 = 0.05;

/// What counts as a departure in one channel.
struct Limits<'a> {
    blocks: &'a Blocks,
    /// Noise of block means.
    sigma: f64,
    range: f64,
    /// Change of the logarithm of the fluctuation.
    fluctuation: f64,
}

impl<'a> Limits<'a> {
    fn new(blocks: &'a Blocks) -> Self {
        // From neighbours; the lower quartile, since inside the cut they differ more.
        let steps: Vec<f64> = blocks.mean.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
        Limits {
            blocks,
            sigma: quantile(&steps, 0.25) / (0.3186 * std::f64::consts::SQRT_2),
            range: quantile(&blocks.mean, 0.95) - quantile(&blocks.mean, 0.05),
            fluctuation: 0.25f64.max(DEPARTURE_SIGMA / (2.0 * blocks.samples_per_block).sqrt()),
        }
    }

    /// Does the mean over positions `tested` leave the line through the `trail` positions, by more than chance
    /// and more than `of_range` of the channel's range? Positions are turned into block numbers by `at`.
    fn leaves(
        &self,
        at: &impl Fn(usize) -> usize,
        trail: &[usize],
        tested: Range<usize>,
        of_range: f64,
    ) -> bool {
        let x = trail.iter().map(|&i| i as f64);
        let (mean, slope, centre) = line(x.clone(), trail.iter().map(|&i| self.blocks.mean[at(i)]));
        let sxx: f64 = x.map(|v| (v - centre).powi(2)).sum();
        let n = tested.len().max(1) as f64;
        let ahead = 0.5 * (tested.start + tested.end - 1) as f64 - centre;
        let now = tested.map(|i| self.blocks.mean[at(i)]).sum::<f64>() / n;
        let lever = if sxx > 0.0 { ahead * ahead / sxx } else { 0.0 };
        let spread = (1.0 / n + 1.0 / trail.len().max(1) as f64 + lever).sqrt();
        let limit = (DEPARTURE_SIGMA * self.sigma * spread).max(of_range * self.range);
        (now - mean - slope * ahead).abs() > limit.max(f64::MIN_POSITIVE)
    }

    fn changes_loudness(&self, at: &impl Fn(usize) -> usize, trail: &[usize], k: usize) -> bool {
        let std: Vec<f64> = trail.iter().map(|&i| self.blocks.std_dev[at(i)]).collect();
        let (usual, now) = (median(&std), self.blocks.std_dev[at(k)]);
        usual > 0.0 && (now / usual).ln().abs() > self.fluctuation
    }
}

/// Number of blocks, counted from one end, that continue the state found at that end. Followed by a line
/// through the latest blocks, so that a slow bend of the drift does not count; two blocks in a row must
/// depart, so that a spike does not.
fn departure(blocks: &[Blocks], count: usize, from_end: bool) -> usize {
    let at = |i: usize| if from_end { count - 1 - i } else { i };
    let seed = MIN_STATE_BLOCKS.max(count / 50).min(count);
    let limits: Vec<Limits> = blocks.iter().map(Limits::new).collect();
    let mut accepted: Vec<usize> = (0..seed).collect();
    let mut previous_departed = false;
    for k in seed..count {
        let trail = &accepted[accepted.len().saturating_sub(TRAIL)..];
        let departed = limits
            .iter()
            .any(|l| l.leaves(&at, trail, k..k + 1, DEPARTURE_OF_RANGE) || l.changes_loudness(&at, trail, k));
        if departed && previous_departed {
            return k - 1;
        }
        previous_departed = departed;
        if departed {
            continue;
        }
        accepted.push(k);
        // A slow departure hides in a line that follows it: look at several blocks ahead of the line.
        let tested = (k + 1).saturating_sub(AHEAD)..k + 1;
        let behind = accepted.partition_point(|&i| i < tested.start);
        let trail = &accepted[behind.saturating_sub(2 * TRAIL)..behind];
        let slow = |l: &Limits| l.leaves(&at, trail, tested.clone(), SLOW_DEPARTURE_OF_RANGE);
        if trail.len() >= seed && limits.iter().any(slow) {
            return tested.start;
        }
    }
    count
}

/// Are the states at the start and at the end of the record air?
fn air_states(
    blocks: &[Blocks],
    count: usize,
    start_end: usize,
    last_start: usize,
    entry_blocks: Option<f64>,
) -> (bool, bool) {
    if start_end >= count || last_start == 0 {
        // One state from end to end: the campaign says that it is a cut.
        return (false, false);
    }
    // Near its inner boundary a state is least moved by drift.
    let near = (count / 10).max(MIN_STATE_BLOCKS);
    let start = start_end.saturating_sub(near)..start_end;
    let end = last_start..(last_start + near).min(count);
    let (m_from, m_to) = (start_end.min(last_start), start_end.max(last_start));
    let quarter = (m_to - m_from) / 4;
    let middle = if m_to > m_from {
        m_from + quarter..(m_to - quarter).max(m_from + quarter + 1)
    } else {
        start.clone()
    };
    let of = |r: &Range<usize>, pick: fn(&Blocks) -> &Vec<f64>| -> Vec<f64> {
        let part = |b: &Blocks| pick(b).get(r.clone()).map_or(0.0, median);
        blocks.iter().map(part).collect()
    };

    // Milling: tooth-passing energy first, drift does not touch it. (A drill has none, and its entry is a ramp.)
    let energy = |r: &Range<usize>| of(r, |b| &b.std_dev);
    let quietest: Vec<f64> = blocks
        .iter()
        .map(|b| quantile(&b.std_dev, 0.05).max(f64::MIN_POSITIVE))
        .collect();
    let loudness = |r: &Range<usize>| -> f64 {
        let e = energy(r);
        e.iter().zip(&quietest).map(|(s, q)| (s / q).powi(2)).sum::<f64>() / e.len().max(1) as f64
    };
    let (ls, lm, le) = (loudness(&start), loudness(&middle), loudness(&end));
    let loudest = ls.max(lm).max(le);
    let least = ls.min(lm).min(le);
    if entry_blocks.is_none() && loudest > 2.0 * least {
        // The passage in or out may be the loudest part: air is as quiet as the quietest, not just quieter.
        let quiet = |l: f64| l < QUIET * least;
        return (quiet(ls), quiet(le));
    }

    // Otherwise the level.
    let level = |r: &Range<usize>| of(r, |b| &b.mean);
    let scale: Vec<f64> = blocks
        .iter()
        .map(|b| (quantile(&b.mean, 0.95) - quantile(&b.mean, 0.05)).max(f64::MIN_POSITIVE))
        .collect();
    let distance = |a: &[f64], b: &[f64]| -> f64 {
        a.iter()
            .zip(b)
            .zip(&scale)
            .map(|((a, b), s)| ((a - b) / s).powi(2))
            .sum::<f64>()
            .sqrt()
    };
    let (s, m, e) = (level(&start), level(&middle), level(&end));
    let (sm, em, se) = (distance(&s, &m), distance(&e, &m), distance(&s, &e));
    let largest = sm.max(em).max(se);
    if m_to - m_from >= MIN_STATE_BLOCKS {
        if sm < SAME_STATE * largest {
            return (false, true);
        }
        if em < SAME_STATE * largest {
            return (true, false);
        }
        if se < sm.max(em) {
            return (true, true);
        }
    }
    // The middle lies between the two states: the passage into the cut or out of it. Where entry is known to
    // take long, a short passage is an exit; otherwise the state nearer zero is the air.
    let start_is_air = match entry_blocks {
        Some(entry) if entry >= 2.0 * MIN_STATE_BLOCKS as f64 => (m_to - m_from) as f64 > 0.4 * entry,
        _ => {
            let zero = vec![0.0; s.len()];
            distance(&s, &zero) < distance(&e, &zero)
        }
    };
    (start_is_air, !start_is_air)
}

/// Grows the steady part from the central blocks of the cut outwards.
fn steady_blocks(blocks: &[Blocks], cut: Range<usize>) -> Range<usize> {
    let length = cut.len();
    let core = cut.start + 3 * length / 10..(cut.end - 3 * length / 10).max(cut.start + 3 * length / 10 + 1);
    struct Core<'a> {
        blocks: &'a Blocks,
        line: (f64, f64, f64),
        mean_tolerance: f64,
        std_dev: f64,
        std_tolerance: f64,
    }
    let cores: Vec<Core> = blocks
        .iter()
        .map(|b| {
            let (mut kept, mut fit): (Vec<usize>, _) = (core.clone().collect(), (0.0, 0.0, 0.0));
            let mut scatter = 0.0;
            for _ in 0..3 {
                fit = line(kept.iter().map(|&i| i as f64), kept.iter().map(|&i| b.mean[i]));
                let off = |i: usize| b.mean[i] - fit.0 - fit.1 * (i as f64 - fit.2);
                let residual: Vec<f64> = core.clone().map(off).collect();
                scatter = robust_std(&residual);
                kept = core
                    .clone()
                    .filter(|&i| scatter == 0.0 || off(i).abs() <= 4.0 * scatter)
                    .collect();
                if kept.len() < 3 {
                    kept = core.clone().collect();
                }
            }
            let level = quantile(&b.mean, 0.98) - quantile(&b.mean, 0.02);
            let std: Vec<f64> = core.clone().map(|i| b.std_dev[i]).collect();
            let std_dev = median(&std);
            Core {
                blocks: b,
                line: fit,
                mean_tolerance: (5.0 * scatter).max(0.01 * level),
                std_dev,
                std_tolerance: (5.0 * robust_std(&std)).max(0.1 * std_dev),
            }
        })
        .collect();
    let fits = |i: usize| {
        cores.iter().all(|l| {
            let expected = l.line.0 + l.line.1 * (i as f64 - l.line.2);
            (l.blocks.mean[i] - expected).abs() <= l.mean_tolerance
                && (l.blocks.std_dev[i] - l.std_dev).abs() <= l.std_tolerance
        })
    };
    // Two misfits in a row end the steady part; one more block is given up as a guard.
    let grow = |candidates: &mut dyn Iterator<Item = usize>| -> Option<usize> {
        let (mut last_good, mut misfits) = (None, 0);
        for i in candidates {
            if fits(i) {
                (last_good, misfits) = (Some(i), 0);
            } else {
                misfits += 1;
                if misfits == 2 {
                    break;
                }
            }
        }
        last_good
    };
    let start = match grow(&mut (cut.start..core.start).rev()) {
        Some(i) => (i + 1).min(core.start),
        None => core.start,
    };
    let end = match grow(&mut (core.end..cut.end)) {
        Some(i) => i.max(core.end),
        None => core.end,
    };
    start..end
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::f64::consts::TAU;

    const RATE: f64 = 2000.0;

    /// What a made record looks like; times in s.
    #[derive(Clone, Copy)]
    struct Made {
        air_to: f64,
        steady: (f64, f64),
        air_from: f64,
        end: f64,
        ripple: f64,
        noise: f64,
        drift: f64,
    }

    const MILLING: Made = Made {
        air_to: 0.8,
        steady: (1.1, 2.5),
        air_from: 2.8,
        end: 3.3,
        ripple: 40.0,
        noise: 4.0,
        drift: 20.0,
    };

    fn make(m: Made, seed: u64) -> Vec<Vec<f64>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let channel = |level: f64, rng: &mut ChaCha8Rng| {
            (0..(m.end * RATE) as usize)
                .map(|i| {
                    let t = i as f64 / RATE;
                    let engaged = if t < m.air_to || t > m.air_from {
                        0.0
                    } else if t < m.steady.0 {
                        (t - m.air_to) / (m.steady.0 - m.air_to)
                    } else if t > m.steady.1 {
                        (m.air_from - t) / (m.air_from - m.steady.1)
                    } else {
                        1.0
                    };
                    let gauss: f64 = (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
                    engaged * (level + m.ripple * (TAU * 80.0 * t).sin())
                        + m.drift * t
                        + 3.0 * (TAU * 50.0 * t).sin()
                        + m.noise * gauss
                })
                .collect()
        };
        vec![channel(150.0, &mut rng), channel(-60.0, &mut rng)]
    }

    fn phases(data: &[Vec<f64>], entry: Option<f64>) -> Phases {
        let channels: Vec<&[f64]> = data.iter().map(Vec::as_slice).collect();
        let spindle = Spindle {
            samples_per_revolution: RATE / 20.0,
            teeth: 4,
        };
        find_phases(&channels, spindle, entry).unwrap()
    }

    fn seconds(r: &Range<usize>) -> (f64, f64) {
        (r.start as f64 / RATE, r.end as f64 / RATE)
    }

    #[test]
    fn milling_phases_are_found_under_drift_hum_and_noise() {
        for seed in 0..20 {
            for drift in [0.0, 20.0, -100.0] {
                let p = phases(&make(Made { drift, ..MILLING }, seed), None);
                let before = seconds(p.air.before.as_ref().unwrap());
                let after = seconds(p.air.after.as_ref().unwrap());
                let steady = seconds(&p.steady);
                assert!(before.1 > 0.6 && before.1 <= 0.8, "seed {seed}: {before:?}");
                assert!(after.0 >= 2.8 && after.0 < 3.0, "seed {seed}: {after:?}");
                assert!(steady.0 >= 1.08 && steady.0 < 1.4, "seed {seed}: {steady:?}");
                assert!(steady.1 <= 2.52 && steady.1 > 2.2, "seed {seed}: {steady:?}");
                assert_eq!(p.steady.len() % 100, 0, "whole revolutions");
            }
        }
    }

    #[test]
    fn missing_air_is_noticed_on_either_side() {
        for seed in 0..10 {
            let data = make(MILLING, seed);
            let cut = |from: f64, to: f64| -> Vec<Vec<f64>> {
                let range = (from * RATE) as usize..(to * RATE) as usize;
                data.iter().map(|c| c[range.clone()].to_vec()).collect()
            };
            let no_before = phases(&cut(1.3, 3.3), None);
            assert!(no_before.air.before.is_none() && no_before.air.after.is_some());
            let no_after = phases(&cut(0.0, 2.3), None);
            assert!(no_after.air.before.is_some() && no_after.air.after.is_none());
            let neither = phases(&cut(1.3, 2.3), None);
            assert_eq!(neither.air, Air::default());
            assert!(neither.steady.len() >= 1500, "{neither:?}");
        }
    }

    #[test]
    fn drilling_without_ripple_is_found_by_level_and_entry_by_geometry() {
        let drilling = Made {
            ripple: 0.0,
            noise: 1.0,
            steady: (1.5, 2.79),
            ..MILLING
        };
        for seed in 0..10 {
            let p = phases(&make(drilling, seed), Some(0.7 * RATE));
            let steady = seconds(&p.steady);
            assert!(p.air.before.is_some() && p.air.after.is_some());
            assert!(steady.0 >= 1.5 && steady.0 < 1.8, "{steady:?}");
            assert!(steady.1 <= 2.79 && steady.1 > 2.5, "{steady:?}");
        }
    }

    #[test]
    fn a_record_too_short_or_without_channels_gives_nothing() {
        let spindle = Spindle {
            samples_per_revolution: 100.0,
            teeth: 2,
        };
        assert_eq!(find_phases(&[], spindle, None), None);
        assert_eq!(find_phases(&[&[1.0; 150]], spindle, None), None);
        let broken = Spindle {
            samples_per_revolution: f64::NAN,
            teeth: 0,
        };
        assert_eq!(find_phases(&[&[1.0; 5000]], broken, None), None);
    }

    #[test]
    fn whole_revolutions_are_whole_and_inside() {
        assert_eq!(whole_revolutions(10.0..45.0, 10.0, 100), 13..43);
        assert!(whole_revolutions(10.0..15.0, 10.0, 100).is_empty());
        assert!(whole_revolutions(90.0..200.0, 20.0, 100).is_empty());
        assert!(whole_revolutions(0.0..1.0, 0.0, 1).is_empty());
    }

    proptest::proptest! {
        #[test]
        fn no_record_makes_it_panic_and_what_it_finds_lies_inside(
            levels in proptest::collection::vec((-1e3..1e3f64, 1usize..400), 0..12),
            turn in 0.0..300.0f64,
            teeth in 0usize..7,
            entry in proptest::option::of(-10.0..3000.0f64),
            seed in 0u64..1000,
        ) {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let data: Vec<f64> = levels
                .iter()
                .flat_map(|&(level, n)| (0..n).map(|_| level + rng.random_range(-1.0..1.0)).collect::<Vec<_>>())
                .collect();
            let spindle = Spindle { samples_per_revolution: turn, teeth };
            if let Some(p) = find_phases(&[&data, &data], spindle, entry) {
                proptest::prop_assert!(!p.steady.is_empty() && p.steady.end <= data.len());
                proptest::prop_assert!(p.air.before.is_none_or(|r| r.end <= p.steady.start));
                proptest::prop_assert!(p.air.after.is_none_or(|r| r.start >= p.steady.end));
            }
        }
    }
}
