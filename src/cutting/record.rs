//! One record of one cut: drift, phases, averages over whole revolutions, in tool axes.

use std::ops::Range;

use super::average_force::{DrillGeometry, ForceAxis, cutting_speed_m_per_min, feed_mm};
use crate::campaign::{Campaign, Cut, CutGeometry, Process, Tool};
use crate::ingest::units::figures;
use crate::ingest::{ChannelRole, TimeRecord};
use crate::signal::{
    self, Air, Blocks, Clipping, DriftLine, Phases, Spindle, ToothLine, find_faults, find_phases, fit_drift,
    tooth_line, whole_revolutions,
};
use crate::{Error, InputError, Result};

/// A mean force (N) or torque (N·m) with its standard error.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Average {
    pub value: f64,
    /// From the scatter between revolutions and the uncertainty of the zero line.
    pub std_error: f64,
}

/// A channel thinned for drawing: extremes in equal stretches of time.
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    /// Middle of each stretch, s on the record's time axis.
    pub time_s: Vec<f64>,
    pub min: Vec<f64>,
    pub max: Vec<f64>,
}

/// One recorded channel, in the dynamometer's own axes.
#[derive(Debug, Clone)]
pub struct ChannelAnalysis {
    pub name: String,
    /// Which recorded axis it is.
    pub axis: ForceAxis,
    pub drift: DriftLine,
    /// Over the steady window, drift taken off.
    pub average: Average,
    /// Not drift compensated.
    pub trace: Trace,
}

/// Something about a record that its owner should know. Notices of one kind are told together.
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
    pub id: String,
    pub process: Process,
    pub spindle_rpm: f64,
    pub cutting_speed_m_per_min: f64,
    /// Per tooth (milling), per revolution (drilling).
    pub feed_mm: f64,
    /// Start and end of the record, s.
    pub record_s: [f64; 2],
    pub air_before_s: Option<[f64; 2]>,
    pub air_after_s: Option<[f64; 2]>,
    pub steady_s: [f64; 2],
    /// The campaign said where; else detected.
    pub steady_given: bool,
    pub revolutions: f64,
    pub channels: Vec<ChannelAnalysis>,
    /// Tool axes x, y, z and torque; `None` where a channel it needs is missing or dead.
    pub averages: [Option<Average>; 4],
    pub tooth_line: Option<ToothLine>,
    pub notices: Vec<Notice>,
}

/// Points of a [`Trace`].
const TRACE_POINTS: usize = 1000;
/// Revolutions whose mean is further than this many robust standard deviations off are spikes.
const SPIKE_SIGMA: f64 = 8.0;

pub const NO_AIR: &str = "no air cut in the record: drift and offset cannot be told from edge force; \
     record a second of air before and after each cut";
pub const NO_AIR_BEFORE: &str = "no air before the cut: the zero line rests on the air after it alone";
pub const NO_AIR_AFTER: &str = "no air after the cut: the zero line rests on the air before it alone";
const CHANNEL_MISSING: &str = "channel missing or not usable";
const CHANNEL_DEAD: &str = "channel dead (one value throughout) and left out: check plug and amplifier";
const CHANNEL_BROKEN: &str = "channel holds values that are no numbers and is left out";
const BENT_DRIFT: &str = "the drift is not a line (the air bends away from it): averages may be off by more than \
     their errors say; let the amplifier warm up and reset it before each cut (`lobestone diagnose` can fit it as \
     nonlinear-drift)";
const STEEP_DRIFT: &str = "the zero drifts far: the line through the air is taken off; let the amplifier warm up and reset it \
     before each cut";
pub(super) const WRONG_SPEED: &str = "coefficients rest on a wrong spindle speed or number of teeth: correct spindle_rpm \
     (and the feed per tooth that goes with it) or [tool] teeth";
const CLIPPED: &str = "clipped, so that the true forces are larger: the channel is left out of this cut; choose a larger range \
     at the amplifier and cut again";
const CLIPPED_ELSEWHERE: &str = "clipped outside the steady window: averages are not touched, but choose a larger range at the \
     amplifier";
const SHORT_WINDOW: &str = "steady window shorter than 5 revolutions";
const SPIKES: &str = "revolutions with spikes left out of the average";
const WRONG_DURATION: &str = "the hole took another time than feed, speed and depth say: check them";

