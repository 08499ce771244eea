//! Maximum-likelihood refinement of common poles: all FRFs of a set at once, weighted with their noise.
//!
//! Model of the receptance of FRF m: `H_m = Σ_r (a_mr ω_r² + b_mr iω ω_r) / (ω_r² − ω² + 2iζ_r ω_r ω)` with real a, b
//! (any viscously damped mode, complex shapes included), lower residual terms 1/ω², i/ω³, 1/ω⁴ and upper ones
//! 1, iω, ω² for the modes outside the band. Given the poles, a, b and the residual terms enter linearly and are projected out
//! (variable projection: Golub & Pereyra 1973, Kaufman's 1975 Jacobian); the poles are found by Levenberg–Marquardt.
//! With Gaussian noise of known variance this is the maximum-likelihood estimate, and the inverse of the normal
//! matrix its covariance (Cramér–Rao).

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use rayon::prelude::*;

use super::local_fit::Pole;

/// Lower residual terms, then upper ones.
pub(super) const RESIDUAL_TERMS: usize = 6;
const MAX_ITERATIONS: usize = 30;
const MIN_DAMPING: f64 = 1e-7;
/// Smallest eigenvalue of the residual terms' Gram matrix, with columns of unit length.
const ROUNDING: f64 = 1e-12;
/// A relative fall of the misfit below this ends the search.
const SETTLED: f64 = 1e-9;

/// One FRF within the window of the fit.
#[derive(Clone)]
pub(super) struct NoisyFrf<'a> {
    pub frequency_hz: &'a [f64],
    pub receptance: &'a [Complex64],
    /// sqrt(E|e|²) of each line, > 0.
    pub sigma: &'a [f64],
}

pub(super) struct Solution {
    pub poles: Vec<Pole>,
    /// By FRF.
    pub frfs: Vec<FrfSolution>,
    /// Σ |e|²/(σ²/2): twice the negative log-likelihood.
    pub misfit: f64,
    pub degrees_of_freedom: usize,
    /// Of (ln f₁, ln ζ₁, ln f₂, …) for the noise as given.
    pub covariance: DMatrix<f64>,
    pub converged: bool,
}

pub(super) struct FrfSolution {
    /// a₁, b₁, a₂, b₂, …, of the fixed poles too, then the residual terms.
    pub linear: DVector<f64>,
    /// Measured less fitted, m/N.
    pub residual: Vec<Complex64>,
    /// Covariance of `linear` for given poles.
    pub linear_covariance: DMatrix<f64>,
    /// −∂linear/∂(ln f₁, ln ζ₁, …).
    pub linear_by_poles: DMatrix<f64>,
    /// Part of the noise at each line that the fit follows, mean over the lines.
    pub leverage: f64,
}

impl Solution {
    pub fn frequency_std_hz(&self, mode: usize) -> f64 {
        self.covariance[(2 * mode, 2 * mode)].max(0.0).sqrt() * self.poles[mode].frequency_hz
    }

    pub fn damping_std(&self, mode: usize) -> f64 {
        self.covariance[(2 * mode + 1, 2 * mode + 1)].max(0.0).sqrt() * self.poles[mode].damping_ratio
    }

    /// Complex modal constant A of a mode in an FRF, 1/kg, and the standard deviation of its modulus' parts:
    /// at the pole the numerator a ω₀² + b s ω₀ is A.
    pub fn constant(&self, frf: usize, mode: usize) -> (Complex64, f64) {
        let found = &self.frfs[frf];
        let pole = self.poles[mode];
        let omega = TAU * pole.frequency_hz;
        let s = Complex64::new(
            -pole.damping_ratio,
            (1.0 - pole.damping_ratio.powi(2)).max(0.0).sqrt(),
        );
        let value = (found.linear[2 * mode] + found.linear[2 * mode + 1] * s) * omega * omega;
        let by_poles = found.linear_by_poles.rows(2 * mode, 2);
        let total = found.linear_covariance.view((2 * mode, 2 * mode), (2, 2))
            + by_poles * &self.covariance * by_poles.transpose();
        (value, (0.5 * total.trace()).max(0.0).sqrt() * omega * omega)
    }

    /// Squared size of a mode in an FRF against its uncertainty (two degrees of freedom).
    pub fn evidence(&self, frf: usize, mode: usize) -> f64 {
        let found = &self.frfs[frf];
        let x = found.linear.rows(2 * mode, 2);
        let covariance = found
            .linear_covariance
            .view((2 * mode, 2 * mode), (2, 2))
            .into_owned();
        covariance
            .try_inverse()
            .map_or(0.0, |inverse| (x.transpose() * inverse * x)[(0, 0)])
    }
}

