//! Tunes the structural model to measured FRFs: maximum a posteriori, staged so that no peak is trapped beside the
//! one it belongs to, repeated from other starting points where the fit is not as good as the noise allows.

use nalgebra::DMatrix;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;

use super::frf_data::FrfData;
use super::levenberg_marquardt::{Fit, Stopping, minimise};
use super::structure::{FrfProblem, Misfit, StructureModel};
use crate::effects::Size;
use crate::parameter::Parameter;
use crate::progress::Progress;
use crate::{Error, Result};

/// One fitted parameter in natural units.
#[derive(Debug, Clone, Serialize)]
pub struct Estimate {
    pub name: String,
    pub value: f64,
    pub unit: &'static str,
    pub std_error: f64,
    pub initial: f64,
    /// True where the estimate stopped at the end of its allowed range.
    pub at_bound: bool,
}

impl Estimate {
    pub fn size(&self) -> Size {
        Size {
            value: self.value,
            std: self.std_error,
        }
    }
}

/// How to calibrate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Further starting points, tried where the first fit leaves more than noise.
    pub extra_starts: usize,
    /// Seed of those starting points.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            extra_starts: 6,
            seed: 1,
        }
    }
}

/// A calibrated model.
#[derive(Debug, Clone)]
pub struct Calibration {
    pub parameters: Vec<Estimate>,
    /// On the solver's scale.
    pub theta: Vec<f64>,
    /// Covariance on the solver's scale, scaled up where the misfit exceeds the noise.
    pub covariance: DMatrix<f64>,
    /// Weighted misfit per real residual: 1 where only noise is left.
    pub reduced_chi2: f64,
    pub iterations: usize,
    pub converged: bool,
    /// Starting points tried.
    pub starts: usize,
    /// How many of them came to the answer given here (within 0.1 % of its misfit).
    pub starts_agreeing: usize,
}

impl Calibration {
    /// What the user should know of the fit before believing it.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if !self.converged {
            warnings.push("the fit did not converge: treat the parameters with care".to_string());
        }
        for p in self.parameters.iter().filter(|p| p.at_bound) {
            warnings.push(format!(
                "{} stopped at the end of its range ({:.4e} {}): the model or the robot file is wrong there",
                p.name, p.value, p.unit
            ));
        }
        if self.reduced_chi2 > FAR_ABOVE_NOISE {
            warnings.push(format!(
                "the calibrated model leaves {:.1} times the variance of the noise: physics is missing, or a file is not \
                 what campaign.toml says (units, quantity, posture, node); standard errors are widened accordingly",
                self.reduced_chi2
            ));
        }
        if self.starts > 1 && self.starts_agreeing < 2 && self.reduced_chi2 > SUSPICIOUS_CHI2 {
            warnings.push(format!(
                "only one of {} starting points led to this fit: there may be a better one (try --starts 20)",
                self.starts
            ));
        }
        warnings
    }
}

/// Misfit from which on the user is told.
const FAR_ABOVE_NOISE: f64 = 1.5;
/// Misfit above which noise alone is not credible any more and further starting points are tried.
const SUSPICIOUS_CHI2: f64 = 1.15;
/// Lines used to get near the answer: every how many.
const COARSE_STRIDE: usize = 4;

/// When to stop on few lines.
const ROUGH: Stopping = Stopping {
    max_iterations: 40,
    relative_decrease: 1e-4,
};
/// Iterations of a look at a further starting point.
const LOOK_ITERATIONS: usize = 10;
/// Times the lowest misfit from which on a starting point is given up after the look.
const HOPELESS: f64 = 1.5;

/// On few lines from a point that is in the right basin already: log magnitudes could only lead out of it.
fn resume(model: &StructureModel, data: &FrfData, start: &[f64]) -> Result<(Fit, usize)> {
    let complex = FrfProblem {
        model,
        data,
        misfit: Misfit::Complex,
        stride: coarse_stride(data),
    };
    let fit = minimise(&complex, start, &model.bounds(), ROUGH)?;
    let iterations = fit.iterations;
    Ok((fit, iterations))
}

/// Log magnitude first, then the complex values on few lines: gets into the right basin.
fn approach(model: &StructureModel, data: &FrfData, start: &[f64], rough: Stopping) -> Result<(Fit, usize)> {
    let bounds = model.bounds();
    let stride = coarse_stride(data);
    let log = FrfProblem {
        model,
        data,
        misfit: Misfit::LogMagnitude,
        stride,
    };
    let near = minimise(&log, start, &bounds, rough)?;
    let complex = FrfProblem {
        model,
        data,
        misfit: Misfit::Complex,
        stride,
    };
    let fit = minimise(&complex, &near.theta, &bounds, rough)?;
    let iterations = near.iterations + fit.iterations;
    Ok((fit, iterations))
}

fn coarse_stride(data: &FrfData) -> usize {
    let lines = data
        .blocks
        .iter()
        .map(|b| b.frequency_hz.len())
        .min()
        .unwrap_or(0);
    // Thinned measurements are left alone: a resonance needs its few lines.
    if lines >= 200 { COARSE_STRIDE } else { 1 }
}

/// Refines from a point that is already in the right basin, on all lines.
pub fn refine(model: &StructureModel, data: &FrfData, start: &[f64]) -> Result<Fit> {
    let problem = FrfProblem {
        model,
        data,
        misfit: Misfit::Complex,
        stride: 1,
    };
    minimise(&problem, start, &model.bounds(), Stopping::default())
}

