//! The validated content of `campaign.toml`.

use std::path::PathBuf;

use super::guesses::Guesses;
use crate::data::{
    Contact, Cut, Dof, LobesSection, OrthogonalSection, Point, Posture, Quantity, RobotSection, Tool,
};
use crate::ingest::ChannelRule;

/// A validated campaign. Paths are absolute or relative to the working directory (already joined with `dir`).
#[derive(Debug, Clone)]
pub struct Campaign {
    /// Folder of the campaign: the one with `campaign.toml` in it.
    pub dir: PathBuf,
    /// Name of the campaign; the folder's where the file gives none.
    pub name: String,
    /// Who measured, as the head of a report names him or her.
    pub operator: Option<String>,
    /// When it was measured, as it was written down.
    pub date: Option<String>,
    /// `None`: no `[robot]`; then there is no model of the structure.
    pub robot: Option<RobotSection>,
    /// Where the robot stood, in the order of the file.
    pub postures: Vec<Posture>,
    /// Of which of them the robot's joints cannot stand so, a sentence each.
    pub beyond_limits: Vec<String>,
    /// Where on the robot was measured, in the order of the file; each has a node number of its own.
    pub points: Vec<Point>,
    /// The `[[frf]]` tables, in the order of the file.
    pub frfs: Vec<FrfFile>,
    /// `None`: no `[tool]`; then there are no cuts.
    pub tool: Option<Tool>,
    /// How the axes of the recorded forces lie to those of the tool.
    pub dynamometer: Dynamometer,
    /// What the channels of the force files are, where the files do not say it.
    pub channels: Vec<CutChannel>,
    /// The `[[cut]]` tables, in the order of the file.
    pub cuts: Vec<Cut>,
    /// What holds the tool point from outside while it cuts (not while it was tapped), in the order of the file.
    pub contacts: Vec<Contact>,
    /// `None`: no lobes are asked for.
    pub lobes: Option<LobesSection>,
    /// Workpiece material: of every cut that names none itself.
    pub material: Option<String>,
    /// What orthogonal cuts of the material gave; `None`: no prediction of coefficients.
    pub orthogonal: Option<OrthogonalSection>,
    /// What is to be measured next; without a `[plan]` the usual.
    pub plan: PlanSection,
    /// What the file itself calls guessed.
    pub guesses: Guesses,
}

/// A channel of the force files of all cuts, or of one.
#[derive(Debug, Clone, PartialEq)]
pub struct CutChannel {
    /// Id of the only cut that it holds for.
    pub cut: Option<String>,
    /// What the channel measures, where it stands in the file, and its gain.
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
    /// Where motion is to be measured; empty: every point in three directions.
    pub responses: Vec<Dof>,
    /// Where the hammer is to hit; empty: the first point on the tool in three directions.
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

/// A `[[frf]]` table: one file with the FRFs of one posture.
#[derive(Debug, Clone, PartialEq)]
pub struct FrfFile {
    /// Path of the file, `dir` included.
    pub file: PathBuf,
    /// Index into `Campaign::postures`.
    pub posture: usize,
    /// What its FRFs are; `None`: as the file says.
    pub quantity: Option<Quantity>,
    /// Level of the hammer or shaker; `None` where nobody says.
    pub force_level_n: Option<f64>,
    /// Line of `campaign.toml`, for messages.
    pub line: usize,
}

/// How the axes of the dynamometer lie to those of the tool.
#[derive(Debug, Clone, PartialEq)]
pub struct Dynamometer {
    /// Rows of A in F_tool = A F_recorded; identity where the campaign does not say.
    pub tool_from_dyno: [[f64; 3]; 3],
}
