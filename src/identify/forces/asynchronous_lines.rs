//! Lines of a steady cut that belong to no order of the spindle: vibration of the tool against the workpiece.

use crate::data::Sample;
use crate::signal::{OrderSpectrum, from_mains_hz, line_amplitude, median};

/// What one cut shows off the comb.
#[derive(Debug, Clone, PartialEq)]
pub struct AsynchronousLines {
    /// The strongest line, Hz.
    pub frequency_hz: f64,
    /// It and the lines shifted from it by multiples of the tooth-passing frequency.
    pub lines: Vec<VibrationLine>,
}

/// One line on all channels.
#[derive(Debug, Clone, PartialEq)]
pub struct VibrationLine {
    /// Multiple of the tooth-passing frequency by which it is shifted.
    pub shift: i64,
    /// By recorded channel (index, amplitude, what noise alone would show), N.
    pub channels: Vec<(usize, f64, f64)>,
}

impl AsynchronousLines {
    /// Numbers that it is compared in: its frequency, and each line on each channel.
    pub fn value_count(&self) -> usize {
        1 + self.lines.iter().map(|l| l.channels.len()).sum::<usize>()
    }
}

/// A line this many times the power of its surroundings, averaged over the channels, is no chance (some 10⁴ lines).
const STANDS_OUT: f64 = 30.0;
/// Nearer to the tooth-passing comb than this share of its spacing it may be the modulation of a cut that is not steady.
const BESIDE_COMB: f64 = 0.12;
/// Lines to each side that a growing vibration spreads over.
const SPREAD: usize = 4;
/// Highest multiple of the tooth-passing frequency by which lines are followed.
pub const MOST_SHIFT: i64 = 2;

/// Times its amplitude in the air that a line of the cut must have.
const OVER_AIR: f64 = 4.0;
/// The same of mains hum, which grows with the current of the drives under load.
const MAINS_OVER_AIR: f64 = 20.0;
/// Part of its frequency that large grids keep it to.
const MAINS_KEPT: f64 = 0.001;
/// Lines further apart than this, Hz, do not tell hum from anything.
const MAINS_TOLD: f64 = 3.0;
/// Frequencies looked at in the air to each side of a line, at most.
const MOST_AIR_STEPS: f64 = 8.0;

/// `spectra`: recorded channel, its spectrum, and a stretch of air. Mains hum that the air shows, or may hold, is none.
pub fn find_vibration<S: Sample, A: AsRef<[S]>>(
    spectra: &[(usize, OrderSpectrum, A)],
    sample_rate_hz: f64,
    spindle_hz: f64,
    teeth: usize,
) -> Option<AsynchronousLines> {
    let (_, first, _) = spectra.first()?;
    let (count, line_hz) = (first.rest.len(), first.line_hz);
    let tooth_hz = spindle_hz * teeth as f64;
    let floor = |s: &OrderSpectrum| floor(s, sample_rate_hz);
    let strength: Vec<f64> = (0..count)
        .map(|j| {
            let sum: f64 = spectra
                .iter()
                .map(|(_, s, _)| (s.rest[j] / floor(s)).powi(2))
                .sum();
            sum / spectra.len() as f64
        })
        .collect();
    let allowed = |j: usize| {
        let hz = j as f64 * line_hz;
        // Orders beyond half the sampling rate fold back among the lines.
        let folded = |m: f64| {
            beside((m * sample_rate_hz - hz).abs(), spindle_hz)
                .min(beside(m * sample_rate_hz + hz, spindle_hz))
        };
        hz < 0.45 * sample_rate_hz
            && folded(1.0).min(folded(2.0)) > 1.5 * line_hz
            && beside(hz, tooth_hz) > (BESIDE_COMB * tooth_hz).max(3.0 * line_hz)
            && beside(hz, spindle_hz) > 2.5 * line_hz.min(0.1 * spindle_hz)
    };
    let mut candidates: Vec<usize> = (1..count)
        .filter(|&j| strength[j] > STANDS_OUT && allowed(j))
        .collect();
    candidates.retain(|&j| strength[j] > STANDS_OUT * surroundings(&strength, j));
    candidates.sort_by(|a, b| strength[*b].total_cmp(&strength[*a]));
    // A line that the air shows as well is hum, not cutting.
    let cutting = |j: usize| {
        let hz = centre(&strength, j) * line_hz;
        let is_mains = mains_beside(hz, line_hz);
        spectra.iter().any(|(_, s, air)| {
            let air = air.as_ref();
            if is_mains && air.len() < LEAST_AIR {
                return false;
            }
            let times = if is_mains { MAINS_OVER_AIR } else { OVER_AIR };
            let cut = 2.0 * s.rest[j];
            s.rest[j] > 3.0 * floor(s) && cut > times * in_air(air, sample_rate_hz, hz, line_hz)
        })
    };
    let peak = candidates.into_iter().find(|j| cutting(*j))?;
    let frequency_hz = centre(&strength, peak) * line_hz;
    let lines = (-MOST_SHIFT..=MOST_SHIFT)
        .filter_map(|shift| {
            let hz = (frequency_hz + shift as f64 * tooth_hz).abs();
            let j = (hz / line_hz).round() as usize;
            let inside = j > SPREAD + 2 && j + SPREAD < count && hz < 0.4 * sample_rate_hz;
            let clear = beside(hz, spindle_hz) > 1.5 * line_hz;
            (inside && clear).then(|| VibrationLine {
                shift,
                channels: spectra
                    .iter()
                    .map(|(channel, s, _)| {
                        let power: f64 = s.rest[j - SPREAD..=j + SPREAD].iter().map(|a| a * a).sum();
                        let noise = (2 * SPREAD + 1) as f64 * floor(s).powi(2);
                        (*channel, 2.0 * power.sqrt(), 2.0 * noise.sqrt())
                    })
                    .collect(),
            })
        })
        .collect();
    Some(AsynchronousLines { frequency_hz, lines })
}

