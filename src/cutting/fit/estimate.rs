//! How coefficients are drawn from averages: least squares or Huber's robust regression, either with bounds; and how
//! far the answer would move had other cuts been made (bootstrap).

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::Result;
use crate::cutting::fit::conic::{ConicFit, Loss, conic_fit};
use crate::cutting::fit::regression::{
    CoefficientFit, Observation, WeightedSolution, fit, measurement_variance,
};
use crate::cutting::force_model::force_axis::ForceAxis;

/// What makes the residuals small.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum RegressionMethod {
    /// The sum of their squares.
    #[default]
    LeastSquares,
    /// Huber's loss: squares of small residuals, magnitudes of large ones.
    Huber,
}

/// How coefficients are wanted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct CfcOptions {
    /// Edge coefficients are held at zero or above.
    pub nonnegative_edges: bool,
    /// Huber's robust regression where there are cuts enough; else it is the second opinion.
    pub robust: bool,
}

/// Threshold of Huber's loss in standard deviations: 95 % as efficient as least squares where errors are normal.
pub const HUBER_THRESHOLD: f64 = 1.345;
/// β = E min(e², k²) of a standard normal e at that threshold, integrated numerically: it makes the robust scatter the
/// standard deviation where errors are normal.
const HUBER_CONSISTENCY: f64 = 0.710_164_5;

/// Coefficients by one method.
#[derive(Debug, Clone, PartialEq)]
pub struct CoefficientEstimate {
    /// The coefficients, in the order of the columns.
    pub value: Vec<f64>,
    /// `None` where a constraint holds the value.
    pub std_error: Vec<Option<f64>>,
    /// Held at zero.
    pub active: Vec<bool>,
    /// Variance weight of each observation, 1/(std error² + extra scatter²).
    pub weight: Vec<f64>,
    /// What Huber's loss left of each observation's weight, 0…1; 1 with least squares.
    pub share: Vec<f64>,
    /// Scatter of the averages beyond their own errors (standard deviation; N, N·m), by axis.
    pub extra_scatter: [f64; 4],
    /// False where the robust scatter did not settle.
    pub converged: bool,
}

/// `free` with `nonnegative` coefficients held at zero where they would be below. The free fit must determine all
/// coefficients.
///
/// # Errors
/// The conic program fails.
pub fn estimate(
    observations: &[Observation],
    free: &CoefficientFit,
    nonnegative: &[bool],
    method: RegressionMethod,
) -> Result<CoefficientEstimate> {
    match method {
        RegressionMethod::LeastSquares => least_squares(observations, free, nonnegative),
        RegressionMethod::Huber => huber(observations, free, nonnegative),
    }
}

fn least_squares(
    observations: &[Observation],
    free: &CoefficientFit,
    nonnegative: &[bool],
) -> Result<CoefficientEstimate> {
    let conic = at_weights(
        observations,
        &free.weight,
        &free.solution,
        nonnegative,
        RegressionMethod::LeastSquares,
    )?;
    let held = conic.active.contains(&true);
    let kept = without(observations, &conic.active);
    let errors = held.then(|| fit(&kept)).flatten().map(|f| f.covering(&kept));
    let errors = errors.as_ref().unwrap_or(free);
    Ok(CoefficientEstimate {
        std_error: spread_out(&errors.std_error, &conic.active),
        value: conic.value,
        active: conic.active,
        weight: errors.weight.clone(),
        share: vec![1.0; observations.len()],
        extra_scatter: errors.extra_scatter,
        converged: true,
    })
}

/// The minimum at given weights; the conic solver is asked only where the least squares solution is not the answer.
fn at_weights(
    observations: &[Observation],
    weight: &[f64],
    free: &[f64],
    nonnegative: &[bool],
    method: RegressionMethod,
) -> Result<ConicFit> {
    let violated = free.iter().zip(nonnegative).any(|(x, bound)| *bound && *x < 0.0);
    let loss = match method {
        RegressionMethod::LeastSquares if !violated => {
            return Ok(ConicFit {
                value: free.to_vec(),
                active: vec![false; free.len()],
            });
        }
        RegressionMethod::LeastSquares => Loss::Squares,
        RegressionMethod::Huber => Loss::Huber(HUBER_THRESHOLD),
    };
    conic_fit(observations, weight, free, nonnegative, loss)
}

