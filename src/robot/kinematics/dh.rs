//! Forward kinematics: joints in the standard (distal) Denavit–Hartenberg convention (Denavit & Hartenberg 1955; Craig
//! 2005), or placed anywhere and turning about any axis (as in a URDF).

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3, Vector6};

use crate::data::{JointPlacement, JointSpec, LinkSpec, RobotSpec, ToolFrame};

/// Frames of a robot at one posture, base frame coordinates, m.
#[derive(Debug, Clone)]
pub struct Kinematics {
    /// Frame 0 (base) to frame n (flange): that of each link.
    pub frames: Vec<Isometry3<f64>>,
    /// For each joint a frame at its axis, fixed to the link before it; z is the axis.
    joint_frames: Vec<Isometry3<f64>>,
    /// Tool centre point with the tool's axes: z is the tool axis, y the flange's y.
    pub tool: Isometry3<f64>,
}

/// Roll, pitch, yaw about fixed axes: Rz(yaw) Ry(pitch) Rx(roll).
pub fn rotation_of_rpy(rpy_rad: [f64; 3]) -> UnitQuaternion<f64> {
    let [roll, pitch, yaw] = rpy_rad;
    UnitQuaternion::from_euler_angles(roll, pitch, yaw)
}

/// The inverse of [`rotation_of_rpy`], to rounding also where the pitch is ±90° (yaw is then any, and roll fits it).
pub fn rpy_of_rotation(rotation: &UnitQuaternion<f64>) -> [f64; 3] {
    let m = rotation.to_rotation_matrix().into_inner();
    let yaw = m[(1, 0)].atan2(m[(0, 0)]);
    let (s, c) = yaw.sin_cos();
    let pitch = (-m[(2, 0)]).atan2(c * m[(0, 0)] + s * m[(1, 0)]);
    let roll = (s * m[(0, 2)] - c * m[(1, 2)]).atan2(c * m[(1, 1)] - s * m[(0, 1)]);
    [roll, pitch, yaw]
}

impl JointPlacement {
    /// The joint's frame in that of the link before it, the joint at zero.
    pub fn frame(&self) -> Isometry3<f64> {
        Isometry3::from_parts(
            Translation3::from(Vector3::from(self.origin_m)),
            rotation_of_rpy(self.rpy_rad),
        )
    }
}

impl JointSpec {
    /// A frame at the joint's axis in the frame of the link before it; z is the axis.
    pub fn axis_frame(&self) -> Isometry3<f64> {
        let Some(placement) = &self.placement else {
            return Isometry3::identity();
        };
        let axis = Vector3::from(placement.axis);
        // From z or from −z, whichever is nearer: between opposite vectors the shortest turn is not defined.
        let half = if axis.z < 0.0 { std::f64::consts::PI } else { 0.0 };
        let near = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), half);
        let rest = UnitQuaternion::rotation_between(&(near * Vector3::z()), &axis).unwrap_or_default();
        placement.frame() * rest * near
    }

    /// Distance of this joint from the next (or from the one before), m.
    pub fn length_m(&self) -> f64 {
        match &self.placement {
            Some(placement) => Vector3::from(placement.origin_m).norm(),
            None => self.a_m.hypot(self.d_m),
        }
    }
}

impl LinkSpec {
    /// The inertia tensor about the centre of mass, axes along the link's frame, kg·m².
    pub fn inertia_tensor(&self) -> Matrix3<f64> {
        let [xx, yy, zz] = self.inertia_kg_m2;
        let [xy, xz, yz] = self.products_kg_m2;
        Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
    }

    /// Whether no axis has a negative moment of inertia (up to rounding).
    pub fn has_possible_inertia(&self) -> bool {
        let tensor = self.inertia_tensor();
        let least = tensor.symmetric_eigenvalues().min();
        least >= -1e-9 * tensor.norm()
    }
}

