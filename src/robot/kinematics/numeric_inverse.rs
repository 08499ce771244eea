//! Inverse kinematics by search for arms of six or seven joints that have no closed form here: damped least squares
//! (Wampler 1986; damping after Sugihara 2011) from many starts.
//!
//! With seven joints the tool pose leaves one motion open. It is told by the elbow angle: how far the elbow (origin of joint
//! 4) is turned about the line from shoulder (joint 2) to wrist (joint 6); see [`NumericInverse::elbow_rad`]. With it the
//! problem has as many equations as joints.

use std::f64::consts::{PI, TAU};

use nalgebra::{Isometry3, Point3, SMatrix, SVector, UnitQuaternion, Vector3};

use crate::data::RobotSpec;
use crate::robot::kinematics::dh::Kinematics;
use crate::robot::kinematics::ik_solution::farthest;
use crate::{Error, Result};

/// Joints at most.
const MOST: usize = 7;

/// Equations: position over the arm's length, rotation vector, elbow angle. Rows and columns that a robot does not have
/// stay zero.
type Equations = SVector<f64, MOST>;
type Jacobian = SMatrix<f64, MOST, MOST>;

/// A solution's pose is off by less: of the arm's length and in rad.
const TOLERANCE: f64 = 1e-11;
const ITERATIONS: usize = 60;
/// Longest step of a joint, rad.
const LONGEST_STEP: f64 = 0.6;
/// Damping in addition to the share of the error.
const LEAST_DAMPING: f64 = 1e-12;
/// Starts at most, and how many more at least after the last one that found something new.
const STARTS: usize = 160;
const MORE_STARTS: usize = 40;
/// Solutions nearer to each other than this in every joint, rad, are one.
const SAME: f64 = 1e-5;
/// A motion is followed in steps of at most this, of the arm's length and in rad.
const FOLLOW_STEP: f64 = 0.04;
/// Inverse condition number below which a posture counts as singular.
const SINGULAR: f64 = 1e-6;

/// Inverse kinematics by search of one robot.
#[derive(Debug, Clone)]
pub struct NumericInverse<'a> {
    spec: &'a RobotSpec,
    /// Sum of the distances between joints and of the tool's: the arm reaches no farther.
    reach_m: f64,
}

/// How far a posture is from what is asked for.
struct Miss {
    error: Equations,
    jacobian: Jacobian,
}

impl<'a> NumericInverse<'a> {
    /// # Errors
    /// Fewer than six joints or more than seven, or an arm without length.
    pub fn new(spec: &'a RobotSpec) -> Result<Self> {
        let refuse = |what: String| {
            Err(Error::computation(format!(
                "{}: no inverse kinematics: {what}",
                spec.name
            )))
        };
        let joints = spec.joints.len();
        if joints < 6 {
            return refuse(format!(
                "{joints} joints cannot put a tool where and how one wants; it takes six"
            ));
        }
        if joints > MOST {
            return refuse(format!(
                "{joints} joints are more than the seven that are handled"
            ));
        }
        let tool_m = Vector3::from(spec.tool.tcp_in_flange_m).norm();
        let reach_m = spec.joints.iter().map(|j| j.length_m()).sum::<f64>() + tool_m;
        if !(reach_m > 1e-6) {
            return refuse("the arm has no length".into());
        }
        Ok(NumericInverse { spec, reach_m })
    }

    /// Whether the arm has seven joints.
    pub fn has_elbow(&self) -> bool {
        self.spec.joints.len() == MOST
    }

    /// Elbow angle of a posture, rad: of the elbow (origin of joint 4) about the line from shoulder (joint 2) to wrist
    /// (joint 6), right-handed, from the side of that line on which the base's z axis points. `None` for arms of six
    /// joints, and where the three lie on one line.
    pub fn elbow_rad(&self, q_rad: &[f64]) -> Option<f64> {
        if !self.has_elbow() {
            return None;
        }
        let kinematics = Kinematics::new(self.spec, q_rad);
        elbow_angle(&elbow_points(&kinematics))
    }

