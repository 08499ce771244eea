//! A structure whose modes are coupled, as a sum over its complex poles: H(ω) = R + Σ_k R_k / (iω − λ_k).
//!
//! Dampers in the joints and masses on springs couple the modes of the chain; solving the coupled equations at every
//! frequency is what makes lobes of such models slow. The poles are found once. States: those of [`StateSpace`], which
//! takes modes far above the lowest as static flexibility.

use std::f64::consts::TAU;

use faer::Mat;
use faer::prelude::Solve;
use num_complex::Complex64;

use crate::Result;
use crate::lobes::dynamics::frf::{Receptance, ToolPointFrf, resonance_grid};
use crate::lobes::dynamics::robot::RobotFrf;
use crate::lobes::milling::state_space::StateSpace;

/// How far the sum may be off the states' own receptance, relative: beyond it the poles are too close to being one.
const SAME: f64 = 1e-8;

/// Sum over complex poles with a constant residual.
#[derive(Debug, Clone)]
pub struct PoleFrf {
    /// λ (1/s) and residue (m/N/s), 2×2.
    poles: Vec<(Complex64, Receptance)>,
    residual_m_per_n: [[f64; 2]; 2],
    band_hz: (f64, f64),
}

impl PoleFrf {
    /// The poles of a robot's FRF; `None` where they do not describe it (a mode just critically damped has no two of
    /// them).
    ///
    /// # Errors
    /// Matrices that are not those of a structure.
    pub fn of_robot(frf: &RobotFrf) -> Result<Option<Self>> {
        let states = frf.state_space()?;
        Ok(Self::of_states(&states, frf.band_hz()))
    }

    fn of_states(states: &StateSpace, band_hz: (f64, f64)) -> Option<Self> {
        let n = states.dynamics.nrows();
        let dynamics = Mat::from_fn(n, n, |i, j| states.dynamics[(i, j)]);
        let eigen = dynamics.eigen().ok()?;
        let (vectors, values) = (eigen.U(), eigen.S().column_vector());
        let input = Mat::from_fn(n, 2, |i, j| Complex64::from(states.input[(i, j)]));
        let into = vectors.partial_piv_lu().solve(&input);
        let out = |axis: usize, k: usize| -> Complex64 {
            (0..n).map(|i| states.output[(axis, i)] * vectors[(i, k)]).sum()
        };
        let poles = (0..n)
            .map(|k| {
                (
                    values[k],
                    [0, 1].map(|i| [0, 1].map(|j| out(i, k) * into[(k, j)])),
                )
            })
            .collect();
        let found = PoleFrf {
            poles,
            residual_m_per_n: states.residual_m_per_n,
            band_hz,
        };
        let (low, high) = band_hz;
        let checked = [0.02, 0.2, 0.4, 0.6, 0.8].map(|share: f64| low * (high / low).powf(share));
        let agrees = |f: f64| {
            states.receptance(f).is_some_and(|exact| {
                let scale: f64 = exact.iter().flatten().map(|h| h.norm()).sum();
                let ours = found.receptance(f);
                let mut pairs = ours.iter().flatten().zip(exact.iter().flatten());
                pairs.all(|(a, b)| (a - b).norm() <= SAME * scale)
            })
        };
        checked.into_iter().all(agrees).then_some(found)
    }
}

impl ToolPointFrf for PoleFrf {
    fn receptance(&self, frequency_hz: f64) -> Receptance {
        let mut h = self.residual_m_per_n.map(|row| row.map(Complex64::from));
        for (pole, residue) in &self.poles {
            let factor = 1.0 / (Complex64::new(0.0, TAU * frequency_hz) - pole);
            for (row, of) in h.iter_mut().zip(residue) {
                for (value, r) in row.iter_mut().zip(of) {
                    *value += r * factor;
                }
            }
        }
        h
    }

    fn band_hz(&self) -> (f64, f64) {
        self.band_hz
    }

    fn seed_grid_hz(&self) -> Vec<f64> {
        // Overdamped poles are no resonances; a resonance damped by more than this is as broad as the coarse grid.
        let resonances = self
            .poles
            .iter()
            .filter(|(pole, _)| pole.im > 0.0)
            .map(|(pole, _)| {
                let damping_ratio = (-pole.re / pole.norm()).clamp(1e-6, 0.3);
                (pole.norm() / TAU, damping_ratio)
            });
        resonance_grid(resonances, self.band_hz)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lobes::{RegenerativeForce, SpeedLimit, StabilitySolver, speed_grid};
    use crate::robot::fixture::{TAP_POSTURES, flexible_tool, irb6640};
    use crate::robot::{Baseline, Dual, RobotModel};
    use nalgebra::DMatrix;

    /// Bending links, a damper in every joint and a flexible tool: the same lobes as with the coupled equations.
    #[test]
    fn a_coupled_structure_keeps_its_lobes() {
        let robot = RobotModel::new(irb6640());
        let kinematics = robot.kinematics(&TAP_POSTURES[0]).unwrap();
        let mut coupled = robot.chain(&kinematics, &Baseline::nominal(&robot.spec));
        coupled.modal_damping_ratio = Dual::constant(0.0);
        for element in &mut coupled.elements {
            element.damping = Some(Dual::constant(1500.0));
        }
        coupled.branches.push(flexible_tool(&robot, &kinematics));
        let exact = RobotFrf::new(&robot, &kinematics, &coupled).unwrap();
        let poles = PoleFrf::of_robot(&exact).unwrap().unwrap();
        for f in [0.5, 7.6, 12.0, 23.0, 60.0] {
            let (a, b) = (exact.receptance(f), poles.receptance(f));
            let scale = a[0][0].norm() + a[1][1].norm();
            for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
                assert!((a - b).norm() < 1e-4 * scale, "{f}: {a} {b}");
            }
        }
        let force = RegenerativeForce::drilling_lateral(1014.2, 619.9, 1.178, 2).unwrap();
        let speeds = speed_grid([100.0, 900.0, 50.0]).unwrap();
        let curve = |frf: &dyn ToolPointFrf| StabilitySolver::new(force, frf).curve(&speeds).depth_limit_mm;
        for (a, b) in curve(&exact).iter().zip(curve(&poles)) {
            approx::assert_relative_eq!(a.unwrap(), b.unwrap(), max_relative = 1e-3);
        }
    }

    /// A critically damped mode has a double pole and one vector: no sum over poles describes it.
    #[test]
    fn a_double_pole_is_noticed() {
        let (omega, n) = (60.0, 2);
        let mut states = StateSpace {
            dynamics: DMatrix::from_row_slice(n, n, &[0.0, omega, -omega, -2.0 * omega]),
            input: DMatrix::from_row_slice(n, 2, &[0.0, 0.0, 0.01, 0.0]),
            output: DMatrix::from_row_slice(2, n, &[0.6, 0.0, 0.0, 0.0]),
            residual_m_per_n: [[0.0; 2]; 2],
            highest_hz: omega / TAU,
        };
        assert!(PoleFrf::of_states(&states, (0.1, 50.0)).is_none());
        states.dynamics[(1, 1)] = -0.1 * omega;
        assert!(PoleFrf::of_states(&states, (0.1, 50.0)).is_some());
    }
}
