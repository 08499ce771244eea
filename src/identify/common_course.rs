//! Whether what is left is each curve's own, or something that the curves of a posture have in common.
//!
//! Errors of a measurement that are smooth over the lines (leakage, windows, a cable, an average over few hits) are new in each
//! curve. Whatever the structure does, a channel, a hammer or a file, it does to several curves at once: over a few neighbouring lines
//! their rests, each over its own response, then have one course but for a factor. Held against the same curves shifted against one
//! another over the lines, which have nothing in common.

use num_complex::Complex64;
use rayon::prelude::*;

use super::rest::RestCurve;

/// Lines of a window over which a rest is averaged, and windows of a block in which two curves may have one course.
const LINES: usize = 16;
const BLOCK: usize = 4;
/// A curve whose windows hold no more than this many standard deviations of noise's energy above that of noise says nothing.
const SEEN: f64 = 3.0;
/// In common from which on errors are none of each curve's own, however the rest looks.
pub(super) const TOO_MUCH: f64 = 0.5;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::own_errors::UNSURE;
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
    fn few_lines_tell_nothing() {
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
