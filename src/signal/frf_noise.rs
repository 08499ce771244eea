//! How noisy measured FRFs are, from the measurement alone.
//!
//! In a short window a set of FRFs that share their poles is a rational function with one common denominator
//! (local rational method, McKelvey & Guérin 2012; Pintelon & Schoukens 2012, ch. 7). What is left at the window's
//! centre, divided by its degrees of freedom, is noise; over all windows its variance is described as
//! σ² = (a |H|)² + (b (f₀/f)^p)²: a relative part (hammer, gain) and a floor (sensor, quantisation), even over the
//! band in what the sensor measures: displacement (p = 0), velocity (1: vibrometer) or acceleration (2). Which one
//! is read from the scatter, since files are often integrated before they are exported.

use std::ops::Range;

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use rayon::prelude::*;

/// Noise of one FRF: standard deviation of the complex value (both parts together) at receptance magnitude |H|.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrfNoise {
    /// a: share of the magnitude.
    pub relative: f64,
    /// b: floor at `reference_hz`, in the unit of the FRF.
    pub floor: f64,
    /// p: the floor falls with this power of the frequency.
    pub power: i32,
    /// f₀, Hz, > 0.
    pub reference_hz: f64,
}

impl FrfNoise {
    /// Standard deviation of the complex value where the true magnitude is `magnitude`.
    pub fn std(&self, frequency_hz: f64, magnitude: f64) -> f64 {
        let floor = self.floor / ratio(frequency_hz, self.reference_hz).powi(self.power);
        (self.relative * magnitude).hypot(floor)
    }
}

/// Powers of the frequency with which a floor may fall: displacement, velocity, acceleration.
const POWERS: [i32; 3] = [0, 1, 2];
/// A floor that falls must be this much likelier (natural logarithm) than an even one.
const LIKELIER: f64 = 10.0;
/// P(square > 7 × mean) is 1e-3 for noise: what lies beyond is no noise.
const CUT: f64 = 7.0;

/// f/f₀, never zero: a line at 0 Hz has no acceleration to speak of.
fn ratio(frequency_hz: f64, reference_hz: f64) -> f64 {
    (frequency_hz / reference_hz).max(1e-6)
}

/// Half width of a window in lines.
const HALF_WINDOW: usize = 8;
/// Lines from one window to the next.
const STEP: usize = 2;
/// Coefficients of the numerator polynomial, each FRF its own.
const NUMERATOR: usize = 5;
/// Coefficients of the common denominator besides the leading 1: two poles.
const DENOMINATOR: usize = 3;
/// Share of a line that the fit may take for the curve without it still to be worth something.
const MOST_TAKEN: f64 = 0.7;
/// Output-error steps after the linear start.
const GAUSS_NEWTON_STEPS: usize = 4;

/// Squared departure from the local rational fit at one line, corrected for the degrees of freedom, and the magnitude
/// of the smooth curve there.
#[derive(Debug, Clone, Copy)]
struct Departure {
    frequency_hz: f64,
    magnitude: f64,
    variance: f64,
}

/// Noise of one FRF and the smooth curve that it was measured against.
#[derive(Debug, Clone)]
pub struct FrfNoiseEstimate {
    pub law: FrfNoise,
    /// Standard deviation of the complex value on each line: the law at the magnitude of a smooth curve through the other
    /// lines. (At the noisy magnitude a line that noise made small would get more weight than it deserves: every FRF
    /// would be fitted too small by a share a², and by a third of that at a curve that the line itself has drawn.)
    pub std: Vec<f64>,
}

