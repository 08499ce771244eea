//! A record cut into blocks of whole tool revolutions, and order statistics.

use crate::data::Sample;
use crate::statistics::quantile;

/// What turns, and how the record is sampled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spindle {
    /// At the stated speed; not a whole number in general.
    pub samples_per_revolution: f64,
    /// Samples a second, Hz.
    pub sample_rate_hz: f64,
    /// Number of teeth (lips).
    pub teeth: usize,
}

/// Mean and fluctuation of each consecutive block of a channel.
#[derive(Debug, Clone, PartialEq)]
pub struct SignalBlocks {
    /// Mean of each block, in the unit of the channel.
    pub mean: Vec<f64>,
    /// Standard deviation within each block less what the drift from block to block makes, in the unit of the
    /// channel.
    pub std_dev: Vec<f64>,
    /// Block length in samples; not a whole number in general.
    pub samples_per_block: f64,
}

impl SignalBlocks {
    /// Cuts `samples` into as many blocks as there are, their edges rounded to samples; a rest at the end is left out.
    pub fn new<S: Sample>(samples: &[S], samples_per_block: f64) -> SignalBlocks {
        SignalBlocks::of(samples.len(), |i| samples[i].value(), samples_per_block)
    }

    /// The same of `samples` values that `value` makes of their index.
    pub fn of(samples: usize, value: impl Fn(usize) -> f64, samples_per_block: f64) -> SignalBlocks {
        let count = if samples_per_block >= 1.0 {
            ((samples as f64 + 0.5 - 1e-9) / samples_per_block).floor() as usize
        } else {
            0
        };
        let edge = |i: usize| ((i as f64 * samples_per_block).round() as usize).min(samples);
        let (mut mean, mut std_dev) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for i in 0..count {
            let block = || (edge(i)..edge(i + 1)).map(&value);
            let n = block().len().max(1) as f64;
            let m = block().sum::<f64>() / n;
            mean.push(m);
            std_dev.push((block().map(|v| (v - m).powi(2)).sum::<f64>() / n).sqrt());
        }
        // A ramp of height d within a block has variance d²/12.
        for i in 1..count.saturating_sub(1) {
            let ramp = 0.5 * (mean[i + 1] - mean[i - 1]);
            let variance = std_dev[i] * std_dev[i];
            std_dev[i] = (variance - ramp * ramp / 12.0).max(0.01 * variance).sqrt();
        }
        SignalBlocks {
            mean,
            std_dev,
            samples_per_block,
        }
    }

    /// Number of blocks.
    pub fn len(&self) -> usize {
        self.mean.len()
    }

    /// True where the record is shorter than one block.
    pub fn is_empty(&self) -> bool {
        self.mean.is_empty()
    }
}

/// Arithmetic mean; 0 of nothing.
pub fn mean<S: Sample>(values: &[S]) -> f64 {
    values.iter().map(|v| v.value()).sum::<f64>() / values.len().max(1) as f64
}

/// Middle of the sorted values, interpolated; 0 of nothing.
pub fn median(values: &[f64]) -> f64 {
    quantile(values.iter().copied(), 0.5).unwrap_or(0.0)
}

/// Standard deviation from the median absolute deviation (normal consistency factor 1.4826).
pub(crate) fn robust_std(values: &[f64]) -> f64 {
    let centre = median(values);
    1.4826 * quantile(values.iter().map(|v| (v - centre).abs()), 0.5).unwrap_or(0.0)
}

/// Straight line through points (x, y) by least squares: (value at mean x, slope, mean x).
/// A single point, or all points at one x, give slope 0.
pub(crate) fn line(
    x: impl Iterator<Item = f64> + Clone,
    y: impl Iterator<Item = f64> + Clone,
) -> (f64, f64, f64) {
    let n = x.clone().count().max(1) as f64;
    let x_mean = x.clone().sum::<f64>() / n;
    let y_mean = y.clone().sum::<f64>() / n;
    let sxx: f64 = x.clone().map(|v| (v - x_mean).powi(2)).sum();
    let sxy: f64 = x.zip(y).map(|(a, b)| (a - x_mean) * (b - y_mean)).sum();
    let slope = if sxx > 0.0 { sxy / sxx } else { 0.0 };
    (y_mean, slope, x_mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_of_a_sine_over_whole_periods_have_its_mean_and_rms() {
        let period = 33.3;
        let samples: Vec<f64> = (0..3330)
            .map(|i| 5.0 + 2.0 * (std::f64::consts::TAU * i as f64 / period).sin())
            .collect();
        let blocks = SignalBlocks::new(&samples, period);
        assert_eq!(blocks.len(), 100);
        assert!(blocks.mean.iter().all(|m| (m - 5.0).abs() < 0.05));
        assert!(blocks.std_dev.iter().all(|s| (s - 2f64.sqrt()).abs() < 0.05));
    }

    #[test]
    fn a_ramp_is_no_fluctuation() {
        let blocks = SignalBlocks::new(&(0..1000).map(|i| i as f64).collect::<Vec<_>>(), 100.0);
        assert!(
            blocks.std_dev[1..9]
                .iter()
                .all(|s| *s < 0.4 * 100.0 / 12f64.sqrt())
        );
    }

    #[test]
    fn quantiles_interpolate_and_empty_input_is_harmless() {
        assert_eq!(median(&[]), 0.0);
        assert!(SignalBlocks::new::<f64>(&[], 10.0).is_empty());
        assert!(SignalBlocks::new(&[1.0], 0.0).is_empty());
    }

    #[test]
    fn a_line_is_found_exactly() {
        let x = [1.0, 2.0, 4.0];
        let (y, slope, at) = line(x.iter().copied(), x.iter().map(|v| 3.0 * v + 1.0));
        assert!((y - (3.0 * at + 1.0)).abs() < 1e-12 && (slope - 3.0).abs() < 1e-12);
    }
}
