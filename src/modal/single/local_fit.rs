//! A few poles and a residual, fitted to the complex mobility around them by least squares.
//!
//! Model: `Y(f) = Σ_j R_j / (ζ_j + i u_j(f)) + c_0 + c_1 t + …`, t linear in frequency, every R and c complex. R and c
//! enter linearly and are projected out (variable projection: Golub & Pereyra 1973, with Kaufman's 1975 Jacobian), the
//! poles are found by Levenberg–Marquardt. Standard deviations come from the residual's covariance at the solution.
//!
//! A set has hundreds of such fits of some twenty lines, so one fit's arrays are kept from step to step.

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use pulp::Arch;

use crate::modal::single::curve::detuning;
use crate::stop;

/// With fewer lines than this nothing is concluded about how the noise is spread over them.
pub(crate) const FEW_LINES: usize = 24;
const MAX_ITERATIONS: usize = 60;
/// A fall of the cost by this part of itself is worth no further step: a hundredth of a standard deviation.
pub(crate) const SETTLED: f64 = 1e-6;
/// Where only the size of what is left is asked for.
pub(crate) const ROUGHLY_SETTLED: f64 = 1e-4;
/// A relative change of the poles that is only rounding.
const LAST_DIGITS: f64 = 1e-11;
/// Sums that the processor can add side by side.
const LANES: usize = 8;
/// Smallest damping ratio the search may reach; below it a line spectrum cannot tell.
const MIN_DAMPING: f64 = 1e-7;
/// A column of which less than this part is its own is held by the others.
const OWN_PART: f64 = 1e-11;
/// A column that keeps this part of its length is orthogonal enough to those taken out of it.
const MOSTLY_OWN: f64 = 0.5;

/// A complex pole as frequency and damping.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pole {
    pub frequency_hz: f64,
    pub damping_ratio: f64,
}

/// What is fitted.
pub(crate) struct Problem<'a> {
    pub frequency_hz: &'a [f64],
    /// On these lines.
    pub mobility: &'a [Complex64],
    /// 1/σ of each line, up to a common factor.
    pub line_weight: Vec<f64>,
    /// Terms of the polynomial that stands for all other modes (2: constant and slope).
    pub residual_terms: usize,
}

pub(crate) struct LocalSolution {
    pub poles: Vec<Pole>,
    /// Residue by pole. The peak of the mode's mobility is R/ζ.
    pub residues: Vec<Complex64>,
    /// Of (f_1, ζ_1, f_2, ζ_2, …), scaled by the residual.
    pub covariance: DMatrix<f64>,
    /// Data minus model (unweighted).
    pub residual: Vec<Complex64>,
    /// Part of each line's noise that the model follows, 0..1.
    pub leverage: Vec<f64>,
    /// Variance of one real component of the weighted residual.
    pub variance: f64,
}

impl LocalSolution {
    pub fn frequency_std_hz(&self, pole: usize) -> f64 {
        self.covariance[(2 * pole, 2 * pole)].max(0.0).sqrt()
    }

    pub fn damping_std(&self, pole: usize) -> f64 {
        self.covariance[(2 * pole + 1, 2 * pole + 1)].max(0.0).sqrt()
    }
}

/// What does not depend on the poles: the polynomial is taken out of everything beforehand.
struct Prepared<'a> {
    problem: &'a Problem<'a>,
    /// Orthonormal basis of the weighted polynomial, by term.
    polynomial: Vec<Vec<f64>>,
    /// Weighted mobility outside the polynomial.
    target: Vec<Complex64>,
}