/// Reads what one record says about one cut.
///
/// # Errors
/// The record is unreadable, too short, holds no usable force channel, or no steady cut is found.
pub fn analyse_cut(campaign: &Campaign, cut_index: usize, record: &TimeRecord) -> Result<CutAnalysis> {
    let cut = &campaign.cuts[cut_index];
    let tool = campaign
        .tool
        .as_ref()
        .ok_or_else(|| Error::computation("[tool] is missing: cutting forces need its teeth and diameter"))?;
    let refuse = |problem: String| Error::from(InputError::new(problem).file(&cut.file));
    let rate = record.sample_rate_hz;
    let samples = record.len();
    let samples_per_revolution = rate * 60.0 / cut.spindle_rpm;
    if samples == 0 {
        return Err(refuse("the record is empty".into()));
    }
    if !(rate.is_finite()
        && rate > 0.0
        && samples_per_revolution.is_finite()
        && samples_per_revolution >= 2.0)
    {
        return Err(refuse(format!(
            "sampled at {rate} Hz, which cannot show a spindle at {} rpm",
            cut.spindle_rpm
        )));
    }

    let mut notices = Vec::new();
    let usable = usable_channels(record, cut.geometry.process(), &mut notices);
    if usable.is_empty() {
        return Err(refuse("no usable force channel (Fx, Fy, Fz or Mz)".into()));
    }
    // A channel that saturates shows neither air nor cut: the others tell where they are, if there are any.
    let clippings: Vec<Option<Clipping>> = usable.iter().map(|c| find_faults(c.2).clipping).collect();
    let (whole, cut_off): (Vec<_>, Vec<_>) = usable
        .into_iter()
        .zip(clippings)
        .partition(|(_, clipping)| clipping.is_none());
    let mut usable: Vec<UsableChannel> = whole.into_iter().map(|(channel, _)| channel).collect();
    let all: Vec<UsableChannel> = usable
        .iter()
        .copied()
        .chain(cut_off.iter().map(|(c, _)| *c))
        .collect();
    let telling = if usable.is_empty() { &all } else { &usable };
    let (phases, steady_given) = phases(cut, tool, record, telling, samples_per_revolution)?;
    let steady = phases.steady.clone();
    for (channel, clipping) in cut_off {
        let clipping = clipping.unwrap_or_default();
        if !is_spoilt(&channel, &clipping, &steady, record, &mut notices) {
            usable.push(channel);
        }
    }
    usable.sort_by_key(|channel| channel.0);
    if usable.is_empty() {
        return Err(refuse("every force channel is clipped".into()));
    }
    let revolutions = steady.len() as f64 / samples_per_revolution;
    let seconds = |r: &Range<usize>| {
        let at = |i: usize| record.start_s + i as f64 / rate;
        [at(r.start), at(r.end)]
    };

    let channels: Vec<ChannelAnalysis> = usable
        .iter()
        .map(|&(axis, name, values)| {
            let drift = fit_drift(values, rate, record.start_s, &phases.air);
            let (average, dropped) = average(values, &steady, samples_per_revolution, &drift, record);
            if dropped > 0 {
                notices.push(Notice {
                    kind: SPIKES,
                    detail: format!("{dropped} on {}", axis.label()),
                });
            }
            ChannelAnalysis {
                name: name.to_string(),
                axis,
                drift,
                average,
                trace: trace(values, record),
            }
        })
        .collect();
    let carrying = ForceAxis::of(cut.geometry.process());
    let carriers: Vec<&ChannelAnalysis> = channels.iter().filter(|c| carrying.contains(&c.axis)).collect();
    air_notices(&phases.air, &carriers, samples as f64 / rate, &mut notices);
    if revolutions < 4.999 {
        notices.push(Notice {
            kind: SHORT_WINDOW,
            detail: format!("{revolutions:.1}"),
        });
    }
    let tooth_line = match cut.geometry {
        CutGeometry::Milling { .. } => usable
            .iter()
            .filter_map(|&(_, _, v)| tooth_line(&v[steady.clone()], rate, cut.spindle_rpm / 60.0, tool.teeth))
            .max_by(|a, b| a.strongest_to_noise.total_cmp(&b.strongest_to_noise)),
        CutGeometry::Drilling { .. } => {
            duration_notice(cut, tool, &phases, rate, &mut notices);
            None
        }
    };
    if let Some(line) = tooth_line.filter(ToothLine::speed_is_doubtful) {
        notices.push(Notice {
            kind: WRONG_SPEED,
            detail: wrong_speed(&line, cut.spindle_rpm, tool.teeth.max(1)),
        });
    }
    Ok(CutAnalysis {
        cut: cut_index,
        id: cut.id.clone(),
        process: cut.geometry.process(),
        spindle_rpm: cut.spindle_rpm,
        cutting_speed_m_per_min: cutting_speed_m_per_min(tool.diameter_mm, cut.spindle_rpm),
        feed_mm: feed_mm(&cut.geometry),
        record_s: seconds(&(0..samples)),
        air_before_s: phases.air.before.as_ref().map(seconds),
        air_after_s: phases.air.after.as_ref().map(seconds),
        steady_s: seconds(&steady),
        steady_given,
        revolutions,
        averages: in_tool_axes(&campaign.dynamometer.tool_from_dyno, &channels),
        channels,
        tooth_line,
        notices,
    })
}

