//! Noise of the FRFs of a set: from the measurement before the modes are known, from what they leave over afterwards.

use num_complex::Complex64;
use rayon::prelude::*;

use crate::modal::max_likelihood::joint_fit::{Data, Group};
use crate::modal::settings::SET;
use crate::signal::frf_noise;
use crate::signal::noise_law::{self, Departure};

/// A stretch of the band left with this many times the noise power is badly described.
const MISFIT: f64 = 2.0;
/// A few FRFs left with this many times the noise power over the whole band are so because of a stretch that no poles describe: by
/// the level of the whole no mode elsewhere would be determined.
const DECIDED_BY_A_STRETCH: f64 = 10.0;
/// Lines of a stretch: enough that a mode overlooked in it still stands out.
const BLOCK: usize = 48;

/// Noise of each FRF, from those on the same lines together.
pub(crate) fn estimate(data: &mut [Data]) {
    let mut todo: Vec<usize> = (0..data.len()).collect();
    while let Some(&first) = todo.first() {
        let (same, other): (Vec<usize>, Vec<usize>) = todo
            .iter()
            .partition(|&&k| data[k].frequency_hz == data[first].frequency_hz);
        let curves: Vec<&[Complex64]> = same.iter().map(|&k| data[k].receptance.as_slice()).collect();
        let estimates = frf_noise::estimate(&data[first].frequency_hz, &curves);
        for (&k, estimate) in same.iter().zip(estimates) {
            let lines = data[k].receptance.iter().zip(sizes(&data[k]));
            data[k].sigma = match estimate {
                Some(e) => lines
                    .zip(&e.std)
                    .map(|((h, size), s)| s.max(1e-6 * h.norm()).max(1e-9 * size))
                    .collect(),
                // Too few lines to tell: relative noise, as of a hammer; the residual scales it later.
                None => lines
                    .map(|(h, size)| (0.02 * h.norm()).max(1e-3 * size))
                    .collect(),
            };
        }
        todo = other;
    }
}

/// The FRFs with noises that differ by a factor only, where they are on the same lines: at each line the mean square over
/// the FRFs of what each has over its own level, so that what a fit leaves there is as large as expected. A fit of such
/// FRFs takes a fraction of the time ([`crate::modal::max_likelihood::alike`]) and is hardly less exact; its standard deviations are not those
/// of the noise.
pub(crate) fn alike(data: &[Data]) -> Vec<Data> {
    let mut data = data.to_vec();
    let lines = data.first().map_or(0, |d| d.frequency_hz.len());
    if data
        .windows(2)
        .any(|w| w[0].frequency_hz != w[1].frequency_hz || w[0].spread_hz != w[1].spread_hz)
    {
        return data;
    }
    let mut squares = vec![0.0; lines];
    let levels: Vec<f64> = data
        .iter()
        .map(|d| {
            let level = (d.sigma.iter().map(|s| s.ln()).sum::<f64>() / lines as f64).exp();
            for (sum, sigma) in squares.iter_mut().zip(&d.sigma) {
                *sum += (sigma / level).powi(2);
            }
            level
        })
        .collect();
    let count = data.len() as f64;
    for (d, level) in data.iter_mut().zip(levels) {
        for (sigma, sum) in d.sigma.iter_mut().zip(&squares) {
            *sigma = level * (sum / count).sqrt();
        }
    }
    data
}

/// By line, what an FRF's size is about: the smaller of its rms and of what the rms of its acceleration is there, so that lines at
/// frequencies far below the rest, where what an accelerometer measured becomes huge as a displacement, decide nothing.
fn sizes(data: &Data) -> Vec<f64> {
    let accelerances = data
        .frequency_hz
        .iter()
        .zip(&data.receptance)
        .map(|(f, h)| h * (f * f));
    let (whole, accelerance) = (rms(&data.receptance), rms(&accelerances.collect::<Vec<_>>()));
    data.frequency_hz
        .iter()
        .map(|f| whole.min(accelerance / (f * f).max(f64::MIN_POSITIVE)))
        .collect()
}