/// Estimates the noise of each FRF of a set measured together (one posture: common poles, common frequency lines).
/// `frfs`: one slice a FRF, all as long as `frequency_hz`. `None` where there are too few lines to tell.
pub fn estimate(frequency_hz: &[f64], frfs: &[&[Complex64]]) -> Vec<Option<FrfNoiseEstimate>> {
    let lines = frequency_hz.len();
    if lines < 2 * HALF_WINDOW + 1 || frfs.is_empty() {
        return vec![None; frfs.len()];
    }
    let mut local: Vec<Local> = frfs
        .iter()
        .map(|h| Local {
            departures: Vec::with_capacity(lines),
            smooth: h.iter().map(|v| v.norm()).collect(),
        })
        .collect();
    let last = lines - 1 - HALF_WINDOW;
    let centres: Vec<usize> = (HALF_WINDOW..=last).step_by(STEP).collect();
    let windows: Vec<Option<Window>> = centres
        .into_par_iter()
        .map(|centre| {
            // The lines that this window speaks for: its own and those up to the next; the first and the last window
            // speak for the ends of the band too.
            let from = if centre == HALF_WINDOW { 0 } else { centre };
            let to = if centre + STEP > last {
                centre + HALF_WINDOW + 1
            } else {
                centre + STEP
            };
            window(frequency_hz, frfs, centre, from..to)
        })
        .collect();
    for window in windows.into_iter().flatten() {
        for (local, (departure, smooth)) in local.iter_mut().zip(window.frfs) {
            local.departures.extend(departure);
            for (line, magnitude) in window.lines.clone().zip(smooth) {
                if magnitude.is_finite() {
                    local.smooth[line] = magnitude;
                }
            }
        }
    }
    let departures: Vec<&[Departure]> = local.iter().map(|l| l.departures.as_slice()).collect();
    fit_laws(&departures)
        .into_iter()
        .zip(&local)
        .map(|(law, local)| {
            let law = law?;
            let smooth = frequency_hz.iter().zip(&local.smooth);
            let std = smooth.map(|(f, magnitude)| law.std(*f, *magnitude)).collect();
            Some(FrfNoiseEstimate { law, std })
        })
        .collect()
}

/// One line of an FRF after a fit.
#[derive(Debug, Clone, Copy)]
pub struct LeftOver {
    pub frequency_hz: f64,
    /// Of the fitted value.
    pub magnitude: f64,
    /// Squared residual, corrected for the degrees of freedom that the fit took.
    pub squared: f64,
}

/// Noise laws of FRFs measured together, from what a fit leaves over on each line of each. `None` for too few lines.
pub fn laws_of_residuals(frfs: &[Vec<LeftOver>]) -> Vec<Option<FrfNoise>> {
    let departures: Vec<Vec<Departure>> = frfs
        .iter()
        .map(|lines| {
            lines
                .iter()
                .filter(|l| l.magnitude.is_finite() && l.squared.is_finite())
                .map(|l| Departure {
                    frequency_hz: l.frequency_hz,
                    magnitude: l.magnitude,
                    variance: l.squared,
                })
                .collect()
        })
        .collect();
    let slices: Vec<&[Departure]> = departures.iter().map(Vec::as_slice).collect();
    fit_laws(&slices)
}

/// What the windows have found of one FRF.
struct Local {
    departures: Vec<Departure>,
    /// Magnitude of the smooth curve on each line.
    smooth: Vec<f64>,
}

/// What one window says of each FRF.
struct Window {
    /// Lines that it speaks for.
    lines: Range<usize>,
    /// By FRF: the departure at the centre, and the magnitude of the smooth curve on these lines (NaN where not known).
    frfs: Vec<(Option<Departure>, Vec<f64>)>,
}

/// A window of all FRFs for a given denominator: the best numerators and what is left.
struct Projection {
    /// Orthonormal basis of numerator polynomials over the denominator, weighted: lines × coefficients.
    basis: DMatrix<Complex64>,
    /// Weighted smooth curves, lines × FRFs.
    fitted: DMatrix<Complex64>,
    /// Weighted measurements less the smooth curves, lines × FRFs.
    residual: DMatrix<Complex64>,
}

