//! One FRF made ready for fitting: mobility on positive, ascending lines, with its local noise.
//!
//! Everything in [`crate::modal`] works on the mobility Y = iωH, because a viscously damped mode is exactly
//! `Y(f) = R / (ζ + i u)`, `u = (f² − f₀²) / (2 f f₀)`: a circle in the complex plane, with its maximum at f₀
//! and half its power at u = ±ζ for any ζ. (In receptance the maximum sits at f₀√(1 − 2ζ²) and the half-power
//! width is 2ζf₀ only to first order.)

use num_complex::Complex64;

use crate::{InputError, Result};

/// Fewest usable lines from which anything is said.
pub(crate) const MIN_LINES: usize = 8;

/// Do lines (ascending, Hz) reach a frequency?
pub(crate) fn reach(lines_hz: &[f64], frequency_hz: f64) -> bool {
    let ends = lines_hz.first().zip(lines_hz.last());
    ends.is_some_and(|(first, last)| (*first..=*last).contains(&frequency_hz))
}

/// Mobility of one FRF.
#[derive(Debug, Clone)]
pub(crate) struct Curve {
    /// Ascending, positive, finite.
    pub frequency_hz: Vec<f64>,
    /// (m/s)/N, finite, same length.
    pub mobility: Vec<Complex64>,
    /// Lines of the band that were dropped because they were not finite.
    pub dropped: usize,
}

impl Curve {
    /// Takes the lines inside `band_hz` (all where `None`); 0 Hz and lines that are not finite are left out.
    ///
    /// # Errors
    /// Lengths differ, or the frequencies are not finite and ascending.
    pub fn from_receptance(
        frequency_hz: &[f64],
        receptance_m_per_n: &[Complex64],
        band_hz: Option<[f64; 2]>,
    ) -> Result<Curve> {
        if frequency_hz.len() != receptance_m_per_n.len() {
            return Err(InputError::new(format!(
                "an FRF has {} frequencies but {} values",
                frequency_hz.len(),
                receptance_m_per_n.len()
            ))
            .into());
        }
        let ascending = frequency_hz.windows(2).all(|w| w[0] < w[1]);
        if !ascending || frequency_hz.iter().any(|f| !f.is_finite()) {
            return Err(
                InputError::new("the frequencies of an FRF are not finite and ascending")
                    .remedy("sort the lines and take out doubles")
                    .into(),
            );
        }
        let [low, high] = band_hz.unwrap_or([0.0, f64::INFINITY]);
        let mut curve = Curve {
            frequency_hz: Vec::with_capacity(frequency_hz.len()),
            mobility: Vec::with_capacity(frequency_hz.len()),
            dropped: 0,
        };
        for (&f, &h) in frequency_hz.iter().zip(receptance_m_per_n) {
            if f <= 0.0 || f < low || f > high {
                continue;
            }
            let mobility = Complex64::new(0.0, std::f64::consts::TAU * f) * h;
            if mobility.re.is_finite() && mobility.im.is_finite() {
                curve.frequency_hz.push(f);
                curve.mobility.push(mobility);
            } else {
                curve.dropped += 1;
            }
        }
        // Scale-free from here on would be nicer still, but squares of 1e-8 m/N are far from underflow.
        Ok(curve)
    }

    pub fn len(&self) -> usize {
        self.frequency_hz.len()
    }

    /// Turns the phase convention round: e^{−iωt} to e^{+iωt}. The mobility of conj(H) is iω conj(H) = −conj(Y).
    pub fn conjugate(&mut self) {
        for y in &mut self.mobility {
            *y = -y.conj();
        }
    }

    /// Distance of neighbouring lines around index `k`, Hz (the smaller one, as the finer tells more).
    pub fn spacing_hz(&self, k: usize) -> f64 {
        let f = &self.frequency_hz;
        let below = (k >= 1 && k < f.len()).then(|| f[k] - f[k - 1]);
        let above = (k + 1 < f.len()).then(|| f[k + 1] - f[k]);
        match (below, above) {
            (Some(a), Some(b)) => a.min(b),
            (Some(a), None) | (None, Some(a)) => a,
            (None, None) => 0.0,
        }
    }

    /// Index of the line nearest to a frequency.
    pub fn nearest(&self, frequency_hz: f64) -> usize {
        let f = &self.frequency_hz;
        let above = f.partition_point(|&x| x < frequency_hz);
        match above {
            0 => 0,
            k if k >= f.len() => f.len().saturating_sub(1),
            k if frequency_hz - f[k - 1] <= f[k] - frequency_hz => k - 1,
            k => k,
        }
    }

