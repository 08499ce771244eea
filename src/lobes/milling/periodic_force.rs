//! The milling force with its true time dependence: F(t) = b A(t) (r(t) − r(t − T)) + b P(t) ṙ(t), A and P periodic in
//! the tooth passing period T.
//!
//! A tooth at φ (from +y, clockwise) meets the chip Δr·n, n = (sin φ, cos φ), and is pushed by −Ktc along its way and
//! −Krc along n: the directional matrix of [`RegenerativeForce::milling_zero_order`] before it is averaged. Teeth are
//! straight (a helix smooths the entry; its pitch is long against the depths that robots cut).

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;

use crate::campaign::Immersion;
use crate::lobes::force::{RegenerativeForce, milling_directional_coefficients};
use crate::{Error, Result};

/// Ratio of tangential to radial process damping force: dry sliding of the flank.
const FLANK_FRICTION: f64 = 0.3;

/// Process damping: the flank presses on the wavy surface with the radial force b (C/V) ṙ·n against the tooth's motion
/// into the work and 0.3 of that against its way, V the cutting speed (Altintas, Eynian & Onozuka 2008,
/// "Identification of dynamic cutting force coefficients and chatter stability with process damping",
/// CIRP Annals 57(1)).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProcessDamping {
    /// C, N/m (0.61e6 for AISI 1045 in the source).
    pub coefficient_n_per_m: f64,
    /// Diameter of the tool, mm; with the spindle speed it gives the cutting speed.
    pub tool_diameter_mm: f64,
}

/// Milling as a periodic, delayed force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PeriodicForce {
    ktc_n_per_m2: f64,
    krc_n_per_m2: f64,
    /// Number of teeth.
    pub teeth: usize,
    immersion: Immersion,
    damping: Option<ProcessDamping>,
    average: RegenerativeForce,
}

impl PeriodicForce {
    /// Coefficients in N/mm².
    ///
    /// # Errors
    /// As [`RegenerativeForce::milling_zero_order`]; process damping that is negative, or a tool without diameter.
    pub fn new(
        ktc_n_per_mm2: f64,
        krc_n_per_mm2: f64,
        teeth: usize,
        immersion: Immersion,
        damping: Option<ProcessDamping>,
    ) -> Result<Self> {
        let average = RegenerativeForce::milling_zero_order(ktc_n_per_mm2, krc_n_per_mm2, teeth, immersion)?;
        if let Some(d) = damping {
            let coefficient = d.coefficient_n_per_m >= 0.0 && d.coefficient_n_per_m.is_finite();
            let diameter = d.tool_diameter_mm > 0.0 && d.tool_diameter_mm.is_finite();
            if !(coefficient && diameter) {
                return Err(Error::computation(format!(
                    "process damping needs a coefficient of 0 N/m or more and a tool diameter, not {} N/m and {} mm",
                    d.coefficient_n_per_m, d.tool_diameter_mm
                )));
            }
        }
        Ok(PeriodicForce {
            ktc_n_per_m2: ktc_n_per_mm2 * 1e6,
            krc_n_per_m2: krc_n_per_mm2 * 1e6,
            teeth,
            immersion,
            damping,
            average,
        })
    }

    /// Its average over a revolution, for the zero-order solution.
    pub fn average(&self) -> RegenerativeForce {
        self.average
    }

    /// Time between two teeth, s.
    pub fn period_s(&self, spindle_rpm: f64) -> f64 {
        60.0 / (self.teeth as f64 * spindle_rpm)
    }

    /// A_k of A(t) = Σ A_k e^{ikω_T t}, N/m², ω_T the tooth passing frequency; φ = 0 at t = 0.
    pub fn harmonic(&self, k: i64) -> [[Complex64; 2]; 2] {
        self.harmonic_of(self.ktc_n_per_m2, self.krc_n_per_m2, k)
    }

    /// P_k of P(t) in the same series, N s/m²; `None` without process damping.
    pub fn damping_harmonic(&self, k: i64, spindle_rpm: f64) -> Option<[[Complex64; 2]; 2]> {
        let (tangential, radial) = self.damping_coefficients(spindle_rpm)?;
        Some(self.harmonic_of(tangential, radial, k))
    }

    /// Tangential and radial process damping, N s/m².
    fn damping_coefficients(&self, spindle_rpm: f64) -> Option<(f64, f64)> {
        let damping = self.damping.filter(|d| d.coefficient_n_per_m > 0.0)?;
        let speed_m_per_s = PI * damping.tool_diameter_mm * 1e-3 * spindle_rpm / 60.0;
        let radial = damping.coefficient_n_per_m / speed_m_per_s;
        Some((FLANK_FRICTION * radial, radial))
    }

    /// (N/2π) ∫ a(φ) e^{−ikNφ} dφ over the immersion. With a(φ) = a₀ + a₊ e^{2iφ} + a₋ e^{−2iφ} each part is an
    /// exponential.
    fn harmonic_of(&self, tangential: f64, radial: f64, k: i64) -> [[Complex64; 2]; 2] {
        let Immersion { start_rad, exit_rad } = self.immersion;
        let integral = |m: f64| -> Complex64 {
            if m == 0.0 {
                return Complex64::from(exit_rad - start_rad);
            }
            let at = |phi: f64| Complex64::new(0.0, m * phi).exp();
            (at(exit_rad) - at(start_rad)) / Complex64::new(0.0, m)
        };
        let shift = -(k as f64) * self.teeth as f64;
        let (whole, plus, minus) = (integral(shift), integral(shift + 2.0), integral(shift - 2.0));
        let sine = (plus - minus) / Complex64::new(0.0, 2.0);
        let cosine = 0.5 * (plus + minus);
        let factor = self.teeth as f64 / TAU;
        directional(tangential, radial, whole, sine, cosine).map(|row| row.map(|v| v * factor))
    }