impl Projection {
    /// `targets`: weighted measurements, lines × FRFs.
    fn new(
        x: &[f64],
        weight: &[f64],
        targets: &DMatrix<Complex64>,
        denominator: &[Complex64],
    ) -> Option<Self> {
        let basis = numerators(x, weight, denominator)?;
        let residual = outside(targets, &basis);
        Some(Projection {
            fitted: targets - &residual,
            basis,
            residual,
        })
    }

    /// Derivatives of the smooth curves with respect to the denominator's coefficients, numerators projected out:
    /// lines × (coefficient, then FRF).
    fn slopes(&self, x: &[f64], denominator: &[Complex64]) -> DMatrix<Complex64> {
        let factors = DMatrix::from_fn(x.len(), DENOMINATOR, |i, j| {
            -x[i].powi(j as i32 + 1) / denominator[i]
        });
        outside(&times_each(&factors, &self.fitted), &self.basis)
    }
}

/// Orthonormal basis of the numerator polynomials over the denominator, weighted; `None` where it is not finite.
fn numerators(x: &[f64], weight: &[f64], denominator: &[Complex64]) -> Option<DMatrix<Complex64>> {
    let polynomials = DMatrix::from_fn(x.len(), NUMERATOR, |i, j| {
        weight[i] * x[i].powi(j as i32) / denominator[i]
    });
    let basis = polynomials.qr().q();
    basis.iter().all(|v| v.is_finite()).then_some(basis)
}

/// The part of the columns of `all` outside the span of an orthonormal basis.
fn outside(all: &DMatrix<Complex64>, basis: &DMatrix<Complex64>) -> DMatrix<Complex64> {
    let inside = adjoint_times(basis, all);
    let mut rest = all.clone();
    let (rows, columns) = rest.shape();
    let out = MatMut::from_column_major_slice_mut(rest.as_mut_slice(), rows, columns);
    matmul(
        out,
        Accum::Add,
        view(basis),
        view(&inside),
        -Complex64::ONE,
        Par::Seq,
    );
    rest
}

/// leftᴴ right. (nalgebra multiplies complex matrices one number at a time.)
fn adjoint_times(left: &DMatrix<Complex64>, right: &DMatrix<Complex64>) -> DMatrix<Complex64> {
    let (rows, columns) = (left.ncols(), right.ncols());
    let mut out = DMatrix::zeros(rows, columns);
    let target = MatMut::from_column_major_slice_mut(out.as_mut_slice(), rows, columns);
    matmul(
        target,
        Accum::Replace,
        view(left).adjoint(),
        view(right),
        Complex64::ONE,
        Par::Seq,
    );
    out
}

fn view(matrix: &DMatrix<Complex64>) -> MatRef<'_, Complex64> {
    MatRef::from_column_major_slice(matrix.as_slice(), matrix.nrows(), matrix.ncols())
}

/// Every curve times every factor, line by line: lines × (factor, then curve).
fn times_each(factors: &DMatrix<Complex64>, curves: &DMatrix<Complex64>) -> DMatrix<Complex64> {
    let (lines, count) = curves.shape();
    let mut out = DMatrix::zeros(lines, factors.ncols() * count);
    // By slices: nalgebra walks the columns of a view one checked step at a time.
    let mut target = out.as_mut_slice().chunks_exact_mut(lines.max(1));
    for factor in factors.as_slice().chunks_exact(lines.max(1)) {
        for curve in curves.as_slice().chunks_exact(lines.max(1)) {
            let Some(target) = target.next() else { break };
            for ((out, f), value) in target.iter_mut().zip(factor).zip(curve) {
                *out = f * value;
            }
        }
    }
    out
}

/// Columns side by side for every FRF as one long column each: (lines × FRFs) × `columns`.
fn stacked(matrix: DMatrix<Complex64>, columns: usize) -> DMatrix<Complex64> {
    let rows = matrix.len() / columns;
    matrix.reshape_generic(nalgebra::Dyn(rows), nalgebra::Dyn(columns))
}

