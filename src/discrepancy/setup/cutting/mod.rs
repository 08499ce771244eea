//! Wrong wiring and wrong filters of force records: the dynamometer's axes, a channel's gain, an amplifier's low-pass.
//!
//! The mean forces of a few feeds fit six coefficients through any wiring; the waveform over a revolution and what
//! coefficients a cut can have do not. Another reading of the channels is another `tool_from_dyno`: it is fitted anew, and
//! those that leave equally little are told apart by their coefficients.

mod axes_of_cuts;
mod change;
mod direction;
mod gain;
mod plausible;
mod records;
mod robust;
mod sequence;

use rayon::prelude::*;

use super::decide::{Noise, Rival, Rivals, TriedMistake, decide};
use super::examine::SetupCheck;
use super::finding::{SetupFinding, with_error};
use super::readings::Turn;
use crate::Result;
use crate::data::Process;
use crate::identify::forces::cutting_study::{NOISE_KNOWN_TO, calibrate_cutting, small_errors};
use crate::identify::{Calibration, CuttingData, CuttingModel};
use crate::signal::SpindleTrack;
use crate::text::listed;
use axes_of_cuts::other_axes;
use change::{RecordChange, SPEED_VARIATION};
use direction::milling_direction;
use gain::{OtherGain, other_gains};
use plausible::{FittedReading, IMPLAUSIBLE, MUCH_BETTER, SUSPICIOUS, fit, improbability, worst_cuts};
use records::{CERTAIN, ToldByRecords};
use robust::RobustFit;

/// Cuts that readings of the axes are tried on.
const CUTS: usize = 4;
/// Cuts of which one may be said to be other than stated: of fewer each could be the one.
const FEWEST_CUTS: usize = 4;
/// Readings that leave no more than this times the least are equal.
const ALIKE: f64 = 1.1;

/// The dynamometer's axes first, for nothing else can be judged before; then gain and filter of the channels. Last what was taken out
/// while the records were read.
///
/// # Errors
/// Records that no model can be fitted to.
pub fn examine_cutting(data: &CuttingData, rival: impl FnOnce() -> Option<Rival>) -> Result<SetupCheck> {
    let told = ToldByRecords::of(&data.slips);
    let mut check = match told.spoilt.is_empty() {
        true => examine(data, rival)?,
        // Waveforms at speeds that are not theirs, or without signs, are none.
        false => SetupCheck {
            findings: told.spoilt,
            reduced_chi2: 1.0,
            explained_share: 1.0,
            ..SetupCheck::default()
        },
    };
    // What the records were put in step for is sure; that the rest may be more of it says little beside that.
    let is_variation = |f: &SetupFinding| f.kind == SPEED_VARIATION;
    let known = check.findings.iter().any(|f| is_variation(f) && f.is_likely());
    if let Some(finding) = speed_variation(data).filter(|_| !known) {
        check.findings.retain(|f| !is_variation(f));
        check.findings.push(finding);
        check.last_taken_out = 1;
    }
    let copied = data.copies.iter().map(copied_record);
    let out: Vec<SetupFinding> = copied.chain(told.left_out).collect();
    check.last_taken_out += out.len();
    check.findings.extend(out);
    Ok(check)
}

/// Two cuts under which one record was filed; it counts once at most.
fn copied_record((cuts, not_of): &([String; 2], Option<String>)) -> SetupFinding {
    let what = match not_of {
        Some(id) => format!("cut {id} is left out"),
        None => "both are left out".into(),
    };
    SetupFinding::without_size(
        "duplicates",
        format!("cut {}", listed(cuts)),
        CERTAIN,
        format!(
            "Both files hold the same record, sample for sample ({what}): export the record of the other cut again, or take it out of \
             campaign.toml."
        ),
    )
}

