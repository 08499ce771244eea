//! Inverse kinematics in closed form for six-axis arms with a spherical wrist (Pieper 1968; Craig 2005, §4.6).
//!
//! The arm: joint 2 and 3 parallel, joint 1 and 4 normal to them; the axes of joints 4 to 6 meet in one point. Up to
//! eight branches: shoulder turned round or not, elbow up or down, wrist flipped or not.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Rotation3, Vector2, Vector3};

use crate::data::RobotSpec;
use crate::robot::kinematics::dh::joint_transform;
use crate::robot::kinematics::ik_solution::{IkSolution, farthest, limit_margin_rad, nearest_turn, tool_at};
use crate::{Error, Result};

/// Closed-form inverse kinematics of one robot.
#[derive(Debug, Clone)]
pub struct SphericalWrist<'a> {
    spec: &'a RobotSpec,
}

const ANGLE_TOLERANCE: f64 = 1e-9;
const LENGTH_TOLERANCE_M: f64 = 1e-9;
/// Below this sine of θ₅ joints 4 and 6 turn about one line, and only their sum is known.
const SINGULAR_SINE: f64 = 1e-9;

impl<'a> SphericalWrist<'a> {
    /// # Errors
    /// Where the robot is not a six-axis arm of this kind: says which entry of the robot file stands against it.
    pub fn new(spec: &'a RobotSpec) -> Result<Self> {
        let refuse = |what: String| -> Result<Self> {
            Err(Error::computation(format!(
                "{}: no closed inverse kinematics: {what}; it needs six joints, 2 and 3 parallel, 1 and 4 normal to \
                 them, and a spherical wrist",
                spec.name
            )))
        };
        if spec.joints.len() != 6 {
            return refuse(format!("{} joints", spec.joints.len()));
        }
        if let Some(i) = spec.joints.iter().position(|joint| joint.placement.is_some()) {
            return refuse(format!(
                "joint {} is not given in the Denavit-Hartenberg convention",
                i + 1
            ));
        }
        for i in [0, 2, 3, 4] {
            if spec.joints[i].alpha_rad.cos().abs() > ANGLE_TOLERANCE {
                return refuse(format!("alpha of joint {} is not ±90°", i + 1));
            }
        }
        if spec.joints[1].alpha_rad.abs() > ANGLE_TOLERANCE {
            return refuse("alpha of joint 2 is not 0".into());
        }
        for (i, length) in [
            (3, spec.joints[3].a_m),
            (4, spec.joints[4].a_m),
            (5, spec.joints[5].a_m),
            (4, spec.joints[4].d_m),
        ] {
            if length.abs() > LENGTH_TOLERANCE_M {
                return refuse(format!("the wrist's axes do not meet at joint {}", i + 1));
            }
        }
        if !(spec.joints[1].a_m.abs() > LENGTH_TOLERANCE_M) {
            return refuse("the upper arm has no length".into());
        }
        Ok(SphericalWrist { spec })
    }

    /// All branches that reach a pose of the tool (origin and axes of [`Kinematics::tool`](crate::robot::Kinematics), base frame), whether within
    /// the joint limits or not, in a fixed order; none where the pose is out of reach. `reference_rad` chooses among
    /// whole turns, and stands for joint 4 where the wrist is singular.
    pub fn tool_pose(&self, tool: &Isometry3<f64>, reference_rad: &[f64]) -> Vec<IkSolution> {
        self.flange_pose(&(tool * self.spec.tool.in_flange().inverse()), reference_rad)
    }

