//! A steady record as Fourier coefficients over the orders of a rotation, with their noise, and what lies between the
//! orders.
//!
//! Projecting the whole window on an order is the same as averaging the waveform over the revolutions first. The noise
//! of a coefficient is what the neighbouring lines that belong to no order show: the scatter from revolution to
//! revolution.

use std::f64::consts::TAU;
use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};
use realfft::RealFftPlanner;

use super::blocks::median;
use crate::data::Sample;

/// One channel over a steady window.
#[derive(Debug, Clone)]
pub struct OrderSpectrum {
    /// Orders 1..=K: x(θ) = … + 2 Re Σ c_n e^{inθ}, θ = 0 at the window's first sample.
    pub coefficient: Vec<Complex64>,
    /// Standard deviation of each complex coefficient (root of E|noise|²).
    pub std: Vec<f64>,
    /// Standard deviation of a sample's white noise.
    pub sample_std: f64,
    /// |amplitude| of what is left without the orders, on lines `line_hz` apart: x(t) = … + 2 Re Σ X_j e^{iω_j t}.
    pub rest: Vec<f64>,
    /// Spacing of the lines of `rest`, Hz.
    pub line_hz: f64,
}

/// Neighbouring orders whose scatter is pooled, to each side.
const POOLED: usize = 8;
/// From so many revolutions on the lines that belong to orders are too few to move a median.
const MANY_REVOLUTIONS: f64 = 8.0;
/// An order whose neighbourhood holds this many times the power of the orders around it keeps its own.
const STANDS_OUT: f64 = 2.0;

/// Share of the sampling rate up to which what is sampled is seen whole: an anti-aliasing filter rolls off from there.
const SEEN_WHOLE: f64 = 0.4;

/// Highest order worth comparing with a model of so many teeth: as [`highest_order`], but where a filter may already take of the tooth
/// passing itself, what lies below.
pub fn highest_order_seen_whole(samples_per_revolution: f64, teeth: usize, wanted: usize) -> usize {
    let whole = SEEN_WHOLE * samples_per_revolution;
    let highest = highest_order(samples_per_revolution, wanted);
    if whole < teeth as f64 {
        highest.min(whole.max(0.0) as usize)
    } else {
        highest
    }
}

/// Highest order worth keeping: `wanted`, or what the sampling shows.
pub fn highest_order(samples_per_revolution: f64, wanted: usize) -> usize {
    wanted.min((0.45 * samples_per_revolution).floor().max(0.0) as usize)
}

/// Samples that are transformed at once, at most: a longer window's lines are the mean power of its pieces, so that memory does not
/// grow with the record. 52 s at 10 kHz.
const PIECE: usize = 1 << 19;
/// Revolutions that a piece holds at least.
const PIECE_REVOLUTIONS: f64 = 16.0;

/// `samples`: the steady window, its baseline taken off; `samples_per_revolution` is not a whole number in general and
/// the last revolution may end within a sample. `None` where there are less than two revolutions,
/// which tell no scatter.
pub fn order_spectrum<S: Sample>(
    samples: &[S],
    sample_rate_hz: f64,
    samples_per_revolution: f64,
    orders: usize,
) -> Option<OrderSpectrum> {
    order_spectrum_above(samples, |_| 0.0, sample_rate_hz, samples_per_revolution, orders)
}

/// The same of samples that `zero` (of a sample's index) is still to be taken off.
pub fn order_spectrum_above<S: Sample>(
    samples: &[S],
    zero: impl Fn(usize) -> f64,
    sample_rate_hz: f64,
    samples_per_revolution: f64,
    orders: usize,
) -> Option<OrderSpectrum> {
    spectrum_by_pieces(
        samples,
        zero,
        sample_rate_hz,
        samples_per_revolution,
        orders,
        PIECE,
    )
}

