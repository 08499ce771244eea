//! A short window of FRFs that share their poles as a rational function with one common denominator.
//!
//! Local rational method, McKelvey & Guérin 2012; Pintelon & Schoukens 2012, ch. 7. All that the denominator's fit needs
//! of the FRFs are the products of their lines with each other, summed over the FRFs ([`LineProducts`]): its cost does
//! not grow with the size of the set.

use nalgebra::{SMatrix, SVector};
use num_complex::Complex64;
use rayon::prelude::*;

/// Half width of a window in lines.
pub(super) const HALF_WINDOW: usize = 8;
/// Lines of a window.
pub(super) const LINES: usize = 2 * HALF_WINDOW + 1;
/// Coefficients of the numerator polynomial, each FRF its own.
const NUMERATOR: usize = 5;
/// Coefficients of the common denominator besides the leading 1: two poles.
const DENOMINATOR: usize = 3;
/// Share of the FRFs' power below which differences of sums of it are not trusted.
const ROUNDING: f64 = 1e-9;
/// Output-error steps after the linear start.
const GAUSS_NEWTON_STEPS: usize = 4;

/// A column for each line.
type Column = SVector<Complex64, LINES>;
/// A column for each coefficient of the numerator.
type Numerators = SMatrix<Complex64, LINES, NUMERATOR>;
/// By line and by line.
type Products = SMatrix<Complex64, LINES, LINES>;
/// By coefficient of the denominator, the leading 1 first.
type EquationProducts = SMatrix<Complex64, { DENOMINATOR + 1 }, { DENOMINATOR + 1 }>;
type Coefficients = SVector<Complex64, DENOMINATOR>;
type Information = SMatrix<Complex64, DENOMINATOR, DENOMINATOR>;

/// FRFs on common lines with the products of neighbouring lines.
pub(super) struct LineProducts<'a> {
    pub frequency_hz: &'a [f64],
    pub frfs: &'a [&'a [Complex64]],
    /// Σ h_i conj(h_{i + d}) over the FRFs, by line i and distance d.
    products: Vec<[Complex64; LINES]>,
}

impl<'a> LineProducts<'a> {
    /// `frfs`: one slice a FRF, all as long as `frequency_hz`.
    pub fn new(frequency_hz: &'a [f64], frfs: &'a [&'a [Complex64]]) -> Self {
        let products = (0..frequency_hz.len())
            .into_par_iter()
            .map(|line| {
                let mut sums = [Complex64::ZERO; LINES];
                for frf in frfs {
                    let value = frf[line];
                    for (sum, other) in sums.iter_mut().zip(&frf[line..]) {
                        *sum += value * other.conj();
                    }
                }
                sums
            })
            .collect();
        LineProducts {
            frequency_hz,
            frfs,
            products,
        }
    }

    /// T Tᴴ of the weighted lines (lines × FRFs) of the window that begins at line `first`.
    fn weighted(&self, first: usize, weight: &[f64; LINES]) -> Products {
        Products::from_fn(|i, j| {
            let (low, high) = (i.min(j), i.max(j));
            let product = self.products[first + low][high - low] * (weight[i] * weight[j]);
            if i <= j { product } else { product.conj() }
        })
    }
}

/// One window fitted.
pub(super) struct Window<'a> {
    data: &'a LineProducts<'a>,
    first: usize,
    weight: [f64; LINES],
    basis: Numerators,
    /// What makes derivatives of the smooth curves by the denominator's coefficients of their coefficients in the basis.
    slopes: [Numerators; DENOMINATOR],
    /// Covariance of the denominator's coefficients for unit noise; `None` where it is not known.
    covariance: Option<Information>,
}

/// One line of one FRF in a fitted window.
pub(super) struct FittedLine {
    pub fitted: Complex64,
    /// Measured less fitted.
    pub residual: Complex64,
    /// Degrees of freedom of the line that the FRF's numerator takes, and with it those that the common denominator does.
    pub taken: f64,
}