impl ToolFrame {
    /// Tool frame in the flange frame; z is the tool axis.
    pub fn in_flange(&self) -> Isometry3<f64> {
        let tilt = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), self.tilt_about_flange_y_rad);
        Isometry3::from_parts(
            Translation3::from(Vector3::from(self.tcp_in_flange_m)),
            rotation_of_rpy(self.rpy_in_flange_rad) * tilt,
        )
    }
}

/// Frame i in frame i−1 with joint i at `q_rad`.
pub fn joint_transform(joint: &JointSpec, q_rad: f64) -> Isometry3<f64> {
    if let Some(placement) = &joint.placement {
        let axis = Unit::new_normalize(Vector3::from(placement.axis));
        return placement.frame() * UnitQuaternion::from_axis_angle(&axis, q_rad);
    }
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
        let mut joint_frames = Vec::with_capacity(spec.joints.len());
        let mut frame = Isometry3::identity();
        for (joint, q) in spec.joints.iter().zip(q_rad) {
            joint_frames.push(match joint.placement {
                Some(_) => frame * joint.axis_frame(),
                None => frame,
            });
            frame *= joint_transform(joint, *q);
            frames.push(frame);
        }
        Kinematics {
            frames,
            joint_frames,
            tool: frame * spec.tool.in_flange(),
        }
    }

    /// Number of joints.
    pub fn joint_count(&self) -> usize {
        self.frames.len() - 1
    }

    /// The same posture of a robot whose lengths and offsets are those of `after` instead of `before`: what follows a joint
    /// moves along its axis (d) and along the x axis of its link (a); nothing turns.
    pub fn with_lengths(&self, before: &RobotSpec, after: &RobotSpec) -> Kinematics {
        let mut moved = self.clone();
        for (i, (old, new)) in before.joints.iter().zip(&after.joints).enumerate() {
            let along_x = self.frames[i + 1].rotation * Vector3::x();
            let by = self.joint_axis(i + 1) * (new.d_m - old.d_m) + along_x * (new.a_m - old.a_m);
            let joints = moved.joint_frames.iter_mut().skip(i + 1);
            for frame in moved.frames.iter_mut().skip(i + 1).chain(joints) {
                frame.translation.vector += by;
            }
            moved.tool.translation.vector += by;
        }
        moved
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
        for frame in turned.joint_frames.iter_mut().skip(i) {
            *frame = about * *frame;
        }
        turned.tool = about * turned.tool;
        turned
    }

    /// The joint angles of this posture of the robot `spec`, −π to π.
    pub fn joint_angles_rad(&self, spec: &RobotSpec) -> Vec<f64> {
        let frames = self.frames.windows(2).zip(&spec.joints);
        frames
            .map(|(w, joint)| {
                let turned = w[0].rotation.inverse() * w[1].rotation;
                let at_zero = joint_transform(joint, 0.0).rotation;
                let (turn, axis) = match &joint.placement {
                    Some(placement) => (
                        at_zero.inverse() * turned,
                        Vector3::from(placement.axis).normalize(),
                    ),
                    None => (turned * at_zero.inverse(), Vector3::z()),
                };
                let half = turn
                    .quaternion()
                    .vector()
                    .dot(&axis)
                    .atan2(turn.quaternion().scalar());
                let angle = 2.0 * half;
                angle.sin().atan2(angle.cos())
            })
            .collect()
    }

    /// A frame at joint `i` (1-based), fixed to the link before it; z is the axis. In the Denavit–Hartenberg convention
    /// it is frame i−1.
    pub fn joint_frame(&self, i: usize) -> &Isometry3<f64> {
        &self.joint_frames[i - 1]
    }

    /// Axis of joint `i` (1-based), a unit vector.
    pub fn joint_axis(&self, i: usize) -> Vector3<f64> {
        self.joint_frame(i).rotation * Vector3::z()
    }

    /// Origin of joint `i` (1-based), on its axis.
    pub fn joint_origin(&self, i: usize) -> Point3<f64> {
        self.joint_frame(i).translation.vector.into()
    }

    /// Rotation of the frame of link `i` (0: base).
    pub fn link_rotation(&self, i: usize) -> Matrix3<f64> {
        Rotation3::from(self.frames[i].rotation).into_inner()
    }

    /// Tool centre point, base frame, m.
    pub fn tcp(&self) -> Point3<f64> {
        self.tool.translation.vector.into()
    }

    /// Twist of the tool centre point for a unit turn of each joint: displacement (m/rad) over rotation, base axes.
    pub fn tool_twists(&self) -> impl Iterator<Item = Vector6<f64>> + '_ {
        (1..=self.joint_count()).map(|i| {
            let axis = self.joint_axis(i);
            let shift = axis.cross(&(self.tcp() - self.joint_origin(i)));
            Vector6::new(shift.x, shift.y, shift.z, axis.x, axis.y, axis.z)
        })
    }

    /// Origin of the flange, base frame, m.
    pub fn flange(&self) -> Point3<f64> {
        self.frames[self.frames.len() - 1].translation.vector.into()
    }

    /// Unit vector along the tool, from the spindle to the workpiece, base axes.
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
    use crate::data::ToolFrame;
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
                    ..JointSpec::default()
                })
                .collect(),
            links: Vec::new(),
            tool: ToolFrame::default(),
            guesses: Vec::new(),
        }
    }

    /// In the Denavit–Hartenberg convention and with axes given.
    #[test]
    fn the_angles_of_a_posture_are_those_that_it_was_made_of() {
        let placed = JointSpec {
            placement: Some(JointPlacement {
                origin_m: [0.1, -0.2, 0.3],
                rpy_rad: [0.4, -0.3, 1.2],
                axis: [0.0, 0.6, -0.8],
            }),
            ..JointSpec::default()
        };
        let mut spec = planar(&[0.4, 0.3]);
        (spec.joints[0].alpha_rad, spec.joints[1].offset_rad) = (1.3, -0.9);
        spec.joints.push(placed);
        let q = [2.9, -1.1, 0.6];
        let found = Kinematics::new(&spec, &q).joint_angles_rad(&spec);
        for (found, q) in found.iter().zip(q) {
            assert!((found - q).abs() < 1e-12, "{found} for {q}");
        }
    }

    /// A joint turned afterwards is a joint that stood there from the beginning.
    #[test]
    fn turning_a_joint_is_setting_its_angle() {
        let q: Vec<f64> = [135.0, -2.0, 53.0, 83.0, 30.0, -117.0]
            .map(f64::to_radians)
            .into();
        for spec in [
            crate::robot::fixture::irb6640(),
            crate::robot::fixture::awkward_arm(6),
        ] {
            for joint in 1..=6 {
                let mut other = q.clone();
                other[joint - 1] += 0.3;
                let expected = Kinematics::new(&spec, &other);
                let turned = Kinematics::new(&spec, &q).turned(joint, 0.3);
                let frames = expected.frames.iter().zip(&turned.frames);
                let joints = expected.joint_frames.iter().zip(&turned.joint_frames);
                for (e, t) in frames.chain(joints).chain([(&expected.tool, &turned.tool)]) {
                    assert!(
                        (e.to_homogeneous() - t.to_homogeneous()).norm() < 1e-12,
                        "{joint}"
                    );
                }
            }
        }
    }

    /// Roll, pitch and yaw lead back to the rotation, with the pitch at ±90°, too.
    #[test]
    fn roll_pitch_yaw_lead_back() {
        let quarter = std::f64::consts::FRAC_PI_2;
        for rpy in [
            [0.3, -0.7, 2.9],
            [1.1, quarter, 0.4],
            [-2.0, -quarter, 3.0],
            [0.0; 3],
        ] {
            let rotation = rotation_of_rpy(rpy);
            let back = rotation_of_rpy(rpy_of_rotation(&rotation));
            assert!(back.angle_to(&rotation) < 1e-14, "{rpy:?}");
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
            let joint = JointSpec { d_m: d, a_m: a, alpha_rad: alpha, offset_rad: 0.1, compliance_rad_per_nm: 1e-6, ..JointSpec::default() };
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
