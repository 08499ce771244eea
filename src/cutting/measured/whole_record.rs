//! A channel's record as a whole, air and cut alike: what tells of a cut that was not made, and of signs that were lost.

use crate::data::Sample;
use crate::signal::{Air, line};

/// A channel, seen without knowing where in it was cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WholeRecord {
    /// Mean of all samples, zero line and all, N or N·m.
    pub mean: f64,
    /// Standard deviation of all samples about a straight line, N or N·m.
    pub std: f64,
    /// The same of the longest stretch of air; `None` where there is none.
    pub air_std: Option<f64>,
    /// Signs were lost: see [`is_rectified`].
    pub is_rectified: bool,
}

impl WholeRecord {
    pub(crate) fn of<S: Sample>(samples: &[S], air: &Air) -> Self {
        let (mean, std) = about_a_line(samples);
        let air = [&air.before, &air.after].into_iter().flatten();
        let air = air
            .max_by_key(|range| range.len())
            .map(|range| &samples[range.clone()]);
        WholeRecord {
            mean,
            std,
            air_std: air.map(|air| about_a_line(air).1),
            is_rectified: air.is_some_and(|air| is_rectified(samples, white_std(air))),
        }
    }
}

fn about_a_line<S: Sample>(samples: &[S]) -> (f64, f64) {
    let index = || (0..samples.len()).map(|i| i as f64);
    let (mean, slope, centre) = line(index(), samples.iter().map(|v| v.value()));
    let squares = index()
        .zip(samples)
        .map(|(i, v)| (v.value() - mean - slope * (i - centre)).powi(2));
    (mean, (squares.sum::<f64>() / samples.len().max(1) as f64).sqrt())
}

/// Of white noise: differences of neighbouring samples know no drift and little hum.
fn white_std<S: Sample>(samples: &[S]) -> f64 {
    let pairs = samples.windows(2).map(|w| (w[1].value() - w[0].value()).powi(2));
    (0.5 * pairs.sum::<f64>() / samples.len().saturating_sub(1).max(1) as f64).sqrt()
}

/// Samples nearer above zero than the noise is large that must have none below it, at least, …
const FEWEST_NEAR_ZERO: usize = 200;
/// … and what part of the record they must be. Normal noise about a force that stays 4 of its standard deviations above zero puts so
/// few there, and of 200 a twentieth as many below zero: ten times as many as by chance would all be missing. Nearer to zero more are.
const LEAST_NEAR_ZERO: f64 = 2e-3;
/// Part of them that may be zero itself: a recorder that knows nothing below zero has many of those, an absolute value has not.
const ZEROS: f64 = 0.25;

/// Absolute values: samples come as near to zero as noise (`noise_std`) brings them, and none goes below.
fn is_rectified<S: Sample>(samples: &[S], noise_std: f64) -> bool {
    if !(noise_std > 0.0) || samples.iter().any(|v| v.value() < 0.0) {
        return false;
    }
    let near = samples.iter().filter(|v| v.value() < noise_std).count();
    let zeros = samples.iter().filter(|v| v.value() == 0.0).count();
    let enough = FEWEST_NEAR_ZERO.max((LEAST_NEAR_ZERO * samples.len() as f64) as usize);
    near >= enough && (zeros as f64) < ZEROS * near as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    /// 2000 samples of air, 38 000 of a cut that goes round in 67 of them, noise of 1 N, and a zero at `offset` N.
    fn record(offset: f64, force: f64) -> Vec<f64> {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let of = |i: usize| {
            let cut = if i < 2000 {
                0.0
            } else {
                force * (0.0942 * i as f64).sin()
            };
            offset + cut + crate::statistics::nearly_normal(&mut random)
        };
        (0..40_000).map(of).collect()
    }

    fn of(samples: &[f64]) -> WholeRecord {
        let air = Air {
            before: Some(0..2000),
            after: None,
        };
        WholeRecord::of(samples, &air)
    }

    #[test]
    fn absolute_values_are_told_from_forces_that_stay_above_zero() {
        // A zero in the noise, one far off it that the cut goes through, and one that the cut turns round at.
        for (offset, force) in [(0.0, 50.0), (20.0, 50.0), (-30.0, 31.0)] {
            let signed = record(offset, force);
            assert!(!of(&signed).is_rectified, "{offset} {force}");
            let absolute: Vec<f64> = signed.iter().map(|v| v.abs()).collect();
            assert!(of(&absolute).is_rectified, "{offset} {force}");
        }
        // Above zero by more than the noise reaches, or just touching it; cut off at zero; without noise.
        for offset in [60.0, 54.0, 53.0] {
            assert!(!of(&record(offset, 50.0)).is_rectified, "{offset}");
        }
        let cut_off: Vec<f64> = record(0.0, 50.0).iter().map(|v| v.max(0.0)).collect();
        assert!(!of(&cut_off).is_rectified);
        let exact: Vec<f64> = (0..40_000)
            .map(|i| if i < 2000 { 0.0 } else { f64::from(i % 40) })
            .collect();
        assert!(!of(&exact).is_rectified);
    }

    #[test]
    fn the_scatter_is_about_a_line() {
        let drifting: Vec<f64> = record(0.0, 0.0)
            .iter()
            .zip(0..)
            .map(|(v, i)| v + 0.01 * f64::from(i))
            .collect();
        let whole = of(&drifting);
        assert!(
            (whole.mean - 200.0).abs() < 0.1 && (whole.std - 1.0).abs() < 0.05,
            "{whole:?}"
        );
        assert!((whole.air_std.unwrap() - 1.0).abs() < 0.05, "{whole:?}");
        assert!(of(&record(0.0, 50.0)).std > 30.0);
    }
}
