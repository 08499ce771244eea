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

/// How the angles of one posture may be written down wrongly. Joints are 1-based.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Slip {
    /// The numbers of two joints exchanged.
    Exchanged(usize, usize),
    /// The decimal point of a joint's number elsewhere: in truth so many times as much.
    Point(usize, f64),
    /// A joint's sign.
    Sign(usize),
    /// A joint a quarter or half a turn off, rad.
    Turn(usize, f64),
}

impl Slip {
    /// All that a robot of so many joints allows.
    fn all(joints: usize) -> Vec<Slip> {
        let each = 1..=joints;
        let mut all: Vec<Slip> = Vec::new();
        all.extend(
            each.clone()
                .flat_map(|a| (a + 1..=joints).map(move |b| Slip::Exchanged(a, b))),
        );
        for joint in each {
            all.extend([10.0, 0.1].map(|times| Slip::Point(joint, times)));
            all.push(Slip::Sign(joint));
            all.extend([FRAC_PI_2, -FRAC_PI_2, PI].map(|turn| Slip::Turn(joint, turn)));
        }
        all
    }

    /// By what each joint has to be turned to stand as in truth, from the angles as they are written, rad.
    fn turns_rad(self, angles_rad: &[f64]) -> Vec<(usize, f64)> {
        let at = |joint: usize| angles_rad[joint - 1];
        match self {
            Slip::Exchanged(a, b) => vec![(a, at(b) - at(a)), (b, at(a) - at(b))],
            Slip::Point(joint, times) => vec![(joint, (times - 1.0) * at(joint))],
            Slip::Sign(joint) => vec![(joint, -2.0 * at(joint))],
            Slip::Turn(joint, turn) => vec![(joint, turn)],
        }
    }

    /// So small that a fitted offset of a joint finds it; of two exchanged numbers, that they are the same.
    fn is_small(self, angles_rad: &[f64]) -> bool {
        let least_rad = match self {
            Slip::Exchanged(..) => SAME_RAD,
            _ => LEAST_RAD,
        };
        self.turns_rad(angles_rad)
            .iter()
            .all(|(_, turn)| turn.abs() < least_rad)
    }
}

/// Turn below which the angles are not mistyped, rad.
const LEAST_RAD: f64 = 0.15;
/// Difference of two angles below which it does not matter which is which, rad.
const SAME_RAD: f64 = 0.01;

/// The angles of one posture, written down wrongly.
pub struct MistypedAngles {
    posture: usize,
    slip: Slip,
    kinematics: Kinematics,
    /// By how much the (first) joint is turned, rad.
    turn_rad: f64,
    /// Slips that were looked at.
    tried: usize,
}

impl FileReading for MistypedAngles {
    fn corrected(&self, data: &FrfData) -> FrfData {
        data.with_kinematics(|posture| (posture == self.posture).then_some(&self.kinematics))
    }

    fn finding(&self, data: &FrfData, _points: &[Point]) -> SetupFinding {
        let id = data.posture_ids.get(self.posture).map_or("?", |id| id);
        let line = format!("joints_deg of posture {id} in campaign.toml");
        let (kind, joint, what) = match self.slip {
            Slip::Exchanged(a, b) => (
                "joint-angles",
                format!("joints {a} and {b}"),
                format!("The numbers {a} and {b} of {line} are exchanged."),
            ),
            Slip::Point(joint, times) => (
                "encoder-offset",
                format!("joint {joint}"),
                format!(
                    "The decimal point of number {joint} of {line} is wrong: the FRFs fit {times} times as much."
                ),
            ),
            Slip::Sign(joint) => (
                "encoder-offset",
                format!("joint {joint}"),
                format!("The sign of number {joint} of {line} is wrong."),
            ),
            Slip::Turn(joint, turn) => (
                "encoder-offset",
                format!("joint {joint}"),
                format!("Add {:+.0} to number {joint} of {line}.", turn.to_degrees()),
            ),
        };
        let turn_rad = (kind == "encoder-offset").then_some(self.turn_rad);
        joint_angles::finding(kind, format!("{joint}, posture {id}"), turn_rad, what)
    }

    fn tried(&self) -> f64 {
        self.tried as f64
    }
}

/// Every slip at every posture; where there is one posture only, that is what the conventions of the joints are.
pub fn proposed(
    table: &DistanceTable,
    model: &StructureModel,
    data: &FrfData,
    theta: &[f64],
) -> Result<Vec<Proposed>> {
    let postures = data.measured_postures();
    if postures.len() < 2 {
        return Ok(Vec::new());
    }
    let with_angles = joint_angles::given(model, data);
    let slips = Slip::all(model.robot.joint_count());
    let tried = slips.len() * postures.len();
    let mut all = Vec::new();
    for slip in slips {
        // The same slip at every posture, predicted at once; each posture is then judged by itself.
        let slipped: Vec<Option<Kinematics>> = with_angles
            .iter()
            .map(|posture| {
                let (kinematics, angles_rad) = posture.as_ref()?;
                let turns = slip.turns_rad(angles_rad);
                (!slip.is_small(angles_rad)).then(|| {
                    turns
                        .iter()
                        .fold((*kinematics).clone(), |k, (joint, turn)| k.turned(*joint, *turn))
                })
            })
            .collect();
        let curves = predict(model, theta, &data.with_kinematics(|p| slipped[p].as_ref()), None)?;
        for &posture in &postures {
            let (Some(kinematics), Some((_, angles_rad))) = (&slipped[posture], &with_angles[posture]) else {
                continue;
            };
            all.push(Proposed {
                gain: table.gain_by_curves(data, &curves, |frf| frf.posture == posture),
                reading: Box::new(MistypedAngles {
                    posture,
                    slip,
                    kinematics: kinematics.clone(),
                    turn_rad: slip.turns_rad(angles_rad)[0].1,
                    tried,
                }),
            });
        }
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_slip_gives_back_the_angles_that_are_right() {
        let right = [0.3, -0.4, 0.7, 1.1];
        for (given, slip) in [
            ([0.7, -0.4, 0.3, 1.1], Slip::Exchanged(1, 3)),
            ([0.3, -0.04, 0.7, 1.1], Slip::Point(2, 10.0)),
            ([0.3, -0.4, 0.7, 11.0], Slip::Point(4, 0.1)),
            ([0.3, 0.4, 0.7, 1.1], Slip::Sign(2)),
            ([0.3, -0.4, 0.7 - FRAC_PI_2, 1.1], Slip::Turn(3, FRAC_PI_2)),
        ] {
            let mut found = given;
            for (joint, turn) in slip.turns_rad(&given) {
                found[joint - 1] += turn;
            }
            let apart = found.iter().zip(right).map(|(a, b)| (a - b).abs());
            assert!(apart.fold(0.0, f64::max) < 1e-12, "{slip:?}: {found:?}");
            assert!(!slip.is_small(&given), "{slip:?}");
        }
        assert!(Slip::Sign(1).is_small(&[0.05, 0.6]) && Slip::Exchanged(1, 2).is_small(&[0.5, 0.505]));
        assert_eq!(Slip::all(6).len(), 15 + 6 * 6);
    }
}
