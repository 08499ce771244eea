//! From candidates to the poles that the FRFs need, and the noise that they leave.

use crate::modal::max_likelihood::joint_fit::{self, Change, Data, Doubt, Group, PoleSearch};
use crate::modal::single::local_fit::Pole;
use crate::modal::together::select::{self, Start};
use crate::modal::together::set_noise;

/// Refinement with search, noise from the rest, refinement without search.
pub(crate) fn solve(
    data: &mut [Data],
    candidates: &[Start],
    changes: &mut Vec<Change>,
) -> Option<Vec<Group>> {
    let start = select::choose(&select::some(data), candidates);
    let mut groups = joint_fit::refine(&set_noise::alike(data), &start, PoleSearch::Roughly, changes)?;
    let many = data.len() > select::ENOUGH_FRFS;
    // What is many fits with noises alike is few with those that each FRF has.
    for (search, alike) in [
        (PoleSearch::Pairs, true),
        (PoleSearch::Pairs, false),
        (PoleSearch::Nothing, false),
    ] {
        // Many FRFs tell as much, whatever each one's noise is.
        if search == PoleSearch::Pairs && !alike && many {
            continue;
        }
        set_noise::renew(data, &groups);
        let poles = poles_of(&groups);
        let mut doubts: Vec<Option<Doubt>> = groups.into_iter().map(|g| g.doubt).collect();
        groups = match (search, alike) {
            // A part of many FRFs tells which poles there are, and all of them where these are.
            (PoleSearch::Pairs, true) if many => {
                let mut some =
                    joint_fit::refine(&set_noise::alike(&select::some(data)), &poles, search, changes)?;
                let found = poles_of(&some);
                let mut all =
                    joint_fit::refine(&set_noise::alike(data), &found, PoleSearch::Roughly, changes)?;
                take_doubts(&mut all, some.iter_mut().map(|g| g.doubt.take()));
                all
            }
            (_, true) => joint_fit::refine(&set_noise::alike(data), &poles, search, changes)?,
            (_, false) => joint_fit::refine(data, &poles, search, changes)?,
        };
        if search == PoleSearch::Nothing {
            take_doubts(&mut groups, doubts.drain(..));
        }
    }
    Some(groups)
}

/// Ascending in frequency.
fn poles_of(groups: &[Group]) -> Vec<Pole> {
    let mut poles: Vec<Pole> = groups
        .iter()
        .flat_map(|g| g.solution.poles.iter().copied())
        .collect();
    poles.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    poles
}

/// The doubts of a fit of the same poles in the same groups.
fn take_doubts(groups: &mut [Group], doubts: impl ExactSizeIterator<Item = Option<Doubt>>) {
    if doubts.len() != groups.len() {
        return;
    }
    for (group, doubt) in groups.iter_mut().zip(doubts) {
        let same = |d: &Doubt| d.shifts.len() == group.solution.poles.len();
        group.doubt = doubt.filter(same);
    }
}
