//! Correlations of the responses with the reference channels, segment by segment.

use faer::Mat;
use num_complex::Complex64;
use rayon::prelude::*;
use realfft::RealFftPlanner;

use crate::{InputError, Result};

/// Channels that are correlated with all others, at most: more add cost rather than information.
const MOST_REFERENCES: usize = 6;
/// Segments: as many as the record gives, within these bounds. The standard deviation of a standard deviation from n
/// segments is 1/√(2 (n − 1)) of itself.
const SEGMENTS: [usize; 2] = [12, 60];
/// A segment is at least this many times the longest lag, so that neighbours are next to independent.
const LAGS_IN_SEGMENT: usize = 5;
/// Block rows of the Hankel matrix.
const BLOCK_ROWS: [usize; 2] = [24, 120];
/// Largest dimension of the Hankel matrix.
const MOST_ROWS: usize = 480;
/// Highest order where none is asked for.
const USUAL_ORDER: usize = 60;

/// Sizes of the analysis.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub channels: usize,
    /// Indices of the reference channels.
    pub references: Vec<usize>,
    /// Block columns of the Hankel matrix; one block row more.
    pub blocks: usize,
    pub segments: usize,
    /// Samples of a segment.
    pub length: usize,
    pub max_order: usize,
}

impl Plan {
    /// # Errors
    /// Too few samples.
    pub fn new(channels: &[Vec<f64>], max_order: Option<usize>) -> Result<Plan> {
        let count = channels.len();
        let samples = channels.first().map_or(0, Vec::len);
        let references = references(channels);
        let wanted = max_order.unwrap_or(USUAL_ORDER).max(2);
        // The order needs as many columns, and twice as many tell modes from noise.
        let needed = (2 * wanted).div_ceil(references.len());
        let blocks = needed
            .clamp(BLOCK_ROWS[0], BLOCK_ROWS[1])
            .min((MOST_ROWS / count).max(8))
            .min(samples / (2 * LAGS_IN_SEGMENT * SEGMENTS[0]));
        if blocks < 8 {
            return Err(InputError::new(format!(
                "only {samples} samples in the band: too short for modes from responses alone"
            ))
            .remedy(format!(
                "record at least {} times as long, or give a band up to a higher frequency",
                (8 * 2 * LAGS_IN_SEGMENT * SEGMENTS[0]).div_ceil(samples.max(1))
            ))
            .into());
        }
        let usable = samples - 2 * blocks;
        let segments = (usable / (2 * LAGS_IN_SEGMENT * blocks)).clamp(2, SEGMENTS[1]);
        Ok(Plan {
            channels: count,
            max_order: wanted.min(blocks * references.len() * 2 / 3) & !1,
            references,
            blocks,
            segments,
            length: usable / segments,
        })
    }

    /// Longest lag, samples.
    pub fn lags(&self) -> usize {
        2 * self.blocks
    }

    pub fn rows(&self) -> usize {
        self.channels * (self.blocks + 1)
    }

    pub fn columns(&self) -> usize {
        self.references.len() * self.blocks
    }

    /// Model orders, two a mode.
    pub fn orders(&self) -> Vec<usize> {
        (2..=self.max_order).step_by(2).collect()
    }

    /// Block Hankel matrix of correlations: block (i, j) is R at lag i + j + 1.
    pub fn hankel(&self, correlation: &Correlation) -> Mat<f64> {
        let (channels, references) = (self.channels, self.references.len());
        Mat::from_fn(self.rows(), self.columns(), |row, column| {
            let lag = row / channels + column / references + 1;
            correlation.at(lag, row % channels, column % references)
        })
    }
}

/// R_k = mean of y(t + k) y_ref(t)ᵀ at lags 1 … K.
#[derive(Debug, Clone)]
pub(super) struct Correlation {
    /// By channel, then reference, then lag.
    values: Vec<f64>,
    references: usize,
    lags: usize,
}

impl Correlation {
    pub fn at(&self, lag: usize, channel: usize, reference: usize) -> f64 {
        self.values[(channel * self.references + reference) * self.lags + lag - 1]
    }

    /// Σ weight · correlation.
    pub fn combined(all: &[Correlation], weight: impl Fn(usize) -> f64) -> Correlation {
        let mut sum = all[0].clone();
        sum.values.fill(0.0);
        for (k, one) in all.iter().enumerate() {
            let weight = weight(k);
            for (s, v) in sum.values.iter_mut().zip(&one.values) {
                *s += weight * v;
            }
        }
        sum
    }
}

