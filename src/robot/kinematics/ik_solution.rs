//! A solution of the inverse kinematics, and what joint angles are judged by.

use std::f64::consts::TAU;

use nalgebra::Isometry3;

use crate::data::{JointSpec, RobotSpec};
use crate::robot::kinematics::dh::Kinematics;

/// Joint angles that put the tool where it was asked to be.
#[derive(Debug, Clone, PartialEq)]
pub struct IkSolution {
    /// Which of the solutions. In closed form 4 shoulder + 2 elbow + wrist, each of which keeps its meaning along a
    /// motion that meets no singularity; by search 0 is the solution nearest to the reference, 1 the next.
    pub branch: u32,
    /// Whole turns chosen so that joints lie within their limits, and there nearest to the reference.
    pub q_rad: Vec<f64>,
    /// Distance of the nearest joint to its limit, rad; negative outside, infinite without limits.
    pub limit_margin_rad: f64,
    /// Distance from the nearest singularity, 0 to 1. In closed form the least of |sin θ₅| (wrist), the sine between upper
    /// and fore arm (elbow), and the wrist's distance from axis 1 over the upper arm's length (shoulder); by search the
    /// inverse condition number of the Jacobian with lengths over the arm's own.
    pub singularity_margin: f64,
    /// Of an arm with seven joints, see [`crate::robot::NumericInverse::elbow_rad`].
    pub elbow_rad: Option<f64>,
}

impl IkSolution {
    /// Whether every joint keeps its limits.
    pub fn is_within_limits(&self) -> bool {
        // Rounding must not put an angle at its limit outside.
        self.limit_margin_rad >= -1e-9
    }

    /// Joint angles, degrees.
    pub fn joints_deg(&self) -> Vec<f64> {
        self.q_rad.iter().map(|q| q.to_degrees()).collect()
    }
}

/// Greatest difference of two postures in any joint, rad.
pub(crate) fn farthest(a: &[f64], b: &[f64]) -> f64 {
    let differences = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, f64::max)
}

/// Distance of the nearest joint to its limit, rad; negative outside.
pub(crate) fn limit_margin_rad(joints: &[JointSpec], q_rad: &[f64]) -> f64 {
    let margins = joints.iter().zip(q_rad).filter_map(|(joint, q)| {
        let [low, high] = joint.limits_rad?;
        Some((q - low).min(high - q))
    });
    margins.fold(f64::INFINITY, f64::min)
}

/// The angle plus whole turns: within the limits where it can be, and there nearest to the reference.
pub(crate) fn nearest_turn(angle_rad: f64, reference_rad: f64, limits_rad: Option<[f64; 2]>) -> f64 {
    let nearest = angle_rad + TAU * ((reference_rad - angle_rad) / TAU).round();
    let Some([low, high]) = limits_rad else {
        return nearest;
    };
    // Rounding must not put an angle at its limit outside.
    let inside = |q: f64| q >= low - 1e-12 && q <= high + 1e-12;
    (-3..=3)
        .map(|turn| nearest + TAU * f64::from(turn))
        .filter(|q| inside(*q))
        .min_by(|a, b| (a - reference_rad).abs().total_cmp(&(b - reference_rad).abs()))
        .unwrap_or(nearest)
}

/// The tool frame at joint angles.
pub(crate) fn tool_at(spec: &RobotSpec, q_rad: &[f64]) -> Isometry3<f64> {
    Kinematics::new(spec, q_rad).tool
}
