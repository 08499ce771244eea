//! Sampled signals of several channels.

use serde::Serialize;

/// One recorded channel of a time record.
#[derive(Debug, Clone)]
pub struct Channel {
    /// Name as in the file.
    pub name: String,
    /// Unit as in the file.
    pub file_unit: String,
    /// What it records, as far as the analyses of cuts go.
    pub role: ChannelRole,
    /// Samples in SI (N, N·m, m/s², m, …; volts and unknown units as they stand).
    pub samples: Vec<f64>,
}

/// What a channel records, decided from its name and unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum ChannelRole {
    /// Force along x of the dynamometer, N.
    ForceX,
    /// Force along y of the dynamometer, N.
    ForceY,
    /// Force along z of the dynamometer, N.
    ForceZ,
    /// Moment about the spindle axis, N·m.
    TorqueZ,
    /// Anything else, such as an acceleration or a part of a force.
    Other,
}

/// A uniformly sampled record of one or more channels.
#[derive(Debug, Clone)]
pub struct TimeRecord {
    /// Samples per second.
    pub sample_rate_hz: f64,
    /// Time of the first sample, s.
    pub start_s: f64,
    /// In the order of the file, all of one length.
    pub channels: Vec<Channel>,
    /// Samples that the recorder dropped: stretches filled by a straight line, so that the times behind them are right.
    pub filled: Vec<std::ops::Range<usize>>,
}

impl TimeRecord {
    /// Are these two recordings of the same channels?
    pub fn same_channels(&self, other: &TimeRecord) -> bool {
        let rate = (self.sample_rate_hz / other.sample_rate_hz - 1.0).abs() < 1e-6;
        let mut channels = self.channels.iter().zip(&other.channels);
        rate && self.channels.len() == other.channels.len()
            && channels.all(|(a, b)| a.name == b.name && a.file_unit == b.file_unit)
    }

    /// Puts the samples of a recording of the same channels behind its own.
    pub fn append(&mut self, next: &TimeRecord) {
        let before = self.channels.first().map_or(0, |c| c.samples.len());
        for (channel, more) in self.channels.iter_mut().zip(&next.channels) {
            channel.samples.extend_from_slice(&more.samples);
        }
        let filled = next.filled.iter().map(|r| r.start + before..r.end + before);
        self.filled.extend(filled);
    }

    /// The first channel with this role; `None` where there is none.
    pub fn channel(&self, role: ChannelRole) -> Option<&Channel> {
        self.channels.iter().find(|c| c.role == role)
    }

    /// Number of samples per channel.
    pub fn len(&self) -> usize {
        self.channels.first().map_or(0, |c| c.samples.len())
    }

    /// Are there no samples?
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}