    /// Inverse condition number of the tool's Jacobian, 0 to 1, lengths over the arm's.
    pub fn singularity_margin(&self, q_rad: &[f64]) -> f64 {
        let kinematics = Kinematics::new(self.spec, q_rad);
        let jacobian = self.tool_jacobian(&kinematics);
        let six = jacobian.fixed_rows::<6>(0);
        let squares = (six * six.transpose()).symmetric_eigenvalues();
        (squares.min().max(0.0) / squares.max().max(f64::MIN_POSITIVE)).sqrt()
    }

    /// Whether a posture stands at a singularity, so that no motion can be followed from it.
    pub fn is_singular(&self, q_rad: &[f64]) -> bool {
        self.singularity_margin(q_rad) < SINGULAR || self.has_elbow() && self.elbow_rad(q_rad).is_none()
    }

    /// All postures that a search finds at a tool pose, angles from −π to π, in the order in which they are found:
    /// `reference_rad` is the first start, the others are spread over the joints' ranges and the same every time. With
    /// seven joints those with the elbow at `elbow_rad`.
    pub fn tool_pose(
        &self,
        tool: &Isometry3<f64>,
        reference_rad: &[f64],
        elbow_rad: Option<f64>,
    ) -> Vec<Vec<f64>> {
        let first = Kinematics::new(self.spec, reference_rad).joint_origin(1);
        if (tool.translation.vector - first.coords).norm() > self.reach_m * (1.0 + 1e-9) {
            return Vec::new();
        }
        let mut found: Vec<Vec<f64>> = Vec::new();
        let mut last = 0;
        for start in 0..STARTS {
            if start > 3 * last + MORE_STARTS {
                break;
            }
            let from = match start {
                0 => reference_rad.to_vec(),
                n => self.spread(n),
            };
            let Some(q) = self.solve(tool, elbow_rad, from, ITERATIONS) else {
                continue;
            };
            let q: Vec<f64> = q.into_iter().map(wrapped).collect();
            let apart = |other: &Vec<f64>| {
                let pairs = other.iter().zip(&q);
                pairs.map(|(a, b)| wrapped(a - b).abs()).fold(0.0, f64::max)
            };
            if found.iter().all(|other| apart(other) > SAME) {
                found.push(q);
                last = start;
            }
        }
        found
    }

    /// The posture at a tool pose (and elbow angle) to which a motion straight there from the posture `from_rad` leads;
    /// `None` where it meets a singularity or the end of the reach.
    pub fn follow(
        &self,
        tool: &Isometry3<f64>,
        from_rad: &[f64],
        elbow_rad: Option<f64>,
    ) -> Option<Vec<f64>> {
        let begin = Kinematics::new(self.spec, from_rad).tool;
        let away = (tool.translation.vector - begin.translation.vector).norm() / self.reach_m;
        // Half a turn has no shortest way; the solver would not know it either.
        let turn = (begin.rotation.inverse() * tool.rotation).scaled_axis();
        let elbow = match elbow_rad {
            Some(wanted) => {
                let own = self.elbow_rad(from_rad)?;
                Some((own, wrapped(wanted - own)))
            }
            None => None,
        };
        let farthest_way = away.max(turn.norm()).max(elbow.map_or(0.0, |(_, way)| way.abs()));
        let steps = (farthest_way / FOLLOW_STEP).ceil().max(1.0);
        let mut q = from_rad.to_vec();
        let side = self.side(&q, elbow_rad)?;
        for step in 1..=steps as usize {
            let share = step as f64 / steps;
            let at = match step as f64 == steps {
                true => *tool,
                false => Isometry3::from_parts(
                    begin
                        .translation
                        .vector
                        .lerp(&tool.translation.vector, share)
                        .into(),
                    begin.rotation * UnitQuaternion::from_scaled_axis(turn * share),
                ),
            };
            let bent = elbow.map(|(own, way)| own + way * share);
            let next = self.solve(&at, bent, q.clone(), ITERATIONS / 3)?;
            // A jump, or the other side of a singularity, is another branch.
            if farthest(&next, &q) > LONGEST_STEP || self.side(&next, elbow_rad)? != side {
                return None;
            }
            q = next;
        }
        Some(q)
    }

