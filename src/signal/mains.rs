//! Hum of the mains.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

use crate::data::Sample;

/// Frequencies of the mains, Hz.
pub const MAINS_HZ: [f64; 2] = [50.0, 60.0];

/// Highest multiple that is called hum: rectifiers make those of six and twelve.
const MOST_MAINS: f64 = 12.0;

/// Distance of a frequency from the nearest multiple of either mains frequency, up to the twelfth, Hz; infinite where there is none.
pub fn from_mains_hz(hz: f64) -> f64 {
    let from = |mains: &f64| {
        let multiple = (hz / mains).round();
        (1.0..=MOST_MAINS)
            .contains(&multiple)
            .then(|| (hz - multiple * mains).abs())
    };
    MAINS_HZ.iter().filter_map(from).fold(f64::INFINITY, f64::min)
}

/// Periods of the mains that must fit into what hum is fitted to.
const FEWEST_PERIODS: f64 = 5.0;
/// Distance at which two lines are told apart, in lines of the spectrum.
const APART: f64 = 2.0;

/// What multiples of one mains frequency, whichever takes away more, leave of `channels` (one length, `rate_hz` samples a second), fitted
/// by least squares with level and slope; those that are not told apart from multiples of `kept_hz` are left in. `None` where nothing
/// can be fitted.
pub(super) fn without_hum<S: Sample>(channels: &[&[S]], rate_hz: f64, kept_hz: f64) -> Option<Vec<Vec<f64>>> {
    let samples = channels.iter().map(|c| c.len()).min()?;
    let cleaned = MAINS_HZ.iter().filter_map(|mains_hz| {
        let lines = hum_lines(samples, rate_hz, *mains_hz, kept_hz);
        (!lines.is_empty()).then(|| without_lines(channels, samples, &lines))?
    });
    let squares = |c: &[Vec<f64>]| c.iter().flatten().map(|v| v * v).sum::<f64>();
    cleaned.min_by(|a, b| squares(a).total_cmp(&squares(b)))
}

/// Multiples of `mains_hz` that can be fitted to so many samples, cycles a sample.
fn hum_lines(samples: usize, rate_hz: f64, mains_hz: f64, kept_hz: f64) -> Vec<f64> {
    let resolution_hz = rate_hz / samples.max(1) as f64;
    let multiples = (1..=MOST_MAINS as usize).map(|m| m as f64 * mains_hz);
    let is_apart = |hz: &f64| {
        let from_kept_hz = (hz - kept_hz * (hz / kept_hz).round()).abs();
        from_kept_hz > APART * resolution_hz && *hz < 0.5 * rate_hz - resolution_hz
    };
    match FEWEST_PERIODS * resolution_hz < mains_hz {
        true => multiples.filter(is_apart).map(|hz| hz / rate_hz).collect(),
        false => Vec::new(),
    }
}

/// The first `samples` of `channels` without these lines, cycles a sample.
fn without_lines<S: Sample>(channels: &[&[S]], samples: usize, lines: &[f64]) -> Option<Vec<Vec<f64>>> {
    // 1, the place from −1 to 1, and cosine and sine of each line.
    let row = |i: usize| -> DVector<f64> {
        let level = [1.0, (2 * i) as f64 / samples as f64 - 1.0];
        let waves = lines
            .iter()
            .flat_map(|cycles| <[f64; 2]>::from((TAU * cycles * i as f64).sin_cos()));
        DVector::from_iterator(2 + 2 * lines.len(), level.into_iter().chain(waves))
    };
    let count = 2 + 2 * lines.len();
    let mut normal = DMatrix::zeros(count, count);
    let mut right = DMatrix::zeros(count, channels.len());
    for i in 0..samples {
        let row = row(i);
        normal.syger(1.0, &row, &row, 1.0);
        for (channel, mut right) in channels.iter().zip(right.column_iter_mut()) {
            right.axpy(channel[i].value(), &row, 1.0);
        }
    }
    let mut amplitudes = normal.cholesky()?.solve(&right);
    // Level and slope stay.
    amplitudes.rows_mut(0, 2).fill(0.0);
    let mut cleaned: Vec<Vec<f64>> = channels.iter().map(|_| Vec::with_capacity(samples)).collect();
    for i in 0..samples {
        let row = row(i);
        for ((channel, amplitudes), cleaned) in
            channels.iter().zip(amplitudes.column_iter()).zip(&mut cleaned)
        {
            cleaned.push(channel[i].value() - amplitudes.dot(&row));
        }
    }
    Some(cleaned)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Hum of 50 and 150 Hz on a ramp and on a line of 80 Hz: the ramp and the line stay. Where 50 Hz is once a tooth it stays, too.
    #[test]
    fn hum_is_taken_out_and_nothing_else() {
        let at = |i: usize, hz: f64| (TAU * hz * i as f64 / 2000.0 + 0.3 * hz).sin();
        let kept = |i: usize| 5.0 + 0.01 * i as f64 + 40.0 * at(i, 80.0);
        let hum = |i: usize| 20.0 * at(i, 50.0) + 7.0 * at(i, 150.0);
        let record: Vec<f64> = (0..2000).map(|i| kept(i) + hum(i)).collect();
        let clean = |kept_hz: f64| {
            without_hum(&[record.as_slice()], 2000.0, kept_hz)
                .unwrap()
                .remove(0)
        };
        let worst = |v: &[f64], of: &dyn Fn(usize) -> f64| {
            v.iter()
                .enumerate()
                .map(|(i, v)| (v - of(i)).abs())
                .fold(0.0, f64::max)
        };
        assert!(worst(&clean(80.0), &kept) < 0.1, "{}", worst(&clean(80.0), &kept));
        let with_hum = |i: usize| kept(i) + hum(i);
        assert!(worst(&clean(50.0), &with_hum) < 0.1);
        // Too short to tell 50 from 60 Hz; and no channel at all.
        assert_eq!(without_hum(&[&record[..150]], 2000.0, 80.0), None);
        assert_eq!(without_hum::<f64>(&[], 2000.0, 80.0), None);
    }

    #[test]
    fn multiples_up_to_the_twelfth_of_both() {
        for (hz, expected) in [
            (50.0, 0.0),
            (61.5, 1.5),
            (295.0, 5.0),
            (720.0, 0.0),
            (744.0, 24.0),
        ] {
            assert!((from_mains_hz(hz) - expected).abs() < 1e-9, "{hz}");
        }
        assert_eq!(from_mains_hz(24.9), f64::INFINITY);
        assert_eq!(from_mains_hz(751.0), f64::INFINITY);
    }
}
