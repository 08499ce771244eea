//! The states at the two ends of a record: how far each reaches, and whether it is air.

use std::ops::Range;

use super::blocks::{SignalBlocks, line, median};
use crate::statistics::quantile;

/// Too few blocks for a state to be told from noise.
pub(super) const MIN_STATE_BLOCKS: usize = 4;
/// A block departs when its mean leaves the local line by this many standard deviations…
const DEPARTURE_SIGMA: f64 = 6.0;
/// …and by this part of the channel's range (slow bends of the drift stay below it).
const DEPARTURE_OF_RANGE: f64 = 0.02;
/// A change of a block's fluctuation must be this many times what it varies by from one block to the next: noise with a
/// resonance or of a narrow band varies more than white noise does.
const LOUDNESS_SIGMA: f64 = 4.0;
/// Two states differ in kind when their distance is beyond this part of the largest distance.
const SAME_STATE: f64 = 0.35;

/// A third of what lies between the ends speaks for it where it is further off both, by this factor, than its middle.
const CLEARLY_FURTHER: f64 = 1.5;

/// Air before and air after have the same noise, up to this ratio of energies.
const QUIET: f64 = 1.6;

/// Blocks behind a line that a departure is judged by.
const TRAIL: usize = 12;
/// Blocks whose mean residual shows a slow departure, such as a drill's entry.
const AHEAD: usize = 6;
/// A slow departure must reach this part of the channel's range.
const SLOW_DEPARTURE_OF_RANGE: f64 = 0.05;

/// What counts as a departure in one channel.
struct Limits<'a> {
    blocks: &'a SignalBlocks,
    /// Noise of block means.
    sigma: f64,
    range: f64,
    /// Change of the logarithm of the fluctuation.
    fluctuation: f64,
}

/// Logarithm of the ratio of two fluctuations.
fn loudness_step(from: f64, to: f64) -> f64 {
    (to.max(f64::MIN_POSITIVE) / from.max(f64::MIN_POSITIVE)).ln()
}

/// Standard deviation of the logarithm of a block's fluctuation, from neighbours.
fn loudness_varies(blocks: &SignalBlocks) -> f64 {
    let pairs = blocks.std_dev.windows(2);
    let steps: Vec<f64> = pairs.map(|w| loudness_step(w[0], w[1]).abs()).collect();
    median(&steps) / (0.6745 * std::f64::consts::SQRT_2)
}

