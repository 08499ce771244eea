//! Records of a spindle that does not keep the stated speed, put in step with it, so that whole turns are turns by angle.

use super::cut_analysis::{CutAnalysis, Notice};
use super::faults::read_record;
use super::force_axis::{ForceAxis, axis_of};
use super::record::analyse_cut;
use crate::Result;
use crate::campaign::{Campaign, Process};
use crate::ingest::TimeRecord;
use crate::signal::{SpindleTrack, spindle_track};
use crate::text::figures;

const OTHER_SPEED: &str = "the spindle did not keep the stated speed: turns are averaged by the angle that the forces show (waveforms \
     only where it does not wander); correct spindle_rpm (and the feed per tooth that goes with it), and look why it changes \
     under load";

/// Which part of the speed's changes is taken out of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InStep {
    /// All of them: averages over turns.
    Fully,
    /// All of them, unless the speed wanders: then the record stays as it is, for `diagnose` to find that as a mistake of the
    /// setup (`spindle-speed-variation`).
    UnlessItWanders,
}

/// The record of one cut and what it says, in step with the stated speed.
///
/// # Errors
/// Those of [`read_record`] and [`analyse_cut`].
pub fn read_in_step(campaign: &Campaign, index: usize, how: InStep) -> Result<(TimeRecord, CutAnalysis)> {
    let (mut record, mut notices) = read_record(campaign, index)?;
    let mut analysis = analyse_cut(campaign, index, &record)?;
    if let Some(found) = followed(campaign, &analysis, &record) {
        let removed = match how {
            InStep::Fully => Some(found.clone()),
            InStep::UnlessItWanders => found.without_wander(),
        };
        if let Some(track) = removed {
            let own = record.channels.iter_mut().filter(|c| axis_of(c.role).is_some());
            own.for_each(|channel| channel.samples = track.in_step_samples(&channel.samples));
            analysis = analyse_cut(campaign, index, &record)?;
        }
        let file = &campaign.cuts[index].file;
        notices.push(Notice {
            kind: OTHER_SPEED,
            detail: in_words(&found, &file.display().to_string(), analysis.spindle_rpm),
        });
        analysis.spindle = Some(found);
    }
    analysis.notices.extend(notices);
    Ok((record, analysis))
}

fn followed(campaign: &Campaign, analysis: &CutAnalysis, record: &TimeRecord) -> Option<SpindleTrack> {
    // A drill's lips make no line that could be relied on.
    if analysis.process != Process::Milling {
        return None;
    }
    let teeth = campaign.tool.as_ref()?.teeth;
    let rate = record.sample_rate_hz;
    let sample = |t: f64| ((t - record.start_s) * rate).round().max(0.0) as usize;
    let [from, to] = analysis.steady_s.map(sample);
    let window = from..to.min(record.len());
    let carries = |axis: ForceAxis| analysis.channels.iter().any(|c| c.axis == axis);
    let channels: Vec<&[f64]> = record
        .channels
        .iter()
        .filter(|c| axis_of(c.role).is_some_and(|axis| axis != ForceAxis::Mz && carries(axis)))
        .map(|c| c.samples.as_slice())
        .collect();
    spindle_track(&channels, &window, rate * 60.0 / analysis.spindle_rpm, teeth)
}

