//! Numbers of the robot file, other than joint stiffnesses and masses, that a calibration may tune: inertia and centre of mass of
//! links, lengths of the kinematics, walls of links that bend.

use nalgebra::Point3;

use super::model::RobotModel;
use crate::data::RobotSpec;
use crate::robot::kinematics::dh::Kinematics;

const AXES: [&str; 3] = ["x", "y", "z"];

/// One number of the robot file. Links and joints count from 1, axes are those of the link's Denavit–Hartenberg frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileNumber {
    /// Moment of inertia about an axis through the centre of mass, kg·m²; products of inertia grow along.
    Inertia {
        /// Number of the link, from 1.
        link: usize,
        /// Axis of the link's frame: 0, 1, 2 for x, y, z.
        axis: usize,
    },
    /// Coordinate of the centre of mass, m.
    Centre {
        /// Number of the link, from 1.
        link: usize,
        /// Axis of the link's frame: 0, 1, 2 for x, y, z.
        axis: usize,
    },
    /// Offset d along the joint's axis, m.
    Offset {
        /// Number of the joint, from 1.
        joint: usize,
    },
    /// Length a of the common normal, m.
    Length {
        /// Number of the joint, from 1.
        joint: usize,
    },
    /// Wall of the hollow section, m.
    Wall {
        /// Number of the link, from 1.
        link: usize,
    },
}

impl FileNumber {
    /// As parameters are called: `link-4.inertia-x`, `joint-4.d`.
    pub fn name(self) -> String {
        match self {
            FileNumber::Inertia { link, axis } => format!("link-{link}.inertia-{}", AXES[axis]),
            FileNumber::Centre { link, axis } => format!("link-{link}.com-{}", AXES[axis]),
            FileNumber::Offset { joint } => format!("joint-{joint}.d"),
            FileNumber::Length { joint } => format!("joint-{joint}.a"),
            FileNumber::Wall { link } => format!("link-{link}.wall"),
        }
    }

    /// Unit of the number, `kg·m²` or `m`.
    pub fn unit(self) -> &'static str {
        match self {
            FileNumber::Inertia { .. } => "kg·m²",
            _ => "m",
        }
    }

    /// Moments of inertia of the links that have any.
    pub fn inertias(spec: &RobotSpec) -> Vec<FileNumber> {
        let links = spec.links.iter().enumerate();
        let all = links.flat_map(|(i, link)| {
            let turning = (0..3).filter(|axis| link.inertia_kg_m2[*axis] > 0.0);
            turning.map(move |axis| FileNumber::Inertia { link: i + 1, axis })
        });
        all.collect()
    }

    /// Centres of mass of the links that have a mass.
    pub fn centres(spec: &RobotSpec) -> Vec<FileNumber> {
        let heavy = (1..=spec.links.len()).filter(|i| spec.links[i - 1].mass_kg > 0.0);
        heavy
            .flat_map(|link| (0..3).map(move |axis| FileNumber::Centre { link, axis }))
            .collect()
    }

    /// Lengths and offsets of the kinematics, without d of the first joint, which only lifts the whole robot along its axis,
    /// and without those of the last, which the tool's position says as well. Joints that are placed otherwise than by
    /// the Denavit–Hartenberg convention have none.
    pub fn lengths(spec: &RobotSpec) -> Vec<FileNumber> {
        let last = spec.joints.len();
        let joints = (1..last).flat_map(|joint| [FileNumber::Offset { joint }, FileNumber::Length { joint }]);
        let by_convention = |number: &FileNumber| match *number {
            FileNumber::Offset { joint } | FileNumber::Length { joint } => {
                spec.joints[joint - 1].placement.is_none()
            }
            _ => true,
        };
        joints
            .filter(by_convention)
            .filter(|number| *number != FileNumber::Offset { joint: 1 })
            .filter(|number| !number.is_said_before(spec))
            .collect()
    }

    /// Walls of the links whose section has one.
    pub fn walls(spec: &RobotSpec) -> Vec<FileNumber> {
        let bending = (1..=spec.links.len()).filter(|i| walled(spec, *i).is_some());
        bending.map(|link| FileNumber::Wall { link }).collect()
    }

    /// Along parallel axes the offsets of two joints are one: only the first counts.
    fn is_said_before(self, spec: &RobotSpec) -> bool {
        match self {
            FileNumber::Offset { joint } if joint > 1 => {
                let before = &spec.joints[joint - 2];
                before.placement.is_none() && before.alpha_rad.sin().abs() < 1e-9
            }
            _ => false,
        }
    }

    /// What the robot says, in the unit of [`unit`](Self::unit).
    pub fn of(self, robot: &RobotModel) -> f64 {
        let spec = &robot.spec;
        match self {
            FileNumber::Inertia { link, axis } => spec.links[link - 1].inertia_kg_m2[axis],
            FileNumber::Centre { link, axis } => centre_m(robot, link)[axis],
            FileNumber::Offset { joint } => spec.joints[joint - 1].d_m,
            FileNumber::Length { joint } => spec.joints[joint - 1].a_m,
            FileNumber::Wall { link } => walled(spec, link).unwrap_or(0.0),
        }
    }

    /// Writes `value` into `robot`.
    pub fn set(self, robot: &mut RobotModel, value: f64) {
        match self {
            FileNumber::Inertia { link, axis } => {
                let link = &mut robot.spec.links[link - 1];
                // Products grow along, so that no axis is left with a negative moment.
                let stretched = (value / link.inertia_kg_m2[axis]).max(0.0).sqrt();
                link.inertia_kg_m2[axis] = value;
                for (product, axes) in link.products_kg_m2.iter_mut().zip([[0, 1], [0, 2], [1, 2]]) {
                    if axes.contains(&axis) {
                        *product *= stretched;
                    }
                }
            }
            FileNumber::Centre { link, axis } => {
                let mut centre = centre_m(robot, link);
                centre[axis] = value;
                robot.spec.links[link - 1].com_m = Some(centre);
            }
            FileNumber::Offset { joint } => robot.spec.joints[joint - 1].d_m = value,
            FileNumber::Length { joint } => robot.spec.joints[joint - 1].a_m = value,
            FileNumber::Wall { link } => {
                if let Some(section) = &mut robot.spec.links[link - 1].section {
                    section.shape.set_wall_m(value);
                }
            }
        }
    }

    /// Whether it is a length of the kinematics, which moves points and joints.
    pub fn is_length(self) -> bool {
        matches!(self, FileNumber::Offset { .. } | FileNumber::Length { .. })
    }
}