impl<'a> Prepared<'a> {
    fn new(problem: &'a Problem) -> Option<Self> {
        let f = problem.frequency_hz;
        let (first, last) = (*f.first()?, *f.last()?);
        let half_span = (0.5 * (last - first)).max(f64::MIN_POSITIVE);
        let lines = || f.iter().zip(&problem.line_weight);
        let mut polynomial: Vec<Vec<f64>> = Vec::with_capacity(problem.residual_terms);
        for power in 0..problem.residual_terms {
            let mut column: Vec<f64> = lines()
                .map(|(f, weight)| ((f - first) / half_span - 1.0).powi(power as i32) * weight)
                .collect();
            let length = |column: &[f64]| column.iter().map(|v| v * v).sum::<f64>().sqrt();
            let before = length(&column);
            for _ in 0..2 {
                for along in &polynomial {
                    let part: f64 = along.iter().zip(&column).map(|(a, c)| a * c).sum();
                    column.iter_mut().zip(along).for_each(|(c, a)| *c -= part * a);
                }
            }
            let own = length(&column);
            if !(own.is_finite() && own > OWN_PART * before) {
                return None;
            }
            column.iter_mut().for_each(|v| *v /= own);
            polynomial.push(column);
        }
        let weighted = problem.mobility.iter().zip(&problem.line_weight);
        let mut target: Vec<Complex64> = weighted.map(|(y, weight)| y * weight).collect();
        take_out_polynomial(&mut target, &polynomial);
        Some(Prepared {
            problem,
            polynomial,
            target,
        })
    }
}

/// Takes the span of orthonormal real columns out of a column.
#[inline(always)]
fn take_out_polynomial(column: &mut [Complex64], polynomial: &[Vec<f64>]) {
    for along in polynomial {
        let ((a, a_rest), (c, c_rest)) = (along.as_chunks::<LANES>(), column.as_chunks::<LANES>());
        let (mut res, mut ims) = ([0.0; LANES], [0.0; LANES]);
        for (a, c) in a.iter().zip(c) {
            for lane in 0..LANES {
                res[lane] += a[lane] * c[lane].re;
                ims[lane] += a[lane] * c[lane].im;
            }
        }
        let rest: Complex64 = a_rest.iter().zip(c_rest).map(|(a, c)| c * a).sum();
        let (re, im) = (
            res.iter().sum::<f64>() + rest.re,
            ims.iter().sum::<f64>() + rest.im,
        );
        for (c, a) in column.iter_mut().zip(along) {
            c.re -= re * a;
            c.im -= im * a;
        }
    }
}

/// The residues for given poles, and how what is left moves with the poles. Columns one after the other.
#[derive(Default)]
struct Linearised {
    cost: f64,
    /// Weighted.
    residual: Vec<Complex64>,
    residues: Vec<Complex64>,
    /// Orthonormal basis of the poles' shapes outside the polynomial.
    basis: Vec<Complex64>,
    /// A column for each parameter (f, ln ζ of every pole).
    jacobian: Vec<Complex64>,
    /// Unweighted 1/(ζ + iu) of every pole.
    shapes: Vec<Complex64>,
    /// Lengths of the weighted shapes, and the triangular factor of the basis by column.
    norms: Vec<f64>,
    factor: Vec<Complex64>,
}

