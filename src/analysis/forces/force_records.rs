//! A campaign's force records: read from their files and handed to [`crate::cutting`] as plain values.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use crate::analysis::workbench::Workbench;
use crate::campaign::Campaign;
use crate::cutting::{
    CfcOptions, CfcResult, CutAnalysis, CuttingTrials, Notice, RecordReading, RecordSlips, analyse_in_step,
    contradicts_speed, fit_force_coefficients, none_usable, repair_record,
};
use crate::data::{Cut, Process, Sample};
use crate::identify::forces::cutting_data::{CutData, processes};
use crate::ingest::{self, Digest, ForceFile, TimeFile, TimeRecord};
use crate::progress::Progress;
use crate::{Error, InputError, Result};

/// What the reader noticed about the file.
const READER: &str = "noticed while reading the file";

/// What was cut in a campaign.
///
/// # Errors
/// No tool.
pub fn cutting_trials(campaign: &Campaign) -> Result<CuttingTrials<'_>> {
    let tool = campaign
        .tool
        .as_ref()
        .ok_or_else(|| Error::computation("[tool] is missing: cutting forces need its teeth and diameter"))?;
    Ok(CuttingTrials {
        tool,
        cuts: &campaign.cuts,
        tool_from_dyno: &campaign.dynamometer.tool_from_dyno,
        material: campaign.material.as_deref(),
        orthogonal: campaign.orthogonal,
    })
}

/// The record of one cut, bad samples replaced, and what its owner should know.
struct ReadRecord<S = f64> {
    record: TimeRecord<S>,
    notices: Vec<Notice>,
    digest: Digest,
}

impl<S: Sample> ReadRecord<S> {
    fn of(file: TimeFile<S>, campaign: &Campaign, cut: usize) -> Self {
        let mut record = file.record;
        let mut notices = repair_record(&mut record, campaign.cuts[cut].spindle_rpm);
        let noticed = |detail| Notice { kind: READER, detail };
        notices.extend(file.warnings.into_iter().map(noticed));
        ReadRecord {
            record,
            notices,
            digest: file.digest,
        }
    }

    /// What it says, in step with the stated speed.
    fn reading(self, campaign: &Campaign, cut: usize) -> Result<RecordReading<S>> {
        analyse_in_step(&cutting_trials(campaign)?, cut, self.record, self.notices)
    }

    /// Averages and waveform of a cut.
    fn told(self, campaign: &Campaign, cut: usize) -> Told {
        let digest = Some(self.digest);
        match self.reading(campaign, cut) {
            Ok(reading) => {
                let waveform = waveform(campaign, cut, &reading);
                (Ok(reading.analysis), waveform, digest)
            }
            Err(error) => (Err(error.clone()), Err(error), digest),
        }
    }
}

/// Averages and waveform of a cut, and what identifies the file.
type Told = (Result<CutAnalysis>, Result<Waveform>, Option<Digest>);

/// A cut's forces as `compare` and `diagnose` look at them, and what their owner should know.
pub type Waveform = (CutData, Vec<Notice>);

/// What the force records of a campaign say, cut by cut in the order of `campaign.toml`.
pub struct ForceRecords {
    /// Averages over turns, or why there are none.
    pub averages: Vec<Result<CutAnalysis>>,
    /// Waveforms, or why there are none.
    pub waveforms: Vec<Result<Waveform>>,
    /// Cuts whose files, of different names, hold the same record.
    pub copies: Vec<Copied>,
    /// What is wrong with the records or the list of the cuts, by process.
    slips: Vec<(Process, RecordSlips)>,
}

/// The record of one cut that stands under another one's name as well.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Copied {
    /// Both cuts, by index into `Campaign::cuts`, ascending.
    pub cuts: [usize; 2],
    /// The one that it is not of: it contradicts the speed stated for that, or counts already. `None` where that cannot be told.
    pub not_of: Option<usize>,
}