/// Centre of mass of a link in its own frame, m: where the file does not say it, its place in that frame is the same at every
/// posture.
fn centre_m(robot: &RobotModel, link: usize) -> [f64; 3] {
    robot.spec.links[link - 1].com_m.unwrap_or_else(|| {
        let kinematics = Kinematics::new(&robot.spec, &vec![0.0; robot.joint_count()]);
        let centre: Point3<f64> = robot.link_com(&kinematics, link);
        (kinematics.frames[link].inverse() * centre).coords.into()
    })
}

/// Wall of the section of a link, m; `None` where it has none.
fn walled(spec: &RobotSpec, link: usize) -> Option<f64> {
    spec.links[link - 1].section?.shape.wall_m()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::fixture::{TAP_POSTURES, irb6640};

    /// Moving what follows a joint is setting its length.
    #[test]
    fn lengths_moved_are_lengths_set() {
        let mut robot = RobotModel::new(irb6640());
        let nominal = robot.kinematics(&TAP_POSTURES[2]).unwrap();
        let before = robot.spec.clone();
        for (k, number) in FileNumber::lengths(&before).into_iter().enumerate() {
            let value = number.of(&robot) + 1e-3 * (k + 1) as f64;
            number.set(&mut robot, value);
        }
        let expected = robot.kinematics(&TAP_POSTURES[2]).unwrap();
        let found = nominal.with_lengths(&before, &robot.spec);
        for (e, f) in expected.frames.iter().zip(&found.frames) {
            assert!((e.to_homogeneous() - f.to_homogeneous()).norm() < 1e-12);
        }
        assert!((expected.tool.to_homogeneous() - found.tool.to_homogeneous()).norm() < 1e-12);
        for joint in 1..=6 {
            assert!(
                (expected.joint_origin(joint) - found.joint_origin(joint)).norm() < 1e-12,
                "{joint}"
            );
            assert!(
                (expected.joint_axis(joint) - found.joint_axis(joint)).norm() < 1e-12,
                "{joint}"
            );
        }
        assert!((expected.tcp() - nominal.tcp()).norm() > 1e-3);
    }

    /// A centre that the file does not give, written down where it is, changes nothing at any posture.
    #[test]
    fn a_centre_that_is_written_down_stays_where_it_was() {
        let robot = RobotModel::new(irb6640());
        let mut written = robot.clone();
        for number in FileNumber::centres(&robot.spec) {
            let value = number.of(&robot);
            number.set(&mut written, value);
        }
        for posture in &TAP_POSTURES {
            let kinematics = robot.kinematics(posture).unwrap();
            for link in 1..=6 {
                let (a, b) = (
                    robot.link_com(&kinematics, link),
                    written.link_com(&kinematics, link),
                );
                assert!((a - b).norm() < 1e-12, "{link}");
            }
        }
    }

    #[test]
    fn numbers_that_say_the_same_are_left_out() {
        let names: Vec<String> = FileNumber::lengths(&irb6640())
            .into_iter()
            .map(FileNumber::name)
            .collect();
        // Joints 2 and 3 are parallel: d of joint 3 is that of joint 2. The last joint's are the tool's.
        assert_eq!(
            names,
            [
                "joint-1.a",
                "joint-2.d",
                "joint-2.a",
                "joint-3.a",
                "joint-4.d",
                "joint-4.a",
                "joint-5.d",
                "joint-5.a"
            ]
        );
    }
}
