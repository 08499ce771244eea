//! Whether what a fitted model leaves of its data is noise, or has structure that noise has not.
//!
//! The level of the noise is known to some per cent at best, so that a misfit of 1.03 per value says nothing by itself.
//! But an error of a model is smooth over neighbouring lines, looks like what the model's own parameters do, and
//! differs from posture to posture in a way that a change of parameters can follow; noise does none of that. Each test
//! projects the rest on patterns of one such kind and compares the energy found there with what noise puts into them
//! (Neyman 1937: smooth tests).
//!
//! What noise puts there is measured, not assumed: the same patterns, turned by e^{iφk} from line to line, belong to a
//! response that is late by a share φ/2π of the record. A structure has rung down by then, noise has not. So turned, they
//! have the same place, the same weights and the same correlation between curves (noise of one hit is common to all its
//! outputs), and hold noise only. Where neighbouring lines are correlated (a Hann window, zero padding), the noise
//! depends on φ: its course is read off a spectrum over the lines (Welch 1967) and carried on to φ = 0.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::levenberg_marquardt::Linearisation;
use super::rest::{AfterSlips, BeyondSlips, LIKE_FOLDS, RestCurve, RestTest};

/// Turns φ at which patterns hold noise only, in sixteenths of a full turn: a quarter record late and more.
const LATE: [usize; 5] = [4, 6, 8, 10, 12];
const SIXTEENTHS: usize = 16;
/// Widths in lines of the windows over which a rest is averaged.
const WIDTHS: [usize; 2] = [4, SIXTEENTHS];
const SMOOTH: [&str; 2] = [
    "smooth over a few neighbouring lines",
    "smooth over many neighbouring lines",
];
const LIKE_PARAMETERS: &str = "what the model's parameters do, of another size in each FRF";
/// A pattern that others explain up to this share of its length is left out.
const COLLINEAR: f64 = 1e-6;
/// Lines that a curve must have for each pattern of its own.
const LINES_PER_PATTERN: usize = 4;
/// Chance at which noise over the lines is taken for coloured.
const COLOURED_P: f64 = 1e-3;
/// What the noise's course over φ is known to where it is carried on.
const COLOUR_STD: f64 = 0.1;

/// Energies of one group of curves in patterns of one kind.
#[derive(Debug, Clone, Copy, Default)]
struct Energies {
    /// Unturned, then at each of [`LATE`].
    at: [f64; 1 + LATE.len()],
    /// Real values that each is the energy of.
    values: f64,
}

impl Energies {
    fn add(&mut self, other: &Energies, times: f64) {
        self.at
            .iter_mut()
            .zip(other.at)
            .for_each(|(sum, e)| *sum += times * e);
        self.values += times * other.values;
    }

    fn late(&self) -> &[f64] {
        &self.at[1..]
    }

    /// What noise puts in, if it does not depend on the turn.
    fn mean(&self) -> f64 {
        self.late().iter().sum::<f64>() / LATE.len() as f64
    }
}

/// e^{−iφk}, φ in sixteenths of a full turn.
pub(super) fn turn(sixteenths: usize, line: usize) -> Complex64 {
    Complex64::from_polar(
        1.0,
        -TAU * ((sixteenths * line) % SIXTEENTHS) as f64 / SIXTEENTHS as f64,
    )
}

/// Turns of [`Energies`].
fn turns() -> impl Iterator<Item = usize> {
    std::iter::once(0).chain(LATE)
}

/// The tests on what small errors of the setup leave of `curves`: their price is part of what is left.
pub fn test_beyond(curves: &mut [RestCurve], after: AfterSlips) -> BeyondSlips {
    for (curve, rest) in curves.iter_mut().zip(after.rest) {
        curve.rest = rest;
    }
    let mut tests = test(curves);
    tests.iter_mut().for_each(|t| t.excess += after.price);
    BeyondSlips {
        tests,
        unlikely: after.unlikely,
        evidence: after.evidence,
        known_to: after.known_to,
        own_errors: None,
    }
}