fn spectrum_by_pieces<S: Sample>(
    samples: &[S],
    zero: impl Fn(usize) -> f64,
    sample_rate_hz: f64,
    samples_per_revolution: f64,
    orders: usize,
    longest: usize,
) -> Option<OrderSpectrum> {
    let revolutions = (samples.len() as f64 / samples_per_revolution + 1e-6).floor();
    if !(revolutions >= 2.0) {
        return None;
    }
    let length = revolutions * samples_per_revolution;
    let count = (length.ceil() as usize).min(samples.len());
    // The last sample counts as far as the revolution reaches into it.
    let last = (length - (count as f64 - 1.0)).clamp(0.0, 1.0);
    let above_zero = |i: usize| samples[i].value() - zero(i);
    let trend = Trend::new(above_zero, count, revolutions as usize, samples_per_revolution);
    // Pieces of whole revolutions, to the sample; what is left over at the end has no lines of its own.
    let per_piece = (longest as f64 / samples_per_revolution)
        .floor()
        .max(PIECE_REVOLUTIONS);
    let piece = if count <= longest || revolutions < 2.0 * per_piece {
        count
    } else {
        (per_piece * samples_per_revolution).round() as usize
    };
    let pieces = count / piece;
    let value = |range: Range<usize>, buffer: &mut Vec<f64>| {
        buffer.clear();
        buffer.extend(range.map(|i| above_zero(i) - trend.at(i)));
    };

    let turn = Turn::new(samples_per_revolution);
    let project = |value: &[f64], first: usize, sums: &mut [[[f64; 8]; 2]]| {
        Arch::new().dispatch(Project {
            value,
            first,
            turn: &turn,
            sums,
        });
    };
    let lines_of = |sums: Vec<[[f64; 8]; 2]>| -> Vec<Complex64> {
        let total = |part: [f64; 8]| part.iter().sum::<f64>() / length;
        sums.into_iter()
            .map(|[re, im]| Complex64::new(total(re), total(im)))
            .collect()
    };
    let (mut buffer, mut sums) = (Vec::with_capacity(piece), vec![[[0.0; 8]; 2]; orders]);
    for first in (0..count).step_by(piece) {
        let end = (first + piece).min(count);
        value(first..end, &mut buffer);
        if end == count
            && let Some(value) = buffer.last_mut()
        {
            *value *= last;
        }
        project(&buffer, first, &mut sums);
    }
    let mut coefficient = lines_of(sums);
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(piece);
    let mut spectrum = transform.make_output_vec();
    let mut scratch = transform.make_scratch_vec();
    let (mut rest, mut sums) = (vec![0.0; spectrum.len()], vec![[[0.0; 8]; 2]; orders]);
    for first in (0..count).step_by(piece) {
        let end = (first + piece).min(count);
        value(first..end, &mut buffer);
        Arch::new().dispatch(TakeAway {
            value: &mut buffer,
            first,
            coefficient: &coefficient,
            turn: &turn,
        });
        // Where the last revolution ends within a sample, each line leaks a little into all others: what is left of them tells it.
        let whole = buffer[end - first - 1];
        if end == count {
            buffer[end - first - 1] *= last;
        }
        project(&buffer, first, &mut sums);
        if end - first < piece {
            continue;
        }
        buffer[end - first - 1] = whole;
        transform
            .process_with_scratch(&mut buffer, &mut spectrum, &mut scratch)
            .ok()?;
        for (sum, c) in rest.iter_mut().zip(&spectrum) {
            *sum += c.norm_sqr();
        }
    }
    for (line, left) in coefficient.iter_mut().zip(lines_of(sums)) {
        *line += left;
    }
    drop((buffer, spectrum, scratch));
    let mean_of_pieces = |power: f64| (power / pieces as f64).sqrt() / piece as f64;
    rest.iter_mut().for_each(|power| *power = mean_of_pieces(*power));
    let line_hz = sample_rate_hz / piece as f64;

    // A single piece is `count` samples long, all revolutions.
    let lines_per_order = match pieces {
        1 => revolutions * count as f64 / length,
        _ => piece as f64 / samples_per_revolution,
    };
    let neighbourhood = |n: f64| {
        let (from, to) = ((n - 0.5) * lines_per_order, (n + 0.5) * lines_per_order);
        (from.ceil().max(1.0) as usize)..(to.floor() as usize + 1).min(rest.len())
    };
    // One line of each neighbourhood, the order's own, was taken away: of all pieces together.
    let free_lines = |n: f64| (pieces * neighbourhood(n).len()).max(2) as f64 - 1.0;
    // What a line of the whole window would hold of it.
    let share = match pieces {
        1 => 1.0,
        _ => (pieces * piece) as f64 / length,
    };
    let power = |n: f64| -> f64 {
        let lines = rest.get(neighbourhood(n));
        share * lines.map_or(0.0, |r| r.iter().map(|a| a * a).sum::<f64>()) / free_lines(n)
    };
    let own: Vec<f64> = (1..=orders).map(|n| power(n as f64)).collect();
    let std = (0..orders)
        .map(|n| {
            let pool = n.saturating_sub(POOLED)..(n + POOLED + 1).min(orders);
            let around =
                pooled(&own, &pool, n) * median_to_weight(2.0 * free_lines((n + 1) as f64), pool.len());
            let variance = if own[n] > STANDS_OUT * around {
                own[n]
            } else {
                around
            };
            variance.sqrt()
        })
        .collect();
    // |X|² is exponentially distributed where there is noise only: its median is ln 2 of its mean; the mean of several pieces
    // comes nearer to it.
    // The lines of the orders themselves are taken away: with few revolutions they are a good part of all.
    let is_order = |j: usize| {
        if revolutions >= MANY_REVOLUTIONS {
            return false;
        }
        let order = (j as f64 / lines_per_order).round();
        order <= orders as f64 && (j as f64 - order * lines_per_order).abs() < 0.5
    };
    let between = rest.iter().enumerate().filter(|(j, _)| !is_order(*j));
    let squares: Vec<f64> = between.map(|(_, a)| a * a).collect();
    let median_of_mean = match pieces {
        1 => std::f64::consts::LN_2,
        _ => median_of_chi2(2.0 * pieces as f64),
    };
    let sample_std = (median(&squares) / median_of_mean * piece as f64).sqrt();
    Some(OrderSpectrum {
        coefficient,
        std,
        sample_std,
        rest,
        line_hz,
    })
}

