//! Φ(iω) from measured lines.

use num_complex::Complex64;

use crate::lobes::dynamics::frf::{Receptance, ToolPointFrf};
use crate::{Error, Result};

/// Measured lines with a smooth curve through them.
///
/// Between two lines each entry is a cubic over a denominator, through two lines on either side exactly. The
/// denominator 1 + c₁t + c₂t² is common to the entries and comes by least squares from six lines around (the local
/// rational method of McKelvey & Guérin, SYSID 2012): two modes and the slowly varying rest of the others. A
/// resonance with only two or three lines on it so keeps its true height. Where the lines give no two damped modes
/// (noise, antiresonances) one is tried, then none, the cubic through four lines.
#[derive(Debug, Clone)]
pub struct SampledFrf {
    frequency_hz: Vec<f64>,
    receptance: Vec<Receptance>,
    /// c₁, c₂ for each interval between two lines, t in spacings from the interval's lower line.
    denominator: Vec<[Complex64; 2]>,
}

/// The closest that a mode's pole may come to the real frequency axis, in line spacings.
const NEAREST_POLE: f64 = 0.25;
/// Ridge of the least squares relative to its diagonal: the second pole goes far away where the lines show but one.
const RIDGE: f64 = 1e-12;

impl SampledFrf {
    /// `frequency_hz` ascending and positive, as many as `receptance` (m/N).
    ///
    /// # Errors
    /// Fewer than six lines, unequal lengths, frequencies not ascending or not positive, a value not finite.
    pub fn new(frequency_hz: Vec<f64>, receptance: Vec<Receptance>) -> Result<Self> {
        if frequency_hz.len() < 6 || frequency_hz.len() != receptance.len() {
            return Err(Error::computation(format!(
                "lobes need at least six FRF lines with a value each, not {} lines and {} values",
                frequency_hz.len(),
                receptance.len()
            )));
        }
        let ascending = frequency_hz.windows(2).all(|f| f[1] > f[0]);
        if !ascending || frequency_hz[0] <= 0.0 || !frequency_hz.iter().all(|f| f.is_finite()) {
            return Err(Error::computation(
                "lobes need FRF lines of ascending positive frequency",
            ));
        }
        if !receptance.iter().flatten().flatten().all(|h| h.is_finite()) {
            return Err(Error::computation("lobes: an FRF value is not finite"));
        }
        let mut frf = SampledFrf {
            frequency_hz,
            receptance,
            denominator: Vec::new(),
        };
        frf.denominator = (0..frf.frequency_hz.len() - 1)
            .map(|interval| frf.fit_denominator(interval))
            .collect();
        Ok(frf)
    }

    /// Numbers of the `N` lines about an interval (shifted inwards at the ends), and where they lie: spacings from
    /// the interval's lower line.
    fn lines_about<const N: usize>(&self, interval: usize) -> ([usize; N], [f64; N]) {
        let first = (interval + 1)
            .saturating_sub(N / 2)
            .min(self.frequency_hz.len() - N);
        let lines: [usize; N] = std::array::from_fn(|j| first + j);
        (lines, lines.map(|l| self.place(interval, self.frequency_hz[l])))
    }

    fn place(&self, interval: usize, frequency_hz: f64) -> f64 {
        let (from, to) = (self.frequency_hz[interval], self.frequency_hz[interval + 1]);
        (frequency_hz - from) / (to - from)
    }

    /// The numerator is a parabola on any four lines in a row: the third divided difference of
    /// (1 + c₁t + c₂t²) h vanishes there, three linear equations for each of the four entries.
    fn fit_denominator(&self, interval: usize) -> [Complex64; 2] {
        let (lines, t) = self.lines_about::<6>(interval);
        let mut normal = Normal::default();
        for first in 0..3 {
            let at: [f64; 4] = std::array::from_fn(|j| t[first + j]);
            let weights = barycentric_weights(at);
            for entry in 0..4 {
                let mut difference = [Complex64::ZERO; 3];
                for j in 0..4 {
                    let mut term = weights[j] * self.receptance[lines[first + j]][entry / 2][entry % 2];
                    for d in &mut difference {
                        *d += term;
                        term *= at[j];
                    }
                }
                normal.add(difference);
            }
        }
        let none = [Complex64::ZERO; 2];
        [normal.two_poles(), normal.one_pole()]
            .into_iter()
            .find(is_damped)
            .unwrap_or(none)
    }
}