/// Part of the steady window that may be clipped without much harm.
const CLIPPED_AT_MOST: f64 = 1e-3;
/// Change of the zero over the record, as a part of the average force, that is worth telling.
const STEEP: f64 = 0.75;

/// Is so much of the channel clipped in the steady window that its average is wrong?
fn is_spoilt(
    channel: &UsableChannel,
    clipping: &Clipping,
    steady: &Range<usize>,
    record: &TimeRecord,
    notices: &mut Vec<Notice>,
) -> bool {
    let axis = channel.0;
    let all: usize = clipping.plateaus.iter().map(Range::len).sum();
    let inside = clipping.samples_in(steady);
    let share = inside as f64 / steady.len().max(1) as f64;
    let first = clipping.plateaus.first().map_or(0, |p| p.start);
    let spoilt = share > CLIPPED_AT_MOST;
    notices.push(Notice {
        kind: if spoilt { CLIPPED } else { CLIPPED_ELSEWHERE },
        detail: format!(
            "{}: {all} samples at {} {} from {:.3} s on, {:.1} % of the steady window",
            axis.label(),
            figures(clipping.level, 4),
            axis.unit(),
            record.start_s + first as f64 / record.sample_rate_hz,
            100.0 * share
        ),
    });
    spoilt
}

/// `the tooth-passing line stands at 61.3 Hz, 1200 rpm × 2 teeth would put it at 40.0 Hz: …`
fn wrong_speed(line: &ToothLine, spindle_rpm: f64, teeth: usize) -> String {
    let hz = line.tooth_hz;
    let as_teeth = 60.0 * hz / spindle_rpm;
    let whole = as_teeth.round();
    let other_tool = if whole >= 1.0 && (as_teeth - whole).abs() < 0.01 * whole && whole != teeth as f64 {
        format!(", or the tool has {whole} teeth")
    } else {
        String::new()
    };
    format!(
        "the tooth-passing line stands at {hz:.1} Hz, {spindle_rpm} rpm × {teeth} teeth would put it at {:.1} Hz: the spindle ran at \
         about {:.0} rpm{other_tool}",
        spindle_rpm / 60.0 * teeth as f64,
        60.0 * hz / teeth as f64
    )
}

type UsableChannel<'a> = (ForceAxis, &'a str, &'a [f64]);

fn usable_channels<'a>(
    record: &'a TimeRecord,
    process: Process,
    notices: &mut Vec<Notice>,
) -> Vec<UsableChannel<'a>> {
    let roles = [
        ChannelRole::ForceX,
        ChannelRole::ForceY,
        ChannelRole::ForceZ,
        ChannelRole::TorqueZ,
    ];
    let mut usable = Vec::new();
    for (axis, role) in ForceAxis::ALL.into_iter().zip(roles) {
        let notice = |kind| Notice {
            kind,
            detail: axis.label().to_string(),
        };
        let Some(channel) = record.channel(role) else {
            if ForceAxis::of(process).contains(&axis) {
                notices.push(notice(CHANNEL_MISSING));
            }
            continue;
        };
        let values = channel.samples.as_slice();
        if !values.iter().all(|v| v.is_finite()) {
            notices.push(notice(CHANNEL_BROKEN));
        } else if values.iter().all(|v| Some(v) == values.first()) {
            notices.push(notice(CHANNEL_DEAD));
        } else {
            usable.push((axis, channel.name.as_str(), values));
        }
    }
    usable
}

