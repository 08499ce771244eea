//! Cuts that do not fit the others: each is predicted from the rest.

use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::cutting::fit::regression::{Observation, fit};
use crate::cutting::force_model::force_axis::ForceAxis;

/// A cut whose average on one axis the other cuts do not predict.
#[derive(Debug, Clone, PartialEq)]
pub struct CutMisfit {
    /// Index of the cut, as in its observations.
    pub cut: usize,
    /// The axis on which it fits worst.
    pub axis: ForceAxis,
    /// Average on that axis, N or N·m.
    pub measured: f64,
    /// From the fit to all other cuts.
    pub predicted: f64,
    /// All averages of the cut: axis, measured, predicted.
    pub averages: Vec<(ForceAxis, f64, f64)>,
}

impl CutMisfit {
    /// Two force axes whose averages are those predicted for each other, signs aside: swapped plugs.
    pub fn swapped(&self) -> Option<[ForceAxis; 2]> {
        let forces: Vec<_> = self.averages.iter().filter(|a| a.0 != ForceAxis::Mz).collect();
        let largest = forces.iter().map(|a| a.2.abs()).fold(0.0, f64::max);
        let is = |measured: f64, predicted: f64| (measured.abs() - predicted.abs()).abs() < ALIKE * largest;
        forces.iter().enumerate().find_map(|(i, a)| {
            let crossed = forces[i + 1..]
                .iter()
                .find(|b| is(a.1, b.2) && is(b.1, a.2) && !is(a.2, b.2));
            crossed.map(|b| [a.0, b.0])
        })
    }
}

/// Averages nearer than this part of the largest are alike.
const ALIKE: f64 = 0.08;

/// Chance, over all cuts and axes together, of calling a good cut a misfit.
const FALSE_ALARM: f64 = 0.01;
/// A deviation below this part of the axis' largest average is nobody's concern.
const SMALLEST: f64 = 0.03;
/// Degrees of freedom that the other cuts must have left on an axis to judge one.
const LEAST_DOF: f64 = 2.0 - 1e-9;

/// One average against the fit to all other cuts.
#[derive(Debug, Clone, PartialEq)]
struct Deleted {
    cut: usize,
    axis: ForceAxis,
    measured: f64,
    predicted: f64,
    /// (measured − predicted) over the standard error of that difference.
    studentized: f64,
    /// Of the fit without the cut.
    dof: f64,
}

/// Every average that the other cuts predict with two degrees of freedom or more on its axis (externally studentised
/// residual, Belsley, Kuh & Welsch, Regression Diagnostics, 1980, eq. 2.26, a whole cut left out at a time).
fn deleted(observations: &[Observation]) -> Vec<Deleted> {
    let mut cuts: Vec<usize> = observations.iter().map(|o| o.cut).collect();
    cuts.sort_unstable();
    cuts.dedup();
    let of_cut = |&cut: &usize| -> Vec<Deleted> {
        let (out, rest): (Vec<Observation>, Vec<Observation>) =
            observations.iter().cloned().partition(|o| o.cut == cut);
        let Some(others) = fit(&rest).filter(|f| f.inseparable.is_empty()) else {
            return Vec::new();
        };
        let one = |o: &Observation| {
            let a = o.axis.index();
            let predicted = others.predict(&o.row);
            let variance =
                o.std_error.powi(2) + others.extra_scatter[a].powi(2) + others.prediction_variance(&o.row);
            let studentized = (o.value - predicted) / variance.sqrt();
            (others.dof[a] >= LEAST_DOF && studentized.is_finite()).then_some(Deleted {
                cut,
                axis: o.axis,
                measured: o.value,
                predicted,
                studentized,
                dof: others.dof[a],
            })
        };
        out.iter().filter_map(one).collect()
    };
    cuts.par_iter().flat_map_iter(of_cut).collect()
}

/// Externally studentised residual of every average, in the order of `observations`; `None` where too few other cuts
/// remain to judge it.
pub fn studentized(observations: &[Observation]) -> Vec<Option<f64>> {
    let known = deleted(observations);
    observations
        .iter()
        .map(|o| {
            known
                .iter()
                .find(|d| d.cut == o.cut && d.axis == o.axis)
                .map(|d| d.studentized)
        })
        .collect()
}

