//! One channel of one force record as numbers with their noise.

use std::ops::Range;

use num_complex::Complex64;

use crate::data::Sample;
use crate::identify::forces::asynchronous_lines::AsynchronousLines;
use crate::identify::forces::cutting_windows::Windows;
use crate::identify::forces::noise_of_means;
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

impl ForceChannel {
    /// Recorded with `factor` times the gain.
    pub(crate) fn scale(&mut self, factor: f64) {
        self.orders.iter_mut().for_each(|line| *line *= factor);
        for values in [&mut self.level, &mut self.integral] {
            values.iter_mut().for_each(|value| *value *= factor);
        }
        self.widen(factor.abs());
    }

    /// Known `factor` times less well.
    pub(crate) fn widen(&mut self, factor: f64) {
        for std in self.order_std.iter_mut().chain(&mut self.level_std) {
            *std *= factor;
        }
    }
}

#[allow(clippy::too_many_arguments)]
pub(crate) fn force_channel<S: Sample>(
    values: &[S],
    zero: impl Fn(usize) -> f64,
    rate: f64,
    window: &Windows,
    spectrum: &OrderSpectrum,
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
    // Blocks of a kind are of one length.
    let block_s = |is_cut: bool| {
        let mut blocks = window.blocks.iter().enumerate();
        let first = blocks.find(|(b, _)| window.is_cut(*b) == is_cut);
        first.map_or(steady_s, |(_, [from, to])| (to - from) / rate)
    };
    let air_std = window
        .air()
        .map(|r| noise_of_means::of_air(&values[r], rate, block_s(false)))
        .fold(0.0, f64::max);
    let cut_std = noise_of_means::of_cut(spectrum, spindle_hz, block_s(true)).max(air_std);
    let lost = mean_integrals(values, zero, rate, &window.blocks);
    let (mut level, mut level_std) = (Vec::new(), Vec::new());
    for (b, [from, to]) in window.blocks.iter().enumerate() {
        let std = if window.is_cut(b) {
            cut_std
        } else {
            air_std.max(1e-12)
        };
        let mut hum: f64 = hum.iter().map(|(hz, a)| leak(*a, *hz, (to - from) / rate)).sum();
        if window.is_cut(b) {
            hum = hum.max(lines_in_mean(spectrum, rate, (to - from) / rate));
        }
        level.push(mean_between(values, *from, *to));
        level_std.push((std * std / (to - from) + hum).sqrt());
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

/// Mean over each of the `blocks` (ascending, apart from one another) of ∫ (value − zero) dt up to the middle of each of its samples.
fn mean_integrals<S: Sample>(
    values: &[S],
    zero: impl Fn(usize) -> f64,
    rate: f64,
    blocks: &[[f64; 2]],
) -> Vec<f64> {
    let mut means = Vec::with_capacity(blocks.len());
    // ∫ up to sample `at`.
    let (mut at, mut integral) = (0, 0.0);
    for [from, to] in blocks {
        let (from, to) = (from + 0.5, (to + 0.5).min(values.len() as f64 + 1.0));
        let mut sum = 0.0;
        while at <= values.len() && (at as f64) < to {
            sum += integral * (to.min(at as f64 + 1.0) - from.max(at as f64)).max(0.0);
            // A sample that the next block begins in counts there too.
            if at as f64 + 1.0 > to {
                break;
            }
            integral += values.get(at).map_or(0.0, |v| (v.value() - zero(at)) / rate);
            at += 1;
        }
        means.push(if to > from { sum / (to - from) } else { 0.0 });
    }
    means
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

    #[test]
    fn integrals_are_those_of_all_samples_kept() {
        let values: Vec<f64> = (0..500).map(|i| (0.1 * f64::from(i)).sin() + 0.3).collect();
        let zero = |i: usize| 0.001 * i as f64;
        let mut integral = vec![0.0];
        for (i, v) in values.iter().enumerate() {
            integral.push(integral[i] + (v - zero(i)) / 50.0);
        }
        let blocks = [[0.0, 33.3], [33.3, 66.6], [120.2, 153.5], [466.7, 500.0]];
        let means = mean_integrals(&values, zero, 50.0, &blocks);
        for ([from, to], mean) in blocks.iter().zip(means) {
            let expected = mean_between(&integral, from + 0.5, to + 0.5);
            assert_relative_eq!(mean, expected, max_relative = 1e-12);
        }
    }

    use crate::identify::forces::asynchronous_lines::VibrationLine;
    use approx::assert_relative_eq;
    use std::f64::consts::TAU;

    fn spectrum(rest: Vec<f64>) -> OrderSpectrum {
        OrderSpectrum {
            coefficient: Vec::new(),
            std: Vec::new(),
            sample_std: 0.1,
            rest,
            line_hz: 2.0,
        }
    }

    /// Mean square over all phases of the mean of a line of `amplitude` at `hz` over `length_s`: by adding it up.
    fn in_mean(amplitude: f64, hz: f64, length_s: f64) -> f64 {
        let phases = 64;
        (0..phases)
            .map(|p| {
                let phase = TAU * f64::from(p) / f64::from(phases);
                let at = |i: i32| (TAU * hz * length_s * (f64::from(i) + 0.5) / 2000.0 + phase).cos();
                (amplitude * (0..2000).map(at).sum::<f64>() / 2000.0).powi(2)
            })
            .sum::<f64>()
            / f64::from(phases)
    }

    #[test]
    fn a_line_leaves_in_a_mean_what_its_periods_do_not_cancel() {
        // Of x = 2 Re X e^{iωt}, |X| = 3 N is an amplitude of 6 N; line 6 is 12 Hz, and a tenth of a second 1.2 of its periods.
        let mut rest = vec![0.0; 20];
        rest[6] = 3.0;
        let left = lines_in_mean(&spectrum(rest.clone()), 1000.0, 0.1);
        assert_relative_eq!(left, in_mean(6.0, 12.0, 0.1), max_relative = 1e-4);
        // Lines add up; noise, and what is slower than the stretch, is none.
        rest[8] = 2.0;
        (rest[5], rest[4], rest[9]) = (0.0, 50.0, 0.013);
        let both = lines_in_mean(&spectrum(rest.clone()), 1000.0, 0.1);
        let expected = in_mean(6.0, 12.0, 0.1) + in_mean(4.0, 16.0, 0.1);
        assert_relative_eq!(both, expected, max_relative = 1e-4);
        // √10 times the noise of a line, 0.1 N · √(2 Hz / 1000 Hz), is a line.
        rest[9] = 0.015;
        let third = lines_in_mean(&spectrum(rest), 1000.0, 0.1);
        assert_relative_eq!(third - both, in_mean(0.03, 18.0, 0.1), max_relative = 1e-3);
    }

    fn channel(orders: usize) -> ForceChannel {
        ForceChannel {
            orders: vec![Complex64::ZERO; orders],
            order_std: vec![2.0; orders],
            level: vec![0.0; 6],
            level_std: vec![2.0; 6],
            integral: vec![0.0; 6],
        }
    }

    /// Lines of 40 N and 24 N beside the vibration's own (mean square 1088 N²) change the orders of tooth passing by a quarter of
    /// themselves: (40² + 24²) / 2 / 4 / 16 = 17 N².
    #[test]
    fn a_vibration_widens_the_orders_of_tooth_passing_and_the_level_of_the_cut() {
        let line = |shift: i64, amplitude: f64| VibrationLine {
            shift,
            channels: vec![(0, 500.0, 1.0), (2, amplitude.hypot(7.0), 7.0)],
        };
        let vibration = AsynchronousLines {
            frequency_hz: 431.0,
            lines: vec![line(-1, 40.0), line(0, 300.0), line(1, 24.0)],
        };
        let mut widened = channel(6);
        widen_for_vibration(&mut widened, &vibration, 2, 3, 2..5);
        let wide = (4.0f64 + 17.0).sqrt();
        for (found, expected) in widened.order_std.iter().zip([2.0, 2.0, wide, 2.0, 2.0, wide]) {
            assert_relative_eq!(*found, expected, max_relative = 1e-12);
        }
        for (found, expected) in widened.level_std.iter().zip([2.0, 2.0, wide, wide, wide, 2.0]) {
            assert_relative_eq!(*found, expected, max_relative = 1e-12);
        }
        // A channel that shows no lines stays as it is.
        let mut other = channel(6);
        widen_for_vibration(&mut other, &vibration, 1, 3, 2..5);
        assert_eq!(other.order_std, vec![2.0; 6]);
    }
}