    /// Mean of A(t) over a stretch of the tooth's way, from φ to φ + dφ of the first of the N teeth, N/m².
    pub fn mean_over(&self, phi: f64, dphi: f64) -> [[f64; 2]; 2] {
        self.mean_of(self.ktc_n_per_m2, self.krc_n_per_m2, phi, dphi)
    }

    /// The same of P(t), N s/m².
    pub fn damping_mean_over(&self, phi: f64, dphi: f64, spindle_rpm: f64) -> Option<[[f64; 2]; 2]> {
        let (tangential, radial) = self.damping_coefficients(spindle_rpm)?;
        Some(self.mean_of(tangential, radial, phi, dphi))
    }

    fn mean_of(&self, tangential: f64, radial: f64, phi: f64, dphi: f64) -> [[f64; 2]; 2] {
        let kr = radial / tangential;
        let mut sum = [[0.0; 2]; 2];
        for tooth in 0..self.teeth {
            let start = (phi + TAU * tooth as f64 / self.teeth as f64).rem_euclid(TAU);
            // The stretch may reach over the full turn.
            for turn in [0.0, TAU] {
                let from = (start - turn).max(self.immersion.start_rad);
                let to = (start - turn + dphi).min(self.immersion.exit_rad);
                if to > from {
                    let part = Immersion {
                        start_rad: from,
                        exit_rad: to,
                    };
                    let alpha = milling_directional_coefficients(kr, part);
                    for (s, a) in sum.iter_mut().flatten().zip(alpha.iter().flatten()) {
                        *s += 0.5 * tangential * a / dphi;
                    }
                }
            }
        }
        sum
    }
}

/// ½ \[\[−Kt s − Kr (1 − c), −Kt (1 + c) − Kr s\], \[Kt (1 − c) − Kr s, Kt s − Kr (1 + c)\]\] with s, c = sin, cos 2φ.
fn directional(kt: f64, kr: f64, one: Complex64, s: Complex64, c: Complex64) -> [[Complex64; 2]; 2] {
    [
        [-kt * s - kr * (one - c), -kt * (one + c) - kr * s],
        [kt * (one - c) - kr * s, kt * s - kr * (one + c)],
    ]
    .map(|row| row.map(|v| 0.5 * v))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn force(immersion: Immersion) -> PeriodicForce {
        PeriodicForce::new(800.0, 250.0, 3, immersion, None).unwrap()
    }

    const PARTIAL: Immersion = Immersion {
        start_rad: 0.4,
        exit_rad: 2.1,
    };

    #[test]
    fn the_zeroth_harmonic_is_the_average() {
        let force = force(PARTIAL);
        let average = force.average().matrix_n_per_m2;
        for (a, b) in force.harmonic(0).iter().flatten().zip(average.iter().flatten()) {
            assert_relative_eq!(a.re, *b, max_relative = 1e-12);
            assert!(a.im.abs() < 1e-6);
        }
        let mean = force.mean_over(0.0, TAU / 3.0);
        for (a, b) in mean.iter().flatten().zip(average.iter().flatten()) {
            assert_relative_eq!(a, b, max_relative = 1e-12);
        }
    }

    /// The Fourier series against the tooth forces written down.
    #[test]
    fn harmonics_are_those_of_the_tooth_forces() {
        let force = force(PARTIAL);
        let (kt, kr, steps) = (800e6, 250e6, 40_000);
        for k in [-3i64, 1, 2, 7] {
            let mut sum = [[Complex64::ZERO; 2]; 2];
            for i in 0..steps {
                // One tooth pitch; all teeth.
                let phase = (f64::from(i) + 0.5) / f64::from(steps);
                let turn = Complex64::new(0.0, -TAU * k as f64 * phase).exp() / f64::from(steps);
                for tooth in 0..3 {
                    let phi = TAU * (phase + f64::from(tooth)) / 3.0;
                    if !(0.4..=2.1).contains(&phi) {
                        continue;
                    }
                    let (s, c) = phi.sin_cos();
                    for (j, chip) in [s, c].into_iter().enumerate() {
                        sum[0][j] += turn * (-(kt * c + kr * s) * chip);
                        sum[1][j] += turn * ((kt * s - kr * c) * chip);
                    }
                }
            }
            for (a, b) in force.harmonic(k).iter().flatten().zip(sum.iter().flatten()) {
                assert!((a - b).norm() < 1e-4 * kt, "{k}: {a} {b}");
            }
        }
    }

    #[test]
    fn a_bad_process_damping_is_refused() {
        for (coefficient_n_per_m, tool_diameter_mm) in [(-1.0, 10.0), (1e5, 0.0), (f64::NAN, 10.0)] {
            let damping = ProcessDamping {
                coefficient_n_per_m,
                tool_diameter_mm,
            };
            assert!(PeriodicForce::new(800.0, 250.0, 3, PARTIAL, Some(damping)).is_err());
        }
    }
}