/// A speed that wanders or droops, as the records were put in step for it.
fn speed_variation(data: &CuttingData) -> Option<SetupFinding> {
    let varying: Vec<(&str, &SpindleTrack)> = data
        .cuts
        .iter()
        .filter_map(|cut| Some((cut.id.as_str(), cut.spindle.as_ref()?)))
        .filter(|(_, track)| track.varies())
        .collect();
    let worst = varying
        .iter()
        .map(|(_, track)| *track)
        .max_by(|a, b| a.varying_rad().total_cmp(&b.varying_rad()))?;
    let (relative, std) = worst.variation();
    let cuts: Vec<String> = varying.iter().map(|(id, _)| (*id).to_string()).collect();
    let place = match varying.len() == data.cuts.len() {
        true => "all cuts".to_string(),
        false => format!("cut {}", listed(&cuts)),
    };
    Some(SetupFinding {
        kind: SPEED_VARIATION,
        place,
        value: Some(worst.varying_rad()),
        std_error: Some(worst.varying_rad() * std / relative),
        unit: "rad",
        confidence: CERTAIN,
        remedy: format!(
            "Look why the speed changes under load (it varies by {} %, rms): the tool is early or late by so much (rms). Averages and \
             waveforms are put in step by the angle that the forces show, so that coefficients and verdict do not suffer from it.",
            with_error(100.0 * relative, 100.0 * std)
        ),
    })
}

fn examine(data: &CuttingData, rival: impl FnOnce() -> Option<Rival>) -> Result<SetupCheck> {
    let mut check = SetupCheck {
        reduced_chi2: 1.0,
        ..SetupCheck::default()
    };
    if data.process == Process::Turning {
        // Three constant forces fit through any wiring: the coefficients' signs are looked at where they are given.
        return Ok(check);
    }
    if data.process != Process::Milling {
        let Some(base) = fit(data) else { return Ok(check) };
        if leaves_more_than_noise(&base, data) {
            let mut changes = vec![RecordChange::DrillDiameter, RecordChange::PointAngle];
            changes.extend(of_some_cuts(data, &base)?);
            try_changes(data, &base, changes, rival, &mut check);
        }
        // Turned round in all cuts a channel fits as well; in some of them it does not.
        if !check.findings.iter().any(SetupFinding::is_likely) {
            check.findings.splice(0..0, drilling_signs(&base));
        }
        return Ok(check);
    }
    // At a wrong speed the waveform is none, and any reading of it fits as badly as any other.
    if data.speed_is_contradicted {
        return Ok(check);
    }
    // The waveform is cut from the other side, or seen from one: what leaves less is told.
    let model = CuttingModel::new(data, true);
    let base = model.and_then(|model| calibrate_cutting(&model, data));
    let found = [milling_direction(data, base.as_ref().ok()), dyno_axes(data)?];
    let least = found.into_iter().flatten().min_by(|a, b| a.1.total_cmp(&b.1));
    let told = match least {
        // A channel without its gain, or another one in its place, in some cuts looks like another reading of all as well, which leaves more.
        Some((finding, left)) if left >= SUSPICIOUS => match OddCuts::of(data)? {
            Some(odd) if odd.a_gain_leaves_less(data, left) => None,
            odd => odd.and_then(|odd| odd.axes(data, left)).or(Some((finding, left))),
        },
        least => least,
    };
    if let Some((finding, left)) = told {
        check.explained_share = 1.0;
        check.reduced_chi2 = left;
        check.findings.push(finding);
        return Ok(check);
    }
    let base = base?;
    check.reduced_chi2 = base.reduced_chi2;
    if !leaves_more_than_noise(&base, data) {
        return Ok(check);
    }
    let mut changes: Vec<RecordChange> = [
        RecordChange::GainOfY,
        RecordChange::SpeedWander {
            steady_in_time: false,
        },
        RecordChange::SpeedWander { steady_in_time: true },
        RecordChange::LowPass { order: 1 },
        RecordChange::LowPass { order: 2 },
        RecordChange::MovingAverage,
        RecordChange::Width(None),
        RecordChange::Helix,
    ]
    .into();
    changes.extend(of_some_cuts(data, &base)?);
    try_changes(data, &base, changes, rival, &mut check);
    Ok(check)
}

