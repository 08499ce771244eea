//! Sampled signals of several channels.

use serde::Serialize;

/// How a sample is held.
pub trait Sample: Copy + PartialEq + Send + Sync + 'static {
    /// The sample as this type can hold it.
    fn of(value: f64) -> Self;
    /// The sample as it is computed with.
    fn value(self) -> f64;
}

impl Sample for f64 {
    #[inline(always)]
    fn of(value: f64) -> f64 {
        value
    }

    #[inline(always)]
    fn value(self) -> f64 {
        self
    }
}

/// Half the memory, for long records: seven digits are more than converters and exports have.
impl Sample for f32 {
    #[inline(always)]
    fn of(value: f64) -> f32 {
        value as f32
    }

    #[inline(always)]
    fn value(self) -> f64 {
        f64::from(self)
    }
}

/// One recorded channel of a time record.
#[derive(Debug, Clone)]
pub struct Channel<S = f64> {
    /// Name as in the file.
    pub name: String,
    /// Unit as in the file.
    pub file_unit: String,
    /// What it records, as far as the analyses of cuts go.
    pub role: ChannelRole,
    /// Samples in SI (N, N·m, m/s², m, …; volts and unknown units as they stand).
    pub samples: Vec<S>,
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
pub struct TimeRecord<S = f64> {
    /// Samples per second.
    pub sample_rate_hz: f64,
    /// Time of the first sample, s.
    pub start_s: f64,
    /// In the order of the file, all of one length.
    pub channels: Vec<Channel<S>>,
    /// Samples that the recorder dropped: stretches filled by a straight line, so that the times behind them are right.
    pub filled: Vec<std::ops::Range<usize>>,
}

impl<S: Sample> TimeRecord<S> {
    /// Are these two recordings of the same channels?
    pub fn same_channels(&self, other: &TimeRecord<S>) -> bool {
        let rate = (self.sample_rate_hz / other.sample_rate_hz - 1.0).abs() < 1e-6;
        let mut channels = self.channels.iter().zip(&other.channels);
        rate && self.channels.len() == other.channels.len()
            && channels.all(|(a, b)| a.name == b.name && a.file_unit == b.file_unit)
    }

    /// Puts the samples of a recording of the same channels behind its own.
    pub fn append(&mut self, next: &TimeRecord<S>) {
        let before = self.channels.first().map_or(0, |c| c.samples.len());
        for (channel, more) in self.channels.iter_mut().zip(&next.channels) {
            channel.samples.extend_from_slice(&more.samples);
        }
        let filled = next.filled.iter().map(|r| r.start + before..r.end + before);
        self.filled.extend(filled);
    }

    /// Leaves out what is neither force nor torque (accelerations and the like that were recorded with them), unless all is.
    pub fn keep_forces(&mut self) {
        if self.channels.iter().any(|c| c.role != ChannelRole::Other) {
            self.channels.retain(|c| c.role != ChannelRole::Other);
        }
    }

    /// The first channel with this role; `None` where there is none.
    pub fn channel(&self, role: ChannelRole) -> Option<&Channel<S>> {
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
