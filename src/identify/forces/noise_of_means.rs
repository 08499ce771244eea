//! How far noise that is not white moves the mean over a stretch of time.
//!
//! The mean over T hears what is slower than about 1/T and hardly anything else. An amplifier's low-pass takes from what is quick, a
//! table that resonates adds to it: neither says anything about means, but both are most of what a record shows of its noise.

use realfft::RealFftPlanner;

use crate::data::Sample;
use crate::signal::{OrderSpectrum, line, median};

/// Lines that speak for a mean over T reach from 1/T to this many times that, …
const REACH: f64 = 4.0;
/// … or so far that there are this many.
const ENOUGH_LINES: usize = 24;
/// Fewer say nothing.
const FEWEST_LINES: usize = 12;
/// The power of slow lines must stand this many of its own standard errors above the white noise to count: else that is known better.
const SURE: f64 = 2.5;
/// Relative standard error of a median of `n` powers of noise, times √n: 1/ln 2.
const OF_MEDIAN: f64 = std::f64::consts::LOG2_E;
/// A line that is this near to an order is the order's own: it was taken out.
const OWN_LINE: f64 = 0.75;

/// The standard deviation σ for which means over `length_s` scatter by σ/√n, n their samples, where `spectrum` is what a steady cut leaves
/// without its orders: that of its samples if the noise is white, more if it is stronger at low frequencies. N (N·m).
pub(crate) fn of_cut(spectrum: &OrderSpectrum, spindle_hz: f64, length_s: f64) -> f64 {
    let power = |j: usize| spectrum.rest[j] * spectrum.rest[j];
    let all: Vec<f64> = (0..spectrum.rest.len()).map(power).collect();
    let usual = median(&all);
    let is_own = |j: usize| {
        let order = j as f64 * spectrum.line_hz / spindle_hz;
        (order - order.round()).abs() * spindle_hz < OWN_LINE * spectrum.line_hz
    };
    let slow = slow_lines(spectrum.line_hz, length_s, all.len(), |j| !is_own(j));
    let slow: Vec<f64> = slow.map(|j| all[j]).collect();
    spectrum.sample_std * excess(&slow, usual).sqrt()
}

/// The same for a stretch without cutting; a straight drift is none.
pub(crate) fn of_air<S: Sample>(samples: &[S], sample_rate_hz: f64, length_s: f64) -> f64 {
    let (count, white_std) = (samples.len(), sample_std(samples));
    if count < 4 * FEWEST_LINES {
        return white_std;
    }
    let index = || (0..count).map(|i| i as f64);
    let (mean, slope, centre) = line(index(), samples.iter().map(|v| v.value()));
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(count);
    let drift = |i: usize| mean + slope * (i as f64 - centre);
    let mut values: Vec<f64> = (0..count).map(|i| samples[i].value() - drift(i)).collect();
    let mut spectrum = transform.make_output_vec();
    if transform.process(&mut values, &mut spectrum).is_err() {
        return white_std;
    }
    let slow = slow_lines(sample_rate_hz / count as f64, length_s, spectrum.len(), |_| true);
    let slow: Vec<f64> = slow.map(|j| spectrum[j].norm_sqr()).collect();
    // White noise has E|X|² = n σ², and ln 2 of that is the median.
    let white = std::f64::consts::LN_2 * count as f64 * white_std * white_std;
    white_std * excess(&slow, white).sqrt()
}

/// White noise of a stretch of air: differences of neighbouring samples know no drift and little hum.
fn sample_std<S: Sample>(samples: &[S]) -> f64 {
    let squares: f64 = samples
        .windows(2)
        .map(|w| (w[1].value() - w[0].value()).powi(2))
        .sum();
    (0.5 * squares / samples.len().saturating_sub(1).max(1) as f64).sqrt()
}

/// Lines, `line_hz` apart, that speak for means over `length_s`.
fn slow_lines(
    line_hz: f64,
    length_s: f64,
    count: usize,
    counts: impl Fn(usize) -> bool,
) -> impl Iterator<Item = usize> {
    let first = (1.0 / (length_s * line_hz)).ceil().max(1.0) as usize;
    let last = (REACH / (length_s * line_hz)) as usize;
    (first..count)
        .filter(move |j| counts(*j))
        .enumerate()
        .take_while(move |(k, j)| *k < ENOUGH_LINES || *j <= last)
        .map(|(_, j)| j)
}

/// Power of the `slow` lines over the `usual`, both medians; 1 where it is not surely more.
fn excess(slow: &[f64], usual: f64) -> f64 {
    // A constant channel has no noise.
    if slow.len() < FEWEST_LINES || !(usual > 0.0) {
        return 1.0;
    }
    let ratio = median(slow) / usual;
    let sure = 1.0 + SURE * OF_MEDIAN / (slow.len() as f64).sqrt();
    if ratio > sure { ratio } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::order_spectrum;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    const RATE_HZ: f64 = 5000.0;
    const PER_TURN: f64 = 137.3;

    /// Neighbours of white noise differ by √2 σ; a slope of a fiftieth of σ a sample hides nothing.
    #[test]
    fn the_noise_of_air_is_known_whatever_drifts_below_it() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let samples: Vec<f64> = (0..40_000)
            .map(|i| {
                let normal = crate::statistics::nearly_normal(&mut random);
                3.0 * normal + 0.06 * f64::from(i)
            })
            .collect();
        approx::assert_relative_eq!(sample_std(&samples), 3.0, max_relative = 0.02);
        assert_eq!(sample_std(&[1.0]), 0.0);
    }

    /// Noise of 2 N per sample through a first-order low-pass.
    fn noise(seed: u64, corner_hz: f64, count: usize) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let keep = (-std::f64::consts::TAU * corner_hz / RATE_HZ).exp();
        let mut value = 0.0;
        (0..count + 2000)
            .map(|_| {
                let new: f64 = 2.0 * crate::statistics::nearly_normal(&mut random);
                value = keep * value + (1.0 - keep) * new;
                value
            })
            .skip(2000)
            .collect()
    }

    /// Scatter of means over `n` samples, times √n.
    fn scatter(samples: &[f64], n: usize) -> f64 {
        let means: Vec<f64> = samples
            .chunks_exact(n)
            .map(|c| c.iter().sum::<f64>() / n as f64)
            .collect();
        let squares: f64 = means.iter().map(|m| m * m).sum();
        (squares / means.len() as f64 * n as f64).sqrt()
    }

    #[test]
    fn means_of_filtered_noise_scatter_as_far_as_is_said() {
        let n = (4.0 * PER_TURN) as usize;
        let length_s = n as f64 / RATE_HZ;
        for corner_hz in [1e6, 300.0, 80.0] {
            let truth = scatter(&noise(1, corner_hz, 1_000_000), n);
            let (mut cut, mut air) = (Vec::new(), Vec::new());
            for seed in 2..32 {
                let samples = noise(seed, corner_hz, 8000);
                let spectrum = order_spectrum(&samples, RATE_HZ, PER_TURN, 40).unwrap();
                cut.push(of_cut(&spectrum, RATE_HZ / PER_TURN, length_s));
                air.push(of_air(&samples, RATE_HZ, length_s));
            }
            for said in [cut, air] {
                let mean = said.iter().sum::<f64>() / said.len() as f64;
                assert!(
                    (mean / truth - 1.0).abs() < 0.1,
                    "{corner_hz} Hz: {mean} for {truth}"
                );
            }
        }
    }
}
