//! How far the tool is engaged, block by block, and where it is fully: a slow entry is a ramp of the force that the steady
//! part must not begin in.

use std::ops::Range;

use super::blocks::{SignalBlocks, line, median};
use crate::statistics::quantile;

/// An entry begins below this part of the full force; a cut whose force merely changes does not.
const ENTRY_BEGINS_BELOW: f64 = 0.6;
/// A ramp over less than this part of the cut stays clear of the cut's middle, and the steady part, which grows out of the
/// middle, ends at it.
const SLOW: f64 = 0.25;
/// Of a few blocks, one with less than this part of the full force is not full.
const FULL: f64 = 0.85;
/// Part of the ramp given up beyond its end: engagement by a round tool rounds the corner.
const ROUNDED: f64 = 0.1;
/// Within a cut, less than this part of the full force is no cut: the tool is out of the work.
const OUT_OF_WORK: f64 = 0.2;
/// The full force that is a part of is that of all but the loudest blocks, which a tool that strikes the work makes.
const FULL_QUANTILE: f64 = 0.9;
/// What air itself seems to carry must be this much less than that for air within the cut to be told from it.
const TOLD_FROM_NOISE: f64 = 3.0;

/// What air on one side of a cut tells of the zero within it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum OneSidedZero {
    /// Nothing, since it may drift: the fluctuation alone counts.
    Unknown,
    /// The zero, near enough.
    Stays,
}

/// A channel's zero as a line over the blocks.
#[derive(Debug, Clone, Copy)]
struct Zero {
    value: f64,
    slope: f64,
    from: f64,
}

impl Zero {
    /// From the `air`, in blocks: before, after, or both.
    fn of(channel: &SignalBlocks, air: &[Range<usize>], one_sided: OneSidedZero) -> Option<Zero> {
        let level = |r: &Range<usize>| median(channel.mean.get(r.clone()).unwrap_or(&[]));
        let middle = |r: &Range<usize>| 0.5 * (r.start + r.end) as f64;
        match air {
            [first, last] => Some(Zero {
                value: level(first),
                slope: (level(last) - level(first)) / (middle(last) - middle(first)).max(1.0),
                from: middle(first),
            }),
            [only] if one_sided == OneSidedZero::Stays => Some(Zero {
                value: level(only),
                slope: 0.0,
                from: 0.0,
            }),
            _ => None,
        }
    }

    fn at(&self, block: usize) -> f64 {
        self.value + self.slope * (block as f64 - self.from)
    }
}

/// Root mean square of the force about zero around each block, over all channels; `blocks_per_turn` of them are taken together,
/// since no tooth is like the next. The zero and the noise are those of `air`, in blocks.
pub(super) fn loudness(
    blocks: &[SignalBlocks],
    air: &[Range<usize>],
    one_sided: OneSidedZero,
    blocks_per_turn: usize,
) -> Vec<f64> {
    let count = blocks.iter().map(SignalBlocks::len).min().unwrap_or(0);
    let mut square = vec![0.0; count];
    for b in blocks {
        let noise = air
            .iter()
            .map(|r| median(b.std_dev.get(r.clone()).unwrap_or(&[])))
            .fold(f64::INFINITY, f64::min);
        let noise = if noise.is_finite() { noise } else { 0.0 };
        let zero = Zero::of(b, air, one_sided);
        for (i, s) in square.iter_mut().enumerate() {
            let ripple = b.std_dev[i].powi(2) - noise * noise;
            let level = zero.map_or(0.0, |z| b.mean[i] - z.at(i));
            *s += ripple + level * level;
        }
    }
    let near = |i: usize| {
        let from = i.saturating_sub(blocks_per_turn / 2);
        let to = (from + blocks_per_turn.max(1)).min(count);
        super::mean(&square[to.saturating_sub(blocks_per_turn.max(1))..to])
            .max(0.0)
            .sqrt()
    };
    (0..count).map(near).collect()
}