impl<'a> Window<'a> {
    /// Fits the window around line `centre`. The linear start is biased by the noise in the regressors, so Gauss–Newton
    /// steps on the output error follow (variable projection, Golub & Pereyra 1973). `None` where the lines do not
    /// determine a denominator.
    pub fn fit(data: &'a LineProducts, centre: usize) -> Option<Self> {
        let first = centre.checked_sub(HALF_WINDOW)?;
        let frequency_hz = data.frequency_hz.get(first..first + LINES)?;
        let half_span = 0.5 * (frequency_hz[LINES - 1] - frequency_hz[0]);
        if !(half_span > 0.0) {
            return None;
        }
        let x: [f64; LINES] =
            std::array::from_fn(|i| (frequency_hz[i] - frequency_hz[HALF_WINDOW]) / half_span);
        let weight = weights(data, first);
        let power = data.weighted(first, &weight);
        let mut coefficients = start(data, first, &x, &weight, &power)?;
        let mut denominator = denominator_values(&x, &coefficients)?;
        let mut projection = Projection::new(&x, &weight, &power, &denominator)?;
        let mut information = Information::zeros();
        for _ in 0..GAUSS_NEWTON_STEPS {
            let right;
            (information, right) = projection.normal_equations(&projection.slopes(&x, &denominator));
            let Some(step) = information.lu().solve(&right) else {
                break;
            };
            let trial = coefficients + step;
            let Some(values) = denominator_values(&x, &trial) else {
                break;
            };
            let Some(next) = Projection::new(&x, &weight, &power, &values) else {
                break;
            };
            let (before, after) = (projection.misfit, next.misfit);
            if !(after < before) {
                break;
            }
            (coefficients, denominator, projection) = (trial, values, next);
            if after > 0.99 * before {
                break;
            }
        }
        Some(Window {
            data,
            first,
            weight,
            slopes: projection.slopes(&x, &denominator),
            basis: projection.basis,
            covariance: information.try_inverse(),
        })
    }

    /// FRF `frf` at some of the window's lines (0 is the first).
    pub fn lines(&self, frf: usize, lines: impl Iterator<Item = usize>) -> impl Iterator<Item = FittedLine> {
        let measured = &self.data.frfs[frf][self.first..self.first + LINES];
        let target = Column::from_fn(|i, _| measured[i] * self.weight[i]);
        let inside = self.basis.ad_mul(&target);
        lines.map(move |i| {
            let at = |rows: &Numerators| {
                rows.row(i)
                    .iter()
                    .zip(&inside)
                    .map(|(b, c)| b * c)
                    .sum::<Complex64>()
            };
            let fitted = at(&self.basis);
            let own: f64 = self.basis.row(i).iter().map(|b| b.norm_sqr()).sum();
            let shared = self.covariance.as_ref().map_or(0.0, |covariance| {
                let slope = Coefficients::from_fn(|j, _| at(&self.slopes[j]));
                (slope.transpose() * covariance * slope.conjugate())[0].re
            });
            FittedLine {
                fitted: fitted / self.weight[i],
                residual: (target[i] - fitted) / self.weight[i],
                taken: own + shared,
            }
        })
    }
}

/// A window of all FRFs for a given denominator: the best numerators and what is left. T are the weighted lines
/// (lines × FRFs), B the basis, P the projector onto what is outside it.
struct Projection {
    /// Orthonormal basis of numerator polynomials over the denominator, weighted.
    basis: Numerators,
    /// Bᴴ T Tᴴ B: products of the smooth curves' coefficients.
    inside: SMatrix<Complex64, NUMERATOR, NUMERATOR>,
    /// P T Tᴴ B: what is left times the coefficients.
    left: Numerators,
    /// |P T|².
    misfit: f64,
}

impl Projection {
    /// `power`: T Tᴴ.
    fn new(x: &[f64; LINES], weight: &[f64; LINES], power: &Products, denominator: &Column) -> Option<Self> {
        let basis = numerators(x, weight, denominator)?;
        let powered = power * basis;
        let inside = basis.ad_mul(&powered);
        Some(Projection {
            left: powered - basis * inside,
            misfit: (power.trace() - inside.trace()).re,
            basis,
            inside,
        })
    }

    /// P ∂B/∂d for each coefficient d of the denominator, the basis taken as polynomials over it.
    fn slopes(&self, x: &[f64; LINES], denominator: &Column) -> [Numerators; DENOMINATOR] {
        let mut factor = denominator.map(|d| -d.inv());
        std::array::from_fn(|_| {
            factor.iter_mut().zip(x).for_each(|(f, x)| *f *= *x);
            let mut slope = self.basis;
            for mut column in slope.column_iter_mut() {
                column.component_mul_assign(&factor);
            }
            slope - self.basis * self.basis.ad_mul(&slope)
        })
    }

