//! What the model says of one posture: frequencies, tool point, static stiffness.

use nalgebra::Point3;

use super::chain::Chain;
use super::dh::Kinematics;
use super::frf::natural_frequencies_hz;
use super::model::{Baseline, RobotModel};
use crate::Result;

/// Frequencies in Hz, ascending; stiffness 1/C_ii in base axes, N/m.
#[derive(Debug, Clone)]
pub struct PostureReport {
    pub natural_frequencies_hz: Vec<f64>,
    pub tcp_m: [f64; 3],
    pub tool_axis: [f64; 3],
    pub tcp_stiffness_n_per_m: [f64; 3],
    pub flange_stiffness_n_per_m: [f64; 3],
}

impl PostureReport {
    pub fn new(robot: &RobotModel, kinematics: &Kinematics, baseline: &Baseline) -> Result<Self> {
        let chain = robot.chain(kinematics, baseline);
        let place = robot.flange_place();
        let stiffness = |chain: &Chain, point: Point3<f64>| -> Result<[f64; 3]> {
            let compliance = chain.compliance(point, place)?;
            Ok([0, 1, 2].map(|i| 1.0 / compliance[(i, i)]))
        };
        Ok(PostureReport {
            natural_frequencies_hz: natural_frequencies_hz(&chain.system(0))?,
            tcp_m: kinematics.tcp().coords.into(),
            tool_axis: kinematics.tool_axis().into(),
            tcp_stiffness_n_per_m: stiffness(&chain, kinematics.tcp())?,
            flange_stiffness_n_per_m: stiffness(&chain, kinematics.flange())?,
        })
    }
}