/// The passes that `cut` is made of, in blocks, without the blocks in which the tool leaves or enters: all of it where the tool stays in
/// the work. `loudness`: with the zero of the `air`, in blocks. A pass of fewer than `shortest` blocks is none.
pub(super) fn passes(
    loudness: &[f64],
    cut: &Range<usize>,
    air: &[Range<usize>],
    shortest: usize,
) -> Vec<Range<usize>> {
    let whole = vec![cut.clone()];
    let of_cut = loudness.get(cut.clone()).unwrap_or(&[]);
    let limit = OUT_OF_WORK * quantile(of_cut.iter().copied(), FULL_QUANTILE).unwrap_or(0.0);
    let of_air = air.iter().filter_map(|r| loudness.get(r.clone())).flatten();
    let of_air = quantile(of_air.copied(), FULL_QUANTILE).unwrap_or(0.0);
    if of_cut.iter().all(|v| *v >= limit) || TOLD_FROM_NOISE * of_air > limit {
        return whole;
    }
    let is_in = |i: &usize| loudness[*i] >= limit;
    // What lacks force at the ends is entry and exit, which are looked at elsewhere.
    let (Some(first), Some(last)) = (cut.clone().find(is_in), cut.clone().rfind(is_in)) else {
        return whole;
    };
    let (mut found, mut from) = (Vec::new(), cut.start);
    let mut keep = |pass: Range<usize>| {
        if pass.len() >= shortest {
            found.push(pass);
        }
    };
    for i in first..last {
        match (is_in(&i), is_in(&(i + 1))) {
            (true, false) => keep(from..i),
            (false, true) => from = i + 2,
            _ => (),
        }
    }
    keep(from..cut.end);
    if found.is_empty() { whole } else { found }
}

/// The part of `cut` between slow ramps in and out of full engagement, in blocks; `cut` where there are none.
pub(super) fn full_engagement(loudness: &[f64], cut: Range<usize>) -> Range<usize> {
    let of_cut = match loudness.get(cut.clone()) {
        Some(part) if part.len() >= 6 => part,
        Some(part) => {
            // A few blocks: those at the ends that lack force are entry and exit.
            let full = part.iter().copied().fold(0.0, f64::max);
            let is_full = |v: &f64| *v > FULL * full;
            let (from, to) = (part.iter().position(is_full), part.iter().rposition(is_full));
            return from
                .zip(to)
                .map_or(cut.clone(), |(a, b)| cut.start + a..cut.start + b + 1);
        }
        None => return cut,
    };
    let backwards: Vec<f64> = of_cut.iter().rev().copied().collect();
    let (entry, exit) = (ramp(of_cut), ramp(&backwards));
    // What one slow ramp leaves of the cut is what the other is measured by.
    let is_slow = |own: usize, other: usize| own as f64 >= SLOW * (of_cut.len() - other) as f64;
    let left_out = |corner: usize, slow: bool| if slow { corner } else { 0 };
    let exit_is_slow = is_slow(exit, left_out(entry, is_slow(entry, 0)));
    let entry_is_slow = is_slow(entry, left_out(exit, exit_is_slow));
    let beyond = |corner: usize| corner + (ROUNDED * corner as f64).ceil() as usize;
    let from = beyond(left_out(entry, entry_is_slow));
    let to = of_cut.len().saturating_sub(beyond(left_out(exit, exit_is_slow)));
    if from + 2 < to {
        cut.start + from..cut.start + to
    } else {
        cut
    }
}

/// Levels of the force further apart than this part of it are two cuts: another depth, another engagement.
const ONE_LEVEL: f64 = 0.16;
/// A stretch at one level is a plateau, and no part of a ramp, where it has so much more of the cut than a ramp over the same range leaves
/// within one level, as a part of what that leaves out…
const PLATEAU: f64 = 0.2;
/// …and this part of what is looked at; more than the other leaves out nothing but the ends.
const SHARE_OF_PLATEAU: f64 = 0.25;
const SHARE_OF_ALL: f64 = 0.9;
/// One part in so many of a cut, at either end, may be entry and exit.
const ENDS: usize = 8;

