//! A few poles and a residual, fitted to the complex mobility around them by least squares.
//!
//! Model per curve m: `Y_m(f) = Σ_j R_jm / (ζ_j + i u_j(f)) + c_0m + c_1m t + …`, t linear in frequency,
//! every R and c complex. The poles are shared by all curves. R and c enter linearly and are projected out
//! (variable projection: Golub & Pereyra 1973, with Kaufman's 1975 Jacobian), the poles are found by
//! Levenberg–Marquardt. Standard deviations come from the residual's covariance at the solution.

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

use super::curve::detuning;

/// With fewer lines than this nothing is concluded about how the noise is spread over them.
pub(super) const FEW_LINES: usize = 24;
/// From this many curves on their scatter is worth asking.
const SEVERAL_CURVES: usize = 4;
const MAX_ITERATIONS: usize = 60;
/// A fall of the cost by this part of itself is worth no further step.
pub(super) const SETTLED: f64 = 1e-7;
/// Where only the size of what is left is asked for.
pub(super) const ROUGHLY_SETTLED: f64 = 1e-4;
/// A relative change of the poles that is only rounding.
const LAST_DIGITS: f64 = 1e-11;
/// Smallest damping ratio the search may reach; below it a line spectrum cannot tell.
const MIN_DAMPING: f64 = 1e-7;

/// A complex pole as frequency and damping.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pole {
    pub frequency_hz: f64,
    pub damping_ratio: f64,
}

/// What is fitted: curves on common lines with common line weights.
pub(super) struct Problem<'a> {
    pub frequency_hz: &'a [f64],
    /// Mobility of each curve on these lines.
    pub curves: Vec<&'a [Complex64]>,
    /// 1/σ of each line, up to a common factor.
    pub line_weight: Vec<f64>,
    /// 1/σ of each curve, up to a common factor.
    pub curve_weight: Vec<f64>,
    /// Terms of the polynomial that stands for all other modes (2: constant and slope).
    pub residual_terms: usize,
}

pub(super) struct Solution {
    pub poles: Vec<Pole>,
    /// Residue R_jm by curve m, then pole j. The peak of the mode's mobility is R/ζ.
    pub residues: Vec<Vec<Complex64>>,
    /// Of (f_1, ζ_1, f_2, ζ_2, …), scaled by the residual.
    pub covariance: DMatrix<f64>,
    /// Data minus model by curve (unweighted).
    pub residual: Vec<Vec<Complex64>>,
    /// Part of each line's noise that the model follows, 0..1 (mean over the curves).
    pub leverage: Vec<f64>,
    /// Variance of one real component of the weighted residual.
    pub variance: f64,
}

impl Solution {
    pub fn frequency_std_hz(&self, pole: usize) -> f64 {
        self.covariance[(2 * pole, 2 * pole)].max(0.0).sqrt()
    }

    pub fn damping_std(&self, pole: usize) -> f64 {
        self.covariance[(2 * pole + 1, 2 * pole + 1)].max(0.0).sqrt()
    }
}

struct Linearised {
    cost: f64,
    /// By curve.
    residual: Vec<DVector<Complex64>>,
    linear: Vec<DVector<Complex64>>,
    /// Orthonormal basis of the linear part.
    basis: DMatrix<Complex64>,
    /// By curve, a column for each parameter.
    jacobian: Vec<Vec<DVector<Complex64>>>,
    /// JᵀJ and Jᵀr over (f, ln ζ) of every pole.
    normal: DMatrix<f64>,
    gradient: DVector<f64>,
}