    /// Normal equations of the denominator's coefficients over all FRFs: information matrix tr(S_jᴴ S_k C Cᴴ) and right
    /// side tr(S_jᴴ R Cᴴ), with the slopes S, the coefficients C and what is left, R.
    fn normal_equations(&self, slopes: &[Numerators; DENOMINATOR]) -> (Information, Coefficients) {
        let moved = slopes.map(|slope| slope * self.inside);
        (
            Information::from_fn(|j, k| slopes[j].dotc(&moved[k])),
            Coefficients::from_fn(|j, _| slopes[j].dotc(&self.left)),
        )
    }
}

/// Orthonormal basis of the numerator polynomials over the denominator, weighted; `None` where it is not finite.
fn numerators(x: &[f64; LINES], weight: &[f64; LINES], denominator: &Column) -> Option<Numerators> {
    let mut column = Column::from_fn(|i, _| weight[i] / denominator[i]);
    let mut polynomials = Numerators::zeros();
    for mut out in polynomials.column_iter_mut() {
        out.copy_from(&column);
        column.iter_mut().zip(x).for_each(|(c, x)| *c *= *x);
    }
    let basis = polynomials.qr().q();
    basis.iter().all(|v| v.is_finite()).then_some(basis)
}

/// 1 + d₁x + d₂x² + … on every line; `None` where it has a root (nearly) on the frequency axis.
fn denominator_values(x: &[f64; LINES], coefficients: &Coefficients) -> Option<Column> {
    let values = Column::from_fn(|i, _| {
        let higher = coefficients.iter().rev();
        Complex64::ONE + higher.fold(Complex64::ZERO, |sum, d| (sum + d) * x[i])
    });
    values
        .iter()
        .all(|d| d.is_finite() && d.norm_sqr() > 1e-18)
        .then_some(values)
}

/// Linear start of the denominator: equation error divided by the denominator of the pass before
/// (Sanathanan & Koerner 1963).
fn start(
    data: &LineProducts,
    first: usize,
    x: &[f64; LINES],
    weight: &[f64; LINES],
    power: &Products,
) -> Option<Coefficients> {
    let mut coefficients = Coefficients::zeros();
    for _ in 0..2 {
        let denominator = denominator_values(x, &coefficients)?;
        let basis = numerators(x, weight, &denominator)?;
        let factors = Factors::from_fn(|i, j| x[i].powi(j as i32) / denominator[i]);
        let products = equation_products(&factors, &basis, power)
            .unwrap_or_else(|| column_products(data, first, weight, &factors, &basis));
        let normal: Information = products.fixed_view::<DENOMINATOR, DENOMINATOR>(1, 1).into_owned();
        let right: Coefficients = -products.fixed_view::<DENOMINATOR, 1>(1, 0).into_owned();
        coefficients = normal.lu().solve(&right)?;
    }
    Some(coefficients)
}

/// What the lines are multiplied with for each coefficient of the denominator.
type Factors = SMatrix<Complex64, LINES, { DENOMINATOR + 1 }>;

/// Products, summed over all FRFs, of the lines times one factor with the lines times another, numerators projected
/// out: tr(Tᴴ F_jᴴ P F_k T) = Σ conj(f_j) (P ∘ (T Tᴴ)ᵀ) f_k. `None` where next to nothing is left of the lines (exact
/// data): rounding would decide.
fn equation_products(factors: &Factors, basis: &Numerators, power: &Products) -> Option<EquationProducts> {
    let mut kernel = Products::identity() - basis * basis.adjoint();
    kernel.zip_apply(&power.transpose(), |p, g| *p *= g);
    let products = factors.ad_mul(&(kernel * factors));
    let trusted = (0..factors.ncols()).all(|j| {
        let column = factors.column(j);
        let before = column
            .iter()
            .enumerate()
            .map(|(k, f)| f.norm_sqr() * power[(k, k)].re);
        products[(j, j)].re > ROUNDING * before.sum::<f64>()
    });
    trusted.then_some(products)
}

/// The same from the projected lines of every FRF.
fn column_products(
    data: &LineProducts,
    first: usize,
    weight: &[f64; LINES],
    factors: &Factors,
    basis: &Numerators,
) -> EquationProducts {
    let mut products = EquationProducts::zeros();
    for frf in data.frfs {
        let mut columns = *factors;
        for (i, mut row) in columns.row_iter_mut().enumerate() {
            row *= frf[first + i] * weight[i];
        }
        columns -= basis * basis.ad_mul(&columns);
        products += columns.ad_mul(&columns);
    }
    products
}

