//! What an effect on the structure is to the loop: its place, its parameters, and what it does to the model.

use std::fmt;

use super::{Background, Size, Spot};
use crate::data::RobotSpec;
use crate::effects::usual_size::UsualSize;
use crate::parameter::Parameter;
use crate::robot::{Chain, Dual, Kinematics, RobotModel};

/// Where an effect sits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Site {
    /// The effect has no place of its own.
    Everywhere,
    /// 1-based joint.
    Joint(usize),
    /// 1-based link.
    Link(usize),
    /// A place where the data drew something.
    At(Spot),
}

impl Site {
    /// `joint-2`, `link-4`; `None` where the effect has no place of its own.
    pub fn label(self) -> Option<String> {
        match self {
            Site::Everywhere => None,
            Site::Joint(i) => Some(format!("joint-{i}")),
            Site::Link(i) => Some(format!("link-{i}")),
            Site::At(spot) => Some(spot.label()),
        }
    }
}

/// What the model is set up for when an effect changes it.
pub struct Setting<'a> {
    /// The robot without effects.
    pub robot: &'a RobotModel,
    /// Where its frames are.
    pub kinematics: &'a Kinematics,
    /// 0 at the highest hammer level of the campaign, 1 at the lowest, logarithmic between; 0 where there is one level.
    pub lowness: f64,
}

/// Share of an effect's usual size (a mass, a compliance) that no measurement can show.
pub(super) const NEGLIGIBLE: f64 = 1e-10;

/// What happens to the response channels between the structure and the file.
#[derive(Debug, Clone)]
pub struct ChannelFilter {
    /// Rows of the matrix that turns true displacements (x, y, z of the point's axes) into measured ones.
    pub mixing: [[Dual; 3]; 3],
    /// The response is this late against the force, s.
    pub delay_s: Dual,
}

impl ChannelFilter {
    /// Channels that show what is there.
    pub fn faithful() -> Self {
        let unit = |i: usize, j: usize| Dual::constant(if i == j { 1.0 } else { 0.0 });
        ChannelFilter {
            mixing: [0, 1, 2].map(|i| [0, 1, 2].map(|j| unit(i, j))),
            delay_s: Dual::constant(0.0),
        }
    }
}

/// What is known of a campaign when an effect is asked whether it can be told from this data.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DataSummary {
    /// Different hammer levels.
    pub force_levels: usize,
    /// Postures with FRFs.
    pub postures: usize,
    /// Lowest measured frequency, Hz.
    pub lowest_hz: f64,
    /// Highest measured frequency, Hz.
    pub highest_hz: f64,
}

/// One physical effect on the structure or its measurement.
pub trait StructuralEffect: Sync {
    /// As in docs/effects.md: `joint-transverse-compliance`.
    fn id(&self) -> &'static str;

    /// The physics in plain words, one or two sentences.
    fn explanation(&self) -> &'static str;

    /// How it shows in FRFs, one sentence.
    fn fingerprint(&self) -> &'static str;

    /// How to check it in the lab, usual sizes, sources.
    fn background(&self) -> Background;

    /// Where it may sit on this robot.
    fn sites(&self, robot: &RobotSpec) -> Vec<Site>;

    /// Discrete choices at one site (an axis of the link, say).
    fn variants(&self) -> usize {
        1
    }

    /// Name of a discrete choice as (key, value) for the JSON; `None` where there is no choice.
    fn variant_label(&self, _variant: usize) -> Option<(&'static str, &'static str)> {
        None
    }

    /// Why this robot or this data cannot show the effect; `None` if it can.
    fn obstacle(&self, _robot: &RobotSpec, _data: &DataSummary) -> Option<String> {
        None
    }

    /// Tunable quantities; names are the keys in docs/json.md. `nominal` is the first starting value.
    fn parameters(&self, robot: &RobotSpec, data: &DataSummary) -> Vec<Parameter>;

    /// Further starting points, natural values in the order of the parameters. `peaks_hz`: where the residual peaks.
    fn starts(&self, robot: &RobotSpec, data: &DataSummary, peaks_hz: &[f64]) -> Vec<Vec<f64>>;

    /// As [`Self::parameters`], where they depend on the site or the discrete choice.
    fn parameters_at(
        &self,
        _site: Site,
        _variant: usize,
        robot: &RobotSpec,
        data: &DataSummary,
    ) -> Vec<Parameter> {
        self.parameters(robot, data)
    }

    /// As [`Self::starts`], where they depend on the site or the discrete choice.
    fn starts_at(
        &self,
        _at: (Site, usize),
        robot: &RobotSpec,
        data: &DataSummary,
        peaks_hz: &[f64],
    ) -> Vec<Vec<f64>> {
        self.starts(robot, data, peaks_hz)
    }

    /// How large it is where it is hidden in a simulated campaign: a line a parameter (lists once).
    fn usual_sizes(&self) -> &'static [UsualSize] {
        &[]
    }

    /// Why this effect cannot be of the size that was fitted (parameters in their order); `None` if it can.
    fn impossible(&self, _site: Site, _robot: &RobotSpec, _sizes: &[Size]) -> Option<String> {
        None
    }

    /// Values of [`Self::parameters`] (given), natural units, at which the effect is not there: the model is the one without
    /// it, to rounding. They may lie outside the parameters' bounds, which are those of an effect worth a name. `None` only
    /// for what is simulated and never fitted.
    fn vanishing(&self, _parameters: &[Parameter]) -> Option<Vec<f64>> {
        None
    }

    /// Effects with lower order are applied first (a payload weighs on the joints before their load is counted).
    fn order(&self) -> u8 {
        1
    }

    /// Changes the chain.
    fn apply(&self, _site: Site, _variant: usize, _values: &[Dual], _setting: &Setting, _chain: &mut Chain) {}

    /// Changes the channels.
    fn filter(&self, _values: &[Dual], _filter: &mut ChannelFilter) {}
}

/// An effect at a site: what is added to a model.
#[derive(Clone, Copy)]
pub struct Instance {
    /// The effect.
    pub effect: &'static dyn StructuralEffect,
    /// Where it sits.
    pub site: Site,
    /// Its discrete choice, from 0.
    pub variant: usize,
}

impl Instance {
    /// `effect@site`, or the bare id; the discrete choice is not part of it.
    pub fn label(&self) -> String {
        match self.site.label() {
            Some(site) => format!("{}@{site}", self.effect.id()),
            None => self.effect.id().to_string(),
        }
    }

    /// For people: the label, and the discrete choice where there is one.
    pub fn title(&self) -> String {
        match self.effect.variant_label(self.variant) {
            Some((key, value)) => format!("{} ({key} {value})", self.label()),
            None => self.label(),
        }
    }
}

impl fmt::Debug for Instance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}#{}", self.label(), self.variant)
    }
}

impl PartialEq for Instance {
    fn eq(&self, other: &Self) -> bool {
        self.effect.id() == other.effect.id() && self.site == other.site && self.variant == other.variant
    }
}
