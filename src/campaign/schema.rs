//! The validated content of `campaign.toml`.

use std::path::PathBuf;

use crate::ingest::{ChannelRule, Dof, Quantity};

/// A validated campaign. Paths are absolute or relative to the working directory (already joined with `dir`).
#[derive(Debug, Clone)]
pub struct Campaign {
    pub dir: PathBuf,
    pub name: String,
    /// Who measured, as the head of a report names him or her.
    pub operator: Option<String>,
    /// When it was measured, as it was written down.
    pub date: Option<String>,
    pub robot: Option<RobotSection>,
    pub postures: Vec<Posture>,
    pub points: Vec<Point>,
    pub frfs: Vec<FrfFile>,
    pub tool: Option<Tool>,
    pub dynamometer: Dynamometer,
    /// What the channels of the force files are, where the files do not say it.
    pub channels: Vec<CutChannel>,
    pub cuts: Vec<Cut>,
    pub lobes: Option<LobesSection>,
    /// Workpiece material: of every cut that names none itself.
    pub material: Option<String>,
    pub orthogonal: Option<OrthogonalSection>,
    pub plan: PlanSection,
}

/// A channel of the force files of all cuts, or of one.
#[derive(Debug, Clone, PartialEq)]
pub struct CutChannel {
    /// Id of the only cut that it holds for.
    pub cut: Option<String>,
    pub rule: ChannelRule,
}

impl Campaign {
    /// How the channels of this cut's file become forces: what is said of the cut goes before what is said of all.
    pub fn channel_rules(&self, cut_id: &str) -> Vec<ChannelRule> {
        let own = || self.channels.iter().filter(|c| c.cut.as_deref() == Some(cut_id));
        let is_own = |rule: &ChannelRule| own().any(|o| o.rule.measures == rule.measures);
        let common = self
            .channels
            .iter()
            .filter(|c| c.cut.is_none() && !is_own(&c.rule));
        own().chain(common).map(|c| c.rule.clone()).collect()
    }
}

/// What is to be measured where there are no files yet; `None` and empty: the usual.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PlanSection {
    pub responses: Vec<Dof>,
    pub hits: Vec<Dof>,
    /// First and last line.
    pub band_hz: Option<[f64; 2]>,
    /// Spacing of the lines.
    pub lines_hz: Option<f64>,
    /// Expected noise as a share of the response (complex standard deviation).
    pub noise_relative: Option<f64>,
    /// Expected noise that is always there.
    pub noise_floor_m_per_n: Option<f64>,
}

/// What orthogonal cuts of the material gave, to predict the milling coefficients from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrthogonalSection {
    pub shear_stress_mpa: f64,
    pub friction_angle_deg: f64,
    pub chip: ChipFormation,
    /// Normal rake of the tool.
    pub rake_deg: f64,
    /// `None`: the tool's helix angle; none in turning.
    pub inclination_deg: Option<f64>,
}

/// How the chip forms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ChipFormation {
    ShearAngleRad(f64),
    /// Uncut over cut chip thickness.
    ChipRatio(f64),
}

#[derive(Debug, Clone, PartialEq)]
pub struct RobotSection {
    /// Built-in name (`irb6640`) or path of a robot file.
    pub model: String,
    /// Relative standard deviation of each link's mass (and inertia with it); `None`: masses are exact.
    pub mass_tolerance: Option<f64>,
    /// Standard deviation of the logarithm of a joint stiffness about the robot file's value.
    pub stiffness_tolerance: f64,
    /// What else of the robot file is not exact.
    pub links: LinkTolerances,
}

/// Standard deviations of the links' numbers about those of the robot file; `None`: the file is exact.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LinkTolerances {
    /// Of the logarithm of the principal moments of inertia.
    pub inertia: Option<f64>,
    /// Of the centres of mass, m.
    pub centre_m: Option<f64>,
    /// Of lengths and offsets of the kinematics, m.
    pub length_m: Option<f64>,
    /// Of the logarithm of the sections' walls.
    pub wall: Option<f64>,
}

