//! What the air in a record says about its zero, and what of that is believed.

use std::ops::Range;

use crate::cutting::force_model::force_axis::ForceAxis;
use crate::cutting::measured::cut_analysis::{ChannelAnalysis, Notice};
use crate::data::Process;
use crate::signal::{self, Air, DriftLine, fit_drift};
use crate::text::figures;

pub(crate) const NO_AIR: &str = "no air cut in the record: drift and offset cannot be told from edge force; \
     record a second of air before and after each cut";
pub(crate) const NO_AIR_BEFORE: &str = "no air before the cut: the zero line rests on the air after it alone";
pub(crate) const NO_AIR_AFTER: &str = "no air after the cut: the zero line rests on the air before it alone";
const BENT_DRIFT: &str = "the drift is not a line (the air bends away from it): averages may be off by more than \
     their errors say; let the amplifier warm up and reset it before each cut (`lobestone diagnose` can fit it as \
     nonlinear-drift)";
const STEEP_DRIFT: &str = "the zero drifts far: the line through the air is taken off; let the amplifier warm up and reset it \
     before each cut";
const MOVED_ZERO: &str = "the zero moved between the air before and the air after the cut: half-way is taken off, and the standard \
     errors cover either; look for what slipped or was clamped, a chip on the table, an amplifier that overloaded or was reset";
const NO_DRIFT: &str = "what looked like air runs so steeply that the zero would be off by more than half the cutting force: an \
     amplifier does not drift like that, the tool enters or leaves; that stretch is not taken as air and the zero is left as it is";
const SHORT_AIR: &str = "the air on one side of the cut is too short to tell drift: its mean is taken off throughout; record a \
     second of air before and after each cut";
/// Change of the zero over the record, as a part of the average force, that is worth telling.
const STEEP: f64 = 0.75;

/// A stretch of air whose own slope would carry the zero off by this part of the cutting force, up to the middle of the cut, is
/// no air, unless the other stretch bears it out.
const STEEPEST: f64 = 0.5;
/// Milling shows by its content whether the tool cuts; there a slope is doubted only where it is carried this many times the
/// length of its air.
const FAR: f64 = 3.0;
/// The slope of so few turns is not carried this many times their length: their mean is.
const SHORT_AIR_TURNS: f64 = 10.0;
const TOO_FAR: f64 = 12.0;
/// Standard deviations that such a slope must stand above nothing.
const STEEP_SIGMA: f64 = 6.0;

/// `air` without the stretches that run too steeply for an amplifier's drift. `channels`: samples of those that carry the force.
/// And whether what is left is too short for its slope to be believed.
#[allow(clippy::too_many_arguments)]
pub(crate) fn believable_air(
    channels: &[(ForceAxis, &[f64])],
    rate: f64,
    start_s: f64,
    air: &Air,
    steady: &Range<usize>,
    process: Process,
    turn_s: f64,
    notices: &mut Vec<Notice>,
) -> (Air, bool) {
    let time = |i: usize| start_s + i as f64 / rate;
    let middle = 0.5 * (time(steady.start) + time(steady.end));
    let mean = |values: &[f64], r: &Range<usize>| signal::mean(values.get(r.clone()).unwrap_or(&[]));
    let own = |values: &[f64], before: Option<&Range<usize>>, after: Option<&Range<usize>>| {
        let side = Air {
            before: before.cloned(),
            after: after.cloned(),
        };
        fit_drift(values, rate, start_s, &side)
    };
    let (before, after) = (air.before.as_ref(), air.after.as_ref());
    let (mut told, mut short) = (Vec::new(), false);
    let mut is_sound = |range: &Range<usize>, is_before: bool, other: Option<&Range<usize>>| -> bool {
        let line = |values: &[f64]| match is_before {
            true => own(values, Some(range), None),
            false => own(values, None, Some(range)),
        };
        let off = |line: &DriftLine| line.slope_per_s * (middle - line.reference_s);
        let length_s = range.len() as f64 / rate;
        let reach_s = (middle - time(range.start + range.len() / 2)).abs();
        // Air on the other side too: nothing is carried beyond it.
        if process == Process::Milling && (other.is_some() || reach_s < FAR * length_s) {
            return true;
        }
        if other.is_none() && reach_s > TOO_FAR * length_s && length_s < SHORT_AIR_TURNS * turn_s {
            short = true;
            return true;
        }
        // Force above the level of this air and its ripple, largest of its kind.
        let size = |torque: bool| {
            let kind = channels.iter().filter(|c| (c.0 == ForceAxis::Mz) == torque);
            let of = |c: &(ForceAxis, &[f64])| {
                let (level, zero) = (mean(c.1, steady), mean(c.1, range));
                let cutting = c.1.get(steady.clone()).unwrap_or(&[]);
                let squares: f64 = cutting.iter().map(|v| (v - level).powi(2)).sum();
                (level - zero).hypot((squares / cutting.len().max(1) as f64).sqrt())
            };
            kind.map(of).fold(0.0, f64::max)
        };
        let steep = channels.iter().find_map(|&(axis, values)| {
            let line = line(values);
            let limit = STEEPEST * size(axis == ForceAxis::Mz);
            let is_steep =
                off(&line).abs() > limit && line.slope_per_s.abs() > STEEP_SIGMA * line.slope_std_per_s;
            // By the other stretch: it lies where the line goes on to, or a decaying drift goes through both.
            let borne_out = other.is_some_and(|o| {
                let at = time(o.start + o.len() / 2);
                (line.at(at) - mean(values, o)).abs() < limit
                    || own(values, before, after).time_constant_s.is_some()
            });
            (is_steep && !borne_out).then_some((axis, line))
        });
        if let Some((axis, line)) = &steep {
            told.push(format!(
                "{} by {} {}/s {} the cut",
                axis.label(),
                figures(line.slope_per_s, 3),
                axis.unit(),
                if is_before { "before" } else { "after" }
            ));
        }
        steep.is_none()
    };
    let sound = Air {
        before: before.filter(|r| is_sound(r, true, after)).cloned(),
        after: after.filter(|r| is_sound(r, false, before)).cloned(),
    };
    notices.extend((!told.is_empty()).then(|| Notice {
        kind: NO_DRIFT,
        detail: told.join(", "),
    }));
    notices.extend(short.then(|| Notice {
        kind: SHORT_AIR,
        detail: String::new(),
    }));
    (sound, short)
}

pub(crate) fn air_notices(
    air: &Air,
    channels: &[&ChannelAnalysis],
    record_s: f64,
    notices: &mut Vec<Notice>,
) {
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
    let moved = channels
        .iter()
        .filter(|c| c.drift.step != 0.0)
        .map(|c| format!("{} by {:+.1} {}", c.axis.label(), c.drift.step, c.axis.unit()));
    let moved: Vec<String> = moved.collect();
    let is_bent = |c: &&&ChannelAnalysis| c.drift.bend > 0.02 * c.mean.average.value.abs();
    let bent = channels.iter().filter(is_bent).map(|c| {
        let (label, unit) = (c.axis.label(), c.axis.unit());
        format!("{label} by {:.2} {unit}{}", c.drift.bend, c.drift.shape())
    });
    // A channel that hardly carries force, or carries a ripple about zero, is measured by the others of its kind.
    let size = |c: &ChannelAnalysis| {
        let same = |o: &&&ChannelAnalysis| (o.axis == ForceAxis::Mz) == (c.axis == ForceAxis::Mz);
        let forces = channels.iter().filter(same).map(|o| o.mean.average.value.abs());
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
        (MOVED_ZERO, moved),
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