/// Whether the fitted model leaves more than noise.
fn leaves_more_than_noise(base: &Calibration, data: &CuttingData) -> bool {
    base.reduced_chi2 >= SUSPICIOUS.min(1.0 + 30.0 / data.value_count() as f64)
}

/// The cuts that stand apart from the others, where there are enough to tell.
struct OddCuts {
    robust: Option<RobustFit>,
    /// Those that stand farthest from that fit, by index into the data's.
    far_off: Vec<usize>,
}

impl OddCuts {
    fn of(data: &CuttingData) -> Result<Option<Self>> {
        if data.cuts.len() < FEWEST_CUTS {
            return Ok(None);
        }
        let robust = RobustFit::of(data);
        let far_off = match &robust {
            Some(fit) => worst_cuts(&fit.even, &fit.theta, (0..fit.even.cuts.len()).collect())?,
            None => Vec::new(),
        };
        Ok(Some(OddCuts { robust, far_off }))
    }

    fn gains(&self, data: &CuttingData) -> Vec<OtherGain> {
        other_gains(data, self.robust.as_ref(), &self.far_off)
    }

    /// Whether another gain of some cuts leaves much less than `left`.
    fn a_gain_leaves_less(&self, data: &CuttingData, left: f64) -> bool {
        self.gains(data).iter().any(|gain| {
            let own = gain.mended(data).and_then(|data| fit(&data));
            own.is_some_and(|own| own.reduced_chi2 < MUCH_BETTER * left)
        })
    }

    /// Channels in another order in some cuts, where that leaves much less than `left`; with what it leaves.
    fn axes(&self, data: &CuttingData, left: f64) -> Option<(SetupFinding, f64)> {
        let tried = other_axes(data, self.robust.as_ref(), &self.far_off)
            .into_iter()
            .filter_map(|axes| {
                let left = fit(&axes.undone(data))?.reduced_chi2;
                let finding = SetupFinding {
                    confidence: CERTAIN,
                    ..axes.finding(data)
                };
                Some((finding, left))
            });
        let best = tried.min_by(|a, b| a.1.total_cmp(&b.1));
        best.filter(|(_, own)| *own < MUCH_BETTER * left)
    }
}

/// Adds what `changes` explain of the misfit that the fitted model (`base`) has.
fn try_changes(
    data: &CuttingData,
    base: &Calibration,
    changes: Vec<RecordChange>,
    rival: impl FnOnce() -> Option<Rival>,
    check: &mut SetupCheck,
) {
    let values = data.value_count();
    let rivals = || Rivals {
        library: rival(),
        small_errors: None,
    };
    let noise = Noise {
        values,
        known_to: NOISE_KNOWN_TO,
        small_errors: small_errors(data),
    };
    let chi2 = base.reduced_chi2 * values as f64;
    let tried: Vec<TriedMistake> = changes
        .par_iter()
        .filter_map(|change| change.tried(data, chi2))
        .collect();
    if let Some(decision) = decide(&tried, chi2, noise, rivals) {
        check.reduced_chi2 = decision.reduced_chi2;
        check.explained_share = decision.explained_share;
        check.findings.extend(decision.findings);
    }
}

fn read(data: &CuttingData, turn: Turn) -> CuttingData {
    let mut own = data.clone();
    for i in 0..3 {
        for j in 0..3 {
            // The recorded channel j is `sign[j]` times what the campaign takes channel `to[j]` for.
            own.tool_from_dyno[i][j] = data.tool_from_dyno[i][turn.to[j]] * turn.sign[j];
            own.dyno_from_tool[j][i] = data.dyno_from_tool[turn.to[j]][i] * turn.sign[j];
        }
    }
    own
}

