//! Robots from URDF files (the robot description of ROS) and back.
//!
//! A URDF has geometry and rigid bodies. It has no compliances and no damping: those of a robot that is read here are
//! guesses, said to be guesses in the robot file ([`guess`]), until a file next to the URDF says them
//! ([`crate::campaign::beside_urdf`]).

mod body;
pub mod guess;
mod read;
mod tree;
mod write;

pub use read::{Request, UrdfRobot, read};
pub(crate) use write::{Names, behind_axis};
pub use write::{Sources, urdf};

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::robot::{Kinematics, RobotModel};

    const FILES: [&str; 2] = [
        include_str!("../../../tests/data/urdf/askew.urdf"),
        include_str!("../../../tests/data/urdf/seven.urdf"),
    ];

    fn robot(text: &str) -> crate::Result<UrdfRobot> {
        read(Path::new("arm.urdf"), text, &Request::default())
    }

    /// Whatever is broken in a file is refused, or leaves a robot with numbers in it; nothing panics.
    #[test]
    fn broken_files_are_refused_or_sound() {
        let (mut refused, mut read) = (0, 0);
        for text in FILES {
            for at in (0..text.len()).step_by(29) {
                let (head, tail) = (&text[..at], &text[at..]);
                let without = tail.get(3..).unwrap_or("");
                for broken in [
                    head.to_string(),
                    format!("{head}{without}"),
                    format!("{head}9{tail}"),
                    format!("{head}\"/><{tail}"),
                    format!("{head}e99{without}"),
                ] {
                    let Ok(found) = robot(&broken) else {
                        refused += 1;
                        continue;
                    };
                    read += 1;
                    let model = RobotModel::new(found.spec);
                    let kinematics = Kinematics::new(&model.spec, &vec![0.3; model.joint_count()]);
                    let centre = model.centre_of_mass(&kinematics).unwrap();
                    assert!(
                        centre
                            .coords
                            .iter()
                            .chain(kinematics.tcp().coords.iter())
                            .all(|v| v.is_finite())
                    );
                }
            }
        }
        assert!(refused > 500 && read > 50, "{refused} {read}");
    }

    /// What is read, written as a robot file and read again is the same robot.
    #[test]
    fn the_robot_file_is_the_robot() {
        for text in FILES {
            let found = robot(text).unwrap();
            let folder = tempfile::tempdir().unwrap();
            std::fs::write(
                folder.path().join("arm.toml"),
                found.spec.to_toml(&Default::default()),
            )
            .unwrap();
            let back = crate::data::RobotSpec::load("arm.toml", folder.path()).unwrap();
            assert_eq!(
                (&back.name, &back.guesses),
                (&found.spec.name, &found.spec.guesses)
            );
            for (a, b) in back.links.iter().zip(&found.spec.links) {
                assert_eq!(a, b);
            }
            for (a, b) in back.joints.iter().zip(&found.spec.joints) {
                assert_eq!(
                    (&a.name, a.compliance_rad_per_nm),
                    (&b.name, b.compliance_rad_per_nm)
                );
                let (a, b) = (a.axis_frame(), b.axis_frame());
                assert!((a.to_homogeneous() - b.to_homogeneous()).norm() < 1e-13);
            }
            let tools = (back.tool.in_flange(), found.spec.tool.in_flange());
            assert!((tools.0.to_homogeneous() - tools.1.to_homogeneous()).norm() < 1e-13);
        }
    }
}