/// The longest stretch of `cut` (blocks) in which the mean force stays, where it steps from one level to another within it; `None` where
/// it stays throughout, changes all the time, or no `air` tells its zero. `blocks_per_turn` blocks are taken together.
pub(super) fn plateau(
    blocks: &[SignalBlocks],
    air: &[Range<usize>],
    blocks_per_turn: usize,
    cut: &Range<usize>,
) -> Option<Range<usize>> {
    let per_turn = blocks_per_turn.max(1);
    let turns = cut.len() / per_turn;
    // Of each channel, turn by turn, over the force that it carries.
    let mut levels: Vec<Vec<f64>> = Vec::new();
    for b in blocks {
        let zero = Zero::of(b, air, OneSidedZero::Stays)?;
        let level = |i: usize| b.mean[i] - zero.at(i);
        let squares = cut.clone().map(|i| level(i).powi(2) + b.std_dev[i].powi(2));
        let force = median(&squares.collect::<Vec<_>>()).sqrt().max(f64::MIN_POSITIVE);
        let turn = |k: usize| {
            let from = cut.start + k * per_turn;
            (from..from + per_turn).map(level).sum::<f64>() / (per_turn as f64 * force)
        };
        levels.push((0..turns).map(turn).collect());
    }
    // What lies before contact and after it, where no air was found, is no level of the cut.
    let carries = |k: &usize| levels.iter().any(|v| v[*k].abs() >= OUT_OF_WORK);
    let turns = (0..turns).find(carries)?..(0..turns).rfind(carries)? + 1;
    // The way in and out is no other level.
    let ends = turns.len() / ENDS;
    let inner = turns.start + ends..turns.end - ends;
    let between =
        |values: &Vec<f64>, share: f64| quantile(values[inner.clone()].iter().copied(), share).unwrap_or(0.0);
    let range = levels.iter().map(|v| between(v, 0.95) - between(v, 0.05));
    let range = range.fold(0.0, f64::max);
    if range < ONE_LEVEL {
        return None;
    }
    // The run that begins at each turn: until the levels seen in it lie too far apart.
    let run_from = |from: usize| -> usize {
        let mut seen: Vec<[f64; 2]> = vec![[f64::INFINITY, f64::NEG_INFINITY]; levels.len()];
        let stays = |k: &usize| {
            levels.iter().zip(&mut seen).all(|(v, [low, high])| {
                (*low, *high) = (low.min(v[*k]), high.max(v[*k]));
                *high - *low < ONE_LEVEL
            })
        };
        (from..turns.end).take_while(stays).count()
    };
    let mut best = 0..0;
    let mut from = turns.start;
    while from + best.len() < turns.end {
        let length = run_from(from);
        if length > best.len() {
            best = from..from + length;
        }
        from += 1;
    }
    let share = best.len() as f64 / turns.len() as f64;
    let of_a_ramp = ONE_LEVEL / range;
    let least = of_a_ramp + PLATEAU * (1.0 - of_a_ramp);
    (share < SHARE_OF_ALL && share > SHARE_OF_PLATEAU.max(least))
        .then(|| cut.start + best.start * per_turn..cut.start + best.end * per_turn)
}

/// Blocks of the ramp that `series` begins with: the corner of level − slope · max(corner − i, 0) that leaves the
/// least squares. 0 where it does not begin low.
fn ramp(series: &[f64]) -> usize {
    // Beyond the last block at full force is the way out.
    let full = quantile(series.iter().copied(), 0.9).unwrap_or(0.0);
    let last = series.iter().rposition(|v| *v > 0.9 * full).unwrap_or(0) + 1;
    let part = &series[..last];
    let first = part[..part.len().min(2)]
        .iter()
        .copied()
        .fold(f64::INFINITY, f64::min);
    if part.len() < 4 || first > ENTRY_BEGINS_BELOW * full {
        return 0;
    }
    let squares_left = |corner: usize| -> f64 {
        let x = |i: usize| corner.saturating_sub(i) as f64;
        let (level, slope, centre) = line((0..part.len()).map(x), part.iter().copied());
        part.iter()
            .enumerate()
            .map(|(i, v)| (v - level - slope * (x(i) - centre)).powi(2))
            .sum()
    };
    let corners = 1..part.len();
    corners
        .min_by(|a, b| squares_left(*a).total_cmp(&squares_left(*b)))
        .unwrap_or(0)
}

