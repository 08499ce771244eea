//! One record of one cut: drift, phases, averages over whole revolutions, in tool axes.

use std::ops::Range;

use num_complex::Complex64;

use crate::cutting::cutting_trials::CuttingTrials;
use crate::cutting::force_model::average_force::{cut_diameter_mm, cutting_speed_m_per_min, feed_mm};
use crate::cutting::force_model::drill_geometry::DrillGeometry;
use crate::cutting::force_model::force_axis::ForceAxis;
use crate::cutting::measured::air::{air_notices, believable_air};
use crate::cutting::measured::average::average;
use crate::cutting::measured::contact::{INTERRUPTED, TurnContact, at_full_contact, interrupted};
use crate::cutting::measured::cut_analysis::{
    ChannelAnalysis, CutAnalysis, NOTHING_REPEATS, Notice, OTHER_MULTIPLE, Trace, WRONG_SPEED, in_tool_axes,
};
use crate::cutting::measured::leak::high_pass;
use crate::cutting::measured::teeth::{
    CERTAIN, TwiceOverOnce, fewer_teeth, idle_tooth, one_tooth_alone, other_than_listed, parts_of_turn,
    tooth_back_mm, tooth_passing_too_weak, uneven_chip_mm,
};
use crate::cutting::measured::uneven_teeth::UnevenTeeth;
use crate::cutting::measured::whole_record::WholeRecord;
use crate::cutting::waveform::MillingCut;
use crate::data::{ChannelRole, Cut, CutGeometry, Process, Sample, TimeRecord, Tool};
use crate::signal::{
    self, Air, Clipping, Phases, SignalBlocks, Spindle, ToothLine, find_faults, find_phases, fit_drift,
    highest_order, tooth_line, whole_revolutions,
};
use crate::text::figures;
use crate::{Error, InputError, Result};

/// Points of a [`Trace`].
const TRACE_POINTS: usize = 1000;
const CHANNEL_MISSING: &str = "channel missing or not usable";
const CHANNEL_DEAD: &str = "channel dead (one value throughout) and left out: check plug and amplifier";
const CHANNEL_BROKEN: &str = "channel holds values that are no numbers and is left out";
const CLIPPED: &str = "clipped, so that the true forces are larger: the channel is left out of this cut; choose a larger range \
     at the amplifier and cut again";
const CLIPPED_ELSEWHERE: &str = "clipped outside the steady window: averages are not touched, but choose a larger range at the \
     amplifier";
const PASSES: &str = "the tool leaves the work in between, so that the record holds several passes: the longest is taken; passes of one \
     depth and feed are cuts of one kind, others need a cut each in the campaign, with steady_s = [from, to] to choose the pass";
const LEVELS: &str = "the force steps from one level to another within the cut, as where depth, engagement or feed change: the longest \
     stretch at one level is taken; give steady_s = [from, to] where the stated depth, engagement and feed hold";
const UNSTEADY_CUT: &str = "the force changes over the steady window: a slow entry or exit, a depth that changes, or wear; look at \
     the record and give steady_s = [from, to]";
const IDLE_TOOTH: &str = "the teeth cut very unevenly, once per turn instead of once per tooth: one is missing or chipped, the runout \
     is as large as the feed per tooth, or [tool] teeth or spindle_rpm is wrong; a tooth that does not cut leaves its edge force out, so that the edge \
     coefficients come out low by its share";
const FEWER_PARTS: &str = "the forces come back several times per turn, but less often than the stated teeth pass, as a tool with fewer \
     teeth makes them, or the stated teeth at another speed: check [tool] teeth and spindle_rpm (and the feed per tooth \
     that goes with them); averages cannot tell that, and coefficients are wrong by the same factor. Where both are right, the teeth \
     alternate (tooth_radius_offset_mm or pitch_deg in [tool] take it into account)";
/// Unevenness over that of one tooth cutting alone that no error of the directions explains (power).
const MORE_THAN_ONE_TOOTH: f64 = 2.0;
const TOOTH_STANDS_BACK: &str = "one tooth cuts less than the others and the next one more, as no offset of the tool's axis makes it: \
     chipped, worn or set low, or the teeth stand at uneven angles; near the ends of the immersion it does not cut, so that the edge \
     coefficients come out low (tooth_radius_offset_mm or pitch_deg in [tool] take it into account)";
const TEETH_DIFFER: &str = "the teeth cut unevenly: the tool runs out, or one of them is chipped or set low; near the ends of the \
     immersion the lower one does not cut, so that the edge coefficients come out low (tooth_radius_offset_mm in [tool] takes it into \
     account)";
const OTHER_TEETH: &str = "the teeth do not cut as pitch_deg and tooth_radius_offset_mm of [tool] have it, so that coefficients come out \
     wrong, those of the edge most: look at the teeth; the lists go in the order in which they cut, a radius of 0 is that of a tooth that \
     stands like the first";
const FEW_SAMPLES: &str = "few samples for each tooth: averages and coefficients hold, but what a tooth does in its pass is not in the \
     record, and without an anti-aliasing filter what lies above half the sampling rate comes back as other lines; 20 and more show it";
const ROTATING: &str = "Fx and Fy turn with the tool, as those of a dynamometer in the spindle do: their averages over a turn are nearly \
     nothing and give no coefficients; turn them back into the direction of the feed by the spindle's angle before, or use Fz and Mz alone";
/// Samples for each tooth below which it is told.
const SAMPLES_PER_TOOTH: f64 = 10.0;
/// A force that turns with the tool: its parts differ by this share, and are this near to a quarter of a turn apart (cosine of the
/// angle), its mean is this share of it, and the air has this share.
const TURNING_ALIKE: f64 = 0.1;
const TURNING_QUARTER: f64 = 0.15;
const TURNING_MEAN: f64 = 0.1;
const TURNING_IN_AIR: f64 = 0.3;
const IMPOSSIBLE: &str = "no machine tool bears such a load: the unit or the gain of the channel is wrong, or its values are no forces \
     (unit and gain in a [[channel]] of campaign.toml)";
