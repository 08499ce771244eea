//! How noisy measured FRFs are, from the measurement alone.
//!
//! In a short window a set of FRFs that share their poles is a rational function (`signal/local_rational.rs`). What is
//! left at the window's centre, divided by its degrees of freedom, is noise; over all windows it makes a law
//! ([`super::noise_law`]).

use std::ops::Range;

use num_complex::Complex64;
use rayon::prelude::*;

use super::local_rational::{self, FittedLine, HALF_WINDOW, LINES, LineProducts};
use super::noise_law::{self, Departure, NoiseAlongBand};
use crate::stop;

/// Lines from one window to the next: at least, and at most (each window speaks for the lines up to the next).
const STEP: [usize; 2] = [2, 6];
/// So many windows are enough for a law of two numbers.
const ENOUGH_WINDOWS: usize = 600;
/// Share of a line that the fit may take for the curve without it still to be worth something.
const MOST_TAKEN: f64 = 0.7;
/// Degrees of freedom that a line must have left to say something about the noise.
const LEAST_FREEDOM: f64 = 0.1;

/// Noise of one FRF and the smooth curve that it was measured against.
#[derive(Debug, Clone)]
pub struct FrfNoiseEstimate {
    /// How the noise depends on frequency and magnitude.
    pub law: NoiseAlongBand,
    /// Standard deviation of the complex value on each line: the law at the magnitude of a smooth curve through the other
    /// lines. (At the noisy magnitude a line that noise made small would get more weight than it deserves: every FRF
    /// would be fitted too small by a share a², and by a third of that at a curve that the line itself has drawn.)
    pub std: Vec<f64>,
}

/// Estimates the noise of each FRF of a set measured together (one posture: common poles, common frequency lines).
/// `frfs`: one slice a FRF, all as long as `frequency_hz`. `None` where there are too few lines to tell.
pub fn estimate(frequency_hz: &[f64], frfs: &[&[Complex64]]) -> Vec<Option<FrfNoiseEstimate>> {
    let lines = frequency_hz.len();
    if lines < LINES || frfs.is_empty() {
        return vec![None; frfs.len()];
    }
    let mut local: Vec<Local> = frfs
        .iter()
        .map(|h| Local {
            departures: Vec::with_capacity(lines),
            smooth: h.iter().map(|v| v.norm()).collect(),
        })
        .collect();
    let data = LineProducts::new(frequency_hz, frfs);
    let last = lines - 1 - HALF_WINDOW;
    let step = (lines / ENOUGH_WINDOWS).clamp(STEP[0], STEP[1]);
    let centres: Vec<usize> = (HALF_WINDOW..=last).step_by(step).collect();
    let windows: Vec<Option<Window>> = centres
        .into_par_iter()
        .map(|centre| {
            stop::point();
            // The lines that this window speaks for: its own and those up to the next; the first and the last window
            // speak for the ends of the band too.
            let from = if centre == HALF_WINDOW { 0 } else { centre };
            let to = if centre + step > last {
                centre + HALF_WINDOW + 1
            } else {
                centre + step
            };
            window(&data, centre, from..to)
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
    noise_law::fit_along_band(&departures)
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

/// Fits the window around line `centre`. `None` where the lines do not determine a denominator.
fn window(data: &LineProducts, centre: usize, lines: Range<usize>) -> Option<Window> {
    let window = local_rational::Window::fit(data, centre)?;
    let first = centre - HALF_WINDOW;
    let found = (0..data.frfs.len()).map(|frf| {
        let mut wanted = window.lines(
            frf,
            std::iter::once(HALF_WINDOW).chain(lines.clone().map(|line| line - first)),
        );
        let departure = wanted.next().and_then(|line| {
            let freedom = 1.0 - line.taken;
            let magnitude = line.fitted.norm();
            let squared = line.residual.norm_sqr() / freedom;
            (freedom > LEAST_FREEDOM && squared.is_finite() && magnitude.is_finite()).then_some(Departure {
                frequency_hz: data.frequency_hz[centre],
                magnitude,
                squared,
            })
        });
        // The curve as it would be without this line (the fit is nearly linear): else a line's own noise would have a say
        // in its weight.
        let without = |line: FittedLine| {
            let taken = line.taken.min(MOST_TAKEN);
            (line.fitted - line.residual * (taken / (1.0 - taken))).norm()
        };
        (departure, wanted.map(without).collect())
    });
    Some(Window {
        frfs: found.collect(),
        lines,
    })
}

#[cfg(test)]
mod tests {
    use super::super::noise_law::{FrfNoise, POWERS};
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
            .map(|e| *e.law.at(16.0))
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
