use std::f64::consts::{FRAC_PI_2, PI};

use super::super::finding::SetupFinding;
use super::super::reading::FileReading;
use super::super::scene::predict;
use super::joint_angles;
use super::proposal::Proposed;
use super::table::DistanceTable;
use crate::Result;
use crate::data::Point;
use crate::identify::StructureModel;
use crate::identify::frfs::frf_data::FrfData;
use crate::robot::Kinematics;

/// How a controller may count a joint's angle where the robot file counts it otherwise.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Convention {
    /// The other way round.
    Reversed,
    /// From another zero, rad.
    Zero(f64),
    /// Against the horizontal instead of the link before it (parallel linkages): so many times that link's angle is in it.
    WithTheOneBefore(f64),
}

/// One joint's angles of all postures, counted by another convention than the robot file's.
pub struct JointConvention {
    /// 1-based.
    joint: usize,
    convention: Convention,
    /// By posture index, of those that have FRFs, as the postures are if this is right.
    kinematics: Vec<Option<Kinematics>>,
}

impl FileReading for JointConvention {
    fn corrected(&self, data: &FrfData) -> FrfData {
        data.with_kinematics(|posture| self.kinematics[posture].as_ref())
    }

    fn finding(&self, _data: &FrfData, _points: &[Point]) -> SetupFinding {
        let joint = self.joint;
        let angle = format!("angle {joint} of every joints_deg in campaign.toml");
        let (kind, what, value, remedy) = match self.convention {
            Convention::Reversed => (
                "joint-convention",
                "counted the other way round".to_owned(),
                None,
                format!("Turn the sign of {angle}, or of that joint's axis in the robot file."),
            ),
            Convention::Zero(turn) => (
                "encoder-offset",
                "all postures".to_owned(),
                Some(turn),
                format!(
                    "Add {:+.0} deg to {angle}, or to the offset of that joint in the robot file.",
                    turn.to_degrees()
                ),
            ),
            Convention::WithTheOneBefore(times) => {
                let before = joint - 1;
                let (with, mend) = match times > 0.0 {
                    true => ("together with", format!("Take angle {before} from")),
                    false => ("against", format!("Add angle {before} to")),
                };
                (
                    "joint-convention",
                    format!("counted {with} joint {before}"),
                    None,
                    format!(
                        "{mend} {angle}: the controller counts it {with} the joint before (a parallel linkage)."
                    ),
                )
            }
        };
        joint_angles::finding(kind, format!("joint {joint}, {what}"), value, remedy)
    }
}

/// The turn of joint `joint` (1-based) at a posture that makes of its `angles_rad` as they are given what they are.
fn turn_rad(convention: Convention, joint: usize, angles_rad: &[f64]) -> f64 {
    match convention {
        Convention::Reversed => -2.0 * angles_rad[joint - 1],
        Convention::Zero(turn) => turn,
        Convention::WithTheOneBefore(times) => -times * angles_rad[joint - 2],
    }
}

/// Every joint by every convention. Another zero of the first joint turns the whole robot, which the axes tell.
pub fn proposed(
    table: &DistanceTable,
    model: &StructureModel,
    data: &FrfData,
    theta: &[f64],
) -> Result<Vec<Proposed>> {
    let with_angles = joint_angles::given(model, data);
    let mut all = Vec::new();
    for joint in 1..=model.robot.joint_count() {
        let zeros = [FRAC_PI_2, -FRAC_PI_2, PI].map(Convention::Zero);
        let linked = [1.0, -1.0].map(Convention::WithTheOneBefore);
        let later = zeros.into_iter().chain(linked).filter(|_| joint > 1);
        for convention in std::iter::once(Convention::Reversed).chain(later) {
            let read = |posture: &Option<(&Kinematics, Vec<f64>)>| {
                let (kinematics, angles_rad) = posture.as_ref()?;
                Some(kinematics.turned(joint, turn_rad(convention, joint, angles_rad)))
            };
            let reading = JointConvention {
                joint,
                convention,
                kinematics: with_angles.iter().map(read).collect(),
            };
            let curves = predict(model, theta, &reading.corrected(data), None)?;
            all.push(Proposed {
                gain: table.gain_by_curves(data, &curves, |_| true),
                reading: Box::new(reading),
            });
        }
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_convention_gives_back_the_angles_that_are_right() {
        let right = [0.3, -0.4, 0.7, 1.1];
        let with = |joint: usize, value: f64| {
            let mut given = right;
            given[joint - 1] = value;
            given
        };
        for (given, joint, convention) in [
            (with(3, -0.7), 3, Convention::Reversed),
            (with(4, 1.1 - PI), 4, Convention::Zero(PI)),
            (with(3, 0.7 - 0.4), 3, Convention::WithTheOneBefore(1.0)),
            (with(3, 0.7 + 0.4), 3, Convention::WithTheOneBefore(-1.0)),
        ] {
            let found = given[joint - 1] + turn_rad(convention, joint, &given);
            assert!(
                (found - right[joint - 1]).abs() < 1e-12,
                "{convention:?}: {found}"
            );
        }
    }
}