/// Sums for the least squares of d₀ + c₁ d₁ + c₂ d₂ = 0.
#[derive(Default)]
struct Normal {
    d11: f64,
    d22: f64,
    d12: Complex64,
    d10: Complex64,
    d20: Complex64,
}

impl Normal {
    fn add(&mut self, [d0, d1, d2]: [Complex64; 3]) {
        self.d11 += d1.norm_sqr();
        self.d22 += d2.norm_sqr();
        self.d12 += d1.conj() * d2;
        self.d10 += d1.conj() * d0;
        self.d20 += d2.conj() * d0;
    }

    fn two_poles(&self) -> [Complex64; 2] {
        let (a, b) = (self.d11 * (1.0 + RIDGE), self.d22 * (1.0 + RIDGE));
        let determinant = a * b - self.d12.norm_sqr();
        [
            (self.d12 * self.d20 - b * self.d10) / determinant,
            (self.d12.conj() * self.d10 - a * self.d20) / determinant,
        ]
    }

    fn one_pole(&self) -> [Complex64; 2] {
        [-self.d10 / self.d11, Complex64::ZERO]
    }
}

/// Whether the roots of 1 + c₁t + c₂t² are poles of damped modes: with e^{iωt} above the real frequency axis.
fn is_damped([c1, c2]: &[Complex64; 2]) -> bool {
    // 1/t solves u² + c₁u + c₂ = 0.
    let root = (c1 * c1 - 4.0 * c2).sqrt();
    let damped = |u: Complex64| u == Complex64::ZERO || u.inv().im > NEAREST_POLE;
    c1.is_finite() && c2.is_finite() && damped(-0.5 * (c1 + root)) && damped(-0.5 * (c1 - root))
}

fn barycentric_weights(t: [f64; 4]) -> [f64; 4] {
    std::array::from_fn(|j| {
        let product: f64 = (0..4).filter(|k| *k != j).map(|k| t[j] - t[k]).product();
        1.0 / product
    })
}

impl ToolPointFrf for SampledFrf {
    fn receptance(&self, frequency_hz: f64) -> Receptance {
        let (low, high) = self.band_hz();
        let f = frequency_hz.clamp(low, high);
        let last = self.frequency_hz.len() - 1;
        let interval = self
            .frequency_hz
            .partition_point(|line| *line <= f)
            .clamp(1, last)
            - 1;
        let (lines, t) = self.lines_about::<4>(interval);
        let place = self.place(interval, f);
        if let Some(hit) = (0..4).find(|j| t[*j] == place) {
            return self.receptance[lines[hit]];
        }
        let weights = barycentric_weights(t);
        let [c1, c2] = self.denominator[interval];
        let share: [Complex64; 4] =
            std::array::from_fn(|j| (1.0 + (c1 + c2 * t[j]) * t[j]) * (weights[j] / (place - t[j])));
        let inverse = share.iter().sum::<Complex64>().inv();
        std::array::from_fn(|row| {
            std::array::from_fn(|column| {
                let numerator: Complex64 = (0..4)
                    .map(|j| share[j] * self.receptance[lines[j]][row][column])
                    .sum();
                numerator * inverse
            })
        })
    }

    fn band_hz(&self) -> (f64, f64) {
        (
            self.frequency_hz[0],
            self.frequency_hz[self.frequency_hz.len() - 1],
        )
    }