/// Another order or sign of the dynamometer's channels, where the records say so; with the misfit that it leaves.
fn dyno_axes(data: &CuttingData) -> Result<Option<(SetupFinding, f64)>> {
    let step = data.cuts.len().div_ceil(CUTS).max(1);
    let some = data.filtered(|i| i % step == 0);
    let Some(now) = fit(&some) else { return Ok(None) };
    let now_improbable = improbability(&now);
    if now.reduced_chi2 < SUSPICIOUS && now_improbable < IMPLAUSIBLE {
        return Ok(None);
    }
    let trials: Vec<(Turn, FittedReading)> = Turn::all()
        .into_par_iter()
        .filter(|turn| *turn != Turn::NONE)
        .filter_map(|turn| Some((turn, FittedReading::of(&read(&some, turn))?)))
        .collect();
    let least = trials.iter().map(|t| t.1.chi2()).fold(now.reduced_chi2, f64::min);
    let mut equal: Vec<&(Turn, FittedReading)> =
        trials.iter().filter(|t| t.1.chi2() <= ALIKE * least).collect();
    equal.sort_by(|a, b| a.1.improbability.total_cmp(&b.1.improbability));
    let Some((turn, best)) = equal.first() else {
        return Ok(None);
    };
    // As recorded counts among the rivals where it fits as well.
    let much_better = best.chi2() < MUCH_BETTER * now.reduced_chi2;
    let more_plausible = now_improbable > IMPLAUSIBLE && best.improbability + IMPLAUSIBLE < now_improbable;
    let alike_now = now.reduced_chi2 <= ALIKE * least;
    if !best.is_plausible() || !(much_better || (alike_now && more_plausible)) {
        return Ok(None);
    }
    let weight = |improbability: f64| (-0.5 * (improbability - best.improbability)).exp();
    let sum: f64 = equal.iter().map(|t| weight(t.1.improbability)).sum::<f64>()
        + if alike_now { weight(now_improbable) } else { 0.0 };
    let matrix = read(data, *turn).tool_from_dyno;
    let rows: Vec<String> = matrix
        .iter()
        .map(|row| {
            let entries: Vec<String> = row.iter().map(|v| decimal(*v)).collect();
            format!("[{}]", entries.join(", "))
        })
        .collect();
    let others: Vec<String> = equal
        .iter()
        .skip(1)
        .filter(|t| weight(t.1.improbability) > 0.05)
        .map(|t| t.0.words(["Fx", "Fy", "Fz"], [true; 3]))
        .collect();
    let also = match others.is_empty() {
        true => String::new(),
        false => format!(" These records cannot tell it from: {}.", others.join("; or ")),
    };
    Ok(Some((
        SetupFinding {
            kind: "axes",
            place: format!("dynamometer: {}", turn.words(["Fx", "Fy", "Fz"], [true; 3])),
            value: None,
            std_error: None,
            unit: "",
            confidence: 0.97 / sum,
            remedy: format!(
                "Write tool_from_dyno = [{}] in [dynamometer] of campaign.toml: read so, {}. The coefficients of the present matrix are \
                 wrong.{also}",
                rows.join(", "),
                best.in_words(now.reduced_chi2),
            ),
        },
        best.chi2(),
    )))
}

/// `0.0`, `-1.0`, `0.9848`: as campaign.toml has it.
fn decimal(value: f64) -> String {
    let rounded = (value * 1e6).round() / 1e6 + 0.0;
    match rounded.fract() == 0.0 {
        true => format!("{rounded:.1}"),
        false => format!("{rounded}"),
    }
}