pub(crate) fn rms(values: &[Complex64]) -> f64 {
    (values.iter().map(|v| v.norm_sqr()).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// Noise of each FRF from what the fit leaves over. Lines whose group could not be fitted keep theirs. Where a stretch of
/// the band is left far worse than the rest (leakage, drifting modes, lines below the sensor's range), it is that much
/// noisier: one bad end of the band must not decide what is needless elsewhere.
pub(crate) fn renew(data: &mut [Data], groups: &[Group]) {
    let left_over: Vec<Vec<Departure>> = data
        .par_iter()
        .enumerate()
        .map(|(m, data)| left_over(data, groups, m))
        .collect();
    let laws = noise_law::fit_along_band(&left_over);
    for ((d, lines), law) in data.iter_mut().zip(&left_over).zip(laws) {
        let sizes = sizes(d);
        let fitted = lines.iter().filter(|l| l.squared.is_finite());
        let sigmas = d.sigma.iter().zip(&d.count);
        let (count, level) = fitted.zip(sigmas).fold((0, 0.0), |(n, sum), (line, (s, count))| {
            (n + 1, sum + line.squared / (s * s * count))
        });
        let scale = (level / f64::from(count.max(1))).sqrt().max(1e-6);
        for (((sigma, line), count), size) in d
            .sigma
            .iter_mut()
            .zip(lines)
            .zip(&d.count)
            .zip(sizes)
            .filter(|(((_, l), _), _)| l.squared.is_finite())
        {
            *sigma = match &law {
                Some(law) => {
                    let of_a_line = law.std(line.frequency_hz, line.magnitude);
                    (of_a_line / count.sqrt())
                        .max(1e-7 * line.magnitude)
                        .max(1e-10 * size)
                }
                None => *sigma * scale,
            };
        }
    }
    let finest = data.iter().max_by_key(|d| d.frequency_hz.len());
    let lines_hz = finest.map_or_else(Vec::new, |d| d.frequency_hz.clone());
    if lines_hz.is_empty() {
        return;
    }
    let line = |f: f64| lines_hz.partition_point(|of| *of < f).min(lines_hz.len() - 1);
    let mut left = vec![(0.0, 0.0); lines_hz.len()];
    for (d, lines) in data.iter().zip(&left_over) {
        for ((departure, sigma), count) in lines.iter().zip(&d.sigma).zip(&d.count) {
            if departure.squared.is_finite() {
                let (sum, lines) = &mut left[line(departure.frequency_hz)];
                *sum += departure.squared / (sigma * sigma * count);
                *lines += 1.0;
            }
        }
    }
    // In a few FRFs alone a mode overlooked would hide in its own misfit.
    let (sum, lines) = left.iter().fold((0.0, 0.0), |(s, n), l| (s + l.0, n + l.1));
    if data.len() < SET && sum < DECIDED_BY_A_STRETCH * lines {
        return;
    }
    let excess = lasting_excess(&left);
    for d in data.iter_mut() {
        for (f, sigma) in d.frequency_hz.iter().zip(&mut d.sigma) {
            let excess = excess[line(*f)];
            if excess > MISFIT {
                *sigma *= excess.sqrt();
            }
        }
    }
}

/// By line, the smallest mean that any stretch of [`BLOCK`] lines around it has: what is far too large on a few lines only (drift at the
/// end of the band) does not reach the sound lines next to them, and a mode overlooked still stands out. `left`: sum and count by line.
fn lasting_excess(left: &[(f64, f64)]) -> Vec<f64> {
    let mut sums = Vec::with_capacity(left.len() + 1);
    sums.push((0.0, 0.0));
    for (sum, count) in left {
        let (before, lines) = sums[sums.len() - 1];
        sums.push((before + sum, lines + count));
    }
    let block = BLOCK.min(left.len());
    let means: Vec<f64> = (0..=left.len() - block)
        .map(|from| {
            let (sum, lines) = (
                sums[from + block].0 - sums[from].0,
                sums[from + block].1 - sums[from].1,
            );
            if lines > 0.0 { sum / lines } else { 0.0 }
        })
        .collect();
    (0..left.len())
        .map(|line| {
            let around = line.saturating_sub(block - 1)..=line.min(means.len() - 1);
            means[around].iter().copied().fold(f64::INFINITY, f64::min)
        })
        .collect()
}

/// By line of FRF m, squares as they would be on a single line; infinite where no group covers it.
fn left_over(data: &Data, groups: &[Group], m: usize) -> Vec<Departure> {
    let mut lines: Vec<Departure> = data
        .frequency_hz
        .iter()
        .zip(&data.receptance)
        .map(|(&frequency_hz, h)| Departure {
            frequency_hz,
            magnitude: h.norm(),
            squared: f64::INFINITY,
        })
        .collect();
    for group in groups {
        let found = &group.solution.frfs[m];
        let from = data.frequency_hz.partition_point(|&f| f < group.window_hz[0]);
        // The poles are shared by all FRFs and cost each of them next to nothing.
        let freedom = (1.0 - found.leverage).max(0.05);
        for (k, residual) in found.residual.iter().enumerate() {
            let line = &mut lines[from + k];
            line.magnitude = (data.receptance[from + k] - residual).norm();
            line.squared = residual.norm_sqr() * data.count[from + k] / freedom;
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn data(frequency_hz: &[f64], sigma: &[f64]) -> Data {
        let lines = frequency_hz.len();
        Data {
            frequency_hz: frequency_hz.to_vec(),
            receptance: vec![Complex64::ONE; lines],
            sigma: sigma.to_vec(),
            spread_hz: vec![0.0; lines],
            count: vec![1.0; lines],
        }
    }

    /// An accelerometer's drift at 0.1 Hz is metres as a displacement; the floor of the lines that count must not follow it.
    #[test]
    fn lines_far_below_the_rest_do_not_say_what_size_is() {
        let f = [0.1, 50.0, 100.0];
        let mut frf = data(&f, &[1.0; 3]);
        frf.receptance = f.map(|f| Complex64::from(1.0 / (f * f))).to_vec();
        let size = sizes(&frf);
        assert!((size[2] - 1e-4).abs() < 1e-9, "{size:?}");
        assert!((size[0] - rms(&frf.receptance)).abs() < 1e-9, "{size:?}");
        // Even displacements: their own rms.
        frf.receptance = vec![Complex64::ONE; 3];
        assert_eq!(sizes(&frf)[..2], [1.0; 2]);
    }

    /// Fifteen lines of drift, then 200 sound ones.
    #[test]
    fn a_bad_end_of_the_band_does_not_reach_the_lines_next_to_it() {
        let mut left = vec![(18.0, 18.0); 215];
        left[..15].fill((1800.0, 18.0));
        let excess = lasting_excess(&left);
        assert!(excess[0] > 30.0, "{}", excess[0]);
        assert!(
            excess[15..].iter().all(|e| (e - 1.0).abs() < 1e-9),
            "{:?}",
            &excess[15..30]
        );
        // As many lines as a mode has, in the middle: a stretch that begins among them holds half of them at least.
        let mut left = vec![(18.0, 18.0); 215];
        left[100..110].fill((1800.0, 18.0));
        let expected = (43.0 + 5.0 * 100.0) / 48.0;
        assert!((lasting_excess(&left)[105] - expected).abs() < 1e-9);
        assert_eq!(lasting_excess(&[]), Vec::<f64>::new());
    }

    #[test]
    fn noises_made_alike_are_in_proportion_and_as_large_together() {
        let f = [1.0, 2.0, 3.0];
        let frfs = [data(&f, &[1.0, 2.0, 4.0]), data(&f, &[30.0, 10.0, 3.0])];
        let even = alike(&frfs);
        for k in 0..3 {
            let ratio = even[1].sigma[k] / even[0].sigma[k];
            approx::assert_relative_eq!(ratio, even[1].sigma[0] / even[0].sigma[0], max_relative = 1e-12);
            // What a fit leaves on a line over all FRFs is as large as expected.
            let left: f64 = (0..2)
                .map(|m| (frfs[m].sigma[k] / even[m].sigma[k]).powi(2))
                .sum();
            approx::assert_relative_eq!(left, 2.0, max_relative = 1e-12);
        }
        let other = [
            data(&f, &[1.0, 2.0, 4.0]),
            data(&[1.0, 2.0, 3.5], &[3.0, 1.0, 3.0]),
        ];
        assert_eq!(alike(&other)[1].sigma, other[1].sigma);
    }
}