/// What of a robot's links a calibration may free.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum LinkGroup {
    Masses,
    Inertias,
    Centres,
    Lengths,
    Walls,
}

impl LinkGroup {
    pub const ALL: [LinkGroup; 5] = [
        LinkGroup::Masses,
        LinkGroup::Inertias,
        LinkGroup::Centres,
        LinkGroup::Lengths,
        LinkGroup::Walls,
    ];

    /// The key of `[robot]` that frees the group for good.
    pub const fn key(self) -> &'static str {
        match self {
            LinkGroup::Masses => "mass_tolerance",
            LinkGroup::Inertias => "inertia_tolerance",
            LinkGroup::Centres => "com_tolerance_mm",
            LinkGroup::Lengths => "length_tolerance_mm",
            LinkGroup::Walls => "wall_tolerance",
        }
    }

    /// What is taken where nobody has said anything else, in the unit of the key: numbers of a data sheet or a drawing that
    /// somebody had to estimate.
    pub fn usual_tolerance(self) -> f64 {
        match self {
            LinkGroup::Masses => 0.1,
            LinkGroup::Inertias => 0.4,
            LinkGroup::Centres => 50.0,
            LinkGroup::Lengths => 10.0,
            LinkGroup::Walls => 0.3,
        }
    }
}

impl RobotSection {
    /// The tolerance of a group, in the unit of its key; `None`: the robot file is exact there.
    pub fn tolerance(&self, group: LinkGroup) -> Option<f64> {
        let mm = |m: f64| m * 1e3;
        match group {
            LinkGroup::Masses => self.mass_tolerance,
            LinkGroup::Inertias => self.links.inertia,
            LinkGroup::Centres => self.links.centre_m.map(mm),
            LinkGroup::Lengths => self.links.length_m.map(mm),
            LinkGroup::Walls => self.links.wall,
        }
    }

    /// The same section with `groups` free: within the usual tolerance, where it gives none.
    pub fn freeing(&self, groups: &[LinkGroup]) -> RobotSection {
        let mut free = self.clone();
        for group in groups.iter().filter(|g| self.tolerance(**g).is_none()) {
            let usual = group.usual_tolerance();
            match group {
                LinkGroup::Masses => free.mass_tolerance = Some(usual),
                LinkGroup::Inertias => free.links.inertia = Some(usual),
                LinkGroup::Centres => free.links.centre_m = Some(usual * 1e-3),
                LinkGroup::Lengths => free.links.length_m = Some(usual * 1e-3),
                LinkGroup::Walls => free.links.wall = Some(usual),
            }
        }
        free
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct Posture {
    pub id: String,
    pub joints_deg: Vec<f64>,
}

/// The body of the robot that a measurement point sits on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BodyRef {
    Base,
    /// 1-based link number; its frame is DH frame i.
    Link(usize),
    /// Origin at the tool centre point, axes of the tool.
    Tool,
}

/// In which frame X, Y, Z of the FRF files are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AxesRef {
    Base,
    /// The frame of the point's body.
    Body,
    Tool,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    pub node: i64,
    pub body: BodyRef,
    pub position_m: [f64; 3],
    pub axes: AxesRef,
}

