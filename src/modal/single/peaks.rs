//! Peak picking on |mobility|, judged against a locally estimated noise floor.
//!
//! A peak counts when it stands out of its surroundings (topographic prominence) by more than the range that
//! noise alone spans over so many lines. Broad peaks under many noisy lines are found on smoothed copies of the curve; smoothing is
//! done on the complex values with a Gaussian, which turns a resonance into a Voigt profile (still one hump)
//! where a box would split it.

use num_complex::Complex64;

use crate::modal::single::curve::Curve;

/// Prominence in standard deviations of the complex noise, beyond the range 2√(ln n) of noise over n lines
/// (radial noise on a level curve: extremes ±√(2 ln n) of σ/√2 each).
const MARGIN_SIGMA: f64 = 1.5;
/// A ripple of less than this part of its peak is no mode, however quiet the record.
const MIN_PROMINENCE_OF_HEIGHT: f64 = 1e-3;
/// Half-widths of the Gaussian (standard deviation, lines); 0 is the raw curve.
const SMOOTHING_LINES: [f64; 6] = [0.0, 1.0, 2.0, 4.0, 8.0, 16.0];
/// More peaks than this in one FRF: the strongest are kept.
const MAX_PEAKS: usize = 60;

/// A local maximum of |mobility|.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FrfPeak {
    pub index: usize,
    /// Prominence over the noise's standard deviation.
    pub significance: f64,
    /// Prominence over height: nearly 1 for a peak that stands alone, little for a ripple on a flank.
    pub rise: f64,
    /// Range in which the curve stays above half of the prominence (inclusive).
    pub from: usize,
    pub to: usize,
}

/// Peaks in ascending frequency. Never the first or last two lines of the band.
pub(crate) fn find(curve: &Curve, noise_std: &[f64]) -> Vec<FrfPeak> {
    let n = curve.len();
    let mut found: Vec<FrfPeak> = Vec::new();
    for width in SMOOTHING_LINES {
        if width > 0.0 && 12.0 * width > n as f64 {
            break;
        }
        let (smooth, noise_gain) = smoothed(&curve.mobility, width);
        for peak in prominent(&smooth, noise_std, noise_gain, 2 + (2.0 * width) as usize) {
            // The same hill, seen sharper on a finer copy already.
            let known = found.iter().any(|p| {
                (peak.from..=peak.to).contains(&p.index)
                    || (p.from..=p.to).contains(&peak.index)
                    || p.index.abs_diff(peak.index) as f64 <= 3.0 * width
            });
            if !known {
                found.push(peak);
            }
        }
    }
    found.sort_by(|a, b| b.significance.total_cmp(&a.significance));
    found.truncate(MAX_PEAKS);
    found.sort_by_key(|p| p.index);
    found
}

/// |Gaussian-smoothed curve| and the factor by which the smoothing lowers white noise.
fn smoothed(mobility: &[Complex64], width_lines: f64) -> (Vec<f64>, f64) {
    if width_lines <= 0.0 {
        return (mobility.iter().map(|y| y.norm_sqr().sqrt()).collect(), 1.0);
    }
    let reach = (3.0 * width_lines).ceil() as usize;
    let kernel: Vec<f64> = (0..=reach)
        .map(|j| (-0.5 * (j as f64 / width_lines).powi(2)).exp())
        .collect();
    let sum = kernel[0] + 2.0 * kernel[1..].iter().sum::<f64>();
    let squares = kernel[0].powi(2) + 2.0 * kernel[1..].iter().map(|w| w * w).sum::<f64>();
    let n = mobility.len();
    // Tap by tap over the whole curve, real and imaginary parts alike.
    let mut total: Vec<Complex64> = mobility.iter().map(|y| y * kernel[0]).collect();
    let mut weight = vec![kernel[0]; n];
    for (j, &w) in kernel.iter().enumerate().skip(1).take_while(|(j, _)| *j < n) {
        for (sum, y) in total.iter_mut().zip(&mobility[j..]) {
            *sum += y * w;
        }
        for (sum, y) in total[j..].iter_mut().zip(mobility) {
            *sum += y * w;
        }
        // At the ends the kernel is cut off and what is left weighs the more.
        weight[..n - j].iter_mut().for_each(|sum| *sum += w);
        weight[j..].iter_mut().for_each(|sum| *sum += w);
    }
    let values = total
        .iter()
        .zip(&weight)
        .map(|(t, w)| t.norm_sqr().sqrt() / w)
        .collect();
    (values, squares.sqrt() / sum)
}

