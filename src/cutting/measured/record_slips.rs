//! What the records of a process, held against one another and against the list of cuts, show to be wrong before anything is
//! fitted: no cut in a record, another spindle speed or number of teeth, exchanged files, lost signs.

use crate::cutting::cutting_trials::CuttingTrials;
use crate::cutting::force_model::average_force::{depth_mm, feed_mm};
use crate::cutting::force_model::force_axis::ForceAxis;
use crate::cutting::measured::cut_analysis::{ChannelAnalysis, CutAnalysis};
use crate::data::Process;
use crate::signal::median;
use crate::text::listed;

/// Slips of the list of cuts or of the files, by the ids of the cuts.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RecordSlips {
    /// Two cuts of which each ran at the speed stated for the other.
    pub exchanged: Vec<[String; 2]>,
    /// Records that hold air alone: nothing was cut.
    pub no_cutting: Vec<String>,
    /// Single cuts that did not run at the stated speed.
    pub other_speed: Vec<OtherSpeed>,
    /// All milled cuts alike.
    pub common_passing: Option<CommonPassing>,
    /// Channels of which absolute values were recorded.
    pub rectified: Vec<Rectified>,
    /// Cuts that were looked at.
    pub count: usize,
}

/// A cut whose teeth pass at another frequency than stated.
#[derive(Debug, Clone, PartialEq)]
pub struct OtherSpeed {
    /// Id of the cut.
    pub cut: String,
    /// Spindle speed in campaign.toml, 1/min.
    pub stated_rpm: f64,
    /// The speed that the forces show, 1/min.
    pub ran_rpm: f64,
    /// Feed per tooth in campaign.toml, mm.
    pub feed_mm: f64,
}

/// Teeth that pass so many times as often as stated in every cut.
#[derive(Debug, Clone, PartialEq)]
pub struct CommonPassing {
    /// True over stated frequency.
    pub ratio: f64,
    /// The stated number of teeth.
    pub stated_teeth: usize,
    /// The true one, where that alone explains it.
    pub teeth: Option<usize>,
    /// A cut and the speed it ran at, 1/min, where the teeth are right.
    pub example: (String, f64),
}

/// A record with absolute values.
#[derive(Debug, Clone, PartialEq)]
pub struct Rectified {
    /// Id of the cut.
    pub cut: String,
    /// `Fx`, `Mz`, …
    pub channels: Vec<String>,
}

/// Ratios of a tooth passing to the stated one that are nearer than this are one: so far a motor slips under load.
const ALIKE: f64 = 0.01;

impl RecordSlips {
    /// `records`: of one process.
    pub fn of(trials: &CuttingTrials, records: &[&CutAnalysis]) -> Self {
        let exchanged = exchanged(records);
        let is_exchanged = |id: &String| exchanged.iter().flatten().any(|other| other == id);
        let common_passing = common_passing(trials, records);
        let mut other_speed = match common_passing {
            Some(_) => Vec::new(),
            None => other_speed(records),
        };
        let no_cutting = no_cutting(trials, records);
        // Where nothing is cut no line is that of teeth.
        other_speed.retain(|found| !is_exchanged(&found.cut) && !no_cutting.contains(&found.cut));
        let rectified = records.iter().filter_map(|record| {
            let own = record.channels.iter().filter(|c| c.whole.is_rectified);
            let channels: Vec<String> = own.map(|c| c.axis.label().to_string()).collect();
            (!channels.is_empty()).then(|| Rectified {
                cut: record.id.clone(),
                channels,
            })
        });
        RecordSlips {
            no_cutting,
            rectified: rectified.collect(),
            count: records.len(),
            exchanged,
            other_speed,
            common_passing,
        }
    }

    /// Whether records without signs are a matter of single cuts.
    pub fn few_are_rectified(&self) -> bool {
        2 * self.rectified.len() < self.count
    }

    /// Cuts that say nothing as they stand, each with what is wrong and what to do. What is wrong with half of all cuts or more is
    /// no matter of single ones.
    pub fn left_out(&self) -> Vec<(&str, String, String)> {
        let mut all: Vec<(&str, String, String)> = Vec::new();
        let no_cutting = self.no_cutting.iter().map(|id| {
            let remedy = "name the file of this cut, make the cut again, or take it out of campaign.toml";
            (
                id.as_str(),
                "nothing is cut in its record, which holds air alone".to_string(),
                remedy.to_string(),
            )
        });
        all.extend(no_cutting);
        all.extend(self.other_speed.iter().map(|found| {
            let why = format!(
                "its spindle ran at about {:.0} rpm and not at the stated {:.0}",
                found.ran_rpm, found.stated_rpm
            );
            (found.cut.as_str(), why, found.remedy())
        }));
        if self.few_are_rectified() {
            all.extend(self.rectified.iter().map(|found| {
                let why = format!(
                    "absolute values stand in {} of its record",
                    listed(&found.channels)
                );
                (
                    found.cut.as_str(),
                    why,
                    "export the record with its signs".to_string(),
                )
            }));
        }
        all.sort_by(|a, b| a.0.cmp(b.0));
        all.dedup_by(|b, a| a.0 == b.0);
        all
    }
}