/// 1 + d₁x + d₂x² on every line; `None` where it has a root (nearly) on the frequency axis.
fn denominator_values(x: &[f64], coefficients: &DVector<Complex64>) -> Option<Vec<Complex64>> {
    let value = |x: &f64| {
        Complex64::ONE
            + coefficients
                .iter()
                .rev()
                .fold(Complex64::ZERO, |sum, d| (sum + d) * *x)
    };
    let values: Vec<Complex64> = x.iter().map(value).collect();
    values
        .iter()
        .all(|d| d.is_finite() && d.norm() > 1e-9)
        .then_some(values)
}

/// Linear start of the denominator: equation error divided by the denominator of the pass before
/// (Sanathanan & Koerner 1963).
fn start(x: &[f64], weight: &[f64], targets: &DMatrix<Complex64>) -> Option<DVector<Complex64>> {
    let mut coefficients = DVector::zeros(DENOMINATOR);
    for _ in 0..2 {
        let denominator = denominator_values(x, &coefficients)?;
        let basis = numerators(x, weight, &denominator)?;
        let factors = DMatrix::from_fn(x.len(), DENOMINATOR + 1, |i, j| {
            x[i].powi(j as i32) / denominator[i]
        });
        let columns = times_each(&factors, targets);
        let projected = stacked(outside(&columns, &basis), DENOMINATOR + 1);
        let products = adjoint_times(&projected, &projected);
        let normal = products.view((1, 1), (DENOMINATOR, DENOMINATOR)).into_owned();
        let right = -products.view((1, 0), (DENOMINATOR, 1)).into_owned();
        coefficients = normal.lu().solve(&right)?.column(0).into_owned();
    }
    Some(coefficients)
}

/// Fits one window. The linear start is biased by the noise in the regressors, so Gauss–Newton steps on the output error
/// follow (variable projection, Golub & Pereyra 1973). `None` where the lines do not determine a denominator.
fn window(frequency_hz: &[f64], frfs: &[&[Complex64]], centre: usize, lines: Range<usize>) -> Option<Window> {
    let range = centre - HALF_WINDOW..centre + HALF_WINDOW + 1;
    let half_span = 0.5 * (frequency_hz[range.end - 1] - frequency_hz[range.start]);
    if !(half_span > 0.0) {
        return None;
    }
    let x: Vec<f64> = frequency_hz[range.clone()]
        .iter()
        .map(|f| (f - frequency_hz[centre]) / half_span)
        .collect();
    let set: Vec<&[Complex64]> = frfs.iter().map(|h| &h[range.clone()]).collect();
    let weight = weights(&set);
    let targets = DMatrix::from_fn(x.len(), set.len(), |i, frf| set[frf][i] * weight[i]);
    let mut coefficients = start(&x, &weight, &targets)?;
    let mut denominator = denominator_values(&x, &coefficients)?;
    let mut projection = Projection::new(&x, &weight, &targets, &denominator)?;
    let mut information = DMatrix::<Complex64>::zeros(DENOMINATOR, DENOMINATOR);
    for _ in 0..GAUSS_NEWTON_STEPS {
        let slopes = stacked(projection.slopes(&x, &denominator), DENOMINATOR);
        information = adjoint_times(&slopes, &slopes);
        let residual = stacked(projection.residual.clone(), 1);
        let right = adjoint_times(&slopes, &residual).column(0).into_owned();
        let Some(step) = information.clone().lu().solve(&right) else {
            break;
        };
        let trial = &coefficients + step;
        let Some(values) = denominator_values(&x, &trial) else {
            break;
        };
        let Some(next) = Projection::new(&x, &weight, &targets, &values) else {
            break;
        };
        let (before, after) = (projection.residual.norm_squared(), next.residual.norm_squared());
        if !(after < before) {
            break;
        }
        (coefficients, denominator, projection) = (trial, values, next);
        if after > 0.99 * before {
            break;
        }
    }
    let inverse = information.try_inverse();
    let slopes = projection.slopes(&x, &denominator);
    let c = HALF_WINDOW;
    let found = (0..set.len()).map(|frf| {
        // Degrees of freedom of a line that the FRF's numerator takes, and with it those that the common denominator does.
        let taken = |i: usize| {
            let own: f64 = projection.basis.row(i).iter().map(|b| b.norm_sqr()).sum();
            let shared = inverse.as_ref().map_or(0.0, |inverse| {
                let slope = |j: usize| slopes[(i, j * set.len() + frf)];
                let mut sum = Complex64::ZERO;
                for j in 0..DENOMINATOR {
                    for k in 0..DENOMINATOR {
                        sum += slope(j) * inverse[(j, k)] * slope(k).conj();
                    }
                }
                sum.re
            });
            own + shared
        };
        let freedom = 1.0 - taken(c);
        let variance = projection.residual[(c, frf)].norm_sqr() / (weight[c].powi(2) * freedom);
        let magnitude = projection.fitted[(c, frf)].norm() / weight[c];
        let known = freedom > 0.1 && variance.is_finite() && magnitude.is_finite();
        let departure = known.then(|| Departure {
            frequency_hz: frequency_hz[centre],
            magnitude,
            variance,
        });
        let smooth = lines.clone().map(|line| {
            let i = line - range.start;
            // The curve as it would be without this line (the fit is nearly linear): else a line's own noise would have
            // a say in its weight.
            let taken = taken(i).min(MOST_TAKEN);
            let without =
                projection.fitted[(i, frf)] - projection.residual[(i, frf)] * (taken / (1.0 - taken));
            without.norm() / weight[i]
        });
        (departure, smooth.collect())
    });
    Some(Window {
        frfs: found.collect(),
        lines,
    })
}