/// Amplitude of a line at `hz` in `air`, where the spectrum that it was found in places it to half its lines' distance.
fn in_air<S: Sample>(air: &[S], sample_rate_hz: f64, hz: f64, line_hz: f64) -> f64 {
    // Long air tells frequencies apart that the spectrum does not: a step of half its own lines' distance misses nothing.
    let step = 0.5 * sample_rate_hz / air.len().max(1) as f64;
    let steps = ((0.5 * line_hz / step).ceil().min(MOST_AIR_STEPS) as i64).max(1);
    (-steps..=steps)
        .map(|k| line_amplitude(air, sample_rate_hz, hz + k as f64 * 0.5 * line_hz / steps as f64))
        .fold(0.0, f64::max)
}

/// Is this a multiple of a mains frequency, as nearly as the spectrum tells (its lines lie `line_hz` apart)?
fn mains_beside(hz: f64, line_hz: f64) -> bool {
    line_hz < MAINS_TOLD && from_mains_hz(hz) < 0.5 * line_hz + MAINS_KEPT * hz
}

/// A line of a steady cut that stands above its surroundings.
#[derive(Debug, Clone, PartialEq)]
pub struct StandingLine {
    /// Hz.
    pub frequency_hz: f64,
    /// Distance of the spectrum's lines, Hz: nearer than that nothing is told apart.
    pub resolution_hz: f64,
    /// Recorded channel (index), amplitude, and amplitude at the same frequency in the air (`None` without air); N (N·m).
    pub channels: Vec<(usize, f64, Option<f64>)>,
}

/// Lines kept of a cut, strongest first.
const MOST_LINES: usize = 24;
/// Air samples that tell an amplitude at all.
const LEAST_AIR: usize = 64;

