//! A few poles and a residual, fitted to the complex mobility around them by least squares.
//!
//! Model: `Y(f) = Σ_j R_j / (ζ_j + i u_j(f)) + c_0 + c_1 t + …`, t linear in frequency, every R and c complex. R and c
//! enter linearly and are projected out (variable projection: Golub & Pereyra 1973, with Kaufman's 1975 Jacobian), the
//! poles are found by Levenberg–Marquardt. Standard deviations come from the residual's covariance at the solution.
//!
//! A set has thousands of such fits, so one fit's arrays are kept from step to step.

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

use crate::modal::single::split_columns::{
    along_real, dot, halves, halves_mut, joined, length, real_dot, split, take_out, take_out_real,
};
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
    /// 1/f by line, 1/Hz.
    inverse_hz: Vec<f64>,
    /// Orthonormal basis of the weighted polynomial, by term.
    polynomial: Vec<Vec<f64>>,
    /// Weighted mobility outside the polynomial: as all columns here, real parts first.
    target: Vec<f64>,
}

impl<'a> Prepared<'a> {
    #[inline(always)]
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
            let before = length(&column);
            for _ in 0..2 {
                for along in &polynomial {
                    let part = real_dot(along, &column);
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
        let mut target = split(weighted.map(|(y, weight)| y * weight));
        take_out_real(&mut target, &polynomial);
        Some(Prepared {
            problem,
            inverse_hz: f.iter().map(|f| f.recip()).collect(),
            polynomial,
            target,
        })
    }
}

/// The residues for given poles, and how the model moves with the poles. Columns one after the other.
#[derive(Default)]
struct Linearised {
    cost: f64,
    /// Weighted.
    residual: Vec<f64>,
    residues: Vec<Complex64>,
    /// Orthonormal basis of the poles' shapes outside the polynomial.
    basis: Vec<f64>,
    /// A column for each parameter (f, ln ζ of every pole).
    slopes: Vec<f64>,
    /// Unweighted 1/(ζ + iu) of every pole.
    shapes: Vec<f64>,
    /// Lengths of the weighted shapes, and the triangular factor of the basis by column.
    norms: Vec<f64>,
    factor: Vec<Complex64>,
}

/// Finds the poles from a start, to a relative fall of the cost of `settled`. `None` where the lines do not determine
/// them.
pub(crate) fn fit(problem: &Problem, start: &[Pole], settled: f64) -> Option<LocalSolution> {
    Arch::new().dispatch(Fit {
        problem,
        start,
        settled,
    })
}

/// A fit in the widest vectors of the processor. (A closure would be compiled for the plainest one, as it is too long to be
/// inlined.)
struct Fit<'a> {
    problem: &'a Problem<'a>,
    start: &'a [Pole],
    settled: f64,
}

impl WithSimd for Fit<'_> {
    type Output = Option<LocalSolution>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Option<LocalSolution> {
        self.run()
    }
}

impl Fit<'_> {
    #[inline(always)]
    fn run(&self) -> Option<LocalSolution> {
        let Fit {
            problem,
            start,
            settled,
        } = *self;
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
        let (mut normal, mut gradient) = current.normal_equations(&prepared, &poles);
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
                (normal, gradient) = current.normal_equations(&prepared, &poles);
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
        let inverse = current.projected_normal(&prepared).try_inverse()?;
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
            residual: joined(&current.residual)
                .zip(&problem.line_weight)
                .map(|(r, weight)| r / weight)
                .collect(),
            poles,
            covariance,
            leverage,
            variance,
        })
    }
}

/// Sizes of the parameters (f₁, ln ζ₁, …), for what is a small change.
fn poles_scale(poles: &[Pole]) -> impl Iterator<Item = f64> {
    poles.iter().flat_map(|p| [p.frequency_hz, 1.0])
}