    fn seed_grid_hz(&self) -> Vec<f64> {
        self.frequency_hz.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lobes::dynamics::frf::{ModalFrf, Mode};
    use approx::assert_relative_eq;
    use std::f64::consts::TAU;

    fn two_modes() -> ModalFrf {
        let mode = |f: f64, zeta, shape| Mode {
            omega_n_rad_per_s: TAU * f,
            damping_ratio: zeta,
            shape,
        };
        ModalFrf::from_mode_shapes(
            vec![mode(12.3, 0.005, [0.03, 0.02]), mode(19.0, 0.03, [0.01, -0.04])],
            [[1e-7, 0.0], [0.0, 2e-7]],
        )
        .unwrap()
    }

    /// Lines as wide as the half-power band of the sharper mode (ζ = 0.5 %): the curve between them is still the FRF.
    #[test]
    fn coarse_lines_keep_a_sharp_resonance() {
        let truth = two_modes();
        let lines: Vec<f64> = (20..600).map(|i| f64::from(i) * 0.1 + 0.03).collect();
        let values = lines.iter().map(|f| truth.receptance(*f)).collect();
        let frf = SampledFrf::new(lines, values).unwrap();
        for i in 0..4000 {
            let f = 5.0 + 0.01 * f64::from(i);
            let (a, b) = (truth.receptance(f), frf.receptance(f));
            for (r, c) in [(0, 0), (0, 1), (1, 1)] {
                let scale = (truth.receptance(f)[0][0].norm() * truth.receptance(f)[1][1].norm()).sqrt();
                assert!(
                    (a[r][c] - b[r][c]).norm() < 0.01 * scale,
                    "{f} Hz entry {r}{c}: {} {}",
                    a[r][c],
                    b[r][c]
                );
            }
        }
    }

    #[test]
    fn sampled_lines_are_met_exactly() {
        let truth = two_modes();
        let lines: Vec<f64> = (1..40).map(f64::from).collect();
        let values: Vec<_> = lines.iter().map(|f| truth.receptance(*f)).collect();
        let frf = SampledFrf::new(lines.clone(), values.clone()).unwrap();
        for (f, h) in lines.iter().zip(&values) {
            assert_relative_eq!(frf.receptance(*f)[0][0].re, h[0][0].re, max_relative = 1e-9);
            assert_relative_eq!(frf.receptance(*f)[0][1].im, h[0][1].im, max_relative = 1e-9);
        }
    }

    #[test]
    fn equal_neighbours_and_zero_entries_stay_finite() {
        let h = [
            [Complex64::from(1e-6), Complex64::ZERO],
            [Complex64::ZERO, Complex64::new(1e-7, -1e-8)],
        ];
        let frf = SampledFrf::new((1..7).map(f64::from).collect(), vec![h; 6]).unwrap();
        for i in 0..50 {
            let value = frf.receptance(0.5 + 0.1 * f64::from(i));
            assert!(value.iter().flatten().all(|v| v.is_finite()));
            assert_relative_eq!(value[0][0].re, 1e-6, max_relative = 1e-12);
        }
    }

    #[test]
    fn bad_lines_are_refused() {
        let h = [[Complex64::from(1e-6); 2]; 2];
        let lines = |n: usize| (1..=n).map(|i| i as f64).collect::<Vec<_>>();
        assert!(SampledFrf::new(lines(6), vec![h; 6]).is_ok());
        assert!(SampledFrf::new(lines(5), vec![h; 5]).is_err());
        assert!(SampledFrf::new(lines(7), vec![h; 6]).is_err());
        assert!(SampledFrf::new(vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0], vec![h; 6]).is_err());
        assert!(SampledFrf::new(vec![1.0, 3.0, 2.0, 4.0, 5.0, 6.0], vec![h; 6]).is_err());
        let mut bad = vec![h; 6];
        bad[2][0][1] = Complex64::new(f64::NAN, 0.0);
        assert!(SampledFrf::new(lines(6), bad).is_err());
    }
}