/// `force/cut03.csv: 1200 rpm stated, 1208.40 ± 0.05 found, falls by 2.0 ± 0.1 % over the cut`.
fn in_words(track: &SpindleTrack, file: &str, stated_rpm: f64) -> String {
    let [_, droops, wanders] = track.told();
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutting::made_records::{CUT_S, MadeCut, TRUTH, write_campaign};
    use crate::cutting::{CfcOptions, CfcResult, from_analyses, identify_forces};
    use std::f64::consts::TAU;

    /// Largest relative error of a cutting coefficient.
    fn worst(result: &CfcResult) -> f64 {
        let off = result.pooled[0].coefficients.iter().zip(TRUTH);
        off.take(3)
            .map(|(c, truth)| (c.value.unwrap() / truth - 1.0).abs())
            .fold(0.0, f64::max)
    }

    #[test]
    fn a_speed_that_is_off_falls_or_wanders_is_told_and_taken_out() {
        type Speed = (&'static str, &'static dyn Fn(f64) -> f64, [f64; 3]);
        let speeds: [Speed; 3] = [
            ("off", &|_| 1.007, [0.007, 0.0, 0.0]),
            ("falls", &|t| 0.99 - 0.02 * t / CUT_S, [-0.01, -0.02, 0.0]),
            (
                "wanders",
                &|t| 1.0 + 0.005 * (TAU * 1.3 * t).sin(),
                [0.0, 0.0, 0.005 * std::f64::consts::FRAC_1_SQRT_2],
            ),
        ];
        for (name, speed, [offset, droop, wander]) in speeds {
            let dir = tempfile::tempdir().unwrap();
            let cuts: Vec<MadeCut> = [(1200.0, 0.05), (1200.0, 0.1), (1200.0, 0.16), (1700.0, 0.08)]
                .map(|(rpm, feed_mm)| MadeCut { rpm, feed_mm, speed })
                .into();
            let campaign = write_campaign(dir.path(), &cuts, &|_, _, _, _, _| 0.0);
            let before = (0..cuts.len()).map(|i| {
                let (record, _) = read_record(&campaign, i)?;
                analyse_cut(&campaign, i, &record)
            });
            let before = from_analyses(&campaign, before.collect(), CfcOptions::default()).unwrap();
            let after = identify_forces(&campaign, CfcOptions::default()).unwrap();
            eprintln!("{name}: {:.4} before, {:.4} after", worst(&before), worst(&after));
            assert!(worst(&after) < 0.01, "{name}: {}", worst(&after));
            for cut in &after.cuts {
                let found = cut
                    .spindle
                    .as_ref()
                    .unwrap_or_else(|| panic!("{name}, cut {}", cut.id));
                eprintln!("  {}", in_words(found, &cut.id, cut.spindle_rpm));
                assert!((found.offset - offset).abs() < 5e-4, "{name}: {found:?}");
                assert!((found.droop - droop).abs() < 2e-3, "{name}: {found:?}");
                assert!(
                    (found.wander - wander).abs() < 0.2 * wander + 3e-4,
                    "{name}: {found:?}"
                );
                assert!(found.in_step[1] > 0.97 && found.in_step[0] < found.in_step[1]);
                assert!(
                    !cut.notices
                        .iter()
                        .any(|n| n.kind == super::super::cut_analysis::WRONG_SPEED)
                );
            }
            assert!(
                after
                    .warnings
                    .iter()
                    .any(|w| w.contains(OTHER_SPEED) && w.contains("cut01.csv"))
            );
        }
    }

    #[test]
    fn ordinary_records_are_left_as_they_are() {
        let dir = tempfile::tempdir().unwrap();
        let cuts: Vec<MadeCut> = (0..20)
            .map(|i| MadeCut {
                rpm: 900.0 + 173.0 * f64::from(i),
                feed_mm: 0.04 + 0.01 * f64::from(i % 5),
                speed: &|_| 1.0,
            })
            .collect();
        // Runout, and a spindle that turns unevenly within its turn.
        let campaign = write_campaign(dir.path(), &cuts, &|cut, axis, _, angle, cutting| {
            let size = if cutting { 3.0 * cut as f64 } else { 0.0 };
            size * (angle + axis as f64).cos()
        });
        for i in 0..cuts.len() {
            let (record, analysis) = read_in_step(&campaign, i, InStep::Fully).unwrap();
            assert_eq!(analysis.spindle, None, "cut {}", analysis.id);
            let (as_read, _) = read_record(&campaign, i).unwrap();
            assert_eq!(record.channels[0].samples, as_read.channels[0].samples);
        }
    }

    #[test]
    fn what_wanders_is_left_to_diagnose() {
        type Speed = (&'static dyn Fn(f64) -> f64, bool);
        let speeds: [Speed; 2] = [
            (&|_| 1.007, false),
            (&|t| 1.0 + 0.01 * (TAU * 1.3 * t).sin(), true),
        ];
        for (speed, wanders) in speeds {
            let dir = tempfile::tempdir().unwrap();
            let cut = MadeCut {
                rpm: 1200.0,
                feed_mm: 0.1,
                speed,
            };
            let campaign = write_campaign(dir.path(), &[cut], &|_, _, _, _, _| 0.0);
            let (record, analysis) = read_in_step(&campaign, 0, InStep::UnlessItWanders).unwrap();
            assert!(analysis.spindle.is_some(), "{wanders}");
            let (as_read, _) = read_record(&campaign, 0).unwrap();
            let untouched = record.channels[0].samples == as_read.channels[0].samples;
            assert_eq!(untouched, wanders);
        }
    }

    #[test]
    fn blind_campaigns_are_left_as_they_are() {
        for name in ["force-9400", "force-9439"] {
            let dir = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
                .join("tests/data/blind")
                .join(name);
            let campaign = Campaign::load(&dir).unwrap();
            for i in 0..campaign.cuts.len() {
                let (_, analysis) = read_in_step(&campaign, i, InStep::Fully).unwrap();
                assert_eq!(analysis.spindle, None, "{name}, cut {}", analysis.id);
            }
        }
    }
}