    fn flange_pose(&self, flange: &Isometry3<f64>, reference_rad: &[f64]) -> Vec<IkSolution> {
        let joints = &self.spec.joints;
        let sine = |i: usize| joints[i].alpha_rad.sin().signum();
        let rotation = Rotation3::from(flange.rotation);
        // Axis of joint 6 in the base frame; the wrist's centre lies d₆ behind the flange along it.
        let (s6, c6) = joints[5].alpha_rad.sin_cos();
        let axis6 = rotation * Vector3::new(0.0, s6, c6);
        let centre = flange.translation.vector - axis6 * joints[5].d_m;

        // Shoulder: the centre's distance from the arm's plane is what joints 2 and 3 are offset by.
        let offset = joints[1].d_m + joints[2].d_m;
        let radius = centre.xy().norm();
        let ratio = offset / radius;
        if !(ratio.abs() <= 1.0) {
            return Vec::new();
        }
        let mut solutions = Vec::new();
        for shoulder in [false, true] {
            // −sin α₁ (−x sin θ + y cos θ) = offset, with x + iy = r e^{iβ}: r sin(β − θ) = −offset / sin α₁.
            let bend = (-ratio / sine(0)).asin();
            let beta = centre.y.atan2(centre.x);
            let theta1 = if shoulder { beta - PI + bend } else { beta - bend };
            let first = joint_transform(&joints[0], theta1 - joints[0].offset_rad);
            let local = first.inverse_transform_point(&centre.into());
            let target = Vector2::new(local.x, local.y);
            let upper = joints[1].a_m;
            // Fore arm from joint 3 to the wrist, before joint 3 turns it.
            let fore = Vector2::new(joints[2].a_m, -joints[3].d_m * sine(2));
            let cosine =
                (target.norm_squared() - upper * upper - fore.norm_squared()) / (2.0 * upper * fore.norm());
            if !(cosine.abs() <= 1.0) {
                continue;
            }
            let bent = cosine.acos();
            for elbow in [false, true] {
                let theta3 = (if elbow { -bent } else { bent }) - fore.y.atan2(fore.x);
                let (s3, c3) = theta3.sin_cos();
                let reach = Vector2::new(upper + c3 * fore.x - s3 * fore.y, s3 * fore.x + c3 * fore.y);
                let theta2 = target.y.atan2(target.x) - reach.y.atan2(reach.x);
                let to_wrist = first
                    * joint_transform(&joints[1], theta2 - joints[1].offset_rad)
                    * joint_transform(&joints[2], theta3 - joints[2].offset_rad);
                let untwisted =
                    rotation * Rotation3::from_axis_angle(&Vector3::x_axis(), -joints[5].alpha_rad);
                let m = Rotation3::from(to_wrist.rotation).inverse() * untwisted;
                let m = m.matrix();
                let cosine5 = -sine(3) * sine(4) * m[(2, 2)];
                let sine5 = m[(0, 2)].hypot(m[(1, 2)]);
                for wrist in [false, true] {
                    let sign = if wrist { -1.0 } else { 1.0 };
                    let theta5 = (sign * sine5).atan2(cosine5);
                    let theta4 = if sine5 > SINGULAR_SINE {
                        let sign = sign * sine(4);
                        (sign * m[(1, 2)]).atan2(sign * m[(0, 2)])
                    } else {
                        reference_rad[3] + joints[3].offset_rad
                    };
                    let before = Rotation3::from_axis_angle(&Vector3::z_axis(), theta4)
                        * Rotation3::from_axis_angle(&Vector3::x_axis(), joints[3].alpha_rad)
                        * Rotation3::from_axis_angle(&Vector3::z_axis(), theta5)
                        * Rotation3::from_axis_angle(&Vector3::x_axis(), joints[4].alpha_rad);
                    let last = before.matrix().transpose() * m;
                    let theta6 = last[(1, 0)].atan2(last[(0, 0)]);
                    let theta = [theta1, theta2, theta3, theta4, theta5, theta6];
                    let turned = |i: usize| {
                        let limits = joints[i].limits_rad;
                        nearest_turn(theta[i] - joints[i].offset_rad, reference_rad[i], limits)
                    };
                    let q_rad: Vec<f64> = (0..6).map(turned).collect();
                    solutions.push(IkSolution {
                        branch: 4 * u32::from(shoulder) + 2 * u32::from(elbow) + u32::from(wrist),
                        limit_margin_rad: limit_margin_rad(joints, &q_rad),
                        q_rad,
                        elbow_rad: None,
                        singularity_margin: sine5.abs().min(bent.sin()).min(radius / upper.abs()),
                    });
                }
            }
        }
        solutions
    }