    /// On which side of the singularities a posture stands: the sign of the equations' determinant; `None` at one.
    fn side(&self, q_rad: &[f64], elbow_rad: Option<f64>) -> Option<bool> {
        let kinematics = Kinematics::new(self.spec, q_rad);
        let mut jacobian = self.tool_jacobian(&kinematics);
        match elbow_rad {
            Some(_) => {
                let row = elbow_slopes(&kinematics)?;
                jacobian.set_row(6, &row.transpose());
            }
            None => jacobian[(6, 6)] = 1.0,
        }
        let determinant = jacobian.determinant();
        (determinant.abs() > 1e-14).then_some(determinant > 0.0)
    }

    /// Start number `n`: Halton's sequence over the joints' ranges.
    fn spread(&self, n: usize) -> Vec<f64> {
        const PRIMES: [usize; MOST] = [2, 3, 5, 7, 11, 13, 17];
        let joints = self.spec.joints.iter().zip(PRIMES);
        joints
            .map(|(joint, prime)| {
                let [low, high] = joint.limits_rad.map_or([-PI, PI], |[low, high]| {
                    // More than a turn leads to nothing new.
                    match high - low > TAU {
                        true => [-PI, PI],
                        false => [low, high],
                    }
                });
                low + (high - low) * halton(n, prime)
            })
            .collect()
    }

    fn solve(
        &self,
        tool: &Isometry3<f64>,
        elbow_rad: Option<f64>,
        mut q: Vec<f64>,
        iterations: usize,
    ) -> Option<Vec<f64>> {
        let mut best = f64::INFINITY;
        let mut stalled = 0;
        for _ in 0..iterations {
            let Miss { error, jacobian } = self.miss(tool, elbow_rad, &q)?;
            let size = error.norm();
            if size < TOLERANCE * 1e-2 {
                return Some(q);
            }
            // Rounding can hold the error above a hundredth of the tolerance.
            stalled = if size < 0.9 * best { 0 } else { stalled + 1 };
            best = best.min(size);
            if stalled > 8 || stalled > 0 && size < TOLERANCE {
                break;
            }
            let damping = 0.5 * size * size + LEAST_DAMPING;
            let mut square = jacobian * jacobian.transpose();
            for i in 0..MOST {
                square[(i, i)] += damping;
            }
            let step = jacobian.transpose() * square.cholesky()?.solve(&error);
            let shorter = (LONGEST_STEP / step.amax().max(f64::MIN_POSITIVE)).min(1.0);
            for (q, d) in q.iter_mut().zip(step.iter()) {
                *q += shorter * d;
            }
        }
        let Miss { error, .. } = self.miss(tool, elbow_rad, &q)?;
        (error.norm() < TOLERANCE).then_some(q)
    }

    /// `None` where the elbow angle is not defined.
    fn miss(&self, tool: &Isometry3<f64>, elbow_rad: Option<f64>, q: &[f64]) -> Option<Miss> {
        let kinematics = Kinematics::new(self.spec, q);
        let mut jacobian = self.tool_jacobian(&kinematics);
        let mut error = Equations::zeros();
        let off = (tool.translation.vector - kinematics.tool.translation.vector) / self.reach_m;
        error.fixed_rows_mut::<3>(0).copy_from(&off);
        let turn = (tool.rotation * kinematics.tool.rotation.inverse()).scaled_axis();
        error.fixed_rows_mut::<3>(3).copy_from(&turn);
        if let Some(wanted) = elbow_rad {
            error[6] = wrapped(wanted - elbow_angle(&elbow_points(&kinematics))?);
            jacobian.set_row(6, &elbow_slopes(&kinematics)?.transpose());
        }
        Some(Miss { error, jacobian })
    }

