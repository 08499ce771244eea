//! What one number says of how records were made, wired or filtered, fitted to them.

use std::sync::Arc;

use argmin::core::{CostFunction, Error as ArgminError, Executor};
use argmin::solver::brent::BrentOpt;
use num_complex::Complex64;

use super::axes_of_cuts::OtherAxes;
use super::gain::OtherGain;
use super::plausible::fit;
use crate::cutting::DrillGeometry;
use crate::discrepancy::setup::decide::TriedMistake;
use crate::discrepancy::setup::finding::{SetupFinding, with_error};
use crate::identify::CuttingData;
use crate::identify::forces::cutting_data::{CutData, CutKind};
use crate::text::listed;

pub(super) const SPEED_VARIATION: &str = "spindle-speed-variation";
/// How often the range of what is tried is widened, and how often it is then divided at most.
const WIDENED: usize = 6;
const BRENT_STEPS: u64 = 40;
/// Nobody slips by less: what so small a change of feed, depth, width or helix takes away is something else.
const LEAST_SLIP: f64 = 0.02;

/// A change of all records that one number describes; zero changes nothing.
#[derive(Debug, Clone)]
pub(super) enum RecordChange {
    /// Logarithm of the gain of Fy against Fx. One of the two cannot be told from the other, for all coefficients scale with
    /// both; nor can the gain of Fz, with which the axial coefficients scale.
    GainOfY,
    /// Standard deviation of the tool's angle, rad, about its mean turning while lines are averaged: high orders smear. Where
    /// the drive swings at a frequency of its own the same turning error is the steadier one in time, s.
    SpeedWander { steady_in_time: bool },
    /// Time constant of the amplifiers, s.
    LowPass { order: u8 },
    /// Length of time that was averaged over, s.
    MovingAverage,
    /// Logarithm of the true feed of one cut over the stated one.
    FeedOf(usize),
    /// Logarithm of the true depth of one cut over the stated one.
    DepthOf(usize),
    /// Logarithm of the true spindle speed of one hole over the stated one: nothing but the speed of its entry tells.
    DrillSpeedOf(usize),
    /// Logarithm of the true radius at which the lips begin in one hole (its pilot's) over the stated one.
    PilotOf(usize),
    /// Logarithm of the true diameter of the drill over the stated one.
    DrillDiameter,
    /// Logarithm of the true tangent of half the point angle over the stated one.
    PointAngle,
    /// Logarithm of the true width over the stated one: of one cut, or of all.
    Width(Option<usize>),
    /// Logarithm of the true tangent of the helix over the stated one.
    Helix,
    /// The records of two cuts stand under each other's name: nothing to fit.
    Exchanged([usize; 2]),
    /// Logarithm of another gain of some records over what it looks like.
    Gain(OtherGain),
    /// Another order of the channels of some records: nothing to fit.
    Axes(OtherAxes),
}

