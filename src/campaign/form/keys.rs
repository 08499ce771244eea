//! Every key of `campaign.toml` and of robot files: what it holds, in which unit, and whether it has to be there. The
//! loader takes from here which keys a table may have, and `json_schema` everything.

use crate::campaign::form::bounds::Bounds;
use crate::data::LinkGroup;

/// Key of an error that is about the reference to a robot file, not about the file.
pub(crate) const ROBOT_KEY: &str = "robot.model";

/// One key of a table.
#[derive(Debug, Clone, Copy)]
pub struct Key {
    /// As it stands before the equals sign.
    pub name: &'static str,
    /// What its value must be.
    pub holds: Holds,
    /// In every table of this kind. What depends on other keys (the feed of a milling cut) the loader alone knows.
    pub required: bool,
    /// For somebody who is writing the file; units are in the names.
    pub about: &'static str,
}

/// What stands behind the equals sign.
#[derive(Debug, Clone, Copy)]
pub enum Holds {
    /// Any text that is not blank.
    Text,
    /// One of these.
    Words(&'static [&'static str]),
    /// Text of this form (a regular expression).
    Form(&'static str),
    /// A finite number within these bounds.
    Number(Bounds),
    /// From, to.
    Whole(i64, i64),
    /// Numbers, at least one.
    Numbers,
    /// A list of texts.
    Texts,
    /// So many numbers.
    Array(usize),
    /// Rows of so many numbers; how many rows, where that is fixed.
    Rows(usize, Option<usize>),
    /// One table `[key]` with these keys.
    Section(&'static [Key]),
    /// Tables `[[key]]`, each with these keys.
    Sections(&'static [Key]),
}

const fn may(name: &'static str, holds: Holds, about: &'static str) -> Key {
    Key {
        name,
        holds,
        required: false,
        about,
    }
}

const fn must(name: &'static str, holds: Holds, about: &'static str) -> Key {
    Key {
        name,
        holds,
        required: true,
        about,
    }
}

/// The names of a table's keys, as [`Section`](crate::campaign::form::section::Section) wants them.
pub const fn names<const N: usize>(keys: &[Key; N]) -> [&'static str; N] {
    let mut names = [""; N];
    let mut i = 0;
    while i < N {
        names[i] = keys[i].name;
        i += 1;
    }
    names
}

/// The form of `campaign.toml` that this program reads.
pub const FORM: &str = "lobestone/campaign/1";

const ANY: Holds = Holds::Number(Bounds::ANY);
const POSITIVE: Holds = Holds::Number(Bounds::POSITIVE);
const NOT_NEGATIVE: Holds = Holds::Number(Bounds::NOT_NEGATIVE);
const UP_TO_RIGHT_ANGLE: Holds = Holds::Number(Bounds::above_up_to(0.0, 90.0));
const HALF_TURN: Holds = Holds::Number(Bounds::closed(0.0, 180.0));
const WITHIN_RIGHT_ANGLES: Holds = Holds::Number(Bounds::open(-90.0, 90.0));
const PROCESS: Holds = Holds::Words(&["milling", "drilling", "turning"]);
const SLOT: Holds = Holds::Words(&["slot"]);
const TEETH: Holds = Holds::Whole(1, 1000);
const BODY: Holds = Holds::Form("^(base|tool|link[1-9][0-9]*)$");

/// The top of `campaign.toml`.
pub const TOP: [Key; 17] = [
    must("schema", Holds::Words(&[FORM]), "Form of this file"),
    may(
        "name",
        Holds::Text,
        "Name of the campaign; the folder's if left out",
    ),
    may("operator", Holds::Text, "Who measured, for the head of reports"),
    may(
        "date",
        Holds::Text,
        "When it was measured, in quotes: \"2026-11-23\"",
    ),
    may("robot", Holds::Section(&ROBOT), "The robot; needed for FRFs"),
    may("posture", Holds::Sections(&POSTURE), "A posture of the robot"),
    may(
        "point",
        Holds::Sections(&POINT),
        "Where a node of the FRF files sits",
    ),
    may(
        "frf",
        Holds::Sections(&FRF),
        "A file of frequency response functions",
    ),
    may("tool", Holds::Section(&TOOL), "The cutting tool; needed for cuts"),
    may("material", Holds::Section(&MATERIAL), "Workpiece material"),
    may(
        "orthogonal",
        Holds::Section(&ORTHOGONAL),
        "What orthogonal cuts of the material gave",
    ),
    may(
        "dynamometer",
        Holds::Section(&DYNAMOMETER),
        "How the dynamometer stands",
    ),
    may(
        "channel",
        Holds::Sections(&CHANNEL),
        "A channel of the force files, where they do not say what it is",
    ),
    may("cut", Holds::Sections(&CUT), "A cut whose forces were recorded"),
    may(
        "contact",
        Holds::Sections(&CONTACT),
        "Pressure foot or clamp: a spring from the tool point to the ground while it cuts",
    ),
    may(
        "lobes",
        Holds::Section(&LOBES),
        "What stability lobes are asked for",
    ),
    may(
        "plan",
        Holds::Section(&PLAN),
        "What is to be measured, for `lobestone plan`",
    ),
];

pub(crate) const ROBOT: [Key; 7] = [
    must(
        "model",
        Holds::Text,
        "A built-in robot (irb6640), or the path of a robot file in this folder",
    ),
    may(
        "mass_tolerance",
        Holds::Number(Bounds::closed(0.0, 1.0)),
        "Relative standard deviation of the link masses; left out: they are exact",
    ),
    may(
        "stiffness_tolerance",
        Holds::Number(Bounds::above_up_to(0.0, 5.0)),
        "Standard deviation of the logarithm of a joint stiffness [0.3]",
    ),
    may(
        LinkGroup::Inertias.key(),
        Holds::Number(Bounds::closed(0.0, 2.0)),
        "Standard deviation of the logarithm of the links' principal moments of inertia; left out: they are exact",
    ),
    may(
        LinkGroup::Centres.key(),
        Holds::Number(Bounds::closed(0.0, 1000.0)),
        "Standard deviation of the links' centres of mass, mm; left out: they are exact",
    ),
    may(
        LinkGroup::Lengths.key(),
        Holds::Number(Bounds::closed(0.0, 500.0)),
        "Standard deviation of the kinematics' lengths and offsets, mm; left out: they are exact",
    ),
    may(
        LinkGroup::Walls.key(),
        Holds::Number(Bounds::closed(0.0, 2.0)),
        "Standard deviation of the logarithm of the walls of links that bend; left out: they are exact",
    ),
];

pub(crate) const POSTURE: [Key; 2] = [
    must("id", Holds::Text, "Such as \"p1\""),
    must(
        "joints_deg",
        Holds::Numbers,
        "One angle a joint in degrees, base first",
    ),
];

pub(crate) const POINT: [Key; 4] = [
    must(
        "node",
        Holds::Whole(i64::MIN, i64::MAX),
        "Node number in the FRF files",
    ),
    must(
        "body",
        BODY,
        "What it sits on: \"base\", \"link1\" …, or \"tool\" (origin at the tool centre point)",
    ),
    must("position_m", Holds::Array(3), "In that body's frame, m"),
    must(
        "axes",
        Holds::Words(&["base", "body", "tool"]),
        "What X, Y, Z mean in the files",
    ),
];

pub(crate) const FRF: [Key; 4] = [
    must("file", Holds::Text, "Path in this folder: UFF 58, CSV, …"),
    must("posture", Holds::Text, "Id of a [[posture]]"),
    may(
        "quantity",
        Holds::Words(&["receptance", "mobility", "accelerance", "acceleration"]),
        "Needed where the file does not say",
    ),
    may("force_level_n", POSITIVE, "Level of the hammer or shaker, N"),
];

pub(crate) const TOOL: [Key; 14] = [
    must(
        "kind",
        Holds::Words(&["endmill", "ballend", "drill", "turning"]),
        "What it is",
    ),
    may("diameter_mm", POSITIVE, "Diameter, mm; not of a turning tool"),
    may(
        "teeth",
        TEETH,
        "Number of teeth (lips of a drill); not of a turning tool",
    ),
    may("helix_deg", WITHIN_RIGHT_ANGLES, "Helix angle, degrees [0]"),
    may(
        "corner_radius_mm",
        NOT_NEGATIVE,
        "End mills: corner between face and side, mm; at most half the diameter [0; ball ends: half the diameter]",
    ),
    may(
        "lead_angle_deg",
        UP_TO_RIGHT_ANGLE,
        "End mills: angle between the feed's plane and the edge (kappa_r of inserts), degrees [90]",
    ),
    may(
        "pitch_deg",
        Holds::Numbers,
        "End mills of variable pitch: for each tooth the angle to the one that cuts next, degrees; together 360",
    ),
    may(
        "tooth_helix_deg",
        Holds::Numbers,
        "End mills of variable helix: the helix angle of each tooth, in the order in which they cut, degrees [helix_deg]",
    ),
    may(
        "tooth_radius_offset_mm",
        Holds::Numbers,
        "End mills: how far each tooth stands beyond half the diameter, in the order in which they cut, mm; negative: chipped, \
         by more than the feed: missing [0]",
    ),
    may(
        "half_point_angle_deg",
        UP_TO_RIGHT_ANGLE,
        "Drills: half of the point angle, degrees",
    ),
    may(
        "web_thickness_mm",
        POSITIVE,
        "Drills: web thickness, mm; below the diameter",
    ),
    may(
        "chisel_edge_angle_deg",
        Holds::Number(Bounds::open(90.0, 180.0)),
        "Drills: angle from a lip to the chisel edge, degrees [125]",
    ),
    may("nose_radius_mm", NOT_NEGATIVE, "Turning: nose radius, mm [0]"),
    may(
        "cutting_edge_angle_deg",
        Holds::Number(Bounds::closed(1.0, 150.0)),
        "Turning: angle between feed and cutting edge (kappa_r), degrees [90]",
    ),
];

pub(crate) const MATERIAL: [Key; 1] = [must(
    "name",
    Holds::Text,
    "Such as \"Ti-6Al-4V\"; of every cut that names none itself",
)];

pub(crate) const ORTHOGONAL: [Key; 11] = [
    must(
        "shear_stress_mpa",
        POSITIVE,
        "Shear stress in the shear plane, MPa",
    ),
    must(
        "friction_angle_deg",
        Holds::Number(Bounds::open(0.0, 90.0)),
        "Friction angle on the rake face, degrees",
    ),
    may(
        "chip_ratio",
        POSITIVE,
        "Uncut over cut chip thickness; or shear_angle_deg",
    ),
    may(
        "shear_angle_deg",
        Holds::Number(Bounds::open(0.0, 90.0)),
        "Shear angle, degrees; or chip_ratio",
    ),
    must(
        "rake_deg",
        WITHIN_RIGHT_ANGLES,
        "Normal rake angle of the tool, degrees",
    ),
    may(
        "inclination_deg",
        WITHIN_RIGHT_ANGLES,
        "Inclination of the edge, degrees [the helix angle]",
    ),
    may(
        "shear_stress_law",
        Holds::Array(4),
        "Drills: shear stress in MPa at rake (degrees), chip thickness (mm), speed (m/min): [constant, per rake, per chip, per speed]",
    ),
    may(
        "friction_angle_law",
        Holds::Array(4),
        "Drills: friction angle in degrees, likewise: [19.1, 0.29, 0.0, 0.0]",
    ),
    may(
        "chip_ratio_law",
        Holds::Array(4),
        "Drills: chip ratio (a + b rake) chip^(c + d rake): [1.755, -0.028, 0.331, -0.0082]",
    ),
    may(
        "edge_force_tangential_n_per_mm",
        NOT_NEGATIVE,
        "Drills: edge force along the speed, N per mm of lip [0]",
    ),
    may(
        "edge_force_normal_n_per_mm",
        NOT_NEGATIVE,
        "Drills: edge force normal to the lip, N per mm of lip [0]",
    ),
];

pub(crate) const DYNAMOMETER: [Key; 1] = [must(
    "tool_from_dyno",
    Holds::Rows(3, Some(3)),
    "A in F_tool = A F_recorded: row 1 is tool x in dynamometer axes",
)];

pub(crate) const CHANNEL: [Key; 10] = [
    must(
        "name",
        Holds::Words(&["fx", "fy", "fz", "mz", "time"]),
        "What the channel measures",
    ),
    may("in_file", Holds::Text, "Its name in the file [name]"),
    may(
        "column",
        Holds::Whole(1, 10_000),
        "Its column from 1, in tables without names",
    ),
    may(
        "unit",
        Holds::Text,
        "Of the values: N, kN, V, mV, pC, A, N·m; of the time s, ms",
    ),
    may(
        "gain",
        Holds::Text,
        "With its units: \"500 N/V\", \"10 mV/N\", \"-3.9 pC/N\", \"350 N/A\"",
    ),
    may(
        "gain_n_per_unit",
        ANY,
        "Newtons (N·m) for one of the unit; or gain",
    ),
    may("offset", ANY, "In the unit of the values, taken off first [0]"),
    may("sign", Holds::Whole(-1, 1), "1 or -1 [1]"),
    may(
        "rate_hz",
        POSITIVE,
        "Samples a second of files without a time column, Hz",
    ),
    may(
        "cut",
        Holds::Text,
        "Id of the only [[cut]] that it holds for [all]",
    ),
];

pub(crate) const CUT: [Key; 20] = [
    must("id", Holds::Text, "Such as \"01\""),
    must("file", Holds::Text, "Path of the force record in this folder"),
    must("process", PROCESS, "Milling, drilling or turning"),
    may(
        "spindle_rpm",
        POSITIVE,
        "Spindle speed, rev/min; turning: or cutting_speed_m_per_min and diameter_mm",
    ),
    may("feed_per_tooth_mm", POSITIVE, "Milling: feed per tooth, mm"),
    may("axial_depth_mm", POSITIVE, "Milling: axial depth of cut, mm"),
    may(
        "immersion",
        SLOT,
        "Milling: the full width; or start_deg and exit_deg",
    ),
    may(
        "start_deg",
        HALF_TURN,
        "Milling: where a tooth enters, degrees from +y, clockwise",
    ),
    may(
        "exit_deg",
        HALF_TURN,
        "Milling: where a tooth leaves, degrees from +y, clockwise",
    ),
    may(
        "feed_per_rev_mm",
        POSITIVE,
        "Drilling and turning: feed per revolution, mm",
    ),
    may(
        "pilot_diameter_mm",
        NOT_NEGATIVE,
        "Drilling: diameter of the hole that is there, mm [0: into the full]",
    ),
    may("hole_depth_mm", POSITIVE, "Drilling: depth at full diameter, mm"),
    may("depth_of_cut_mm", POSITIVE, "Turning: depth of cut, mm"),
    may("diameter_mm", POSITIVE, "Turning: diameter of the workpiece, mm"),
    may(
        "cutting_speed_m_per_min",
        POSITIVE,
        "Turning: cutting speed, m/min, with diameter_mm; or spindle_rpm",
    ),
    may(
        "order",
        Holds::Whole(i64::MIN, i64::MAX),
        "Position in the sequence in which the cuts were made",
    ),
    may(
        "steady_s",
        Holds::Array(2),
        "Steady window from, to in s of the record, instead of the one that is found",
    ),
    may(
        "outcome",
        Holds::Words(&["stable", "chatter"]),
        "How the cut went, where someone listened",
    ),
    may(
        "posture",
        Holds::Text,
        "Id of the [[posture]] in which it was made",
    ),
    may("material", Holds::Text, "Of this cut, where cuts are of several"),
];

pub(crate) const LOBES: [Key; 25] = [
    must("process", PROCESS, "Milling, drilling or turning"),
    must(
        "source",
        Holds::Words(&["model", "measured", "modes"]),
        "The calibrated model, the FRF files, or the [[lobes.mode]] tables",
    ),
    may(
        "method",
        Holds::Words(&[
            "zero-order",
            "multi-frequency",
            "semi-discretisation",
            "semi-discretization",
            "frequency-domain",
        ]),
        "Milling: zero-order, multi-frequency or semi-discretisation; drilling: frequency-domain",
    ),
    may(
        "ktc_n_per_mm2",
        POSITIVE,
        "Tangential cutting coefficient, N/mm² [of the campaign's cuts]",
    ),
    may(
        "krc_n_per_mm2",
        ANY,
        "Radial cutting coefficient, N/mm² [of the campaign's cuts]",
    ),
    may("kac_n_per_mm2", ANY, "Axial cutting coefficient, N/mm²"),
    may(
        "coefficients",
        Holds::Words(&["orthogonal"]),
        "Drilling: predict them from [orthogonal] and the drill's geometry, in place of ktc, krc, kac and cuts",
    ),
    may("teeth", TEETH, "Number of teeth [that of the tool]"),
    may(
        "immersion",
        SLOT,
        "The full width; or start_deg and exit_deg, or radial_ratio and cut",
    ),
    may(
        "start_deg",
        HALF_TURN,
        "Where a tooth enters, degrees from +y, clockwise",
    ),
    may(
        "exit_deg",
        HALF_TURN,
        "Where a tooth leaves, degrees from +y, clockwise",
    ),
    may(
        "radial_ratio",
        Holds::Number(Bounds::above_up_to(0.0, 1.0)),
        "Width of cut over diameter; needs cut",
    ),
    may(
        "cut",
        Holds::Words(&["up", "down"]),
        "Up-milling or down-milling; needs radial_ratio",
    ),
    may(
        "process_damping_n_per_m",
        NOT_NEGATIVE,
        "Milling (not zero-order) and drilling: C in the damping C/V of the flank, N/m",
    ),
    may(
        "indentation_n_per_mm3",
        POSITIVE,
        "Drilling: indentation stiffness of the material, N/mm³, with wear_land_mm in place of process_damping_n_per_m",
    ),
    may("wear_land_mm", POSITIVE, "Drilling: width of the worn flank, mm"),
    may(
        "margin_stiffness_n_per_m",
        NOT_NEGATIVE,
        "Drilling: stiffness between the margins and the wall of the hole, N/m [the tip is free]",
    ),
    may(
        "margin_damping_ns_per_m",
        NOT_NEGATIVE,
        "Drilling: damping between the margins and the wall, N·s/m [0]",
    ),
    may(
        "half_point_angle_deg",
        UP_TO_RIGHT_ANGLE,
        "Drilling: half of the point angle, degrees",
    ),
    may("feed_per_rev_mm", POSITIVE, "Drilling: feed per revolution, mm"),
    must("spindle_rpm", Holds::Array(3), "From, to, step, rev/min"),
    may(
        "mode",
        Holds::Sections(&MODE),
        "A mode at the tool point, for source = \"modes\"",
    ),
    may(
        "redundancy",
        Holds::Section(&REDUNDANCY),
        "The robot turned about the tool's axis",
    ),
    may(
        "hole",
        Holds::Section(&HOLE),
        "What pushes the tool, and what the hole may be off by",
    ),
    may("tool", Holds::Section(&LOBE_TOOL), "The tool as a beam"),
];

pub(crate) const MODE: [Key; 5] = [
    must(
        "axis",
        Holds::Words(&["x", "y", "z", "theta"]),
        "Milling: x, y; drilling also z, theta",
    ),
    must("frequency_hz", POSITIVE, "Natural frequency, Hz"),
    must(
        "damping_ratio",
        Holds::Number(Bounds::open(0.0, 1.0)),
        "Damping ratio, such as 0.039",
    ),
    must(
        "stiffness_n_per_m",
        POSITIVE,
        "Modal stiffness, N/m; theta: N·m/rad",
    ),
    may(
        "extension_mm_per_rad",
        ANY,
        "Theta: how much longer the drill gets per radian that it unwinds, mm [0]",
    ),
];

pub(crate) const REDUNDANCY: [Key; 4] = [
    must("posture", Holds::Text, "Id of the [[posture]] whose tool is kept"),
    must(
        "step_deg",
        Holds::Number(Bounds::closed(0.01, 180.0)),
        "Step of the angle, degrees",
    ),
    may(
        "forbidden_deg",
        Holds::Rows(2, None),
        "Angles that cannot be used, degrees: [[200.0, 240.0]]",
    ),
    may(
        "elbow_step_deg",
        Holds::Number(Bounds::closed(1.0, 180.0)),
        "Step of the elbow's angle, degrees; arms of seven joints [it stays]",
    ),
];

pub(crate) const CONTACT: [Key; 5] = [
    may("name", Holds::Text, "Such as \"pressure foot\""),
    must(
        "direction",
        Holds::Words(&["axial", "lateral", "x", "y"]),
        "Along the tool, across it in all directions, or across it along one axis",
    ),
    must("stiffness_n_per_m", NOT_NEGATIVE, "Contact stiffness, N/m"),
    may(
        "damping_ns_per_m",
        NOT_NEGATIVE,
        "Viscous contact damping, N·s/m [0]",
    ),
    may(
        "preload_n",
        NOT_NEGATIVE,
        "Force at which it gives way, N: along the tool the foot's pressure, across it what friction holds [it never does]",
    ),
];

pub(crate) const HOLE: [Key; 7] = [
    may("thrust_n", ANY, "Against the tool, N [from the coefficients]"),
    may(
        "torque_nm",
        NOT_NEGATIVE,
        "Against the rotation, N·m [from the coefficients]",
    ),
    may(
        "lateral_n",
        NOT_NEGATIVE,
        "Across the axis, N [from the coefficients]",
    ),
    may(
        "pilot_diameter_mm",
        NOT_NEGATIVE,
        "Diameter of the hole that is there, mm",
    ),
    may(
        "position_tolerance_mm",
        POSITIVE,
        "Tolerance of the position, mm [0.25]",
    ),
    may(
        "perpendicularity_tolerance_deg",
        POSITIVE,
        "Tolerance of the axis, degrees [0.5]",
    ),
    may(
        "diameter_tolerance",
        Holds::Words(&HOLE_TOLERANCES),
        "Tolerance of the diameter (ISO 286), such as \"H8\"; drilling",
    ),
];

/// Tolerances of a diameter that `[lobes.hole]` knows: ISO 286, position H, in the order of the grades from 6 on.
pub(crate) const HOLE_TOLERANCES: [&str; 8] = ["H6", "H7", "H8", "H9", "H10", "H11", "H12", "H13"];

pub(crate) const LOBE_TOOL: [Key; 1] = [must(
    "segment",
    Holds::Sections(&SEGMENT),
    "A stretch of one section and material, from the holder face to the tip",
)];

pub(crate) const SEGMENT: [Key; 9] = [
    must("length_mm", POSITIVE, "Length, mm"),
    must("diameter_mm", POSITIVE, "Outer diameter, mm"),
    may("bore_mm", NOT_NEGATIVE, "Bore, mm [0]"),
    may(
        "flute_ratio",
        Holds::Number(Bounds::above_up_to(0.0, 1.0)),
        "Diameter of the round bar that is as stiff over diameter_mm [1; about 0.8 with flutes]",
    ),
    must(
        "young_gpa",
        POSITIVE,
        "Young's modulus, GPa (carbide 600, steel 210)",
    ),
    may(
        "shear_gpa",
        POSITIVE,
        "Shear modulus, GPa [Young's modulus / 2.6]",
    ),
    must("density_kg_per_m3", POSITIVE, "Density, kg/m³"),
    may(
        "loss_factor",
        Holds::Number(Bounds::closed(0.0, 1.0)),
        "Loss factor, twice the damping ratio [0.02]",
    ),
    may(
        "twist_coupling",
        Holds::Number(Bounds::closed(-0.9, 0.9)),
        "Positive where a drill gets longer as the torque unwinds it [0]",
    ),
];

pub(crate) const PLAN: [Key; 6] = [
    may(
        "responses",
        Holds::Text,
        "Nodes and directions: \"1X, 1Y, 2Z\" [every point in three directions]",
    ),
    may(
        "hits",
        Holds::Text,
        "Nodes and directions that are hit [the tool in three directions]",
    ),
    may("band_hz", Holds::Array(2), "First and last line, Hz"),
    may("lines_hz", POSITIVE, "Spacing of the lines, Hz"),
    may(
        "noise_relative",
        Holds::Number(Bounds::closed(0.0, 1.0)),
        "Expected noise as a share of the response",
    ),
    may(
        "noise_floor_m_per_n",
        NOT_NEGATIVE,
        "Expected noise that is always there, m/N",
    ),
];

/// The top of a robot file.
pub const ROBOT_FILE: [Key; 5] = [
    may("name", Holds::Text, "Name of the robot"),
    may(
        "guesses",
        Holds::Texts,
        "What in this file is nobody's measurement, a sentence each",
    ),
    must("joint", Holds::Sections(&JOINT), "A revolute joint, base first"),
    must(
        "link",
        Holds::Sections(&LINK),
        "The body that a joint carries: as many as joints",
    ),
    may("tool", Holds::Section(&TOOL_FRAME), "The tool centre point"),
];

pub(crate) const JOINT: [Key; 10] = [
    may("name", Holds::Text, "Name of the joint"),
    may(
        "d_m",
        ANY,
        "Denavit-Hartenberg (standard, distal): offset along z, m",
    ),
    may("a_m", ANY, "Length along x, m"),
    may("alpha_deg", ANY, "Twist about x, degrees"),
    may("offset_deg", ANY, "Added to the joint's angle, degrees [0]"),
    may(
        "origin_m",
        Holds::Array(3),
        "Instead of d, a and alpha: where the joint stands in the frame before it, m",
    ),
    may(
        "origin_rpy_deg",
        Holds::Array(3),
        "How its frame is turned there: roll, pitch, yaw, degrees [0, 0, 0]",
    ),
    may(
        "axis",
        Holds::Array(3),
        "What it turns about, in its own frame [0, 0, 1]",
    ),
    must(
        "compliance_rad_per_nm",
        Holds::Number(Bounds::closed(1e-30, 1e30)),
        "Of the drive, rad/(N·m)",
    ),
    may(
        "limits_deg",
        Holds::Array(2),
        "Lower and upper limit of the angle, degrees",
    ),
];

pub(crate) const LINK: [Key; 16] = [
    may("name", Holds::Text, "Name of the link"),
    must("mass_kg", NOT_NEGATIVE, "Mass, kg"),
    must(
        "inertia_kg_m2",
        Holds::Array(3),
        "Moments Ixx, Iyy, Izz about the centre of mass, axes along the link's frame, kg m²",
    ),
    may(
        "products_kg_m2",
        Holds::Array(3),
        "Elements Ixy, Ixz, Iyz of the same tensor, kg m² [0, 0, 0]",
    ),
    may(
        "com_m",
        Holds::Array(3),
        "Centre of mass in the link's frame, m [midway between its joints]",
    ),
    may(
        "section_outer_diameter_m",
        POSITIVE,
        "Outer diameter of the tube that bends like the link, m; without any section: rigid",
    ),
    may(
        "section_width_m",
        POSITIVE,
        "Or of a rectangular tube: outer width, across the link and its height, m",
    ),
    may(
        "section_height_m",
        POSITIVE,
        "Outer height of the rectangular tube, along section_height_axis, m",
    ),
    may("section_wall_m", POSITIVE, "Wall of either tube, m"),
    may(
        "section_area_m2",
        POSITIVE,
        "Or of any other section: its area, m²",
    ),
    may(
        "section_second_moment_y_m4",
        POSITIVE,
        "Its second moment of area about the width: bending along section_height_axis, m⁴",
    ),
    may(
        "section_second_moment_z_m4",
        POSITIVE,
        "Its second moment of area about the height: bending across section_height_axis, m⁴",
    ),
    may(
        "section_torsion_constant_m4",
        POSITIVE,
        "Its torsion constant J, m⁴",
    ),
    may(
        "section_height_axis",
        Holds::Array(3),
        "Direction of the height in the link's frame, of a section that is not round",
    ),
    may(
        "young_pa",
        POSITIVE,
        "Young's modulus of this link, Pa [the one that all links have in common]",
    ),
    may(
        "shear_pa",
        POSITIVE,
        "Shear modulus of a link with its own young_pa, Pa [young_pa / 2.6]",
    ),
];

pub(crate) const TOOL_FRAME: [Key; 3] = [
    may(
        "tcp_in_flange_m",
        Holds::Array(3),
        "Tool centre point in the flange's frame, m [0, 0, 0]",
    ),
    may(
        "tilt_about_flange_y_deg",
        ANY,
        "Tool axis from the flange's z towards its x, degrees [0]",
    ),
    may(
        "rpy_in_flange_deg",
        Holds::Array(3),
        "Or the tool's frame in that of the flange: roll, pitch, yaw, degrees",
    ),
];
