//! What Φ(iω) is to the solver, and Φ from modes; [`crate::lobes::dynamics::sampled`] has it from measured lines.

use std::f64::consts::TAU;

use num_complex::Complex64;

use crate::{Error, Result};

/// Displacement (m) over force (N), 2×2: row = response axis, column = force axis.
pub type Receptance = [[Complex64; 2]; 2];

/// The direct FRF of the tool point in the two axes of a regenerative force.
pub trait ToolPointFrf: Sync {
    /// Receptance at a frequency within [`band_hz`](Self::band_hz), time factor e^{+iωt}.
    fn receptance(&self, frequency_hz: f64) -> Receptance;

    /// Lowest and highest frequency at which the FRF is known; chatter is searched there only.
    fn band_hz(&self) -> (f64, f64);

    /// Ascending frequencies from one end of the band to the other that no resonance slips through;
    /// the solver refines between them.
    fn seed_grid_hz(&self) -> Vec<f64>;
}

/// A real mode of one axis: H = (1/k) ω_n² / (ω_n² − ω² + 2iζω_nω).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisMode {
    /// 0 = first axis (x), 1 = second axis (y).
    pub axis: usize,
    /// Undamped natural frequency, Hz.
    pub frequency_hz: f64,
    /// Viscous damping ratio ζ.
    pub damping_ratio: f64,
    /// Modal stiffness k, N/m (N·m/rad for a rotation).
    pub stiffness_n_per_m: f64,
}

/// A mode with its mass-normalised shape at the tool point: H = φ φᵀ / (ω_n² − ω² + 2iζω_nω).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mode {
    /// Undamped natural frequency ω_n, rad/s.
    pub omega_n_rad_per_s: f64,
    /// Viscous damping ratio ζ.
    pub damping_ratio: f64,
    /// Mass-normalised displacement in the two axes, kg^−½.
    pub shape: [f64; 2],
}

/// Modal sum with a constant residual.
#[derive(Debug, Clone)]
pub struct ModalFrf {
    modes: Vec<Mode>,
    residual_m_per_n: [[f64; 2]; 2],
    band_hz: (f64, f64),
}

/// The band runs from the lowest mode over this …
const BELOW_LOWEST_MODE: f64 = 50.0;
/// … to the highest mode times this, where the receptance is down to 1/15 of that mode's static flexibility.
const ABOVE_HIGHEST_MODE: f64 = 4.0;

impl ModalFrf {
    /// Real modes, each along one axis (no cross FRF).
    ///
    /// # Errors
    /// No mode, an axis other than 0 and 1, or a frequency, damping ratio or stiffness that is not positive and finite.
    pub fn from_axis_modes(modes: &[AxisMode]) -> Result<Self> {
        let shapes = modes
            .iter()
            .map(|mode| {
                let omega = TAU * mode.frequency_hz;
                if mode.axis > 1 || !(mode.stiffness_n_per_m > 0.0 && mode.stiffness_n_per_m.is_finite()) {
                    return Err(Error::computation(format!(
                        "lobes: a mode at {} Hz needs an axis of the lobe's plane and a positive stiffness, not {}",
                        mode.frequency_hz, mode.stiffness_n_per_m
                    )));
                }
                let mut shape = [0.0; 2];
                shape[mode.axis] = omega / mode.stiffness_n_per_m.sqrt();
                Ok(Mode {
                    omega_n_rad_per_s: omega,
                    damping_ratio: mode.damping_ratio,
                    shape,
                })
            })
            .collect::<Result<Vec<_>>>()?;
        Self::from_mode_shapes(shapes, [[0.0; 2]; 2])
    }

    /// Modes with shapes, as a structural model gives them, and the static flexibility of the modes left out.
    ///
    /// # Errors
    /// No mode, or a frequency or damping ratio that is not positive, or anything not finite.
    pub fn from_mode_shapes(modes: Vec<Mode>, residual_m_per_n: [[f64; 2]; 2]) -> Result<Self> {
        for mode in &modes {
            let positive = |v: f64| v > 0.0 && v.is_finite();
            if !positive(mode.omega_n_rad_per_s) || !positive(mode.damping_ratio) {
                return Err(Error::computation(format!(
                    "lobes need modes of positive frequency and damping, not {} Hz with damping ratio {}",
                    mode.omega_n_rad_per_s / TAU,
                    mode.damping_ratio
                )));
            }
            if !mode.shape.iter().all(|v| v.is_finite()) {
                return Err(Error::computation("lobes: a mode shape is not finite"));
            }
        }
        if !residual_m_per_n.iter().flatten().all(|v| v.is_finite()) {
            return Err(Error::computation(
                "lobes: the residual flexibility is not finite",
            ));
        }
        let band_hz = band_around(modes.iter().map(|m| m.omega_n_rad_per_s / TAU))
            .ok_or_else(|| Error::computation("lobes need at least one mode"))?;
        Ok(ModalFrf {
            modes,
            residual_m_per_n,
            band_hz,
        })
    }