/// Standard deviations of its sign test from which on the noise falls or rises over the orders of a pool.
const FALLS: f64 = 3.0;

/// The power of the noise at index `n` of `own` by that of the orders in `pool`, a median: where it falls or rises over them, as a filter
/// makes it, along a power law (its exponent the median of all pairs': Theil 1950, Sen 1968; told by Kendall's sign test, 1938).
fn pooled(own: &[f64], pool: &Range<usize>, n: usize) -> f64 {
    let slopes: Vec<f64> = pool
        .clone()
        .flat_map(|b| (pool.start..b).map(move |a| [a, b]))
        .map(|[a, b]| (own[b] / own[a]).ln() / ((b + 1) as f64 / (a + 1) as f64).ln())
        .filter(|slope| slope.is_finite())
        .collect();
    let signs: f64 = slopes.iter().map(|slope| slope.signum()).sum();
    let count = pool.len() as f64;
    let by_chance = (count * (count - 1.0) * (2.0 * count + 5.0) / 18.0).sqrt();
    if signs.abs() <= FALLS * by_chance {
        return median(&own[pool.clone()]);
    }
    let exponent = median(&slopes);
    let here = |k: usize| own[k] * ((n + 1) as f64 / (k + 1) as f64).powf(exponent);
    median(&pool.clone().map(here).collect::<Vec<_>>())
}

/// Samples that are multiplied side by side: enough independent products for the widest vectors to be busy.
const LANES: usize = 32;

/// One number of each of the samples side by side.
type Lanes = [f64; LANES];