/// Diagonal of the projection onto what the model can follow, linear and pole parameters together. The slopes are those
/// that [`Linearised::projected_normal`] left.
#[inline(always)]
fn leverage(prepared: &Prepared, at: &Linearised, inverse: &DMatrix<f64>) -> Vec<f64> {
    let lines = prepared.inverse_hz.len();
    let mut leverage = vec![0.0; lines];
    for column in &prepared.polynomial {
        for (h, c) in leverage.iter_mut().zip(column) {
            *h += c * c;
        }
    }
    // Re x̄ y on every line, times the factor.
    let mut add = |factor: f64, x: &[f64], y: &[f64]| {
        let ((x_re, x_im), (y_re, y_im)) = (halves(x), halves(y));
        for ((h, (a, b)), (c, d)) in leverage
            .iter_mut()
            .zip(x_re.iter().zip(x_im))
            .zip(y_re.iter().zip(y_im))
        {
            *h += factor * (a * c + b * d);
        }
    };
    for column in at.basis.chunks_exact(2 * lines) {
        add(1.0, column, column);
    }
    let slopes = || at.slopes.chunks_exact(2 * lines).enumerate();
    for (a, x) in slopes() {
        for (b, y) in slopes().take(a + 1) {
            // A complex line is two real equations, and the poles are real.
            let twice = if a == b { 1.0 } else { 2.0 };
            add(0.5 * twice * inverse[(a, b)], x, y);
        }
    }
    leverage.iter_mut().for_each(|h| *h = h.clamp(0.0, 1.0));
    leverage
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
    let lines = leverage.len();
    let parameters = at.slopes.len() / (2 * lines);
    let variances: Vec<f64> = joined(&at.residual)
        .zip(leverage)
        .map(|(r, h)| 0.5 * r.norm_sqr() / (1.0 - h).max(0.01))
        .collect();
    let column = |a: usize| joined(&at.slopes[2 * a * lines..2 * (a + 1) * lines]);
    DMatrix::from_fn(parameters, parameters, |a, b| {
        let products = column(a).zip(column(b)).map(|(a, b)| a.re * b.re + a.im * b.im);
        products.zip(&variances).map(|(product, v)| product * v).sum()
    })
}

impl Linearised {
    /// Solves for the residues at these poles. `None` where the lines do not determine them; what is held then is of no
    /// use.
    #[inline(always)]
    fn solve(&mut self, prepared: &Prepared, poles: &[Pole]) -> Option<()> {
        self.fill(prepared, poles);
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
        self.cost = real_dot(&self.residual, &self.residual);
        self.cost.is_finite().then_some(())
    }

    /// Puts the shapes where they go, and weighted where the basis goes.
    #[inline(always)]
    fn fill(&mut self, prepared: &Prepared, poles: &[Pole]) {
        let (f, weights) = (prepared.problem.frequency_hz, &prepared.problem.line_weight);
        let size = 2 * f.len();
        self.shapes.resize(size * poles.len(), 0.0);
        self.basis.resize(size * poles.len(), 0.0);
        let columns = self
            .shapes
            .chunks_exact_mut(size)
            .zip(self.basis.chunks_exact_mut(size));
        for (pole, (shape, weighted)) in poles.iter().zip(columns) {
            let (damping, natural_hz) = (pole.damping_ratio, pole.frequency_hz);
            let lines = f.iter().zip(&prepared.inverse_hz).zip(weights);
            let ((re, im), (weighted_re, weighted_im)) = (halves_mut(shape), halves_mut(weighted));
            let shapes = re.iter_mut().zip(im).zip(weighted_re.iter_mut().zip(weighted_im));
            for (((f, inverse), weight), ((re, im), (weighted_re, weighted_im))) in lines.zip(shapes) {
                // The detuning (curve.rs) with 1/f at hand.
                let u = 0.5 * (f / natural_hz - natural_hz * inverse);
                let scale = (damping * damping + u * u).recip();
                (*re, *im) = (damping * scale, -u * scale);
                (*weighted_re, *weighted_im) = (*re * weight, *im * weight);
            }
        }
    }