impl OtherSpeed {
    /// The line to write.
    pub fn remedy(&self) -> String {
        let feed_mm = self.feed_mm * self.stated_rpm / self.ran_rpm;
        format!(
            "write spindle_rpm = {:.1} for it, with the feed per tooth as it is if that is what was meant to be cut, or \
             feed_per_tooth_mm = {feed_mm:.4} if the table kept the feed of the stated speed",
            self.ran_rpm
        )
    }
}

/// The speed that a clear line of the teeth shows, where it is not the stated one, 1/min.
fn ran_rpm(record: &CutAnalysis) -> Option<f64> {
    record.tooth_line.filter(|line| line.speed_is_doubtful())?;
    Some(record.passes_times? * record.spindle_rpm)
}

/// Cuts of which each shows the speed stated for the other.
fn exchanged(records: &[&CutAnalysis]) -> Vec<[String; 2]> {
    let at_odds: Vec<(&CutAnalysis, f64)> = records
        .iter()
        .filter_map(|record| Some((*record, ran_rpm(record)?)))
        .collect();
    let mut pairs = Vec::new();
    for (n, (a, ran_a)) in at_odds.iter().enumerate() {
        let mut others = at_odds[n + 1..].iter();
        let other = others.find(|(b, ran_b)| are_exchanged([a.spindle_rpm, *ran_a], [b.spindle_rpm, *ran_b]));
        pairs.extend(other.map(|(b, _)| [a.id.clone(), b.id.clone()]));
    }
    pairs
}

/// Whether of two cuts, each with its stated speed and the one it ran at, each ran at the other's stated speed, and not both a little beside
/// the same one.
fn are_exchanged([stated_a, ran_a]: [f64; 2], [stated_b, ran_b]: [f64; 2]) -> bool {
    let is_near = |a: f64, b: f64| (a / b - 1.0).abs() < ALIKE;
    is_near(ran_a, stated_b) && is_near(ran_b, stated_a) && !is_near(stated_a, stated_b)
}

/// Half of the stated frequency may be chatter as well, in which every second tooth cuts alike.
const HALF: f64 = 0.5;

/// A few cuts at speeds of their own.
fn other_speed(records: &[&CutAnalysis]) -> Vec<OtherSpeed> {
    let milled = records.iter().filter(|r| r.process == Process::Milling).count();
    let found: Vec<OtherSpeed> = records
        .iter()
        .filter_map(|record| {
            let ran_rpm = ran_rpm(record)?;
            ((ran_rpm / (HALF * record.spindle_rpm) - 1.0).abs() > ALIKE).then(|| OtherSpeed {
                cut: record.id.clone(),
                stated_rpm: record.spindle_rpm,
                ran_rpm,
                feed_mm: record.feed_mm,
            })
        })
        .collect();
    // Of half of the cuts it is no slip of the list any more.
    if 2 * found.len() < milled {
        found
    } else {
        Vec::new()
    }
}

/// One ratio in all cuts.
pub(crate) fn common_passing(trials: &CuttingTrials, records: &[&CutAnalysis]) -> Option<CommonPassing> {
    let ratio = common_ratio(records)?;
    let milled: Vec<&&CutAnalysis> = records.iter().filter(|r| r.process == Process::Milling).collect();
    let first = milled.first()?;
    // At one speed a line of the dynamometer's own may stand where another tooth passing would.
    let one_speed = milled
        .iter()
        .all(|r| (r.spindle_rpm / first.spindle_rpm - 1.0).abs() < ALIKE);
    let are_lines = milled
        .iter()
        .all(|r| r.tooth_line.is_some_and(|line| line.speed_is_doubtful()));
    if one_speed && !are_lines {
        return None;
    }
    let stated_teeth = trials.tool.teeth.max(1);
    let teeth = stated_teeth as f64 * ratio;
    let is_whole = teeth > 0.5 && (teeth / teeth.round() - 1.0).abs() < ALIKE;
    Some(CommonPassing {
        ratio,
        stated_teeth,
        teeth: is_whole.then_some(teeth.round() as usize),
        example: (first.id.clone(), ratio * first.spindle_rpm),
    })
}

/// How many times as often as stated the teeth pass, where that is one number for all milled cuts (two and more).
fn common_ratio(records: &[&CutAnalysis]) -> Option<f64> {
    let milled = || records.iter().filter(|r| r.process == Process::Milling);
    let ratios: Vec<f64> = milled().filter_map(|r| r.passes_times).collect();
    let ratio = median(&ratios);
    let is_one = ratios.iter().all(|own| (own / ratio - 1.0).abs() <= ALIKE);
    (ratios.len() >= 2 && ratios.len() == milled().count() && is_one).then_some(ratio)
}

/// A record is air where its scatter is no more than this times that of the air in the other records, …
const LIKE_AIR: f64 = 1.5;
/// … and a cut of its depth and feed would have made it this times as large: sixteen times the power cannot be missed.
const WOULD_BE_SEEN: f64 = 4.0;
/// Of a process whose force does not swing within a turn the level tells besides: it stays within this part of the force that is expected.
const AT_ZERO: f64 = 0.25;

