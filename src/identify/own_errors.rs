//! Whether what is left is each curve's own, or something that the curves of a posture have in common.
//!
//! Errors of a measurement that are smooth over the lines (leakage, windows, a cable, an average over few hits) are new in each
//! curve. Whatever the structure does, a channel, a hammer or a file, it does to several curves at once: over a few neighbouring lines
//! their rests, each over its own response, then have one course but for a factor. Held against the same curves shifted against one
//! another over the lines, which have nothing in common.

use num_complex::Complex64;
use rayon::prelude::*;

use super::rest::{RestCurve, RestTest};

/// Lines of a window over which a rest is averaged, and windows of a block in which two curves may have one course.
const LINES: usize = 16;
const BLOCK: usize = 4;
/// A curve whose windows hold no more than this many standard deviations of noise's energy above that of noise says nothing.
const SEEN: f64 = 3.0;
/// What two curves may have in common although their errors are their own, over what chance puts there.
const UNSURE: f64 = 0.1;
/// What something else gives curves in common over chance, at most.
const COMMON: f64 = 2.5;
/// In common from which on errors are none of each curve's own, however the rest looks.
pub(super) const TOO_MUCH: f64 = 0.5;
/// Share of errors of each curve that a law at one place takes, for the places are many and it has a few unknowns in each band.
const OF_A_PLACE: f64 = 0.01;
/// Share of something else that is no law at one place, so that it takes next to nothing of it, and the share that is such a law takes
/// of what it is held for.
const BESIDES_PLACES: f64 = 0.15;
const PLACE_TAKES: [f64; 2] = [0.04, 1.2];

/// What speaks for errors that each curve has of its own.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct OwnErrors {
    /// What the curves of a fold have in common over what chance puts there, less 1.
    pub common: f64,
    /// Standard deviation of that for curves that have nothing in common.
    pub common_std: f64,
    /// Share of what is left that the best law at one place takes.
    pub of_a_place: f64,
    /// Standard deviation of that for noise.
    pub of_a_place_std: f64,
}

impl OwnErrors {
    /// ln of the Bayes factor of "each curve has errors of its own" against "something that several curves have in common".
    pub fn log_factor(&self) -> f64 {
        let common = normal(self.common, 0.0, self.common_std.hypot(UNSURE))
            - density_of_common(self.common, self.common_std).ln();
        let std = self.of_a_place_std.hypot(OF_A_PLACE);
        let share = self.of_a_place.max(0.0);
        let [least, most] = PLACE_TAKES;
        let place = (1.0 - BESIDES_PLACES) * at_least(share, least, std)
            / ((most / least).ln() * share.max(least))
            + BESIDES_PLACES * normal(share, OF_A_PLACE, std).exp().min(1.0 / least);
        common + normal(share, OF_A_PLACE, std) - place.ln()
    }
}

/// ln of a normal density.
fn normal(value: f64, mean: f64, std: f64) -> f64 {
    -0.5 * (((value - mean) / std).powi(2) + (std::f64::consts::TAU * std * std).ln())
}

/// Density of what is found in common, where it is anything from nothing to all.
fn density_of_common(value: f64, std: f64) -> f64 {
    at_least(value, 0.0, std.hypot(UNSURE)) / COMMON
}

/// Probability that a value found as `value` ± `std` is `least` or more.
fn at_least(value: f64, least: f64, std: f64) -> f64 {
    use statrs::distribution::{ContinuousCDF, Normal};
    Normal::new(0.0, 1.0).map_or(1.0, |n| n.cdf((value - least) / std))
}

