//! What the uncertainty of a model's parameters leaves open of its lobes: quantiles over draws.

use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;

use super::blocks::{AveragedCut, BlockSolver, Blocks};
use super::curve::SpeedLimit;
use crate::statistics::quantile;
use crate::{Error, Result};

/// The band's lower and upper quantile.
pub const QUANTILES: [f64; 2] = [0.05, 0.95];

/// Quantiles of the limit at each speed, mm; `None` where that share of the draws has no limit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LobeBand {
    /// The 5 % quantile at each speed, mm.
    pub lower_mm: Vec<Option<f64>>,
    /// The 95 % quantile at each speed, mm.
    pub upper_mm: Vec<Option<f64>>,
}

/// Normal draws about `mean` with a covariance, within bounds; the same for the same seed.
///
/// # Errors
/// A covariance that is not one.
pub fn draws(
    mean: &[f64],
    covariance: &DMatrix<f64>,
    bounds: &[[f64; 2]],
    count: usize,
    seed: u64,
) -> Result<Vec<Vec<f64>>> {
    let n = mean.len();
    // On unit diagonal: parameters differ by many orders of magnitude.
    let std: Vec<f64> = (0..n).map(|i| covariance[(i, i)].sqrt()).collect();
    let scaled = DMatrix::from_fn(n, n, |i, j| covariance[(i, j)] / (std[i] * std[j]));
    let lower = scaled
        .cholesky()
        .ok_or_else(|| Error::computation("lobes: the parameters' covariance is not positive definite"))?
        .l();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    // Box & Muller (1958).
    let mut normal = || -> f64 {
        let (u, v): (f64, f64) = (1.0 - random.random::<f64>(), random.random());
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    };
    Ok((0..count)
        .map(|_| {
            let z = DVector::from_fn(n, |_, _| normal());
            let step = &lower * z;
            (0..n)
                .map(|i| (mean[i] + std[i] * step[i]).clamp(bounds[i][0], bounds[i][1]))
                .collect()
        })
        .collect())
}

/// A cut on each of the structures, one a draw.
pub fn solvers<'a>(cut: &AveragedCut, structures: &'a [Blocks]) -> Vec<BlockSolver<'a>> {
    structures.par_iter().map(|blocks| cut.on(blocks)).collect()
}

/// The band over the speeds, one solver a draw.
pub fn band(solvers: &[BlockSolver<'_>], spindle_rpm: &[f64]) -> LobeBand {
    let limits: Vec<Vec<f64>> = solvers
        .par_iter()
        .map(|solver| {
            spindle_rpm
                .iter()
                .map(|n| solver.limit_at(*n).map_or(f64::INFINITY, |l| l.depth_mm))
                .collect()
        })
        .collect();
    let [lower_mm, upper_mm] = QUANTILES.map(|share| {
        (0..spindle_rpm.len())
            .map(|i| quantile(limits.iter().map(|l| l[i]), share))
            .collect()
    });
    LobeBand { lower_mm, upper_mm }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lobes::dynamics::frf::{AxisMode, ModalFrf};
    use crate::lobes::{RegenerativeForce, StabilitySolver};

    #[test]
    fn draws_have_the_covariance_asked_for() {
        let covariance = DMatrix::from_row_slice(2, 2, &[4e-6, 1e-3, 1e-3, 1.0]);
        let free = [[f64::NEG_INFINITY, f64::INFINITY]; 2];
        let drawn = draws(&[1.0, -3.0], &covariance, &free, 20_000, 1).unwrap();
        let mean = |f: &dyn Fn(&[f64]) -> f64| drawn.iter().map(|d| f(d)).sum::<f64>() / drawn.len() as f64;
        let (a, b) = (mean(&|d| d[0]), mean(&|d| d[1]));
        assert!((a - 1.0).abs() < 1e-4 && (b + 3.0).abs() < 0.03, "{a} {b}");
        let cov = [
            mean(&|d| (d[0] - a).powi(2)) / 4e-6,
            mean(&|d| (d[1] - b).powi(2)),
            mean(&|d| (d[0] - a) * (d[1] - b)) / 1e-3,
        ];
        assert!(cov.iter().all(|c| (c - 1.0).abs() < 0.05), "{cov:?}");
        assert_eq!(
            drawn[..5],
            draws(&[1.0, -3.0], &covariance, &free, 5, 1).unwrap()[..]
        );
        let bounded = draws(&[1.0, -3.0], &covariance, &[[0.999, 1.001], [-3.0, -2.9]], 50, 1).unwrap();
        assert!(
            bounded
                .iter()
                .all(|d| (0.999..=1.001).contains(&d[0]) && (-3.0..=-2.9).contains(&d[1]))
        );
    }

    /// Stiffness off by a factor moves the limit by that factor: the band at any speed is the one of the factor.
    #[test]
    fn the_band_of_a_scaled_structure_is_known() {
        let structures: Vec<Blocks> = (0..=100)
            .map(|i| {
                let factor = 1.0 + 0.002 * f64::from(i);
                let mode = |axis, frequency_hz| AxisMode {
                    axis,
                    frequency_hz,
                    damping_ratio: 0.03,
                    stiffness_n_per_m: 1e6 * factor,
                };
                let frf = ModalFrf::from_axis_modes(&[mode(0, 12.0), mode(1, 15.0)]).unwrap();
                Blocks {
                    lateral: Box::new(frf),
                    axial: None,
                }
            })
            .collect();
        let force = RegenerativeForce::drilling_lateral(1014.2, 619.9, 1.178, 2).unwrap();
        let speeds = [150.0, 300.0, 420.0];
        let found = band(&solvers(&force.into(), &structures), &speeds);
        let solver = StabilitySolver::new(force, structures[0].lateral.as_ref());
        for (i, n) in speeds.iter().enumerate() {
            let least = solver.limit_at(*n).unwrap().depth_mm;
            assert!((found.lower_mm[i].unwrap() / least - 1.01).abs() < 1e-9);
            assert!((found.upper_mm[i].unwrap() / least - 1.19).abs() < 1e-9);
        }
    }
}