    /// Twist of the tool point per joint angle: position over the arm's length, rotation.
    fn tool_jacobian(&self, kinematics: &Kinematics) -> Jacobian {
        let mut jacobian = Jacobian::zeros();
        for (i, mut twist) in kinematics.tool_twists().enumerate() {
            twist.fixed_rows_mut::<3>(0).unscale_mut(self.reach_m);
            jacobian.fixed_view_mut::<6, 1>(0, i).copy_from(&twist);
        }
        jacobian
    }
}

/// Shoulder, elbow, wrist.
fn elbow_points(kinematics: &Kinematics) -> [Point3<f64>; 3] {
    [2, 4, 6].map(|joint| kinematics.joint_origin(joint))
}

fn elbow_angle(points: &[Point3<f64>; 3]) -> Option<f64> {
    let [shoulder, elbow, wrist] = points;
    let line = (wrist - shoulder).try_normalize(1e-9)?;
    let across = |v: Vector3<f64>| v - line * line.dot(&v);
    // From x where the line stands upright.
    let up = if line.z.abs() < 0.999_999 {
        Vector3::z()
    } else {
        Vector3::x()
    };
    let zero = across(up).try_normalize(1e-9)?;
    let arm = across(elbow - shoulder);
    (arm.norm() > 1e-9).then(|| arm.dot(&line.cross(&zero)).atan2(arm.dot(&zero)))
}

/// Slopes of the elbow angle over the joint angles: central differences over the three points (the angle has no simple
/// slope), their motion by the geometric Jacobian.
fn elbow_slopes(kinematics: &Kinematics) -> Option<Equations> {
    const STEP_M: f64 = 1e-6;
    let points = elbow_points(kinematics);
    let mut slopes = Equations::zeros();
    for (k, joint) in [2, 4, 6].into_iter().enumerate() {
        let mut slope = Vector3::zeros();
        for axis in 0..3 {
            let shifted = |by: f64| {
                let mut moved = points;
                moved[k][axis] += by;
                elbow_angle(&moved)
            };
            slope[axis] = wrapped(shifted(STEP_M)? - shifted(-STEP_M)?) / (2.0 * STEP_M);
        }
        for i in 1..joint {
            let motion = kinematics
                .joint_axis(i)
                .cross(&(points[k] - kinematics.joint_origin(i)));
            slopes[i - 1] += slope.dot(&motion);
        }
    }
    Some(slopes)
}

/// From −π up to π.
fn wrapped(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}