/// Finds the poles from a start, to a relative fall of the cost of `settled`. `None` where the lines do not determine
/// them.
pub(super) fn fit(problem: &Problem, start: &[Pole], settled: f64) -> Option<Solution> {
    let parameters = 2 * start.len();
    let equations = 2 * problem.frequency_hz.len() * problem.curves.len();
    let linear = 2 * (start.len() + problem.residual_terms) * problem.curves.len();
    let degrees_of_freedom = equations
        .checked_sub(parameters + linear)
        .filter(|&free| free > 0)?;
    let (first, last) = (*problem.frequency_hz.first()?, *problem.frequency_hz.last()?);

    let mut poles = start.to_vec();
    let mut current = linearise(problem, &poles)?;
    let mut lambda = 1e-3;
    for _ in 0..MAX_ITERATIONS {
        let mut damped = current.normal.clone();
        for j in 0..parameters {
            damped[(j, j)] *= 1.0 + lambda;
        }
        let step = damped.lu().solve(&current.gradient)?;
        // What the step promises, where it is nearly a full one; with exact data there is always more to gain, but no
        // digit that could hold it.
        let enough = lambda < 1e-2 && step.dot(&current.gradient) <= settled * current.cost;
        if enough
            || step
                .iter()
                .zip(poles_scale(&poles))
                .all(|(s, x)| s.abs() <= LAST_DIGITS * x)
        {
            break;
        }
        let trial: Vec<Pole> = poles
            .iter()
            .enumerate()
            .map(|(j, p)| {
                let widest = p.damping_ratio * p.frequency_hz + 0.02 * (last - first);
                Pole {
                    frequency_hz: p.frequency_hz - step[2 * j].clamp(-widest, widest),
                    damping_ratio: (p.damping_ratio * (-step[2 * j + 1].clamp(-1.0, 1.0)).exp())
                        .max(MIN_DAMPING),
                }
            })
            .collect();
        let sane = trial
            .iter()
            .all(|p| p.frequency_hz > 0.0 && p.damping_ratio < 2.0);
        let next = if sane { linearise(problem, &trial) } else { None };
        match next {
            Some(next) if next.cost <= current.cost => {
                let done = current.cost - next.cost <= settled * current.cost;
                poles = trial;
                current = next;
                lambda = (lambda * 0.2).max(1e-12);
                if done {
                    break;
                }
            }
            _ => {
                lambda *= 8.0;
                if lambda > 1e10 {
                    break;
                }
            }
        }
    }

    let variance = current.cost / degrees_of_freedom as f64;
    let inverse = current.normal.clone().try_inverse()?;
    let leverage = leverage(&current, &inverse);
    let mut covariance = &inverse * variance;
    // The plain covariance holds for noise that is alike on all lines and independent between curves.
    if problem.curves.len() >= SEVERAL_CURVES {
        // Scatter between the curves: each curve's own pull on the poles (cluster-robust, Liang & Zeger 1986).
        raise(
            &mut covariance,
            &(&inverse * scatter_of_curves(&current) * &inverse),
        );
    } else if problem.frequency_hz.len() < FEW_LINES {
        // Too few lines to learn from them how the noise is spread. Where it sits on the peak, the plain
        // estimate is too small; the one that takes each line's own residual (MacKinnon & White 1985, HC2)
        // is not.
        raise(
            &mut covariance,
            &(&inverse * scatter_of_lines(&current, &leverage) * &inverse),
        );
    }
    for (j, pole) in poles.iter().enumerate() {
        // From ln ζ to ζ.
        covariance.row_mut(2 * j + 1).scale_mut(pole.damping_ratio);
        covariance.column_mut(2 * j + 1).scale_mut(pole.damping_ratio);
    }
    covariance.iter().all(|c| c.is_finite()).then(|| Solution {
        residues: current
            .linear
            .iter()
            .map(|x| x.iter().take(poles.len()).copied().collect())
            .collect(),
        residual: current
            .residual
            .iter()
            .zip(&problem.curve_weight)
            .map(|(r, curve)| {
                r.iter()
                    .zip(&problem.line_weight)
                    .map(|(r, line)| r / (line * curve))
                    .collect()
            })
            .collect(),
        poles,
        covariance,
        leverage,
        variance,
    })
}

/// Sizes of the parameters (f₁, ln ζ₁, …), for what is a small change.
fn poles_scale(poles: &[Pole]) -> impl Iterator<Item = f64> {
    poles.iter().flat_map(|p| [p.frequency_hz, 1.0])
}

/// Diagonal of the projection onto what the model can follow, linear and pole parameters together.
fn leverage(at: &Linearised, inverse: &DMatrix<f64>) -> Vec<f64> {
    let curves = at.jacobian.len().max(1) as f64;
    (0..at.basis.nrows())
        .map(|k| {
            let linear = at.basis.row(k).norm_squared();
            let mut by_poles = 0.0;
            for jacobian in &at.jacobian {
                for (a, column_a) in jacobian.iter().enumerate() {
                    for (b, column_b) in jacobian.iter().enumerate() {
                        by_poles += inverse[(a, b)] * (column_a[k].conj() * column_b[k]).re;
                    }
                }
            }
            // A complex line is two real equations, and the poles are real.
            (linear + 0.5 * by_poles / curves).clamp(0.0, 1.0)
        })
        .collect()
}