/// Tests the rest that a model leaves of `curves`. Empty where there are too few lines to tell.
pub fn test(curves: &[RestCurve]) -> Vec<RestTest> {
    let Some(colour) = colour(curves) else {
        return Vec::new();
    };
    let mut tests = Vec::new();
    for (width, looks_like) in WIDTHS.into_iter().zip(SMOOTH) {
        let energies = by_source(curves, |curve| in_windows(curve, width));
        tests.extend(against_late(looks_like, &energies, colour));
    }
    let energies = by_source(curves, in_own_patterns);
    tests.extend(against_late(LIKE_PARAMETERS, &energies, colour));
    tests.extend(against_late(LIKE_FOLDS, &in_folds(curves), colour));
    tests
}

/// Sums of `energies` over the curves of each source.
fn by_source(curves: &[RestCurve], energies: impl Fn(&RestCurve) -> Energies + Sync + Send) -> Vec<Energies> {
    let sources = curves.iter().map(|c| c.source + 1).max().unwrap_or(0);
    let each: Vec<Energies> = curves.par_iter().map(energies).collect();
    let mut sums = vec![Energies::default(); sources];
    for (curve, own) in curves.iter().zip(each) {
        sums[curve.source].add(&own, 1.0);
    }
    sums
}

/// Energy in the means over windows of `width` lines.
fn in_windows(curve: &RestCurve, width: usize) -> Energies {
    let mut energies = Energies {
        values: 2.0 * (curve.rest.len() / width) as f64,
        ..Energies::default()
    };
    for (energy, turned) in energies.at.iter_mut().zip(turns()) {
        for (w, window) in curve.rest.chunks_exact(width).enumerate() {
            let lines = window.iter().enumerate();
            let sum: Complex64 = lines.map(|(k, r)| r * turn(turned, w * width + k)).sum();
            *energy += 2.0 * sum.norm_sqr() / width as f64;
        }
    }
    energies
}

/// Energy in a curve's slopes and own patterns, complex amplitudes free.
fn in_own_patterns(curve: &RestCurve) -> Energies {
    let mut energies = Energies::default();
    let patterns = curve.slopes.iter().chain(&curve.own);
    if curve.rest.len() < LINES_PER_PATTERN * (curve.slopes.len() + curve.own.len()) {
        return energies;
    }
    let mut basis: Vec<Vec<Complex64>> = Vec::new();
    for pattern in patterns {
        let mut column = pattern.clone();
        let before = norm(&column);
        for _ in 0..2 {
            for q in &basis {
                let share = product(q, &column);
                column.iter_mut().zip(q).for_each(|(c, q)| *c -= q * share);
            }
        }
        let left = norm(&column);
        if left > COLLINEAR * before && left.is_finite() {
            column.iter_mut().for_each(|c| *c /= left);
            basis.push(column);
        }
    }
    energies.values = 2.0 * basis.len() as f64;
    for (energy, turned) in energies.at.iter_mut().zip(turns()) {
        let rest = turned_rest(curve, turned);
        *energy = basis.iter().map(|q| 2.0 * product(q, &rest).norm_sqr()).sum();
    }
    energies
}

fn turned_rest(curve: &RestCurve, turned: usize) -> Vec<Complex64> {
    let lines = curve.rest.iter().enumerate();
    lines.map(|(k, r)| r * turn(turned, k)).collect()
}

fn product(a: &[Complex64], b: &[Complex64]) -> Complex64 {
    a.iter().zip(b).map(|(a, b)| a.conj() * b).sum()
}

fn norm(a: &[Complex64]) -> f64 {
    a.iter().map(|v| v.norm_sqr()).sum::<f64>().sqrt()
}