impl RecordChange {
    /// The data as they were before the change.
    fn undone(&self, data: &CuttingData, value: f64) -> CuttingData {
        let mut own = data.clone();
        match self {
            RecordChange::FeedOf(cut) => return data.with_feed_of(*cut, value.exp()),
            RecordChange::DepthOf(cut) => return data.with_depth_of(*cut, value.exp()),
            RecordChange::DrillSpeedOf(cut) => return data.with_drill_speed_of(*cut, value.exp()),
            RecordChange::PilotOf(cut) => return data.with_pilot_of(*cut, value.exp()),
            RecordChange::DrillDiameter => return data.with_drill_diameter(value.exp()),
            RecordChange::PointAngle => return data.with_point_angle(value.exp()),
            RecordChange::Width(only) => {
                return data.with_width_of(|i| only.is_none_or(|one| one == i), value.exp());
            }
            RecordChange::Helix => return data.with_helix(value.exp()),
            RecordChange::Exchanged(cuts) => return data.with_exchanged(*cuts),
            RecordChange::Gain(gain) => return gain.undone(data, value.exp()),
            RecordChange::Axes(axes) => return axes.undone(data),
            RecordChange::GainOfY => {
                let channel = 1;
                for row in &mut own.tool_from_dyno {
                    row[channel] *= (-value).exp();
                }
                for entry in &mut own.dyno_from_tool[channel] {
                    *entry *= value.exp();
                }
            }
            RecordChange::SpeedWander { steady_in_time } => {
                for cut in &mut own.cuts {
                    let angle = match steady_in_time {
                        true => value * std::f64::consts::TAU * cut.spindle_hz(),
                        false => value,
                    };
                    for channel in Arc::make_mut(cut).channels.iter_mut().flatten() {
                        let lines = channel.orders.iter_mut().zip(&mut channel.order_std);
                        for (k, (line, std)) in lines.enumerate() {
                            let smeared = (-0.5 * ((k + 1) as f64 * angle).powi(2)).exp().max(1e-3);
                            *line /= smeared;
                            *std /= smeared;
                        }
                    }
                }
            }
            RecordChange::MovingAverage => {
                for cut in &mut own.cuts {
                    // Half the angle by which order 1 goes on from sample to sample.
                    let half_step = std::f64::consts::PI * cut.spindle_hz() / cut.sample_rate_hz;
                    let count = (value * cut.sample_rate_hz).max(1.0);
                    for channel in Arc::make_mut(cut).channels.iter_mut().flatten() {
                        let lines = channel.orders.iter_mut().zip(&mut channel.order_std);
                        for (k, (line, std)) in lines.enumerate() {
                            let x = (k + 1) as f64 * half_step;
                            let left = (count * x).sin() / (count * x.sin());
                            // Where whole periods were averaged nothing is left that could be brought back.
                            let left = left.abs().max(1e-3).copysign(left);
                            *line /= left;
                            *std /= left.abs();
                        }
                    }
                }
            }
            RecordChange::LowPass { order } => {
                for cut in &mut own.cuts {
                    let spindle = std::f64::consts::TAU * cut.spindle_hz();
                    let cut = Arc::make_mut(cut);
                    for channel in cut.channels.iter_mut().flatten() {
                        let lines = channel.orders.iter_mut().zip(&mut channel.order_std);
                        for (k, (line, std)) in lines.enumerate() {
                            let s = Complex64::new(0.0, spindle * (k + 1) as f64 * value);
                            let divisor = match order {
                                1 => 1.0 + s,
                                _ => 1.0 + s * std::f64::consts::SQRT_2 + s * s,
                            };
                            *line *= divisor;
                            *std *= divisor.norm();
                        }
                    }
                }
            }
        }
        own
    }

