//! The lobes of one structure, as an analysis of a campaign has them.

use crate::lobes::band::LobeBand;
use crate::lobes::drilling::hole::HoleError;
use crate::lobes::drilling::whirling::WhirlSpeed;
use crate::lobes::dynamics::feed_stiffness::FeedStiffness;
use crate::lobes::outcome::LimitRange;
use crate::lobes::{AbsoluteLimit, BlockLobes, LobeCurve, Peak};

/// Best speeds that are listed.
pub const BEST: usize = 10;
/// Lobes of one structure.
#[derive(Debug, Clone)]
pub struct LobeCase {
    /// `None` where the FRF belongs to no posture (modes from the campaign file).
    pub posture: Option<String>,
    /// Redundancy angle, °; `None` where the posture stands as it is.
    pub angle_deg: Option<f64>,
    /// For people: where the FRF comes from.
    pub description: String,
    /// Where chatter was sought, Hz.
    pub band_hz: (f64, f64),
    /// Depth limit over spindle speed.
    pub curve: LobeCurve,
    /// The limit that holds at every speed; `None` where no depth chatters.
    pub absolute: Option<AbsoluteLimit>,
    /// Drilling with both blocks: the limits of the lateral and of the axial–torsional one alone.
    pub by_block: Option<[BlockLobes; 2]>,
    /// The deepest places between the lobes, deepest first.
    pub best: Vec<Peak>,
    /// From the uncertainty of the calibrated parameters; averaged forces only.
    pub band: Option<LobeBand>,
    /// Without the effects that were added to the model; `None` where there are none.
    pub before: Option<LobesBefore>,
    /// Where the static forces of the cut put the tool; from the model only.
    pub hole: Option<HoleError>,
    /// How stiff the tool point is along the feed; from the model only.
    pub feed_stiffness: Option<FeedStiffness>,
    /// Drilling: speeds at which the drill may whirl; of a posture as it stands.
    pub whirling: Vec<WhirlSpeed>,
    /// At the speed of every cut with a noted outcome.
    pub(crate) at_cuts: Vec<LimitRange>,
}

impl LobeCase {
    /// For people: ` at p1`, empty where the FRFs belong to no posture.
    pub fn at_posture(&self) -> String {
        self.posture
            .as_ref()
            .map(|p| format!(" at {p}"))
            .unwrap_or_default()
    }
}

/// Lobes of the baseline (revision 0), fitted to the same data as the model with its effects.
#[derive(Debug, Clone)]
pub struct LobesBefore {
    /// Depth limit over spindle speed.
    pub curve: LobeCurve,
    /// The limit that holds at every speed; `None` where no depth chatters.
    pub absolute: Option<AbsoluteLimit>,
}