fn phases(
    cut: &Cut,
    tool: &Tool,
    record: &TimeRecord,
    usable: &[UsableChannel],
    samples_per_revolution: f64,
) -> Result<(Phases, bool)> {
    let rate = record.sample_rate_hz;
    let entry = DrillGeometry::new(tool, &cut.geometry).ok().and_then(|g| {
        let feed_mm_per_s = g.feed_per_rev_mm * cut.spindle_rpm / 60.0;
        (feed_mm_per_s > 0.0).then(|| g.entry_travel_mm() / feed_mm_per_s * rate)
    });
    // A drill's side forces say nothing of its engagement.
    let carriers = ForceAxis::of(cut.geometry.process());
    let mut carrying: Vec<&[f64]> = usable
        .iter()
        .filter(|c| carriers.contains(&c.0))
        .map(|c| c.2)
        .collect();
    if carrying.is_empty() {
        carrying = usable.iter().map(|c| c.2).collect();
    }
    let spindle = Spindle {
        samples_per_revolution,
        teeth: tool.teeth,
    };
    let found = find_phases(&carrying, spindle, entry);
    let Some([from, to]) = cut.steady_s else {
        let found = found.ok_or_else(|| {
            InputError::new("no steady cut found in the record")
                .file(&cut.file)
                .remedy("record longer, or give steady_s = [from, to] for this cut")
        })?;
        return Ok((found, false));
    };
    let sample = |t: f64| (t - record.start_s) * rate;
    let steady = if sample(from) >= -0.5 && sample(to) <= record.len() as f64 + 0.5 {
        whole_revolutions(sample(from)..sample(to), samples_per_revolution, record.len())
    } else {
        0..0
    };
    if steady.is_empty() {
        let end = record.start_s + record.len() as f64 / rate;
        return Err(InputError::new(format!(
            "steady_s = [{from}, {to}] holds no whole revolution of the record, which runs from {} to {end} s",
            record.start_s
        ))
        .file(&cut.file)
        .key("steady_s")
        .into());
    }
    // What is said to be steady is not air, whatever was found.
    let air = found.map(|p| p.air).unwrap_or_default();
    let air = Air {
        before: air.before.filter(|r| r.end <= steady.start),
        after: air.after.filter(|r| r.start >= steady.end),
    };
    let cutting = steady.clone();
    Ok((Phases { air, cutting, steady }, true))
}

/// Mean over the revolutions of the window with the zero line taken off, and how many revolutions were left
/// out as spikes.
fn average(
    values: &[f64],
    steady: &Range<usize>,
    samples_per_revolution: f64,
    drift: &DriftLine,
    record: &TimeRecord,
) -> (Average, usize) {
    let time = |i: usize| record.start_s + i as f64 / record.sample_rate_hz;
    let compensated: Vec<f64> = steady.clone().map(|i| values[i] - drift.at(time(i))).collect();
    let blocks = Blocks::new(&compensated, samples_per_revolution);
    let centre = signal::median(&blocks.mean);
    let deviation: Vec<f64> = blocks.mean.iter().map(|m| (m - centre).abs()).collect();
    let limit = SPIKE_SIGMA * 1.4826 * signal::median(&deviation);
    let mut kept: Vec<f64> = blocks
        .mean
        .iter()
        .copied()
        .filter(|m| limit == 0.0 || (m - centre).abs() <= limit)
        .collect();
    if 10 * (blocks.len() - kept.len()) > blocks.len() {
        // So many are no spikes.
        kept = blocks.mean.clone();
    }
    let dropped = blocks.len() - kept.len();
    let n = kept.len().max(1) as f64;
    let value = kept.iter().sum::<f64>() / n;
    let scatter = if kept.len() >= 4 {
        scatter_of_mean(&kept)
    } else {
        // Too few revolutions to compare: the samples themselves, which counts the ripple as noise.
        let m = compensated.len().max(1) as f64;
        (compensated.iter().map(|v| (v - value).powi(2)).sum::<f64>() / m).sqrt() / n.sqrt()
    };
    let middle = 0.5 * (time(steady.start) + time(steady.end));
    let std_error = scatter.hypot(drift.std_at(middle)).hypot(drift.bend);
    (Average { value, std_error }, dropped)
}

/// Standard error of the mean of a series whose neighbours may be alike (first-order autoregressive).
fn scatter_of_mean(series: &[f64]) -> f64 {
    let n = series.len() as f64;
    let mean = series.iter().sum::<f64>() / n;
    let variance = series.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    if variance <= 0.0 {
        return 0.0;
    }
    let lagged: f64 = series.windows(2).map(|w| (w[0] - mean) * (w[1] - mean)).sum();
    let rho = (lagged / (n - 1.0) / variance).clamp(0.0, 0.9);
    (variance / n * (1.0 + rho) / (1.0 - rho)).sqrt()
}

