//! Cuts one after the other, and what is another from one of them on.

use rayon::prelude::*;

use crate::identify::CuttingData;

/// Cuts before and after a switch, at least.
const BEFORE: usize = 3;
const AFTER: usize = 2;
/// Places in a sequence at which a switch is looked for first.
const STEPS: usize = 24;

/// The cuts as they are listed, and as they were made where that is another order.
pub(super) fn sequences(data: &CuttingData) -> Vec<Vec<usize>> {
    let listed: Vec<usize> = (0..data.cuts.len()).collect();
    let mut made = listed.clone();
    made.sort_by_key(|&i| (data.cuts[i].order, i));
    match made == listed {
        true => vec![listed],
        false => vec![listed, made],
    }
}

/// Where something changes within a `sequence`, looked for in steps, then one by one: the place from which on it is another, and what
/// `at` makes of the cuts before and after the place that leaves least (its second value).
pub(super) fn switch<T: Send>(
    sequence: &[usize],
    at: impl Fn(&[usize], &[usize]) -> Option<(T, f64)> + Sync,
) -> Option<(usize, T)> {
    let last = sequence.len().checked_sub(AFTER)?;
    let step = sequence.len().div_ceil(STEPS);
    let best = |places: Vec<usize>| {
        places
            .into_par_iter()
            .filter_map(|place| {
                let (before, after) = sequence.split_at_checked(place)?;
                Some((place, at(before, after)?))
            })
            .min_by(|a, b| a.1.1.total_cmp(&b.1.1))
    };
    let coarse = best((BEFORE..=last).step_by(step).collect())?;
    let place = coarse.0;
    let beside = (place + 1).saturating_sub(step).max(BEFORE)..=(place + step - 1).min(last);
    let fine = best(beside.filter(|other| *other != place).collect());
    let (place, (found, _)) = fine.filter(|fine| fine.1.1 < coarse.1.1).unwrap_or(coarse);
    Some((place, found))
}