/// What parameters fitted to each part alone take away beyond those fitted to all, and how many parameters that takes.
pub(super) fn apart(parts: &[Linearisation]) -> (f64, f64) {
    let Some(first) = parts.first() else {
        return (0.0, 0.0);
    };
    let count = first.gradient.len();
    let gain = |hessian: &DMatrix<f64>, gradient: &DVector<f64>| -> (f64, f64) {
        let directions = Directions::new(hessian);
        (directions.gain(gradient), directions.count as f64)
    };
    let (mut hessian, mut gradient) = (DMatrix::zeros(count, count), DVector::zeros(count));
    let mut sum = (0.0, 0.0);
    for part in parts {
        let own = gain(&part.hessian, &part.gradient);
        sum = (sum.0 + own.0, sum.1 + own.1);
        hessian += &part.hessian;
        gradient += &part.gradient;
    }
    let common = gain(&hessian, &gradient);
    (sum.0 - common.0, sum.1 - common.1)
}

/// Directions in which data say something about parameters.
struct Directions {
    /// Columns, each scaled to unit information.
    vectors: DMatrix<f64>,
    count: usize,
}

impl Directions {
    fn new(information: &DMatrix<f64>) -> Self {
        let count = information.nrows();
        let scale = DVector::from_fn(count, |i, _| match information[(i, i)] {
            d if d > 0.0 => 1.0 / d.sqrt(),
            _ => 0.0,
        });
        let scaled = DMatrix::from_fn(count, count, |i, j| information[(i, j)] * scale[i] * scale[j]);
        let eigen = scaled.symmetric_eigen();
        let mut vectors = eigen.eigenvectors;
        let mut kept = 0;
        for (mut column, value) in vectors.column_iter_mut().zip(&eigen.eigenvalues) {
            let told = *value > COLLINEAR;
            kept += usize::from(told);
            let factor = if told { 1.0 / value.sqrt() } else { 0.0 };
            column.component_mul_assign(&scale);
            column *= factor;
        }
        Directions { vectors, count: kept }
    }

    /// gᵀ H⁻¹ g.
    fn gain(&self, gradient: &DVector<f64>) -> f64 {
        self.vectors.tr_mul(gradient).norm_squared()
    }
}

/// What parameters fitted to each fold alone take away beyond those fitted to all, by fold. The share of the fit to all is
/// spread over the folds evenly.
fn in_folds(curves: &[RestCurve]) -> Vec<Energies> {
    let folds = curves.iter().map(|c| c.fold + 1).max().unwrap_or(0);
    let count = curves.first().map_or(0, |c| c.slopes.len());
    if folds < 2 || count == 0 {
        return Vec::new();
    }
    let turned = 1 + LATE.len();
    let zero = || {
        (
            DMatrix::<f64>::zeros(count, count),
            vec![DVector::<f64>::zeros(count); turned],
        )
    };
    let each: Vec<(DMatrix<f64>, Vec<DVector<f64>>)> = curves
        .par_iter()
        .map(|curve| {
            let (mut information, mut scores) = zero();
            for (i, a) in curve.slopes.iter().enumerate() {
                for (j, b) in curve.slopes.iter().enumerate().take(i + 1) {
                    information[(i, j)] = product(a, b).re;
                    information[(j, i)] = information[(i, j)];
                }
            }
            for (score, turned) in scores.iter_mut().zip(turns()) {
                let rest = turned_rest(curve, turned);
                for (s, slope) in score.iter_mut().zip(&curve.slopes) {
                    *s = product(slope, &rest).re;
                }
            }
            (information, scores)
        })
        .collect();
    let mut by_fold: Vec<_> = (0..folds).map(|_| zero()).collect();
    let mut all = zero();
    for (curve, (information, scores)) in curves.iter().zip(each) {
        for sum in [&mut by_fold[curve.fold], &mut all] {
            sum.0 += &information;
            sum.1.iter_mut().zip(&scores).for_each(|(sum, s)| *sum += s);
        }
    }
    by_fold.retain(|(information, _)| information.trace() > 0.0);
    let gain = |(information, scores): &(DMatrix<f64>, Vec<DVector<f64>>)| -> Energies {
        let directions = Directions::new(information);
        Energies {
            at: std::array::from_fn(|t| 2.0 * directions.gain(&scores[t])),
            values: directions.count as f64,
        }
    };
    let common = gain(&all);
    let share = 1.0 / by_fold.len().max(1) as f64;
    let mut energies: Vec<Energies> = by_fold.iter().map(gain).collect();
    for energy in &mut energies {
        energy.add(&common, -share);
    }
    energies
}