    /// Values to begin with, rising.
    fn starts(&self) -> &'static [f64] {
        match self {
            RecordChange::GainOfY => &[-0.3, -0.1, 0.1, 0.3],
            RecordChange::SpeedWander {
                steady_in_time: false,
            } => &[0.0, 5e-3, 2e-2, 5e-2],
            RecordChange::SpeedWander { steady_in_time: true } => &[0.0, 5e-5, 2e-4, 5e-4],
            // Corners from 3 kHz down to 30 Hz.
            RecordChange::LowPass { .. } => &[0.0, 5e-5, 2e-4, 6e-4, 2e-3, 5e-3],
            // Each order comes back with the other sign where it is averaged over more than its period: steps are short against that.
            RecordChange::MovingAverage => &[0.0, 2e-4, 5e-4, 1e-3, 2e-3, 3e-3, 4e-3, 6e-3, 8e-3],
            RecordChange::FeedOf(_) | RecordChange::DepthOf(_) | RecordChange::PilotOf(_) => {
                &[-0.7, -0.2, 0.2, 0.7]
            }
            RecordChange::Width(_) | RecordChange::Helix => &[-0.5, -0.15, 0.15, 0.5],
            RecordChange::DrillSpeedOf(_) | RecordChange::DrillDiameter | RecordChange::PointAngle => {
                &[-0.3, -0.1, 0.1, 0.3]
            }
            RecordChange::Gain(_) | RecordChange::Exchanged(_) | RecordChange::Axes(_) => {
                &[-0.1, -0.02, 0.02, 0.1]
            }
        }
    }

    /// What values are possible.
    fn range(&self) -> [f64; 2] {
        match self {
            RecordChange::GainOfY => [-1.5, 1.5],
            RecordChange::SpeedWander {
                steady_in_time: false,
            } => [0.0, 0.3],
            RecordChange::SpeedWander { steady_in_time: true } => [0.0, 3e-3],
            RecordChange::LowPass { .. } => [0.0, 0.01],
            RecordChange::MovingAverage => [0.0, 0.02],
            RecordChange::FeedOf(_) | RecordChange::DepthOf(_) | RecordChange::PilotOf(_) => [-2.5, 2.5],
            RecordChange::DrillSpeedOf(_) | RecordChange::DrillDiameter | RecordChange::PointAngle => {
                [-1.0, 1.0]
            }
            RecordChange::Width(_) | RecordChange::Helix => [-1.5, 1.5],
            RecordChange::Gain(_) | RecordChange::Exchanged(_) | RecordChange::Axes(_) => [-1.0, 1.0],
        }
    }

    /// The best value with its standard error and χ², where there is one inside what is possible.
    fn best(&self, data: &CuttingData) -> Option<(f64, f64, f64)> {
        let range = self.range();
        let chi2 = |value: f64| -> Option<f64> {
            let own = self.undone(data, value);
            Some(fit(&own)?.reduced_chi2 * data.value_count() as f64)
        };
        let (value, least) = least_of(&chi2, self.starts(), range)?;
        let [low, high] = range;
        let step = 1e-3 * value.abs().max(0.01 * (high - low));
        let middle = value.clamp(low + step, high - step);
        let at = |value: f64| Some((value, chi2(value)?));
        // At an end of what is possible the parabola stands beside it.
        let here = if middle == value {
            (value, least)
        } else {
            at(middle)?
        };
        let curvature = curvature(&[at(middle - step)?, here, at(middle + step)?])?;
        (curvature > 0.0).then(|| (value, (2.0 / curvature).sqrt(), least))
    }

    pub(super) fn tried(&self, data: &CuttingData, base: f64) -> Option<TriedMistake> {
        let values = data.value_count() as f64;
        let (value, std, chi2) = match self {
            // Neither has a size.
            RecordChange::Gain(gain) if gain.is_dead => {
                let rest = gain.left_out(data)?;
                let kept = rest.value_count() as f64;
                (0.0, 0.0, fit(&rest)?.reduced_chi2 * kept + values - kept)
            }
            RecordChange::Exchanged(_) | RecordChange::Axes(_) => {
                (0.0, 0.0, fit(&self.undone(data, 0.0))?.reduced_chi2 * values)
            }
            _ => self.best(data)?,
        };
        let is_slip = match self {
            RecordChange::FeedOf(_)
            | RecordChange::DepthOf(_)
            | RecordChange::DrillSpeedOf(_)
            | RecordChange::PilotOf(_)
            | RecordChange::DrillDiameter
            | RecordChange::PointAngle
            | RecordChange::Width(_)
            | RecordChange::Helix => value.abs() >= LEAST_SLIP,
            RecordChange::Exchanged(_) | RecordChange::Gain(_) | RecordChange::Axes(_) => true,
            RecordChange::GainOfY
            | RecordChange::SpeedWander { .. }
            | RecordChange::LowPass { .. }
            | RecordChange::MovingAverage => value != 0.0,
        };
        let is_better = chi2 < base;
        if !is_better || !is_slip {
            return None;
        }
        let std = std * (chi2 / values).max(1.0).sqrt();
        let finding = match self {
            RecordChange::Width(Some(cut)) => {
                other_than_stated(&data.cuts[*cut].id, "radial-width", "radial width", value, std)
            }
            RecordChange::Width(None) => all_otherwise(
                "radial-width",
                "all cuts",
                "width of cut",
                &true_angles(data, value.exp()),
                value,
                std,
            ),
            RecordChange::Helix => all_otherwise(
                "helix",
                "tool",
                "tan(helix)/diameter",
                &true_helix(data, value.exp()),
                value,
                std,
            ),
            RecordChange::Exchanged(cuts) => exchanged_files(
                &cuts.map(|i| data.cuts[i].id.clone()),
                "each record has the forces that the other cut asks for",
                0.0,
            ),
            RecordChange::Gain(gain) => gain.finding(data, value, std),
            RecordChange::Axes(axes) => axes.finding(data),
            RecordChange::FeedOf(cut) => {
                other_than_stated(&data.cuts[*cut].id, "feed-override", "feed", value, std)
            }
            RecordChange::DepthOf(cut) => {
                other_than_stated(&data.cuts[*cut].id, "axial-depth", "axial depth", value, std)
            }
            RecordChange::DrillSpeedOf(cut) => {
                let found =
                    other_than_stated(&data.cuts[*cut].id, "spindle-speed", "spindle speed", value, std);
                let rpm = value.exp() * data.cuts[*cut].spindle_rpm;
                told_as(found, rpm, std, "1/min", &format!("spindle_rpm = {rpm:.0}"))
            }
            RecordChange::PilotOf(cut) => pilot(data, *cut, value, std),
            RecordChange::DrillDiameter => {
                let diameter_mm = value.exp() * 2.0 * drill(data).map_or(0.0, |g| g.radius_mm);
                let truth = format!("diameter_mm = {diameter_mm:.2} in [tool]");
                let found = all_otherwise(
                    "tool-diameter",
                    "tool",
                    "diameter of the drill",
                    &truth,
                    value,
                    std,
                );
                told_as(found, diameter_mm, std, "mm", "")
            }
            RecordChange::PointAngle => {
                let tangent = value.exp() * drill(data).map_or(0.0, |g| g.half_point_rad.tan());
                let half_deg = tangent.atan().to_degrees();
                let truth = format!("half_point_angle_deg = {half_deg:.1} in [tool]");
                let found = all_otherwise(
                    "point-angle",
                    "tool",
                    "tangent of half the point angle",
                    &truth,
                    value,
                    std,
                );
                // d atan(t) = t/(1 + t²) d ln t.
                let error_deg = (std * tangent / (1.0 + tangent * tangent)).to_degrees();
                SetupFinding {
                    value: Some(half_deg),
                    std_error: Some(error_deg),
                    unit: "deg",
                    ..found
                }
            }
            RecordChange::MovingAverage => SetupFinding {
                kind: "moving-average",
                place: "all cuts, all channels".into(),
                value: Some(1e3 * value),
                std_error: Some(1e3 * std),
                unit: "ms",
                confidence: 0.0,
                remedy: format!(
                    "Export the records as they were sampled: each sample is the mean of {} ms ({}), which takes the peaks of the teeth away.",
                    with_error(1e3 * value, 1e3 * std),
                    samples(data, value)
                ),
            },
            RecordChange::GainOfY => {
                let factor = value.exp();
                let error = factor * std;
                SetupFinding {
                    kind: "channel-gain",
                    place: "all cuts, Fy against Fx".into(),
                    value: Some(factor),
                    std_error: Some(error),
                    unit: "1",
                    confidence: 0.0,
                    remedy: format!(
                        "Calibrate the dynamometer's channels: recorded Fy is {} times what it should be (or Fx {:.4} times: \
                         only their ratio shows).",
                        with_error(factor, error),
                        1.0 / factor
                    ),
                }
            }
            RecordChange::SpeedWander { steady_in_time } => {
                let (factor, unit) = match steady_in_time {
                    true => (1e3, "ms"),
                    false => (1.0, "rad"),
                };
                SetupFinding {
                    kind: SPEED_VARIATION,
                    place: "all cuts".into(),
                    value: Some(factor * value),
                    std_error: Some(factor * std),
                    unit,
                    confidence: 0.0,
                    remedy: format!(
                        "Average the turns over the angle of the spindle (an encoder's, or shorter records): the tool is {} \
                         {unit} (rms) early or late while turns are averaged, which smears what is quick within a turn.",
                        with_error(factor * value, factor * std)
                    ),
                }
            }
            RecordChange::LowPass { order } => {
                let corner = 1.0 / (std::f64::consts::TAU * value);
                let error = corner * std / value;
                SetupFinding {
                    kind: "amplifier-low-pass",
                    place: "all cuts, all channels".into(),
                    value: Some(corner),
                    std_error: Some(error),
                    unit: "Hz",
                    confidence: 0.0,
                    remedy: format!(
                        "Open the charge amplifier's low-pass filter: corner {} Hz, order {order}.",
                        with_error(corner, error)
                    ),
                }
            }
        };
        Some(TriedMistake {
            finding,
            chi2,
            parameters: usize::from(!matches!(
                self,
                RecordChange::Exchanged(_) | RecordChange::Axes(_)
            )),
            tried: match self {
                RecordChange::FeedOf(_)
                | RecordChange::DepthOf(_)
                | RecordChange::DrillSpeedOf(_)
                | RecordChange::PilotOf(_)
                | RecordChange::Width(Some(_)) => 3.0 * data.cuts.len() as f64,
                // Of one cut alone a slip of the pen is more likely than another range of all channels.
                RecordChange::Gain(gain) if gain.is_of_one_cut() => 40.0 * data.cuts.len() as f64,
                RecordChange::Gain(_) => 4.0 * data.cuts.len() as f64,
                RecordChange::Axes(_) => 40.0 * data.cuts.len() as f64,
                RecordChange::Exchanged(_) => (data.cuts.len() * data.cuts.len()) as f64,
                _ => 4.0,
            },
            at_bound: self.leaves_no_lip(data, value),
        })
    }

    /// A pilot hole so wide that nobody drills it.
    fn leaves_no_lip(&self, data: &CuttingData, value: f64) -> bool {
        /// Part of the drill's radius.
        const WIDEST: f64 = 0.9;
        let RecordChange::PilotOf(cut) = self else {
            return false;
        };
        match &data.cuts[*cut].kind {
            CutKind::Drilling { cut, .. } => {
                value.exp() * cut.geometry.inner_radius_mm > WIDEST * cut.geometry.radius_mm
            }
            CutKind::Milling { .. } | CutKind::Turning { .. } => false,
        }
    }
}

