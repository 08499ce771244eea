//! What was read off the records themselves, before anything was fitted, as findings.

use super::change::exchanged_files;
use crate::cutting::{CommonPassing, OtherSpeed, RecordSlips};
use crate::discrepancy::setup::finding::SetupFinding;
use crate::text::listed;

/// Confidence in what was read off the records themselves.
pub(super) const CERTAIN: f64 = 0.97;
/// Confidence in a number of teeth: another sampling rate, or another speed in all cuts, by the ratio of two whole numbers is rarer.
const TEETH: f64 = 0.9;

pub(super) struct ToldByRecords {
    /// Nothing can be fitted before these are mended.
    pub(super) spoilt: Vec<SetupFinding>,
    /// Of cuts that were left out: the others can be judged.
    pub(super) left_out: Vec<SetupFinding>,
}

impl ToldByRecords {
    pub(super) fn of(slips: &RecordSlips) -> Self {
        const SPEEDS: &str = "each ran at the spindle speed stated for the other";
        let exchanged = slips
            .exchanged
            .iter()
            .map(|cuts| exchanged_files(cuts, SPEEDS, CERTAIN));
        let mut spoilt: Vec<SetupFinding> = exchanged
            .chain(slips.common_passing.as_ref().map(common))
            .collect();
        let mut left_out: Vec<SetupFinding> = slips.no_cutting.iter().map(|id| no_cutting(id)).collect();
        left_out.extend(slips.other_speed.iter().map(other_speed));
        let rectified = rectified(slips);
        match slips.few_are_rectified() {
            true => left_out.extend(rectified),
            false => spoilt.extend(rectified),
        }
        ToldByRecords { spoilt, left_out }
    }
}

fn no_cutting(id: &str) -> SetupFinding {
    SetupFinding::without_size(
        "no-cutting",
        format!("cut {id}"),
        CERTAIN,
        "Nothing is cut in this record: it shows what the other records show in the air, from its first sample to its last (the cut is \
         left out). Name the file of this cut, make the cut again, or take it out of campaign.toml."
            .into(),
    )
}

fn other_speed(found: &OtherSpeed) -> SetupFinding {
    SetupFinding {
        kind: "spindle-speed",
        place: format!("cut {}", found.cut),
        value: Some(found.ran_rpm),
        std_error: None,
        unit: "1/min",
        confidence: CERTAIN,
        remedy: format!(
            "The teeth pass as they do at {:.0} rpm, and {:.0} rpm are stated (the cut is left out): {}.",
            found.ran_rpm,
            found.stated_rpm,
            found.remedy()
        ),
    }
}

fn common(found: &CommonPassing) -> SetupFinding {
    let (cut, rpm) = &found.example;
    let ratio = found.ratio;
    let others = format!(
        "the sampling rate (rate_hz, or the times in the files) is {ratio:.4} times the true one, or every spindle_rpm is {:.4} times \
         what ran (cut {cut}: spindle_rpm = {rpm:.0})",
        1.0 / ratio
    );
    match found.teeth {
        Some(teeth) => SetupFinding {
            kind: "teeth",
            place: "tool".into(),
            value: Some(teeth as f64),
            std_error: None,
            unit: "1",
            confidence: TEETH,
            remedy: format!(
                "Count the teeth and write teeth = {teeth} in [tool] of campaign.toml (not {}): in all cuts they pass {ratio:.3} times as \
                 often as stated. Where the number is right, {others}.",
                found.stated_teeth
            ),
        },
        None => SetupFinding {
            kind: "spindle-speed",
            place: "all cuts".into(),
            value: Some(ratio),
            std_error: None,
            unit: "1",
            confidence: CERTAIN,
            remedy: format!(
                "In all cuts the teeth pass {ratio:.4} times as often as stated, which no number of teeth explains: {others}. Correct \
                 the one that is wrong."
            ),
        },
    }
}