/// Cuts that do not fit, worst first, each with its worst axis. One after the other is taken out, the least likely
/// first (Student's t, Bonferroni over all averages), up to a quarter of the cuts; all up to the last unlikely one count,
/// so that two spoilt cuts cannot hide each other (Rosner, Technometrics 25, 1983).
pub fn misfits(observations: &[Observation]) -> Vec<CutMisfit> {
    let mut cuts: Vec<usize> = observations.iter().map(|o| o.cut).collect();
    cuts.sort_unstable();
    cuts.dedup();
    let largest = |axis: ForceAxis| {
        let on_axis = observations.iter().filter(|o| o.axis == axis);
        on_axis.map(|o| o.value.abs()).fold(0.0, f64::max)
    };
    let mut rest = observations.to_vec();
    let (mut taken, mut last_unlikely) = (Vec::new(), 0);
    for _ in 0..(cuts.len() / 4).max(1) {
        let chance = |d: &Deleted| {
            let t = StudentsT::new(0.0, 1.0, d.dof).ok()?;
            Some(2.0 * t.cdf(-d.studentized.abs()))
        };
        let worst = deleted(&rest)
            .into_iter()
            .filter(|d| (d.measured - d.predicted).abs() > SMALLEST * largest(d.axis))
            .filter_map(|d| Some((chance(&d)?, d)))
            .min_by(|a, b| {
                a.0.total_cmp(&b.0)
                    .then(b.1.studentized.abs().total_cmp(&a.1.studentized.abs()))
            });
        let Some((chance, worst)) = worst else { break };
        let out: Vec<Observation> = rest.iter().filter(|o| o.cut == worst.cut).cloned().collect();
        rest.retain(|o| o.cut != worst.cut);
        let others = fit(&rest);
        let predicted = |o: &Observation| Some((o.axis, o.value, others.as_ref()?.predict(&o.row)));
        let averages = out.iter().filter_map(predicted).collect();
        taken.push((worst, averages));
        if chance * (rest.len() + 1) as f64 <= FALSE_ALARM {
            last_unlikely = taken.len();
        }
    }
    taken.truncate(last_unlikely);
    let misfit = |(d, averages): (Deleted, Vec<(ForceAxis, f64, f64)>)| CutMisfit {
        cut: d.cut,
        axis: d.axis,
        measured: d.measured,
        predicted: d.predicted,
        averages,
    };
    taken.into_iter().map(misfit).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(spoilt: Option<usize>) -> Vec<Observation> {
        (0..8)
            .map(|cut| {
                let x = 0.05 * (1 + cut % 4) as f64;
                // A fixed, harmless scatter.
                let scatter = [0.3, -0.2, 0.1, -0.4, 0.2, 0.05, -0.1, 0.25][cut];
                Observation {
                    cut,
                    axis: ForceAxis::Z,
                    row: vec![x, 1.0],
                    value: 1000.0 * x + 20.0 + scatter + if spoilt == Some(cut) { 30.0 } else { 0.0 },
                    std_error: 0.3,
                }
            })
            .collect()
    }

    #[test]
    fn the_spoilt_cut_is_named_and_the_good_ones_are_not() {
        assert_eq!(misfits(&series(None)), []);
        let found = misfits(&series(Some(5)));
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0].cut, 5);
        assert!((found[0].measured - found[0].predicted - 30.0).abs() < 1.0);
    }

    #[test]
    fn too_few_cuts_accuse_nobody() {
        assert_eq!(misfits(&series(Some(1))[..3]), []);
        assert_eq!(misfits(&[]), []);
    }

    #[test]
    fn two_spoilt_cuts_do_not_hide_each_other() {
        let mut all = series(Some(5));
        all[2].value += 28.0;
        let mut found: Vec<usize> = misfits(&all).iter().map(|m| m.cut).collect();
        found.sort_unstable();
        assert_eq!(found, [2, 5]);
    }

    /// With equal errors and all scatter estimated, the textbook's closed form (Belsley, Kuh & Welsch):
    /// t = e √((n − p − 1)/(SSE (1 − h) − e²)).
    #[test]
    fn studentised_residuals_are_the_textbooks() {
        let mut all = series(None);
        all.iter_mut().for_each(|o| o.std_error = 0.0);
        let free = fit(&all).unwrap();
        let sse: f64 = free.residual.iter().map(|e| e * e).sum();
        for ((got, e), h) in studentized(&all).iter().zip(&free.residual).zip(&free.leverage) {
            let want = e * (5.0 / (sse * (1.0 - h) - e * e)).sqrt();
            approx::assert_relative_eq!(got.unwrap(), want, max_relative = 1e-6);
        }
    }
}
