//! Which lobes are wanted, and of what.

use super::cut::{Immersion, Process};
use super::tool::ToolSegment;

/// Where the FRFs of the tool point come from that lobes are computed with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LobeSource {
    /// The calibrated robot model.
    Model,
    /// The measured FRFs of the campaign.
    Measured,
    /// The modes in the `[[lobes.mode]]` tables.
    Modes,
}

/// How stability limits are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LobeMethod {
    /// Milling and turning: the directional force coefficients averaged over a revolution.
    ZeroOrder,
    /// Milling: the coefficients with their harmonics of the tooth passing frequency, in the frequency domain.
    MultiFrequency,
    /// Milling: semi-discretisation of one tooth period in time, of first order; needs modes.
    SemiDiscretisation,
    /// Drilling, in the frequency domain: lateral and, where Kac is known, axial–torsional vibration.
    FrequencyDomain,
}

/// Degree of freedom of a mode in the `[[lobes.mode]]` table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LobeAxis {
    /// Across the tool axis; in milling along the feed.
    X,
    /// Across the tool axis, at right angles to x.
    Y,
    /// Along the tool axis.
    Z,
    /// Turn about the tool axis.
    Theta,
}

/// A mode of the tool point that somebody gives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LobeMode {
    /// Along or about what the tool point moves.
    pub axis: LobeAxis,
    /// Undamped natural frequency.
    pub frequency_hz: f64,
    /// Viscous damping ratio ζ, 0 < ζ < 1.
    pub damping_ratio: f64,
    /// N/m; for theta N·m/rad.
    pub stiffness_n_per_m: f64,
    /// Theta: how much longer the drill gets per radian that it unwinds (turned against the rotation); 0 in other axes.
    pub extension_mm_per_rad: f64,
}

/// `[lobes.redundancy]`: the robot is turned about the tool axis, while tool point and axis stay where they are.
#[derive(Debug, Clone, PartialEq)]
pub struct Redundancy {
    /// Index into `Campaign::postures`.
    pub posture: usize,
    /// Step of the angle about the tool axis; angles run from 0 through a whole turn.
    pub step_deg: f64,
    /// Bands \[from, to\] of that angle which are not to be used; whole turns do not count.
    pub forbidden_deg: Vec<[f64; 2]>,
    /// Seven joints: the elbow is turned in steps of this, too; `None`: it stays as the posture has it.
    pub elbow_step_deg: Option<f64>,
}

/// The `[lobes]` section: what stability lobes are wanted.
#[derive(Debug, Clone, PartialEq)]
pub struct LobesSection {
    /// Process whose lobes they are.
    pub process: Process,
    /// Where the FRFs of the tool point come from.
    pub source: LobeSource,
    /// How the limits are computed.
    pub method: LobeMethod,
    /// Tangential cutting coefficient Ktc; `None`: this and Krc come from the campaign's cuts.
    pub ktc_n_per_mm2: Option<f64>,
    /// Radial cutting coefficient Krc (turning: normal to the edge); `None`: this and Ktc come from the campaign's cuts.
    pub krc_n_per_mm2: Option<f64>,
    /// Drilling: axial cutting coefficient Kac; `None`: from the campaign's cuts if Ktc or Krc is, else not known.
    pub kac_n_per_mm2: Option<f64>,
    /// Drilling: the coefficients are predicted from the orthogonal database and the drill's geometry.
    pub from_orthogonal: bool,
    /// Number of teeth; `None`: that of the campaign's tool.
    pub teeth: Option<usize>,
    /// Milling: where a tooth is in the workpiece; milling lobes need it.
    pub immersion: Option<Immersion>,
    /// Milling, methods other than zero-order: see [`crate::lobes::ProcessDamping`]; drilling: see
    /// [`crate::lobes::drilling::flank_damping`].
    pub process_damping_n_per_m: Option<f64>,
    /// Drilling: stiffness of the contact between the margins and the wall; `None`: the tip is free.
    pub margin_stiffness_n_per_m: Option<f64>,
    /// Drilling: damping of that contact; `None`: none.
    pub margin_damping_ns_per_m: Option<f64>,
    /// Drilling: half of the point angle; `None`: that of the campaign's tool.
    pub half_point_angle_deg: Option<f64>,
    /// Drilling: feed per revolution; `None`: no thrust is predicted, and axial–torsional lobes take 0.
    pub feed_per_rev_mm: Option<f64>,
    /// From, to, step.
    pub spindle_rpm: [f64; 3],
    /// Modes of the tool point; used with [`LobeSource::Modes`] only.
    pub modes: Vec<LobeMode>,
    /// Sweep over the robot's turn about the tool axis; `None`: the postures as they are.
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
    /// How far the hole may be off, normal to the tool axis.
    pub position_tolerance_mm: f64,
    /// How far the axis of the hole may be tilted.
    pub perpendicularity_tolerance_deg: f64,
    /// Drilling: grade of the diameter's tolerance, 8 for H8 (ISO 286-1); `None`: the diameter is not judged.
    pub diameter_grade: Option<u32>,
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
            diameter_grade: None,
        }
    }
}
