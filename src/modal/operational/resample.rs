//! Detrending and thinning of records.

use std::f64::consts::PI;

use rayon::prelude::*;

use super::record::OperationalRecord;

/// Share of the sampling rate up to which poles are sought: above it the low-pass filter bends the responses.
pub(super) const USABLE: f64 = 0.4;
/// Lobes of the windowed sinc on either side: with Kaiser's β = 6 some 60 dB from 0.6 times the new rate on, which is
/// what folds back to below [`USABLE`].
const LOBES: f64 = 10.0;
const KAISER: f64 = 6.0;

/// Channels without mean and slope, thinned by the largest whole number that keeps `highest_hz` usable; the new rate.
pub(super) fn thinned(record: &OperationalRecord, highest_hz: f64) -> (Vec<Vec<f64>>, f64) {
    let factor = (USABLE * record.sample_rate_hz / highest_hz).floor().max(1.0) as usize;
    let taps = low_pass(factor);
    let channels = record
        .channels
        .par_iter()
        .map(|samples| {
            let straight = detrended(samples);
            match factor {
                1 => straight,
                _ => filtered(&straight, &taps, factor),
            }
        })
        .collect();
    (channels, record.sample_rate_hz / factor as f64)
}

fn detrended(samples: &[f64]) -> Vec<f64> {
    let n = samples.len() as f64;
    let mean = samples.iter().sum::<f64>() / n;
    let middle = 0.5 * (n - 1.0);
    let (mut up, mut square) = (0.0, 0.0);
    for (k, x) in samples.iter().enumerate() {
        let t = k as f64 - middle;
        up += t * (x - mean);
        square += t * t;
    }
    let slope = if square > 0.0 { up / square } else { 0.0 };
    let straight = samples.iter().enumerate();
    straight
        .map(|(k, x)| x - mean - slope * (k as f64 - middle))
        .collect()
}

/// Symmetric taps of a low-pass filter at half the new rate, sum 1.
fn low_pass(factor: usize) -> Vec<f64> {
    let reach = (LOBES * factor as f64) as isize;
    let taps: Vec<f64> = (-reach..=reach)
        .map(|k| {
            let x = k as f64 / factor as f64;
            let sinc = if k == 0 { 1.0 } else { (PI * x).sin() / (PI * x) };
            let edge = (1.0 - (k as f64 / (reach + 1) as f64).powi(2)).sqrt();
            sinc * bessel(KAISER * edge) / bessel(KAISER)
        })
        .collect();
    let sum: f64 = taps.iter().sum();
    taps.iter().map(|t| t / sum).collect()
}

/// Modified Bessel function I₀.
fn bessel(x: f64) -> f64 {
    let (mut term, mut sum) = (1.0, 1.0);
    for k in 1..60 {
        term *= (x / (2.0 * f64::from(k))).powi(2);
        sum += term;
    }
    sum
}

/// Every `factor`-th sample of the filtered signal; samples without a full set of neighbours are left out.
fn filtered(samples: &[f64], taps: &[f64], factor: usize) -> Vec<f64> {
    let windows = samples.windows(taps.len()).step_by(factor);
    windows
        .map(|w| w.iter().zip(taps).map(|(x, t)| x * t).sum())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_band_passes_and_what_would_fold_into_it_does_not() {
        let rate = 1000.0;
        let tone = |f: f64| -> Vec<f64> {
            (0..20_000)
                .map(|k| (2.0 * PI * f * f64::from(k) / rate).sin())
                .collect()
        };
        let size = |f: f64| {
            let samples = tone(f);
            let record = OperationalRecord {
                sample_rate_hz: rate,
                channels: &[&samples],
                differentiations: &[],
            };
            // Thinned to 100 Hz.
            let (channels, new) = thinned(&record, 40.0);
            assert_eq!(new, 100.0);
            2.0_f64.sqrt() * super::super::rms(&channels[0])
        };
        for f in [5.0, 20.0, 39.0] {
            assert!((size(f) - 1.0).abs() < 0.02, "{f} Hz: {}", size(f));
        }
        for f in [61.0, 99.0, 140.0, 230.0] {
            assert!(size(f) < 2e-3, "{f} Hz: {}", size(f));
        }
    }

    #[test]
    fn offset_and_slope_are_taken_out() {
        let samples: Vec<f64> = (0..100).map(|k| 3.0 + 0.5 * f64::from(k)).collect();
        assert!(detrended(&samples).iter().all(|x| x.abs() < 1e-9));
    }
}
