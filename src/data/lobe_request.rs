//! Which lobes are wanted, and of what.

use super::cut::{Immersion, Process};
use super::tool::ToolSegment;

#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LobeSource {
    Model,
    Measured,
    Modes,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LobeMethod {
    ZeroOrder,
    MultiFrequency,
    SemiDiscretisation,
    FrequencyDomain,
}

/// Degree of freedom of a mode in the `[[lobes.mode]]` table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LobeAxis {
    X,
    Y,
    Z,
    Theta,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LobeMode {
    pub axis: LobeAxis,
    pub frequency_hz: f64,
    pub damping_ratio: f64,
    /// N/m; for theta N·m/rad.
    pub stiffness_n_per_m: f64,
    /// Theta: how much longer the drill gets per radian that it unwinds (turned against the rotation); 0 in other axes.
    pub extension_mm_per_rad: f64,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Redundancy {
    /// Index into `Campaign::postures`.
    pub posture: usize,
    pub step_deg: f64,
    pub forbidden_deg: Vec<[f64; 2]>,
    /// Seven joints: the elbow is turned in steps of this, too; `None`: it stays as the posture has it.
    pub elbow_step_deg: Option<f64>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct LobesSection {
    pub process: Process,
    pub source: LobeSource,
    pub method: LobeMethod,
    pub ktc_n_per_mm2: Option<f64>,
    pub krc_n_per_mm2: Option<f64>,
    pub kac_n_per_mm2: Option<f64>,
    pub teeth: Option<usize>,
    pub immersion: Option<Immersion>,
    /// Milling, methods other than zero-order: see [`crate::lobes::ProcessDamping`].
    pub process_damping_n_per_m: Option<f64>,
    pub half_point_angle_deg: Option<f64>,
    pub feed_per_rev_mm: Option<f64>,
    /// From, to, step.
    pub spindle_rpm: [f64; 3],
    pub modes: Vec<LobeMode>,
    pub redundancy: Option<Redundancy>,
    /// `[lobes.tool]`: the tool as a beam, from the holder face to the tip; empty: rigid, or part of the FRFs.
    pub tool: Vec<ToolSegment>,
    /// `None` where the campaign has no `[lobes.hole]`: the defaults hold.
    pub hole: Option<HoleSection>,
}

/// `[lobes.hole]`: what pushes the tool, and what the hole may be off by. A force that is left out is predicted from the
/// cutting coefficients.
#[derive(Debug, Clone, PartialEq)]
pub struct HoleSection {
    /// Against the tool, away from the workpiece.
    pub thrust_n: Option<f64>,
    /// On the tool about its axis, against its rotation.
    pub torque_nm: Option<f64>,
    /// Across the tool axis, in whichever direction does most harm.
    pub lateral_n: Option<f64>,
    /// Drilling: zero is into the full.
    pub pilot_diameter_mm: Option<f64>,
    pub position_tolerance_mm: f64,
    pub perpendicularity_tolerance_deg: f64,
}

impl Default for HoleSection {
    /// Tolerances of bush-free robotic drilling (`datasets/irb6640/cutting_conditions.toml`).
    fn default() -> Self {
        HoleSection {
            thrust_n: None,
            torque_nm: None,
            lateral_n: None,
            pilot_diameter_mm: None,
            position_tolerance_mm: 0.25,
            perpendicularity_tolerance_deg: 0.5,
        }
    }
}