/// `margin`: lines at either end where smoothing leans on few values and a maximum proves nothing.
fn prominent(height: &[f64], noise_std: &[f64], noise_gain: f64, margin: usize) -> Vec<FrfPeak> {
    let n = height.len();
    let threshold = 2.0 * (n.max(2) as f64).ln().sqrt() + MARGIN_SIGMA;
    let mut peaks = Vec::new();
    for k in margin..n.saturating_sub(margin) {
        if !(height[k] > height[k - 1] && height[k] >= height[k + 1]) {
            continue;
        }
        let noise = noise_std[k] * noise_gain;
        let wanted = (threshold * noise).max(MIN_PROMINENCE_OF_HEIGHT * height[k]);
        let Some(prominence) = prominence(height, k, wanted).filter(|p| *p > 0.0) else {
            continue;
        };
        let level = height[k] - 0.5 * prominence;
        let from = (0..k).rev().find(|&j| height[j] < level).unwrap_or(0);
        let to = (k..n).find(|&j| height[j] < level).unwrap_or(n - 1);
        // A noise-free curve has no finite ratio; any large number will do.
        let significance = (prominence / noise.max(1e-9 * height[k])).min(1e9);
        peaks.push(FrfPeak {
            index: k,
            significance,
            rise: prominence / height[k],
            from,
            to,
        });
    }
    peaks
}

/// How far a maximum stands above the higher of the two valleys on the way to higher ground or to the end; `None` where
/// that is less than `wanted`. Both ways are walked by turns: a ripple on a flank meets higher ground soon on one side,
/// and need not be followed down the other.
fn prominence(height: &[f64], peak: usize, wanted: f64) -> Option<f64> {
    let top = height[peak];
    let mut ways = [
        Box::new(height[..peak].iter().rev()) as Box<dyn Iterator<Item = &f64>>,
        Box::new(height[peak + 1..].iter()),
    ];
    let mut valleys = [top; 2];
    let mut open = [true; 2];
    while open[0] || open[1] {
        for ((way, valley), open) in ways.iter_mut().zip(&mut valleys).zip(&mut open) {
            if !*open {
                continue;
            }
            match way.next().filter(|h| **h <= top) {
                Some(h) => *valley = valley.min(*h),
                None => *open = false,
            }
            if !*open && top - *valley < wanted {
                return None;
            }
        }
    }
    Some(top - valleys[0].max(valleys[1]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::modal::synthetic::{Synthetic, SyntheticMode};

    fn peaks_hz(case: Synthetic) -> Vec<f64> {
        let (f, h) = case.frf();
        let curve = Curve::from_receptance(&f, &h, None).unwrap();
        find(&curve, &curve.noise_std())
            .iter()
            .map(|p| curve.frequency_hz[p.index])
            .collect()
    }

    #[test]
    fn every_mode_is_found_once_under_noise_broad_and_narrow_together() {
        let modes = [
            SyntheticMode::new(6.0, 0.01, 1.0),
            SyntheticMode::new(14.0, 0.05, 2.0),
            SyntheticMode::new(60.0, 0.05, 30.0),
        ];
        for seed in 0..20 {
            let found = peaks_hz(Synthetic::new(3.0, 90.0, 0.05, &modes).with_noise(0.0, 0.02, seed));
            assert_eq!(found.len(), 3, "seed {seed}: {found:?}");
            for (found, mode) in found.iter().zip(&modes) {
                assert!((found - mode.frequency_hz).abs() < mode.damping_ratio * mode.frequency_hz);
            }
        }
    }

    #[test]
    fn noise_alone_has_no_peaks() {
        for seed in 0..20 {
            // 1000 Hz is far outside: what is left in the band is a flat line with 30 % noise.
            let found = peaks_hz(
                Synthetic::new(3.0, 90.0, 0.05, &[SyntheticMode::new(1000.0, 0.02, 1.0)])
                    .with_noise(0.3, 0.0, seed),
            );
            assert!(found.is_empty(), "seed {seed}: {found:?}");
        }
    }

    #[test]
    fn the_rise_towards_a_band_edge_is_no_peak() {
        assert!(
            peaks_hz(Synthetic::new(
                3.0,
                20.0,
                0.1,
                &[SyntheticMode::new(20.1, 0.02, 1.0)]
            ))
            .is_empty()
        );
        assert!(
            peaks_hz(Synthetic::new(
                3.0,
                20.0,
                0.1,
                &[SyntheticMode::new(2.9, 0.02, 1.0)]
            ))
            .is_empty()
        );
    }

    #[test]
    fn prominence_is_the_height_over_the_higher_valley() {
        let height = [1.0, 5.0, 3.0, 9.0, 2.0, 4.0, 0.5, 6.0];
        assert_eq!(prominence(&height, 3, 0.0), Some(8.0));
        assert_eq!(prominence(&height, 1, 0.0), Some(2.0));
        assert_eq!(prominence(&height, 5, 2.0), Some(2.0));
        assert_eq!(prominence(&height, 5, 2.1), None);
        assert_eq!(prominence(&height, 3, 8.1), None);
    }
}