    /// Gram–Schmidt on columns of unit length; one that mostly lay in the others is done twice (enough for orthogonality
    /// to rounding: Daniel, Gragg, Kaufman & Stewart 1976).
    #[inline(always)]
    fn orthonormalise(&mut self, prepared: &Prepared) -> Option<()> {
        let size = prepared.target.len();
        let columns = self.basis.len() / size;
        self.norms.clear();
        self.factor.clear();
        self.factor.resize(columns * columns, Complex64::ZERO);
        for j in 0..columns {
            let (done, rest) = self.basis.split_at_mut(j * size);
            let column = &mut rest[..size];
            let norm = length(column);
            if !(norm.is_finite() && norm > 0.0) {
                return None;
            }
            self.norms.push(norm);
            let factor = &mut self.factor[j * columns..(j + 1) * columns];
            let mut own = norm;
            for _ in 0..2 {
                take_out_real(column, &prepared.polynomial);
                for (part, along) in factor.iter_mut().zip(done.chunks_exact(size)) {
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

    /// ∂/∂f₀ and ∂/∂ln ζ of the model.
    #[inline(always)]
    fn fill_slopes(&mut self, prepared: &Prepared, poles: &[Pole]) {
        let (f, weights) = (prepared.problem.frequency_hz, &prepared.problem.line_weight);
        let lines = f.len();
        self.slopes.resize(4 * lines * poles.len(), 0.0);
        let pairs = self.slopes.chunks_exact_mut(4 * lines);
        let shapes = self.shapes.chunks_exact(2 * lines);
        for (((pole, residue), pair), shape) in poles.iter().zip(&self.residues).zip(pairs).zip(shapes) {
            let (by_frequency, by_damping) = halves_mut(pair);
            let ((f_re, f_im), (d_re, d_im)) = (halves_mut(by_frequency), halves_mut(by_damping));
            let (re, im) = halves(shape);
            let inverse_square = (pole.frequency_hz * pole.frequency_hz).recip();
            let out = f_re.iter_mut().zip(f_im).zip(d_re.iter_mut().zip(d_im));
            let lines = f
                .iter()
                .zip(&prepared.inverse_hz)
                .zip(weights)
                .zip(re.iter().zip(im));
            for (((f_re, f_im), (d_re, d_im)), (((f, inverse), weight), (a, b))) in out.zip(lines) {
                // −g² R, weighted.
                let (square_re, square_im) = (b * b - a * a, -2.0 * a * b);
                let re = (square_re * residue.re - square_im * residue.im) * weight;
                let im = (square_re * residue.im + square_im * residue.re) * weight;
                let by_hz = -0.5 * (f * inverse_square + inverse);
                (*f_re, *f_im) = (-im * by_hz, re * by_hz);
                (*d_re, *d_im) = (re * pole.damping_ratio, im * pole.damping_ratio);
            }
        }
    }

    /// JᵀJ and −Jᵀr over (f, ln ζ) of every pole, J the slopes outside what the linear part can follow. That part need
    /// not be taken out of the columns for them: the residual is outside it already, and JᵀJ = DᵀD − (QᴴD)ᴴ(QᴴD) with the
    /// slopes D and its orthonormal basis Q. (The difference of two near sums directs a step; it is no covariance.)
    #[inline(always)]
    fn normal_equations(&mut self, prepared: &Prepared, poles: &[Pole]) -> (DMatrix<f64>, DVector<f64>) {
        self.fill_slopes(prepared, poles);
        let size = prepared.target.len();
        let parameters = 2 * poles.len();
        let mut inside = Vec::with_capacity(parameters * (prepared.polynomial.len() + poles.len()) * 2);
        for column in self.slopes.chunks_exact(size) {
            for along in &prepared.polynomial {
                inside.extend(along_real(column, along));
            }
            for along in self.basis.chunks_exact(size) {
                let part = dot(along, column);
                inside.extend([part.re, part.im]);
            }
        }
        let inside: Vec<&[f64]> = inside.chunks_exact(inside.len() / parameters).collect();
        let mut normal = DMatrix::zeros(parameters, parameters);
        let mut gradient = DVector::zeros(parameters);
        for (a, x) in self.slopes.chunks_exact(size).enumerate() {
            gradient[a] = -real_dot(x, &self.residual);
            for (b, y) in self.slopes.chunks_exact(size).enumerate().take(a + 1) {
                let value = real_dot(x, y) - real_dot(inside[a], inside[b]);
                (normal[(a, b)], normal[(b, a)]) = (value, value);
            }
        }
        (normal, gradient)
    }

    /// JᵀJ, what the linear part can follow taken out of the slopes themselves.
    #[inline(always)]
    fn projected_normal(&mut self, prepared: &Prepared) -> DMatrix<f64> {
        let size = prepared.target.len();
        for column in self.slopes.chunks_exact_mut(size) {
            take_out_real(column, &prepared.polynomial);
            for along in self.basis.chunks_exact(size) {
                take_out(column, along);
            }
        }
        let parameters = self.slopes.len() / size;
        let mut normal = DMatrix::zeros(parameters, parameters);
        for (a, x) in self.slopes.chunks_exact(size).enumerate() {
            for (b, y) in self.slopes.chunks_exact(size).enumerate().take(a + 1) {
                let value = real_dot(x, y);
                (normal[(a, b)], normal[(b, a)]) = (value, value);
            }
        }
        normal
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
