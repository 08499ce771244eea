//! One channel of one force record as numbers with their noise.

use std::ops::Range;

use num_complex::Complex64;

use crate::identify::forces::asynchronous_lines::AsynchronousLines;
use crate::identify::forces::cutting_windows::Windows;
use crate::signal::{OrderSpectrum, mean_between};

/// One recorded channel of one cut.
#[derive(Debug, Clone)]
pub struct ForceChannel {
    /// Orders 1..=K of the steady waveform, N (N·m); angle zero at the window's first sample.
    pub orders: Vec<Complex64>,
    /// Root of E|noise|² of each.
    pub order_std: Vec<f64>,
    /// Mean of each block of the record, N (N·m), drift and all.
    pub level: Vec<f64>,
    /// Standard deviation of each level, N (N·m).
    pub level_std: Vec<f64>,
    /// ∫ (recorded − straight zero line) dt up to the middle of each block: what a leaking amplifier loses times its
    /// time constant.
    pub integral: Vec<f64>,
}

/// White noise of a stretch of air: differences of neighbouring samples know no drift and little hum.
pub(crate) fn sample_std(samples: &[f64]) -> f64 {
    let squares: f64 = samples.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
    (0.5 * squares / samples.len().saturating_sub(1).max(1) as f64).sqrt()
}

#[allow(clippy::too_many_arguments)]
pub(crate) fn force_channel(
    values: &[f64],
    zeroed: &[f64],
    rate: f64,
    window: &Windows,
    spectrum: &OrderSpectrum,
    air_std: f64,
    hum: &[(f64, f64)],
    spindle_hz: f64,
) -> Option<ForceChannel> {
    let steady_s = window.steady.len() as f64 / rate;
    // What a line of mains hum puts into a mean over a stretch of time, at `off_hz` from the line; squared.
    let leak = |amplitude: f64, off_hz: f64, length_s: f64| {
        let x = std::f64::consts::PI * off_hz * length_s;
        let sinc = if x.abs() < 1e-6 { 1.0 } else { x.sin() / x };
        0.5 * (amplitude * sinc).powi(2)
    };
    let mut integral = Vec::with_capacity(values.len() + 1);
    let mut sum = 0.0;
    for v in zeroed {
        integral.push(sum);
        sum += v / rate;
    }
    integral.push(sum);
    let (mut level, mut level_std, mut lost) = (Vec::new(), Vec::new(), Vec::new());
    for (b, [from, to]) in window.blocks.iter().enumerate() {
        let std = if window.is_cut(b) {
            spectrum.sample_std.max(air_std)
        } else {
            air_std.max(1e-12)
        };
        let mut hum: f64 = hum.iter().map(|(hz, a)| leak(*a, *hz, (to - from) / rate)).sum();
        if window.is_cut(b) {
            hum = hum.max(lines_in_mean(spectrum, rate, (to - from) / rate));
        }
        level.push(mean_between(values, *from, *to));
        level_std.push((std * std / (to - from) + hum).sqrt());
        lost.push(mean_between(&integral, *from + 0.5, *to + 0.5));
    }
    let order_std = spectrum
        .std
        .iter()
        .enumerate()
        .map(|(k, std)| {
            let hz = (k + 1) as f64 * spindle_hz;
            // |coefficient|² of a line is a quarter of its amplitude's square.
            let hum: f64 = hum
                .iter()
                .map(|(line, a)| 0.5 * leak(*a, hz - line, steady_s))
                .sum();
            (std * std + hum).sqrt()
        })
        .collect();
    let channel = ForceChannel {
        orders: spectrum.coefficient.clone(),
        order_std,
        level,
        level_std,
        integral: lost,
    };
    let sound = |v: &[f64]| v.iter().all(|x| x.is_finite());
    let positive = |v: &[f64]| v.iter().all(|x| *x > 0.0);
    (sound(&channel.level)
        && positive(&channel.level_std)
        && positive(&channel.order_std)
        && channel.orders.iter().all(|c| c.is_finite()))
    .then_some(channel)
}

/// A limit cycle's amplitude wanders by about this share while it lasts.
const VIBRATION_WANDERS: f64 = 0.25;

/// Where a tooth leaves the cut in every swing, the vibration changes the orders of tooth passing as well, by about what it
/// puts on the lines beside its own; and it does so no more steadily than its amplitude is.
pub(crate) fn widen_for_vibration(
    channel: &mut ForceChannel,
    vibration: &AsynchronousLines,
    index: usize,
    teeth: usize,
    steady: Range<usize>,
) {
    let beside: Vec<f64> = vibration
        .lines
        .iter()
        .filter(|l| l.shift != 0)
        .flat_map(|l| l.channels.iter().filter(|c| c.0 == index))
        .map(|(_, amplitude, noise)| (amplitude * amplitude - noise * noise).max(0.0))
        .collect();
    if beside.is_empty() {
        return;
    }
    // Mean square amplitude of the lines; a coefficient is half an amplitude.
    let power = beside.iter().sum::<f64>() / beside.len() as f64;
    let variance = VIBRATION_WANDERS.powi(2) * power / 4.0;
    let widen = |std: &mut f64| *std = (*std * *std + variance).sqrt();
    channel
        .order_std
        .iter_mut()
        .skip(teeth - 1)
        .step_by(teeth)
        .for_each(widen);
    channel.level_std[steady].iter_mut().for_each(widen);
}

/// Variance that lines above the noise (vibration, hum) leave in a mean over `length_s`. Slower than that is no line but a
/// level that changes, which the model has to explain.
pub(crate) fn lines_in_mean(spectrum: &OrderSpectrum, rate: f64, length_s: f64) -> f64 {
    let floor = spectrum.sample_std.powi(2) * spectrum.line_hz / rate;
    let first = (1.0 / (length_s * spectrum.line_hz)).ceil() as usize;
    spectrum
        .rest
        .iter()
        .enumerate()
        .skip(first.max(1))
        .filter(|(_, a)| **a * **a > 10.0 * floor)
        .map(|(j, a)| {
            let x = std::f64::consts::PI * j as f64 * spectrum.line_hz * length_s;
            2.0 * (a * x.sin() / x).powi(2)
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

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
}