/// The files of two cuts that stand under each other's name; `why`: what says so.
pub(super) fn exchanged_files(cuts: &[String; 2], why: &str, confidence: f64) -> SetupFinding {
    let cuts = listed(cuts);
    let remedy = format!("Swap the files of cut {cuts}: {why}.");
    SetupFinding::without_size("cut-swap", format!("cut {cuts}"), confidence, remedy)
}

/// All cuts made otherwise than stated, by a factor on `what` whose logarithm is `value`; `truth`: what that comes to.
fn all_otherwise(
    kind: &'static str,
    place: &str,
    what: &str,
    truth: &str,
    value: f64,
    std: f64,
) -> SetupFinding {
    let factor = value.exp();
    let error = factor * std;
    SetupFinding {
        kind,
        place: place.into(),
        value: Some(factor),
        std_error: Some(error),
        unit: "1",
        confidence: 0.0,
        remedy: format!(
            "The waveforms are those of {} times the stated {what}: {truth}. Measure it and write it down; the coefficients with the \
             present one are wrong.",
            with_error(factor, error)
        ),
    }
}

/// The angles of the first cut that was milled `factor` times as wide as stated.
fn true_angles(data: &CuttingData, factor: f64) -> String {
    let of_cut = |cut: &Arc<CutData>| match &cut.kind {
        CutKind::Milling { cut: milling, .. } => Some((cut.id.clone(), milling.immersion.wider(factor)?)),
        CutKind::Drilling { .. } | CutKind::Turning { .. } => None,
    };
    data.cuts
        .iter()
        .find_map(of_cut)
        .map_or(String::new(), |(id, angles)| {
            let [start, exit] = [angles.start_rad, angles.exit_rad].map(f64::to_degrees);
            format!("start_deg = {start:.1}, exit_deg = {exit:.1} for cut {id}")
        })
}