fn air_notices(air: &Air, channels: &[&ChannelAnalysis], record_s: f64, notices: &mut Vec<Notice>) {
    let kind = match (&air.before, &air.after) {
        (None, None) => Some(NO_AIR),
        (None, Some(_)) => Some(NO_AIR_BEFORE),
        (Some(_), None) => Some(NO_AIR_AFTER),
        _ => None,
    };
    notices.extend(kind.map(|kind| Notice {
        kind,
        detail: String::new(),
    }));
    let is_bent = |c: &&&ChannelAnalysis| c.drift.bend > 0.02 * c.average.value.abs();
    let bent = channels.iter().filter(is_bent).map(|c| {
        let (label, unit) = (c.axis.label(), c.axis.unit());
        format!("{label} by {:.2} {unit}{}", c.drift.bend, c.drift.shape())
    });
    // A channel that hardly carries force, or carries a ripple about zero, is measured by the others of its kind.
    let size = |c: &ChannelAnalysis| {
        let same = |o: &&&ChannelAnalysis| (o.axis == ForceAxis::Mz) == (c.axis == ForceAxis::Mz);
        let forces = channels.iter().filter(same).map(|o| o.average.value.abs());
        forces.fold(0.0, f64::max)
    };
    let change = |c: &ChannelAnalysis| c.drift.slope_per_s * record_s;
    let is_steep = |c: &&&ChannelAnalysis| {
        !is_bent(c)
            && change(c).abs() > STEEP * size(c)
            && c.drift.slope_per_s.abs() > 6.0 * c.drift.slope_std_per_s
    };
    let steep = channels.iter().filter(is_steep).map(|c| {
        let (label, unit) = (c.axis.label(), c.axis.unit());
        format!(
            "{label} by {:+.2} {unit}/s, {:+.1} {unit} over the record",
            c.drift.slope_per_s,
            change(c)
        )
    });
    for (kind, details) in [
        (BENT_DRIFT, bent.collect::<Vec<String>>()),
        (STEEP_DRIFT, steep.collect()),
    ] {
        if !details.is_empty() {
            notices.push(Notice {
                kind,
                detail: details.join(", "),
            });
        }
    }
}

/// A hole's cutting time is known from its geometry.
fn duration_notice(cut: &Cut, tool: &Tool, phases: &Phases, rate: f64, notices: &mut Vec<Notice>) {
    let CutGeometry::Drilling {
        hole_depth_mm: Some(depth),
        ..
    } = cut.geometry
    else {
        return;
    };
    let (Ok(g), true) = (
        DrillGeometry::new(tool, &cut.geometry),
        phases.air.before.is_some() && phases.air.after.is_some(),
    ) else {
        return;
    };
    let expected_s = (g.entry_travel_mm() + depth) / (g.feed_per_rev_mm * cut.spindle_rpm / 60.0);
    let took_s = phases.cutting.len() as f64 / rate;
    // A dwell at the bottom is usual; half the time again is not.
    if expected_s.is_finite() && !(0.9..1.5).contains(&(took_s / expected_s)) {
        notices.push(Notice {
            kind: WRONG_DURATION,
            detail: format!("{took_s:.2} s against {expected_s:.2} s"),
        });
    }
}

/// F_tool = A F_recorded, standard errors added in squares; torque is taken as recorded.
fn in_tool_axes(tool_from_dyno: &[[f64; 3]; 3], channels: &[ChannelAnalysis]) -> [Option<Average>; 4] {
    let recorded = |axis: ForceAxis| channels.iter().find(|c| c.axis == axis).map(|c| c.average);
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

fn trace(values: &[f64], record: &TimeRecord) -> Trace {
    let stretch = values.len().div_ceil(TRACE_POINTS).max(1);
    let mut trace = Trace {
        time_s: Vec::new(),
        min: Vec::new(),
        max: Vec::new(),
    };
    for (k, part) in values.chunks(stretch).enumerate() {
        let middle = (k * stretch) as f64 + 0.5 * (part.len() - 1) as f64;
        trace.time_s.push(record.start_s + middle / record.sample_rate_hz);
        trace.min.push(part.iter().copied().fold(f64::INFINITY, f64::min));
        trace
            .max
            .push(part.iter().copied().fold(f64::NEG_INFINITY, f64::max));
    }
    trace
}