/// Weight of each line, one for all FRFs of the set: the reciprocal of the magnitude, so that the error is relative.
/// The magnitude is averaged over the set and over neighbouring lines (with a floor), or else the noise would weigh
/// itself.
fn weights(set: &[&[Complex64]]) -> Vec<f64> {
    const REACH: usize = 2;
    let lines = set[0].len();
    let mut power = vec![0.1; lines];
    for h in set {
        let mean = h.iter().map(|v| v.norm_sqr()).sum::<f64>() / lines as f64;
        for (p, v) in power.iter_mut().zip(h.iter()) {
            *p += v.norm_sqr() / (mean.max(f64::MIN_POSITIVE) * set.len() as f64);
        }
    }
    (0..lines)
        .map(|i| {
            let near = &power[i.saturating_sub(REACH)..(i + REACH + 1).min(lines)];
            (near.len() as f64 / near.iter().sum::<f64>()).sqrt()
        })
        .collect()
}

/// The law of each FRF, with the power of the floor that describes all of them best.
fn fit_laws(frfs: &[&[Departure]]) -> Vec<Option<FrfNoise>> {
    let all = || frfs.iter().flat_map(|d| d.iter());
    let (sum, count) = all()
        .filter(|d| d.frequency_hz > 0.0)
        .fold((0.0, 0), |(sum, n), d| (sum + d.frequency_hz.ln(), n + 1));
    let reference_hz = if count > 0 {
        (sum / f64::from(count)).exp()
    } else {
        1.0
    };
    let mut best: Option<(f64, Vec<Option<FrfNoise>>)> = None;
    for power in POWERS {
        let laws: Vec<Option<FrfNoise>> = frfs.par_iter().map(|d| fit_law(d, power, reference_hz)).collect();
        let likelihood: f64 = frfs
            .iter()
            .zip(&laws)
            .filter_map(|(d, law)| Some(log_likelihood(d, law.as_ref()?)))
            .sum();
        let found = laws.iter().flatten().count();
        let better = best.as_ref().is_none_or(|(before, other)| {
            found >= other.iter().flatten().count()
                && likelihood > before + if power > 0 { LIKELIER } else { 0.0 }
        });
        if better {
            best = Some((likelihood, laws));
        }
    }
    best.map_or_else(Vec::new, |(_, laws)| laws)
}