/// Helix or diameter of a tool whose edge lags `factor` times as far behind as the stated ones make it.
fn true_helix(data: &CuttingData, factor: f64) -> String {
    let of_cut = |cut: &Arc<CutData>| match &cut.kind {
        CutKind::Milling { cut: milling, .. } => {
            let diameter_mm = 1e3 * cut.cutting_speed_m_per_min / (std::f64::consts::PI * cut.spindle_rpm);
            let tangent = milling.lag_rad * diameter_mm / (2.0 * milling.axial_depth_mm);
            Some(((factor * tangent).atan().to_degrees(), diameter_mm / factor))
        }
        CutKind::Drilling { .. } | CutKind::Turning { .. } => None,
    };
    data.cuts
        .iter()
        .find_map(of_cut)
        .map_or(String::new(), |(helix_deg, diameter_mm)| {
            format!("helix_deg = {helix_deg:.1} with the diameter as stated, or diameter_mm = {diameter_mm:.1} with the helix as stated")
        })
}

/// A cut whose `what` was not as stated but the exponential of `value` times that.
fn other_than_stated(id: &str, kind: &'static str, what: &str, value: f64, std: f64) -> SetupFinding {
    let factor = value.exp();
    let error = factor * std;
    SetupFinding {
        kind,
        place: format!("cut {id}"),
        value: Some(factor),
        std_error: Some(error),
        unit: "1",
        confidence: 0.0,
        remedy: format!(
            "Look what {what} cut {id} was made with (the override knob, a line of the program, a slip in the cut list; or the \
             amplifier's range): its forces are those of {} times the stated one. Write the true one down, or leave the cut out.",
            with_error(factor, error)
        ),
    }
}