impl<'a> Limits<'a> {
    fn new(blocks: &'a SignalBlocks) -> Self {
        // From neighbours; the lower quartile, since inside the cut they differ more. Near and far ones, too, against the line
        // between them: what hum makes of the means comes back after a few blocks.
        let steps = blocks.mean.windows(2).map(|w| (w[1] - w[0]).abs());
        let step = quantile(steps, 0.25).unwrap_or(0.0) / (0.3186 * std::f64::consts::SQRT_2);
        let bend = |apart: usize| {
            let m = &blocks.mean;
            let bends = (2 * apart..m.len()).map(|i| (m[i] - 2.0 * m[i - apart] + m[i - 2 * apart]).abs());
            quantile(bends, 0.25).unwrap_or(0.0) / (0.3186 * 6f64.sqrt())
        };
        let by_chance = DEPARTURE_SIGMA / (2.0 * blocks.samples_per_block).sqrt();
        Limits {
            blocks,
            sigma: step.max(bend(1)).max(bend(2)),
            range: quantile(blocks.mean.iter().copied(), 0.95).unwrap_or(0.0)
                - quantile(blocks.mean.iter().copied(), 0.05).unwrap_or(0.0),
            fluctuation: 0.25f64
                .max(by_chance)
                .max(LOUDNESS_SIGMA * loudness_varies(blocks)),
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
        let squares: f64 = std.windows(2).map(|w| loudness_step(w[0], w[1]).powi(2)).sum();
        let varies = (0.5 * squares / (std.len().max(2) - 1) as f64).sqrt();
        usual > 0.0 && loudness_step(usual, now).abs() > self.fluctuation.max(LOUDNESS_SIGMA * varies)
    }
}

/// Number of blocks, counted from one end, that continue the state found at that end. Followed by a line
/// through the latest blocks, so that a slow bend of the drift does not count; two blocks in a row must
/// depart, so that a spike does not.
pub(super) fn departure(blocks: &[SignalBlocks], count: usize, from_end: bool) -> usize {
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
pub(super) fn air_states(
    blocks: &[SignalBlocks],
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
    // The tool may be out of the work in the middle, between two passes: then one of the outer thirds speaks for the cut.
    let third = m_to.saturating_sub(m_from) / 3;
    let outer = [m_from..m_from + third, m_to - third..m_to];
    let outer = outer.iter().filter(|r| r.len() >= MIN_STATE_BLOCKS);
    let of = |r: &Range<usize>, pick: fn(&SignalBlocks) -> &Vec<f64>| -> Vec<f64> {
        let part = |b: &SignalBlocks| pick(b).get(r.clone()).map_or(0.0, median);
        blocks.iter().map(part).collect()
    };

    // Milling: tooth-passing energy first, drift does not touch it. (A drill has none, and its entry is a ramp.)
    let energy = |r: &Range<usize>| of(r, |b| &b.std_dev);
    let quietest: Vec<f64> = blocks
        .iter()
        .map(|b| {
            quantile(b.std_dev.iter().copied(), 0.05)
                .unwrap_or(0.0)
                .max(f64::MIN_POSITIVE)
        })
        .collect();
    let loudness = |r: &Range<usize>| -> f64 {
        let e = energy(r);
        e.iter().zip(&quietest).map(|(s, q)| (s / q).powi(2)).sum::<f64>() / e.len().max(1) as f64
    };
    let (ls, le) = (loudness(&start), loudness(&end));
    let lm = outer.clone().map(loudness).fold(loudness(&middle), f64::max);
    let loudest = ls.max(lm).max(le);
    let least = ls.min(lm).min(le);
    if entry_blocks.is_none() && loudest > 2.0 * least {
        // The passage in or out may be the loudest part: air is as quiet as the quietest, not just quieter. Noise that varies
        // more has more to differ by, but a state nearer to the loudest is no air.
        let varies = blocks.iter().map(loudness_varies).fold(0.0, f64::max);
        let by_chance = (2.0 * LOUDNESS_SIGMA * varies * (2.0 / near as f64).sqrt()).exp();
        let quiet = |l: f64| l < least * QUIET.max(by_chance.min((loudest / least).sqrt()));
        return (quiet(ls), quiet(le));
    }

    // Otherwise the level.
    let level = |r: &Range<usize>| of(r, |b| &b.mean);
    let scale: Vec<f64> = blocks
        .iter()
        .map(|b| {
            (quantile(b.mean.iter().copied(), 0.95).unwrap_or(0.0)
                - quantile(b.mean.iter().copied(), 0.05).unwrap_or(0.0))
            .max(f64::MIN_POSITIVE)
        })
        .collect();
    let distance = |a: &[f64], b: &[f64]| -> f64 {
        a.iter()
            .zip(b)
            .zip(&scale)
            .map(|((a, b), s)| ((a - b) / s).powi(2))
            .sum::<f64>()
            .sqrt()
    };
    let (s, e) = (level(&start), level(&end));
    let off = |m: &[f64]| [distance(&s, m), distance(&e, m)];
    let [mut sm, mut em] = off(&level(&middle));
    for [other_sm, other_em] in outer.map(|r| off(&level(r))) {
        // On the way from one state to the other the sum is the same everywhere.
        if other_sm + other_em > CLEARLY_FURTHER * (sm + em) {
            (sm, em) = (other_sm, other_em);
        }
    }
    let se = distance(&s, &e);
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
