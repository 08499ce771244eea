//! Refits a model that has been given a further effect, without being trapped by where the fit without it stood.

use rayon::prelude::*;

use super::frf_data::FrfData;
use super::levenberg_marquardt::{Fit, LeastSquares, Stopping, minimise};
use super::structure::{FrfProblem, Misfit, StructureModel};
use crate::Result;

/// Complex values a screening fit works on, about: enough to tell effects apart, few enough to try many starts.
const SCREENING_VALUES: usize = 5000;
/// Starts that get more than a look at their cost.
const SERIOUS_STARTS: usize = 2;

/// ½χ² per complex value from which on log magnitudes are fitted first.
const TRAP_MISFIT: f64 = 3.0;

/// Every how many lines screening fits use.
pub fn screening_stride(data: &FrfData) -> usize {
    (data.value_count() / SCREENING_VALUES).clamp(1, 6)
}

/// Fits `model` (its last effect is the new one) on every `stride`-th line. `bases`: points for the parameters in front
/// of the effect's; `effect_starts`: points for the effect's own (solver's scale).
pub fn screen(
    model: &StructureModel,
    data: &FrfData,
    stride: usize,
    bases: &[Vec<f64>],
    effect_starts: &[Vec<f64>],
) -> Result<Fit> {
    let bounds = model.bounds();
    let complex = FrfProblem {
        model,
        data,
        misfit: Misfit::Complex,
        stride,
    };
    let log = FrfProblem {
        model,
        data,
        misfit: Misfit::LogMagnitude,
        stride: 2 * stride,
    };
    let mut starts: Vec<(f64, f64, Vec<f64>)> = bases
        .iter()
        .flat_map(|base| {
            effect_starts
                .iter()
                .map(move |own| [base.as_slice(), own].concat())
        })
        .map(|start| {
            let cost = |p: &FrfProblem| p.cost(&start).unwrap_or(f64::INFINITY);
            (cost(&complex), cost(&log), start)
        })
        .collect();
    // The most promising by either measure: a start may have its peaks in the right places and still a large misfit.
    starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let direct: Vec<Vec<f64>> = starts.iter().take(SERIOUS_STARTS).map(|s| s.2.clone()).collect();
    let lowest = starts.first().map_or(f64::INFINITY, |s| s.0);
    starts.sort_by(|a, b| a.1.total_cmp(&b.1));
    // Peaks beside their places are a danger only where the misfit is far above noise.
    let values = data.value_count() as f64 / stride as f64;
    let staged = if lowest > TRAP_MISFIT * values {
        SERIOUS_STARTS
    } else {
        0
    };
    let look = Stopping {
        max_iterations: 6,
        relative_decrease: 1e-3,
    };
    let mut fits = Vec::new();
    let mut failure = None;
    let mut keep = |fit: Result<Fit>| match fit {
        Ok(fit) => fits.push(fit),
        Err(error) => failure = Some(error),
    };
    for start in &direct {
        keep(minimise(&complex, start, &bounds, look));
    }
    for (_, _, start) in starts.iter().take(staged) {
        let near = minimise(
            &log,
            start,
            &bounds,
            Stopping {
                max_iterations: 10,
                ..look
            },
        );
        keep(near.and_then(|near| minimise(&complex, &near.theta, &bounds, look)));
    }
    fits.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let settle = Stopping {
        max_iterations: 40,
        relative_decrease: 1e-6,
    };
    let mut best: Option<Fit> = None;
    // The runner-up goes to the end too where it is close: the leader of a short look need not win.
    let close = |fit: &&Fit| fit.cost < 1.5 * fits[0].cost;
    for fit in fits.iter().take(2).filter(close) {
        let settled = minimise(&complex, &fit.theta, &bounds, settle)?;
        if best.as_ref().is_none_or(|b| settled.cost < b.cost) {
            best = Some(settled);
        }
    }
    match (best, failure) {
        (Some(best), _) => Ok(best),
        (None, Some(error)) => Err(error),
        (None, None) => Err(crate::Error::computation("no starting point for the effect")),
    }
}

/// Sums behind held-out errors of one fit.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct HeldOut {
    /// Σ|model − measured|² and Σ|measured|² on postures left out of the fit.
    pub error: f64,
    pub signal: f64,
    /// Σ|model − measured|²/σ² there.
    pub chi2: f64,
}

impl HeldOut {
    pub fn nrms(&self) -> f64 {
        if self.signal > 0.0 {
            (self.error / self.signal).sqrt()
        } else {
            0.0
        }
    }
}

/// Leaves out one posture at a time, refits from `theta` on every `stride`-th line and predicts the posture left out.
/// `None` with fewer than two measured postures.
pub fn held_out(
    model: &StructureModel,
    data: &FrfData,
    theta: &[f64],
    stride: usize,
) -> Result<Option<HeldOut>> {
    let postures = data.measured_postures();
    if postures.len() < 2 {
        return Ok(None);
    }
    let folds: Vec<HeldOut> = postures
        .par_iter()
        .map(|&left_out| {
            let rest = data.filtered(|p| p != left_out);
            let problem = FrfProblem {
                model,
                data: &rest,
                misfit: Misfit::Complex,
                stride,
            };
            let stopping = Stopping {
                max_iterations: 30,
                relative_decrease: 1e-6,
            };
            let fit = minimise(&problem, theta, &model.bounds(), stopping)?;
            let own = data.filtered(|p| p == left_out);
            let predicted = model.predict(&fit.theta, &own)?;
            let mut sums = HeldOut::default();
            for ((_, frf), model) in own.frfs().zip(&predicted) {
                for ((h, m), std) in frf.receptance.iter().zip(model).zip(&frf.noise_std) {
                    let square = (m - h).norm_sqr();
                    sums.error += square;
                    sums.signal += h.norm_sqr();
                    sums.chi2 += square / (std * std);
                }
            }
            Ok(sums)
        })
        .collect::<Result<_>>()?;
    let mut total = HeldOut::default();
    for fold in folds {
        total.error += fold.error;
        total.signal += fold.signal;
        total.chi2 += fold.chi2;
    }
    Ok(Some(total))
}