/// What curves of one fold have in common. `None` where too few lines or too few curves stand out for that to be told.
pub(super) fn common(curves: &[RestCurve]) -> Option<[f64; 2]> {
    let windows = curves.iter().map(|c| c.rest.len() / LINES).min()?;
    // Shifted curves are to have nothing in common over a block.
    if windows < 3 * BLOCK {
        return None;
    }
    let seen: Vec<Seen> = curves
        .iter()
        .filter_map(|curve| Seen::new(curve, windows))
        .filter(|seen| seen.above_noise > SEEN * (windows as f64).sqrt())
        .collect();
    let pairs: Vec<[&Seen; 2]> = (0..seen.len())
        .flat_map(|i| (0..i).map(move |j| (i, j)))
        .filter(|(i, j)| seen[*i].fold == seen[*j].fold)
        .map(|(i, j)| [&seen[i], &seen[j]])
        .collect();
    let at = |shift: usize| -> f64 {
        let (together, apart) = pairs
            .iter()
            .map(|[a, b]| in_blocks(&a.windows, &b.windows, shift))
            .fold((0.0, 0.0), |sum, own| (sum.0 + own.0, sum.1 + own.1));
        together / apart
    };
    if pairs.is_empty() {
        return None;
    }
    // Noise is no curve's own error: what it is of two curves' energy has nothing in common whatever the rest has.
    let [above, all] = pairs.iter().fold([0.0, 0.0], |[above, all], [a, b]| {
        [
            above + a.above_noise * b.above_noise,
            all + a.energy() * b.energy(),
        ]
    });
    let share = above / all;
    let shifted: Vec<f64> = (BLOCK..=windows - BLOCK).into_par_iter().map(at).collect();
    let count = shifted.len() as f64;
    let mean = shifted.iter().sum::<f64>() / count;
    let variance = shifted.iter().map(|t| (t - mean).powi(2)).sum::<f64>() / (count - 1.0);
    let found = [(at(0) / mean - 1.0) / share, variance.sqrt() / mean / share];
    found.iter().all(|v| v.is_finite()).then_some(found)
}

/// A curve's rest over its own response, window by window; noise has unit variance.
struct Seen {
    fold: usize,
    windows: Vec<Complex64>,
    /// Energy above that of noise.
    above_noise: f64,
}

impl Seen {
    fn new(curve: &RestCurve, windows: usize) -> Option<Seen> {
        let windows = relative(curve, windows)?;
        Some(Seen {
            fold: curve.fold,
            above_noise: windows.iter().map(|v| v.norm_sqr() - 1.0).sum(),
            windows,
        })
    }

    fn energy(&self) -> f64 {
        self.above_noise + self.windows.len() as f64
    }
}

fn relative(curve: &RestCurve, windows: usize) -> Option<Vec<Complex64>> {
    // The first pattern of a curve's own is its gain.
    let response = curve.own.first()?;
    let in_window = |w: usize| {
        let lines = w * LINES..(w + 1) * LINES;
        let (rest, own) = (&curve.rest[lines.clone()], &response[lines]);
        let sum: Complex64 = rest.iter().zip(own).map(|(r, s)| r * s.conj()).sum();
        let mean = sum / own.iter().map(Complex64::norm_sqr).sum::<f64>().sqrt();
        mean.is_finite().then_some(mean)
    };
    (0..windows).map(in_window).collect()
}

/// Energy that two curves have in common block by block, the second shifted by so many windows, and what they would have if their
/// windows had nothing to do with one another.
fn in_blocks(a: &[Complex64], b: &[Complex64], shift: usize) -> (f64, f64) {
    let products: Vec<Complex64> = (0..a.len())
        .map(|i| a[i] * b[(i + shift) % a.len()].conj())
        .collect();
    products.chunks_exact(BLOCK).fold((0.0, 0.0), |sum, block| {
        let together = block.iter().sum::<Complex64>().norm_sqr();
        let apart: f64 = block.iter().map(Complex64::norm_sqr).sum();
        (sum.0 + together, sum.1 + apart)
    })
}