/// All lines that the orders taken out of `spectra` (recorded channel, its spectrum, a stretch of air) leave standing,
/// strongest first. `orders_taken`: the orders of `spindle_hz` are out, and what lies against them is their own unsteadiness.
pub fn standing_lines<S: Sample, A: AsRef<[S]>>(
    spectra: &[(usize, OrderSpectrum, A)],
    sample_rate_hz: f64,
    spindle_hz: f64,
    orders_taken: bool,
) -> Vec<StandingLine> {
    let Some((_, first, _)) = spectra.first() else {
        return Vec::new();
    };
    let (count, line_hz) = (first.rest.len(), first.line_hz);
    if spectra.iter().any(|(_, s, _)| s.rest.len() != count) {
        return Vec::new();
    }
    let floor = |s: &OrderSpectrum| floor(s, sample_rate_hz);
    let strength: Vec<f64> = (0..count)
        .map(|j| {
            let each = spectra.iter().map(|(_, s, _)| (s.rest[j] / floor(s)).powi(2));
            each.fold(0.0, f64::max)
        })
        .collect();
    let beside_order = |j: usize| beside(j as f64 * line_hz, spindle_hz) < 1.5 * line_hz;
    let mut peaks: Vec<usize> = (2..count)
        .filter(|&j| j as f64 * line_hz < 0.45 * sample_rate_hz)
        .filter(|&j| !(orders_taken && beside_order(j)))
        .filter(|&j| {
            let around = j.saturating_sub(1)..(j + 2).min(count);
            strength[around].iter().all(|s| *s <= strength[j])
        })
        .filter(|&j| strength[j] > STANDS_OUT && strength[j] > STANDS_OUT * surroundings(&strength, j))
        .collect();
    peaks.sort_by(|a, b| strength[*b].total_cmp(&strength[*a]));
    let mut kept: Vec<usize> = Vec::new();
    for j in peaks {
        // A line spreads over its neighbours.
        if kept.len() < MOST_LINES && kept.iter().all(|k| k.abs_diff(j) > SPREAD) {
            kept.push(j);
        }
    }
    kept.into_iter()
        .map(|j| {
            let range = j.saturating_sub(2)..(j + 3).min(count);
            let sums = range.clone().map(|k| (strength[k], strength[k] * k as f64));
            let (sum, moment) = sums.fold((0.0, 0.0), |t, s| (t.0 + s.0, t.1 + s.1));
            let frequency_hz = moment / sum * line_hz;
            let of = |(channel, s, air): &(usize, OrderSpectrum, A)| {
                let air = air.as_ref();
                let power: f64 = s.rest[range.clone()].iter().map(|a| a * a).sum();
                let noise = range.len() as f64 * floor(s).powi(2);
                let in_air =
                    (air.len() >= LEAST_AIR).then(|| line_amplitude(air, sample_rate_hz, frequency_hz));
                (*channel, 2.0 * (power - noise).max(0.0).sqrt(), in_air)
            };
            StandingLine {
                frequency_hz,
                resolution_hz: line_hz,
                channels: spectra.iter().map(of).collect(),
            }
        })
        .collect()
}

/// What noise alone shows in a line of a spectrum.
fn floor(spectrum: &OrderSpectrum, sample_rate_hz: f64) -> f64 {
    (spectrum.sample_std * (spectrum.line_hz / sample_rate_hz).sqrt()).max(1e-300)
}

/// Distance of a frequency from the nearest multiple of `spacing`, Hz.
fn beside(hz: f64, spacing: f64) -> f64 {
    (hz / spacing - (hz / spacing).round()).abs() * spacing
}

/// Median of forty lines to each side, never below what noise shows.
fn surroundings(strength: &[f64], j: usize) -> f64 {
    median(&strength[j.saturating_sub(40)..(j + 41).min(strength.len())]).max(1.0)
}

