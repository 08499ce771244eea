//! Channels that are called otherwise in some records than in the rest: plugs exchanged between two cuts, an export with its columns in
//! another order.

use std::sync::Arc;

use rayon::prelude::*;

use super::plausible::{IMPLAUSIBLE, fit, improbability};
use super::robust::RobustFit;
use super::sequence::{sequences, switch};
use crate::discrepancy::setup::finding::SetupFinding;
use crate::discrepancy::setup::readings::Turn;
use crate::identify::{CuttingData, CuttingModel, CuttingProblem};
use crate::text::listed;

const NAMES: [&str; 3] = ["Fx", "Fy", "Fz"];
/// Another order of the channels is tried further where it leaves this part of a cut's misfit: half of it is left of a channel that is
/// read rightly while another one stays wrong.
const BETTER: f64 = 0.5;

/// Another order (and sign) of the channels of some records.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct OtherAxes {
    /// By index into the data's.
    cuts: Vec<usize>,
    turn: Turn,
}

impl OtherAxes {
    /// The records with the channels under their true names.
    pub(super) fn undone(&self, data: &CuttingData) -> CuttingData {
        let mut own = data.clone();
        for &i in &self.cuts {
            let cut = Arc::make_mut(&mut own.cuts[i]);
            let mut recorded = cut.channels.clone();
            for (j, &to) in self.turn.to.iter().enumerate() {
                let mut channel = recorded[j].take();
                if let Some(channel) = &mut channel {
                    channel.scale(self.turn.sign[j]);
                }
                cut.channels[to] = channel;
            }
            let lines = cut.vibration.iter_mut().flat_map(|v| &mut v.lines);
            for (channel, ..) in lines.flat_map(|line| &mut line.channels) {
                *channel = self.turn.to.get(*channel).copied().unwrap_or(*channel);
            }
        }
        own
    }

    pub(super) fn finding(&self, data: &CuttingData) -> SetupFinding {
        let ids: Vec<String> = self.cuts.iter().map(|&i| data.cuts[i].id.clone()).collect();
        let entry = |j: usize| {
            let sign = if self.turn.sign[j] < 0.0 {
                " and sign = -1"
            } else {
                ""
            };
            let name = NAMES[self.turn.to[j]].to_lowercase();
            format!(
                "name = \"{name}\" with the `in_file` (or `column`) of what is called {} now{sign}",
                NAMES[j]
            )
        };
        let changed = (0..3).filter(|&j| self.turn.to[j] != j || self.turn.sign[j] < 0.0);
        let entries: Vec<String> = changed.map(entry).collect();
        SetupFinding::without_size(
            "axes",
            format!("cut {}: {}", listed(&ids), self.turn.words(NAMES, [true; 3])),
            0.0,
            format!(
                "Look which plug or column is which: read so, these records are as the others are. A [[channel]] for each (`cut`, {}) puts \
                 it right.",
                listed(&entries)
            ),
        )
    }
}

/// Every other order of the channels, with every sign. (Signs alone are another mistake.)
fn orders() -> Vec<Turn> {
    Turn::all()
        .into_iter()
        .filter(|turn| turn.to != Turn::NONE.to)
        .collect()
}

/// Orders to be tried: of the cuts that stand far off the `robust` fit, and from some cut on.
pub(super) fn other_axes(
    data: &CuttingData,
    robust: Option<&RobustFit>,
    far_off: &[usize],
) -> Vec<OtherAxes> {
    let has_all = |i: usize| data.cuts[i].channels[..3].iter().all(Option::is_some);
    if !(0..data.cuts.len()).all(has_all) {
        return Vec::new();
    }
    let mut found: Vec<OtherAxes> = Vec::new();
    if let Some(robust) = robust {
        found.extend(far_off.iter().filter_map(|&cut| of_single_cuts(robust, cut)));
    }
    found.extend(
        sequences(data)
            .iter()
            .filter_map(|sequence| switched(data, sequence)),
    );
    found.sort_by(|a, b| a.cuts.cmp(&b.cuts));
    found.dedup();
    found
}

/// χ² of the `i`-th cut at `theta`, read with `turn`.
fn misfit(data: &CuttingData, theta: &[f64], i: usize, turn: Turn) -> Option<f64> {
    let one = data.filtered(|own| own == i);
    let read = OtherAxes { cuts: vec![0], turn }.undone(&one);
    let model = CuttingModel::new(&read, true).ok()?;
    let problem = CuttingProblem {
        model: &model,
        data: &read,
    };
    Some(problem.fits(theta).ok()?.first()?.chi2)
}

/// The order that fits `cut` best, in all cuts that it fits better.
fn of_single_cuts(robust: &RobustFit, cut: usize) -> Option<OtherAxes> {
    let misfit = |i: usize, turn: Turn| misfit(&robust.even, &robust.theta, i, turn);
    let trials = orders()
        .into_par_iter()
        .filter_map(|turn| Some((turn, misfit(cut, turn)?)));
    let (turn, left) = trials.min_by(|a, b| a.1.total_cmp(&b.1))?;
    if left > BETTER * misfit(cut, Turn::NONE)? {
        return None;
    }
    let is_better = |i: &usize| {
        let both = misfit(*i, turn).zip(misfit(*i, Turn::NONE));
        both.is_some_and(|(left, now)| left < BETTER * now)
    };
    let cuts: Vec<usize> = (0..robust.even.cuts.len()).filter(is_better).collect();
    (2 * cuts.len() < robust.even.cuts.len()).then_some(OtherAxes { cuts, turn })
}