/// Raises standard deviations to those of another estimate of the covariance where these are larger.
fn raise(covariance: &mut DMatrix<f64>, other: &DMatrix<f64>) {
    for j in 0..covariance.nrows() {
        let factor = (other[(j, j)] / covariance[(j, j)]).max(1.0).sqrt();
        if factor.is_finite() {
            covariance.row_mut(j).scale_mut(factor);
            covariance.column_mut(j).scale_mut(factor);
        }
    }
}

/// Σ g gᵀ over the curves' gradients, for the mean's one degree of freedom.
fn scatter_of_curves(at: &Linearised) -> DMatrix<f64> {
    let parameters = at.gradient.len();
    let mut sum = DMatrix::zeros(parameters, parameters);
    for (jacobian, residual) in at.jacobian.iter().zip(&at.residual) {
        let g = DVector::from_fn(parameters, |a, _| jacobian[a].dotc(residual).re);
        sum += &g * g.transpose();
    }
    let curves = at.jacobian.len() as f64;
    sum * (curves / (curves - 1.0).max(1.0))
}

/// Jᵀ diag(|r|²/2(1 − h)) J: the gradient's covariance from each line's own residual.
fn scatter_of_lines(at: &Linearised, leverage: &[f64]) -> DMatrix<f64> {
    let mut sum = DMatrix::zeros(at.gradient.len(), at.gradient.len());
    for (jacobian, residual) in at.jacobian.iter().zip(&at.residual) {
        for (k, h) in leverage.iter().enumerate() {
            let variance = 0.5 * residual[k].norm_sqr() / (1.0 - h).max(0.01);
            for (a, column_a) in jacobian.iter().enumerate() {
                for (b, column_b) in jacobian.iter().enumerate() {
                    sum[(a, b)] += variance * (column_a[k].conj() * column_b[k]).re;
                }
            }
        }
    }
    sum
}

/// Solves for the linear parameters and builds the normal equations of the poles.
fn linearise(problem: &Problem, poles: &[Pole]) -> Option<Linearised> {
    let f = problem.frequency_hz;
    let n = f.len();
    let (first, last) = (*f.first()?, *f.last()?);
    let half_span = (0.5 * (last - first)).max(f64::MIN_POSITIVE);
    let columns = poles.len() + problem.residual_terms;
    let mut shapes: Vec<Complex64> = Vec::with_capacity(n * poles.len());
    let mut values: Vec<Complex64> = Vec::with_capacity(n * columns);
    for pole in poles {
        let damping = pole.damping_ratio;
        for (f, weight) in f.iter().zip(&problem.line_weight) {
            let u = detuning(*f, pole.frequency_hz);
            let g = Complex64::new(damping, -u) / (damping * damping + u * u);
            shapes.push(g);
            values.push(g * weight);
        }
    }
    for power in 0..problem.residual_terms {
        let lines = f.iter().zip(&problem.line_weight);
        values.extend(
            lines.map(|(f, weight)| {
                Complex64::from(((f - first) / half_span - 1.0).powi(power as i32) * weight)
            }),
        );
    }
    // Unit columns keep the factorisation well scaled.
    let mut norms = Vec::with_capacity(columns);
    for column in values.chunks_exact_mut(n) {
        let norm = column.iter().map(|v| v.norm_sqr()).sum::<f64>().sqrt();
        if !(norm.is_finite() && norm > 0.0) {
            return None;
        }
        let scale = norm.recip();
        column.iter_mut().for_each(|v| *v *= scale);
        norms.push(norm);
    }
    let basis = DMatrix::from_vec(n, columns, values);
    let qr = basis.qr();
    let (q, r) = (qr.q(), qr.r());
    if r.diagonal().iter().any(|d| d.norm() < 1e-11) {
        return None;
    }
    // ∂/∂f₀ and ∂/∂ln ζ of each pole's shape, what the linear part can follow taken out.
    let mut slopes: Vec<Complex64> = vec![Complex64::ZERO; 2 * n * poles.len()];
    let pairs = slopes.chunks_exact_mut(2 * n).zip(shapes.chunks_exact(n));
    for (pole, (pair, shape)) in poles.iter().zip(pairs) {
        let (by_frequency, by_damping) = pair.split_at_mut(n);
        for (k, g) in shape.iter().enumerate() {
            let weighted = -(g * g) * problem.line_weight[k];
            let slope = -0.5 * (f[k] / (pole.frequency_hz * pole.frequency_hz) + 1.0 / f[k]);
            by_frequency[k] = Complex64::new(-weighted.im * slope, weighted.re * slope);
            by_damping[k] = weighted * pole.damping_ratio;
        }
    }
    let mut projected = DMatrix::from_vec(n, 2 * poles.len(), slopes);
    let inside = q.ad_mul(&projected);
    projected.gemm(-Complex64::ONE, &q, &inside, Complex64::ONE);

    let parameters = 2 * poles.len();
    let mut result = Linearised {
        cost: 0.0,
        residual: Vec::with_capacity(problem.curves.len()),
        linear: Vec::with_capacity(problem.curves.len()),
        basis: DMatrix::zeros(0, 0),
        jacobian: Vec::with_capacity(problem.curves.len()),
        normal: DMatrix::zeros(parameters, parameters),
        gradient: DVector::zeros(parameters),
    };
    for (curve, &weight) in problem.curves.iter().zip(&problem.curve_weight) {
        let y = DVector::from_fn(n, |k, _| curve[k] * problem.line_weight[k] * weight);
        let in_basis = q.ad_mul(&y);
        let mut linear = r.solve_upper_triangular(&in_basis)?;
        for (x, norm) in linear.iter_mut().zip(&norms) {
            *x /= norm * weight;
        }
        let residual = y - &q * in_basis;
        // Model minus data: the Jacobian of the model, sign turned by the update above.
        let jacobian: Vec<DVector<Complex64>> = (0..parameters)
            .map(|j| projected.column(j) * (linear[j / 2] * weight))
            .collect();
        for a in 0..parameters {
            for b in 0..=a {
                let value = jacobian[a].dotc(&jacobian[b]).re;
                result.normal[(a, b)] += value;
                if a != b {
                    result.normal[(b, a)] += value;
                }
            }
            result.gradient[a] -= jacobian[a].dotc(&residual).re;
        }
        result.cost += residual.norm_squared();
        result.residual.push(residual);
        result.linear.push(linear);
        result.jacobian.push(jacobian);
    }
    result.basis = q;
    result.cost.is_finite().then_some(result)
}

