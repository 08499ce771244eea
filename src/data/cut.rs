//! What was cut.

use std::path::PathBuf;

/// What kind of machining a cut is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Process {
    /// Milling with an end mill.
    Milling,
    /// Drilling with a twist drill, into the full or a pilot hole.
    Drilling,
    /// Turning with a tool of one edge.
    Turning,
}

impl Process {
    /// All three, milling first.
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
    /// Where a tooth enters the workpiece.
    pub start_rad: f64,
    /// Where a tooth leaves the workpiece.
    pub exit_rad: f64,
}

impl Immersion {
    /// The full width of the cutter, 0 to π.
    pub const SLOT: Immersion = Immersion {
        start_rad: 0.0,
        exit_rad: std::f64::consts::PI,
    };

    /// The same part of the cutter on the other side of the feed: down milling for up milling.
    pub fn mirrored(self) -> Immersion {
        Immersion {
            start_rad: std::f64::consts::PI - self.exit_rad,
            exit_rad: std::f64::consts::PI - self.start_rad,
        }
    }
}

/// What was cut: geometry and feed of one record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CutGeometry {
    /// A milled cut; the feed is along +x.
    Milling {
        /// Feed per tooth.
        feed_per_tooth_mm: f64,
        /// Axial depth of cut ap, along the tool axis.
        axial_depth_mm: f64,
        /// Angles at which a tooth is in the workpiece.
        immersion: Immersion,
    },
    /// A hole drilled along the tool axis.
    Drilling {
        /// Feed per revolution of the drill.
        feed_per_rev_mm: f64,
        /// Zero: drilled into the full.
        pilot_diameter_mm: f64,
        /// Depth at full diameter.
        hole_depth_mm: Option<f64>,
    },
    /// A cut on a turning workpiece.
    Turning {
        /// Feed per revolution of the workpiece.
        feed_per_rev_mm: f64,
        /// ap, across the feed.
        depth_of_cut_mm: f64,
        /// Of the workpiece where it is cut: with the spindle speed it gives the cutting speed.
        diameter_mm: f64,
    },
}

impl CutGeometry {
    /// The process that this geometry belongs to.
    pub fn process(&self) -> Process {
        match self {
            CutGeometry::Milling { .. } => Process::Milling,
            CutGeometry::Drilling { .. } => Process::Drilling,
            CutGeometry::Turning { .. } => Process::Turning,
        }
    }
}

/// How a cut went, as somebody heard or saw it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum CutOutcome {
    /// Without chatter.
    Stable,
    /// With chatter: self-excited vibration.
    Chatter,
}

impl CutOutcome {
    /// `stable` or `chatter`.
    pub fn label(self) -> &'static str {
        match self {
            CutOutcome::Stable => "stable",
            CutOutcome::Chatter => "chatter",
        }
    }
}

/// One cut and its force record.
#[derive(Debug, Clone, PartialEq)]
pub struct Cut {
    /// Name of the cut, unlike any other's.
    pub id: String,
    /// Where its force record is; messages name it.
    pub file: PathBuf,
    /// As stated.
    pub spindle_rpm: f64,
    /// Process, feed and depth.
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
