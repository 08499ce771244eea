//! The validated content of `campaign.toml`.

use crate::data::{Cut, Dof, LobesSection, OrthogonalSection, Point, Posture, Quantity, RobotSection, Tool};
use std::path::PathBuf;

use crate::ingest::ChannelRule;

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

#[derive(Debug, Clone, PartialEq)]
pub struct Dynamometer {
    /// Rows of A in F_tool = A F_recorded; identity where the campaign does not say.
    pub tool_from_dyno: [[f64; 3]; 3],
}
