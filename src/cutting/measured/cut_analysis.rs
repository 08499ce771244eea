//! What one force record says: averages, the zero of each channel, and what its owner should know.

use crate::cutting::force_model::force_axis::ForceAxis;
use crate::cutting::measured::uneven_teeth::UnevenTeeth;
use crate::cutting::measured::whole_record::WholeRecord;
use crate::data::Process;
use crate::signal::{DriftLine, SpindleTrack, ToothLine};

/// A mean force (N) or torque (N·m) with its standard error.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Average {
    /// Mean force (N) or torque (N·m).
    pub value: f64,
    /// From the scatter between revolutions and the uncertainty of the baseline.
    pub std_error: f64,
}

/// A channel thinned for drawing: extremes in equal stretches of time.
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    /// Middle of each stretch, s on the record's time axis.
    pub time_s: Vec<f64>,
    /// Smallest sample of each stretch, unit of the channel.
    pub min: Vec<f64>,
    /// Largest sample of each stretch, unit of the channel.
    pub max: Vec<f64>,
}

/// One recorded channel, in the dynamometer's own axes.
#[derive(Debug, Clone)]
pub struct ChannelAnalysis {
    /// As the file names it.
    pub name: String,
    /// Which recorded axis it is.
    pub axis: ForceAxis,
    /// The zero of the channel over the record.
    pub drift: DriftLine,
    /// Over the steady window, drift taken off.
    pub mean: TurnAverage,
    /// Not drift compensated.
    pub whole: WholeRecord,
    /// Not drift compensated.
    pub trace: Trace,
}

/// Something about a record that its owner should know. Notices of one kind become one sentence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Notice {
    /// What it is and what to do, the same for every cut.
    pub kind: &'static str,
    /// What is particular to this cut; may be empty.
    pub detail: String,
}

/// What one record says.
#[derive(Debug, Clone)]
pub struct CutAnalysis {
    /// Index into `Campaign::cuts`.
    pub cut: usize,
    /// The cut's id.
    pub id: String,
    /// How it was cut.
    pub process: Process,
    /// As stated, not as found.
    pub spindle_rpm: f64,
    /// At the diameter of the tool, in turning that of the workpiece.
    pub cutting_speed_m_per_min: f64,
    /// Per tooth (milling), per revolution (drilling, turning).
    pub feed_mm: f64,
    /// Start and end of the record, s.
    pub record_s: [f64; 2],
    /// Start and end of the air before the cut, s; `None` where there is none.
    pub air_before_s: Option<[f64; 2]>,
    /// Start and end of the air after the cut, s; `None` where there is none.
    pub air_after_s: Option<[f64; 2]>,
    /// Start and end of the steady window, s.
    pub steady_s: [f64; 2],
    /// The campaign said where; else detected.
    pub steady_given: bool,
    /// Revolutions in the steady window.
    pub revolutions: f64,
    /// The usable channels, ordered by axis.
    pub channels: Vec<ChannelAnalysis>,
    /// Part of each turn in which the edge cuts: less than 1 where it turns an interrupted surface. Means are those of that part.
    pub contact_share: f64,
    /// Tool axes x, y, z and torque; `None` where a channel it needs is missing or dead.
    pub averages: [Option<Average>; 4],
    /// Milling: the tooth-passing line in all force channels together; `None` where the window is too short for one.
    pub tooth_line: Option<ToothLine>,
    /// Milling: how many times as often as stated the teeth pass, where the record says otherwise than campaign.toml.
    pub passes_times: Option<f64>,
    /// Milling: that the teeth, which are not listed one by one, cut unequally, where that stands above the noise.
    pub uneven_teeth: Option<UnevenTeeth>,
    /// How the spindle ran, where it did not keep the stated speed.
    pub spindle: Option<SpindleTrack>,
    /// What its owner should know.
    pub notices: Vec<Notice>,
}

impl CutAnalysis {
    /// Whether two cuts in one record are the same samples. A record may hold several: one after the other (`steady_s`), or each in
    /// channels of its own.
    pub fn is_same_stretch(&self, other: &CutAnalysis) -> bool {
        let both = self.steady_s[1].min(other.steady_s[1]) - self.steady_s[0].max(other.steady_s[0]);
        let shorter = (self.steady_s[1] - self.steady_s[0]).min(other.steady_s[1] - other.steady_s[0]);
        let names =
            |cut: &CutAnalysis| -> Vec<String> { cut.channels.iter().map(|c| c.name.clone()).collect() };
        both > 0.5 * shorter && names(self) == names(other)
    }
}

/// The mean of one channel over a window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TurnAverage {
    /// The mean and its standard error, N or N·m.
    pub average: Average,
    /// Revolutions averaged.
    pub turns: usize,
    /// Standard deviation between the means of revolutions; `None` with one revolution only.
    pub turn_std: Option<f64>,
    /// Part of the standard error that the baseline brings.
    pub zero_std: f64,
    /// Revolutions left out as spikes.
    pub dropped: usize,
}

