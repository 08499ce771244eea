//! Where in a record the tool cuts air, enters, cuts steadily and leaves.
//!
//! The record is looked at in blocks of whole tool revolutions: their means show the force level, their
//! fluctuation the tooth-passing energy. From each end, the state found there is followed until blocks stop
//! fitting it; the states are then told apart by fluctuation (milling) or level (drilling). Inside the cut,
//! the steady part is grown outwards from its middle until entry or exit shows.

use std::ops::Range;

use super::air_check::air_in;
use super::blocks::{SignalBlocks, Spindle, line, median, robust_std};
use super::drift::Air;
use super::end_states::{MIN_STATE_BLOCKS, air_states, departure};
use super::engagement::{OneSidedZero, full_engagement, loudness, passes, plateau};
use crate::data::Sample;
use crate::statistics::quantile;

/// The parts of a record, as sample ranges.
#[derive(Debug, Clone, PartialEq)]
pub struct Phases {
    /// Where the tool cuts nothing.
    pub air: Air,
    /// First contact to last.
    pub cutting: Range<usize>,
    /// Where the tool leaves the work in between: each pass, of which the steady part is one's. Empty where it stays in it.
    pub passes: Vec<Range<usize>>,
    /// Where the force steps from one level to another within the cut: all of the cut that the steady part could be of, of which it
    /// is the longest stretch at one level.
    pub levels: Option<Range<usize>>,
    /// Full engagement, a whole number of revolutions.
    pub steady: Range<usize>,
}

/// More blocks than this are merged: finer ones would make a drill's slow entry too gentle to notice.
const MAX_BLOCKS: f64 = 250.0;
/// Turns of a clip are alike where their force fluctuates by the same, up to this part of it.
const ALIKE: f64 = 0.15;
/// Finds the phases of a record from its channels (all of one length; those that carry the cutting force).
/// `entry_samples`: travel from first contact to full engagement where geometry tells it (drilling);
/// otherwise entry is detected. `None` where the record holds less than a revolution, or no steady cut.
pub fn find_phases<S: Sample>(
    channels: &[&[S]],
    spindle: Spindle,
    entry_samples: Option<f64>,
) -> Option<Phases> {
    let samples = channels.iter().map(|c| c.len()).min()?;
    let per_block = block_length(samples, spindle)?;
    let blocks: Vec<SignalBlocks> = channels
        .iter()
        .map(|c| SignalBlocks::new(&c[..samples], per_block))
        .collect();
    let count = blocks.first()?.len();
    let whole = |span: Range<f64>| {
        let steady = whole_revolutions(span, spindle.samples_per_revolution, samples);
        (!steady.is_empty()).then_some(steady)
    };
    if count < 2 * MIN_STATE_BLOCKS {
        // Too short for air next to a cut: a clip out of a cut.
        return Some(Phases {
            air: Air::default(),
            cutting: 0..samples,
            passes: Vec::new(),
            levels: None,
            steady: whole(0.0..samples as f64)?,
        });
    }
    let start_end = departure(&blocks, count, false);
    let last_start = count - departure(&blocks, count, true);
    let entry_blocks = entry_samples.map(|entry| entry / per_block);
    let (before, after) = air_states(&blocks, count, start_end, last_start, entry_blocks);

    // Guard blocks: the departure is noticed a little late.
    let sample = |block: f64| ((block * per_block).round().max(0.0) as usize).min(samples);
    let guard = 2.0;
    let air_before = before.then(|| 0..sample(start_end as f64 - guard));
    let air_after = after.then(|| sample(last_start as f64 + guard)..samples);
    let long_enough = |r: &Range<usize>| r.len() as f64 >= 2.0 * per_block;
    let (mut before, mut after) = (air_before.filter(long_enough), air_after.filter(long_enough));
    let per_turn = (spindle.samples_per_revolution / per_block).round() as usize;
    // Blocks of the air at either end, as far as it is some.
    let air_blocks = |before: bool, after: bool| -> Vec<Range<usize>> {
        let before = before.then_some(0..start_end.saturating_sub(2).max(1));
        let after = after.then_some((last_start + 2).min(count - 1)..count);
        before.into_iter().chain(after).collect()
    };
    let passes_between = |before: bool, after: bool| {
        let (lo, hi) = (
            if before { start_end } else { 0 },
            if after { last_start } else { count },
        );
        let air = air_blocks(before, after);
        let engaged = loudness(&blocks, &air, OneSidedZero::Stays, per_turn);
        passes(&engaged, &(lo..hi.max(lo)), &air, MIN_STATE_BLOCKS)
    };
    let mut air_is_doubtful = false;
    if entry_samples.is_none() {
        // The campaign says that it is a cut; what is no different from the rest of it is no air. Of several passes the longest is
        // looked at.
        let longest = longest(&passes_between(before.is_some(), after.is_some()));
        let cutting = sample(longest.start as f64)..sample(longest.end as f64);
        let air = |r: Range<usize>| air_in(channels, &r, &cutting, spindle).filter(long_enough);
        let found = before.is_some() || after.is_some();
        (before, after) = (before.and_then(air), after.and_then(air));
        air_is_doubtful = found && before.is_none() && after.is_none();
    }
    let lo = if before.is_some() { start_end } else { 0 };
    let hi = if after.is_some() { last_start } else { count };
    if lo + MIN_STATE_BLOCKS > hi {
        return None;
    }
    let cutting = sample(lo as f64)..sample(hi as f64);
    let passes = passes_between(before.is_some(), after.is_some());
    let air_blocks = air_blocks(before.is_some(), after.is_some());
    let engaged = loudness(&blocks, &air_blocks, OneSidedZero::Unknown, per_turn);
    let inside = match entry_samples.filter(|_| before.is_some()) {
        Some(entry) => {
            // Full engagement follows from how far the tool has gone in; the contact may have been noticed a block early.
            let entry = (1.03 * entry / per_block + guard).ceil() as usize;
            let mut gone = 0;
            let engaged_in = passes.iter().map(|pass| {
                let left = entry.saturating_sub(gone).min(pass.len());
                gone += pass.len();
                pass.start + left..pass.end
            });
            let full = longest(&engaged_in.collect::<Vec<_>>());
            if full.len() > MIN_STATE_BLOCKS {
                full
            } else {
                longest(&passes)
            }
        }
        None if entry_samples.is_some() => longest(&passes),
        None => full_engagement(&engaged, longest(&passes)),
    };
    let at_one_level = match entry_samples {
        None => plateau(&blocks, &air_blocks, per_turn, &inside),
        Some(_) => None,
    };
    let levels = at_one_level
        .as_ref()
        .map(|_| sample(inside.start as f64)..sample(inside.end as f64));
    let inside = at_one_level.unwrap_or(inside);
    // A clip of a few turns that are all alike has no ends to keep clear of.
    let is_even_clip = air_blocks.is_empty() && per_block < spindle.samples_per_revolution && {
        let of_clip = &engaged[inside.clone()];
        let usual = median(of_clip);
        of_clip.iter().all(|v| (v - usual).abs() <= ALIKE * usual)
    };
    let found = if air_is_doubtful || is_even_clip || inside.len() < MIN_STATE_BLOCKS {
        inside
    } else {
        steady_blocks(&blocks, inside)
    };
    let steady = whole(found.start as f64 * per_block..found.end as f64 * per_block)?;
    let air = Air { before, after };
    let passes = match passes.len() {
        1 => Vec::new(),
        _ => passes
            .iter()
            .map(|p| sample(p.start as f64)..sample(p.end as f64))
            .collect(),
    };
    Some(Phases {
        air,
        cutting,
        passes,
        levels,
        steady,
    })
}