/// Centre of the power around a peak, in lines.
fn centre(strength: &[f64], peak: usize) -> f64 {
    let range = peak.saturating_sub(SPREAD)..(peak + SPREAD + 1).min(strength.len());
    let (mut sum, mut moment) = (0.0, 0.0);
    for j in range {
        sum += strength[j];
        moment += strength[j] * j as f64;
    }
    if sum > 0.0 { moment / sum } else { peak as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_centre_of_a_peak_is_that_of_its_power() {
        let mut strength = vec![0.0; 20];
        (strength[9], strength[10], strength[11]) = (1.0, 4.0, 3.0);
        approx::assert_relative_eq!(
            centre(&strength, 10),
            (9.0 + 40.0 + 33.0) / 8.0,
            max_relative = 1e-12
        );
        // What lies farther off does not count, and an end of the spectrum is no trouble.
        strength[10 + SPREAD + 1] = 100.0;
        approx::assert_relative_eq!(centre(&strength, 10), 82.0 / 8.0, max_relative = 1e-12);
        strength[10 + SPREAD] = 8.0;
        approx::assert_relative_eq!(
            centre(&strength, 10),
            (82.0 + 8.0 * (10 + SPREAD) as f64) / 16.0,
            max_relative = 1e-12
        );
        assert_eq!(centre(&[2.0, 0.0, 0.0], 0), 0.0);
        assert_eq!(centre(&[0.0; 5], 3), 3.0);
    }

    #[test]
    fn the_distance_from_the_next_multiple_has_no_sign() {
        approx::assert_relative_eq!(beside(52.0, 25.0), 2.0, max_relative = 1e-12);
        approx::assert_relative_eq!(beside(48.0, 25.0), 2.0, max_relative = 1e-12);
        approx::assert_relative_eq!(beside(62.5, 25.0), 12.5, max_relative = 1e-12);
    }

    use crate::signal::order_spectrum;
    use rand::SeedableRng;
    use std::f64::consts::TAU;

    const RATE_HZ: f64 = 5000.0;

    /// 1.2 s of a channel at 50 Hz with noise of 1 N, tooth passing of 60 N at 100 Hz and lines (Hz, N); as many of noise and `air`.
    fn seen(seed: u64, lines: &[(f64, f64)], air: &[(f64, f64)]) -> (usize, OrderSpectrum, Vec<f64>) {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut made = |lines: &[(f64, f64)]| -> Vec<f64> {
            (0..6000)
                .map(|i| {
                    let t = i as f64 / RATE_HZ;
                    let sum: f64 = lines.iter().map(|(hz, a)| a * (TAU * hz * t + 0.3).sin()).sum();
                    sum + crate::statistics::nearly_normal(&mut random)
                })
                .collect()
        };
        let cut: Vec<(f64, f64)> = lines
            .iter()
            .copied()
            .chain([(100.0, 60.0), (200.0, 20.0)])
            .collect();
        let spectrum = order_spectrum(&made(&cut), RATE_HZ, 100.0, 40).unwrap();
        (0, spectrum, made(air))
    }

    /// Chatter at 430 Hz with lines a tooth passing to either side, as a limit cycle has them (Insperger et al. 2003).
    #[test]
    fn chatter_is_found_with_its_side_lines_and_their_sizes() {
        let chatter = [(430.0, 20.0), (330.0, 8.0), (530.0, 5.0)];
        let mut other = seen(2, &chatter, &[]);
        other.0 = 1;
        let found = find_vibration(&[seen(1, &chatter, &[]), other], RATE_HZ, 50.0, 2).unwrap();
        assert!((found.frequency_hz - 430.0).abs() < 0.3, "{}", found.frequency_hz);
        assert_eq!(
            found.lines.iter().map(|l| l.shift).collect::<Vec<_>>(),
            [-2, -1, 0, 1, 2]
        );
        for (line, size) in found.lines.iter().zip([0.0, 8.0, 20.0, 5.0, 0.0]) {
            assert_eq!(line.channels.iter().map(|c| c.0).collect::<Vec<_>>(), [0, 1]);
            for (_, amplitude, noise) in &line.channels {
                // Nine lines of noise of 1 N over 6000 samples: 2 · √(9 / 6000) N.
                assert!(
                    (noise / (2.0 * (9.0 / 6000f64).sqrt()) - 1.0).abs() < 0.1,
                    "{noise}"
                );
                let above = (amplitude * amplitude - noise * noise).max(0.0).sqrt();
                assert!(
                    (above - size).abs() < 0.03 * size + 0.15,
                    "{amplitude} for {size}"
                );
            }
        }
        assert_eq!(found.value_count(), 11);
    }

    /// No chatter: nothing there, a hum that the air shows as well, modulation next to the tooth passing, an order of the turn, what
    /// lies so high that the sampling cannot hold it, and orders beyond half the sampling rate that fold back.
    #[test]
    fn what_is_no_vibration_of_the_cut_is_left() {
        let found = |lines: &[(f64, f64)], air: &[(f64, f64)]| {
            find_vibration(&[seen(3, lines, air)], RATE_HZ, 50.0, 2).map(|v| v.frequency_hz)
        };
        assert_eq!(found(&[], &[]), None);
        assert!(found(&[(431.0, 6.0)], &[]).is_some());
        assert_eq!(found(&[(430.0, 6.0)], &[(430.0, 6.0)]), None);
        // A fifth of it is in the air: the cut makes the rest.
        assert!(found(&[(431.0, 6.0)], &[(431.0, 1.2)]).is_some());
        assert_eq!(found(&[(409.0, 6.0)], &[]), None);
        assert!(found(&[(417.0, 6.0)], &[]).is_some());
        assert_eq!(found(&[(450.0, 6.0)], &[]), None);
        assert_eq!(found(&[(2363.0, 6.0)], &[]), None);
        assert!(found(&[(2163.0, 6.0)], &[]).is_some());
        // Noise of 1 N over 6000 samples has 0.013 N on a line: thirty times its power are 0.14 N of amplitude.
        assert_eq!(found(&[(430.0, 0.11)], &[]), None);
        assert!(found(&[(430.0, 0.19)], &[]).is_some());
    }

    /// Hum between two lines of the spectrum, in air so long that it tells the two apart, and hum that grows under load; a line there
    /// that the air knows nothing of is a vibration, and without air nobody can tell.
    #[test]
    fn mains_hum_is_no_vibration() {
        let hum = |cut: f64, in_air: f64, hz: f64, air_samples: usize| {
            let (channel, spectrum, _) = seen(3, &[(hz, cut)], &[]);
            let air: Vec<f64> = (0..air_samples)
                .map(|i| in_air * (TAU * hz * i as f64 / RATE_HZ).sin() + 0.001 * (i as f64 * 1.7).sin())
                .collect();
            find_vibration(&[(channel, spectrum, air)], RATE_HZ, 47.3, 2).map(|v| v.frequency_hz)
        };
        // Any hum: 430.4 Hz lies between the lines of 1.2 s.
        assert_eq!(hum(6.0, 6.0, 430.4, 40_000), None);
        assert!(hum(6.0, 1.0, 430.4, 40_000).is_some());
        // Of the mains: six times as much in the cut.
        for hz in [240.0, 360.0, 420.0] {
            assert_eq!(hum(6.0, 1.0, hz, 40_000), None, "{hz}");
            assert!(hum(6.0, 0.0, hz, 40_000).is_some(), "{hz}");
            assert_eq!(hum(6.0, 1.0, hz, 0), None, "{hz}");
        }
        assert!(hum(6.0, 0.0, 431.0, 0).is_some());
    }

    /// At 51 Hz and 5000 Hz of sampling, order 91 (4641 Hz) stands at 359 Hz: a fold, no vibration.
    #[test]
    fn an_order_that_folds_back_is_no_vibration() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        let samples: Vec<f64> = (0..6000)
            .map(|i| {
                let t = i as f64 / RATE_HZ;
                20.0 * (TAU * 91.0 * 51.0 * t).sin() + crate::statistics::nearly_normal(&mut random)
            })
            .collect();
        let spectrum = order_spectrum(&samples, RATE_HZ, RATE_HZ / 51.0, 40).unwrap();
        let own = [(0, spectrum, Vec::<f64>::new())];
        assert_eq!(find_vibration(&own, RATE_HZ, 51.0, 2), None);
        // At a speed that has no order there it is one.
        assert!(find_vibration(&own, RATE_HZ, 47.3, 2).is_some());
    }

    #[test]
    fn standing_lines_have_their_size_and_what_the_air_has_of_it() {
        let own = seen(5, &[(431.0, 20.0), (837.0, 5.0), (2363.0, 9.0)], &[(837.0, 5.0)]);
        let lines = standing_lines(std::slice::from_ref(&own), RATE_HZ, 50.0, true);
        let found: Vec<f64> = lines.iter().map(|l| l.frequency_hz).collect();
        assert_eq!(found.len(), 2, "{found:?}");
        for (line, (hz, size, air)) in lines.iter().zip([(431.0, 20.0, 0.0), (837.0, 5.0, 5.0)]) {
            assert!((line.frequency_hz - hz).abs() < 0.3);
            assert!((line.resolution_hz - RATE_HZ / 6000.0).abs() < 1e-9);
            let (channel, amplitude, in_air) = line.channels[0];
            assert_eq!(channel, 0);
            // A line between two of the spectrum leaves some of its power beyond its neighbours.
            assert!((amplitude / size - 1.0).abs() < 0.06, "{amplitude} for {size}");
            assert!((in_air.unwrap() - air).abs() < 0.3, "{in_air:?}");
        }
        // The orders left in, tooth passing stands first; without air nothing is said of it.
        let (_, spectrum, _) = seen(5, &[(431.0, 20.0)], &[]);
        let mut with_orders = spectrum;
        with_orders.rest[120] = 30.0;
        let lines = standing_lines(&[(0, with_orders.clone(), vec![0.0; 60])], RATE_HZ, 50.0, false);
        assert!((lines[0].frequency_hz - 100.0).abs() < 0.1);
        assert!((lines[0].channels[0].1 - 60.0).abs() < 0.1);
        assert_eq!(lines[0].channels[0].2, None);
        let lines = standing_lines(&[(0, with_orders, Vec::<f64>::new())], RATE_HZ, 50.0, true);
        assert_eq!(lines.len(), 1);
    }
}
