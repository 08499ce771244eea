//! Records of a spindle that does not keep the stated speed, put in step with it, so that whole turns are turns by angle.

use crate::Result;
use crate::cutting::cutting_trials::CuttingTrials;
use crate::cutting::force_model::force_axis::{ForceAxis, axis_of};
use crate::cutting::measured::cut_analysis::{CutAnalysis, Notice};
use crate::cutting::measured::jump::put_jumps_right;
use crate::cutting::measured::record::analyse_cut;
use crate::data::{Process, Sample, TimeRecord, Tool};
use crate::signal::{SpindleTrack, spindle_track};
use crate::text::figures;

pub(crate) const OTHER_SPEED: &str = "the spindle did not keep the stated speed: turns are averaged by the angle that the forces show; \
     correct spindle_rpm (and the feed per tooth that goes with it), and look why it changes \
     under load";

/// What one record says, put in step with the stated speed.
pub struct RecordReading<S = f64> {
    /// Averages over turns, windows and notices; with the track of a spindle that did not keep the stated speed.
    pub analysis: CutAnalysis,
    /// The record in step: all changes of the speed are taken out.
    pub record: TimeRecord<S>,
}

/// Puts the record of one cut in step with the stated speed and reads it. `notices`: what is known of the record already.
///
/// # Errors
/// Those of [`analyse_cut`].
pub fn analyse_in_step<S: Sample>(
    trials: &CuttingTrials,
    index: usize,
    record: TimeRecord<S>,
    mut notices: Vec<Notice>,
) -> Result<RecordReading<S>> {
    let mut analysis = analyse_cut(trials, index, &record)?;
    let mut record = record;
    if let Some(jumped) = put_jumps_right(&mut record, &analysis) {
        notices.push(jumped);
        analysis = analyse_cut(trials, index, &record)?;
    }
    if let Some(found) = followed(trials.tool, &analysis, &record) {
        let file = &trials.cuts[index].file;
        notices.push(Notice {
            kind: OTHER_SPEED,
            detail: in_words(&found, &file.display().to_string(), analysis.spindle_rpm),
        });
        record = turned_evenly(record, &found);
        analysis = analyse_cut(trials, index, &record)?;
        analysis.spindle = Some(found);
    }
    analysis.notices.extend(notices);
    Ok(RecordReading { analysis, record })
}

fn turned_evenly<S: Sample>(mut record: TimeRecord<S>, track: &SpindleTrack) -> TimeRecord<S> {
    let own = record.channels.iter_mut().filter(|c| axis_of(c.role).is_some());
    own.for_each(|channel| channel.samples = track.in_step_samples(&channel.samples));
    record
}

fn followed<S: Sample>(tool: &Tool, analysis: &CutAnalysis, record: &TimeRecord<S>) -> Option<SpindleTrack> {
    // A drill's lips make no line that could be relied on.
    if analysis.process != Process::Milling {
        return None;
    }
    let rate = record.sample_rate_hz;
    let sample = |t: f64| ((t - record.start_s) * rate).round().max(0.0) as usize;
    let [from, to] = analysis.steady_s.map(sample);
    let window = from..to.min(record.len());
    let carries = |axis: ForceAxis| analysis.channels.iter().any(|c| c.axis == axis);
    let channels: Vec<&[S]> = record
        .channels
        .iter()
        .filter(|c| axis_of(c.role).is_some_and(|axis| axis != ForceAxis::Mz && carries(axis)))
        .map(|c| c.samples.as_slice())
        .collect();
    spindle_track(&channels, &window, rate * 60.0 / analysis.spindle_rpm, tool.teeth)
}

/// `force/cut03.csv: 1200 rpm stated, 1208.40 ± 0.05 found, falls by 2.0 ± 0.1 % over the cut`.
fn in_words(track: &SpindleTrack, file: &str, stated_rpm: f64) -> String {
    let [_, droops, wanders] = track.told();
    // A part in a million is a rounding error that happens to stand above its own.
    let droops = droops && track.droop.abs() > 1e-6;
    let wanders = wanders && track.wander > 1e-6;
    let percent =
        |value: f64, std: f64| format!("{} ± {} %", figures(100.0 * value, 2), figures(100.0 * std, 1));
    let mut text = format!(
        "{file}: {stated_rpm} rpm stated, {:.1} ± {} found",
        stated_rpm * (1.0 + track.offset),
        figures(stated_rpm * track.offset_std, 1)
    );
    if droops {
        let way = if track.droop < 0.0 { "falls" } else { "rises" };
        text += &format!(
            ", {way} by {} over the cut",
            percent(track.droop.abs(), track.droop_std)
        );
    }
    if wanders {
        text += &format!(", wanders by {} (rms)", percent(track.wander, track.wander_std));
    }
    text
}