/// Regression and scatter in turn: the scatter beyond the measurement errors is found per axis from
/// Σ min(e², k²) = β Σ (1 − leverage) (Huber, Robust Statistics, 1981, §7.7, "proposal 2"), so that a spoilt cut neither
/// pulls the coefficients nor hides behind the scatter that it makes itself. Standard errors: ibid. eq. 7.6.5.
fn huber(
    observations: &[Observation],
    free: &CoefficientFit,
    nonnegative: &[bool],
) -> Result<CoefficientEstimate> {
    let variance = measurement_variance(observations);
    let mut extra = free.extra_scatter.map(|e| e * e);
    let weights = |extra: &[f64; 4]| -> Vec<f64> {
        let total = observations.iter().zip(&variance);
        total.map(|(o, v)| 1.0 / (v + extra[o.axis.index()])).collect()
    };
    let mut converged = false;
    let mut conic = ConicFit {
        value: free.solution.clone(),
        active: vec![false; nonnegative.len()],
    };
    let mut residual = free.residual.clone();
    for _ in 0..100 {
        let solved = at_weights(
            observations,
            &weights(&extra),
            &free.solution,
            nonnegative,
            RegressionMethod::Huber,
        )?;
        conic = solved;
        residual = residuals(observations, &conic.value);
        let mut change = 0.0f64;
        for axis in ForceAxis::ALL {
            let a = axis.index();
            let on_axis: Vec<(f64, f64)> = (0..observations.len())
                .filter(|&i| observations[i].axis == axis)
                .map(|i| (residual[i].powi(2), variance[i]))
                .collect();
            // As in the ordinary fit: a fraction of a degree of freedom is no information.
            if free.dof[a] >= 0.5 {
                let next = robust_scatter(&on_axis, HUBER_CONSISTENCY * free.dof[a]);
                let size = next + extra[a];
                if size > 0.0 {
                    change = change.max((next - extra[a]).abs() / size);
                }
                extra[a] = next;
            }
        }
        if change < 1e-6 {
            converged = true;
            break;
        }
    }
    let weight = weights(&extra);
    let standardised: Vec<f64> = residual
        .iter()
        .zip(&weight)
        .map(|(r, w)| (r * w.sqrt()).abs())
        .collect();
    let kept = without(observations, &conic.active);
    let unknowns = kept.first().map_or(0, |o| o.row.len());
    let covariance = WeightedSolution::new(&kept, unknowns, &variance, &extra).covariance;
    let (m, p) = (observations.len() as f64, unknowns as f64);
    let inside = standardised.iter().filter(|e| **e <= HUBER_THRESHOLD).count() as f64 / m;
    let psi2: f64 = standardised.iter().map(|e| e.min(HUBER_THRESHOLD).powi(2)).sum();
    // Residuals smaller than the measurement errors allow are luck, not knowledge.
    let psi2 = (psi2 / (m - p).max(1.0)).max(HUBER_CONSISTENCY);
    let correction = 1.0 + p / m * (1.0 - inside) / inside.max(0.1);
    let widening = correction * psi2.sqrt() / inside.max(0.1);
    let errors: Vec<Option<f64>> = (0..unknowns)
        .map(|j| Some(widening * covariance[(j, j)].sqrt()))
        .collect();
    Ok(CoefficientEstimate {
        std_error: spread_out(&errors, &conic.active),
        value: conic.value,
        active: conic.active,
        weight,
        share: standardised
            .iter()
            .map(|e| {
                if *e > HUBER_THRESHOLD {
                    HUBER_THRESHOLD / e
                } else {
                    1.0
                }
            })
            .collect(),
        extra_scatter: extra.map(f64::sqrt),
        converged,
    })
}

