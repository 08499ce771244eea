//! The angles of the postures as campaign.toml gives them, and findings about a joint.

use super::super::finding::SetupFinding;
use crate::identify::StructureModel;
use crate::identify::frfs::frf_data::FrfData;
use crate::robot::Kinematics;

/// By posture index, of those that have FRFs: where the frames are and the angles that put them there, rad.
pub fn given<'d>(model: &StructureModel, data: &'d FrfData) -> Vec<Option<(&'d Kinematics, Vec<f64>)>> {
    let with_angles =
        |kinematics: &'d Kinematics| (kinematics, kinematics.joint_angles_rad(&model.robot.spec));
    data.kinematics_by_posture()
        .into_iter()
        .map(|kinematics| kinematics.map(with_angles))
        .collect()
}

/// A finding whose size, where it has one, is by how much a joint is turned, rad; its confidence still open.
pub fn finding(kind: &'static str, place: String, turn_rad: Option<f64>, remedy: String) -> SetupFinding {
    SetupFinding {
        value: turn_rad.map(f64::to_degrees),
        unit: if turn_rad.is_some() { "deg" } else { "" },
        ..SetupFinding::without_size(kind, place, 0.0, remedy)
    }
}