    /// Half-open index range of the lines within `[low_hz, high_hz]`.
    pub fn range(&self, low_hz: f64, high_hz: f64) -> std::ops::Range<usize> {
        let from = self.frequency_hz.partition_point(|&f| f < low_hz);
        let to = self.frequency_hz.partition_point(|&f| f <= high_hz);
        from..to.max(from)
    }

    /// Standard deviation of the complex noise, sqrt(E|e|²), at every line: the median of fourth differences
    /// in a sliding window. Fourth differences remove what is smooth over five lines, the median ignores the
    /// few lines of a sharp peak.
    pub fn noise_std(&self) -> Vec<f64> {
        const HALF_WINDOW: usize = 20;
        let n = self.len();
        if n < 5 {
            return vec![0.0; n];
        }
        // Var(y₋₂ − 4y₋₁ + 6y₀ − 4y₁ + y₂) = 70 σ².
        let difference: Vec<f64> = self
            .mobility
            .windows(5)
            .map(|w| {
                (w[0] - w[1] * 4.0 + w[2] * 6.0 - w[3] * 4.0 + w[4])
                    .norm_sqr()
                    .sqrt()
                    / 70f64.sqrt()
            })
            .collect();
        let last = difference.len() - 1;
        let range =
            |centre: usize| centre.saturating_sub(HALF_WINDOW)..(centre + HALF_WINDOW + 1).min(last + 1);
        // In ascending order; from line to line one value goes and one comes.
        let mut window: Vec<f64> = difference[range(0)].to_vec();
        window.sort_by(f64::total_cmp);
        let mut held = range(0);
        (0..n)
            .map(|k| {
                let wanted = range(k.saturating_sub(2).min(last));
                let place =
                    |window: &[f64], value: f64| window.partition_point(|x| x.total_cmp(&value).is_lt());
                for value in &difference[held.end..wanted.end] {
                    window.insert(place(&window, *value), *value);
                }
                for value in &difference[held.start..wanted.start] {
                    window.remove(place(&window, *value));
                }
                held = wanted;
                // |e| is Rayleigh distributed: its median is σ √ln 2.
                window[window.len() / 2] / std::f64::consts::LN_2.sqrt()
            })
            .collect()
    }
}

/// u = (f² − f₀²) / (2 f f₀): the detuning that turns a viscous mode into 1/(ζ + iu).
pub(crate) fn detuning(frequency_hz: f64, natural_hz: f64) -> f64 {
    0.5 * (frequency_hz / natural_hz - natural_hz / frequency_hz)
}

/// The frequency at which the detuning is `u`: the inverse of [`detuning`].
pub(crate) fn detuned_hz(natural_hz: f64, u: f64) -> f64 {
    natural_hz * (u + (1.0 + u * u).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::modal::synthetic::{Synthetic, SyntheticMode};

    #[test]
    fn the_detuning_and_its_inverse_agree() {
        for u in [-0.7, -0.01, 0.0, 0.03, 2.0] {
            approx::assert_relative_eq!(detuning(detuned_hz(12.3, u), 12.3), u, epsilon = 1e-13);
        }
    }

    #[test]
    fn noise_is_estimated_beside_and_below_a_peak() {
        let clean = Synthetic::new(3.0, 90.0, 0.1, &[SyntheticMode::new(20.0, 0.03, 1.0)]);
        let peak = clean.mobility_peak();
        let (f, h) = clean.with_noise(0.02, 0.0, 7).frf();
        let curve = Curve::from_receptance(&f, &h, None).unwrap();
        let noise = curve.noise_std();
        // The noise of the test case is white in receptance: ∝ f in mobility.
        for f_hz in [10.0, 20.0, 60.0] {
            let expected = 0.02 * peak * f_hz / 20.0;
            let estimated = noise[curve.nearest(f_hz)];
            assert!(
                (estimated / expected).ln().abs() < 0.5,
                "{f_hz} Hz: {estimated} against {expected}"
            );
        }
    }

    #[test]
    fn bad_lines_are_refused_or_dropped() {
        let one = Complex64::new(1.0, 0.0);
        assert!(Curve::from_receptance(&[1.0, 2.0], &[one], None).is_err());
        assert!(Curve::from_receptance(&[2.0, 1.0], &[one, one], None).is_err());
        let nan = Complex64::new(f64::NAN, 0.0);
        let curve = Curve::from_receptance(&[0.0, 1.0, 2.0], &[nan, nan, one], None).unwrap();
        assert_eq!((curve.len(), curve.dropped), (1, 1));
    }
}