/// Another order from some cut of a sequence on, by the first and the last cut after that.
fn switched(data: &CuttingData, sequence: &[usize]) -> Option<OtherAxes> {
    let (at, turn) = switch(sequence, |before, after| switched_at(data, before, after))?;
    let (before, after) = sequence.split_at_checked(at)?;
    let sorted = |cuts: &[usize]| {
        let mut cuts = cuts.to_vec();
        cuts.sort_unstable();
        cuts
    };
    let later = OtherAxes {
        cuts: sorted(after),
        turn,
    };
    // Either part may be the wrong one: coefficients that no cut has tell.
    let earlier = OtherAxes {
        cuts: sorted(before),
        turn: inverse(turn),
    };
    let of = |one: &OtherAxes| Some(improbability(&fit(&one.undone(data))?));
    match of(&later).zip(of(&earlier)) {
        Some((later_is, earlier_is)) if earlier_is + IMPLAUSIBLE < later_is => Some(earlier),
        _ => Some(later),
    }
}

/// What brings back what `turn` has turned.
fn inverse(turn: Turn) -> Turn {
    let mut back = Turn::NONE;
    for (j, &to) in turn.to.iter().enumerate() {
        back.to[to] = j;
        back.sign[to] = turn.sign[j];
    }
    back
}

/// The best order after a place, and what part of their misfit it leaves the first and the last cut there.
fn switched_at(data: &CuttingData, before: &[usize], after: &[usize]) -> Option<(Turn, f64)> {
    let base = fit(&data.filtered(|i| before.contains(&i)))?;
    let looked_at = [*after.first()?, *after.last()?];
    let left = |turn: Turn| -> Option<f64> {
        let each: Option<Vec<f64>> = looked_at
            .iter()
            .map(|&i| misfit(data, &base.theta, i, turn))
            .collect();
        Some(each?.iter().sum())
    };
    let trials = orders().into_iter().filter_map(|turn| Some((turn, left(turn)?)));
    let (turn, least) = trials.min_by(|a, b| a.1.total_cmp(&b.1))?;
    (least < BETTER * left(Turn::NONE)?).then_some((turn, least))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discrepancy::setup::examine_cutting;
    use crate::identify::forces::made_cuts::ten_hard_cuts;

    #[test]
    fn turns_go_back() {
        for turn in Turn::all() {
            let back = inverse(turn);
            let there: [(usize, f64); 3] =
                std::array::from_fn(|i| (back.to[turn.to[i]], back.sign[turn.to[i]] * turn.sign[i]));
            assert_eq!(there, [(0, 1.0), (1, 1.0), (2, 1.0)], "{turn:?}");
        }
    }

    #[test]
    fn records_with_their_channels_in_another_order_are_named() {
        let made = ten_hard_cuts();
        assert_eq!(examine_cutting(&made, || None).unwrap().findings, []);
        let swapped = |a: usize, b: usize, sign: [f64; 3]| {
            let mut to = [0, 1, 2];
            to.swap(a, b);
            Turn { to, sign }
        };
        let all: [(&[usize], Turn, &str); 5] = [
            // A quarter of a turn, which looks like the other way of milling.
            (
                &[3],
                swapped(0, 1, [-1.0, 1.0, 1.0]),
                "cut cut-3: Fx is in truth −Fy, Fy is in truth Fx",
            ),
            (
                &[6],
                swapped(0, 1, [1.0; 3]),
                "cut cut-6: Fx is in truth Fy, Fy is in truth Fx",
            ),
            (
                &[2],
                swapped(0, 1, [1.0, -1.0, 1.0]),
                "cut cut-2: Fx is in truth Fy, Fy is in truth −Fx",
            ),
            (
                &[1, 4],
                swapped(1, 2, [1.0; 3]),
                "cut cut-1 and cut-4: Fy is in truth Fz, Fz is in truth Fy",
            ),
            (
                &[5, 6, 7, 8, 9],
                swapped(0, 2, [1.0; 3]),
                "cut cut-5, cut-6, cut-7, cut-8 and cut-9: Fx is in truth Fz, Fz is in truth Fx",
            ),
        ];
        for (cuts, turn, place) in all {
            let listed = OtherAxes {
                cuts: cuts.to_vec(),
                turn: inverse(turn),
            };
            // What is recorded now is what the truth turns back to.
            let findings = examine_cutting(&listed.undone(&made), || None).unwrap().findings;
            let found = findings.first().expect(place);
            assert_eq!(
                (found.kind, found.place.as_str()),
                ("axes", place),
                "{findings:?}"
            );
            assert!(found.confidence > 0.9, "{found:?}");
        }
    }
}
