//! A structure as first-order equations, for methods that step through time.

use std::f64::consts::TAU;

use nalgebra::DMatrix;

use super::frf::ModalFrf;

/// ẏ = L y + B F, r = C y + R F: force F (N) and displacement r (m) in the two axes of the lobes' plane.
#[derive(Debug, Clone)]
pub struct StateSpace {
    /// L, n×n, 1/s.
    pub dynamics: DMatrix<f64>,
    /// B, n×2.
    pub input: DMatrix<f64>,
    /// C, 2×n; C B = 0 (a force moves nothing at once but through the residual).
    pub output: DMatrix<f64>,
    /// R, m/N: what the modes that are left out give way at once.
    pub residual_m_per_n: [[f64; 2]; 2],
    /// The highest natural frequency among the states, Hz.
    pub highest_hz: f64,
}

impl From<&ModalFrf> for StateSpace {
    /// Two states a mode: modal displacement and modal velocity over ω, so that both are of one size.
    fn from(frf: &ModalFrf) -> Self {
        let modes = frf.modes();
        let n = 2 * modes.len();
        let (mut dynamics, mut input, mut output) =
            (DMatrix::zeros(n, n), DMatrix::zeros(n, 2), DMatrix::zeros(2, n));
        for (i, mode) in modes.iter().enumerate() {
            let omega = mode.omega_n_rad_per_s;
            dynamics[(2 * i, 2 * i + 1)] = omega;
            dynamics[(2 * i + 1, 2 * i)] = -omega;
            dynamics[(2 * i + 1, 2 * i + 1)] = -2.0 * mode.damping_ratio * omega;
            for axis in 0..2 {
                input[(2 * i + 1, axis)] = mode.shape[axis] / omega;
                output[(axis, 2 * i)] = mode.shape[axis];
            }
        }
        StateSpace {
            dynamics,
            input,
            output,
            residual_m_per_n: *frf.residual_m_per_n(),
            highest_hz: modes.iter().map(|m| m.omega_n_rad_per_s / TAU).fold(0.0, f64::max),
        }
    }
}