/// Weight of each line, one for all FRFs of the set: the reciprocal of the magnitude, so that the error is relative.
/// The magnitude is averaged over the set and over neighbouring lines (with a floor), or else the noise would weigh
/// itself.
fn weights(data: &LineProducts, first: usize) -> [f64; LINES] {
    const REACH: usize = 2;
    let count = data.frfs.len() as f64;
    let mut power = [0.1; LINES];
    for frf in data.frfs {
        let squares: [f64; LINES] = std::array::from_fn(|i| frf[first + i].norm_sqr());
        let mean = squares.iter().sum::<f64>() / LINES as f64;
        let share = 1.0 / (mean.max(f64::MIN_POSITIVE) * count);
        power
            .iter_mut()
            .zip(squares)
            .for_each(|(p, square)| *p += square * share);
    }
    std::array::from_fn(|i| {
        let near = &power[i.saturating_sub(REACH)..(i + REACH + 1).min(LINES)];
        (near.len() as f64 / near.iter().sum::<f64>()).sqrt()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Lines of FRFs with two common poles near 20 Hz, and relative noise.
    fn frfs(noise: f64) -> (Vec<f64>, Vec<Vec<Complex64>>) {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let frequency_hz: Vec<f64> = (0..LINES).map(|k| 18.0 + 0.25 * k as f64).collect();
        let frfs = (0..5)
            .map(|frf| {
                frequency_hz
                    .iter()
                    .map(|&f| {
                        let mode = |f0: f64, zeta: f64| {
                            let r = f / f0;
                            1.0 / Complex64::new(1.0 - r * r, 2.0 * zeta * r)
                        };
                        let shape = ((2 * frf + 1) as f64).sin();
                        let exact = mode(19.5, 0.03) + shape * mode(20.5, 0.02) + 0.3;
                        let (size, turn) = (-random.random_range(1e-9..1.0f64).ln(), random.random::<f64>());
                        exact
                            + Complex64::from_polar(
                                noise * exact.norm() * size.sqrt(),
                                turn * std::f64::consts::TAU,
                            )
                    })
                    .collect()
            })
            .collect();
        (frequency_hz, frfs)
    }

    #[test]
    fn two_poles_leave_nothing_of_exact_lines_and_the_noise_of_noisy_ones() {
        for (noise, least, most) in [(0.0, 0.0, 1e-5), (0.02, 0.012, 0.028)] {
            let (frequency_hz, frfs) = frfs(noise);
            let slices: Vec<&[Complex64]> = frfs.iter().map(Vec::as_slice).collect();
            let data = LineProducts::new(&frequency_hz, &slices);
            let window = Window::fit(&data, HALF_WINDOW).unwrap();
            let (mut square, mut freedom) = (0.0, 0.0);
            for frf in 0..frfs.len() {
                for line in window.lines(frf, 0..LINES) {
                    assert!((0.0..=1.0).contains(&line.taken), "{}", line.taken);
                    square += (line.residual / line.fitted).norm_sqr();
                    freedom += 1.0 - line.taken;
                }
            }
            let left = (square / freedom).sqrt();
            assert!((least..=most).contains(&left), "noise {noise}: {left}");
            // Numerators take five lines of each FRF, the denominator three of all together.
            let expected = (frfs.len() * (LINES - NUMERATOR) - DENOMINATOR) as f64;
            assert!((freedom - expected).abs() < 0.5, "{freedom} for {expected}");
        }
    }

    #[test]
    fn the_short_way_to_the_products_is_the_long_one() {
        let (frequency_hz, frfs) = frfs(0.02);
        let slices: Vec<&[Complex64]> = frfs.iter().map(Vec::as_slice).collect();
        let data = LineProducts::new(&frequency_hz, &slices);
        let weight = weights(&data, 0);
        let x: [f64; LINES] = std::array::from_fn(|k| k as f64 / 8.0 - 1.0);
        let denominator = Column::repeat(Complex64::ONE);
        let basis = numerators(&x, &weight, &denominator).unwrap();
        let factors = Factors::from_fn(|i, j| x[i].powi(j as i32).into());
        let short = equation_products(&factors, &basis, &data.weighted(0, &weight)).unwrap();
        let long = column_products(&data, 0, &weight, &factors, &basis);
        assert!((short - long).norm() < 1e-11 * long.norm());
    }

    #[test]
    fn lines_that_are_no_numbers_give_no_window() {
        let (frequency_hz, mut frfs) = frfs(0.02);
        frfs[2][5].re = f64::NAN;
        let slices: Vec<&[Complex64]> = frfs.iter().map(Vec::as_slice).collect();
        assert!(Window::fit(&LineProducts::new(&frequency_hz, &slices), HALF_WINDOW).is_none());
    }
}