/// What all FRFs on the same lines share: f/f₀ and 1/(1 − r² + 2iζr) by pole, then line; residual terms by line.
struct Axis {
    ratio: Vec<Vec<f64>>,
    shape: Vec<Vec<Complex64>>,
    terms: Vec<[Complex64; RESIDUAL_TERMS]>,
}

impl Axis {
    fn new<'a>(frequency_hz: &[f64], poles: impl Iterator<Item = &'a Pole>, centre_hz: f64) -> Axis {
        let mut axis = Axis {
            ratio: Vec::new(),
            shape: Vec::new(),
            terms: frequency_hz
                .iter()
                .map(|&f| residual_terms(f, centre_hz))
                .collect(),
        };
        for pole in poles {
            let ratio: Vec<f64> = frequency_hz.iter().map(|f| f / pole.frequency_hz).collect();
            let shape = ratio.iter().map(|r| {
                let (re, im) = (1.0 - r * r, 2.0 * pole.damping_ratio * r);
                let size = 1.0 / (re * re + im * im);
                Complex64::new(re * size, -im * size)
            });
            axis.shape.push(shape.collect());
            axis.ratio.push(ratio);
        }
        axis
    }
}

/// Which FRFs have the same lines: by FRF, the index of the first one with them.
fn same_lines(frfs: &[NoisyFrf]) -> Vec<usize> {
    (0..frfs.len())
        .map(|m| {
            (0..m)
                .find(|&k| frfs[k].frequency_hz == frfs[m].frequency_hz)
                .unwrap_or(m)
        })
        .collect()
}

/// What modes outside the band leave inside it, to the second order in the ratio of the frequencies: 1/ω², i/ω³, 1/ω⁴
/// below, 1, iω, ω² above, each scaled to one at the centre. (With 1/ω² alone the damping of a mode whose flank reaches
/// the band's lower end comes out 0.5 % wrong.)
fn residual_terms(f: f64, centre_hz: f64) -> [Complex64; RESIDUAL_TERMS] {
    let x = f / centre_hz;
    [
        Complex64::new(-1.0 / (x * x), 0.0),
        Complex64::new(0.0, 1.0 / (x * x * x)),
        Complex64::new(1.0 / (x * x).powi(2), 0.0),
        Complex64::ONE,
        Complex64::new(0.0, x),
        Complex64::new(x * x, 0.0),
    ]
}

struct Linearised {
    misfit: f64,
    normal: DMatrix<f64>,
    gradient: DVector<f64>,
    frfs: Vec<FrfSolution>,
}

/// Frequency at which the residual terms have unit size.
fn centre_hz(frfs: &[NoisyFrf]) -> f64 {
    let first = frfs
        .iter()
        .filter_map(|c| c.frequency_hz.first())
        .fold(f64::INFINITY, |m, f| m.min(*f));
    let last = frfs
        .iter()
        .filter_map(|c| c.frequency_hz.last())
        .fold(0.0, |m: f64, f| m.max(*f));
    (first.max(1e-3 * last) * last).sqrt()
}

/// Refines the poles `start`; `fixed` poles take part with residues of their own but are not moved. `None` where the
/// lines do not determine the poles.
pub(super) fn fit(frfs: &[NoisyFrf], start: &[Pole], fixed: &[Pole]) -> Option<Solution> {
    let parameters = 2 * start.len();
    let linear = 2 * (start.len() + fixed.len()) + RESIDUAL_TERMS;
    let equations: usize = frfs.iter().map(|c| 2 * c.frequency_hz.len()).sum();
    let degrees_of_freedom = equations
        .checked_sub(parameters + linear * frfs.len())
        .filter(|&free| free > 0)?;
    if frfs.iter().any(|c| 2 * c.frequency_hz.len() <= linear) {
        return None;
    }
    let lines = Lines {
        axis_of: same_lines(frfs),
        centre_hz: centre_hz(frfs),
    };
    let mut poles = start.to_vec();
    let mut current = linearise(frfs, &poles, fixed, &lines)?;
    let mut lambda = 1e-4;
    let mut converged = parameters == 0;
    for _ in 0..MAX_ITERATIONS {
        if converged {
            break;
        }
        let mut damped = current.normal.clone();
        for j in 0..parameters {
            damped[(j, j)] *= 1.0 + lambda;
        }
        let Some(step) = damped.cholesky().map(|c| c.solve(&current.gradient)) else {
            break;
        };
        let trial: Vec<Pole> = poles
            .iter()
            .enumerate()
            .map(|(j, p)| {
                let widest = (2.0 * p.damping_ratio).clamp(1e-4, 0.1);
                Pole {
                    frequency_hz: p.frequency_hz * step[2 * j].clamp(-widest, widest).exp(),
                    damping_ratio: (p.damping_ratio * step[2 * j + 1].clamp(-0.7, 0.7).exp())
                        .max(MIN_DAMPING),
                }
            })
            .collect();
        let sane = trial
            .iter()
            .all(|p| p.frequency_hz > 0.0 && p.damping_ratio < 0.9);
        match if sane {
            linearise(frfs, &trial, fixed, &lines)
        } else {
            None
        } {
            Some(next) if next.misfit <= current.misfit => {
                converged = current.misfit - next.misfit <= SETTLED * current.misfit + 1e-3;
                poles = trial;
                current = next;
                lambda = (lambda * 0.2).max(1e-12);
            }
            _ => {
                // No way down that rounding lets one see.
                if step.amax() < 1e-9 {
                    converged = true;
                }
                lambda *= 10.0;
                if lambda > 1e8 {
                    break;
                }
            }
        }
    }
    let covariance = current.normal.try_inverse()?;
    covariance.iter().all(|c| c.is_finite()).then_some(Solution {
        poles,
        frfs: current.frfs,
        misfit: current.misfit,
        degrees_of_freedom,
        covariance,
        converged,
    })
}