#[derive(Debug, Clone, PartialEq)]
pub struct FrfFile {
    pub file: PathBuf,
    /// Index into `Campaign::postures`.
    pub posture: usize,
    pub quantity: Option<Quantity>,
    pub force_level_n: Option<f64>,
    /// Line of `campaign.toml`, for messages.
    pub line: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ToolKind {
    Endmill,
    Drill,
    /// A turning tool with one insert; `teeth` is 1.
    Turning,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Tool {
    pub kind: ToolKind,
    /// 0 for a turning tool, which has none: the workpiece turns.
    pub diameter_mm: f64,
    pub teeth: usize,
    pub helix_deg: f64,
    /// End mills: radius of the corner between face and side; half the diameter is a ball end, 0 a sharp corner. Turning:
    /// the nose radius rε.
    pub corner_radius_mm: f64,
    /// End mills: angle between the feed's plane and the straight part of the edge (κr of inserts); 90° up the side.
    /// Turning: κr, between the direction of the feed and the straight part of the edge.
    pub lead_angle_deg: f64,
    /// Drills: half of the point angle.
    pub half_point_angle_deg: Option<f64>,
    /// Drills: web thickness.
    pub web_thickness_mm: Option<f64>,
}

impl Tool {
    /// Whether the edge of an end mill runs straight up its side.
    pub fn has_straight_edge(&self) -> bool {
        self.corner_radius_mm == 0.0 && self.lead_angle_deg == 90.0
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct Dynamometer {
    /// Rows of A in F_tool = A F_recorded; identity where the campaign does not say.
    pub tool_from_dyno: [[f64; 3]; 3],
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Process {
    Milling,
    Drilling,
    Turning,
}

impl Process {
    pub const ALL: [Process; 3] = [Process::Milling, Process::Drilling, Process::Turning];

    /// As `campaign.toml` and people call it.
    pub fn name(self) -> &'static str {
        match self {
            Process::Milling => "milling",
            Process::Drilling => "drilling",
            Process::Turning => "turning",
        }
    }

    /// What its feed is counted for, as in "mm per tooth".
    pub fn feed_per(self) -> &'static str {
        match self {
            Process::Milling => "tooth",
            Process::Drilling | Process::Turning => "revolution",
        }
    }
}

/// Immersion angles from +y, clockwise, rad; 0 ≤ start < exit ≤ 2π.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Immersion {
    pub start_rad: f64,
    pub exit_rad: f64,
}

impl Immersion {
    pub const SLOT: Immersion = Immersion {
        start_rad: 0.0,
        exit_rad: std::f64::consts::PI,
    };
}

/// What was cut: geometry and feed of one record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CutGeometry {
    Milling {
        feed_per_tooth_mm: f64,
        axial_depth_mm: f64,
        immersion: Immersion,
    },
    Drilling {
        feed_per_rev_mm: f64,
        /// Zero: drilled into the full.
        pilot_diameter_mm: f64,
        /// Depth at full diameter.
        hole_depth_mm: Option<f64>,
    },
    Turning {
        feed_per_rev_mm: f64,
        /// ap, across the feed.
        depth_of_cut_mm: f64,
        /// Of the workpiece where it is cut: with the spindle speed it gives the cutting speed.
        diameter_mm: f64,
    },
}

impl CutGeometry {
    pub fn process(&self) -> Process {
        match self {
            CutGeometry::Milling { .. } => Process::Milling,
            CutGeometry::Drilling { .. } => Process::Drilling,
            CutGeometry::Turning { .. } => Process::Turning,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum CutOutcome {
    Stable,
    Chatter,
}

impl CutOutcome {
    pub fn label(self) -> &'static str {
        match self {
            CutOutcome::Stable => "stable",
            CutOutcome::Chatter => "chatter",
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct Cut {
    pub id: String,
    pub file: PathBuf,
    pub spindle_rpm: f64,
    pub geometry: CutGeometry,
    /// Position in the sequence in which the cuts were made.
    pub order: Option<i64>,
    /// Overrides the detected steady window, s of the record's time axis.
    pub steady_s: Option<[f64; 2]>,
    /// What was cut: the cut's own `material`, else the campaign's.
    pub material: Option<String>,
    /// How the cut went, where someone listened.
    pub outcome: Option<CutOutcome>,
    /// Where the robot stood: index into `Campaign::postures`.
    pub posture: Option<usize>,
    /// Line of `campaign.toml`, for messages.
    pub line: usize,
}

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

/// `[[lobes.tool.segment]]`: a stretch of the tool of one section and material, from the holder face to the tip.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct ToolSegment {
    pub length_mm: f64,
    pub diameter_mm: f64,
    pub bore_mm: f64,
    /// Diameter of the round bar that is as stiff over `diameter_mm`: below 1 for flutes.
    pub flute_ratio: f64,
    pub young_gpa: f64,
    pub shear_gpa: f64,
    pub density_kg_per_m3: f64,
    pub loss_factor: f64,
    /// See [`crate::lobes::BeamSegment::twist_coupling`].
    pub twist_coupling: f64,
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