/// τ² with Σ min(r²/(v + τ²), k²) = `target`, over pairs (r², v); 0 where the measurement errors suffice.
fn robust_scatter(squares: &[(f64, f64)], target: f64) -> f64 {
    let bounded = |tau2: f64| -> f64 {
        let each = squares.iter().map(|(r2, v)| r2 / (v + tau2));
        each.map(|e2| e2.min(HUBER_THRESHOLD.powi(2))).sum()
    };
    let (mut low, mut high) = (0.0, squares.iter().map(|s| s.0).sum::<f64>() / target);
    if bounded(low) <= target {
        return 0.0;
    }
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if bounded(middle) > target {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

fn residuals(observations: &[Observation], value: &[f64]) -> Vec<f64> {
    let fitted = |o: &Observation| o.row.iter().zip(value).map(|(r, x)| r * x).sum::<f64>();
    observations.iter().map(|o| o.value - fitted(o)).collect()
}

/// The model without the coefficients that are held at zero.
fn without(observations: &[Observation], held: &[bool]) -> Vec<Observation> {
    let row = |o: &Observation| {
        let kept = o.row.iter().zip(held).filter(|(_, held)| !**held);
        kept.map(|(r, _)| *r).collect()
    };
    observations
        .iter()
        .map(|o| Observation {
            row: row(o),
            ..o.clone()
        })
        .collect()
}

/// Errors of the kept coefficients in their places.
fn spread_out(kept: &[Option<f64>], held: &[bool]) -> Vec<Option<f64>> {
    let mut next = kept.iter().copied();
    held.iter()
        .map(|held| if *held { None } else { next.next().flatten() })
        .collect()
}

/// Draws of the bootstrap.
pub const BOOTSTRAP_DRAWS: usize = 500;
/// With fewer cuts, draws repeat the same few sets and say nothing.
pub const BOOTSTRAP_CUTS: usize = 5;
const BOOTSTRAP_SEED: u64 = 20_260;

/// Standard errors by drawing the cuts again with replacement (Efron & Tibshirani, An Introduction to the Bootstrap,
/// 1993, §9.5, "bootstrapping pairs", all axes of a cut together), the weights as `estimate` left them: half the width
/// between the 15.87 and 84.13 % quantiles over the draws, which a few draws of nearly equal feeds cannot blow up.
/// Seeded, the same for any number of threads. `None` with fewer than [`BOOTSTRAP_CUTS`] cuts, or where one draw in five
/// leaves a coefficient undetermined.
pub fn bootstrap(
    observations: &[Observation],
    estimate: &CoefficientEstimate,
    nonnegative: &[bool],
    method: RegressionMethod,
) -> Option<Vec<f64>> {
    let mut cuts: Vec<usize> = observations.iter().map(|o| o.cut).collect();
    cuts.sort_unstable();
    cuts.dedup();
    if cuts.len() < BOOTSTRAP_CUTS {
        return None;
    }
    let draw = |number: usize| -> Option<Vec<f64>> {
        let mut random = ChaCha8Rng::seed_from_u64(BOOTSTRAP_SEED);
        random.set_stream(number as u64);
        let (mut drawn, mut weight) = (Vec::new(), Vec::new());
        for _ in 0..cuts.len() {
            let cut = cuts[random.random_range(0..cuts.len())];
            for (o, w) in observations
                .iter()
                .zip(&estimate.weight)
                .filter(|(o, _)| o.cut == cut)
            {
                drawn.push(o.clone());
                weight.push(*w);
            }
        }
        let variance: Vec<f64> = weight.iter().map(|w| 1.0 / w).collect();
        let solved = WeightedSolution::new(&drawn, nonnegative.len(), &variance, &[0.0; 4]);
        if !solved.null.is_empty() {
            return None;
        }
        let conic = at_weights(&drawn, &weight, &solved.solution, nonnegative, method).ok()?;
        Some(conic.value)
    };
    let draws: Vec<Vec<f64>> = (0..BOOTSTRAP_DRAWS).into_par_iter().filter_map(draw).collect();
    if draws.len() < BOOTSTRAP_DRAWS * 4 / 5 {
        return None;
    }
    let half_width = |j: usize| {
        let mut values: Vec<f64> = draws.iter().map(|d| d[j]).collect();
        values.sort_by(f64::total_cmp);
        let at = |part: f64| values[(part * (values.len() - 1) as f64).round() as usize];
        0.5 * (at(0.8413) - at(0.1587))
    };
    Some((0..nonnegative.len()).map(half_width).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// y = 1000 x + 20 over `n` cuts of four feeds, with the scatter that is given; the cuts' own errors are unknown.
    fn line(n: usize, scatter: impl Fn(usize) -> f64) -> Vec<Observation> {
        (0..n)
            .map(|cut| {
                let x = 0.05 * (1 + cut % 4) as f64;
                Observation {
                    cut,
                    axis: ForceAxis::Z,
                    row: vec![x, 1.0],
                    value: 1000.0 * x + 20.0 + scatter(cut),
                    std_error: 0.0,
                }
            })
            .collect()
    }

    fn normal(seed: u64, n: usize) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut one = || crate::statistics::nearly_normal(&mut random);
        (0..n).map(|_| one()).collect()
    }

    fn of(observations: &[Observation], method: RegressionMethod) -> CoefficientEstimate {
        let free = fit(observations).unwrap();
        estimate(observations, &free, &[false, false], method).unwrap()
    }

    #[test]
    fn with_normal_errors_huber_is_nearly_least_squares() {
        let e = normal(3, 400);
        let all = line(400, |i| 2.0 * e[i]);
        let (ordinary, robust) = (
            of(&all, RegressionMethod::LeastSquares),
            of(&all, RegressionMethod::Huber),
        );
        assert!(robust.converged);
        // The scatter that was put in, by both; 400 values know it to 3.5 %.
        assert_relative_eq!(ordinary.extra_scatter[2], 2.0, max_relative = 0.1);
        assert_relative_eq!(robust.extra_scatter[2], 2.0, max_relative = 0.1);
        for j in 0..2 {
            let (a, b) = (ordinary.std_error[j].unwrap(), robust.std_error[j].unwrap());
            // 95 % efficiency: errors 1/√0.95 = 1.026 times as large, up to the scatter of the scale.
            assert!((0.95..1.12).contains(&(b / a)), "{a} {b}");
            assert!((ordinary.value[j] - robust.value[j]).abs() < a);
        }
    }

    #[test]
    fn a_spoilt_cut_does_not_pull_the_robust_answer() {
        let e = normal(5, 12);
        let all = line(12, |i| 0.3 * e[i] + if i == 3 { 60.0 } else { 0.0 });
        let (ordinary, robust) = (
            of(&all, RegressionMethod::LeastSquares),
            of(&all, RegressionMethod::Huber),
        );
        assert!((ordinary.value[0] - 1000.0).abs() > 80.0, "{ordinary:?}");
        assert!((robust.value[0] - 1000.0).abs() < 10.0, "{robust:?}");
        assert!(
            robust.share[3] < 0.05 && robust.share[2] > 0.5,
            "{:?}",
            robust.share
        );
        assert!(robust.std_error[0].unwrap() < 0.2 * ordinary.std_error[0].unwrap());
        let off = (robust.value[0] - 1000.0).abs() / robust.std_error[0].unwrap();
        assert!(off < 4.0, "{off}");
    }

    #[test]
    fn robust_and_bounded_go_together() {
        let e = normal(7, 12);
        let all = line(12, |i| 0.3 * e[i] - 25.0 + if i == 3 { 60.0 } else { 0.0 });
        let free = fit(&all).unwrap();
        let bounded = estimate(&all, &free, &[false, true], RegressionMethod::Huber).unwrap();
        assert_eq!(bounded.active, [false, true]);
        assert_eq!((bounded.value[1], bounded.std_error[1]), (0.0, None));
        // 1000 x − 5 through zero over these feeds: 1000 − 5 Σx/Σx².
        let slope = 1000.0 - 5.0 * 0.125 / 0.01875;
        assert!((bounded.value[0] - slope).abs() < 15.0, "{bounded:?}");
    }

    #[test]
    fn the_bootstrap_of_a_mean_is_the_textbooks() {
        let e = normal(11, 40);
        let mut all = line(40, |i| e[i]);
        for (o, e) in all.iter_mut().zip(&e) {
            o.row = vec![1.0];
            o.value = 7.0 + e;
        }
        let free = fit(&all).unwrap();
        let one = estimate(&all, &free, &[false], RegressionMethod::LeastSquares).unwrap();
        let drawn = bootstrap(&all, &one, &[false], RegressionMethod::LeastSquares).unwrap();
        let mean = e.iter().sum::<f64>() / 40.0;
        let exact = (e.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / 40.0 / 40.0).sqrt();
        // 500 draws know a standard deviation to 3 %, by quantiles to 5.
        assert_relative_eq!(drawn[0], exact, max_relative = 0.15);
        let again = bootstrap(&all, &one, &[false], RegressionMethod::LeastSquares).unwrap();
        assert_eq!(drawn, again);
        assert_eq!(
            bootstrap(&all[..4], &one, &[false], RegressionMethod::LeastSquares),
            None
        );
    }
}
