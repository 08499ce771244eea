//! Is the record made at the spindle speed the campaign says? Its spectrum must hold the tooth-passing line.

use std::f64::consts::TAU;

use realfft::RealFftPlanner;

use super::blocks::median;

/// What the spectrum of a steady cut says about the spindle speed.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct ToothLine {
    /// Strongest line on a multiple of the nominal spindle frequency, over the noise floor (amplitudes).
    pub nominal_to_noise: f64,
    /// Strongest line anywhere, Hz.
    pub strongest_hz: f64,
    /// Its amplitude over the noise floor.
    pub strongest_to_noise: f64,
    /// The strongest line, or that of which it is a harmonic, Hz: tooth passing.
    pub tooth_hz: f64,
}

impl ToothLine {
    /// A clear line exists, and none of the spindle's own multiples rises from the noise and the skirts of that
    /// line. (Chatter, too, is a
    /// clear line off the comb, but next to it.)
    pub fn speed_is_doubtful(&self) -> bool {
        self.strongest_to_noise > 30.0 && self.nominal_to_noise < (0.03 * self.strongest_to_noise).max(8.0)
    }
}

/// Longest transform; a longer record is looked at from its start.
const MAX_SAMPLES: usize = 1 << 17;
/// A line of this part of the strongest, at a fraction of its frequency, is what the strongest is a harmonic of. (What a
/// runout puts at once per revolution is weaker where the teeth cut at all.)
const FUNDAMENTAL: f64 = 0.3;
/// Mains hum and its first odd harmonic are no tooth.
const MAINS_HZ: [f64; 4] = [50.0, 60.0, 150.0, 180.0];

/// Looks for lines in the Hann-windowed amplitude spectrum of `samples` (steady cut, drift compensated, or not:
/// a line is taken out). `None` where the record is shorter than 8 revolutions, or has no spectrum.
pub fn tooth_line(samples: &[f64], sample_rate_hz: f64, spindle_hz: f64, teeth: usize) -> Option<ToothLine> {
    let samples = &samples[..samples.len().min(MAX_SAMPLES)];
    let n = samples.len();
    let resolution_hz = sample_rate_hz / n.max(1) as f64;
    let usable = spindle_hz.is_finite() && sample_rate_hz.is_finite() && spindle_hz > 8.0 * resolution_hz;
    if n < 64 || !usable {
        return None;
    }
    let index = || (0..n).map(|i| i as f64);
    let (mean, slope, centre) = super::blocks::line(index(), samples.iter().copied());
    let mut input: Vec<f64> = samples
        .iter()
        .enumerate()
        .map(|(i, v)| {
            let hann = 0.5 - 0.5 * (TAU * i as f64 / n as f64).cos();
            hann * (v - mean - slope * (i as f64 - centre))
        })
        .collect();
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(n);
    let mut spectrum = transform.make_output_vec();
    transform.process(&mut input, &mut spectrum).ok()?;
    let amplitude: Vec<f64> = spectrum.iter().map(|c| c.norm()).collect();
    let noise = median(&amplitude);
    if !noise.is_finite() || noise <= 0.0 {
        return None;
    }
    let peak = |hz: f64, half_width_hz: f64| -> f64 {
        let from = ((hz - half_width_hz) / resolution_hz).round().max(0.0) as usize;
        let to = ((hz + half_width_hz) / resolution_hz).round().max(0.0) as usize;
        amplitude
            .get(from..(to + 1).min(amplitude.len()))
            .map_or(0.0, |part| part.iter().copied().fold(0.0, f64::max))
    };
    // Nominal speeds are good to about half a percent; the window's own line is four bins wide.
    let nominal = (1..=teeth.max(1))
        .chain([2 * teeth.max(1)])
        .map(|k| k as f64 * spindle_hz)
        .filter(|hz| MAINS_HZ.iter().all(|m| (m - hz).abs() > 4.0 * resolution_hz))
        .map(|hz| peak(hz, (0.005 * hz).max(1.5 * resolution_hz).min(0.2 * spindle_hz)))
        .fold(0.0, f64::max);
    // Below half a turn there is only drift.
    let first = (0.5 * spindle_hz / resolution_hz).ceil() as usize;
    let (at, strongest) = amplitude
        .iter()
        .enumerate()
        .skip(first)
        .filter(|(i, _)| {
            let hz = *i as f64 * resolution_hz;
            MAINS_HZ.iter().all(|m| (m - hz).abs() > 4.0 * resolution_hz)
        })
        .max_by(|a, b| a.1.total_cmp(b.1))?;
    let strongest_hz = (at as f64 + peak_shift(&amplitude, at)) * resolution_hz;
    let is_harmonic = |m: &usize| {
        let hz = strongest_hz / *m as f64;
        hz > 0.5 * spindle_hz && peak(hz, 1.5 * resolution_hz) > FUNDAMENTAL * strongest
    };
    let harmonic = (2..=4).rev().find(is_harmonic).unwrap_or(1);
    Some(ToothLine {
        nominal_to_noise: nominal / noise,
        strongest_hz,
        strongest_to_noise: strongest / noise,
        tooth_hz: strongest_hz / harmonic as f64,
    })
}

/// Where a peak lies between lines: the top of the parabola through the logarithms of three neighbours, in lines.
fn peak_shift(amplitude: &[f64], at: usize) -> f64 {
    let log = |i: usize| amplitude.get(i).map(|a| a.max(f64::MIN_POSITIVE).ln());
    let (Some(left), Some(top), Some(right)) = (at.checked_sub(1).and_then(log), log(at), log(at + 1)) else {
        return 0.0;
    };
    let bend = left - 2.0 * top + right;
    if bend < 0.0 {
        (0.5 * (left - right) / bend).clamp(-0.5, 0.5)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn cut(tooth_hz: f64, hum: f64) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        (0..6000)
            .map(|i| {
                let t = i as f64 / 5000.0;
                let noise: f64 = rng.random_range(-10.0..10.0);
                100.0 + 30.0 * (TAU * tooth_hz * t).sin() + hum * (TAU * 50.0 * t).sin() + 8.0 * t + noise
            })
            .collect()
    }

    #[test]
    fn the_right_speed_passes_and_a_wrong_one_is_told_with_its_line() {
        let right = tooth_line(&cut(120.0, 5.0), 5000.0, 20.0, 6).unwrap();
        assert!(!right.speed_is_doubtful(), "{right:?}");
        // Off by 7 %: no line on the nominal comb.
        let wrong = tooth_line(&cut(128.9, 5.0), 5000.0, 20.0, 6).unwrap();
        assert!(wrong.speed_is_doubtful(), "{wrong:?}");
        assert!((wrong.strongest_hz - 128.9).abs() < 0.1);
    }

    #[test]
    fn noise_hum_and_silence_accuse_nobody() {
        let hum = tooth_line(&cut(0.0, 50.0), 5000.0, 20.0, 6).unwrap();
        assert!(!hum.speed_is_doubtful(), "{hum:?}");
        assert_eq!(tooth_line(&[0.0; 5000], 5000.0, 20.0, 6), None);
        assert_eq!(tooth_line(&[1.0; 10], 5000.0, 20.0, 6), None);
        assert_eq!(tooth_line(&cut(120.0, 0.0), 5000.0, f64::NAN, 6), None);
    }
}
