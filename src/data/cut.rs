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

    /// The same side of the cutter at `factor` times the width of cut, as far as the cutter is wide. `None` where the work does not
    /// reach to the edge on one side, or does on both: which side moves is not known then.
    pub fn wider(self, factor: f64) -> Option<Immersion> {
        const AT_EDGE_RAD: f64 = 1e-6;
        let at_start = self.start_rad.abs() < AT_EDGE_RAD;
        let at_exit = (self.exit_rad - std::f64::consts::PI).abs() < AT_EDGE_RAD;
        if at_start == at_exit {
            return None;
        }
        // A width of D (1 − cos φ) / 2.
        let width = 1.0 - (self.exit_rad - self.start_rad).cos();
        let arc_rad = (1.0 - (width * factor).clamp(0.0, 2.0)).acos();
        Some(match at_start {
            true => Immersion {
                exit_rad: arc_rad,
                ..self
            },
            false => Immersion {
                start_rad: std::f64::consts::PI - arc_rad,
                ..self
            },
        })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_width_of_cut_grows_on_the_side_that_is_not_the_cutters_edge() {
        let degrees = |i: Immersion| [i.start_rad, i.exit_rad].map(|a| a.to_degrees().round());
        let of = |start: f64, exit: f64| Immersion {
            start_rad: start.to_radians(),
            exit_rad: exit.to_radians(),
        };
        // Half the diameter; a quarter of it is 60° of arc, all of it 180°, and no cut is wider.
        for (factor, arc) in [(0.5, 60.0), (1.0, 90.0), (2.0, 180.0), (3.0, 180.0)] {
            assert_eq!(degrees(of(0.0, 90.0).wider(factor).unwrap()), [0.0, arc]);
            assert_eq!(
                degrees(of(90.0, 180.0).wider(factor).unwrap()),
                [180.0 - arc, 180.0]
            );
        }
        assert_eq!(of(0.0, 180.0).wider(0.5), None);
        assert_eq!(of(30.0, 150.0).wider(0.5), None);
    }
}