/// Thrust and torque oppose the drill: coefficients below zero are a channel of the wrong sign.
fn drilling_signs(calibration: &Calibration) -> Vec<SetupFinding> {
    let estimate = |name: &str| calibration.parameters.iter().find(|p| p.name == name);
    let channels = [("kfc_n_per_mm2", "thrust Fz"), ("ktc_n_per_mm2", "torque Mz")];
    let turned = channels.into_iter().filter_map(|(name, channel)| {
        let p = estimate(name)?;
        (p.value < -5.0 * p.std_error).then(|| SetupFinding {
            kind: "channel-sign",
            place: format!("all drilling cuts, {channel}"),
            value: Some(-1.0),
            std_error: None,
            unit: "",
            confidence: 0.95,
            remedy: format!(
                "Turn the sign of {channel} round (tool_from_dyno, or the amplifier's polarity): it pulls the drill along."
            ),
        })
    });
    turned.collect()
}

/// What may be wrong with single cuts, or with some of them together: feed, depth or width, exchanged files, another gain.
fn of_some_cuts(data: &CuttingData, base: &Calibration) -> Result<Vec<RecordChange>> {
    let Some(odd) = OddCuts::of(data)? else {
        return Ok(Vec::new());
    };
    let mut doubtful = worst_cuts(data, &base.theta, (0..data.cuts.len()).collect())?;
    let far_off = &odd.far_off;
    let mut changes: Vec<RecordChange> = Vec::new();
    for (n, &a) in far_off.iter().enumerate() {
        let others = far_off[n + 1..].iter();
        let may_be_exchanged = others.filter(|&&b| data.cuts[a].may_be_exchanged_with(&data.cuts[b]));
        changes.extend(may_be_exchanged.map(|&b| RecordChange::Exchanged([a.min(b), a.max(b)])));
    }
    if data.process == Process::Milling {
        let axes = other_axes(data, odd.robust.as_ref(), far_off);
        changes.extend(axes.into_iter().map(RecordChange::Axes));
    }
    doubtful.extend(far_off);
    doubtful.sort_unstable();
    doubtful.dedup();
    for cut in doubtful {
        changes.push(RecordChange::FeedOf(cut));
        match data.process {
            Process::Milling => changes.extend([RecordChange::DepthOf(cut), RecordChange::Width(Some(cut))]),
            Process::Drilling => {
                changes.extend([RecordChange::DrillSpeedOf(cut), RecordChange::PilotOf(cut)])
            }
            Process::Turning => {}
        }
    }
    changes.extend(odd.gains(data).into_iter().map(RecordChange::Gain));
    Ok(changes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::forces::made_cuts::{METAL, drilled, milled, ten_hard_cuts};

    #[test]
    fn a_cut_that_was_not_made_as_the_list_says_is_named_with_what_it_was_made_with() {
        let ways =
            [0.05, 0.1, 0.15].map(|feed| [[feed, 1.0, 0.0, 180.0, 0.4], [feed, 2.0, 90.0, 180.0, -0.7]]);
        // Ten times as hard: what a wrong feed changes is then more than the errors of 1 N, which these forces do not have.
        let made = milled(METAL.map(|k| 10.0 * k), &ways.concat());
        assert_eq!(examine_cutting(&made, || None).unwrap().findings, []);
        // What the list says is the true value over the factor.
        for (cut, factor) in [(0, 0.8), (3, 1.25), (5, 0.5)] {
            let listed = [
                ("feed-override", made.with_feed_of(cut, 1.0 / factor)),
                ("axial-depth", made.with_depth_of(cut, 1.0 / factor)),
            ];
            for (kind, listed) in listed {
                let findings = examine_cutting(&listed, || None).unwrap().findings;
                let found = &findings[0];
                assert_eq!(
                    (found.kind, &found.place),
                    (kind, &format!("cut {}", listed.cuts[cut].id)),
                    "{findings:?}"
                );
                assert!(found.confidence > 0.9, "{found:?}");
                approx::assert_relative_eq!(found.value.unwrap(), factor, max_relative = 1e-2);
            }
        }
    }

    fn first(listed: &CuttingData) -> SetupFinding {
        let findings = examine_cutting(listed, || None).unwrap().findings;
        let first = findings.into_iter().next().expect("a finding");
        assert!(first.confidence > 0.9, "{first:?}");
        first
    }

    #[test]
    fn a_wrong_width_is_named_with_the_true_one() {
        let made = ten_hard_cuts();
        for factor in [0.8, 1.25] {
            let cases = [
                (
                    "radial-width",
                    "all cuts",
                    made.with_width_of(|_| true, 1.0 / factor),
                ),
                (
                    "radial-width",
                    "cut cut-3",
                    made.with_width_of(|i| i == 3, 1.0 / factor),
                ),
            ];
            for (kind, place, listed) in cases {
                let found = first(&listed);
                assert_eq!((found.kind, found.place.as_str()), (kind, place), "{found:?}");
                approx::assert_relative_eq!(found.value.unwrap(), factor, max_relative = 2e-2);
            }
        }
    }

    #[test]
    fn two_records_under_each_others_name_are_named() {
        let made = ten_hard_cuts();
        let found = first(&made.with_exchanged([2, 8]));
        assert_eq!(
            (found.kind, found.place.as_str(), found.value),
            ("cut-swap", "cut cut-2 and cut-8", None)
        );
        let mut at_other_speeds = made;
        at_other_speeds.slips.exchanged = vec![["a".into(), "b".into()]];
        assert_eq!(first(&at_other_speeds).place, "cut a and b");
    }

    #[test]
    fn a_hole_that_was_not_drilled_with_the_stated_feed_is_named() {
        let holes = [[0.1, 4.0], [0.15, 4.0], [0.2, 4.0], [0.1, 0.0], [0.2, 0.0]];
        let made = drilled([800.0, 20.0, 500.0, 30.0], &holes);
        let listed = made.with_feed_of(1, 1.0 / 0.7);
        let findings = examine_cutting(&listed, || None).unwrap().findings;
        let found = &findings[0];
        assert_eq!(
            (found.kind, found.place.as_str()),
            ("feed-override", "cut cut-1"),
            "{findings:?}"
        );
        approx::assert_relative_eq!(found.value.unwrap(), 0.7, max_relative = 3e-2);
    }

    const HOLES: [[f64; 2]; 6] = [
        [0.1, 4.0],
        [0.15, 3.0],
        [0.2, 4.0],
        [0.1, 0.0],
        [0.2, 0.0],
        [0.15, 5.0],
    ];

    #[test]
    fn a_hole_or_a_drill_that_is_not_as_stated_is_named() {
        let made = drilled([800.0, 20.0, 500.0, 30.0], &HOLES);
        assert_eq!(examine_cutting(&made, || None).unwrap().findings, []);
        let cases: [(CuttingData, &str, &str, f64); 4] = [
            (
                made.with_pilot_of(1, 1.0 / 1.5),
                "pilot-diameter",
                "cut cut-1",
                3.0,
            ),
            (made.with_feed_of(0, 3.0), "feed-override", "cut cut-0", 1.0 / 3.0),
            (made.with_drill_diameter(8.5 / 9.5), "tool-diameter", "tool", 9.5),
            (
                made.with_point_angle(f64::to_radians(59.0).tan() / f64::to_radians(67.5).tan()),
                "point-angle",
                "tool",
                67.5,
            ),
        ];
        for (listed, kind, place, value) in cases {
            let findings = examine_cutting(&listed, || None).unwrap().findings;
            let found = findings.first().unwrap_or_else(|| panic!("{kind}"));
            assert_eq!((found.kind, found.place.as_str()), (kind, place), "{findings:?}");
            assert!(found.confidence > 0.9, "{findings:?}");
            approx::assert_relative_eq!(found.value.unwrap(), value, max_relative = 3e-2);
        }
    }

    #[test]
    fn matrices_are_written_as_campaign_toml_has_them() {
        assert_eq!(decimal(-1.0), "-1.0");
        assert_eq!(decimal(-0.0), "0.0");
        assert_eq!(decimal(0.984_807_753), "0.984808");
    }
}