/// Records that several files hold.
fn copies(cuts: &[Cut], digests: &[Option<Digest>], averages: &[Result<CutAnalysis>]) -> Vec<Copied> {
    let mut found: Vec<Copied> = Vec::new();
    for (b, second) in averages.iter().enumerate() {
        let Ok(second) = second else { continue };
        let first = averages[..b].iter().enumerate().find_map(|(a, first)| {
            let first = first.as_ref().ok()?;
            let is_copy = digests[a] == digests[b]
                && cuts[a].file != cuts[b].file
                && first.is_same_stretch(second)
                && !found.iter().any(|f| f.not_of == Some(a));
            is_copy.then_some((a, first))
        });
        let Some((a, first)) = first else { continue };
        let alike = cuts[a].geometry == cuts[b].geometry && cuts[a].spindle_rpm == cuts[b].spindle_rpm;
        let not_of = match [first, second].map(|cut| cut.notices.iter().any(contradicts_speed)) {
            [true, false] => Some(a),
            [false, true] => Some(b),
            _ => alike.then_some(b),
        };
        found.push(Copied { cuts: [a, b], not_of });
    }
    found
}

/// What is wrong with the records of each process. Copies left out already have no record any more.
fn slips(campaign: &Campaign, averages: &[Result<CutAnalysis>]) -> Vec<(Process, RecordSlips)> {
    let Ok(trials) = cutting_trials(campaign) else {
        return Vec::new();
    };
    let of = |process: Process| {
        let records: Vec<&CutAnalysis> = averages
            .iter()
            .flatten()
            .filter(|r| r.process == process)
            .collect();
        (process, RecordSlips::of(&trials, &records))
    };
    processes(&campaign.cuts).into_iter().map(of).collect()
}

impl ForceRecords {
    /// What is wrong with the records of a process.
    pub fn slips(&self, process: Process) -> RecordSlips {
        let found = self.slips.iter().find(|(own, _)| *own == process);
        found.map(|(_, slips)| slips.clone()).unwrap_or_default()
    }

    /// Each record is read once (in parallel, one record in memory per thread; long ones few at a time), however often this is
    /// asked for.
    pub fn of(campaign: &Workbench) -> Arc<Self> {
        campaign
            .known()
            .unwrap_or_else(|| campaign.keep(Self::read(campaign)))
    }

    fn read(campaign: &Workbench) -> Self {
        let plain: &Campaign = campaign;
        let progress = Progress::new("force records", plain.cuts.len());
        let one = |cut: usize| {
            let own = &plain.cuts[cut];
            let told = match ingest::read_forces_with(&own.file, &plain.channel_rules(&own.id)) {
                Ok(ForceFile::Short(file)) => ReadRecord::of(file, plain, cut).told(plain, cut),
                Ok(ForceFile::Long(file)) => ReadRecord::of(file, plain, cut).told(plain, cut),
                Err(error) => (Err(error.clone()), Err(error), None),
            };
            progress.step();
            told
        };
        let bytes = |cut: &Cut| std::fs::metadata(&cut.file).map_or(0, |m| m.len());
        let sizes: Vec<u64> = plain.cuts.iter().map(bytes).collect();
        let mut read: Vec<Told> = Vec::new();
        for batch in batches(&sizes) {
            read.par_extend(batch.into_par_iter().map(one));
        }
        let (mut averages, mut waveforms, mut digests) = (Vec::new(), Vec::new(), Vec::new());
        for (average, waveform, digest) in read {
            averages.push(average);
            waveforms.push(waveform);
            digests.push(digest);
        }
        campaign.records_were_read(&digests);
        let copies = copies(&plain.cuts, &digests, &averages);
        for Copied { cuts: both, not_of } in &copies {
            for cut in both.iter().filter(|cut| not_of.is_none_or(|one| one == **cut)) {
                let other = both[usize::from(both[0] == *cut)];
                let error = Error::from(
                    InputError::new(format!(
                        "its file holds the same record as that of cut {}",
                        plain.cuts[other].id
                    ))
                    .file(&plain.cuts[*cut].file)
                    .remedy("export this cut's own record, or take the cut out of campaign.toml"),
                );
                averages[*cut] = Err(error.clone());
                waveforms[*cut] = Err(error);
            }
        }
        let slips = slips(plain, &averages);
        for (id, why, remedy) in slips.iter().flat_map(|(_, slips)| slips.left_out()) {
            let Some(cut) = plain.cuts.iter().position(|cut| cut.id == id) else {
                continue;
            };
            let error = Error::from(InputError::new(why).file(&plain.cuts[cut].file).remedy(remedy));
            averages[cut] = Err(error.clone());
            waveforms[cut] = Err(error);
        }
        ForceRecords {
            averages,
            waveforms,
            copies,
            slips,
        }
    }
}