/// `found` with its size in the unit of campaign.toml, known to `std` of itself, and the `line` to write.
fn told_as(found: SetupFinding, size: f64, std: f64, unit: &'static str, line: &str) -> SetupFinding {
    let line = match line {
        "" => String::new(),
        line => format!(" True is {line}."),
    };
    SetupFinding {
        value: Some(size),
        std_error: Some(size * std),
        unit,
        remedy: found.remedy + &line,
        ..found
    }
}

/// What the drill is in the first hole.
fn drill(data: &CuttingData) -> Option<&DrillGeometry> {
    data.cuts.iter().find_map(|cut| match &cut.kind {
        CutKind::Drilling { cut, .. } => Some(&cut.geometry),
        CutKind::Milling { .. } | CutKind::Turning { .. } => None,
    })
}

/// A hole whose lips begin at another radius than stated, by a factor whose logarithm is `value`.
fn pilot(data: &CuttingData, cut: usize, value: f64, std: f64) -> SetupFinding {
    let id = &data.cuts[cut].id;
    let radius_mm = |cut: &CutData, full: bool| match &cut.kind {
        CutKind::Drilling { cut, .. } if cut.full_hole || !full => Some(cut.geometry.inner_radius_mm),
        _ => None,
    };
    let diameter_mm = 2.0 * value.exp() * radius_mm(&data.cuts[cut], false).unwrap_or(0.0);
    let chisel_mm = data
        .cuts
        .iter()
        .find_map(|cut| radius_mm(cut, true))
        .map(|half| 2.0 * half);
    // The lips of a hole without a pilot begin where the chisel ends.
    let is_full =
        chisel_mm.is_some_and(|chisel| (diameter_mm / chisel).ln().abs() < (3.0 * std).max(LEAST_SLIP));
    let written = match is_full {
        true => "pilot_diameter_mm = 0.0".to_string(),
        false => format!("pilot_diameter_mm = {diameter_mm:.2}"),
    };
    SetupFinding {
        kind: "pilot-diameter",
        place: format!("cut {id}"),
        value: Some(if is_full { 0.0 } else { diameter_mm }),
        std_error: Some(diameter_mm * std),
        unit: "mm",
        confidence: 0.0,
        remedy: format!(
            "Look what pilot hole cut {id} had: its thrust, torque and entry are those of lips that begin at a diameter of {} mm. Write \
             {written} for it, or leave the cut out.",
            with_error(diameter_mm, diameter_mm * std)
        ),
    }
}

