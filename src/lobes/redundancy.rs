//! Lobes over the redundancy angle: the tool turned about its own axis at one place, b(n, θ).
//!
//! A rotating tool does not care how the robot stands behind it; the robot's structure does. The angle θ turns the tool
//! frame of the posture to keep about its z axis (right-handed); inverse kinematics follows the branch of that posture.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use serde::Serialize;

use super::curve::AbsoluteLimit;
use super::optimum::SurfacePoint;
use crate::Result;
use crate::robot::{IkReference, InverseKinematics, RobotModel};

/// Whether a cut can be made at an angle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum AngleStatus {
    /// On the posture's branch, within the joint limits.
    Reachable,
    /// Within a forbidden band of the campaign.
    Forbidden,
    /// Out of reach, or a joint beyond its limit, on the posture's branch.
    Unreachable,
}

/// How the robot stands at one angle.
#[derive(Debug, Clone, Serialize)]
pub struct AnglePosture {
    /// 0 to below 360; 0 is the posture to keep.
    pub angle_deg: f64,
    /// Whether the cut can be made here.
    pub status: AngleStatus,
    /// `None` where unreachable.
    pub joints_deg: Option<Vec<f64>>,
    /// Distance of the nearest joint to its limit; `None` where unreachable or no limits are known.
    pub limit_margin_deg: Option<f64>,
    /// Distance from the nearest singularity, 0 to 1 (see [`crate::robot::IkSolution`]).
    pub singularity_margin: Option<f64>,
    /// Elbow angle of an arm with seven joints (see [`crate::robot::NumericInverse::elbow_rad`]).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub elbow_deg: Option<f64>,
}

/// All angles of one place.
pub struct RedundancySweep<'a> {
    robot: &'a RobotModel,
    ik: InverseKinematics<'a>,
    tool: Isometry3<f64>,
    reference: IkReference,
    forbidden_deg: Vec<[f64; 2]>,
    /// How the robot stands at each angle, ascending.
    pub angles: Vec<AnglePosture>,
}

impl<'a> RedundancySweep<'a> {
    /// `joints_deg`: the posture whose tool point and axis are kept. Angles run from 0 in steps; the posture is followed
    /// from 0 both ways, so that whole turns of a joint do not jump but at 180°. `elbow_deg`: how far the elbow of an arm
    /// with seven joints stands turned from that of the posture.
    ///
    /// # Errors
    /// A robot of fewer than six joints or more than seven, a posture at a singularity, an elbow angle for an arm without one.
    pub fn new(
        robot: &'a RobotModel,
        joints_deg: &[f64],
        step_deg: f64,
        forbidden_deg: &[[f64; 2]],
        elbow_deg: f64,
    ) -> Result<Self> {
        let ik = InverseKinematics::new(&robot.spec)?;
        let mut reference = ik.reference(joints_deg, "the redundancy sweep")?;
        match &mut reference.elbow_rad {
            Some(elbow) => *elbow += elbow_deg.to_radians(),
            None if elbow_deg != 0.0 => {
                return Err(crate::Error::computation(format!(
                    "{} has no elbow to turn: that takes seven joints",
                    robot.spec.name
                )));
            }
            None => {}
        }
        let start = reference.q_rad.clone();
        let tool = robot.kinematics(joints_deg)?.tool;
        let mut sweep = RedundancySweep {
            robot,
            ik,
            tool,
            reference,
            forbidden_deg: forbidden_deg.to_vec(),
            angles: Vec::new(),
        };
        let count = steps_of_a_turn(step_deg);
        let angle = |i: usize| step_deg * i as f64;
        let half = (0..count).take_while(|i| angle(*i) <= 180.0).count();
        let mut angles: Vec<Option<AnglePosture>> = vec![None; count];
        for order in [(0..half).collect::<Vec<_>>(), (half..count).rev().collect()] {
            let mut reference = start.clone();
            for i in order {
                let posture = sweep.at(angle(i), &reference);
                if let Some(joints) = &posture.joints_deg {
                    reference = joints.iter().map(|q| q.to_radians()).collect();
                }
                angles[i] = Some(posture);
            }
        }
        sweep.angles = angles.into_iter().flatten().collect();
        Ok(sweep)
    }

    /// The robot at any angle; whole turns of joints nearest to `reference_rad`.
    pub fn at(&self, angle_deg: f64, reference_rad: &[f64]) -> AnglePosture {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle_deg.to_radians());
        let pose = self.tool * turn;
        let solution = self.ik.follow(&pose, &self.reference, reference_rad);
        let status = match (&solution, in_forbidden_band(&self.forbidden_deg, angle_deg)) {
            (None, _) => AngleStatus::Unreachable,
            (Some(_), true) => AngleStatus::Forbidden,
            (Some(_), false) => AngleStatus::Reachable,
        };
        AnglePosture {
            angle_deg,
            status,
            joints_deg: solution.as_ref().map(|s| s.joints_deg()),
            limit_margin_deg: solution
                .as_ref()
                .map(|s| s.limit_margin_rad.max(0.0).to_degrees())
                .filter(|m| m.is_finite()),
            singularity_margin: solution.as_ref().map(|s| s.singularity_margin),
            elbow_deg: solution.and_then(|s| s.elbow_rad).map(f64::to_degrees),
        }
    }

    /// The robot at any angle, followed from the nearest angle of the sweep.
    pub fn between(&self, angle_deg: f64) -> AnglePosture {
        let angle_deg = angle_deg.rem_euclid(360.0);
        let distance = |a: &AnglePosture| {
            let d = (a.angle_deg - angle_deg).abs();
            d.min(360.0 - d)
        };
        let nearest = self
            .angles
            .iter()
            .filter(|a| a.joints_deg.is_some())
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .and_then(|a| a.joints_deg.as_ref());
        let reference: Vec<f64> = match nearest {
            Some(joints) => joints.iter().map(|q| q.to_radians()).collect(),
            None => self.reference.q_rad.clone(),
        };
        self.at(angle_deg, &reference)
    }

    /// The robot that is swept.
    pub fn robot(&self) -> &RobotModel {
        self.robot
    }
}

