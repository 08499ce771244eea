//! Φ at the tool point of the robot model.

use std::f64::consts::TAU;

use nalgebra::{DVector, Vector3};
use num_complex::Complex64;

use crate::lobes::dynamics::frf::{ModalFrf, Mode, Receptance, ToolPointFrf, band_around, resonance_grid};
use crate::lobes::milling::state_space::StateSpace;
use crate::robot::frf::natural_frequencies_hz;
use crate::robot::{Chain, FrfBasis, Kinematics, ModalBasis, RobotModel, System};
use crate::{Error, Result};

/// Receptance of the tool centre point in the plane normal to the tool axis. First axis: the base's x projected into
/// that plane; second: normal to it, so that the third points from the workpiece to the spindle. For a vertical tool
/// these are the base's x and y.
pub struct RobotFrf {
    basis: FrfBasis,
    resonances: Vec<(f64, f64)>,
    band_hz: (f64, f64),
    system: System,
    rows: [DVector<f64>; 2],
}

/// The two axes of the lobes' plane for a tool axis that points from the spindle to the workpiece.
pub fn lobe_axes(tool_axis: Vector3<f64>) -> [Vector3<f64>; 2] {
    let up = -tool_axis;
    // Where the tool lies along the base's x, its y serves.
    let seed = if up.x.abs() < 0.9 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    let first = (seed - up * up.dot(&seed)).normalize();
    [first, up.cross(&first)]
}

impl RobotFrf {
    /// The receptance of the tool centre point in the two axes across the tool ([`lobe_axes`]).
    pub fn new(robot: &RobotModel, kinematics: &Kinematics, chain: &Chain) -> Result<Self> {
        let rows = lobe_axes(kinematics.tool_axis())
            .map(|axis| chain.output_row(kinematics.tcp(), robot.flange_place(), true, &axis));
        Self::of_rows(chain, rows)
    }

    /// The receptance of the tool centre point along the tool axis into the workpiece (m, N) and about it (rad, N·m).
    pub fn axial_torsional(robot: &RobotModel, kinematics: &Kinematics, chain: &Chain) -> Result<Self> {
        let (axis, place) = (kinematics.tool_axis(), robot.flange_place());
        let jacobian = chain.jacobian(kinematics.tcp(), place);
        let rows = [
            chain.output_row(kinematics.tcp(), place, true, &axis),
            jacobian.fixed_rows::<3>(3).transpose() * axis,
        ];
        Self::of_rows(chain, rows)
    }

    fn of_rows(chain: &Chain, rows: [DVector<f64>; 2]) -> Result<Self> {
        let system = chain.system(0);
        let basis = FrfBasis::new(&system, &rows)?;
        let frequencies = natural_frequencies_hz(&system)?;
        let band_hz = band_around(frequencies.iter().copied())
            .ok_or_else(|| Error::computation("lobes need at least one mode"))?;
        // Only the density of the grid depends on this; chains without modal damping get a narrow guess.
        let zeta = system.modal_damping_ratio.value;
        let zeta = if zeta > 0.0 { zeta } else { 0.01 };
        let resonances = frequencies.into_iter().map(|f| (f, zeta)).collect();
        Ok(RobotFrf {
            basis,
            resonances,
            band_hz,
            system,
            rows,
        })
    }

    /// The same structure as first-order equations, for methods that step through time.
    pub fn state_space(&self) -> Result<StateSpace> {
        StateSpace::of_system(&self.system, &self.rows)
    }

    /// The same FRF as a modal sum, which is quicker; `None` where modes are coupled (dampers, branches).
    pub fn modal(&self) -> Result<Option<ModalFrf>> {
        let system = &self.system;
        let zeta = system.modal_damping_ratio.value;
        if system.viscous.is_some() || system.chain_count < system.stiffness.nrows() || !(zeta > 0.0) {
            return Ok(None);
        }
        let basis = ModalBasis::new(&system.stiffness, &system.mass)?;
        let mut residual = [[0.0; 2]; 2];
        let mut modes = Vec::new();
        for (i, mu) in basis.inverse_omega2.iter().enumerate() {
            let along = [0, 1].map(|a: usize| self.rows[a].dot(&basis.shapes.column(i)));
            if *mu > 0.0 {
                let omega_n_rad_per_s = 1.0 / mu.sqrt();
                modes.push(Mode {
                    omega_n_rad_per_s,
                    damping_ratio: zeta,
                    shape: along.map(|v| v * omega_n_rad_per_s),
                });
            } else {
                for (a, row) in residual.iter_mut().enumerate() {
                    for (b, value) in row.iter_mut().enumerate() {
                        *value += along[a] * along[b];
                    }
                }
            }
        }
        ModalFrf::from_mode_shapes(modes, residual).map(Some)
    }
}