/// `20 samples at 5000 Hz`: what was averaged, by the first record.
fn samples(data: &CuttingData, length_s: f64) -> String {
    data.cuts.first().map_or(String::new(), |cut| {
        format!(
            "{:.0} samples at {:.0} Hz",
            length_s * cut.sample_rate_hz,
            cut.sample_rate_hz
        )
    })
}

/// Where `f` is least and how small it is there: the least of `starts`, which rise, then Brent's method between its neighbours; within
/// `range`.
fn least_of(f: &impl Fn(f64) -> Option<f64>, starts: &[f64], [low, high]: [f64; 2]) -> Option<(f64, f64)> {
    let at = |value: f64| Some((value, f(value)?));
    let mut points: Vec<(f64, f64)> = starts.iter().map(|start| at(*start)).collect::<Option<_>>()?;
    let least =
        |points: &[(f64, f64)]| (0..points.len()).min_by(|a, b| points[*a].1.total_cmp(&points[*b].1));
    for _ in 0..WIDENED {
        // At an end of what was tried the range is widened by half.
        let [first, last] = [points[0].0, points[points.len() - 1].0];
        let width = 0.5 * (last - first);
        match least(&points)? {
            0 if first > low => points.insert(0, at((first - width).max(low))?),
            i if i + 1 == points.len() && last < high => points.push(at((last + width).min(high))?),
            _ => break,
        }
    }
    let best = least(&points)?;
    let between = [best.saturating_sub(1), (best + 1).min(points.len() - 1)].map(|i| points[i].0);
    let brent = BrentOpt::new(between[0], between[1]).set_tolerance(1e-6, 1e-6 * (high - low));
    let found = Executor::new(Scalar(f), brent)
        .configure(|state| state.max_iters(BRENT_STEPS))
        .run()
        .ok()?;
    let found = (found.state.best_param?, found.state.best_cost);
    [found, points[best]]
        .into_iter()
        .min_by(|a, b| a.1.total_cmp(&b.1))
}

/// A function of one value, as argmin takes it; what cannot be computed is as bad as can be.
struct Scalar<'a, F>(&'a F);

impl<F: Fn(f64) -> Option<f64>> CostFunction for Scalar<'_, F> {
    type Param = f64;
    type Output = f64;

    fn cost(&self, value: &f64) -> std::result::Result<f64, ArgminError> {
        Ok((self.0)(*value).unwrap_or(f64::MAX))
    }
}

/// Second derivative of the parabola through three points.
fn curvature(points: &[(f64, f64)]) -> Option<f64> {
    let [(a, fa), (b, fb), (c, fc)] = *points else {
        return None;
    };
    let slope = |x: f64, fx: f64, y: f64, fy: f64| (fy - fx) / (y - x);
    let second = 2.0 * (slope(b, fb, c, fc) - slope(a, fa, b, fb)) / (c - a);
    second.is_finite().then_some(second)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curvature_of_a_parabola_is_found() {
        let f = |x: f64| 3.0 + 5.0 * (x - 0.7).powi(2);
        let points = [-1.0, 0.2, 2.0].map(|x| (x, f(x)));
        assert!((curvature(&points).unwrap() - 10.0).abs() < 1e-12);
    }

    /// A valley as sharp and as lopsided as a slip in one feed makes it, beyond the starts and at the end of the range.
    #[test]
    fn the_least_is_found_to_the_last_digit() {
        let at = |bottom: f64| move |x: f64| Some(1e6 * ((x - bottom).exp() - 1.0 - (x - bottom)) + 7.0);
        for bottom in [-1.9, -0.48, 0.0, 0.481, 2.1] {
            let (value, least) = least_of(&at(bottom), &[-0.7, -0.2, 0.2, 0.7], [-2.5, 2.5]).unwrap();
            assert!((value - bottom).abs() < 1e-5, "{value} for {bottom}");
            assert!((least - 7.0).abs() < 1e-3, "{least}");
        }
        let (value, _) = least_of(&at(9.0), &[-0.7, -0.2, 0.2, 0.7], [-2.5, 2.5]).unwrap();
        assert!((value - 2.5).abs() < 1e-4, "{value}");
    }
}