/// Of exponentially distributed squares; one far beyond its mean counts as if it were at the cut.
fn log_likelihood(departures: &[Departure], law: &FrfNoise) -> f64 {
    departures
        .iter()
        .map(|d| {
            let mean = law.std(d.frequency_hz, d.magnitude).powi(2);
            -mean.ln() - (d.variance / mean).min(CUT)
        })
        .sum()
}

/// The law of one FRF for a given power of its floor: of f^p H, whose floor is even.
fn fit_law(departures: &[Departure], power: i32, reference_hz: f64) -> Option<FrfNoise> {
    let even: Vec<Departure> = departures
        .iter()
        .map(|d| {
            let x = ratio(d.frequency_hz, reference_hz).powi(power);
            Departure {
                frequency_hz: d.frequency_hz,
                magnitude: d.magnitude * x,
                variance: d.variance * x * x,
            }
        })
        .collect();
    let (relative, floor) = fit_even_law(&even)?;
    Some(FrfNoise {
        relative,
        floor,
        power,
        reference_hz,
    })
}

/// a and b: maximum likelihood of σ² = a²|H|² + b² for exponentially distributed squares (complex Gaussian noise), by
/// iteratively reweighted least squares; squares beyond `CUT` times their mean are taken for misfit and trimmed with
/// the bias that this brings taken back out.
fn fit_even_law(departures: &[Departure]) -> Option<(f64, f64)> {
    if departures.len() < 20 {
        return None;
    }
    let scale = departures.iter().map(|d| d.magnitude).fold(0.0, f64::max);
    let mut sorted: Vec<f64> = departures.iter().map(|d| d.variance).collect();
    sorted.sort_by(f64::total_cmp);
    // Start: all floor, from the median of an exponential distribution.
    let (mut relative, mut floor) = (0.0, (sorted[sorted.len() / 2] / std::f64::consts::LN_2).sqrt());
    if !(scale > 0.0) || !floor.is_finite() || floor <= 0.0 {
        return None;
    }
    // Where the FRF is smallest the median says what the floor is, whatever the reweighting makes of it: a floor that
    // has come out far too low would trim all that speaks against it.
    let mut smallest_first: Vec<&Departure> = departures.iter().collect();
    smallest_first.sort_by(|a, b| a.magnitude.total_cmp(&b.magnitude));
    smallest_first.truncate((departures.len() / 5).max(10));
    let low_square = smallest_first[smallest_first.len() / 2].magnitude.powi(2);
    smallest_first.sort_by(|a, b| a.variance.total_cmp(&b.variance));
    let low_variance = smallest_first[smallest_first.len() / 2].variance / std::f64::consts::LN_2;
    // Mean of an exponential variable given that it is below CUT times its mean.
    let kept_mean = 1.0 - CUT / (CUT.exp() - 1.0);
    let samples: Vec<[f64; 2]> = departures
        .iter()
        .map(|d| [d.magnitude * d.magnitude, d.variance])
        .collect();
    for pass in 0..60 {
        // The first passes know only a crude law: do not trim by it.
        let (cut, share) = if pass > 4 {
            (CUT, kept_mean)
        } else {
            (f64::INFINITY, 1.0)
        };
        let (mut s, mut r) = ([[0.0; 2]; 2], [0.0; 2]);
        for &[u, variance] in &samples {
            let mean = relative * relative * u + floor * floor;
            if variance > cut * mean {
                continue;
            }
            let w = 1.0 / (mean * mean);
            r[0] += w * u * variance;
            r[1] += w * variance;
            s[0][0] += w * u * u;
            s[0][1] += w * u;
            s[1][1] += w;
        }
        s[1][0] = s[0][1];
        r = r.map(|sum| sum / share);
        let determinant = s[0][0] * s[1][1] - s[0][1] * s[1][0];
        let mut a2 = (r[0] * s[1][1] - r[1] * s[0][1]) / determinant;
        let mut b2 = (r[1] * s[0][0] - r[0] * s[1][0]) / determinant;
        // Neither part may be negative: then the other one alone carries the noise.
        if !(a2 > 0.0) {
            a2 = 0.0;
            b2 = r[1] / s[1][1];
        } else if !(b2 > 0.0) {
            b2 = 0.0;
            a2 = r[0] / s[0][0];
        }
        b2 = b2.max(0.5 * (low_variance - a2 * low_square));
        if !a2.is_finite() || !b2.is_finite() || a2 + b2 <= 0.0 {
            return None;
        }
        // Never exactly zero: a line of zero noise would get all the weight there is.
        let smallest = 1e-12 * scale * scale;
        let next = (a2.sqrt(), b2.max(smallest).sqrt());
        let settled =
            (next.0 - relative).abs() < 1e-6 * next.0.max(1e-9) && (next.1 - floor).abs() < 1e-6 * next.1;
        (relative, floor) = next;
        if settled && pass > 6 {
            break;
        }
    }
    Some((relative, floor))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Robot-like FRFs with known noise: both parts of the law come back, and what the sensor measured.
    #[test]
    fn relative_noise_and_floor_are_recovered() {
        POWERS.into_iter().for_each(recovered);
    }

    fn recovered(power: i32) {
        let frequency: Vec<f64> = (0..436).map(|k| 3.0 + 0.2 * k as f64).collect();
        let modes = [
            (7.6, 0.03),
            (9.2, 0.03),
            (13.7, 0.03),
            (19.0, 0.03),
            (24.0, 0.03),
            (81.0, 0.03),
        ];
        let (relative, floor) = (0.025, 2e-8);
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let mut gauss = || -> f64 {
            // Box–Muller
            let (u, v): (f64, f64) = (random.random_range(1e-12..1.0), random.random());
            (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
        };
        let frfs: Vec<Vec<Complex64>> = (0..8)
            .map(|k| {
                frequency
                    .iter()
                    .map(|f| {
                        let h: Complex64 = modes
                            .iter()
                            .enumerate()
                            .map(|(m, (f0, zeta))| {
                                let shape = ((k * 3 + m * 5) as f64).sin();
                                let r = f / f0;
                                shape * 5e-7 * (10.0 / f0).powi(2)
                                    / Complex64::new(1.0 - r * r, 2.0 * zeta * r)
                            })
                            .sum();
                        let even = floor * (16.0 / f).powi(power);
                        let std = (relative * h.norm()).hypot(even) / 2f64.sqrt();
                        h + Complex64::new(gauss(), gauss()) * std
                    })
                    .collect()
            })
            .collect();
        let slices: Vec<&[Complex64]> = frfs.iter().map(|f| f.as_slice()).collect();
        let laws: Vec<FrfNoise> = estimate(&frequency, &slices)
            .into_iter()
            .flatten()
            .map(|e| e.law)
            .collect();
        assert_eq!(laws.len(), frfs.len());
        assert!(laws.iter().all(|l| l.power == power), "{laws:?}");
        let mean = |f: fn(&FrfNoise) -> f64| laws.iter().map(f).sum::<f64>() / laws.len() as f64;
        let (a, b) = (
            mean(|l| l.relative),
            mean(|l| FrfNoise { relative: 0.0, ..*l }.std(16.0, 0.0)),
        );
        assert!((a / relative - 1.0).abs() < 0.1, "power {power}: relative {a}");
        assert!((b / floor - 1.0).abs() < 0.06, "power {power}: floor {b}");
    }

    #[test]
    fn too_few_or_constant_lines_give_no_law() {
        let f: Vec<f64> = (0..10).map(|k| k as f64).collect();
        assert!(estimate(&f, &[&[Complex64::ONE; 10]])[0].is_none());
        let f = vec![5.0; 40];
        assert!(estimate(&f, &[&[Complex64::ONE; 40]])[0].is_none());
    }
}