/// Notice of a record whose tooth-passing line is not where speed and teeth put it.
pub(crate) const WRONG_SPEED: &str = "coefficients rest on a wrong spindle speed or number of teeth: correct spindle_rpm \
     (and the feed per tooth that goes with it) or [tool] teeth";

/// Notice of a record whose lines fit a multiple or a fraction of the stated speed only.
pub(crate) const OTHER_MULTIPLE: &str = "the forces repeat as they would at a multiple or a fraction of the stated speed, and the \
     coefficients rest on it: check spindle_rpm (and the feed per tooth that goes with it), [tool] teeth and the sampling rate (rate_hz \
     or the file's times); where they are right, a resonance of the dynamometer lies on that line";
/// Notice of a record that is noise at the orders of the turn.
pub(crate) const NOTHING_REPEATS: &str = "nothing in these records repeats with the stated speed: the sampling rate, spindle_rpm or the \
     columns are not what campaign.toml says (rate_hz, spindle_rpm, [[channel]] column), or the tool did not cut; coefficients from \
     them mean nothing";

/// Does the record contradict the stated speed, or show nothing that repeats with it? Then nothing that its waveform says about
/// channels, axes or physics can be believed.
pub(crate) fn contradicts_speed(notice: &Notice) -> bool {
    [WRONG_SPEED, OTHER_MULTIPLE, NOTHING_REPEATS].contains(&notice.kind)
}

/// F_tool = A F_recorded, standard errors added in squares; torque is taken as recorded.
pub(crate) fn in_tool_axes(
    tool_from_dyno: &[[f64; 3]; 3],
    channels: &[ChannelAnalysis],
) -> [Option<Average>; 4] {
    let recorded = |axis: ForceAxis| channels.iter().find(|c| c.axis == axis).map(|c| c.mean.average);
    let mut averages = [None; 4];
    for (average, row) in averages.iter_mut().zip(tool_from_dyno) {
        let largest = row.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let mut sum = Some((0.0, 0.0));
        for (&a, axis) in row.iter().zip(ForceAxis::ALL) {
            if a.abs() > 1e-9 * largest {
                sum = sum.zip(recorded(axis)).map(|((value, variance), r)| {
                    (value + a * r.value, variance + (a * r.std_error).powi(2))
                });
            }
        }
        *average = sum.map(|(value, variance): (f64, f64)| Average {
            value,
            std_error: variance.sqrt(),
        });
    }
    averages[ForceAxis::Mz.index()] = recorded(ForceAxis::Mz);
    averages
}

/// A channel of ten turns for tests: nothing but its average, above a zero of 0.
#[cfg(test)]
pub(super) fn made_channel(axis: ForceAxis, average: Average) -> ChannelAnalysis {
    use crate::signal::{Air, fit_drift};
    ChannelAnalysis {
        name: String::new(),
        axis,
        drift: fit_drift::<f64>(&[], 100.0, 0.0, &Air::default()),
        mean: TurnAverage {
            average,
            turns: 10,
            turn_std: Some(1.0),
            zero_std: 0.0,
            dropped: 0,
        },
        whole: WholeRecord {
            mean: average.value,
            std: average.value.abs(),
            air_std: None,
            is_rectified: false,
        },
        trace: Trace {
            time_s: Vec::new(),
            min: Vec::new(),
            max: Vec::new(),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn channel(axis: ForceAxis, value: f64, std_error: f64) -> ChannelAnalysis {
        made_channel(axis, Average { value, std_error })
    }

    /// A dynamometer turned by 30° about z: 100 N along its x and 50 N along its y, each known to 3 N and 4 N.
    #[test]
    fn forces_turn_as_vectors_and_their_errors_add_in_squares() {
        let (s, c) = (0.5, 0.75f64.sqrt());
        let turned = [[c, -s, 0.0], [s, c, 0.0], [0.0, 1e-12, 1.0]];
        let mut channels = vec![
            channel(ForceAxis::X, 100.0, 3.0),
            channel(ForceAxis::Y, 50.0, 4.0),
            channel(ForceAxis::Mz, 7.0, 0.1),
        ];
        let [x, y, z, torque] = in_tool_axes(&turned, &channels);
        assert_relative_eq!(x.unwrap().value, 100.0 * c - 50.0 * s, max_relative = 1e-12);
        assert_relative_eq!(y.unwrap().value, 100.0 * s + 50.0 * c, max_relative = 1e-12);
        assert_relative_eq!(
            x.unwrap().std_error,
            (9.0 * 0.75 + 16.0 * 0.25f64).sqrt(),
            max_relative = 1e-12
        );
        assert_eq!((z, torque.map(|t| t.value)), (None, Some(7.0)));
        // Without y there is no x of the tool; rounding of the matrix needs no channel.
        channels.remove(1);
        channels.push(channel(ForceAxis::Z, 20.0, 1.0));
        let [x, y, z, _] = in_tool_axes(&turned, &channels);
        assert_eq!((x, y, z.map(|z| z.value)), (None, None, Some(20.0)));
    }
}