    /// The branch that a posture lies on; `None` where it stands at a singularity and two branches meet.
    pub fn branch_of(&self, q_rad: &[f64]) -> Option<u32> {
        let all = self.tool_pose(&tool_at(self.spec, q_rad), q_rad);
        let own = all.into_iter().find(|s| farthest(&s.q_rad, q_rad) < 1e-6);
        own.map(|s| s.branch)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::robot::Kinematics;
    use crate::robot::fixture::{TAP_POSTURES, irb6640};
    use proptest::prelude::*;

    fn with_shoulder_offset() -> RobotSpec {
        let mut spec = irb6640();
        spec.joints[1].d_m = 0.12;
        spec.joints[2].d_m = -0.03;
        spec.joints[0].alpha_rad = PI / 2.0;
        spec.joints[5].alpha_rad = 0.4;
        spec
    }

    proptest! {
        /// Every branch leads back to the pose, and one of them to the angles it came from.
        #[test]
        fn forward_and_inverse_are_each_others_inverse(
            q in proptest::array::uniform6(-3.1f64..3.1),
            offset in any::<bool>(),
        ) {
            let spec = if offset { with_shoulder_offset() } else { irb6640() };
            let ik = SphericalWrist::new(&spec).unwrap();
            let tool = Kinematics::new(&spec, &q).tool;
            let solutions = ik.tool_pose(&tool, &q);
            prop_assert!(solutions.len() >= 4 && solutions.len() <= 8);
            let mut met = false;
            for s in &solutions {
                let back = Kinematics::new(&spec, &s.q_rad).tool;
                let off = (back.translation.vector - tool.translation.vector).norm();
                prop_assert!(off < 1e-8, "{s:?} {off}");
                prop_assert!(back.rotation.angle_to(&tool.rotation) < 1e-7, "{s:?}");
                let worst = s.q_rad.iter().zip(&q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                met |= worst < 1e-6;
            }
            let margin = solutions.iter().map(|s| s.singularity_margin).fold(1.0, f64::min);
            prop_assert!(met || margin < 1e-5, "{q:?} {solutions:?}");
        }
    }

    #[test]
    fn limits_choose_the_turn_and_are_measured() {
        let mut spec = irb6640();
        for joint in &mut spec.joints {
            joint.limits_rad = Some([-2.0 * PI, 2.0 * PI]);
        }
        spec.joints[4].limits_rad = Some([-0.2, 0.2]);
        let ik = SphericalWrist::new(&spec).unwrap();
        let q: [f64; 6] = TAP_POSTURES[0].map(f64::to_radians);
        let tool = Kinematics::new(&spec, &q).tool;
        let mut reference = q;
        reference[5] += TAU;
        let solutions = ik.tool_pose(&tool, &reference);
        let branch = ik.branch_of(&q).unwrap();
        let same = solutions.iter().find(|s| s.branch == branch).unwrap();
        assert!((same.q_rad[5] - (q[5] + TAU)).abs() < 1e-9);
        assert!((same.limit_margin_rad - (0.2 - q[4].abs())).abs() < 1e-9);
        assert!(!same.is_within_limits());
    }

    #[test]
    fn out_of_reach_and_other_arms() {
        let spec = irb6640();
        let ik = SphericalWrist::new(&spec).unwrap();
        let far = Isometry3::translation(9.0, 0.0, 1.0);
        assert!(ik.tool_pose(&far, &[0.0; 6]).is_empty());
        let mut other = irb6640();
        other.joints[4].d_m = 0.1;
        let message = SphericalWrist::new(&other).err().unwrap().to_string();
        assert!(message.contains("spherical wrist"), "{message}");
    }
}