/// By what part the force changes over a steady window, where that is more than its scatter: from its first third to its last, or
/// to or from the middle third if that is more. `loudness`: of each of its turns.
pub fn change(loudness: &[f64]) -> f64 {
    let third = loudness.len() / 3;
    if third < 2 {
        return 0.0;
    }
    let from = [0, (loudness.len() - third) / 2, loudness.len() - third];
    let thirds = from.map(|at| &loudness[at..at + third]);
    let between = |a: usize, b: usize| -> f64 {
        let scatter = super::robust_std(thirds[a]).max(super::robust_std(thirds[b]));
        let (from, to) = (median(thirds[a]), median(thirds[b]));
        let level = 0.5 * (from + to);
        if level > 0.0 && (to - from).abs() > 3.0 * scatter {
            (to - from) / level
        } else {
            0.0
        }
    };
    let all = [between(0, 1), between(1, 2), between(0, 2)];
    all.into_iter()
        .fold(0.0, |most, c| if c.abs() >= most.abs() { c } else { most })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn a_cut(entry: usize, steady: usize, exit: usize) -> Vec<f64> {
        let up = (0..entry).map(|i| i as f64 / entry as f64);
        let down = (0..exit).map(|i| 1.0 - (i + 1) as f64 / (exit + 1) as f64);
        let values = up.chain((0..steady).map(|_| 1.0)).chain(down);
        // A little scatter, the same every time.
        values
            .enumerate()
            .map(|(i, v)| v + 0.01 * ((i * 7919 % 13) as f64 - 6.0) / 6.0)
            .collect()
    }

    #[test]
    fn the_plateau_lies_between_the_ramps_however_long_they_are() {
        for (entry, steady, exit) in [(60, 30, 3), (40, 80, 4), (100, 40, 40), (12, 30, 4)] {
            let values = a_cut(entry, steady, exit);
            let found = full_engagement(&values, 0..values.len());
            assert!(
                found.start + 2 >= entry && found.end <= entry + steady + 4,
                "{entry} {steady} {exit}: {found:?}"
            );
            assert!(found.len() * 2 >= steady, "{entry} {steady} {exit}: {found:?}");
        }
    }

    /// One channel of `level` in blocks of a turn, air of ten blocks on either side.
    fn stays(level: &[f64]) -> Option<Range<usize>> {
        let air = [0.0; 10];
        let mean: Vec<f64> = air.iter().chain(level).chain(&air).copied().collect();
        let count = mean.len();
        // A zero that drifts by as much as the force is.
        let mean = mean
            .iter()
            .enumerate()
            .map(|(i, v)| 5.0 + v + i as f64 / count as f64);
        let blocks = SignalBlocks {
            mean: mean.collect(),
            std_dev: vec![0.01; count],
            samples_per_block: 100.0,
        };
        plateau(&[blocks], &[0..10, count - 10..count], 1, &(10..count - 10))
    }

    #[test]
    fn a_force_that_steps_is_taken_where_it_stays_longest() {
        let step: Vec<f64> = (0..90).map(|i| if i < 30 { 1.0 } else { 1.4 }).collect();
        assert_eq!(stays(&step), Some(40..100));
        let up_and_on = |i: usize| 1.0 + 0.5 * ((i as f64 - 50.0) / 20.0).clamp(0.0, 1.0);
        let slow: Vec<f64> = (0..90).map(up_and_on).collect();
        let found = stays(&slow).unwrap();
        assert!(found.start == 10 && (60..=67).contains(&found.end), "{found:?}");
        // One that changes all the time stays nowhere, and little is no change.
        let ramp: Vec<f64> = (0..90).map(|i| 1.0 + 0.5 * i as f64 / 89.0).collect();
        assert_eq!(stays(&ramp), None);
        // Entry and exit over a twentieth of the cut each.
        let quick: Vec<f64> = (0..90)
            .map(|i| (0.2 * (i + 1).min(90 - i) as f64).min(1.0))
            .collect();
        assert_eq!(stays(&quick), None);
        // A real record: a zero that has not come back after the cut was found to be no air.
        let beyond: Vec<f64> = (0..90).map(|i| if i < 60 { 1.0 } else { 0.04 }).collect();
        assert_eq!(stays(&beyond), None);
        let step_and_beyond: Vec<f64> = step.iter().copied().chain([0.04; 20]).collect();
        assert_eq!(stays(&step_and_beyond), Some(40..100));
        let little: Vec<f64> = (0..90).map(|i| if i < 30 { 1.0 } else { 1.1 }).collect();
        assert_eq!(stays(&little), None);
    }

    #[test]
    fn passes_are_what_lies_between_the_air_of_a_cut() {
        let quiet = |i: usize| 0.02 * (i * 7919 % 13) as f64 / 12.0;
        let cutting = |i: usize| (10..40).contains(&i) || (50..55).contains(&i) || (60..100).contains(&i);
        let loud: Vec<f64> = (0..110)
            .map(|i| quiet(i) + f64::from(u8::from(cutting(i))))
            .collect();
        let air = [0..10, 100..110];
        // The guard blocks of the inner ends; the stretch of five blocks is none of at least four besides them.
        assert_eq!(passes(&loud, &(10..100), &air, 4), [10..39, 61..100]);
        assert_eq!(passes(&loud, &(10..100), &air, 3), [10..39, 51..54, 61..100]);
        assert_eq!(passes(&loud, &(10..40), &air, 4), std::slice::from_ref(&(10..40)));
        // What lacks force at the ends is the way in and out.
        assert_eq!(passes(&loud, &(5..45), &air, 4), std::slice::from_ref(&(5..45)));
        // A force that falls to a third of itself is a cut of less depth.
        let lower: Vec<f64> = (0..110)
            .map(|i| if (40..60).contains(&i) { 0.33 } else { 1.0 })
            .collect();
        assert_eq!(
            passes(&lower, &(10..100), &[], 4),
            std::slice::from_ref(&(10..100))
        );
        // Where air is as loud as that, nothing tells the two apart.
        let noisy: Vec<f64> = (0..110).map(|i| if cutting(i) { 1.0 } else { 0.1 }).collect();
        assert_eq!(
            passes(&noisy, &(10..100), &air, 4),
            std::slice::from_ref(&(10..100))
        );
    }

    #[test]
    fn a_force_that_wanders_or_grows_is_not_cut_short() {
        let wander: Vec<f64> = (0..80).map(|i| 1.0 + 0.15 * (i as f64 / 9.0).sin()).collect();
        assert_eq!(full_engagement(&wander, 0..80), 0..80);
        let grows: Vec<f64> = (0..80).map(|i| 0.8 + 0.4 * i as f64 / 79.0).collect();
        assert_eq!(full_engagement(&grows, 0..80), 0..80);
        assert!((change(&grows) - 0.27).abs() < 0.03, "{}", change(&grows));
        assert_eq!(change(&a_cut(0, 40, 0)), 0.0);
        // Up in the middle and down again.
        let hump: Vec<f64> = (0..90)
            .map(|i| if (30..60).contains(&i) { 1.2 } else { 1.0 })
            .collect();
        assert!((change(&hump).abs() - 0.18).abs() < 0.01, "{}", change(&hump));
        let quick = a_cut(3, 80, 3);
        assert_eq!(full_engagement(&quick, 0..quick.len()), 0..quick.len());
    }
}