/// Radical inverse of `n` to a base, 0 to below 1 (Halton 1960).
fn halton(mut n: usize, base: usize) -> f64 {
    let (mut value, mut place) = (0.0, 1.0);
    while n > 0 {
        place /= base as f64;
        value += place * (n % base) as f64;
        n /= base;
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::SphericalWrist;
    use crate::robot::fixture::{TAP_POSTURES, awkward_arm, irb6640, ur10e};

    /// Of two sets of postures, how many of the first the second lacks.
    fn lacking(of: &[Vec<f64>], among: &[Vec<f64>]) -> usize {
        let same = |a: &Vec<f64>, b: &Vec<f64>| a.iter().zip(b).all(|(a, b)| wrapped(a - b).abs() < 1e-4);
        of.iter().filter(|a| !among.iter().any(|b| same(a, b))).count()
    }

    /// What the closed form knows the search finds, all eight.
    #[test]
    fn the_search_finds_what_the_closed_form_knows() {
        let spec = irb6640();
        let closed = SphericalWrist::new(&spec).unwrap();
        let numeric = NumericInverse::new(&spec).unwrap();
        for posture in &TAP_POSTURES {
            let q = posture.map(f64::to_radians);
            let tool = Kinematics::new(&spec, &q).tool;
            let known: Vec<Vec<f64>> = closed.tool_pose(&tool, &q).into_iter().map(|s| s.q_rad).collect();
            let found = numeric.tool_pose(&tool, &q, None);
            assert_eq!(lacking(&known, &found), 0, "{posture:?}");
            assert_eq!(lacking(&found, &known), 0, "{posture:?}");
        }
    }

    /// A search from ten times as many starts, elsewhere, finds nothing that the usual one has not; every posture found
    /// leads back to the pose.
    #[test]
    fn a_dense_search_finds_nothing_more() {
        let mut all = 0;
        for (spec, poses) in [(ur10e(), 6), (awkward_arm(6), 3)] {
            let numeric = NumericInverse::new(&spec).unwrap();
            for pose in 0..poses {
                let angle = |j: usize| 4.0 * (halton(pose + 11, [2, 3, 5, 7, 11, 13][j]) - 0.5);
                let q: Vec<f64> = (0..6).map(angle).collect();
                let tool = Kinematics::new(&spec, &q).tool;
                let found = numeric.tool_pose(&tool, &[0.1; 6], None);
                for q in &found {
                    let back = Kinematics::new(&spec, q).tool;
                    assert!((back.translation.vector - tool.translation.vector).norm() < 1e-9);
                    assert!(back.rotation.angle_to(&tool.rotation) < 1e-9);
                }
                let dense =
                    (1000..2600).filter_map(|n| numeric.solve(&tool, None, numeric.spread(n), ITERATIONS));
                let dense: Vec<Vec<f64>> = dense.map(|q| q.into_iter().map(wrapped).collect()).collect();
                assert_eq!(lacking(&dense, &found), 0, "{} pose {pose}: {q:?}", spec.name);
                assert_eq!(lacking(&[q], &found), 0, "{} pose {pose}", spec.name);
                all += found.len();
            }
        }
        assert!(all >= 40, "{all}");
    }

    /// The elbow turns, the tool stays; the slopes are those of differences.
    #[test]
    fn the_elbow_turns_with_the_tool_at_rest() {
        let spec = awkward_arm(7);
        let numeric = NumericInverse::new(&spec).unwrap();
        let q = [0.4, 0.6, -0.3, 1.2, 0.5, 0.9, -0.2];
        let tool = Kinematics::new(&spec, &q).tool;
        let own = numeric.elbow_rad(&q).unwrap();
        let slopes = elbow_slopes(&Kinematics::new(&spec, &q)).unwrap();
        for i in 0..7 {
            let mut beside = q;
            beside[i] += 1e-6;
            let above = numeric.elbow_rad(&beside).unwrap();
            beside[i] -= 2e-6;
            let difference = wrapped(above - numeric.elbow_rad(&beside).unwrap()) / 2e-6;
            assert!((slopes[i] - difference).abs() < 1e-6, "{i}");
        }
        let mut turned = 0;
        for by in [-0.2, -0.1, 0.1, 0.2] {
            let Some(there) = numeric.follow(&tool, &q, Some(own + by)) else {
                continue;
            };
            turned += 1;
            let back = Kinematics::new(&spec, &there).tool;
            assert!((back.translation.vector - tool.translation.vector).norm() < 1e-9);
            assert!(back.rotation.angle_to(&tool.rotation) < 1e-9);
            assert!((numeric.elbow_rad(&there).unwrap() - own - by).abs() < 1e-9);
            assert!(farthest(&there, &q) > 0.02);
        }
        assert!(turned >= 2, "{turned}");
    }

    #[test]
    fn other_numbers_of_joints_are_refused_in_words() {
        for (joints, words) in [(5, "it takes six"), (8, "more than the seven")] {
            let spec = awkward_arm(joints);
            let message = NumericInverse::new(&spec).err().unwrap().to_string();
            assert!(message.contains(words), "{message}");
        }
    }
}