/// Cuts with the same channels are told together.
fn rectified(slips: &RecordSlips) -> Vec<SetupFinding> {
    let found = &slips.rectified;
    let mut groups: Vec<(Vec<String>, Vec<String>)> = Vec::new();
    for own in found {
        match groups.iter_mut().find(|(channels, _)| *channels == own.channels) {
            Some((_, cuts)) => cuts.push(own.cut.clone()),
            None => groups.push((own.channels.clone(), vec![own.cut.clone()])),
        }
    }
    // In all cuts it is one mistake, whichever channels go through zero in one or the other.
    if !slips.few_are_rectified() && groups.len() > 1 {
        let mut channels: Vec<String> = found.iter().flat_map(|own| own.channels.clone()).collect();
        channels.sort_unstable();
        channels.dedup();
        groups = vec![(channels, found.iter().map(|own| own.cut.clone()).collect())];
    }
    let finding = |(channels, cuts): (Vec<String>, Vec<String>)| {
        let place = match cuts.len() == slips.count {
            true => "all cuts".to_string(),
            false => format!("cut {}", listed(&cuts)),
        };
        SetupFinding::without_size(
            "rectified",
            format!("{place}, {}", listed(&channels)),
            CERTAIN,
            "Export the records with their signs: absolute values were written. Samples come down to zero as noise brings them there, and \
             not one goes below; what a force was there cannot be brought back."
                .into(),
        )
    };
    groups.into_iter().map(finding).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutting::Rectified;
    use crate::discrepancy::setup::examine_cutting;
    use crate::identify::forces::made_cuts::ten_hard_cuts;

    #[test]
    fn cuts_left_out_keep_no_verdict_from_being_certain_and_spoilt_ones_do() {
        let mut data = ten_hard_cuts();
        data.slips = RecordSlips {
            no_cutting: vec!["a".into()],
            other_speed: vec![OtherSpeed {
                cut: "b".into(),
                stated_rpm: 1260.0,
                ran_rpm: 1620.0,
                feed_mm: 0.09,
            }],
            rectified: vec![Rectified {
                cut: "c".into(),
                channels: vec!["Fx".into(), "Fy".into()],
            }],
            count: 13,
            ..RecordSlips::default()
        };
        let check = examine_cutting(&data, || None).unwrap();
        assert_eq!(check.likely(), None);
        let told: Vec<(&str, &str, Option<f64>)> = check
            .taken_out()
            .iter()
            .map(|f| (f.kind, f.place.as_str(), f.value))
            .collect();
        assert_eq!(
            told,
            [
                ("no-cutting", "cut a", None),
                ("spindle-speed", "cut b", Some(1620.0)),
                ("rectified", "cut c, Fx and Fy", None)
            ]
        );
        assert!(
            check.findings[1].remedy.contains("spindle_rpm = 1620.0"),
            "{:?}",
            check.findings[1]
        );
        assert!(
            check.findings[1].remedy.contains("feed_per_tooth_mm = 0.0700"),
            "{:?}",
            check.findings[1]
        );
        data.slips.count = 1;
        assert_eq!(
            examine_cutting(&data, || None).unwrap().likely().unwrap().kind,
            "rectified"
        );
    }

    #[test]
    fn another_number_of_teeth_is_told_where_one_explains_it() {
        let of = |ratio: f64, teeth: Option<usize>| {
            let slips = RecordSlips {
                common_passing: Some(CommonPassing {
                    ratio,
                    stated_teeth: 5,
                    teeth,
                    example: ("01".into(), 1000.0 * ratio),
                }),
                count: 4,
                ..RecordSlips::default()
            };
            ToldByRecords::of(&slips).spoilt.remove(0)
        };
        let teeth = of(1.2, Some(6));
        assert_eq!((teeth.kind, teeth.value), ("teeth", Some(6.0)));
        assert!(
            teeth.remedy.contains("teeth = 6 in [tool]") && teeth.is_likely(),
            "{teeth:?}"
        );
        let speed = of(1.28, None);
        assert_eq!((speed.kind, speed.value), ("spindle-speed", Some(1.28)));
        assert!(speed.remedy.contains("spindle_rpm = 1280"), "{speed:?}");
    }
}