impl ToolPointFrf for RobotFrf {
    fn receptance(&self, frequency_hz: f64) -> Receptance {
        // Only an undamped system at its resonance has no response; no depth is safe there.
        let Ok(response) = self.basis.solve(TAU * frequency_hz) else {
            return [[Complex64::new(0.0, -f64::MAX.sqrt()); 2]; 2];
        };
        [0, 1].map(|out| [0, 1].map(|input| self.basis.receptance(&response, out, input)))
    }

    fn band_hz(&self) -> (f64, f64) {
        self.band_hz
    }

    fn seed_grid_hz(&self) -> Vec<f64> {
        resonance_grid(self.resonances.iter().copied(), self.band_hz)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lobes::{RegenerativeForce, SpeedLimit, StabilitySolver, speed_grid};
    use crate::robot::fixture::{TAP_POSTURES, flexible_tool, irb6640};
    use crate::robot::{Baseline, Dual};

    #[test]
    fn a_vertical_tool_has_the_base_axes() {
        let [x, y] = lobe_axes(-Vector3::z());
        assert!((x - Vector3::x()).norm() < 1e-12 && (y - Vector3::y()).norm() < 1e-12);
    }

    /// The same structure as modal sum and as state space: rigid links, bending links, and with a damper and a branch.
    #[test]
    fn modal_sum_and_state_space_are_the_same_structure() {
        let robot = RobotModel::new(irb6640());
        let kinematics = robot.kinematics(&TAP_POSTURES[0]).unwrap();
        let rigid = Baseline::nominal(&robot.spec);
        let mut bending = rigid.clone();
        bending.young_pa = Some(Dual::constant(200e9));
        let mut coupled = robot.chain(&kinematics, &rigid);
        coupled.modal_damping_ratio = Dual::constant(0.0);
        for element in &mut coupled.elements {
            element.damping = Some(Dual::constant(1500.0));
        }
        coupled.branches.push(flexible_tool(&robot, &kinematics));
        let chains = [
            robot.chain(&kinematics, &rigid),
            robot.chain(&kinematics, &bending),
            coupled,
        ];
        for (case, chain) in chains.iter().enumerate() {
            let frf = RobotFrf::new(&robot, &kinematics, chain).unwrap();
            let states = frf.state_space().unwrap();
            let modal = frf.modal().unwrap();
            assert_eq!(modal.is_some(), case < 2);
            for f in [0.5, 7.6, 12.0, 23.0, 60.0] {
                let exact = frf.receptance(f);
                let scale = exact[0][0].norm() + exact[1][1].norm();
                let stepped = states.receptance(f).unwrap();
                for (a, b) in exact.iter().flatten().zip(stepped.iter().flatten()) {
                    assert!((a - b).norm() < 1e-4 * scale, "case {case}, {f} Hz: {a} {b}");
                }
                if let Some(modal) = &modal {
                    for (a, b) in exact.iter().flatten().zip(modal.receptance(f).iter().flatten()) {
                        assert!((a - b).norm() < 1e-9 * scale, "case {case}, {f} Hz: {a} {b}");
                    }
                }
            }
        }
    }

    /// The modal sum leads to the same lobes.
    #[test]
    fn robot_and_modal_sum_have_the_same_lobes() {
        let robot = RobotModel::new(irb6640());
        let kinematics = robot.kinematics(&TAP_POSTURES[0]).unwrap();
        let chain = robot.chain(&kinematics, &Baseline::nominal(&robot.spec));
        let frf = RobotFrf::new(&robot, &kinematics, &chain).unwrap();
        let modal = frf.modal().unwrap().unwrap();
        let force = RegenerativeForce::drilling_lateral(1014.2, 619.9, 1.178, 2).unwrap();
        let speeds = speed_grid([100.0, 900.0, 10.0]).unwrap();
        let ours = StabilitySolver::new(force, &frf).curve(&speeds);
        let theirs = StabilitySolver::new(force, &modal).curve(&speeds);
        for (a, b) in ours.depth_limit_mm.iter().zip(&theirs.depth_limit_mm) {
            approx::assert_relative_eq!(a.unwrap(), b.unwrap(), max_relative = 1e-6);
        }
    }
}
