//! What the air in a record says about its zero, and what of that is believed.

use std::ops::Range;

use crate::cutting::force_model::force_axis::ForceAxis;
use crate::cutting::measured::cut_analysis::{ChannelAnalysis, Notice};
use crate::cutting::measured::leak::leaked;
use crate::data::{Process, Sample};
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
pub(crate) fn believable_air<S: Sample>(
    channels: &[(ForceAxis, &[S])],
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
    let mean = |values: &[S], r: &Range<usize>| signal::mean(values.get(r.clone()).unwrap_or(&[]));
    let own = |values: &[S], before: Option<&Range<usize>>, after: Option<&Range<usize>>| {
        let side = Air {
            before: before.cloned(),
            after: after.cloned(),
        };
        fit_drift(values, rate, start_s, &side)
    };
    let (before, after) = (air.before.as_ref(), air.after.as_ref());
    let (mut told, mut short) = (Vec::new(), false);
    let mut is_sound = |range: &Range<usize>, is_before: bool, other: Option<&Range<usize>>| -> bool {
        let line = |values: &[S]| match is_before {
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
            let of = |c: &(ForceAxis, &[S])| {
                let (level, zero) = (mean(c.1, steady), mean(c.1, range));
                let cutting = c.1.get(steady.clone()).unwrap_or(&[]);
                let squares: f64 = cutting.iter().map(|v| (v.value() - level).powi(2)).sum();
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

/// A channel that carries this share of the largest force says how much of it was lost.
const CARRIES: f64 = 0.2;

pub(crate) fn air_notices(
    air: &Air,
    channels: &[&ChannelAnalysis],
    record_s: f64,
    cutting_s: f64,
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
    let mut moved: Vec<String> = moved.collect();
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
    let each: Vec<[f64; 2]> = channels
        .iter()
        .map(|c| (c.mean.average.value, c.drift.step, size(c)))
        .filter(|(force, _, size)| force.abs() > CARRIES * size)
        .map(|(force, step, _)| [force, step])
        .collect();
    if let Some(leak) = leaked(&each, cutting_s) {
        moved.clear();
        notices.push(leak);
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutting::measured::cut_analysis::{Average, made_channel};

    /// Samples at 100 Hz of what the closure says of the time, s: a cut of `cut_s` between air.
    fn record(seconds: f64, value: impl Fn(f64) -> f64) -> Vec<f64> {
        let samples = (100.0 * seconds) as usize;
        (0..samples).map(|i| value(i as f64 / 100.0)).collect()
    }

    fn believed(
        values: &[f64],
        air: [Option<Range<usize>>; 2],
        process: Process,
    ) -> (Air, bool, Vec<&'static str>) {
        let [before, after] = air;
        let mut notices = Vec::new();
        let axis = if process == Process::Drilling {
            ForceAxis::Z
        } else {
            ForceAxis::X
        };
        let (air, short) = believable_air(
            &[(axis, values)],
            100.0,
            0.0,
            &Air { before, after },
            &(200..400),
            process,
            0.05,
            &mut notices,
        );
        (air, short, notices.iter().map(|n| n.kind).collect())
    }

    /// A second of air, the cut from 2 s to 4 s at 200 N: a zero that would be off by 100 N in the middle, 2.5 s on, is no zero.
    #[test]
    fn air_that_would_carry_the_zero_off_by_half_the_force_is_none() {
        let at = |slope: f64| {
            let values = record(4.0, |t| if t < 1.0 { slope * (t - 0.5) } else { 200.0 });
            let (air, short, notices) = believed(&values, [Some(0..100), None], Process::Turning);
            assert!(!short);
            assert_eq!(notices.is_empty(), air.before.is_some());
            air.before.is_some()
        };
        assert!(at(0.0) && at(38.0) && at(-38.0));
        assert!(!at(43.0) && !at(-43.0));
    }

    /// The same slope, of a zero that really drifts: the air after the cut lies where the line goes on to.
    #[test]
    fn air_on_the_other_side_bears_a_steep_drift_out() {
        let drift = |t: f64| 60.0 * (t - 0.5);
        let both = [Some(0..100), Some(500..600)];
        let values = record(6.0, |t| {
            drift(t) + if (2.0..4.0).contains(&t) { 200.0 } else { 0.0 }
        });
        let (air, _, notices) = believed(&values, both.clone(), Process::Turning);
        assert!(air.before.is_some() && air.after.is_some() && notices.is_empty());
        // A tool that is going in: the air after the cut knows nothing of it.
        let values = record(6.0, |t| match t {
            t if t < 1.0 => drift(t),
            t if (2.0..4.0).contains(&t) => 200.0,
            _ => 0.0,
        });
        let (air, _, notices) = believed(&values, both.clone(), Process::Turning);
        assert_eq!((air.before, air.after), (None, Some(500..600)));
        assert_eq!(notices, [NO_DRIFT]);
        // A mill shows by its teeth that it does not cut.
        let (air, _, notices) = believed(&values, both, Process::Milling);
        assert!(air.before.is_some() && notices.is_empty());
    }

    /// Milling: a slope is doubted where it is carried more than three times the length of its air.
    #[test]
    fn a_mills_air_is_doubted_where_it_is_carried_far() {
        let kept = |air: Range<usize>| {
            let middle = 0.01 * (air.start as f64 + 0.5 * air.len() as f64);
            let values = record(4.0, |t| if t < 1.9 { 90.0 * (t - middle) } else { 200.0 });
            believed(&values, [Some(air), None], Process::Milling)
                .0
                .before
                .is_some()
        };
        // From 0.5 s to the middle at 3 s are 2.5 s: two and a half lengths of one second, five of half a second.
        assert!(kept(0..100));
        assert!(!kept(25..75));
    }

    /// Four turns of air, 2.9 s before the middle of the cut: more than twelve times their length. Their mean is the zero.
    #[test]
    fn the_slope_of_a_few_turns_is_not_carried_far() {
        let values = record(4.0, |t| if t < 1.0 { 0.0 } else { 200.0 });
        let short = |air: Range<usize>| believed(&values, [Some(air), None], Process::Turning).1;
        assert!(short(0..20));
        assert!(!short(0..30) && !short(0..60));
    }

    fn channel(axis: ForceAxis, value: f64, change: impl Fn(&mut DriftLine)) -> ChannelAnalysis {
        let average = Average {
            value,
            std_error: 1.0,
        };
        let mut channel = made_channel(axis, average);
        change(&mut channel.drift);
        channel
    }

    fn told(channels: &[ChannelAnalysis]) -> Vec<&'static str> {
        let mut notices = Vec::new();
        let air = Air {
            before: Some(0..10),
            after: Some(20..30),
        };
        air_notices(&air, &channels.iter().collect::<Vec<_>>(), 4.0, 2.0, &mut notices);
        notices.iter().map(|n| n.kind).collect()
    }

    /// Over a record of 4 s: three quarters of 200 N are 37.5 N/s. The torque is no force to compare with.
    #[test]
    fn a_zero_that_drifts_far_is_told() {
        let steep = |axis, slope: f64, std: f64| {
            channel(axis, 20.0, move |d| {
                (d.slope_per_s, d.slope_std_per_s) = (slope, std)
            })
        };
        let large = || channel(ForceAxis::Z, 200.0, |_| ());
        assert!(told(&[large(), steep(ForceAxis::X, 36.0, 1.0)]).is_empty());
        assert_eq!(told(&[large(), steep(ForceAxis::X, -39.0, 1.0)]), [STEEP_DRIFT]);
        // One that six standard deviations do not tell from none is not.
        assert!(told(&[large(), steep(ForceAxis::X, 39.0, 7.0)]).is_empty());
        assert_eq!(told(&[large(), steep(ForceAxis::X, 39.0, 6.0)]), [STEEP_DRIFT]);
        // 20 N·m of torque and 4 N·m/s.
        assert_eq!(told(&[large(), steep(ForceAxis::Mz, 4.0, 0.1)]), [STEEP_DRIFT]);
        assert!(told(&[large(), steep(ForceAxis::Mz, 3.6, 0.1)]).is_empty());
    }

    /// A bend of more than 2 % of the mean force, and a zero that jumped.
    #[test]
    fn a_zero_that_bends_or_jumps_is_told() {
        let bent = |bend: f64| {
            channel(ForceAxis::X, -200.0, move |d| {
                (d.bend, d.slope_per_s) = (bend, 60.0)
            })
        };
        assert_eq!(told(&[bent(4.4)]), [BENT_DRIFT]);
        // As a line it is steep.
        assert_eq!(told(&[bent(3.6)]), [STEEP_DRIFT]);
        assert_eq!(
            told(&[channel(ForceAxis::X, 200.0, |d| d.step = -5.0)]),
            [MOVED_ZERO]
        );
        let mut notices = Vec::new();
        for (before, after) in [(false, false), (false, true), (true, false), (true, true)] {
            let air = Air {
                before: before.then_some(0..10),
                after: after.then_some(20..30),
            };
            air_notices(&air, &[], 4.0, 2.0, &mut notices);
        }
        let kinds: Vec<&str> = notices.iter().map(|n| n.kind).collect();
        assert_eq!(kinds, [NO_AIR, NO_AIR_BEFORE, NO_AIR_AFTER]);
    }
}
