//! Φ at the tool point of the robot model.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use num_complex::Complex64;

use super::frf::{DirectFrf, Receptance, band_around, resonance_grid};
use crate::robot::frf::{Response, natural_frequencies_hz};
use crate::robot::{Chain, FrfBasis, Kinematics, RobotModel};
use crate::{Error, Result};

/// Receptance of the tool centre point in the plane normal to the tool axis. First axis: the base's x projected into
/// that plane; second: normal to it, so that the third points from the workpiece to the spindle. For a vertical tool
/// these are the base's x and y.
pub struct RobotFrf {
    basis: FrfBasis,
    resonances: Vec<(f64, f64)>,
    band_hz: (f64, f64),
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
    pub fn new(robot: &RobotModel, kinematics: &Kinematics, chain: &Chain) -> Result<Self> {
        let rows: Vec<_> = lobe_axes(kinematics.tool_axis())
            .iter()
            .map(|axis| chain.output_row(kinematics.tcp(), robot.flange_place(), true, axis))
            .collect();
        let system = chain.system(0);
        let basis = FrfBasis::new(&system, &rows)?;
        let frequencies = natural_frequencies_hz(&system)?;
        let band_hz = band_around(frequencies.iter().copied())
            .ok_or_else(|| Error::computation("lobes need at least one mode"))?;
        // Only the density of the grid hangs on this; chains without modal damping get a narrow guess.
        let zeta = system.modal_damping_ratio.value;
        let zeta = if zeta > 0.0 { zeta } else { 0.01 };
        let resonances = frequencies.into_iter().map(|f| (f, zeta)).collect();
        Ok(RobotFrf {
            basis,
            resonances,
            band_hz,
        })
    }
}

impl DirectFrf for RobotFrf {
    fn receptance(&self, frequency_hz: f64) -> Receptance {
        let mut response = Response::default();
        // Only an undamped system at its resonance has no response; no depth is safe there.
        if self.basis.solve(TAU * frequency_hz, &mut response).is_err() {
            return [[Complex64::new(0.0, -f64::MAX.sqrt()); 2]; 2];
        }
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
    use crate::lobes::{ModalFrf, Mode, RegenerativeForce, SpeedLimit, StabilitySolver, speed_grid};
    use crate::robot::fixture::{TAP_POSTURES, irb6640};
    use crate::robot::{Baseline, ModalBasis};

    #[test]
    fn a_vertical_tool_has_the_base_axes() {
        let [x, y] = lobe_axes(-Vector3::z());
        assert!((x - Vector3::x()).norm() < 1e-12 && (y - Vector3::y()).norm() < 1e-12);
    }

    /// The same modes given as shapes lead to the same lobes.
    #[test]
    fn robot_and_mode_shapes_agree() {
        let robot = RobotModel::new(irb6640());
        let kinematics = robot.kinematics(&TAP_POSTURES[0]).unwrap();
        let baseline = Baseline::nominal(&robot.spec);
        let chain = robot.chain(&kinematics, &baseline);
        let frf = RobotFrf::new(&robot, &kinematics, &chain).unwrap();
        let system = chain.system(0);
        let modes = ModalBasis::new(&system.stiffness, &system.mass).unwrap();
        let rows = lobe_axes(kinematics.tool_axis())
            .map(|d| chain.output_row(kinematics.tcp(), robot.flange_place(), true, &d));
        let shapes = (0..6)
            .map(|k| {
                let omega = 1.0 / modes.inverse_omega2[k].sqrt();
                Mode {
                    omega_n_rad_per_s: omega,
                    damping_ratio: baseline.damping_ratio.value,
                    shape: [0, 1].map(|a| rows[a].dot(&modes.shapes.column(k)) * omega),
                }
            })
            .collect();
        let modal = ModalFrf::from_mode_shapes(shapes, [[0.0; 2]; 2]).unwrap();
        let force = RegenerativeForce::drilling_lateral(1014.2, 619.9, 1.178, 2).unwrap();
        let speeds = speed_grid([100.0, 900.0, 10.0]).unwrap();
        let ours = StabilitySolver::new(force, &frf).curve(&speeds);
        let theirs = StabilitySolver::new(force, &modal).curve(&speeds);
        for (a, b) in ours.depth_limit_mm.iter().zip(&theirs.depth_limit_mm) {
            approx::assert_relative_eq!(a.unwrap(), b.unwrap(), max_relative = 1e-6);
        }
    }
}
