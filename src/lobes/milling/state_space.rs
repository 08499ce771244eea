//! A structure as first-order equations, for methods that step through time.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

use crate::lobes::dynamics::frf::{ModalFrf, Receptance};
use crate::robot::{ModalBasis, System};
use crate::{Error, Result};

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
            highest_hz: modes
                .iter()
                .map(|m| m.omega_n_rad_per_s / TAU)
                .fold(0.0, f64::max),
        }
    }
}

/// Chain modes up to this multiple of the lowest natural frequency are states; the others are residual flexibility.
const STATES_UP_TO: f64 = 40.0;

impl StateSpace {
    /// A chain's matrices between two outputs (rows of displacement per coordinate): its lower modes and all of its
    /// branches, with their modal and viscous damping; what the higher modes give way statically is the residual.
    ///
    /// # Errors
    /// Matrices that are not those of a structure.
    pub fn of_system(system: &System, rows: &[DVector<f64>; 2]) -> Result<Self> {
        let singular = || Error::computation("lobes: the structure's matrices are singular");
        let (total, chain) = (system.stiffness.nrows(), system.chain_count);
        let chain_stiffness = system.stiffness.view((0, 0), (chain, chain)).into_owned();
        let modes = ModalBasis::new(&chain_stiffness, &system.chain_mass)?;
        let slowest = modes.inverse_omega2.first().copied().unwrap_or(0.0);
        let least = slowest / (STATES_UP_TO * STATES_UP_TO);
        let kept = modes
            .inverse_omega2
            .iter()
            .filter(|mu| **mu > 0.0 && **mu >= least)
            .count();
        // In this basis the stiffness is the identity.
        let m = kept + total - chain;
        let mut basis = DMatrix::zeros(total, m);
        basis
            .view_mut((0, 0), (chain, kept))
            .copy_from(&modes.shapes.columns(0, kept));
        for i in chain..total {
            basis[(i, kept + i - chain)] = 1.0 / system.stiffness[(i, i)].sqrt();
        }
        let mass = basis.transpose() * &system.mass * &basis;
        let mut damping = match &system.viscous {
            Some(viscous) => basis.transpose() * viscous * &basis,
            None => DMatrix::zeros(m, m),
        };
        for i in 0..kept {
            damping[(i, i)] += 2.0 * system.modal_damping_ratio.value * modes.inverse_omega2[i].sqrt();
        }
        let reduced = ModalBasis::new(&DMatrix::identity(m, m), &mass)?;
        let lower = mass.cholesky().ok_or_else(singular)?.l();
        let inverse = lower
            .solve_lower_triangular(&DMatrix::identity(m, m))
            .ok_or_else(singular)?;
        let output_modes = DMatrix::from_fn(2, m, |axis, i| rows[axis].dot(&basis.column(i)));
        // Displacement in the basis, and velocity weighed with the root of the mass: both of the size of energy.
        let mut dynamics = DMatrix::zeros(2 * m, 2 * m);
        dynamics.view_mut((0, m), (m, m)).copy_from(&inverse.transpose());
        dynamics.view_mut((m, 0), (m, m)).copy_from(&-&inverse);
        dynamics
            .view_mut((m, m), (m, m))
            .copy_from(&-(&inverse * damping * inverse.transpose()));
        let mut input = DMatrix::zeros(2 * m, 2);
        input
            .view_mut((m, 0), (m, 2))
            .copy_from(&(&inverse * output_modes.transpose()));
        let mut output = DMatrix::zeros(2, 2 * m);
        output.view_mut((0, 0), (2, m)).copy_from(&output_modes);
        let whole = system.stiffness.clone().cholesky().ok_or_else(singular)?;
        let residual_m_per_n = [0, 1].map(|i: usize| {
            let given = whole.solve(&rows[i]);
            [0, 1].map(|j: usize| rows[j].dot(&given) - output_modes.row(i).dot(&output_modes.row(j)))
        });
        Ok(StateSpace {
            dynamics,
            input,
            output,
            residual_m_per_n,
            highest_hz: reduced.natural_frequencies_hz().into_iter().fold(0.0, f64::max),
        })
    }

    /// Receptance, m/N: C (iω − L)⁻¹ B + R.
    pub fn receptance(&self, frequency_hz: f64) -> Option<Receptance> {
        let n = self.dynamics.nrows();
        let matrix = DMatrix::from_fn(n, n, |i, j| {
            let diagonal = if i == j { TAU * frequency_hz } else { 0.0 };
            Complex64::new(-self.dynamics[(i, j)], diagonal)
        });
        let states = matrix.lu().solve(&self.input.map(Complex64::from))?;
        let h = self.output.map(Complex64::from) * states;
        Some([0, 1].map(|i| [0, 1].map(|j| h[(i, j)] + self.residual_m_per_n[i][j])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lobes::dynamics::frf::{AxisMode, ToolPointFrf};

    #[test]
    fn modes_keep_their_receptance() {
        let mode = |axis, frequency_hz, stiffness_n_per_m| AxisMode {
            axis,
            frequency_hz,
            damping_ratio: 0.03,
            stiffness_n_per_m,
        };
        let frf =
            ModalFrf::from_axis_modes(&[mode(0, 12.0, 1e6), mode(1, 15.0, 2e6), mode(0, 40.0, 8e6)]).unwrap();
        let states = StateSpace::from(&frf);
        for f in [1.0, 11.9, 15.2, 70.0] {
            let (a, b) = (frf.receptance(f), states.receptance(f).unwrap());
            for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
                assert!(
                    (a - b).norm() < 1e-10 * frf.receptance(f)[0][0].norm(),
                    "{f}: {a} {b}"
                );
            }
        }
    }
}