/// Correlations of each segment. Lags reach over a segment's end into the next, so that the mean over the segments is
/// the correlation of the whole record.
pub(super) fn of_segments(channels: &[Vec<f64>], plan: &Plan) -> Vec<Correlation> {
    let lags = plan.lags();
    let size = (plan.length + lags).next_power_of_two();
    let mut planner = RealFftPlanner::<f64>::new();
    let (forward, backward) = (planner.plan_fft_forward(size), planner.plan_fft_inverse(size));
    (0..plan.segments)
        .into_par_iter()
        .map(|segment| {
            let from = segment * plan.length;
            let transform = |samples: &[f64]| {
                let mut padded = vec![0.0; size];
                padded[..samples.len()].copy_from_slice(samples);
                let mut out = forward.make_output_vec();
                // Lengths are those of the plan.
                let done = forward.process(&mut padded, &mut out);
                debug_assert!(done.is_ok());
                out
            };
            let reference: Vec<Vec<Complex64>> = plan
                .references
                .iter()
                .map(|&r| transform(&channels[r][from..from + plan.length]))
                .collect();
            let scale = 1.0 / (size as f64 * plan.length as f64);
            let mut values = Vec::with_capacity(channels.len() * reference.len() * lags);
            for channel in channels {
                let response = transform(&channel[from..from + plan.length + lags]);
                for reference in &reference {
                    let mut product: Vec<Complex64> = response
                        .iter()
                        .zip(reference)
                        .map(|(y, r)| y * r.conj())
                        .collect();
                    // Real by definition; rounding leaves a trace.
                    product[0].im = 0.0;
                    product[size / 2].im = 0.0;
                    let mut correlation = backward.make_output_vec();
                    let done = backward.process(&mut product, &mut correlation);
                    debug_assert!(done.is_ok());
                    values.extend(correlation[1..=lags].iter().map(|c| c * scale));
                }
            }
            Correlation {
                values,
                references: reference.len(),
                lags,
            }
        })
        .collect()
}

/// The channels that together say most of all others: one after the other the one with the most power that those before
/// do not explain (pivoted Cholesky decomposition of the covariance of the scaled channels).
fn references(channels: &[Vec<f64>]) -> Vec<usize> {
    let count = channels.len();
    if count <= MOST_REFERENCES {
        return (0..count).collect();
    }
    let samples = channels[0].len().max(1) as f64;
    let mut rest: Vec<Vec<f64>> = (0..count)
        .into_par_iter()
        .map(|i| {
            let row = (0..count).map(|j| {
                let product = channels[i].iter().zip(&channels[j]).map(|(a, b)| a * b);
                product.sum::<f64>() / samples
            });
            row.collect()
        })
        .collect();
    let mut chosen = Vec::new();
    for _ in 0..MOST_REFERENCES {
        let left = (0..count).filter(|k| !chosen.contains(k));
        let Some(best) = left.max_by(|&a, &b| rest[a][a].total_cmp(&rest[b][b])) else {
            break;
        };
        let pivot = rest[best][best];
        if !(pivot > 1e-9) {
            break;
        }
        chosen.push(best);
        let row = rest[best].clone();
        for i in 0..count {
            for j in 0..count {
                rest[i][j] -= row[i] * row[j] / pivot;
            }
        }
    }
    chosen.sort_unstable();
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_correlation_is_the_mean_of_products() {
        let a: Vec<f64> = (0..6000)
            .map(|k| (f64::from(k) * 0.7).sin() + f64::from(k % 7))
            .collect();
        let b: Vec<f64> = (0..6000)
            .map(|k| (f64::from(k) * 0.3).cos() - f64::from(k % 5))
            .collect();
        let channels = [a.clone(), b.clone()];
        let plan = Plan::new(&channels, Some(8)).unwrap();
        let segments = of_segments(&channels, &plan);
        let whole = Correlation::combined(&segments, |_| 1.0 / plan.segments as f64);
        let used = plan.segments * plan.length;
        for lag in [1, 5, plan.lags()] {
            let direct: f64 = (0..used).map(|t| b[t + lag] * a[t]).sum::<f64>() / used as f64;
            approx::assert_relative_eq!(whole.at(lag, 1, 0), direct, max_relative = 1e-9, epsilon = 1e-9);
        }
    }

    #[test]
    fn a_copy_of_a_channel_is_no_reference_of_its_own() {
        let wave = |f: f64| -> Vec<f64> { (0..3000).map(|k| (f64::from(k) * f).sin()).collect() };
        let mut channels: Vec<Vec<f64>> = [0.1, 0.23, 0.37, 0.41, 0.53, 0.61].map(wave).to_vec();
        channels.insert(0, channels[3].clone());
        let chosen = references(&channels);
        assert_eq!(chosen.len(), 6);
        assert_ne!(chosen.contains(&0), chosen.contains(&4), "{chosen:?}");
    }

    #[test]
    fn a_short_record_is_an_error_that_says_how_long_it_must_be() {
        let error = Plan::new(&[vec![1.0; 200]], None).unwrap_err().to_string();
        assert!(error.contains("200 samples"), "{error}");
    }
}
