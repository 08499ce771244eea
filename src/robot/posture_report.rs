//! What the model says of one posture: frequencies, tool point, static stiffness.

use nalgebra::{Point3, Vector3};

use super::chain::Chain;
use super::frf::natural_frequencies_hz;
use super::model::RobotModel;
use crate::robot::kinematics::dh::Kinematics;
use crate::{Error, Result};

/// Frequencies in Hz, ascending; stiffness 1/C_ii in base axes, N/m.
#[derive(Debug, Clone)]
pub struct PostureReport {
    /// Undamped natural frequencies, ascending, Hz.
    pub natural_frequencies_hz: Vec<f64>,
    /// Tool centre point, base frame, m.
    pub tcp_m: [f64; 3],
    /// Unit vector along the tool, from the spindle to the workpiece, base axes.
    pub tool_axis: [f64; 3],
    /// Static stiffness at the tool point along x, y, z, N/m.
    pub tcp_stiffness_n_per_m: [f64; 3],
    /// Static stiffness at the flange along x, y, z, N/m.
    pub flange_stiffness_n_per_m: [f64; 3],
}

impl PostureReport {
    /// Of a chain at its posture, with whatever effects it has. The tool point moves with a flexible tool where there is
    /// one; the flange does not.
    ///
    /// # Errors
    /// A chain whose stiffness is not positive definite.
    pub fn new(robot: &RobotModel, kinematics: &Kinematics, chain: &Chain) -> Result<Self> {
        Self::with_ground_springs(robot, kinematics, chain, [])
    }

    /// As [`new`](Self::new) with springs between the tool point and the ground: unit vector (base axes) and stiffness
    /// (N/m) of each.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_ground_springs(
        robot: &RobotModel,
        kinematics: &Kinematics,
        chain: &Chain,
        springs: impl IntoIterator<Item = (Vector3<f64>, f64)>,
    ) -> Result<Self> {
        let place = robot.flange_place();
        let mut system = chain.system(0);
        for (axis, stiffness_n_per_m) in springs {
            let row = chain.output_row(kinematics.tcp(), place, true, &axis);
            system.stiffness += &row * row.transpose() * stiffness_n_per_m;
        }
        let cholesky = system
            .stiffness
            .clone()
            .cholesky()
            .ok_or_else(|| Error::computation("the stiffness matrix is not positive definite"))?;
        let stiffness = |point: Point3<f64>, at_tool_point: bool| {
            [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| {
                let row = chain.output_row(point, place, at_tool_point, &axis);
                1.0 / row.dot(&cholesky.solve(&row))
            })
        };
        Ok(PostureReport {
            natural_frequencies_hz: natural_frequencies_hz(&system)?,
            tcp_m: kinematics.tcp().coords.into(),
            tool_axis: kinematics.tool_axis().into(),
            tcp_stiffness_n_per_m: stiffness(kinematics.tcp(), true),
            flange_stiffness_n_per_m: stiffness(kinematics.flange(), false),
        })
    }
}