struct Lines {
    axis_of: Vec<usize>,
    centre_hz: f64,
}

/// What one FRF adds: cost, information matrix, gradient and its own solution.
type Share = (f64, DMatrix<f64>, DVector<f64>, FrfSolution);

/// Solves for the linear parameters of every FRF and builds the normal equations of the poles.
fn linearise(frfs: &[NoisyFrf], poles: &[Pole], fixed: &[Pole], lines: &Lines) -> Option<Linearised> {
    let axes: Vec<Option<Axis>> = (0..frfs.len())
        .map(|m| {
            let own = lines.axis_of[m] == m;
            own.then(|| Axis::new(frfs[m].frequency_hz, poles.iter().chain(fixed), lines.centre_hz))
        })
        .collect();
    let each: Vec<Option<Share>> = frfs
        .par_iter()
        .zip(&lines.axis_of)
        .map(|(frf, &axis)| linearise_one(frf, poles, axes[axis].as_ref()?))
        .collect();
    let parameters = 2 * poles.len();
    let mut sum = Linearised {
        misfit: 0.0,
        normal: DMatrix::zeros(parameters, parameters),
        gradient: DVector::zeros(parameters),
        frfs: Vec::with_capacity(frfs.len()),
    };
    // In order, so that rounding does not depend on the threads.
    for one in each {
        let (misfit, normal, gradient, solution) = one?;
        sum.misfit += misfit;
        sum.normal += normal;
        sum.gradient += gradient;
        sum.frfs.push(solution);
    }
    sum.misfit.is_finite().then_some(sum)
}

/// Writes the weighted real and imaginary parts of a function of the line into a column.
fn put(column: &mut [f64], weight: &[f64], value: impl Fn(usize) -> Complex64) {
    for (k, (pair, w)) in column.chunks_exact_mut(2).zip(weight).enumerate() {
        let value = value(k);
        pair[0] = value.re * w;
        pair[1] = value.im * w;
    }
}