/// Angles from 0 in steps that lie below 360°.
pub(super) fn steps_of_a_turn(step_deg: f64) -> usize {
    (360.0 / step_deg - 1e-9).ceil().max(1.0) as usize
}

/// Whether an angle lies in one of the bands, whole turns aside.
pub(super) fn in_forbidden_band(forbidden_deg: &[[f64; 2]], angle_deg: f64) -> bool {
    forbidden_deg.iter().any(|[from, to]| {
        [-360.0, 0.0, 360.0]
            .iter()
            .any(|turn| (*from..=*to).contains(&(angle_deg + turn)))
    })
}

/// What the surface says to do.
#[derive(Debug, Clone, Serialize)]
pub struct Recommendation {
    /// Speed and angle to use, with the limit there.
    pub point: SurfacePoint,
    /// The limit at exactly that speed.
    pub tip_depth_mm: Option<f64>,
    /// The 5 % quantile of `point.depth_mm` over the model's uncertainty, mm; `None` without a calibration.
    pub lower_quantile_mm: Option<f64>,
    /// How the robot stands at that angle.
    pub posture: AnglePosture,
    /// Absolute stability limit at that angle; `None` where nothing is limited.
    pub absolute_limit: Option<AbsoluteLimit>,
    /// Best of the enumeration, refined.
    pub enumeration: SurfacePoint,
    /// Best of the particle swarm.
    pub swarm: SurfacePoint,
    /// Whether enumeration and swarm found the same depth (to [`super::optimum::AGREEMENT`]).
    pub agree: bool,
    /// Difference of the two depths as a share of the deeper one.
    pub difference: f64,
    /// Share of the speed by which it may be off on either side.
    pub speed_margin: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::fixture::{TAP_POSTURES, irb6640};

    fn limited() -> RobotModel {
        let mut spec = irb6640();
        let limits = [
            [-180.0, 180.0],
            [-65.0, 85.0],
            [-180.0, 70.0],
            [-300.0, 300.0],
            [-120.0, 120.0],
            [-360.0, 360.0],
        ];
        for (joint, limits) in spec.joints.iter_mut().zip(limits) {
            joint.limits_rad = Some(limits.map(f64::to_radians));
        }
        RobotModel::new(spec)
    }

    /// The four tap-test postures are one sweep in steps of 90°: joint angles within what whole degrees and the 20 mm
    /// between the four tool points leave open.
    #[test]
    fn the_four_thesis_postures_are_one_sweep() {
        let robot = limited();
        let sweep = RedundancySweep::new(&robot, &TAP_POSTURES[0], 1.0, &[], 0.0).unwrap();
        assert_eq!(sweep.angles.len(), 360);
        let mut angles = Vec::new();
        for posture in &TAP_POSTURES {
            let off = |a: &AnglePosture| -> f64 {
                a.joints_deg.as_ref().map_or(f64::INFINITY, |joints| {
                    joints
                        .iter()
                        .zip(posture)
                        .map(|(a, b)| (a - b + 180.0).rem_euclid(360.0) - 180.0)
                        .fold(0.0, |worst: f64, d| worst.max(d.abs()))
                })
            };
            let nearest = sweep
                .angles
                .iter()
                .min_by(|a, b| off(a).total_cmp(&off(b)))
                .unwrap();
            assert!(
                off(nearest) < 4.0,
                "{posture:?}: {nearest:?} off by {}",
                off(nearest)
            );
            angles.push(nearest.angle_deg);
        }
        for pair in angles.windows(2) {
            let turned = (pair[1] - pair[0]).rem_euclid(360.0);
            assert!(
                (turned - 90.0).abs() < 4.0 || (turned - 270.0).abs() < 4.0,
                "{angles:?}"
            );
        }
    }

    /// Tool point and axis stay where they are at every reachable angle; neighbours differ little.
    #[test]
    fn the_tool_stays_and_joints_move_smoothly() {
        let robot = limited();
        let sweep = RedundancySweep::new(&robot, &TAP_POSTURES[1], 5.0, &[[350.0, 370.0]], 0.0).unwrap();
        let start = robot.kinematics(&TAP_POSTURES[1]).unwrap();
        for a in &sweep.angles {
            let banned = a.angle_deg <= 10.0 || a.angle_deg >= 350.0;
            let Some(joints) = &a.joints_deg else {
                assert_eq!(a.status, AngleStatus::Unreachable);
                continue;
            };
            assert_eq!(a.status == AngleStatus::Forbidden, banned, "{a:?}");
            let here = robot.kinematics(joints).unwrap();
            assert!((here.tcp() - start.tcp()).norm() < 1e-9);
            assert!((here.tool_axis() - start.tool_axis()).norm() < 1e-9);
        }
        assert!(sweep.angles[0].joints_deg.is_some());
        for pair in sweep.angles.windows(2).filter(|p| p[1].angle_deg <= 180.0) {
            if let (Some(a), Some(b)) = (&pair[0].joints_deg, &pair[1].joints_deg) {
                let jump = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(jump < 60.0, "{pair:?}");
            }
        }
    }
}