/// Bytes of files whose records are held in memory at once, unless a single one has more.
const AT_ONCE: u64 = 512 << 20;

/// Files of these `sizes` in stretches of at most [`AT_ONCE`] bytes.
fn batches(sizes: &[u64]) -> Vec<Range<usize>> {
    let mut batches: Vec<Range<usize>> = Vec::new();
    let mut held = 0;
    for (i, size) in sizes.iter().enumerate() {
        match batches.last_mut() {
            Some(last) if held + size <= AT_ONCE => {
                last.end = i + 1;
                held += size;
            }
            _ => {
                batches.push(i..i + 1);
                held = *size;
            }
        }
    }
    batches
}

fn waveform<S: Sample>(campaign: &Campaign, cut: usize, reading: &RecordReading<S>) -> Result<Waveform> {
    let tool = cutting_trials(campaign)?.tool;
    let (record, analysis) = (&reading.record, &reading.analysis);
    let data = CutData::new(tool, (cut, &campaign.cuts[cut]), record, analysis)?;
    Ok((data, analysis.notices.clone()))
}

/// Puts an error that names no file into the campaign's, at its cuts where it names no key.
pub(super) fn in_campaign_file(error: Error, campaign: &Workbench) -> Error {
    match error {
        Error::Input(input) if input.file.is_none() => {
            let key = input.key.clone().unwrap_or_else(|| "cut".to_owned());
            input.file(campaign.dir.join("campaign.toml")).key(key).into()
        }
        other => other,
    }
}

