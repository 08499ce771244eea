//! Robots from URDF files (the robot description of ROS) and back.
//!
//! A URDF has geometry and rigid bodies. It has no compliances and no damping: those of a robot that is read here are from the file
//! next to it ([`BesideUrdf`]), else guesses, said to be guesses in the robot file ([`guess`]).

mod body;
pub mod guess;
mod read;
mod tree;
mod write;

pub use crate::campaign::beside_urdf::{BesideUrdf, SaidBeside, beside};
pub use read::{Request, UrdfRobot, read};
pub use write::{Sources, compliances, urdf};

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::data::{BeamSection, SectionShape};
    use crate::robot::fixture::{TAP_POSTURES, irb6640};
    use crate::robot::frf::natural_frequencies_hz;
    use crate::robot::{Baseline, Dual, Kinematics, RobotModel};

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

    fn sources() -> Sources {
        Sources {
            source: "calibrated on a test".into(),
            damping_ratio: 0.02,
            young_pa: Some(70e9),
            left_out: Vec::new(),
        }
    }

    /// The IRB 6640 with sections of every kind, one turned askew.
    fn with_sections() -> RobotModel {
        let mut spec = irb6640();
        let height_axis = [0.2, 0.9, 0.4];
        let mut section = BeamSection::tube(0.3, 0.02);
        section.shape = SectionShape::Box {
            width_m: 0.2,
            height_m: 0.3,
            wall_m: 0.01,
            height_axis,
        };
        spec.links[1].section = Some(section);
        spec.links[3].section = Some(BeamSection {
            shape: SectionShape::General {
                area_m2: 4e-3,
                second_moment_y_m4: 3e-5,
                second_moment_z_m4: 1e-5,
                torsion_constant_m4: 2e-5,
                height_axis,
            },
            young_pa: Some(180e9),
            shear_pa: Some(60e9),
        });
        RobotModel::new(spec)
    }

    /// Written and read back with the file next to it, a robot has the same frequencies, with links that bend any way, and nothing in it
    /// is a guess.
    #[test]
    fn both_files_together_are_the_robot() {
        let robot = with_sections();
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("out.urdf");
        let text = urdf(&robot, &sources());
        std::fs::write(beside(&file), compliances(&robot.spec, &sources())).unwrap();
        let request = Request {
            beside: BesideUrdf::find(&file).unwrap(),
            ..Request::default()
        };
        let found = read(&file, &text, &request).unwrap();
        assert_eq!(found.spec.guesses, Vec::<String>::new());
        let said = found.beside.unwrap();
        assert_eq!(said.file_name, "out.compliances.toml");
        assert_eq!(said.source.as_deref(), Some("calibrated on a test"));
        let back = RobotModel::new(found.spec);
        for posture in &TAP_POSTURES {
            let frequencies = |robot: &RobotModel| {
                let mut baseline = Baseline::nominal(&robot.spec);
                baseline.young_pa = Some(Dual::constant(70e9));
                let kinematics = robot.kinematics(posture).unwrap();
                natural_frequencies_hz(&robot.chain(&kinematics, &baseline).system(0)).unwrap()
            };
            for (a, b) in frequencies(&robot).iter().zip(&frequencies(&back)).take(12) {
                approx::assert_relative_eq!(a, b, max_relative = 1e-9);
            }
        }
    }

    #[test]
    fn a_file_of_another_robot_is_refused() {
        let robot = RobotModel::new(irb6640());
        let text = urdf(&robot, &sources());
        let whole = compliances(&robot.spec, &sources());
        for (beside_text, words) in [
            (
                whole.replace("\"joint_2\"", "\"elbow\""),
                "says nothing of joint \"joint_2\", which out.urdf has",
            ),
            (
                whole.replace("\"joint_2\"", "\"joint_1\""),
                "joint[1].name: \"joint_1\" is there twice",
            ),
            (
                whole.replacen("compliance_rad_per_nm = ", "compliance_rad_per_nm = -", 1),
                "joint[0].compliance_rad_per_nm: is -",
            ),
            (whole.replace("[[joint]]", "[[joint"), "not valid TOML"),
            (whole.replace("section_wall_m", "wall_m"), "unknown key"),
        ] {
            let folder = tempfile::tempdir().unwrap();
            let file = folder.path().join("out.urdf");
            std::fs::write(beside(&file), beside_text).unwrap();
            let request = Request {
                beside: BesideUrdf::find(&file).unwrap(),
                ..Request::default()
            };
            let message = read(&file, &text, &request).unwrap_err().to_string();
            assert!(
                message.contains(words)
                    && message.contains("out.compliances.toml:")
                    && message.contains("remedy"),
                "{message}"
            );
        }
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