/// Energy at φ = 0 against that at the late turns, by group; `colour`: noise at φ = 0 over the mean of that at the late
/// turns, and its relative standard deviation.
fn against_late(looks_like: &'static str, groups: &[Energies], colour: [f64; 2]) -> Option<RestTest> {
    let late = LATE.len() as f64;
    let mut all = Energies::default();
    groups.iter().for_each(|e| all.add(e, 1.0));
    let expected = all.mean();
    let scatter = |e: &Energies| e.late().iter().map(|x| (x - e.mean()).powi(2)).sum::<f64>() / (late - 1.0);
    // What is measured may come out too small by chance where groups are few: noise that no two curves have in common
    // scatters by twice its mean.
    let variance = groups.iter().map(scatter).sum::<f64>().max(2.0 * expected) * (1.0 + 1.0 / late);
    let [factor, unsure] = colour;
    let std = factor * variance.sqrt().hypot(unsure * expected);
    (expected > 0.0).then(|| RestTest::new(looks_like, all.at[0], factor * expected, std, all.values))?
}

/// The noise at φ = 0 over the mean of that at the late turns, and what that is known to: 1 and 0 for white noise. `None`
/// where there are too few lines.
pub(super) fn colour(curves: &[RestCurve]) -> Option<[f64; 2]> {
    /// Sixteenths of a turn from which on structures have rung down.
    const QUIET: std::ops::RangeInclusive<usize> = 3..=13;
    /// Cosines and sines of φ and 2φ: what a Hann window's correlation over two lines is made of.
    const TERMS: usize = 5;
    let spectra: Vec<([f64; SIXTEENTHS], usize)> = curves
        .par_iter()
        .map(|curve| {
            let mut spectrum = [0.0; SIXTEENTHS];
            let windows = curve.rest.chunks_exact(SIXTEENTHS);
            let count = windows.len();
            for window in windows {
                for (turned, power) in spectrum.iter_mut().enumerate() {
                    let lines = window.iter().enumerate();
                    let sum: Complex64 = lines.map(|(k, r)| r * turn(turned, k)).sum();
                    *power += sum.norm_sqr() / SIXTEENTHS as f64;
                }
            }
            (spectrum, count)
        })
        .collect();
    let windows: usize = spectra.iter().map(|s| s.1).sum();
    if windows < SIXTEENTHS {
        return None;
    }
    let power: [f64; SIXTEENTHS] =
        std::array::from_fn(|j| spectra.iter().map(|s| s.0[j]).sum::<f64>() / windows as f64);
    let quiet: Vec<usize> = QUIET.collect();
    let mean = quiet.iter().map(|j| power[*j]).sum::<f64>() / quiet.len() as f64;
    // How well a mean over the windows is known: from the windows of different curves, which may share noise.
    let variance: f64 = spectra
        .iter()
        .map(|(s, count)| {
            quiet
                .iter()
                .map(|j| (s[*j] - *count as f64 * power[*j]).powi(2))
                .sum::<f64>()
        })
        .sum::<f64>()
        / quiet.len() as f64
        / (windows as f64).powi(2);
    let chi2: f64 = quiet.iter().map(|j| (power[*j] - mean).powi(2)).sum::<f64>()
        / variance.max(mean * mean / windows as f64);
    let white = ChiSquared::new((quiet.len() - 1) as f64).map_or(1.0, |d| d.sf(chi2)) > COLOURED_P;
    if white || !(mean > 0.0) {
        return Some([1.0, 0.0]);
    }
    let angle = |j: usize| TAU * j as f64 / SIXTEENTHS as f64;
    let row = |j: usize| -> [f64; TERMS] {
        let a = angle(j);
        [1.0, a.cos(), a.sin(), (2.0 * a).cos(), (2.0 * a).sin()]
    };
    let basis = DMatrix::from_fn(quiet.len(), TERMS, |i, t| row(quiet[i])[t]);
    let seen = DVector::from_fn(quiet.len(), |i, _| power[quiet[i]]);
    let fitted = (basis.transpose() * &basis)
        .cholesky()?
        .solve(&(basis.transpose() * seen));
    let at = |j: usize| row(j).iter().zip(fitted.iter()).map(|(a, b)| a * b).sum::<f64>();
    let late = LATE.iter().map(|j| power[*j]).sum::<f64>() / LATE.len() as f64;
    // Never below what is seen somewhere: padding with zeros cuts the noise off within the turn.
    let most = quiet.iter().map(|j| power[*j]).fold(0.0, f64::max);
    let carried = [SIXTEENTHS - 1, 0, 1].map(at).into_iter().fold(most, f64::max);
    Some([(carried / late.max(1e-3 * mean)).max(1.0), COLOUR_STD])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::rest::Rest;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const LINES: usize = 600;
    const FOLDS: usize = 4;
    const OUTPUTS: usize = 6;

    /// E|n|² = 1.
    fn noise(random: &mut ChaCha8Rng) -> Complex64 {
        let (size, turn) = (-random.random_range(1e-12..1.0f64).ln(), random.random::<f64>());
        Complex64::from_polar(size.sqrt(), turn * TAU)
    }

    fn resonance(line: usize, at: f64, width: f64) -> Complex64 {
        Complex64::new(0.0, -width) / Complex64::new(line as f64 - at, -width)
    }

    /// Curves of three modes hit once a fold; `rest(fold, output, line)` is added to noise made by `noise`.
    fn curves(
        noise: impl Fn(&mut ChaCha8Rng) -> Vec<Vec<Complex64>>,
        rest: impl Fn(usize, usize, usize) -> Complex64,
    ) -> Vec<RestCurve> {
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let mut all = Vec::new();
        for fold in 0..FOLDS {
            for (output, noise) in noise(&mut random).into_iter().enumerate() {
                let shift = 7.0 * fold as f64;
                let modes = [(90.0, 6.0), (240.0, 9.0), (420.0, 14.0)];
                let column = |(at, width): (f64, f64)| -> Vec<Complex64> {
                    let size = 20.0 * ((3 * output + fold) as f64 + at).sin();
                    (0..LINES)
                        .map(|k| size * resonance(k, at + shift, width).powi(2))
                        .collect()
                };
                all.push(RestCurve {
                    fold,
                    source: fold,
                    rest: (0..LINES).map(|k| noise[k] + rest(fold, output, k)).collect(),
                    slopes: modes.map(column).to_vec(),
                    own: Vec::new(),
                });
            }
        }
        all
    }

    fn white(random: &mut ChaCha8Rng) -> Vec<Vec<Complex64>> {
        (0..OUTPUTS)
            .map(|_| (0..LINES).map(|_| noise(random)).collect())
            .collect()
    }

    /// Neighbours correlated by 2/3, next ones by 1/6: lines of a Hann window about its middle.
    fn hann(random: &mut ChaCha8Rng) -> Vec<Vec<Complex64>> {
        white(random)
            .into_iter()
            .map(|n| {
                let at = |k: usize| n[k % LINES];
                (0..LINES)
                    .map(|k| (at(k) + 2.0 * at(k + 1) + at(k + 2)) / 6f64.sqrt())
                    .collect()
            })
            .collect()
    }

    /// All outputs of a hit share it.
    fn common(random: &mut ChaCha8Rng) -> Vec<Vec<Complex64>> {
        let one: Vec<Complex64> = (0..LINES).map(|_| noise(random)).collect();
        vec![one; OUTPUTS]
    }

    fn nothing(_: usize, _: usize, _: usize) -> Complex64 {
        Complex64::ZERO
    }

    #[test]
    fn noise_of_whatever_correlation_is_noise() {
        for (name, tests) in [
            ("white", test(&curves(white, nothing))),
            ("Hann", test(&curves(hann, nothing))),
            ("common", test(&curves(common, nothing))),
        ] {
            assert_eq!(tests.len(), 4, "{name}");
            for t in tests {
                assert!(t.sigmas() < 4.0 && !t.is_significant(), "{name}: {t:?}");
            }
        }
    }

    #[test]
    fn white_noise_is_expected_to_be_as_large_as_it_is() {
        for t in test(&curves(white, nothing)) {
            assert!(
                (t.noise_factor - 1.0).abs() < 0.2 && t.sigmas().abs() < 3.5,
                "{t:?}"
            );
        }
        // Six outputs that move alike and share their noise are one.
        let mut alike = curves(common, nothing);
        for i in 0..alike.len() {
            alike[i].slopes = alike[i - i % OUTPUTS].slopes.clone();
        }
        let rest = Rest {
            tests: test(&alike),
            ..Rest::default()
        };
        // Nine directions at five turns tell it to a quarter.
        let share = rest.noise_factor() / OUTPUTS as f64;
        assert!((0.5..2.0).contains(&share), "{share}");
    }

    /// A rest far below the noise on every line, the same share of a mode at all lines, is found, and named.
    #[test]
    fn a_smooth_rest_far_below_the_noise_is_structure() {
        let bump = |_: usize, _: usize, k: usize| 0.5 * resonance(k, 500.0, 20.0);
        let found = test(&curves(white, bump));
        let smooth = found.iter().find(|t| t.looks_like == SMOOTH[1]).unwrap();
        assert!(smooth.is_significant(), "{found:?}");
        let energy = 2.0 * 24.0 * 0.25 * std::f64::consts::PI * 20.0;
        assert!(
            (smooth.excess / energy - 1.0).abs() < 0.3,
            "{} {energy}",
            smooth.excess
        );
    }

    #[test]
    fn parameters_that_differ_between_folds_are_found_by_their_test() {
        let slope = |fold: usize, output: usize, k: usize| {
            let size = 20.0 * ((3 * output + fold) as f64 + 240.0).sin();
            let sign = if fold.is_multiple_of(2) { 0.02 } else { -0.02 };
            sign * size * resonance(k, 240.0 + 7.0 * fold as f64, 9.0).powi(2)
        };
        let found = test(&curves(white, slope));
        let folds = found.iter().find(|t| t.looks_like == LIKE_FOLDS).unwrap();
        assert!(folds.is_significant() && folds.sigmas() > 10.0, "{found:?}");
        // The same in all folds is what a fit takes away: no difference between folds.
        let same = test(&curves(white, |f, o, k| {
            slope(f, o, k) * if f % 2 == 0 { 1.0 } else { -1.0 }
        }));
        let folds = same.iter().find(|t| t.looks_like == LIKE_FOLDS).unwrap();
        assert!(!folds.is_significant(), "{folds:?}");
    }

    #[test]
    fn parts_that_agree_leave_nothing_apart() {
        let part = |at: [f64; 2]| {
            let hessian = DMatrix::from_row_slice(2, 2, &[4.0, 1.0, 1.0, 9.0]);
            Linearisation {
                cost: 0.0,
                gradient: &hessian * DVector::from_row_slice(&at),
                hessian,
            }
        };
        let (gain, count) = apart(&[part([1.0, 2.0]), part([1.0, 2.0])]);
        assert!(gain.abs() < 1e-9 && count == 2.0);
        // Apart by ±d: d' H d from each.
        let (gain, _) = apart(&[part([1.0, 0.0]), part([-1.0, 0.0])]);
        assert!((gain - 8.0).abs() < 1e-9, "{gain}");
    }

    #[test]
    fn too_few_lines_give_no_test() {
        let short: Vec<RestCurve> = curves(white, nothing)
            .into_iter()
            .take(2)
            .map(|c| RestCurve {
                rest: c.rest[..100].to_vec(),
                slopes: c.slopes.iter().map(|s| s[..100].to_vec()).collect(),
                ..c
            })
            .collect();
        assert!(test(&short).is_empty());
    }
}