/// Finds the poles from a start, to a relative fall of the cost of `settled`. `None` where the lines do not determine
/// them.
pub(crate) fn fit(problem: &Problem, start: &[Pole], settled: f64) -> Option<LocalSolution> {
    let parameters = 2 * start.len();
    let equations = 2 * problem.frequency_hz.len();
    let linear = 2 * (start.len() + problem.residual_terms);
    let degrees_of_freedom = equations
        .checked_sub(parameters + linear)
        .filter(|&free| free > 0)?;
    let (first, last) = (*problem.frequency_hz.first()?, *problem.frequency_hz.last()?);

    let mut poles = start.to_vec();
    let prepared = Prepared::new(problem)?;
    let mut current = Linearised::default();
    current.solve(&prepared, &poles)?;
    let (mut normal, mut gradient) = current.normal_equations();
    let mut next = Linearised::default();
    let mut lambda = 1e-3;
    for _ in 0..MAX_ITERATIONS {
        stop::point();
        let mut damped = normal.clone();
        for j in 0..parameters {
            damped[(j, j)] *= 1.0 + lambda;
        }
        let step = damped.lu().solve(&gradient)?;
        // What the step promises, where it is nearly a full one; with exact data there is always more to gain, but no
        // digit that could hold it.
        let enough = lambda < 1e-2 && step.dot(&gradient) <= settled * current.cost;
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
        if sane && next.solve(&prepared, &trial).is_some() && next.cost <= current.cost {
            let done = current.cost - next.cost <= settled * current.cost;
            poles = trial;
            std::mem::swap(&mut current, &mut next);
            (normal, gradient) = current.normal_equations();
            lambda = (lambda * 0.2).max(1e-12);
            if done {
                break;
            }
        } else {
            lambda *= 8.0;
            if lambda > 1e10 {
                break;
            }
        }
    }

    let variance = current.cost / degrees_of_freedom as f64;
    let inverse = normal.try_inverse()?;
    let leverage = leverage(&prepared, &current, &inverse);
    // The plain covariance holds for noise that is alike on all lines.
    let mut covariance = &inverse * variance;
    if problem.frequency_hz.len() < FEW_LINES {
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
    covariance.iter().all(|c| c.is_finite()).then(|| LocalSolution {
        residues: current.residues,
        residual: current
            .residual
            .iter()
            .zip(&problem.line_weight)
            .map(|(r, weight)| r / weight)
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
fn leverage(prepared: &Prepared, at: &Linearised, inverse: &DMatrix<f64>) -> Vec<f64> {
    let lines = at.residual.len();
    (0..lines)
        .map(|k| {
            let on_line = |columns: &[Complex64], j: usize| columns[j * lines + k];
            let shapes: f64 = (0..at.residues.len())
                .map(|j| on_line(&at.basis, j).norm_sqr())
                .sum();
            let polynomial: f64 = prepared
                .polynomial
                .iter()
                .map(|column| column[k] * column[k])
                .sum();
            let mut by_poles = 0.0;
            for a in 0..inverse.nrows() {
                for b in 0..inverse.ncols() {
                    by_poles +=
                        inverse[(a, b)] * (on_line(&at.jacobian, a).conj() * on_line(&at.jacobian, b)).re;
                }
            }
            // A complex line is two real equations, and the poles are real.
            (shapes + polynomial + 0.5 * by_poles).clamp(0.0, 1.0)
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

/// Jᵀ diag(|r|²/2(1 − h)) J: the gradient's covariance from each line's own residual.
fn scatter_of_lines(at: &Linearised, leverage: &[f64]) -> DMatrix<f64> {
    let lines = at.residual.len();
    let parameters = at.jacobian.len() / lines;
    let variances: Vec<f64> = at
        .residual
        .iter()
        .zip(leverage)
        .map(|(r, h)| 0.5 * r.norm_sqr() / (1.0 - h).max(0.01))
        .collect();
    let column = |a: usize| at.jacobian[a * lines..(a + 1) * lines].iter();
    DMatrix::from_fn(parameters, parameters, |a, b| {
        let products = column(a).zip(column(b)).map(|(a, b)| a.re * b.re + a.im * b.im);
        products.zip(&variances).map(|(product, v)| product * v).sum()
    })
}

/// xᴴ y.
#[inline(always)]
fn dot(x: &[Complex64], y: &[Complex64]) -> Complex64 {
    let (mut re, mut im) = ([0.0; LANES], [0.0; LANES]);
    let ((x, x_rest), (y, y_rest)) = (x.as_chunks::<LANES>(), y.as_chunks::<LANES>());
    for (x, y) in x.iter().zip(y) {
        for lane in 0..LANES {
            re[lane] += x[lane].re * y[lane].re + x[lane].im * y[lane].im;
            im[lane] += x[lane].re * y[lane].im - x[lane].im * y[lane].re;
        }
    }
    let rest: Complex64 = x_rest.iter().zip(y_rest).map(|(x, y)| x.conj() * y).sum();
    Complex64::new(re.iter().sum(), im.iter().sum()) + rest
}

/// Re xᴴ y.
#[inline(always)]
fn real_dot(x: &[Complex64], y: &[Complex64]) -> f64 {
    let mut sums = [0.0; LANES];
    let ((x, x_rest), (y, y_rest)) = (x.as_chunks::<LANES>(), y.as_chunks::<LANES>());
    for (x, y) in x.iter().zip(y) {
        for lane in 0..LANES {
            sums[lane] += x[lane].re * y[lane].re + x[lane].im * y[lane].im;
        }
    }
    let rest: f64 = x_rest
        .iter()
        .zip(y_rest)
        .map(|(x, y)| x.re * y.re + x.im * y.im)
        .sum();
    sums.iter().sum::<f64>() + rest
}

/// Takes the part of `column` along the unit column `along` out, and says how much that was.
#[inline(always)]
fn take_out(column: &mut [Complex64], along: &[Complex64]) -> Complex64 {
    let part = dot(along, column);
    for (c, a) in column.iter_mut().zip(along) {
        *c -= a * part;
    }
    part
}

impl Linearised {
    /// Solves for the residues at these poles. `None` where the lines do not determine them; what is held then is of no
    /// use.
    fn solve(&mut self, prepared: &Prepared, poles: &[Pole]) -> Option<()> {
        Arch::new().dispatch(|| self.solve_with_wide_vectors(prepared, poles))
    }

    #[inline(always)]
    fn solve_with_wide_vectors(&mut self, prepared: &Prepared, poles: &[Pole]) -> Option<()> {
        self.fill(prepared.problem, poles);
        self.orthonormalise(prepared)?;
        self.residual.clear();
        self.residual.extend_from_slice(&prepared.target);
        self.residues.clear();
        for column in self.basis.chunks_exact(prepared.target.len()) {
            self.residues.push(take_out(&mut self.residual, column));
        }
        // Back substitution in the triangular factor.
        let columns = poles.len();
        for j in (0..columns).rev() {
            self.residues[j] /= self.factor[j * columns + j];
            for i in 0..j {
                let above = self.factor[j * columns + i] * self.residues[j];
                self.residues[i] -= above;
            }
        }
        for (x, norm) in self.residues.iter_mut().zip(&self.norms) {
            *x /= norm;
        }
        self.cost = self.residual.iter().map(|r| r.norm_sqr()).sum();
        self.slopes(prepared, poles);
        self.cost.is_finite().then_some(())
    }

    /// Puts the weighted shapes where the basis goes.
    #[inline(always)]
    fn fill(&mut self, problem: &Problem, poles: &[Pole]) {
        self.shapes.clear();
        self.basis.clear();
        for pole in poles {
            let damping = pole.damping_ratio;
            for (f, weight) in problem.frequency_hz.iter().zip(&problem.line_weight) {
                let u = detuning(*f, pole.frequency_hz);
                let g = Complex64::new(damping, -u) / (damping * damping + u * u);
                self.shapes.push(g);
                self.basis.push(g * weight);
            }
        }
    }

    /// Gram–Schmidt on columns of unit length; one that mostly lay in the others is done twice (enough for orthogonality
    /// to rounding: Daniel, Gragg, Kaufman & Stewart 1976).
    #[inline(always)]
    fn orthonormalise(&mut self, prepared: &Prepared) -> Option<()> {
        let lines = prepared.target.len();
        let columns = self.basis.len() / lines;
        let length = |column: &[Complex64]| column.iter().map(|v| v.norm_sqr()).sum::<f64>().sqrt();
        self.norms.clear();
        self.factor.clear();
        self.factor.resize(columns * columns, Complex64::ZERO);
        for j in 0..columns {
            let (done, rest) = self.basis.split_at_mut(j * lines);
            let column = &mut rest[..lines];
            let norm = length(column);
            if !(norm.is_finite() && norm > 0.0) {
                return None;
            }
            self.norms.push(norm);
            let factor = &mut self.factor[j * columns..(j + 1) * columns];
            let mut own = norm;
            for _ in 0..2 {
                take_out_polynomial(column, &prepared.polynomial);
                for (part, along) in factor.iter_mut().zip(done.chunks_exact(lines)) {
                    *part += take_out(column, along);
                }
                let before = std::mem::replace(&mut own, length(column));
                if own > MOSTLY_OWN * before {
                    break;
                }
            }
            if !(own >= OWN_PART * norm) {
                return None;
            }
            let scale = own.recip();
            column.iter_mut().for_each(|v| *v *= scale);
            // The factor belongs to columns of unit length.
            factor[j] = own.into();
            factor[..=j].iter_mut().for_each(|part| *part /= norm);
        }
        Some(())
    }

    /// ∂/∂f₀ and ∂/∂ln ζ of the model, what the linear part can follow taken out.
    #[inline(always)]
    fn slopes(&mut self, prepared: &Prepared, poles: &[Pole]) {
        let (f, weights) = (prepared.problem.frequency_hz, &prepared.problem.line_weight);
        let lines = f.len();
        self.jacobian.clear();
        self.jacobian.resize(2 * lines * poles.len(), Complex64::ZERO);
        let pairs = self.jacobian.chunks_exact_mut(2 * lines);
        let shapes = self.shapes.chunks_exact(lines);
        for (((pole, residue), pair), shape) in poles.iter().zip(&self.residues).zip(pairs).zip(shapes) {
            let (by_frequency, by_damping) = pair.split_at_mut(lines);
            for (k, g) in shape.iter().enumerate() {
                let weighted = -(g * g) * residue * weights[k];
                let slope = -0.5 * (f[k] / (pole.frequency_hz * pole.frequency_hz) + 1.0 / f[k]);
                by_frequency[k] = Complex64::new(-weighted.im * slope, weighted.re * slope);
                by_damping[k] = weighted * pole.damping_ratio;
            }
            for column in [by_frequency, by_damping] {
                take_out_polynomial(column, &prepared.polynomial);
                for along in self.basis.chunks_exact(lines) {
                    take_out(column, along);
                }
            }
        }
    }

    /// JᵀJ and −Jᵀr over (f, ln ζ) of every pole.
    fn normal_equations(&self) -> (DMatrix<f64>, DVector<f64>) {
        Arch::new().dispatch(|| self.normal_equations_with_wide_vectors())
    }

    #[inline(always)]
    fn normal_equations_with_wide_vectors(&self) -> (DMatrix<f64>, DVector<f64>) {
        let lines = self.residual.len();
        let parameters = self.jacobian.len() / lines;
        let column = |a: usize| &self.jacobian[a * lines..(a + 1) * lines];
        (
            DMatrix::from_fn(parameters, parameters, |a, b| real_dot(column(a), column(b))),
            DVector::from_fn(parameters, |a, _| -real_dot(column(a), &self.residual)),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::modal::single::curve::Curve;
    use crate::modal::synthetic::{Synthetic, SyntheticMode};

    #[test]
    fn two_modes_closer_than_their_widths_come_out_exactly() {
        let modes = [
            SyntheticMode::new(12.0, 0.03, 1.0),
            SyntheticMode::new(12.4, 0.02, -0.4),
        ];
        let (f, h) = Synthetic::new(6.0, 20.0, 0.1, &modes).frf();
        let curve = Curve::from_receptance(&f, &h, None).unwrap();
        let problem = Problem {
            frequency_hz: &curve.frequency_hz,
            mobility: &curve.mobility,
            line_weight: vec![1.0; curve.len()],
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
        approx::assert_relative_eq!(solution.residues[first].re, expected, max_relative = 1e-4);
    }

    #[test]
    fn too_few_lines_give_nothing() {
        let y = vec![Complex64::new(1.0, 0.0); 4];
        let f = [1.0, 2.0, 3.0, 4.0];
        let problem = Problem {
            frequency_hz: &f,
            mobility: &y,
            line_weight: vec![1.0; 4],
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
