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

/// Root mean square of the force about zero around each block, over all channels; `blocks_per_turn` of them are taken together,
/// since no tooth is like the next. The zero and the noise are those of `air`, in blocks; air on one side tells the noise only,
/// since it may drift, and then the fluctuation alone counts.
pub(super) fn loudness(blocks: &[SignalBlocks], air: &[Range<usize>], blocks_per_turn: usize) -> Vec<f64> {
    let count = blocks.iter().map(SignalBlocks::len).min().unwrap_or(0);
    let mut square = vec![0.0; count];
    for b in blocks {
        let of = |pick: &[f64], r: &Range<usize>| median(pick.get(r.clone()).unwrap_or(&[]));
        let noise = air
            .iter()
            .map(|r| of(&b.std_dev, r))
            .fold(f64::INFINITY, f64::min);
        let noise = if noise.is_finite() { noise } else { 0.0 };
        let zero = match air {
            [first, last] => {
                let middle = |r: &Range<usize>| 0.5 * (r.start + r.end) as f64;
                let (from, to) = (of(&b.mean, first), of(&b.mean, last));
                let slope = (to - from) / (middle(last) - middle(first)).max(1.0);
                Some(move |i: usize| from + slope * (i as f64 - middle(first)))
            }
            _ => None,
        };
        for (i, s) in square.iter_mut().enumerate() {
            let ripple = b.std_dev[i].powi(2) - noise * noise;
            let level = zero.as_ref().map_or(0.0, |z| b.mean[i] - z(i));
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

/// By what part the force changes from the first third of a steady window to its last, where that is more than its scatter;
/// `loudness`: of each of its turns.
pub fn change(loudness: &[f64]) -> f64 {
    let third = loudness.len() / 3;
    if third < 2 {
        return 0.0;
    }
    let (first, last) = (&loudness[..third], &loudness[loudness.len() - third..]);
    let (a, b) = (median(first), median(last));
    let scatter = super::blocks::robust_std(first).max(super::blocks::robust_std(last));
    let level = 0.5 * (a + b);
    if level > 0.0 && (b - a).abs() > 3.0 * scatter {
        (b - a) / level
    } else {
        0.0
    }
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

    #[test]
    fn a_force_that_wanders_or_grows_is_not_cut_short() {
        let wander: Vec<f64> = (0..80).map(|i| 1.0 + 0.15 * (i as f64 / 9.0).sin()).collect();
        assert_eq!(full_engagement(&wander, 0..80), 0..80);
        let grows: Vec<f64> = (0..80).map(|i| 0.8 + 0.4 * i as f64 / 79.0).collect();
        assert_eq!(full_engagement(&grows, 0..80), 0..80);
        assert!((change(&grows) - 0.27).abs() < 0.03, "{}", change(&grows));
        assert_eq!(change(&a_cut(0, 40, 0)), 0.0);
        let quick = a_cut(3, 80, 3);
        assert_eq!(full_engagement(&quick, 0..quick.len()), 0..quick.len());
    }
}
