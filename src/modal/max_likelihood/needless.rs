//! Which poles of a fit the FRFs do not need.

use crate::modal::max_likelihood::joint_fit::{Change, PoleGroup};
use crate::modal::max_likelihood::ml_fit::Solution;
use crate::modal::single::local_fit::Pole;

/// What explains so many times what a mode must is needed, however badly it is determined.
const INDISPENSABLE: f64 = 10.0;
/// A pole whose evidence is beyond this times what a mode must explain is needed, whatever the others could take over.
const BEYOND_DOUBT: f64 = 4.0;

/// What speaks for a pole of a fit.
struct Evidence {
    pole: Pole,
    /// See [`PoleGroup::possible`].
    possible: bool,
    /// And determined.
    sane: bool,
    /// Growth of the misfit without it, the other poles held.
    evidence: f64,
    /// What it must explain.
    wanted: f64,
}

impl Evidence {
    /// Why it goes out.
    fn change(&self) -> Change {
        match self.sane {
            true => Change::Needless(self.pole),
            false => Change::NotDetermined(self.pole),
        }
    }
}

impl PoleGroup<'_> {
    /// Takes out the least needed pole until all are needed.
    pub(super) fn without_needless(&self, mut solution: Solution, changes: &mut Vec<Change>) -> Solution {
        while let Some((needless, without)) = self.needless(&solution) {
            changes.push(needless);
            solution = without;
        }
        solution
    }

    /// The pole that is needed least, if it is not needed, and the fit without it.
    fn needless(&self, solution: &Solution) -> Option<(Change, Solution)> {
        let poles = solution.poles.iter().enumerate().map(|(j, &pole)| {
            let possible = self.possible(pole);
            Evidence {
                pole,
                possible,
                sane: possible && self.determined(solution, j),
                evidence: (0..self.frfs.len()).map(|m| solution.evidence(m, j)).sum(),
                wanted: self.wanted_of(solution, pole),
            }
        });
        let poles: Vec<Evidence> = poles.collect();
        let without = |j: usize| {
            let mut rest = solution.poles.clone();
            rest.remove(j);
            self.fit(&rest)
        };
        // With the other poles held the growth is an upper bound of the true one: what is needless by that is so without a
        // fit, and one fit is enough to take out the least of them.
        let certainly = (0..poles.len())
            .filter(|&j| poles[j].evidence < poles[j].wanted)
            .min_by(|&a, &b| {
                let key = |j: usize| (poles[j].sane, poles[j].evidence);
                let ((a_sane, a), (b_sane, b)) = (key(a), key(b));
                a_sane.cmp(&b_sane).then(a.total_cmp(&b))
            });
        if let Some(j) = certainly
            && let Some(without) = without(j)
        {
            return Some((poles[j].change(), without));
        }
        let mut least: Option<(f64, usize, Solution)> = None;
        for (j, of_pole) in poles.iter().enumerate() {
            let wanted = of_pole.wanted;
            if of_pole.sane && of_pole.evidence > BEYOND_DOUBT * wanted {
                continue;
            }
            let Some(without) = without(j) else { continue };
            // Where the model fits badly nothing is well determined: a pole that explains that much stays all the same.
            let grown = without.misfit - solution.misfit;
            let may_stay = of_pole.possible && (of_pole.sane || grown > INDISPENSABLE * wanted);
            let growth = if may_stay { grown } else { f64::NEG_INFINITY };
            if growth < wanted && least.as_ref().is_none_or(|(g, ..)| growth < *g) {
                least = Some((growth, j, without));
            }
        }
        least.map(|(_, j, without)| (poles[j].change(), without))
    }
}
