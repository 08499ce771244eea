//! Reads lab files into SI records. Nothing outside this module knows a file format.

use num_complex::Complex64;
use serde::Serialize;

/// What an FRF's response is: displacement, velocity or acceleration per newton.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Quantity {
    /// Displacement per force, m/N.
    Receptance,
    /// Velocity per force, (m/s)/N.
    Mobility,
    /// Acceleration per force, (m/s²)/N. (`acceleration` in campaign files.)
    #[serde(rename = "acceleration", alias = "accelerance")]
    Accelerance,
}

/// One of the three axes of a measurement frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
pub enum Axis {
    X,
    Y,
    Z,
}

impl Axis {
    pub const ALL: [Axis; 3] = [Axis::X, Axis::Y, Axis::Z];

    pub fn index(self) -> usize {
        self as usize
    }

    pub fn letter(self) -> char {
        ['X', 'Y', 'Z'][self.index()]
    }
}

/// A degree of freedom as measurement files name it: node number, axis, and sense along it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
pub struct Dof {
    pub node: i64,
    pub axis: Axis,
    /// True where the file says −X, −Y or −Z.
    pub negative: bool,
}

impl std::fmt::Display for Dof {
    /// `1X`, `12-Z`: the form of the FRF CSV header.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let sign = if self.negative { "-" } else { "" };
        write!(f, "{}{}{}", self.node, sign, self.axis.letter())
    }
}

/// One frequency response function, in SI per newton, in the quantity of the file.
#[derive(Debug, Clone)]
pub struct FrfRecord {
    /// What the file calls it, e.g. `1X/1X`.
    pub name: String,
    pub response: Option<Dof>,
    pub reference: Option<Dof>,
    /// `None` where the file does not say (the campaign file must).
    pub quantity: Option<Quantity>,
    /// Ascending, Hz.
    pub frequency_hz: Vec<f64>,
    /// Same length as `frequency_hz`; SI units of `quantity`.
    pub value: Vec<Complex64>,
    /// Ordinary coherence 0..1 on the same lines, where the file holds it.
    pub coherence: Option<Vec<f64>>,
}

/// One recorded channel of a time record.
#[derive(Debug, Clone)]
pub struct Channel {
    /// Name as in the file.
    pub name: String,
    /// Unit as in the file.
    pub file_unit: String,
    pub role: ChannelRole,
    /// Samples in SI (N, N·m, m/s², m, …; volts and unknown units as they stand).
    pub samples: Vec<f64>,
}

/// What a channel records, decided from its name and unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum ChannelRole {
    ForceX,
    ForceY,
    ForceZ,
    /// Moment about the spindle axis, N·m.
    TorqueZ,
    Other,
}

/// A uniformly sampled record of one or more channels.
#[derive(Debug, Clone)]
pub struct TimeRecord {
    pub sample_rate_hz: f64,
    /// Time of the first sample, s.
    pub start_s: f64,
    pub channels: Vec<Channel>,
}

impl TimeRecord {
    pub fn channel(&self, role: ChannelRole) -> Option<&Channel> {
        self.channels.iter().find(|c| c.role == role)
    }

    /// Number of samples per channel.
    pub fn len(&self) -> usize {
        self.channels.first().map_or(0, |c| c.samples.len())
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

// STAND-IN, dropped at merge.
mod standin;
pub use standin::read_time;
