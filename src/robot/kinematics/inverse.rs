//! Inverse kinematics: in closed form for six-axis arms with a spherical wrist ([`SphericalWrist`]), by search for other
//! arms of six or seven joints ([`NumericInverse`]).

use std::f64::consts::TAU;

use nalgebra::Isometry3;

use crate::data::RobotSpec;
use crate::robot::kinematics::ik_solution::{IkSolution, farthest, limit_margin_rad, nearest_turn};
use crate::robot::kinematics::numeric_inverse::NumericInverse;
use crate::robot::kinematics::spherical_wrist::SphericalWrist;
use crate::{Error, Result};

/// The posture that a task refers to.
#[derive(Debug, Clone)]
pub struct IkReference {
    /// Joint angles, rad.
    pub q_rad: Vec<f64>,
    /// Its branch; `None` where solutions are searched for.
    branch: Option<u32>,
    /// Elbow angle to be kept, of an arm with seven joints.
    pub elbow_rad: Option<f64>,
}

impl IkReference {
    /// Branch of the posture itself among the solutions at any pose.
    pub fn own_branch(&self) -> u32 {
        self.branch.unwrap_or(0)
    }
}

#[derive(Debug, Clone)]
enum Form<'a> {
    Closed(SphericalWrist<'a>),
    Numeric(NumericInverse<'a>),
}

/// Inverse kinematics of one robot.
#[derive(Debug, Clone)]
pub struct InverseKinematics<'a> {
    spec: &'a RobotSpec,
    form: Form<'a>,
}

/// Elbow angles that are tried where the wanted one cannot be had, rad: 10°.
const ELBOW_STEP: f64 = TAU / 36.0;
/// The same where every one takes a search: 60°.
const WIDE_ELBOW_STEP: f64 = TAU / 6.0;

impl<'a> InverseKinematics<'a> {
    /// # Errors
    /// Arms of fewer than six joints, which reach single poses only, or of more than seven.
    pub fn new(spec: &'a RobotSpec) -> Result<Self> {
        let form = match SphericalWrist::new(spec) {
            Ok(closed) => Form::Closed(closed),
            Err(_) => Form::Numeric(NumericInverse::new(spec)?),
        };
        Ok(InverseKinematics { spec, form })
    }

    /// Whether the arm has a joint more than a tool pose needs, so that its elbow can be turned with the tool at rest.
    pub fn has_elbow(&self) -> bool {
        matches!(&self.form, Form::Numeric(numeric) if numeric.has_elbow())
    }

    /// The posture, in degrees, that `what` refers to.
    ///
    /// # Errors
    /// Another number of joints, or a posture at a singularity.
    pub fn reference(&self, joints_deg: &[f64], what: &str) -> Result<IkReference> {
        let joints = self.spec.joints.len();
        if joints_deg.len() != joints {
            return Err(Error::computation(format!("{what} needs {joints} joint angles")));
        }
        let q_rad: Vec<f64> = joints_deg.iter().map(|q| q.to_radians()).collect();
        let singular = || {
            Error::computation(format!(
                "the posture that {what} refers to stands at a singularity of the robot: choose another one"
            ))
        };
        let (branch, elbow_rad) = match &self.form {
            Form::Closed(closed) => (Some(closed.branch_of(&q_rad).ok_or_else(singular)?), None),
            Form::Numeric(numeric) => {
                if numeric.is_singular(&q_rad) {
                    return Err(singular());
                }
                (None, numeric.elbow_rad(&q_rad))
            }
        };
        Ok(IkReference {
            q_rad,
            branch,
            elbow_rad,
        })
    }

    /// The posture at a tool pose that a motion from `near_rad` (a posture on the reference's branch) leads to without
    /// meeting a singularity, within the limits; an elbow stands as the reference wants it or, where the limits or the reach
    /// stand against that, as near to it as can be (in steps of 10°).
    pub fn follow(
        &self,
        tool: &Isometry3<f64>,
        reference: &IkReference,
        near_rad: &[f64],
    ) -> Option<IkSolution> {
        let numeric = match &self.form {
            Form::Closed(closed) => {
                let all = closed.tool_pose(tool, near_rad);
                return all
                    .into_iter()
                    .find(|s| Some(s.branch) == reference.branch && s.is_within_limits());
            }
            Form::Numeric(numeric) => numeric,
        };
        let elbows = match reference.elbow_rad {
            Some(wanted) => around(wanted, ELBOW_STEP).map(Some).collect(),
            None => vec![None],
        };
        elbows
            .into_iter()
            .filter_map(|elbow| numeric.follow(tool, near_rad, elbow))
            .map(|q| self.found(q, near_rad, 0))
            .find(IkSolution::is_within_limits)
    }

    /// All postures at a tool pose, within the limits or not, in a fixed order; none where it is out of reach. The
    /// reference chooses among whole turns of the joints. Of an arm with seven joints those with the reference's elbow
    /// angle, or, where none of them lies within the limits, with another one (in steps of 60°).
    pub fn tool_pose(&self, tool: &Isometry3<f64>, reference: &IkReference) -> Vec<IkSolution> {
        let numeric = match &self.form {
            Form::Closed(closed) => return closed.tool_pose(tool, &reference.q_rad),
            Form::Numeric(numeric) => numeric,
        };
        let at = |elbow: Option<f64>| -> Vec<IkSolution> {
            let found = numeric.tool_pose(tool, &reference.q_rad, elbow);
            let mut all: Vec<IkSolution> = found
                .into_iter()
                .map(|q| self.found(q, &reference.q_rad, 0))
                .collect();
            let off = |s: &IkSolution| farthest(&s.q_rad, &reference.q_rad);
            all.sort_by(|a, b| off(a).total_cmp(&off(b)));
            for (branch, solution) in (0..).zip(&mut all) {
                solution.branch = branch;
            }
            all
        };
        let Some(wanted) = reference.elbow_rad else {
            return at(None);
        };
        let mut beyond = Vec::new();
        for elbow in around(wanted, WIDE_ELBOW_STEP) {
            let all = at(Some(elbow));
            if all.iter().any(IkSolution::is_within_limits) {
                return all;
            }
            if beyond.is_empty() {
                beyond = all;
            }
        }
        beyond
    }

    fn found(&self, q_rad: Vec<f64>, reference_rad: &[f64], branch: u32) -> IkSolution {
        let joints = self.spec.joints.iter().zip(q_rad.iter().zip(reference_rad));
        let q_rad: Vec<f64> = joints
            .map(|(joint, (q, reference))| nearest_turn(*q, *reference, joint.limits_rad))
            .collect();
        let (singularity_margin, elbow_rad) = match &self.form {
            Form::Numeric(numeric) => (numeric.singularity_margin(&q_rad), numeric.elbow_rad(&q_rad)),
            Form::Closed(_) => (0.0, None),
        };
        IkSolution {
            branch,
            limit_margin_rad: limit_margin_rad(&self.spec.joints, &q_rad),
            singularity_margin,
            elbow_rad,
            q_rad,
        }
    }
}

/// Angles from `wanted` outwards on both sides in turn, once round.
fn around(wanted: f64, step: f64) -> impl Iterator<Item = f64> {
    let count = (TAU / step).round() as i32;
    (0..count).map(move |i| {
        let outwards = f64::from((i + 1) / 2) * step;
        wanted + if i % 2 == 0 { -outwards } else { outwards }
    })
}