/// N (torques: N·m).
const LARGEST_LOAD: f64 = 1e6;
const SHORT_WINDOW: &str = "steady window shorter than 5 revolutions";
const SPIKES: &str = "revolutions with spikes left out of the average";
const WRONG_DURATION: &str = "the hole took another time than feed, speed and depth say: check them";

/// Reads what one record says about one cut.
///
/// # Errors
/// The record is unreadable, too short, holds no usable force channel, or no steady cut is found.
pub fn analyse_cut<S: Sample>(
    trials: &CuttingTrials,
    cut_index: usize,
    record: &TimeRecord<S>,
) -> Result<CutAnalysis> {
    let (tool, cut) = (trials.tool, &trials.cuts[cut_index]);
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
    let mut usable: Vec<UsableChannel<S>> = whole.into_iter().map(|(channel, _)| channel).collect();
    let all: Vec<UsableChannel<S>> = usable
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

    let carrying = ForceAxis::of(cut.geometry.process());
    let carriers: Vec<(ForceAxis, &[S])> = usable
        .iter()
        .filter(|c| carrying.contains(&c.0))
        .map(|c| (c.0, c.2))
        .collect();
    let (air, is_short) = believable_air(
        &carriers,
        rate,
        record.start_s,
        &phases.air,
        &steady,
        cut.geometry.process(),
        60.0 / cut.spindle_rpm,
        &mut notices,
    );
    let phases = Phases { air, ..phases };
    if !phases.passes.is_empty() {
        let each = phases.passes.iter().map(|pass| {
            let [from, to] = seconds(pass);
            format!("{from:.2} to {to:.2} s")
        });
        notices.push(Notice {
            kind: PASSES,
            detail: each.collect::<Vec<_>>().join(", "),
        });
    }
    if let Some(all) = &phases.levels {
        let ([from, to], [taken, end]) = (seconds(all), seconds(&steady));
        notices.push(Notice {
            kind: LEVELS,
            detail: format!("{taken:.2} to {end:.2} s of {from:.2} to {to:.2} s"),
        });
    }
    let mut channels: Vec<ChannelAnalysis> = usable
        .iter()
        .map(|&(axis, name, values)| {
            let mut drift = fit_drift(values, rate, record.start_s, &phases.air);
            if is_short {
                drift.hold_back(0.0);
            }
            let mean = average(values, &steady, samples_per_revolution, &drift, record);
            if mean.dropped > 0 {
                notices.push(Notice {
                    kind: SPIKES,
                    detail: format!("{} on {}", mean.dropped, axis.label()),
                });
            }
            ChannelAnalysis {
                name: name.to_string(),
                axis,
                drift,
                mean,
                whole: WholeRecord::of(values, &phases.air),
                trace: trace(values, record),
            }
        })
        .collect();
    let contact = match cut.geometry {
        CutGeometry::Turning { .. } => contact(&channels, &usable, &steady, samples_per_revolution, record),
        CutGeometry::Milling { .. } | CutGeometry::Drilling { .. } => None,
    };
    if let Some(contact) = contact {
        at_full_contact(&mut channels, contact);
        notices.push(Notice {
            kind: INTERRUPTED,
            detail: format!("{:.1} % of the turn in the air", 100.0 * (1.0 - contact.share)),
        });
    }
    for channel in &channels {
        let mean = channel.mean.average.value;
        if mean.abs() > LARGEST_LOAD {
            notices.push(Notice {
                kind: IMPOSSIBLE,
                detail: format!(
                    "{}: {} {} on average",
                    channel.axis.label(),
                    figures(mean, 3),
                    channel.axis.unit()
                ),
            });
        }
    }
    let own: Vec<&ChannelAnalysis> = channels.iter().filter(|c| carrying.contains(&c.axis)).collect();
    let cutting_s = phases.cutting.len() as f64 / rate;
    air_notices(&phases.air, &own, samples as f64 / rate, cutting_s, &mut notices);
    if let (Some(before), Some(after)) = (&phases.air.before, &phases.air.after) {
        let told = carriers.iter().filter_map(|(axis, values)| {
            high_pass(
                axis.label(),
                values,
                [before, &steady, after],
                (samples_per_revolution, rate),
            )
        });
        notices.extend(told);
    }
    let pass = phases.passes.iter().find(|p| p.contains(&steady.start));
    let of_cut = steady.len() as f64 / pass.unwrap_or(&phases.cutting).len().max(1) as f64;
    let change = unsteady_notice(
        &usable,
        &channels,
        &steady,
        if of_cut < 0.5 && !steady_given && phases.levels.is_none() {
            STILL_ENTERING
        } else {
            UNSTEADY
        },
        samples_per_revolution,
        record,
        &mut notices,
    );
    for channel in &mut channels {
        let average = &mut channel.mean.average;
        average.std_error = average.std_error.hypot(STILL_TO_COME * change * average.value);
    }
    if revolutions < 4.999 {
        notices.push(Notice {
            kind: SHORT_WINDOW,
            detail: format!("{revolutions:.1}"),
        });
    }
    let tooth_line = match cut.geometry {
        CutGeometry::Milling { .. } => {
            // A torque has another unit; it speaks where it is alone.
            let forces = || usable.iter().filter(|c| c.0 != ForceAxis::Mz);
            let alone = forces().next().is_none();
            let own: Vec<&[S]> = usable
                .iter()
                .filter(|c| alone || c.0 != ForceAxis::Mz)
                .map(|c| &c.2[steady.clone()])
                .collect();
            tooth_line(&own, rate, cut.spindle_rpm / 60.0, tool.teeth)
        }
        CutGeometry::Drilling { .. } => {
            duration_notice(cut, tool, &phases, rate, &mut notices);
            None
        }
        // One edge that never leaves the work: no line to judge the speed by.
        CutGeometry::Turning { .. } => None,
    };
    let per_tooth = samples_per_revolution / tool.teeth.max(1) as f64;
    if cut.geometry.process() == Process::Milling && per_tooth < SAMPLES_PER_TOOTH {
        notices.push(Notice {
            kind: FEW_SAMPLES,
            detail: figures(per_tooth, 2),
        });
    }
    let mut of_turn = None;
    let mut passes_times = None;
    if let Some(line) = tooth_line.filter(ToothLine::speed_is_doubtful) {
        passes_times = Some(60.0 * line.tooth_hz / (cut.spindle_rpm * tool.teeth.max(1) as f64));
        notices.push(Notice {
            kind: WRONG_SPEED,
            detail: wrong_speed(&line, cut.spindle_rpm, tool.teeth.max(1)),
        });
    } else {
        // At a wrong speed the orders are no orders of the turn, and say nothing of the teeth.
        of_turn = turn_orders(trials, cut, &channels, &usable, &phases, record);
        if let Some(of_turn) = &of_turn {
            let twice = of_turn.twice_as_often();
            let fewer = of_turn.fewer_teeth();
            teeth_notice(of_turn, twice.as_ref(), fewer, cut, &mut notices);
            let fewer = fewer.map(|teeth| teeth as f64 / of_turn.milling.teeth as f64);
            passes_times = twice.map(|_| 2.0).or(fewer);
        }
    }
    Ok(CutAnalysis {
        cut: cut_index,
        id: cut.id.clone(),
        process: cut.geometry.process(),
        spindle_rpm: cut.spindle_rpm,
        cutting_speed_m_per_min: cutting_speed_m_per_min(
            cut_diameter_mm(tool, &cut.geometry),
            cut.spindle_rpm,
        ),
        feed_mm: feed_mm(&cut.geometry),
        record_s: seconds(&(0..samples)),
        air_before_s: phases.air.before.as_ref().map(seconds),
        air_after_s: phases.air.after.as_ref().map(seconds),
        steady_s: seconds(&steady),
        steady_given,
        revolutions,
        contact_share: contact.map_or(1.0, |c| c.share),
        averages: in_tool_axes(trials.tool_from_dyno, &channels),
        channels,
        tooth_line,
        passes_times,
        uneven_teeth: of_turn
            .filter(|_| passes_times.is_none())
            .and_then(|of_turn| of_turn.uneven_teeth()),
        spindle: None,
        notices,
    })
}