/// The first of the longest; empty where there are none.
fn longest(ranges: &[Range<usize>]) -> Range<usize> {
    let first = ranges.iter().rev().max_by_key(|r| r.len());
    first.cloned().unwrap_or(0..0)
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

/// Grows the steady part from the central blocks of the cut outwards.
fn steady_blocks(blocks: &[SignalBlocks], cut: Range<usize>) -> Range<usize> {
    let length = cut.len();
    let core = cut.start + 3 * length / 10..(cut.end - 3 * length / 10).max(cut.start + 3 * length / 10 + 1);
    struct Core<'a> {
        blocks: &'a SignalBlocks,
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
            let level = quantile(b.mean.iter().copied(), 0.98).unwrap_or(0.0)
                - quantile(b.mean.iter().copied(), 0.02).unwrap_or(0.0);
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
                    let gauss: f64 = crate::statistics::nearly_normal(rng);
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
            sample_rate_hz: RATE,
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

    /// Noise of a narrow band (a dynamometer's resonance, 5 % of damping) and hum a sixth of the force: blocks differ by far more
    /// than under white noise.
    #[test]
    fn milling_phases_are_found_under_a_resonance_and_strong_hum() {
        for seed in 0..20 {
            let mut rng = ChaCha8Rng::seed_from_u64(100 + seed);
            let mut data = make(
                Made {
                    noise: 1.0,
                    ..MILLING
                },
                seed,
            );
            for channel in &mut data {
                let (w, decay) = (TAU * 310.0 / RATE, (-0.05 * TAU * 310.0 / RATE).exp());
                let (mut before, mut last) = (0.0, 0.0);
                let hum = rng.random_range(0.0..TAU);
                for (i, v) in channel.iter_mut().enumerate() {
                    let gauss: f64 = crate::statistics::nearly_normal(&mut rng);
                    let now = 2.0 * decay * w.cos() * last - decay * decay * before + 3.0 * gauss;
                    (before, last) = (last, now);
                    *v += now + 25.0 * (TAU * 50.0 * i as f64 / RATE + hum).sin();
                }
            }
            let p = phases(&data, None);
            let steady = seconds(&p.steady);
            assert!(
                p.air.before.is_some() && p.air.after.is_some(),
                "seed {seed}: {p:?}"
            );
            assert!(steady.0 >= 1.08 && steady.0 < 1.5, "seed {seed}: {steady:?}");
            assert!(steady.1 <= 2.52 && steady.1 > 2.1, "seed {seed}: {steady:?}");
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
            sample_rate_hz: RATE,
            teeth: 2,
        };
        assert_eq!(find_phases::<f64>(&[], spindle, None), None);
        assert_eq!(find_phases(&[&[1.0; 90]], spindle, None), None);
        // A clip out of a cut is all cut, however short.
        let clip = find_phases(&[&[1.0; 250]], spindle, None).unwrap();
        assert_eq!((clip.air, clip.steady), (Air::default(), 25..225));
        let broken = Spindle {
            samples_per_revolution: f64::NAN,
            sample_rate_hz: f64::NAN,
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
            let spindle = Spindle { samples_per_revolution: turn, sample_rate_hz: RATE, teeth };
            if let Some(p) = find_phases(&[&data, &data], spindle, entry) {
                proptest::prop_assert!(!p.steady.is_empty() && p.steady.end <= data.len());
                proptest::prop_assert!(p.air.before.is_none_or(|r| r.end <= p.steady.start));
                proptest::prop_assert!(p.air.after.is_none_or(|r| r.start >= p.steady.end));
            }
        }
    }
}
