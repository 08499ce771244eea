//! Forward kinematics in the standard (distal) Denavit–Hartenberg convention (Denavit & Hartenberg 1955; Craig 2005).

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::campaign::robot_spec::{JointSpec, RobotSpec};

/// Frames of a robot at one posture, base frame coordinates, m.
#[derive(Debug, Clone)]
pub struct Kinematics {
    /// Frame 0 (base) to frame n (flange).
    pub frames: Vec<Isometry3<f64>>,
    /// Tool centre point with the tool's axes: z is the tool axis, y the flange's y.
    pub tool: Isometry3<f64>,
}

/// T = Rz(q + offset) Tz(d) Tx(a) Rx(alpha).
pub fn joint_transform(joint: &JointSpec, q_rad: f64) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), q_rad + joint.offset_rad);
    let twist = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), joint.alpha_rad);
    Isometry3::from_parts(
        Translation3::from(turn * Vector3::new(joint.a_m, 0.0, joint.d_m)),
        turn * twist,
    )
}

impl Kinematics {
    /// `q_rad`: one angle a joint (the caller has checked the length).
    pub fn new(spec: &RobotSpec, q_rad: &[f64]) -> Self {
        let mut frames = vec![Isometry3::identity()];
        let mut frame = Isometry3::identity();
        for (joint, q) in spec.joints.iter().zip(q_rad) {
            frame *= joint_transform(joint, *q);
            frames.push(frame);
        }
        let tcp = Vector3::from(spec.tool.tcp_in_flange_m);
        let tilt = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), spec.tool.tilt_about_flange_y_rad);
        let tool = frame * Isometry3::from_parts(Translation3::from(tcp), tilt);
        Kinematics { frames, tool }
    }

    pub fn joint_count(&self) -> usize {
        self.frames.len() - 1
    }

    /// The same posture with joint `i` (1-based) further by `angle_rad`.
    pub fn turned(&self, i: usize, angle_rad: f64) -> Kinematics {
        let origin = self.joint_origin(i);
        let axis = nalgebra::Unit::new_normalize(self.joint_axis(i));
        let turn = UnitQuaternion::from_axis_angle(&axis, angle_rad);
        let about = Isometry3::rotation_wrt_point(turn, origin);
        let mut turned = self.clone();
        for frame in turned.frames.iter_mut().skip(i) {
            *frame = about * *frame;
        }
        turned.tool = about * turned.tool;
        turned
    }

    /// Axis of joint `i` (1-based): z of frame i−1.
    pub fn joint_axis(&self, i: usize) -> Vector3<f64> {
        self.frames[i - 1].rotation * Vector3::z()
    }

    /// Origin of joint `i` (1-based): origin of frame i−1.
    pub fn joint_origin(&self, i: usize) -> Point3<f64> {
        self.frames[i - 1].translation.vector.into()
    }

    /// Rotation of the frame of link `i` (0: base).
    pub fn link_rotation(&self, i: usize) -> Matrix3<f64> {
        Rotation3::from(self.frames[i].rotation).into_inner()
    }

    pub fn tcp(&self) -> Point3<f64> {
        self.tool.translation.vector.into()
    }

    pub fn flange(&self) -> Point3<f64> {
        self.frames[self.frames.len() - 1].translation.vector.into()
    }

    pub fn tool_axis(&self) -> Vector3<f64> {
        self.tool.rotation * Vector3::z()
    }

    /// Where link `i` (1-based) begins and ends as a beam: from its joint axis to the next one; the last link
    /// reaches to the tool centre point.
    pub fn link_ends(&self, i: usize) -> (Point3<f64>, Point3<f64>) {
        let end = if i == self.joint_count() {
            self.tcp()
        } else {
            self.joint_origin(i + 1)
        };
        (self.joint_origin(i), end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::robot_spec::ToolFrame;
    use proptest::prelude::*;

    fn planar(lengths: &[f64]) -> RobotSpec {
        RobotSpec {
            name: "planar".into(),
            joints: lengths
                .iter()
                .map(|&a_m| JointSpec {
                    d_m: 0.0,
                    a_m,
                    alpha_rad: 0.0,
                    offset_rad: 0.0,
                    compliance_rad_per_nm: 1e-6,
                    limits_rad: None,
                })
                .collect(),
            links: Vec::new(),
            tool: ToolFrame::default(),
        }
    }

    /// A joint turned afterwards is a joint that stood there from the beginning.
    #[test]
    fn turning_a_joint_is_setting_its_angle() {
        let spec = crate::robot::fixture::irb6640();
        let q: Vec<f64> = [135.0, -2.0, 53.0, 83.0, 30.0, -117.0]
            .map(f64::to_radians)
            .into();
        for joint in 1..=6 {
            let mut other = q.clone();
            other[joint - 1] += 0.3;
            let expected = Kinematics::new(&spec, &other);
            let turned = Kinematics::new(&spec, &q).turned(joint, 0.3);
            let pairs = expected.frames.iter().zip(&turned.frames);
            for (e, t) in pairs.chain([(&expected.tool, &turned.tool)]) {
                assert!(
                    (e.to_homogeneous() - t.to_homogeneous()).norm() < 1e-12,
                    "{joint}"
                );
            }
        }
    }

    proptest! {
        /// A planar arm has the textbook closed form.
        #[test]
        fn planar_arm_matches_closed_form(q in proptest::collection::vec(-3.1f64..3.1, 3)) {
            let lengths = [1.3, 0.8, 0.4];
            let kin = Kinematics::new(&planar(&lengths), &q);
            let (mut x, mut y, mut sum) = (0.0, 0.0, 0.0);
            for (l, q) in lengths.iter().zip(&q) {
                sum += q;
                x += l * f64::cos(sum);
                y += l * f64::sin(sum);
            }
            prop_assert!((kin.flange() - Point3::new(x, y, 0.0)).norm() < 1e-12);
        }

        /// Each DH transform equals the published 4×4 matrix.
        #[test]
        fn transform_matches_the_dh_matrix(q in -3.1f64..3.1, alpha in -3.1f64..3.1, a in -1.0f64..1.0, d in -1.0f64..1.0) {
            let joint = JointSpec { d_m: d, a_m: a, alpha_rad: alpha, offset_rad: 0.1, compliance_rad_per_nm: 1e-6, limits_rad: None };
            let t = joint_transform(&joint, q).to_homogeneous();
            let (s, c) = (q + 0.1).sin_cos();
            let (sa, ca) = alpha.sin_cos();
            let expected = nalgebra::Matrix4::new(
                c, -s * ca, s * sa, a * c,
                s, c * ca, -c * sa, a * s,
                0.0, sa, ca, d,
                0.0, 0.0, 0.0, 1.0,
            );
            prop_assert!((t - expected).norm() < 1e-12);
        }
    }
}