/// e^(−iθ) at the samples of a rotation.
struct Turn {
    samples_per_revolution: f64,
    /// cos and −sin from the first of the samples side by side.
    ahead: [Lanes; 2],
}

impl Turn {
    fn new(samples_per_revolution: f64) -> Turn {
        let step = TAU / samples_per_revolution;
        Turn {
            samples_per_revolution,
            ahead: [
                std::array::from_fn(|k| (step * k as f64).cos()),
                std::array::from_fn(|k| -(step * k as f64).sin()),
            ],
        }
    }

    /// Real and imaginary part at sample `first` and those after it.
    #[inline(always)]
    fn at(&self, first: usize) -> [Lanes; 2] {
        let angle = TAU * (first as f64 / self.samples_per_revolution).fract();
        let (sine, cosine) = angle.sin_cos();
        let [re, im] = &self.ahead;
        [
            std::array::from_fn(|k| cosine * re[k] + sine * im[k]),
            std::array::from_fn(|k| cosine * im[k] - sine * re[k]),
        ]
    }
}

/// Adds Σ x e^(−inθ) over the samples from `first` on for the orders from 1 on, one part for every eighth sample.
/// (A type of its own: a closure is compiled for the plainest processor where it is not inlined.)
struct Project<'a> {
    value: &'a [f64],
    first: usize,
    turn: &'a Turn,
    sums: &'a mut [[[f64; 8]; 2]],
}

impl WithSimd for Project<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (block, value) in self.value.chunks(LANES).enumerate() {
            let mut re = [0.0; LANES];
            re[..value.len()].copy_from_slice(value);
            let mut im = [0.0; LANES];
            let [cosine, sine] = self.turn.at(self.first + block * LANES);
            for sum in self.sums.iter_mut() {
                for k in 0..LANES {
                    let (a, b) = (re[k], im[k]);
                    re[k] = a * cosine[k] - b * sine[k];
                    im[k] = a * sine[k] + b * cosine[k];
                }
                for k in 0..LANES {
                    sum[0][k % 8] += re[k];
                    sum[1][k % 8] += im[k];
                }
            }
        }
    }
}

/// Takes 2 Re Σ c e^(inθ) off every sample from `first` on.
struct TakeAway<'a> {
    value: &'a mut [f64],
    first: usize,
    coefficient: &'a [Complex64],
    turn: &'a Turn,
}

impl WithSimd for TakeAway<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (block, value) in self.value.chunks_mut(LANES).enumerate() {
            let [cosine, sine] = self.turn.at(self.first + block * LANES);
            let (mut re, mut im) = ([0.0; LANES], [0.0; LANES]);
            // Horner from the highest order.
            for c in self.coefficient.iter().rev() {
                for k in 0..LANES {
                    let (a, b) = (re[k] + c.re, im[k] + c.im);
                    re[k] = a * cosine[k] + b * sine[k];
                    im[k] = b * cosine[k] - a * sine[k];
                }
            }
            for (value, re) in value.iter_mut().zip(re) {
                *value -= 2.0 * re;
            }
        }
    }
}

/// Median of a χ² of `freedom` normal values over its mean (Wilson & Hilferty 1931).
fn median_of_chi2(freedom: f64) -> f64 {
    (1.0 - 2.0 / (9.0 * freedom)).powi(3)
}

/// What the median of `count` mean squares of `freedom` normal values each is to be multiplied with, to be the variance by which
/// squares are to be divided so that they are one on average: a χ² has its median below its mean, and
/// the inverse of an estimate is larger than the inverse of what it estimates (a median is as good as 2/π of its values).
fn median_to_weight(freedom: f64, count: usize) -> f64 {
    let of_mean = median_of_chi2(freedom);
    let pooled = (count as f64 * freedom * std::f64::consts::FRAC_2_PI).max(freedom);
    let inverse = if pooled > 4.0 {
        pooled / (pooled - 2.0)
    } else {
        2.0
    };
    inverse / of_mean
}

