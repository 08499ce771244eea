//! Test cases with known modes (compiled for tests only).

use std::f64::consts::TAU;

use num_complex::Complex64;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

#[derive(Debug, Clone, Copy)]
pub struct SyntheticMode {
    pub frequency_hz: f64,
    pub damping_ratio: f64,
    /// Modal constant φ_out φ_in of a mass-normalised mode, 1/kg.
    pub constant: f64,
}

impl SyntheticMode {
    pub fn new(frequency_hz: f64, damping_ratio: f64, constant: f64) -> SyntheticMode {
        SyntheticMode {
            frequency_hz,
            damping_ratio,
            constant,
        }
    }

    /// The modes of one FRF of a set: frequency (Hz) and damping ratio, which the set shares, and the FRF's own constants.
    pub fn row(shared: &[(f64, f64)], constants: &[f64]) -> Vec<SyntheticMode> {
        let each = shared.iter().zip(constants);
        each.map(|(&(f, z), &a)| SyntheticMode::new(f, z, a)).collect()
    }
}

#[derive(Debug, Clone)]
pub struct Synthetic {
    frequency_hz: Vec<f64>,
    receptance: Vec<Complex64>,
}

impl Synthetic {
    /// Receptance Σ A / (ω₀² − ω² + 2iζω₀ω) on even lines.
    pub fn new(from_hz: f64, to_hz: f64, step_hz: f64, modes: &[SyntheticMode]) -> Synthetic {
        let count = ((to_hz - from_hz) / step_hz).round() as usize + 1;
        let frequency_hz: Vec<f64> = (0..count).map(|k| from_hz + step_hz * k as f64).collect();
        let receptance = frequency_hz
            .iter()
            .map(|f| {
                let w = TAU * f;
                modes
                    .iter()
                    .map(|m| {
                        let w0 = TAU * m.frequency_hz;
                        m.constant / Complex64::new(w0 * w0 - w * w, 2.0 * m.damping_ratio * w0 * w)
                    })
                    .sum()
            })
            .collect();
        Synthetic {
            frequency_hz,
            receptance,
        }
    }

    /// Adds complex Gaussian noise with E|e|² = (of_peak · max|H|)² + (of_local · |H|)².
    pub fn with_noise(mut self, of_peak: f64, of_local: f64, seed: u64) -> Synthetic {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let peak = self.receptance.iter().map(|h| h.norm()).fold(0.0, f64::max);
        for h in &mut self.receptance {
            let std = (of_peak * peak).hypot(of_local * h.norm());
            // Box–Muller: a complex normal number with E|e|² = 1.
            let radius = (-(1.0 - random.random::<f64>()).ln()).sqrt();
            *h += Complex64::from_polar(radius * std, TAU * random.random::<f64>());
        }
        self
    }

    pub fn mobility_peak(&self) -> f64 {
        let mobility = self
            .frequency_hz
            .iter()
            .zip(&self.receptance)
            .map(|(f, h)| TAU * f * h.norm());
        mobility.fold(0.0, f64::max)
    }

    pub fn frf(self) -> (Vec<f64>, Vec<Complex64>) {
        (self.frequency_hz, self.receptance)
    }
}
