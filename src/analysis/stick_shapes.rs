//! Measured mode shapes on the robot's stick figure: where joints and measured points stand, and how they move.

use nalgebra::{Point3, Vector3};

use super::modal::{ModalAnalysis, SetModes};
use crate::Result;
use crate::campaign::{BodyRef, Campaign};
use crate::ingest::Dof;
use crate::robot::{Kinematics, RobotModel, RobotSpec};

/// One mode of one posture.
#[derive(Debug, Clone, PartialEq)]
pub struct StickShape {
    /// Measured frequency, Hz.
    pub frequency_hz: f64,
    /// Measured damping ratio.
    pub damping_ratio: f64,
    /// Base, joints, flange, tool centre point; base frame, m.
    pub chain_m: Vec<[f64; 3]>,
    /// Displacement of each of them, the largest measured one 1: between base and measured points in proportion to the way
    /// along the arm, for want of measurements there.
    pub chain_shape: Vec<[f64; 3]>,
    /// Measured points: position, m, and measured displacement (directions that were not measured: 0).
    pub points: Vec<([f64; 3], [f64; 3])>,
}

/// [`stick_shapes`] of the posture that shows most modes; empty where they cannot be drawn, which spoils nothing else.
pub fn of_richest_set(campaign: &Campaign, analysis: &ModalAnalysis) -> Vec<StickShape> {
    let shapes = analysis.richest_set().map(|set| stick_shapes(campaign, set));
    shapes.and_then(Result::ok).unwrap_or_default()
}

/// All modes of a posture whose shape was measured in at least two degrees of freedom. Empty for a campaign without a
/// robot.
///
/// # Errors
/// The robot file cannot be read.
pub fn stick_shapes(campaign: &Campaign, set: &SetModes) -> Result<Vec<StickShape>> {
    let (Some(section), Some(posture)) = (
        &campaign.robot,
        campaign.postures.iter().find(|p| p.id == set.set),
    ) else {
        return Ok(Vec::new());
    };
    let robot = RobotModel::new(RobotSpec::load(&section.model, &campaign.dir)?);
    let kinematics = robot.kinematics(&posture.joints_deg)?;
    let chain = chain(&kinematics);
    // Way along the arm.
    let mut way = vec![0.0];
    for pair in chain.windows(2) {
        way.push(way[way.len() - 1] + (pair[1] - pair[0]).norm());
    }
    let mut shapes = Vec::new();
    for mode in set.global.modes.iter().filter(|m| m.shape.len() >= 2) {
        let mut points = Vec::new();
        let mut moved: Vec<(f64, Vector3<f64>)> = vec![(0.0, Vector3::zeros())];
        for point in &campaign.points {
            let mut sum = Vector3::zeros();
            let mut measured = false;
            for (dof, value) in &mode.shape {
                let Some(Ok(dof)) = set.dofs.get(*dof).map(|name| name.parse::<Dof>()) else {
                    continue;
                };
                if dof.node == point.node {
                    measured = true;
                    sum += robot.direction(&kinematics, point, dof.axis, dof.negative) * value.re;
                }
            }
            if measured {
                let (position, _) = robot.locate(&kinematics, point);
                points.push((position.coords.into(), sum.into()));
                let at = match point.body {
                    BodyRef::Base => 0,
                    BodyRef::Link(i) => i.min(chain.len() - 1),
                    BodyRef::Tool => chain.len() - 1,
                };
                moved.push((way[at], sum));
            }
        }
        moved.sort_by(|a, b| a.0.total_cmp(&b.0));
        shapes.push(StickShape {
            frequency_hz: mode.frequency_hz,
            damping_ratio: mode.damping_ratio,
            chain_m: chain.iter().map(|p| p.coords.into()).collect(),
            chain_shape: way.iter().map(|s| between(&moved, *s).into()).collect(),
            points,
        });
    }
    Ok(shapes)
}

/// Base, joints, flange, tool centre point; base frame, m.
pub fn chain(kinematics: &Kinematics) -> Vec<Point3<f64>> {
    let frames = kinematics.frames.iter();
    let mut chain: Vec<Point3<f64>> = frames.map(|f| Point3::from(f.translation.vector)).collect();
    chain.push(kinematics.tcp());
    chain
}

/// Linear between what is known on either side; beyond the last as that.
fn between(known: &[(f64, Vector3<f64>)], at: f64) -> Vector3<f64> {
    let above = known.partition_point(|k| k.0 < at);
    match (above.checked_sub(1).map(|k| known[k]), known.get(above)) {
        (Some((a, u)), Some(&(b, v))) => u + (v - u) * ((at - a) / (b - a)),
        (_, Some(&(_, v))) => v,
        (Some((_, u)), None) => u,
        (None, None) => Vector3::zeros(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn displacement_grows_along_the_arm_up_to_what_was_measured() {
        let known = [(0.0, Vector3::zeros()), (2.0, Vector3::new(1.0, 0.0, -2.0))];
        assert_eq!(between(&known, 0.0), Vector3::zeros());
        assert_eq!(between(&known, 1.0), Vector3::new(0.5, 0.0, -1.0));
        assert_eq!(between(&known, 3.0), known[1].1);
    }
}