    /// Searches chatter in another band than the one its modes suggest.
    pub fn with_band_hz(mut self, from_hz: f64, to_hz: f64) -> Result<Self> {
        if !(from_hz > 0.0 && to_hz > from_hz && to_hz.is_finite()) {
            return Err(Error::computation(format!(
                "lobes: {from_hz} to {to_hz} Hz is no frequency band"
            )));
        }
        self.band_hz = (from_hz, to_hz);
        Ok(self)
    }

    /// The modes of the sum.
    pub fn modes(&self) -> &[Mode] {
        &self.modes
    }

    /// Static flexibility of what is not among the modes.
    pub fn residual_m_per_n(&self) -> &[[f64; 2]; 2] {
        &self.residual_m_per_n
    }
}

impl ToolPointFrf for ModalFrf {
    fn receptance(&self, frequency_hz: f64) -> Receptance {
        let w = TAU * frequency_hz;
        let mut h = self.residual_m_per_n.map(|row| row.map(Complex64::from));
        for mode in &self.modes {
            let wn = mode.omega_n_rad_per_s;
            let (re, im) = (wn * wn - w * w, 2.0 * mode.damping_ratio * wn * w);
            let inverse = 1.0 / (re * re + im * im);
            let q = Complex64::new(re * inverse, -im * inverse);
            let [a, b] = mode.shape;
            h[0][0] += a * a * q;
            h[1][1] += b * b * q;
            if a != 0.0 && b != 0.0 {
                h[0][1] += a * b * q;
                h[1][0] += a * b * q;
            }
        }
        h
    }

    fn band_hz(&self) -> (f64, f64) {
        self.band_hz
    }

    fn seed_grid_hz(&self) -> Vec<f64> {
        let resonances = self
            .modes
            .iter()
            .map(|m| (m.omega_n_rad_per_s / TAU, m.damping_ratio));
        resonance_grid(resonances, self.band_hz)
    }
}

/// Even steps of phase around every resonance (frequency in Hz, damping ratio), and a coarse geometric grid between.
pub(crate) fn resonance_grid(
    resonances: impl Iterator<Item = (f64, f64)>,
    (low, high): (f64, f64),
) -> Vec<f64> {
    const COARSE: usize = 64;
    let ratio = (high / low).ln();
    let mut grid: Vec<f64> = (1..COARSE)
        .map(|i| low * (ratio * i as f64 / COARSE as f64).exp())
        .collect();
    for (f, damping_ratio) in resonances {
        grid.extend((-8..=8).map(|step| {
            let phase = f64::from(step) * std::f64::consts::PI / 18.0;
            f * (1.0 + damping_ratio * phase.tan())
        }));
    }
    within_band(grid, low, high)
}

/// The band in which chatter is sought around modes at these frequencies (Hz); `None` without any.
pub(crate) fn band_around(frequencies_hz: impl Iterator<Item = f64> + Clone) -> Option<(f64, f64)> {
    let lowest = frequencies_hz.clone().reduce(f64::min)?;
    let highest = frequencies_hz.reduce(f64::max)?;
    Some((lowest / BELOW_LOWEST_MODE, highest * ABOVE_HIGHEST_MODE))
}

/// Ascending, without near doubles, both ends of the band included.
fn within_band(mut grid: Vec<f64>, low: f64, high: f64) -> Vec<f64> {
    grid.retain(|f| *f > low && *f < high);
    grid.extend([low, high]);
    grid.sort_by(f64::total_cmp);
    grid.dedup_by(|b, a| *b - *a <= 1e-9 * *b);
    grid
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn an_axis_mode_has_its_static_flexibility_and_resonance() {
        let frf = ModalFrf::from_axis_modes(&[AxisMode {
            axis: 1,
            frequency_hz: 12.0,
            damping_ratio: 0.02,
            stiffness_n_per_m: 2e6,
        }])
        .unwrap();
        assert_relative_eq!(frf.receptance(1e-6)[1][1].re, 5e-7, max_relative = 1e-9);
        let resonance = frf.receptance(12.0)[1][1];
        assert_relative_eq!(resonance.im, -5e-7 / 0.04, max_relative = 1e-12);
        assert_eq!(frf.receptance(12.0)[0][0], Complex64::ZERO);
    }

    #[test]
    fn bad_modes_are_refused() {
        let mode = AxisMode {
            axis: 0,
            frequency_hz: 10.0,
            damping_ratio: 0.02,
            stiffness_n_per_m: 1e6,
        };
        assert!(ModalFrf::from_axis_modes(&[]).is_err());
        assert!(ModalFrf::from_axis_modes(&[AxisMode { axis: 2, ..mode }]).is_err());
        assert!(
            ModalFrf::from_axis_modes(&[AxisMode {
                damping_ratio: 0.0,
                ..mode
            }])
            .is_err()
        );
        assert!(
            ModalFrf::from_axis_modes(&[AxisMode {
                frequency_hz: f64::NAN,
                ..mode
            }])
            .is_err()
        );
        assert!(
            ModalFrf::from_axis_modes(&[AxisMode {
                stiffness_n_per_m: -1.0,
                ..mode
            }])
            .is_err()
        );
    }
}