/// Cuts whose records show air throughout.
fn no_cutting(trials: &CuttingTrials, records: &[&CutAnalysis]) -> Vec<String> {
    let air: Vec<(ForceAxis, f64)> = ForceAxis::ALL
        .into_iter()
        .filter_map(|axis| {
            let stds: Vec<f64> = records
                .iter()
                .filter_map(|r| channel(r, axis)?.whole.air_std)
                .collect();
            (!stds.is_empty()).then(|| (axis, median(&stds)))
        })
        .collect();
    let in_air = |axis: ForceAxis| air.iter().find(|(own, _)| *own == axis).map(|(_, std)| *std);
    let is_like_air = |record: &CutAnalysis| {
        let carrying = || {
            record
                .channels
                .iter()
                .filter(|c| ForceAxis::of(record.process).contains(&c.axis))
        };
        // A cut in another unit or range is as quiet, or quieter, and yet far above its own air.
        let is_air = |c: &ChannelAnalysis| {
            let usual = in_air(c.axis).filter(|std| *std > 0.0);
            let alike = usual.is_some_and(|std| (std / LIKE_AIR..=LIKE_AIR * std).contains(&c.whole.std));
            alike && c.whole.air_std.is_none_or(|own| c.whole.std <= LIKE_AIR * own)
        };
        carrying().count() > 0 && carrying().all(is_air)
    };
    let (like_air, cuts): (Vec<&CutAnalysis>, Vec<&CutAnalysis>) =
        records.iter().partition(|record| is_like_air(record));
    if like_air.len() >= cuts.len() {
        return Vec::new();
    }
    // Forces grow at most with the chip's cross section: edge forces keep them from falling as much.
    let per_chip = |axis: ForceAxis| {
        let each = cuts.iter().filter_map(|record| {
            let chip = chip_mm2(trials, record);
            let std = channel(record, axis)?.whole.std;
            (chip > 0.0).then_some(std / chip)
        });
        each.fold(f64::INFINITY, f64::min)
    };
    let largest_chip = cuts
        .iter()
        .map(|record| chip_mm2(trials, record))
        .fold(0.0, f64::max);
    let was_cut_nowhere = |record: &&&CutAnalysis| {
        record.channels.iter().any(|c| {
            let expected = per_chip(c.axis) * chip_mm2(trials, record).min(largest_chip);
            let is_seen =
                in_air(c.axis).is_some_and(|std| expected > WOULD_BE_SEEN * std) && expected.is_finite();
            is_seen
                && (record.process == Process::Milling
                    || outlasts_its_hole(trials, record)
                    || is_at_zero(c, &cuts, expected))
        })
    };
    like_air
        .iter()
        .filter(was_cut_nowhere)
        .map(|record| record.id.clone())
        .collect()
}

fn channel(record: &CutAnalysis, axis: ForceAxis) -> Option<&ChannelAnalysis> {
    record.channels.iter().find(|c| c.axis == axis)
}

/// Depth (where it has one that the force grows with) times feed.
fn chip_mm2(trials: &CuttingTrials, record: &CutAnalysis) -> f64 {
    let geometry = &trials.cuts[record.cut].geometry;
    let depth = match record.process {
        // The lips are as long in every hole of one drill.
        Process::Drilling => 1.0,
        Process::Milling | Process::Turning => depth_mm(geometry).unwrap_or(1.0),
    };
    depth * feed_mm(geometry)
}

/// Whether a record of a drilled hole is longer than the hole takes: then the force begins or ends in it.
fn outlasts_its_hole(trials: &CuttingTrials, record: &CutAnalysis) -> bool {
    let is_drilled = record.process == Process::Drilling;
    let Some(depth) = depth_mm(&trials.cuts[record.cut].geometry).filter(|_| is_drilled) else {
        return false;
    };
    let hole_s = depth / (record.feed_mm * record.spindle_rpm / 60.0);
    record.record_s[1] - record.record_s[0] > hole_s
}

/// Whether a channel stays where the others have their zero, as far as `expected` matters.
fn is_at_zero(own: &ChannelAnalysis, cuts: &[&CutAnalysis], expected: f64) -> bool {
    let zeros: Vec<f64> = cuts
        .iter()
        .filter_map(|record| channel(record, own.axis))
        .filter(|c| c.whole.air_std.is_some())
        .map(|c| c.drift.offset)
        .collect();
    let usual = median(&zeros);
    let near = |level: f64| (level - usual).abs() < AT_ZERO * expected;
    !zeros.is_empty() && zeros.iter().all(|zero| near(*zero)) && near(own.whole.mean)
}

#[cfg(test)]
mod tests {
    use super::are_exchanged;

    #[test]
    fn cuts_that_ran_beside_one_speed_are_not_exchanged() {
        assert!(are_exchanged([800.0, 1201.0], [1200.0, 799.0]));
        assert!(!are_exchanged([800.0, 1201.0], [1200.0, 1190.0]));
        // A spindle that wanders.
        assert!(!are_exchanged([809.0, 802.0], [809.0, 803.0]));
    }
}