/// Calibrates `model` to `data`, from the solution that the model brings along where it has one, else from its nominal
/// values and from `measured` (such as [`super::modal_start`] gives), whichever leads further down.
pub fn calibrate(
    model: &StructureModel,
    data: &FrfData,
    measured: Option<&[f64]>,
    options: Options,
) -> Result<Calibration> {
    let nominal = model.nominal_theta();
    let (mut first, mut iterations) = match model.start() {
        Some(start) => resume(model, data, start)?,
        None => approach(model, data, &nominal, ROUGH)?,
    };
    let (mut starts, mut agreeing) = (1, 1);
    // As with the further starting points below, one that leads nowhere is no reason to give up.
    if let (Some(start), None) = (measured, model.start())
        && let Ok((other, more)) = approach(model, data, start, ROUGH)
    {
        starts += 1;
        iterations += more;
        let alike = (other.cost / first.cost - 1.0).abs() < 1e-3;
        agreeing += usize::from(alike);
        if other.cost < first.cost {
            first = other;
        }
    }
    let mut best = refine(model, data, &first.theta)?;
    iterations += best.iterations;
    let residual_count = (2 * data.value_count()) as f64;
    let chi2 = |fit: &Fit| 2.0 * fit.cost / (residual_count - model.parameters.len() as f64).max(1.0);

    if chi2(&best) > SUSPICIOUS_CHI2 && options.extra_starts > 0 {
        let points = scattered_starts(&model.parameters, options.extra_starts, options.seed);
        let progress = Progress::new("calibrating from further starting points", points.len());
        let look = Stopping {
            max_iterations: LOOK_ITERATIONS,
            ..ROUGH
        };
        let looks: Vec<Fit> = points
            .par_iter()
            .filter_map(|start| {
                let fit = approach(model, data, start, look).ok().map(|(fit, _)| fit);
                progress.step();
                fit
            })
            .collect();
        // Starts that a look leaves far behind the others would only end beside the answer.
        let lowest = looks.iter().map(|f| f.cost).fold(first.cost, f64::min);
        let mut fits: Vec<Fit> = looks
            .par_iter()
            .filter(|look| look.cost < HOPELESS * lowest)
            .filter_map(|look| resume(model, data, &look.theta).ok().map(|(fit, _)| fit))
            .collect();
        starts += points.len();
        fits.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        // Costs of the coarse fits are comparable with each other and with the first one's.
        agreeing = 0;
        let winner = fits.first().filter(|fit| fit.cost < first.cost * (1.0 - 1e-3));
        if let Some(winner) = winner {
            let fine = refine(model, data, &winner.theta)?;
            iterations += fine.iterations;
            if fine.cost < best.cost {
                best = fine;
            }
        }
        let lowest = fits.iter().map(|f| f.cost).fold(first.cost, f64::min);
        agreeing += fits.iter().filter(|f| f.cost < lowest * 1.001).count();
        agreeing += usize::from(first.cost < lowest * 1.001);
    }

    let reduced_chi2 = chi2(&best);
    let covariance = covariance(&best, reduced_chi2)?;
    let parameters = estimates(&model.parameters, &best, reduced_chi2)?;
    Ok(Calibration {
        parameters,
        theta: best.theta,
        covariance,
        reduced_chi2,
        iterations,
        converged: best.converged,
        starts,
        starts_agreeing: agreeing,
    })
}

/// Covariance on the solver's scale, widened where the misfit exceeds the noise.
pub(super) fn covariance(fit: &Fit, reduced_chi2: f64) -> Result<DMatrix<f64>> {
    // Solved on unit diagonal: the parameters' information differs by many orders of magnitude.
    let n = fit.hessian.nrows();
    let scale: Vec<f64> = (0..n).map(|i| fit.hessian[(i, i)].sqrt()).collect();
    let scaled = DMatrix::from_fn(n, n, |i, j| fit.hessian[(i, j)] / (scale[i] * scale[j]));
    let inverse = scaled
        .cholesky()
        .ok_or_else(|| {
            Error::computation("the data do not determine the parameters (singular information matrix)")
        })?
        .inverse();
    Ok(DMatrix::from_fn(n, n, |i, j| {
        inverse[(i, j)] / (scale[i] * scale[j]) * reduced_chi2.max(1.0)
    }))
}

/// The fitted parameters in natural units with standard errors.
pub fn estimates(parameters: &[Parameter], fit: &Fit, reduced_chi2: f64) -> Result<Vec<Estimate>> {
    let covariance = covariance(fit, reduced_chi2)?;
    Ok(parameters
        .iter()
        .enumerate()
        .map(|(i, p)| Estimate {
            name: p.name.clone(),
            value: p.natural(fit.theta[i]),
            unit: p.unit,
            std_error: p.natural_std(fit.theta[i], covariance[(i, i)].sqrt()),
            initial: p.nominal,
            at_bound: fit.at_bound.contains(&i),
        })
        .collect())
}

/// Draws from the priors, twice as wide, within the bounds; on the solver's scale.
pub fn scattered_starts(parameters: &[Parameter], count: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (0..count)
        .map(|_| {
            let draw = |p: &Parameter| {
                // Uniform on ±√3·2σ has the standard deviation 2σ and no far tails.
                let half = p.prior.map_or(0.1, |prior| prior.std) * 2.0 * 3f64.sqrt();
                let [low, high] = p.internal_bounds();
                (p.internal(p.nominal) + half * random.random_range(-1.0..1.0)).clamp(low, high)
            };
            parameters.iter().map(draw).collect()
        })
        .collect()
}