/// Polynomial through the means of the revolutions: what moves so slowly is drift, and would leak into all orders. (The
/// samples themselves would not do: a polynomial takes a little out of every wave.)
struct Trend {
    coefficient: DVector<f64>,
    scale: f64,
}

impl Trend {
    fn new(
        value: impl Fn(usize) -> f64,
        count: usize,
        revolutions: usize,
        samples_per_revolution: f64,
    ) -> Trend {
        let terms = 1 + (revolutions / 4).min(3);
        let scale = 2.0 / count.max(2) as f64;
        let edge = |r: usize| r as f64 * samples_per_revolution;
        let mean = DVector::from_fn(revolutions, |r, _| mean_of(&value, count, edge(r), edge(r + 1)));
        let basis = DMatrix::from_fn(revolutions, terms, |r, k| {
            ((edge(r) + 0.5 * samples_per_revolution) * scale - 1.0).powi(k as i32)
        });
        let coefficient = (basis.transpose() * &basis)
            .cholesky()
            .map_or_else(|| DVector::zeros(terms), |c| c.solve(&(basis.transpose() * mean)));
        Trend { coefficient, scale }
    }

    fn at(&self, i: usize) -> f64 {
        let x = (i as f64 + 0.5) * self.scale - 1.0;
        self.coefficient.iter().rev().fold(0.0, |s, c| s * x + c)
    }
}

/// Mean of `samples` between two positions that need not be whole: a sample counts by the share of it that lies inside.
pub fn mean_between<S: Sample>(samples: &[S], from: f64, to: f64) -> f64 {
    mean_of(&|i| samples[i].value(), samples.len(), from, to)
}

/// The same of `count` samples that `value` makes.
fn mean_of(value: &impl Fn(usize) -> f64, count: usize, from: f64, to: f64) -> f64 {
    let (from, to) = (from.max(0.0), to.min(count as f64));
    if !(to > from) {
        return 0.0;
    }
    let (first, last) = (from.floor() as usize, (to.ceil() as usize).min(count));
    let mut sum = 0.0;
    for i in first..last {
        let share = (to.min(i as f64 + 1.0) - from.max(i as f64)).max(0.0);
        sum += value(i) * share;
    }
    sum / (to - from)
}

