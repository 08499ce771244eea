//! Other optima of a calibration, and whether the data tell them from the one that was chosen.
//!
//! Where physics is missing, a model may explain this posture or that stretch of the frequency, with parameters far apart and about the
//! same misfit. Which of the two is lower is then a matter of a line more or less. Whether the data decide is told as between any two
//! models (Vuong, *Econometrica* 57, 1989): by the sum of the differences of χ² over parts of the data against the scatter of those
//! differences.

use std::collections::BTreeMap;

use nalgebra::DVector;

use super::frf_data::FrfData;
use super::frf_problem::FrfProblem;
use crate::Result;
use crate::identify::levenberg_marquardt::{Fit, Linearisation};

/// Times the lowest misfit up to which another optimum is looked at, …
const CLOSE: f64 = 1.15;
/// … and how many of them are.
const MOST: usize = 2;
/// Standard errors (of noise as large as what is left) from which on two points are no longer one optimum.
const APART: f64 = 5.0;
/// Standard errors of the sum of the differences within which the data do not decide.
const UNDECIDED: f64 = 2.0;
/// Stretches of the frequency of which each may err as a whole.
pub(super) const STRETCHES: usize = 12;

/// Whether `b` is another optimum than `a`, `reduced_chi2` being what that leaves.
fn apart(a: &Fit, b: &Fit, reduced_chi2: f64) -> bool {
    let way = DVector::from_iterator(a.theta.len(), a.theta.iter().zip(&b.theta).map(|(a, b)| a - b));
    let square = way.dot(&(&a.hessian * &way)) / reduced_chi2.max(1.0);
    // A way so long that the curvature at its beginning means nothing is one all the same.
    !(square < APART * APART)
}

/// Those of `found` (on few of the data, in any order) that stand apart from `best` and from each other and are close to it in misfit,
/// best first.
pub(super) fn close_to(best: &Fit, mut found: Vec<Fit>, reduced_chi2: f64) -> Vec<Fit> {
    found.retain(|fit| fit.cost < CLOSE * best.cost);
    found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let mut kept: Vec<Fit> = Vec::new();
    for fit in found {
        let is_new = std::iter::once(best)
            .chain(&kept)
            .all(|k| apart(k, &fit, reduced_chi2));
        if is_new && kept.len() < MOST {
            kept.push(fit);
        }
    }
    kept
}

/// The lowest of `best` and `others` on all data, and where those others stand there that are close to it. `refine`: a fit on all data
/// from a point.
pub(super) fn settled(
    data: &FrfData,
    mut best: Fit,
    others: &[Fit],
    refine: impl Fn(&[f64]) -> Result<Fit>,
) -> (Fit, Vec<Vec<f64>>) {
    let mut rest = Vec::new();
    for other in others {
        // As with further starting points, one that leads nowhere is no reason to give up.
        let Ok(mut fit) = refine(&other.theta) else {
            continue;
        };
        if fit.cost < best.cost {
            std::mem::swap(&mut fit, &mut best);
        }
        rest.push(fit);
    }
    let freedom = (2 * data.value_count()) as f64 - best.theta.len() as f64;
    let reduced_chi2 = 2.0 * best.cost / freedom.max(1.0);
    let rivals = close_to(&best, rest, reduced_chi2)
        .into_iter()
        .map(|fit| fit.theta);
    let rivals = rivals.collect();
    (best, rivals)
}

/// Those of the `rivals` that the data do not tell from a solution, `here` being what `problem` says of its blocks and stretches.
///
/// # Errors
/// A model that cannot be set up at one of them.
pub(super) fn undecided(
    rivals: &[Vec<f64>],
    problem: &FrfProblem<'_>,
    here: &[(usize, usize, Linearisation)],
) -> Result<Vec<Vec<f64>>> {
    let mut undecided = Vec::new();
    for rival in rivals {
        let there = problem.by_block_and_stretch(rival, STRETCHES)?;
        let differences: Vec<[f64; 3]> = here
            .iter()
            .zip(&there)
            .map(|((block, stretch, here), (.., there))| {
                let posture = problem.data.blocks[*block].posture;
                [posture as f64, *stretch as f64, there.cost - here.cost]
            })
            .collect();
        let total: f64 = differences.iter().map(|d| d[2]).sum();
        // What errs together is a posture or a stretch of the frequency: the larger scatter counts.
        let scatter = [0, 1].map(|by| scatter(&differences, by));
        if total < UNDECIDED * scatter[0].max(scatter[1]) {
            undecided.push(rival.clone());
        }
    }
    Ok(undecided)
}

/// Standard error of the sum of the differences (last column), those with the same number in column `by` taken together.
fn scatter(differences: &[[f64; 3]], by: usize) -> f64 {
    let mut groups: BTreeMap<u64, f64> = BTreeMap::new();
    for d in differences {
        *groups.entry(d[by] as u64).or_default() += d[2];
    }
    let count = groups.len() as f64;
    if count < 2.0 {
        return 0.0;
    }
    let mean = groups.values().sum::<f64>() / count;
    let squares: f64 = groups.values().map(|sum| (sum - mean).powi(2)).sum();
    (squares * count / (count - 1.0)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::levenberg_marquardt::Ending;
    use nalgebra::DMatrix;

    fn fit(theta: [f64; 2], cost: f64) -> Fit {
        Fit {
            theta: theta.to_vec(),
            cost,
            hessian: DMatrix::identity(2, 2) * 1e4,
            iterations: 1,
            ending: Ending::Converged,
            at_bound: Vec::new(),
        }
    }

    #[test]
    fn other_optima_are_far_away_and_close_in_misfit() {
        let best = fit([0.0, 0.0], 100.0);
        let found = vec![
            fit([0.01, 0.0], 100.1),
            fit([0.0, 0.9], 150.0),
            fit([0.5, 0.0], 110.0),
            fit([0.0, 0.7], 101.0),
            fit([0.0, 0.71], 102.0),
        ];
        let close = close_to(&best, found, 1.0);
        let costs: Vec<f64> = close.iter().map(|f| f.cost).collect();
        assert_eq!(costs, [101.0, 110.0]);
    }

    /// n equal differences have no scatter; of one that stands alone the sum is known to itself.
    #[test]
    fn scatter_is_that_of_groups() {
        let equal: Vec<[f64; 3]> = (0..6).map(|i| [f64::from(i), f64::from(i % 2), 2.0]).collect();
        assert_eq!([scatter(&equal, 0), scatter(&equal, 1)], [0.0, 0.0]);
        let one: Vec<[f64; 3]> = (0..4)
            .map(|i| [f64::from(i), 0.0, if i == 0 { 8.0 } else { 0.0 }])
            .collect();
        assert!((scatter(&one, 0) - 8.0).abs() < 1e-12, "{}", scatter(&one, 0));
        assert_eq!(scatter(&one, 1), 0.0);
    }
}
