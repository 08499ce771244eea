//! Which candidates explain more than a pole anywhere near would: chosen strongest first, over what those chosen so far
//! leave.
//!
//! A model never fits measurements exactly, and what it leaves is smooth over lines: any pole put there explains some of
//! it. So a candidate is not held against white noise but against trial poles spread over its surroundings, which know
//! neither a level nor a colour (in radar: detection with a constant rate of false alarms).

use crate::modal::max_likelihood::joint_fit::{self, Data, PoleSearch};
use crate::modal::settings::SET;
use crate::modal::single::local_fit::Pole;
use crate::modal::together::set_noise;

/// Batches at most.
const MAX_ROUNDS: usize = 30;
/// The first batches come in whatever they explain: while strong modes are missing nothing can be held against the rest.
const UNASKED: usize = 3;
/// A candidate that stayed over so many orders is no accident …
const LONG_CHAIN: usize = 6;
/// … one that stayed over so many in a few FRFs comes in unasked: the modes above the strongest are so small there, and so many, that
/// while they are missing a pole anywhere explains as much as one of them …
const CERTAIN_CHAIN: usize = 20;
/// … the others are tried for this part of what others must explain: while close neighbours are missing, poles anywhere explain
/// much too.
const FIRM: f64 = 0.4;
/// A batch holds what explains at least this share of its best …
const BATCH: f64 = 0.25;
/// … and is not within so many half-widths of something better.
const APART_WIDTHS: f64 = 1.5;
/// FRFs that the choice is made on, at most.
pub(crate) const ENOUGH_FRFS: usize = 40;

/// Evenly spread FRFs, enough to choose on.
pub(crate) fn some(data: &[Data]) -> Vec<Data> {
    let count = data.len().min(ENOUGH_FRFS);
    (0..count).map(|k| data[k * data.len() / count].clone()).collect()
}

/// A pole that may be one of the structure's.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Start {
    pub pole: Pole,
    /// Orders over which it stayed.
    pub orders: usize,
}

/// The candidates to begin with, ascending in frequency.
pub(crate) fn choose(data: &[Data], candidates: &[Start]) -> Vec<Pole> {
    // The strongest come in, and what they leave is looked at, before the noise is taken from that: while strong modes are
    // missing, they would hide in it. Later it tells what the model cannot describe from what is missing.
    let mut data = data.to_vec();
    // Many FRFs hold what is no mode (drift, the floor's own) over as many orders, and do not need it.
    let few = data.len() < SET;
    let mut certain: Vec<bool> = candidates
        .iter()
        .map(|c| few && c.orders >= CERTAIN_CHAIN)
        .collect();
    let mut firm: Vec<bool> = candidates.iter().map(|c| c.orders >= LONG_CHAIN).collect();
    let mut left: Vec<Pole> = candidates.iter().map(|c| c.pole).collect();
    let mut taken: Vec<Pole> = Vec::new();
    let mut chosen: Vec<Pole> = Vec::new();
    for round in 0..MAX_ROUNDS {
        let even = set_noise::alike(&data);
        let Some(mut worth) = joint_fit::worth(&even, &chosen, &left) else {
            break;
        };
        for (worth, _) in worth.iter_mut().zip(&firm).filter(|(_, firm)| **firm) {
            *worth /= FIRM;
        }
        let wanted = if round < UNASKED { 0.0 } else { 1.0 };
        let batch = batch(&left, &worth, &certain, wanted);
        if batch.is_empty() {
            break;
        }
        chosen.extend(batch.iter().map(|&k| left[k]));
        taken.extend(batch.iter().map(|&k| left[k]));
        for k in batch.into_iter().rev() {
            left.remove(k);
            firm.remove(k);
            certain.remove(k);
        }
        chosen.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
        let Some(groups) = joint_fit::refine(&even, &chosen, PoleSearch::Roughly, &mut Vec::new()) else {
            break;
        };
        if round > 0 {
            set_noise::renew(&mut data, &groups);
        }
        chosen = groups
            .iter()
            .flat_map(|g| g.solution.poles.iter().copied())
            .collect();
        // While modes are missing a pole may leave its own to stand for two others: it begins again where it was found.
        let lost = |c: &&Pole| !chosen.iter().any(|p| near(p, c));
        let back: Vec<Pole> = taken.iter().filter(lost).copied().collect();
        if !back.is_empty() {
            chosen.retain(|p| taken.iter().any(|c| near(p, c)));
            chosen.extend(back);
        }
        chosen.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    }
    chosen
}

/// Within both half-widths of each other?
fn near(a: &Pole, b: &Pole) -> bool {
    let width = |p: &Pole| p.damping_ratio * p.frequency_hz;
    (a.frequency_hz - b.frequency_hz).abs() < width(a) + width(b)
}

/// Ascending indices of those that come in together: the best, and those that are `certain`.
fn batch(left: &[Pole], worth: &[f64], certain: &[bool], wanted: f64) -> Vec<usize> {
    let best = worth.iter().copied().fold(0.0, f64::max);
    let mut order: Vec<usize> = (0..left.len())
        .filter(|&k| worth[k] > 0.0 && (certain[k] || worth[k] > wanted && worth[k] >= BATCH * best))
        .collect();
    order.sort_by(|&a, &b| worth[b].total_cmp(&worth[a]));
    let width = |p: &Pole| p.damping_ratio * p.frequency_hz;
    let mut taken: Vec<usize> = Vec::new();
    for k in order {
        let apart = |&t: &usize| {
            let reach = APART_WIDTHS * (width(&left[t]) + width(&left[k]));
            (left[t].frequency_hz - left[k].frequency_hz).abs() > reach
        };
        if taken.iter().all(apart) {
            taken.push(k);
        }
    }
    taken.sort_unstable();
    taken
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stayed_over_many_orders_comes_in_however_little_it_explains_next_to_the_strongest() {
        let poles = [10.0, 10.05, 40.0, 80.0, 80.1].map(|frequency_hz| Pole {
            frequency_hz,
            damping_ratio: 0.01,
        });
        let worth = [1000.0, 900.0, 0.5, 0.4, 0.3];
        let certain = [false, false, false, true, true];
        // In one half-width of another the better one alone, whatever it is.
        assert_eq!(batch(&poles, &worth, &certain, 0.0), [0, 3]);
        assert_eq!(batch(&poles, &worth, &[false; 5], 0.0), [0]);
        assert_eq!(batch(&poles[2..], &worth[2..], &[false; 3], 1.0), [0; 0]);
        assert_eq!(batch(&poles[2..], &worth[2..], &certain[2..], 1.0), [1]);
    }
}