/// Amplitude of a line at `hz` in `samples`, less what noise alone would show; a straight line is taken out first.
pub fn line_amplitude<S: Sample>(samples: &[S], sample_rate_hz: f64, hz: f64) -> f64 {
    let n = samples.len();
    if n < 16 {
        return 0.0;
    }
    let index = || (0..n).map(|i| i as f64);
    let (mean, slope, centre) = super::blocks::line(index(), samples.iter().map(|v| v.value()));
    let (window_turn, line_turn) = (Turn::new(n as f64), Turn::new(sample_rate_hz / hz));
    let half_a_sample = Complex64::from_polar(1.0, -TAU * 0.5 / n as f64);
    let (mut sum, mut window, mut square) = (Complex64::ZERO, 0.0, 0.0);
    for (block, samples) in samples.chunks(LANES).enumerate() {
        let first = block * LANES;
        let (hann, line) = (window_turn.at(first), line_turn.at(first));
        for (k, v) in samples.iter().enumerate() {
            let cosine = hann[0][k] * half_a_sample.re - hann[1][k] * half_a_sample.im;
            let hann = 0.5 - 0.5 * cosine;
            let value = v.value() - mean - slope * ((first + k) as f64 - centre);
            sum += Complex64::new(line[0][k], line[1][k]) * (hann * value);
            window += hann;
            square += value * value;
        }
    }
    let power = 4.0 * sum.norm_sqr() / (window * window);
    // Hann-windowed white noise: E|2S/W|² = 4 σ² Σw²/W² = 6 σ²/n.
    let noise = 6.0 * square / (n * n) as f64;
    (power - noise).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn a_tooth_passing_that_a_filter_may_take_of_is_not_compared() {
        assert_eq!(highest_order_seen_whole(9.0, 4, 64), 3);
        assert_eq!(highest_order_seen_whole(11.0, 4, 64), 4);
        assert_eq!(highest_order_seen_whole(100.0, 4, 64), 45);
        assert_eq!(highest_order_seen_whole(100.0, 4, 24), 24);
    }

    #[test]
    fn lines_noise_and_drift_are_told_apart() {
        let (rate, per_turn, sigma) = (5000.0, 137.3, 2.0);
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut coverage = Vec::new();
        for _ in 0..20 {
            let samples: Vec<f64> = (0..6000)
                .map(|i| {
                    let theta = TAU * i as f64 / per_turn;
                    let gauss: f64 = crate::statistics::nearly_normal(&mut random);
                    let x = i as f64 / 6000.0;
                    80.0 * x + 40.0 * x * x + 300.0 * (4.0 * theta).cos() - 20.0 * (17.0 * theta).sin()
                        + sigma * gauss
                })
                .collect();
            let s = order_spectrum(&samples, rate, per_turn, 40).unwrap();
            assert!((s.sample_std / sigma - 1.0).abs() < 0.05, "{}", s.sample_std);
            for n in 1..=40 {
                let truth = match n {
                    4 => Complex64::new(150.0, 0.0),
                    17 => Complex64::new(0.0, 10.0),
                    _ => Complex64::ZERO,
                };
                coverage.push(((s.coefficient[n - 1] - truth).norm() / s.std[n - 1]).powi(2));
            }
        }
        let mean = coverage.iter().sum::<f64>() / coverage.len() as f64;
        assert!((0.85..1.15).contains(&mean), "{mean}");
    }

    /// A turn is no whole number of samples: without a second look each line would be off by a sample's share of all others.
    #[test]
    fn lines_do_not_leak_into_one_another() {
        let truth = |n: usize| Complex64::from_polar(100.0 / n as f64, n as f64);
        let value = |i: usize| {
            let theta = TAU * i as f64 / 137.3;
            (1..=30)
                .map(|n| 2.0 * (truth(n) * Complex64::from_polar(1.0, n as f64 * theta)).re)
                .sum::<f64>()
        };
        let samples: Vec<f64> = (0..6000).map(value).collect();
        let found = order_spectrum(&samples, 5000.0, 137.3, 40).unwrap();
        for (k, line) in found.coefficient.iter().enumerate() {
            let expected = if k < 30 { truth(k + 1) } else { Complex64::ZERO };
            assert!(
                (line - expected).norm() < 2e-3,
                "order {}: {line} for {expected}",
                k + 1
            );
        }
    }

    /// A filter makes the noise fall over the orders: the lowest are known as well as they are, not as well as those above them.
    #[test]
    fn noise_that_falls_over_the_orders_is_that_of_each() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let (mut low, mut high) = (Vec::new(), Vec::new());
        for _ in 0..60 {
            let mut stages = [0.0; 2];
            let samples: Vec<f64> = (0..6000)
                .map(|_| {
                    let mut value: f64 = crate::statistics::nearly_normal(&mut random);
                    for stage in &mut stages {
                        *stage += 0.12 * (value - *stage);
                        value = *stage;
                    }
                    value
                })
                .collect();
            let s = order_spectrum(&samples, 5000.0, 137.3, 40).unwrap();
            let squares = s
                .coefficient
                .iter()
                .zip(&s.std)
                .map(|(c, std)| c.norm_sqr() / (std * std));
            let squares: Vec<f64> = squares.collect();
            low.extend_from_slice(&squares[..4]);
            high.extend_from_slice(&squares[20..]);
        }
        for squares in [low, high] {
            let mean = squares.iter().sum::<f64>() / squares.len() as f64;
            assert!((0.8..1.25).contains(&mean), "{mean}");
        }
    }

    /// In pieces: the same orders to the bit of rounding, the same noise, and a line beside the orders where it was.
    #[test]
    fn a_long_window_says_the_same_in_pieces() {
        let (rate, per_turn, sigma) = (5000.0, 137.3, 2.0);
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let samples: Vec<f64> = (0..60_000)
            .map(|i| {
                let theta = TAU * i as f64 / per_turn;
                let noise: f64 = crate::statistics::nearly_normal(&mut random);
                let chatter = 5.0 * (TAU * 431.0 * i as f64 / rate).sin();
                0.01 * i as f64 + 300.0 * (4.0 * theta).cos() - 20.0 * (17.0 * theta).sin()
                    + chatter
                    + sigma * noise
            })
            .collect();
        let zero = |i: usize| 0.01 * i as f64;
        let by = |longest| spectrum_by_pieces(&samples, zero, rate, per_turn, 40, longest).unwrap();
        let (whole, pieces) = (by(1 << 19), by(1 << 13));
        // 436 revolutions are 59 863 samples.
        assert_eq!(whole.rest.len(), 59_863 / 2 + 1);
        // 59 revolutions of 137.3 samples.
        assert_eq!(pieces.rest.len(), 8101 / 2 + 1);
        for (a, b) in whole.coefficient.iter().zip(&pieces.coefficient) {
            assert!((a - b).norm() < 1e-9, "{a} {b}");
        }
        for (n, (a, b)) in whole.std.iter().zip(&pieces.std).enumerate() {
            assert!((a / b - 1.0).abs() < 0.15, "order {}: {a} {b}", n + 1);
        }
        for spectrum in [&whole, &pieces] {
            assert!(
                (spectrum.sample_std / sigma - 1.0).abs() < 0.03,
                "{}",
                spectrum.sample_std
            );
            let lines = spectrum.rest.iter().enumerate();
            let (peak, _) = lines.max_by(|a, b| a.1.total_cmp(b.1)).unwrap();
            assert!((peak as f64 * spectrum.line_hz - 431.0).abs() < spectrum.line_hz);
            // All of its power, whatever the width of a line.
            let power: f64 = spectrum.rest[peak - 3..peak + 4].iter().map(|a| a * a).sum();
            assert!((2.0 * power.sqrt() / 5.0 - 1.0).abs() < 0.05);
        }
    }

    #[test]
    fn noise_of_a_few_turns_is_neither_too_small_nor_too_large() {
        let mut random = ChaCha8Rng::seed_from_u64(11);
        for turns in [2, 3, 4, 6, 12] {
            let mut squares = Vec::new();
            for _ in 0..60 {
                let samples: Vec<f64> = (0..(turns as f64 * 137.3) as usize + 1)
                    .map(|_| crate::statistics::nearly_normal(&mut random))
                    .collect();
                let s = order_spectrum(&samples, 5000.0, 137.3, 48).unwrap();
                squares.extend(
                    s.coefficient
                        .iter()
                        .zip(&s.std)
                        .map(|(c, std)| c.norm_sqr() / (std * std)),
                );
            }
            let mean = squares.iter().sum::<f64>() / squares.len() as f64;
            // Two turns have neighbourhoods that share lines: a little on the safe side.
            let least = if turns == 2 { 0.88 } else { 0.94 };
            assert!((least..1.06).contains(&mean), "{turns} turns: {mean}");
        }
    }

    #[test]
    fn fractional_means_and_hum() {
        assert!((mean_between(&[1.0, 2.0, 3.0], 0.5, 2.5) - 2.0).abs() < 1e-12);
        assert_eq!(mean_between::<f64>(&[], 0.0, 1.0), 0.0);
        let hum: Vec<f64> = (0..2000)
            .map(|i| 3.0 * (TAU * 50.0 * i as f64 / 5000.0 + 0.4).cos())
            .collect();
        assert!((line_amplitude(&hum, 5000.0, 50.0) - 3.0).abs() < 0.05);
        assert!(line_amplitude(&hum, 5000.0, 120.0) < 0.3);
    }
}