/// Part of the steady window that may be clipped without much harm.
const CLIPPED_AT_MOST: f64 = 1e-3;
/// Is so much of the channel clipped in the steady window that its average is wrong?
fn is_spoilt<S: Sample>(
    channel: &UsableChannel<S>,
    clipping: &Clipping,
    steady: &Range<usize>,
    record: &TimeRecord<S>,
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
    } else if (as_teeth / teeth as f64 - 0.5).abs() < 0.005 {
        ", or it chatters so that every second tooth cuts alike".to_string()
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

type UsableChannel<'a, S> = (ForceAxis, &'a str, &'a [S]);

fn usable_channels<'a, S: Sample>(
    record: &'a TimeRecord<S>,
    process: Process,
    notices: &mut Vec<Notice>,
) -> Vec<UsableChannel<'a, S>> {
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
        if !values.iter().all(|v| v.value().is_finite()) {
            notices.push(notice(CHANNEL_BROKEN));
        } else if values.iter().all(|v| Some(v) == values.first()) {
            notices.push(notice(CHANNEL_DEAD));
        } else {
            usable.push((axis, channel.name.as_str(), values));
        }
    }
    usable
}

fn phases<S: Sample>(
    cut: &Cut,
    tool: &Tool,
    record: &TimeRecord<S>,
    usable: &[UsableChannel<S>],
    samples_per_revolution: f64,
) -> Result<(Phases, bool)> {
    let rate = record.sample_rate_hz;
    let entry = DrillGeometry::new(tool, &cut.geometry).ok().and_then(|g| {
        let feed_mm_per_s = g.feed_per_rev_mm * cut.spindle_rpm / 60.0;
        (feed_mm_per_s > 0.0).then(|| g.entry_travel_mm() / feed_mm_per_s * rate)
    });
    // A drill's side forces say nothing of its engagement.
    let carriers = ForceAxis::of(cut.geometry.process());
    let mut carrying: Vec<&[S]> = usable
        .iter()
        .filter(|c| carriers.contains(&c.0))
        .map(|c| c.2)
        .collect();
    if carrying.is_empty() {
        carrying = usable.iter().map(|c| c.2).collect();
    }
    let spindle = Spindle {
        samples_per_revolution,
        sample_rate_hz: rate,
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
    Ok((
        Phases {
            air,
            cutting,
            passes: Vec::new(),
            levels: None,
            steady,
        },
        true,
    ))
}

/// How much of each turn a turning edge cuts, by the channel that carries most of the force; `None` where it stays in the work, or no air
/// tells the zero.
fn contact<S: Sample>(
    channels: &[ChannelAnalysis],
    usable: &[UsableChannel<S>],
    steady: &Range<usize>,
    samples_per_turn: f64,
    record: &TimeRecord<S>,
) -> Option<TurnContact> {
    let forces = channels
        .iter()
        .zip(usable)
        .filter(|(c, _)| c.axis != ForceAxis::Mz);
    let size = |c: &ChannelAnalysis| c.mean.average.value.abs();
    let (channel, (_, _, values)) = forces.max_by(|a, b| size(a.0).total_cmp(&size(b.0)))?;
    if !(channel.drift.air_before || channel.drift.air_after) {
        return None;
    }
    let time = |i: usize| record.start_s + i as f64 / record.sample_rate_hz;
    let above: Vec<f64> = steady
        .clone()
        .map(|i| values[i].value() - channel.drift.at(time(i)))
        .collect();
    interrupted(&above, samples_per_turn)
}

/// Change of the force over the steady window that is worth telling, as a part of it.
const UNSTEADY: f64 = 0.05;
/// The same where the window is less than half of the cut: what came before is a slow entry, which such a change shows not to be over.
const STILL_ENTERING: f64 = 0.015;

/// Of a change that is told, this part of the force is uncertain: it may go on, or have been another before.
const STILL_TO_COME: f64 = 0.5;

/// Does the force (root mean square about zero, turn by turn) change over the window? Without air its fluctuation does. The change as a
/// part of the force where it is told, else zero.
fn unsteady_notice<S: Sample>(
    usable: &[UsableChannel<S>],
    channels: &[ChannelAnalysis],
    steady: &Range<usize>,
    worth_telling: f64,
    samples_per_revolution: f64,
    record: &TimeRecord<S>,
    notices: &mut Vec<Notice>,
) -> f64 {
    let mut squares: Vec<f64> = Vec::new();
    for ((axis, _, values), channel) in usable.iter().zip(channels) {
        if *axis == ForceAxis::Mz {
            continue;
        }
        let has_zero = channel.drift.air_before || channel.drift.air_after;
        let zero = |i: usize| {
            channel
                .drift
                .at(record.start_s + i as f64 / record.sample_rate_hz)
        };
        let compensated = |i: usize| values[steady.start + i].value() - zero(steady.start + i);
        let turns = SignalBlocks::of(steady.len(), compensated, samples_per_revolution);
        squares.resize(turns.len(), 0.0);
        for (k, square) in squares.iter_mut().enumerate() {
            let level = if has_zero { turns.mean[k] } else { 0.0 };
            *square += turns.std_dev[k].powi(2) + level * level;
        }
    }
    let loudness: Vec<f64> = squares.into_iter().map(f64::sqrt).collect();
    let change = signal::change(&loudness);
    if change.abs() <= worth_telling {
        return 0.0;
    }
    notices.push(Notice {
        kind: UNSTEADY_CUT,
        detail: format!("by {:+.0} %", 100.0 * change),
    });
    change
}

/// Orders of a longer window are taken from its start.
const MOST_SAMPLES: usize = 1 << 17;

/// Are the orders of the turn no stronger than what lies between them? `over_noise`: their powers over those of their noise, which
/// has one on average and is exponentially distributed.
fn is_noise(over_noise: &[f64]) -> bool {
    let count = over_noise.len() as f64;
    let highest = over_noise.iter().copied().fold(0.0, f64::max);
    // Noise exceeds either bound once in a thousand records.
    let mean = over_noise.iter().sum::<f64>() / count;
    count > 0.0 && highest < count.ln() + 7.0 && mean < 1.0 + 3.5 / count.sqrt()
}

/// What comes back once per turn in the forces along tool axes x and y.
struct TurnOrders {
    milling: MillingCut,
    /// Orders from 1 on, N.
    orders: [Vec<Complex64>; 2],
    /// Standard deviation of each, N.
    std: [Vec<f64>; 2],
    /// N; above the zero where `zero_is_known`.
    mean: [f64; 2],
    zero_is_known: bool,
    /// Powers of all channels over those of their noise.
    over_noise: Vec<f64>,
    /// The same orders in the air, added up over the channels: what turns with the spindle and is no tooth, N².
    air_power: Vec<f64>,
}

impl TurnOrders {
    /// Whether the forces are those of axes that turn with the tool: a force that stands still there goes round once per turn, and
    /// leaves no mean. Runout leaves the mean of the teeth, an unbalanced spindle shows in the air.
    fn turns_with_the_tool(&self) -> bool {
        let [x, y] = [0, 1].map(|axis| self.orders[axis].first().copied().unwrap_or_default());
        let size = 0.5 * (x.norm() + y.norm());
        let noise = [0, 1].map(|axis| self.std[axis].first().copied().unwrap_or(f64::INFINITY));
        let in_air = self.air_power.first().copied().unwrap_or(0.0).sqrt();
        // Of a coefficient the line has twice the size.
        size > CERTAIN * noise[0].hypot(noise[1])
            && (x.norm() - y.norm()).abs() < TURNING_ALIKE * size
            && (x * y.conj()).re.abs() < TURNING_QUARTER * size * size
            && self.zero_is_known
            && self.mean[0].hypot(self.mean[1]) < TURNING_MEAN * 2.0 * size
            && in_air < TURNING_IN_AIR * size
    }

    /// The line at twice the stated tooth passing is stronger than any cut of the stated teeth makes it.
    fn twice_as_often(&self) -> Option<TwiceOverOnce> {
        if !self.shows_teeth() {
            return None;
        }
        let (orders, std) = self.lines();
        tooth_passing_too_weak(
            &self.milling,
            orders,
            std,
            self.zero_is_known.then_some(self.mean),
        )
    }

    /// Orders by axis, and their standard deviations.
    fn lines(&self) -> ([&[Complex64]; 2], [&[f64]; 2]) {
        (
            self.orders.each_ref().map(Vec::as_slice),
            self.std.each_ref().map(Vec::as_slice),
        )
    }

    /// Whether their values say anything of teeth that are taken for alike.
    fn shows_teeth(&self) -> bool {
        self.milling.places.is_empty() && !is_noise(&self.over_noise) && !self.turns_with_the_tool()
    }

    /// The forces come back as often per turn as a tool with fewer teeth makes them.
    fn fewer_teeth(&self) -> Option<usize> {
        let (orders, std) = self.lines();
        let found = || fewer_teeth(&self.milling, orders, std, self.mean, self.zero_is_known);
        self.shows_teeth().then(found).flatten()
    }

    /// Where the teeth are not listed one by one.
    fn uneven_teeth(&self) -> Option<UnevenTeeth> {
        if !self.milling.places.is_empty() || is_noise(&self.over_noise) {
            return None;
        }
        let (orders, std) = self.lines();
        let known = (self.mean, self.zero_is_known);
        let chip_mm = uneven_chip_mm(&self.milling, orders, std, known, &self.air_power)?;
        Some(UnevenTeeth::new(&self.milling, chip_mm))
    }
}

/// `None` where a channel is missing, or the tooth passing was not sampled.
fn turn_orders<S: Sample>(
    trials: &CuttingTrials,
    cut: &Cut,
    channels: &[ChannelAnalysis],
    usable: &[UsableChannel<S>],
    phases: &Phases,
    record: &TimeRecord<S>,
) -> Option<TurnOrders> {
    let milling = MillingCut::new(trials.tool, &cut.geometry)?;
    let rate = record.sample_rate_hz;
    let steady = &phases.steady;
    let window = steady.start..steady.end.min(steady.start + MOST_SAMPLES);
    let per_turn = rate * 60.0 / cut.spindle_rpm;
    if highest_order(per_turn, milling.teeth) < milling.teeth {
        return None;
    }
    // Twice the tooth passing tells of half the true speed, where it was sampled.
    let highest = highest_order(per_turn, 2 * milling.teeth);
    let longest_air = [&phases.air.before, &phases.air.after]
        .into_iter()
        .flatten()
        .max_by_key(|r| r.len());
    let mut air_power = vec![0.0; highest];
    let mut of_channel = |axis: ForceAxis| -> Option<(signal::OrderSpectrum, f64, bool)> {
        let values = usable.iter().find(|c| c.0 == axis)?.2;
        let channel = channels.iter().find(|c| c.axis == axis)?;
        let spectrum = signal::order_spectrum(&values[window.clone()], rate, per_turn, highest)?;
        let in_air = longest_air.and_then(|air| {
            let air = air.start..air.end.min(air.start + MOST_SAMPLES);
            signal::order_spectrum(&values[air], rate, per_turn, highest)
        });
        for (sum, own) in air_power
            .iter_mut()
            .zip(in_air.iter().flat_map(|s| &s.coefficient))
        {
            *sum += own.norm_sqr();
        }
        let has_zero = channel.drift.air_before || channel.drift.air_after;
        Some((spectrum, channel.mean.average.value, has_zero))
    };
    let recorded = [ForceAxis::X, ForceAxis::Y, ForceAxis::Z].map(&mut of_channel);
    let mut orders = [0, 1].map(|_| vec![Complex64::ZERO; highest]);
    let mut variance = [0, 1].map(|_| vec![0.0; highest]);
    let (mut mean, mut zero_is_known) = ([0.0; 2], true);
    for (axis, row) in trials.tool_from_dyno.iter().take(2).enumerate() {
        for (weight, channel) in row.iter().zip(&recorded).filter(|(w, _)| **w != 0.0) {
            let (own, value, has_zero) = channel.as_ref()?;
            for (sum, o) in orders[axis].iter_mut().zip(&own.coefficient) {
                *sum += o * *weight;
            }
            for (sum, s) in variance[axis].iter_mut().zip(&own.std) {
                *sum += (s * weight).powi(2);
            }
            mean[axis] += weight * value;
            zero_is_known &= has_zero;
        }
    }
    let over_noise = recorded.iter().flatten().flat_map(|(own, ..)| {
        let each = own.coefficient.iter().zip(&own.std);
        each.map(|(c, std)| c.norm_sqr() / (std * std))
    });
    let over_noise = over_noise.collect();
    let std = variance.map(|v| v.into_iter().map(f64::sqrt).collect());
    Some(TurnOrders {
        milling,
        orders,
        std,
        mean,
        zero_is_known,
        over_noise,
        air_power,
    })
}

fn teeth_notice(
    of_turn: &TurnOrders,
    twice: Option<&TwiceOverOnce>,
    fewer: Option<usize>,
    cut: &Cut,
    notices: &mut Vec<Notice>,
) {
    if is_noise(&of_turn.over_noise) {
        notices.push(Notice {
            kind: NOTHING_REPEATS,
            detail: String::new(),
        });
        return;
    }
    if of_turn.turns_with_the_tool() {
        notices.push(Notice {
            kind: ROTATING,
            detail: String::new(),
        });
        return;
    }
    let (milling, mean, zero_is_known) = (&of_turn.milling, of_turn.mean, of_turn.zero_is_known);
    let (orders, std) = of_turn.lines();
    if !milling.places.is_empty() {
        let other = other_than_listed(milling, orders, std, mean, zero_is_known);
        if let Some(other) = other {
            notices.push(Notice {
                kind: OTHER_TEETH,
                detail: format!(
                    "the part of the force that comes back once per turn is {} N, by the list {} N{}",
                    figures(other.measured, 2),
                    figures(other.listed, 2),
                    if other.is_reversed {
                        "; counted the other way round, its teeth agree: list them in the order in which they cut"
                    } else {
                        ""
                    }
                ),
            });
        }
        return;
    }
    if let Some(slow) = twice {
        notices.push(Notice {
            kind: OTHER_MULTIPLE,
            detail: format!(
                "the line at twice the tooth-passing frequency of {} rpm × {} teeth is {} times as strong as that at the frequency \
                 itself, and a cut of this immersion makes it {} times at most: as if the spindle ran at {} rpm, or the tool had {} \
                 teeth",
                cut.spindle_rpm,
                milling.teeth,
                figures(slow.measured, 2),
                figures(slow.at_most, 2),
                2.0 * cut.spindle_rpm,
                2 * milling.teeth
            ),
        });
        return;
    }
    // So many parts of a turn are the teeth, or the turns.
    let fewer_parts = |parts: usize, turns: f64| Notice {
        kind: FEWER_PARTS,
        detail: format!(
            "{parts} times per turn of {} rpm: as {parts} teeth, or {} at {} rpm",
            cut.spindle_rpm,
            milling.teeth,
            figures(cut.spindle_rpm * turns, 4)
        ),
    };
    if let Some(teeth) = fewer {
        notices.push(fewer_parts(teeth, teeth as f64 / milling.teeth as f64));
        return;
    }
    if let Some(part) = idle_tooth(milling, orders, mean, zero_is_known) {
        let n = milling.teeth as f64;
        let strongest = (1..milling.teeth)
            .max_by(|a, b| {
                let power = |k: usize| orders.iter().map(|o| o[k - 1].norm_sqr()).sum::<f64>();
                power(*a).total_cmp(&power(*b))
            })
            .unwrap_or(1);
        let power: f64 = orders.iter().map(|o| o[strongest - 1].norm_sqr()).sum();
        let noise: f64 = std.iter().map(|s| s[strongest - 1].powi(2)).sum();
        let stands_out = power > CERTAIN * CERTAIN * noise;
        let notice = if stands_out && part > MORE_THAN_ONE_TOOTH * one_tooth_alone(milling.teeth) {
            Notice {
                kind: OTHER_MULTIPLE,
                detail: format!(
                    "the line at {strongest} times {} rpm is stronger against that at {} times than one single cutting tooth of {} \
                     would make it: as if the spindle ran at {} rpm",
                    cut.spindle_rpm,
                    milling.teeth,
                    milling.teeth,
                    figures(cut.spindle_rpm * strongest as f64 / n, 4)
                ),
            }
        } else {
            Notice {
                kind: IDLE_TOOTH,
                detail: format!("{:.0} % of what a missing tooth makes", 100.0 * part),
            }
        };
        notices.push(notice);
        return;
    }
    if let Some(parts) = parts_of_turn(milling.teeth, orders, std, zero_is_known) {
        notices.push(fewer_parts(parts, parts as f64));
        return;
    }
    let back = tooth_back_mm(milling, orders, std, mean, zero_is_known);
    if let Some(back) = back {
        notices.push(Notice {
            kind: if milling.teeth < 4 {
                TEETH_DIFFER
            } else {
                TOOTH_STANDS_BACK
            },
            detail: format!("by about {} mm", figures(back, 2)),
        });
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
    // Of pecks, what is drilled again and again between them is not known.
    if !phases.passes.is_empty() {
        return;
    }
    let took_s = phases.cutting.len() as f64 / rate;
    // A dwell at the bottom is usual; half the time again is not.
    if expected_s.is_finite() && !(0.9..1.5).contains(&(took_s / expected_s)) {
        notices.push(Notice {
            kind: WRONG_DURATION,
            detail: format!("{took_s:.2} s against {expected_s:.2} s"),
        });
    }
}

fn trace<S: Sample>(values: &[S], record: &TimeRecord<S>) -> Trace {
    let stretch = values.len().div_ceil(TRACE_POINTS).max(1);
    let mut trace = Trace {
        time_s: Vec::new(),
        min: Vec::new(),
        max: Vec::new(),
    };
    for (k, part) in values.chunks(stretch).enumerate() {
        let middle = (k * stretch) as f64 + 0.5 * (part.len() - 1) as f64;
        trace.time_s.push(record.start_s + middle / record.sample_rate_hz);
        let (min, max) = signal::least_and_greatest(part);
        trace.min.push(min);
        trace.max.push(max);
    }
    trace
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    /// Orders of `turns` turns of noise, with a line of `line` N (noise: 20 N) at order 4, over their noise.
    fn over_noise(seed: u64, turns: usize, line: f64) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let samples: Vec<f64> = (0..turns * 250)
            .map(|i| {
                let angle = std::f64::consts::TAU * 4.0 * i as f64 / 250.0;
                20.0 * crate::statistics::nearly_normal(&mut random) + line * angle.sin()
            })
            .collect();
        let spectrum = signal::order_spectrum(&samples, 5000.0, 250.0, 8).unwrap();
        let each = spectrum.coefficient.iter().zip(&spectrum.std);
        each.map(|(c, std)| c.norm_sqr() / (std * std)).collect()
    }

    #[test]
    fn noise_repeats_with_no_turn_and_a_line_in_it_does() {
        let of_noise = (0..200)
            .filter(|seed| is_noise(&over_noise(*seed, 60, 0.0)))
            .count();
        assert!(of_noise >= 196, "{of_noise} of 200");
        for seed in 0..50 {
            assert!(!is_noise(&over_noise(seed, 60, 5.0)), "{seed}");
        }
        assert!(!is_noise(&[]));
    }

    use crate::cutting::made_tools::{drill, endmill};
    use crate::cutting::measured::cut_analysis::Average;
    use crate::data::{Channel, Immersion};
    use approx::assert_relative_eq;
    use std::f64::consts::TAU;

    const RATE_HZ: f64 = 2000.0;
    const AS_IT_IS: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    /// `seconds` of x, y, z and torque at 2 kHz with noise of 1 N and a zero that rises from 5 N by 1 N/s.
    fn record(seconds: f64, seed: u64, force: impl Fn(f64) -> [f64; 4]) -> TimeRecord {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let roles = [
            ChannelRole::ForceX,
            ChannelRole::ForceY,
            ChannelRole::ForceZ,
            ChannelRole::TorqueZ,
        ];
        let mut channels = roles.map(|role| Channel {
            name: format!("{role:?}"),
            file_unit: "N".into(),
            role,
            samples: Vec::new(),
        });
        for i in 0..(seconds * RATE_HZ) as usize {
            let t = i as f64 / RATE_HZ;
            for (channel, value) in channels.iter_mut().zip(force(t)) {
                let noise = crate::statistics::nearly_normal(&mut random);
                channel.samples.push(value + 5.0 + t + noise);
            }
        }
        TimeRecord {
            sample_rate_hz: RATE_HZ,
            start_s: 10.0,
            channels: channels.into(),
            filled: Vec::new(),
        }
    }

    fn cut(geometry: CutGeometry) -> Cut {
        Cut {
            id: "a".into(),
            file: "a.csv".into(),
            spindle_rpm: 1200.0,
            geometry,
            order: None,
            steady_s: None,
            material: None,
            outcome: None,
            posture: None,
            line: 1,
        }
    }

    fn read(tool: &Tool, cut: &Cut, dyno: &[[f64; 3]; 3], record: &TimeRecord) -> CutAnalysis {
        let trials = CuttingTrials {
            tool,
            cuts: std::slice::from_ref(cut),
            tool_from_dyno: dyno,
            material: None,
            orthogonal: None,
        };
        analyse_cut(&trials, 0, record).unwrap()
    }

    fn kinds(analysis: &CutAnalysis) -> Vec<&'static str> {
        analysis.notices.iter().map(|n| n.kind).collect()
    }

    /// From 1 s to 4 s of 5 s.
    fn cutting(t: f64) -> bool {
        (1.0..4.0).contains(&t)
    }

    /// A bar of 40 mm turned at 1200 1/min: 151 m/min, and forces above a zero that drifts by 3 N while it cuts.
    #[test]
    fn a_turned_cut_is_read_with_its_air_and_its_means() {
        let bar = cut(CutGeometry::Turning {
            feed_per_rev_mm: 0.2,
            depth_of_cut_mm: 1.5,
            diameter_mm: 40.0,
        });
        let force = [300.0, 150.0, 900.0, 0.0];
        let record = record(5.0, 1, |t| if cutting(t) { force } else { [0.0; 4] });
        let analysis = read(&endmill(0.4, 95.0), &bar, &AS_IT_IS, &record);
        assert_relative_eq!(analysis.cutting_speed_m_per_min, 150.8, max_relative = 1e-3);
        assert_eq!((analysis.feed_mm, analysis.record_s), (0.2, [10.0, 15.0]));
        for (average, truth) in analysis.averages.iter().zip(force).take(3) {
            let average = average.unwrap();
            assert!(
                (average.value - truth).abs() < 5.0 * average.std_error,
                "{average:?} for {truth}"
            );
            // 1 N of noise over some 3 s, and the line through 2 s of air.
            assert!((0.008..0.1).contains(&average.std_error), "{average:?}");
        }
        let ([_, before], [after, _]) = (analysis.air_before_s.unwrap(), analysis.air_after_s.unwrap());
        let [from, to] = analysis.steady_s;
        assert!(
            before > 10.8 && before <= 11.0 && (14.0..14.2).contains(&after),
            "{before} {after}"
        );
        assert!(
            (11.0..11.3).contains(&from) && (13.7..14.01).contains(&to),
            "{from} {to}"
        );
        assert_relative_eq!(analysis.revolutions, 20.0 * (to - from), max_relative = 1e-9);
        assert!(kinds(&analysis).is_empty(), "{:?}", analysis.notices);
        // Middles and ends of the stretches that are drawn: ten samples each.
        let trace = &analysis.channels[0].trace;
        assert_eq!(trace.time_s.len(), 1000);
        assert_relative_eq!(trace.time_s[100], 10.0 + 1004.5 / RATE_HZ, max_relative = 1e-12);
        let samples = &record.channels[0].samples[1000..1010];
        assert_eq!(trace.max[100], samples.iter().copied().fold(f64::MIN, f64::max));
        assert_eq!(trace.min[100], samples.iter().copied().fold(f64::MAX, f64::min));
    }

    /// A force that grows by a quarter while it cuts, and one of a mean near zero whose ripple does.
    #[test]
    fn a_cut_that_changes_is_told() {
        let bar = cut(CutGeometry::Turning {
            feed_per_rev_mm: 0.2,
            depth_of_cut_mm: 1.5,
            diameter_mm: 40.0,
        });
        let told = |growth: f64| {
            let factor = move |t: f64| 1.0 + growth * (t - 1.0) / 3.0;
            let record = record(5.0, 2, |t| {
                if cutting(t) {
                    [300.0, 150.0, 900.0, 0.0].map(|f| f * factor(t))
                } else {
                    [0.0; 4]
                }
            });
            let analysis = read(&endmill(0.4, 95.0), &bar, &AS_IT_IS, &record);
            let told = analysis.notices.iter().find(|n| n.kind == UNSTEADY_CUT);
            // What is told is uncertain by half of it.
            let Average { value, std_error } = analysis.averages[2].unwrap();
            let part = if told.is_some() { growth / 3.0 } else { 0.0 };
            assert!((std_error / value - part).abs() < 0.01, "{std_error} of {value}");
            told.map(|n| n.detail.clone())
        };
        // The last third against the first: two thirds of the growth.
        assert_eq!(told(0.3).as_deref(), Some("by +17 %"));
        assert_eq!(told(0.1).as_deref(), Some("by +6 %"));
        assert_eq!(told(0.05), None);
    }

    fn slot() -> Cut {
        cut(CutGeometry::Milling {
            feed_per_tooth_mm: 0.1,
            axial_depth_mm: 2.0,
            immersion: Immersion::SLOT,
        })
    }

    fn straight_mill() -> Tool {
        Tool {
            helix_deg: 0.0,
            ..endmill(0.0, 90.0)
        }
    }

    /// A slot milled by two teeth of a straight edge; `share`: of the common chip that each tooth takes.
    fn milled(share: [f64; 2]) -> impl Fn(f64) -> [f64; 4] {
        move |t| {
            if !cutting(t) {
                return [0.0; 4];
            }
            let mut force = [0.0; 4];
            for (tooth, share) in share.iter().enumerate() {
                let phi = (TAU * (20.0 * t + 0.5 * tooth as f64)).rem_euclid(TAU);
                if phi < std::f64::consts::PI {
                    let (tangential, radial) =
                        (1600.0 * 0.1 * share * phi.sin(), 500.0 * 0.1 * share * phi.sin());
                    force[0] -= tangential * phi.cos() + radial * phi.sin();
                    force[1] += tangential * phi.sin() - radial * phi.cos();
                    force[2] += 0.3 * tangential;
                }
            }
            force
        }
    }

    /// A missing tooth leaves its chip to the other; on a dynamometer that lies the other way round it is missing as well.
    #[test]
    fn a_tooth_that_does_not_cut_is_told_whatever_way_the_dynamometer_lies() {
        let (slot, tool) = (slot(), straight_mill());
        // Recorded x is the tool's y, recorded y its −x.
        let turned = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], AS_IT_IS[2]];
        for share in [[1.0, 1.0], [0.0, 2.0]] {
            let made = milled(share);
            let plain = read(&tool, &slot, &AS_IT_IS, &record(5.0, 3, &made));
            let other = read(
                &tool,
                &slot,
                &turned,
                &record(5.0, 3, |t| {
                    let [x, y, z, m] = made(t);
                    [y, -x, z, m]
                }),
            );
            for analysis in [plain, other] {
                let idle = analysis.notices.iter().find(|n| n.kind == IDLE_TOOTH);
                match share[0] {
                    0.0 => assert_eq!(idle.unwrap().detail, "100 % of what a missing tooth makes"),
                    _ => assert!(analysis.notices.is_empty(), "{:?}", analysis.notices),
                }
                // Of a slot: the mean of y is N a c K_t / 4, that of x minus N a c K_r / 4; N = 2, a K_t = 1600 N/mm.
                let mean = |axis: usize| analysis.averages[axis].unwrap().value;
                assert_relative_eq!(mean(1), 80.0, max_relative = 0.01);
                assert_relative_eq!(mean(0), -25.0, max_relative = 0.01);
            }
        }
    }

    /// Forces as a dynamometer in the spindle records them; runout, which leaves the mean, and a plain slot are none.
    #[test]
    fn forces_that_turn_with_the_tool_are_told() {
        let (slot, tool) = (slot(), straight_mill());
        for (share, turns) in [([1.0, 1.0], true), ([1.0, 1.0], false), ([0.7, 1.3], false)] {
            let made = milled(share);
            let analysis = read(
                &tool,
                &slot,
                &AS_IT_IS,
                &record(5.0, 4, |t| {
                    let [x, y, z, m] = made(t);
                    let (sin, cos) = (TAU * 20.0 * t + 0.3).sin_cos();
                    match turns {
                        true => [x * cos + y * sin, y * cos - x * sin, z, m],
                        false => [x, y, z, m],
                    }
                }),
            );
            assert_eq!(
                kinds(&analysis).contains(&ROTATING),
                turns,
                "{share:?} {:?}",
                analysis.notices
            );
        }
    }

    #[test]
    fn few_samples_a_tooth_are_told() {
        let mut slot = slot();
        let made = record(5.0, 5, milled([1.0, 1.0]));
        let mut told = |rpm: f64| {
            slot.spindle_rpm = rpm;
            let analysis = read(&endmill(0.0, 90.0), &slot, &AS_IT_IS, &made);
            let notice = analysis.notices.iter().find(|n| n.kind == FEW_SAMPLES);
            notice.map(|n| n.detail.clone())
        };
        // 2 kHz over two teeth.
        assert_eq!(told(6300.0).as_deref(), Some("9.5"));
        assert_eq!(told(5700.0), None);
    }

    /// A hole 14 mm deep at 4 mm/s, its entry of 1.6 mm included, takes 3.9 s.
    #[test]
    fn a_hole_that_takes_another_time_is_told() {
        let told = |depth: f64, seconds: f64| {
            let hole = cut(CutGeometry::Drilling {
                feed_per_rev_mm: 0.2,
                pilot_diameter_mm: 0.0,
                hole_depth_mm: Some(depth),
            });
            let record = record(seconds + 2.0, 4, |t| {
                let part = ((t - 1.0) / 0.4).clamp(0.0, 1.0);
                let part = if t < 1.0 + seconds { part } else { 0.0 };
                [0.0, 0.0, 800.0 * part, 60.0 * part]
            });
            kinds(&read(&drill(), &hole, &AS_IT_IS, &record)).contains(&WRONG_DURATION)
        };
        assert!(!told(14.0, 3.9));
        // A dwell at the bottom is usual, half the time again is not; nor is a hole that is over too early.
        assert!(!told(14.0, 5.0));
        assert!(told(14.0, 6.3));
        assert!(told(14.0, 3.2));
    }

    /// Where the steady cut is given, in times of the record, it is taken in whole turns; where it is not in the record, refused.
    #[test]
    fn a_steady_window_that_is_given_is_taken() {
        let mut bar = cut(CutGeometry::Turning {
            feed_per_rev_mm: 0.2,
            depth_of_cut_mm: 1.5,
            diameter_mm: 40.0,
        });
        let record = record(5.0, 1, |t| {
            if cutting(t) {
                [300.0, 150.0, 900.0, 0.0]
            } else {
                [0.0; 4]
            }
        });
        bar.steady_s = Some([12.0, 13.02]);
        let tool = endmill(0.4, 95.0);
        let analysis = read(&tool, &bar, &AS_IT_IS, &record);
        assert!(analysis.steady_given);
        assert_relative_eq!(
            analysis.steady_s[1] - analysis.steady_s[0],
            1.0,
            max_relative = 1e-9
        );
        assert_relative_eq!(analysis.revolutions, 20.0, max_relative = 1e-9);
        bar.steady_s = Some([12.0, 12.2]);
        let short = read(&tool, &bar, &AS_IT_IS, &record);
        assert_eq!(kinds(&short), [SHORT_WINDOW]);
        bar.steady_s = Some([14.0, 16.0]);
        let trials = CuttingTrials {
            tool: &tool,
            cuts: &[bar],
            tool_from_dyno: &AS_IT_IS,
            material: None,
            orthogonal: None,
        };
        assert!(analyse_cut(&trials, 0, &record).is_err());
    }
}