#[cfg(test)]
mod tests {
    use super::super::curve::Curve;
    use super::super::synthetic::{Mode, Synthetic};
    use super::*;

    #[test]
    fn two_modes_closer_than_their_widths_come_out_exactly() {
        let modes = [Mode::new(12.0, 0.03, 1.0), Mode::new(12.4, 0.02, -0.4)];
        let (f, h) = Synthetic::new(6.0, 20.0, 0.1, &modes).frf();
        let curve = Curve::from_receptance(&f, &h, None).unwrap();
        let problem = Problem {
            frequency_hz: &curve.frequency_hz,
            curves: vec![&curve.mobility],
            line_weight: vec![1.0; curve.len()],
            curve_weight: vec![1.0],
            residual_terms: 2,
        };
        let start = [
            Pole {
                frequency_hz: 11.8,
                damping_ratio: 0.02,
            },
            Pole {
                frequency_hz: 12.6,
                damping_ratio: 0.02,
            },
        ];
        let solution = fit(&problem, &start, SETTLED).unwrap();
        let mut poles = solution.poles.clone();
        poles.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
        for (pole, mode) in poles.iter().zip(&modes) {
            approx::assert_relative_eq!(pole.frequency_hz, mode.frequency_hz, max_relative = 1e-7);
            approx::assert_relative_eq!(pole.damping_ratio, mode.damping_ratio, max_relative = 1e-5);
        }
        // A mass-normalised mode's mobility peaks at A/(2ζω₀), and R = that times ζ.
        let expected = 1.0 / (2.0 * std::f64::consts::TAU * 12.0);
        let first = solution.poles.iter().position(|p| p.frequency_hz < 12.2).unwrap();
        approx::assert_relative_eq!(solution.residues[0][first].re, expected, max_relative = 1e-4);
    }

    #[test]
    fn too_few_lines_give_nothing() {
        let y = vec![Complex64::new(1.0, 0.0); 4];
        let f = [1.0, 2.0, 3.0, 4.0];
        let problem = Problem {
            frequency_hz: &f,
            curves: vec![&y],
            line_weight: vec![1.0; 4],
            curve_weight: vec![1.0],
            residual_terms: 2,
        };
        assert!(
            fit(
                &problem,
                &[Pole {
                    frequency_hz: 2.2,
                    damping_ratio: 0.02
                }],
                SETTLED
            )
            .is_none()
        );
    }
}