fn linearise_one(
    frf: &NoisyFrf,
    poles: &[Pole],
    axis: &Axis,
) -> Option<(f64, DMatrix<f64>, DVector<f64>, FrfSolution)> {
    let lines = frf.frequency_hz.len();
    let modes = axis.shape.len();
    let columns = 2 * modes + RESIDUAL_TERMS;
    // A complex standard deviation of σ is σ/√2 in each part.
    let weight: Vec<f64> = frf.sigma.iter().map(|s| std::f64::consts::SQRT_2 / s).collect();
    let mut values = vec![0.0; 2 * lines * columns];
    for (column, out) in values.chunks_exact_mut(2 * lines).enumerate() {
        match column.checked_sub(2 * modes) {
            None => {
                let (shape, ratio) = (&axis.shape[column / 2], &axis.ratio[column / 2]);
                if column % 2 == 0 {
                    put(out, &weight, |k| shape[k]);
                } else {
                    put(out, &weight, |k| {
                        Complex64::new(-shape[k].im * ratio[k], shape[k].re * ratio[k])
                    });
                }
            }
            Some(term) => put(out, &weight, |k| axis.terms[k][term]),
        }
    }
    let mut basis = DMatrix::from_vec(2 * lines, columns, values);
    let mut target = DVector::<f64>::zeros(2 * lines);
    put(target.as_mut_slice(), &weight, |k| frf.receptance[k]);
    // Unit columns: the Gram matrix is then as well scaled as it can be.
    let norms: Vec<f64> = basis.column_iter().map(|c| c.norm()).collect();
    if norms.iter().any(|n| !(n.is_finite() && *n > 0.0)) {
        return None;
    }
    for (mut column, norm) in basis.column_iter_mut().zip(&norms) {
        column /= *norm;
    }
    let transposed = basis.transpose();
    let mut gram = &transposed * &basis;
    // Lines near 0 Hz make the lower residual terms all alike: hold back the part of them that rounding would decide.
    for term in 2 * modes..columns {
        gram[(term, term)] += ROUNDING;
    }
    let cholesky = gram.cholesky()?;
    let mut x = cholesky.solve(&(&transposed * &target));
    let mut residual = &target - &basis * &x;
    // One step of iterative refinement: the normal equations square the condition number.
    let correction = cholesky.solve(&(&transposed * &residual));
    x += correction;
    residual = &target - &basis * &x;

    let parameters = 2 * poles.len();
    let mut values = vec![0.0; 2 * lines * parameters];
    for (column, out) in values.chunks_exact_mut(2 * lines).enumerate() {
        let j = column / 2;
        let (shape, ratio, zeta) = (&axis.shape[j], &axis.ratio[j], poles[j].damping_ratio);
        let (a, b) = (x[2 * j] / norms[2 * j], x[2 * j + 1] / norms[2 * j + 1]);
        put(out, &weight, |k| {
            let (g, r) = (shape[k], ratio[k]);
            let squared = g * g * Complex64::new(a, b * r);
            if column % 2 == 0 {
                // r falls by r with ln f₀.
                g * Complex64::new(0.0, -b * r) - squared * Complex64::new(2.0 * r * r, -2.0 * zeta * r)
            } else {
                -squared * Complex64::new(0.0, 2.0 * zeta * r)
            }
        });
    }
    let slopes = DMatrix::from_vec(2 * lines, parameters, values);
    let cross = &transposed * &slopes;
    let solved = cholesky.solve(&cross);
    let slopes_t = slopes.transpose();
    let normal = &slopes_t * &slopes - cross.transpose() * &solved;
    let gradient = &slopes_t * &residual;
    let misfit = residual.norm_squared();
    let scale = DMatrix::from_diagonal(&DVector::from_iterator(columns, norms.iter().map(|n| 1.0 / n)));
    let solution = FrfSolution {
        linear: &scale * x,
        residual: (0..lines)
            .map(|k| Complex64::new(residual[2 * k], residual[2 * k + 1]) / weight[k])
            .collect(),
        linear_covariance: &scale * cholesky.inverse() * &scale,
        linear_by_poles: &scale * solved,
        leverage: columns as f64 / (2 * lines) as f64,
    };
    Some((misfit, normal, gradient, solution))
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::{Mode, Synthetic};
    use super::*;

    /// Residual terms are the first of a series in the modes outside the band: what is cut off stays below the marks.
    #[test]
    fn modes_outside_the_band_leave_exact_data_within_the_marks() {
        let modes = [
            Mode::new(0.2, 0.02, 0.01),
            Mode::new(12.0, 0.03, 0.01),
            Mode::new(12.5, 0.02, -0.02),
            Mode::new(400.0, 0.02, 30.0),
        ];
        let (f, h) = Synthetic::new(4.0, 40.0, 0.25, &modes).frf();
        let sigma: Vec<f64> = h.iter().map(|h| 0.01 * h.norm()).collect();
        let frf = NoisyFrf {
            frequency_hz: &f,
            receptance: &h,
            sigma: &sigma,
        };
        let start = [(11.8, 0.04), (12.7, 0.015)].map(|(frequency_hz, damping_ratio)| Pole {
            frequency_hz,
            damping_ratio,
        });
        let solution = fit(&[frf], &start, &[]).unwrap();
        assert!(solution.converged);
        for (pole, mode) in solution.poles.iter().zip(&modes[1..3]) {
            approx::assert_relative_eq!(pole.frequency_hz, mode.frequency_hz, max_relative = 1e-4);
            approx::assert_relative_eq!(pole.damping_ratio, mode.damping_ratio, max_relative = 2e-3);
        }
        for (j, mode) in modes[1..3].iter().enumerate() {
            let (constant, _) = solution.constant(0, j);
            approx::assert_relative_eq!(constant.re, mode.constant, max_relative = 1e-2);
        }
    }
}