/// Fits the coefficients to the averages of every cut. A cut that cannot be used is left out with a warning that names it.
///
/// # Errors
/// No cuts, no tool, or not one usable record.
pub fn identify_forces(campaign: &Workbench, options: CfcOptions) -> Result<CfcResult> {
    if campaign.cuts.is_empty() {
        return Err(
            InputError::new("the campaign has no [[cut]]: nothing to identify cutting forces from")
                .file(campaign.dir.join("campaign.toml"))
                .key("cut")
                .remedy("add [[cut]] tables that name the force records")
                .into(),
        );
    }
    let outcomes = ForceRecords::of(campaign).averages.clone();
    let result = match cutting_trials(campaign) {
        Ok(trials) => fit_force_coefficients(&trials, outcomes, options),
        // Without a tool no record could be analysed.
        Err(_) => Err(none_usable(
            campaign.cuts.len(),
            outcomes.into_iter().find_map(Result::err),
        )),
    };
    result.map_err(|error| in_campaign_file(error, campaign))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::forces::made_force_records::{
        CUT_S, MadeCut, MadeTool, TRUTH, write_campaign, write_campaign_of,
    };
    use crate::cutting::{OTHER_SPEED, WRONG_SPEED, analyse_cut};
    use crate::data::CutGeometry;
    use crate::identify::CuttingData;
    use std::f64::consts::TAU;

    fn slots<const N: usize>(rpm: f64, feeds_mm: [f64; N], speed: &dyn Fn(f64) -> f64) -> [MadeCut<'_>; N] {
        feeds_mm.map(|feed_mm| MadeCut { rpm, feed_mm, speed })
    }

    /// Largest relative error of a cutting coefficient.
    fn worst(result: &CfcResult) -> f64 {
        let off = result.pooled[0].coefficients.iter().zip(TRUTH);
        off.take(3)
            .map(|(c, truth)| (c.value.unwrap() / truth - 1.0).abs())
            .fold(0.0, f64::max)
    }

    fn read_record(campaign: &Campaign, cut: usize) -> Result<ReadRecord> {
        let own = &campaign.cuts[cut];
        match ingest::read_forces_with(&own.file, &campaign.channel_rules(&own.id))? {
            ForceFile::Short(file) => Ok(ReadRecord::of(file, campaign, cut)),
            ForceFile::Long(_) => panic!("{} is short", own.id),
        }
    }

    #[test]
    fn few_long_records_are_in_memory_at_once() {
        let mb = |sizes: &[u64]| batches(&sizes.iter().map(|mb| mb << 20).collect::<Vec<u64>>());
        assert_eq!(mb(&[]), Vec::<Range<usize>>::new());
        assert_eq!(mb(&[1; 40]), vec![0..40]);
        assert_eq!(mb(&[300, 200, 300, 900, 1, 511]), vec![0..2, 2..3, 3..4, 4..6]);
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
                let read = read_record(&campaign, i)?;
                analyse_cut(&cutting_trials(&campaign)?, i, &read.record)
            });
            let trials = cutting_trials(&campaign).unwrap();
            let before = fit_force_coefficients(&trials, before.collect(), CfcOptions::default()).unwrap();
            let after = identify_forces(&Workbench::new(&campaign), CfcOptions::default()).unwrap();
            eprintln!("{name}: {:.4} before, {:.4} after", worst(&before), worst(&after));
            assert!(worst(&after) < 0.01, "{name}: {}", worst(&after));
            for cut in &after.cuts {
                let found = cut
                    .spindle
                    .as_ref()
                    .unwrap_or_else(|| panic!("{name}, cut {}", cut.id));
                eprintln!("  {}: {found:?}", cut.id);
                assert!((found.offset - offset).abs() < 5e-4, "{name}: {found:?}");
                assert!((found.droop - droop).abs() < 2e-3, "{name}: {found:?}");
                assert!(
                    (found.wander - wander).abs() < 0.2 * wander + 3e-4,
                    "{name}: {found:?}"
                );
                assert!(found.in_step[1] > 0.97 && found.in_step[0] < found.in_step[1]);
                assert!(!cut.notices.iter().any(|n| n.kind == WRONG_SPEED));
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
    fn from_a_speed_that_is_far_off_nothing_is_concluded() {
        let told = |speed: &dyn Fn(f64) -> f64| {
            let dir = tempfile::tempdir().unwrap();
            let cuts = slots(1200.0, [0.05, 0.1, 0.16], speed);
            let campaign = write_campaign(dir.path(), &cuts, &|_, _, _, _, _| 0.0);
            let bench = Workbench::new(&campaign);
            let warnings = identify_forces(&bench, CfcOptions::default()).unwrap().warnings;
            let data = CuttingData::on(&bench, Process::Milling).unwrap();
            (warnings, data.speed_is_contradicted)
        };
        let (warnings, contradicted) = told(&|_| 1.15);
        assert!(contradicted);
        assert!(
            warnings
                .iter()
                .any(|w| w.contains("cut 01: 1380 rpm and not 1200")),
            "{warnings:?}"
        );
        let (warnings, contradicted) = told(&|_| 1.0);
        assert!(!contradicted, "{warnings:?}");
        assert!(
            !warnings.iter().any(|w| w.contains("rpm and not")),
            "{warnings:?}"
        );
    }

    /// Slots of two speeds, their files changed by `change` (text of cut 02 or of all), and the campaign by `list`.
    fn told_of(
        change: &dyn Fn(&str) -> String,
        which: &[usize],
        list: &dyn Fn(&mut Campaign),
    ) -> (CuttingData, Vec<crate::discrepancy::setup::SetupFinding>, bool) {
        let dir = tempfile::tempdir().unwrap();
        let cuts: Vec<MadeCut> = [
            (1200.0, 0.05),
            (1200.0, 0.1),
            (1200.0, 0.16),
            (1700.0, 0.08),
            (1700.0, 0.12),
        ]
        .map(|(rpm, feed_mm)| MadeCut {
            rpm,
            feed_mm,
            speed: &|_| 1.0,
        })
        .into();
        let mut campaign = write_campaign(dir.path(), &cuts, &|_, _, _, _, _| 0.0);
        for &cut in which {
            let file = &campaign.cuts[cut].file;
            let text = std::fs::read_to_string(file).unwrap();
            std::fs::write(file, change(&text)).unwrap();
        }
        list(&mut campaign);
        let data = CuttingData::on(&Workbench::new(&campaign), Process::Milling).unwrap();
        let check = crate::discrepancy::setup::examine_cutting(&data, || None).unwrap();
        let likely = check.likely().is_some();
        (data, check.findings, likely)
    }

    #[test]
    fn records_and_lists_that_contradict_each_other_are_named_before_anything_is_fitted() {
        let as_it_is = |text: &str| text.to_string();
        let unchanged = |_: &mut Campaign| {};
        let all = [0, 1, 2, 3, 4];
        let clean = told_of(&as_it_is, &[], &unchanged);
        assert_eq!((clean.0.cuts.len(), clean.1), (5, Vec::new()));

        // The air of the first half second again and again.
        let nothing_cut = |text: &str| {
            let lines: Vec<&str> = text.lines().collect();
            let row = |(i, line): (usize, &&str)| {
                let time = line.split(',').next().unwrap_or_default();
                let air = lines[1 + (i - 1) % 2000].split_once(',').map_or("", |row| row.1);
                format!("{time},{air}\n")
            };
            lines[0].to_string() + "\n" + &lines.iter().enumerate().skip(1).map(row).collect::<String>()
        };
        let (data, found, likely) = told_of(&nothing_cut, &[1], &unchanged);
        assert_eq!(
            (found.len(), found[0].kind, found[0].place.as_str()),
            (1, "no-cutting", "cut 02")
        );
        assert!(data.cuts.len() == 4 && !likely, "{found:?}");

        let typed_wrong = |campaign: &mut Campaign| campaign.cuts[2].spindle_rpm = 1200.0 / 1.285;
        let (data, found, likely) = told_of(&as_it_is, &[], &typed_wrong);
        assert_eq!(
            (found.len(), found[0].kind, found[0].place.as_str()),
            (1, "spindle-speed", "cut 03")
        );
        assert!((found[0].value.unwrap() / 1200.0 - 1.0).abs() < 1e-3, "{found:?}");
        assert!(data.cuts.len() == 4 && !likely, "{found:?}");

        // (Of more teeth than there are some may not cut.)
        for teeth in [2, 3] {
            let other_tool = |campaign: &mut Campaign| campaign.tool.as_mut().unwrap().teeth = teeth;
            let (_, found, likely) = told_of(&as_it_is, &[], &other_tool);
            assert_eq!(
                (found[0].kind, found[0].value),
                ("teeth", Some(4.0)),
                "{teeth}: {found:?}"
            );
            assert!(likely);
        }

        let absolute = |text: &str| text.replace(",-", ",");
        let (_, found, likely) = told_of(&absolute, &all, &unchanged);
        assert_eq!((found.len(), found[0].kind), (1, "rectified"), "{found:?}");
        assert!(likely && found[0].place.starts_with("all cuts, Fx"), "{found:?}");
        let (data, found, likely) = told_of(&absolute, &[3], &unchanged);
        assert_eq!((found.len(), found[0].kind), (1, "rectified"), "{found:?}");
        assert!(
            data.cuts.len() == 4 && !likely && found[0].place.starts_with("cut 04, Fx"),
            "{found:?}"
        );
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
            let as_read = read_record(&campaign, i).unwrap().record;
            let reading = read_record(&campaign, i).unwrap().reading(&campaign, i).unwrap();
            assert_eq!(reading.analysis.spindle, None, "cut {i}");
            let samples = |record: &TimeRecord| record.channels[0].samples.clone();
            assert_eq!(samples(&reading.record), samples(&as_read));
        }
    }

    #[test]
    fn what_wanders_is_put_in_step_and_told_by_diagnose() {
        type Speed = (&'static dyn Fn(f64) -> f64, Option<f64>);
        // Root mean square by which the tool is early or late, rad of its turn: ∫ 2π n ε sin(2πft) dt has the amplitude n ε / f.
        let speeds: [Speed; 3] = [
            (&|_| 1.0, None),
            (&|_| 1.007, None),
            (
                &|t| 1.0 + 0.01 * (TAU * 1.3 * t).sin(),
                Some(20.0 * 0.01 / 1.3 * std::f64::consts::FRAC_1_SQRT_2),
            ),
        ];
        for (speed, varies) in speeds {
            let dir = tempfile::tempdir().unwrap();
            let cuts = slots(1200.0, [0.05, 0.1, 0.16], speed);
            let campaign = write_campaign(dir.path(), &cuts, &|_, _, _, _, _| 0.0);
            let data = CuttingData::on(&Workbench::new(&campaign), Process::Milling).unwrap();
            let check = crate::discrepancy::setup::examine_cutting(&data, || None).unwrap();
            let found = check
                .findings
                .iter()
                .find(|f| f.kind == "spindle-speed-variation");
            assert_eq!(found.is_some(), varies.is_some(), "{:?}", check.findings);
            assert_eq!(check.likely(), None);
            // Nothing else is missing; what was taken out has no name in the library.
            let verdict = match varies {
                Some(_) => crate::discrepancy::DiagnosisVerdict::Unknown,
                None => crate::discrepancy::DiagnosisVerdict::None,
            };
            let told = crate::analysis::CuttingFindings::run(&campaign, crate::identify::Options::default())
                .unwrap();
            assert_eq!(told.diagnosis.verdict, verdict, "{varies:?}");
            assert!(told.lead.is_none());
            if let (Some(found), Some(rad)) = (found, varies) {
                let value = found.value.unwrap();
                assert!((value / rad - 1.0).abs() < 0.2, "{value} {rad}");
            }
        }
    }

    /// From the stated speed down by a tenth: the mean is further off than a wrong number would be believed to be.
    #[test]
    fn a_spindle_that_gives_way_by_a_tenth_is_followed() {
        let dir = tempfile::tempdir().unwrap();
        // The speed counts from the middle of the cut.
        let cuts = slots(1200.0, [0.05, 0.1, 0.16], &|t| 0.95 - 0.1 * t / CUT_S);
        let campaign = write_campaign(dir.path(), &cuts, &|_, _, _, _, _| 0.0);
        let found = identify_forces(&Workbench::new(&campaign), CfcOptions::default()).unwrap();
        for (own, truth) in found.pooled[0].coefficients.iter().zip(TRUTH) {
            let (value, std) = (own.value.unwrap(), own.std_error.unwrap());
            assert!(
                (value - truth).abs() < 4.0 * std,
                "{}: {value} ± {std}",
                own.label
            );
            assert!(
                (value / truth - 1.0).abs() < 0.06,
                "{}: {value} ± {std}",
                own.label
            );
        }
        for cut in &found.cuts {
            let track = cut.spindle.as_ref().unwrap();
            assert!(
                (track.offset + 0.05).abs() < 0.01 && (track.droop + 0.1).abs() < 0.03,
                "{track:?}"
            );
        }
        assert!(
            !found
                .warnings
                .iter()
                .any(|w| w.contains("sampling rate in the files is wrong"))
        );
    }

    #[test]
    fn blind_campaigns_are_left_as_they_are() {
        for name in ["force-9400", "force-9439"] {
            let dir = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
                .join("tests/data/blind")
                .join(name);
            let campaign = Campaign::load(&dir).unwrap();
            for i in 0..campaign.cuts.len() {
                let reading = read_record(&campaign, i).unwrap().reading(&campaign, i).unwrap();
                assert_eq!(reading.analysis.spindle, None, "{name}, cut {i}");
            }
        }
    }

    const BALL: MadeTool = MadeTool {
        corner_radius_mm: 5.0,
        runout_mm: 0.0,
        exponents: [0.0; 3],
    };

    /// 2 mm deep a ball of 10 mm is 8 mm wide: a side of the work 4.3 mm from the axis stays out of its reach, one 3.5 mm from it does not.
    #[test]
    fn a_cut_in_which_a_ball_touches_nothing_is_told() {
        for (start_deg, told) in [
            (f64::acos(-0.86).to_degrees(), true),
            (f64::acos(-0.7).to_degrees(), false),
        ] {
            let dir = tempfile::tempdir().unwrap();
            let cuts = slots(1500.0, [0.04, 0.08, 0.12], &|_| 1.0);
            let mut campaign = write_campaign_of(dir.path(), BALL, &cuts, &|_, _, _, _, _| 0.0);
            let CutGeometry::Milling { immersion, .. } = &mut campaign.cuts[1].geometry else {
                unreachable!()
            };
            immersion.start_rad = start_deg.to_radians();
            let warnings = identify_forces(&Workbench::new(&campaign), CfcOptions::default())
                .unwrap()
                .warnings;
            let of_it =
                |w: &String| w.starts_with("cut 02: by the stated engagement the tool touches nothing");
            assert_eq!(warnings.iter().any(of_it), told, "{start_deg}: {warnings:?}");
        }
    }

    /// A ball end that runs out, a law of the chip with an exponent for each direction, and nothing of the kind: named with their sizes,
    /// and the coefficients are those of the metal.
    #[test]
    fn what_a_ball_end_and_its_metal_do_is_named() {
        let out = MadeTool {
            runout_mm: 0.012,
            ..BALL
        };
        let kienzle = MadeTool {
            exponents: [0.26, 0.4, 0.32],
            ..BALL
        };
        for (tool, named, sizes) in [
            (BALL, None, vec![]),
            (out, Some("runout"), vec![0.012]),
            (kienzle, Some("size-effect"), kienzle.exponents.to_vec()),
        ] {
            let dir = tempfile::tempdir().unwrap();
            let cuts = slots(1500.0, [0.03, 0.06, 0.1, 0.16], &|_| 1.0);
            let campaign = write_campaign_of(dir.path(), tool, &cuts, &|_, _, _, _, _| 0.0);
            let found = crate::analysis::CuttingFindings::run(&campaign, crate::identify::Options::default())
                .unwrap();
            let winner = found.diagnosis.winner();
            let name = winner.map(|w| w.name.effect.as_str());
            assert_eq!(name, named, "{:?}", found.diagnosis.confidence);
            for (parameter, truth) in winner.iter().flat_map(|w| &w.parameters).zip(&sizes) {
                let off = (parameter.value - truth).abs();
                assert!(off < 0.05 * truth, "{parameter:?} for {truth}");
            }
        }
    }

    /// Slots with a ball end: the radial force has an axial part, so that all six coefficients depend on each other.
    #[test]
    fn a_ball_end_gives_back_its_coefficients() {
        let dir = tempfile::tempdir().unwrap();
        let cuts = slots(1500.0, [0.04, 0.08, 0.12, 0.16], &|_| 1.0);
        let campaign = write_campaign_of(dir.path(), BALL, &cuts, &|_, _, _, _, _| 0.0);
        let result = identify_forces(&Workbench::new(&campaign), CfcOptions::default()).unwrap();
        let found = &result.pooled[0];
        for (coefficient, truth) in found.coefficients.iter().zip(TRUTH) {
            let (value, std) = (coefficient.value.unwrap(), coefficient.std_error.unwrap());
            assert!((value - truth).abs() < 4.0 * std, "{value} ± {std} for {truth}");
            assert!(std < 0.02 * truth.max(50.0), "± {std} of {truth}");
        }
        assert!(found.r2.iter().flatten().all(|r2| *r2 > 0.999));
        assert!(result.warnings.is_empty(), "{:?}", result.warnings);
        // Taken for a straight end mill the radial force comes out a third too small.
        let straight = write_campaign_of(dir.path(), MadeTool::default(), &[], &|_, _, _, _, _| 0.0);
        let wrong = Campaign {
            tool: straight.tool,
            ..campaign
        };
        let wrong = identify_forces(&Workbench::new(&wrong), CfcOptions::default()).unwrap();
        assert!(wrong.pooled[0].coefficients[1].value.unwrap() < 0.7 * TRUTH[1]);
    }
}