/// Both together: `place`: the best law at one place, in what is left; `excess`: all that is left.
pub(super) fn own_errors(common: [f64; 2], place: &RestTest, excess: f64) -> Option<OwnErrors> {
    (excess > 0.0).then(|| OwnErrors {
        common: common[0],
        common_std: common[1],
        of_a_place: place.excess / excess,
        of_a_place_std: place.std / excess,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    const WINDOWS: usize = 30;
    const CURVES: usize = 9;

    /// Curves of three folds with noise and with errors of each curve, or of all curves of a fold times a factor, of twice the noise's size.
    fn curves(of_its_own: bool, seed: u64) -> Vec<RestCurve> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = || {
            let part = std::f64::consts::FRAC_1_SQRT_2;
            let mut normal = || part * crate::statistics::nearly_normal(&mut random);
            Complex64::new(normal(), normal())
        };
        // Smooth over one window and a half.
        let smooth = |draw: &mut dyn FnMut() -> Complex64| -> Vec<Complex64> {
            let knots: Vec<Complex64> = (0..WINDOWS + 3).map(|_| draw()).collect();
            // Each begins somewhere else between two knots.
            let first = draw().norm().fract();
            (0..WINDOWS * LINES)
                .map(|l| {
                    let at = first + l as f64 / (1.5 * LINES as f64);
                    let (s, c) = (std::f64::consts::FRAC_PI_2 * at.fract()).sin_cos();
                    knots[at as usize] * c + knots[at as usize + 1] * s
                })
                .collect()
        };
        let mut all = Vec::new();
        for fold in 0..3 {
            let common = smooth(&mut draw);
            for _ in 0..CURVES {
                let error = if of_its_own {
                    smooth(&mut draw)
                } else {
                    common.clone()
                };
                let factor = draw();
                let response: Vec<Complex64> = (0..WINDOWS * LINES)
                    .map(|l| Complex64::from_polar(20.0, 0.3 * l as f64))
                    .collect();
                let factor = if of_its_own { Complex64::ONE } else { factor };
                let rest = error
                    .iter()
                    .zip(&response)
                    .map(|(e, s)| 0.1 * factor * e * s + draw())
                    .collect();
                all.push(RestCurve {
                    fold,
                    source: 0,
                    rest,
                    slopes: Vec::new(),
                    own: vec![response],
                });
            }
        }
        all
    }

    #[test]
    fn errors_of_each_curve_have_nothing_in_common_and_others_have() {
        for seed in 1..6 {
            let [own, std] = common(&curves(true, seed)).unwrap();
            assert!(own.abs() < 2.0 * std.hypot(UNSURE), "{seed}: {own} {std}");
            // Over a block errors as smooth as these have half of their course in common by chance: all of it is twice that at most.
            let [shared, std] = common(&curves(false, seed)).unwrap();
            assert!(shared > 2.5 * std && shared > 0.3, "{seed}: {shared} {std}");
        }
    }

    #[test]
    fn only_curves_that_share_nothing_and_no_place_speak_for_errors_of_their_own() {
        let of = |common: f64, of_a_place: f64| {
            OwnErrors {
                common,
                common_std: 0.05,
                of_a_place,
                of_a_place_std: 0.003,
            }
            .log_factor()
        };
        assert!(of(0.0, 0.01) > 4.0, "{}", of(0.0, 0.01));
        assert!(of(0.5, 0.01) < -4.0, "{}", of(0.5, 0.01));
        assert!(of(1.0, 0.01) < -20.0, "{}", of(1.0, 0.01));
        assert!(of(0.0, 0.3) < -10.0, "{}", of(0.0, 0.3));
        assert!(of(0.1, 0.03) < of(0.0, 0.01));
    }

    #[test]
    fn few_data_tell_nothing() {
        let vague = OwnErrors {
            common: 0.2,
            common_std: 1.5,
            of_a_place: 0.1,
            of_a_place_std: 0.5,
        };
        assert!(vague.log_factor().abs() < 1.5, "{}", vague.log_factor());
        let few: Vec<RestCurve> = curves(true, 1)
            .into_iter()
            .map(|mut c| {
                c.rest.truncate(5 * LINES);
                c
            })
            .collect();
        assert_eq!(common(&few), None);
    }
}
