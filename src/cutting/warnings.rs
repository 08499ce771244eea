//! What a technician should know about the records and the regression, in plain words.

use std::collections::BTreeMap;

use super::cutting_trials::CuttingTrials;
use super::plausibility::unit_slip;
use crate::cutting::fit::estimate::{CfcOptions, RegressionMethod};
use crate::cutting::fit::group::{Coefficient, ForceGroup, distinct};
use crate::cutting::fit::outlier::CutMisfit;
use crate::cutting::force_model::average_force::average_row;
use crate::cutting::force_model::force_axis::ForceAxis;
use crate::cutting::measured::air::NO_AIR;
use crate::cutting::measured::cut_analysis::{
    CutAnalysis, NOTHING_REPEATS, Notice, OTHER_MULTIPLE, WRONG_SPEED,
};
use crate::cutting::measured::record_slips::common_passing;
use crate::data::{CutGeometry, Process};
use crate::text::figures;

/// Notices of all records, one sentence a kind.
pub(super) fn of_records(trials: &CuttingTrials, cuts: &[CutAnalysis]) -> Vec<String> {
    let common = common_speed_error(trials, cuts);
    let told = |notice: &&Notice| common.is_none() || ![WRONG_SPEED, OTHER_MULTIPLE].contains(&notice.kind);
    let notices = cuts
        .iter()
        .flat_map(|c| c.notices.iter().filter(told).map(|n| (c.id.as_str(), n)));
    common
        .iter()
        .cloned()
        .chain(sentences(notices, cuts.len()))
        .collect()
}

/// As [`of_records`], for the notices of `cuts` records, each with its cut's id.
pub(crate) fn of_notices(notices: &[(String, Notice)], cuts: usize) -> Vec<String> {
    sentences(notices.iter().map(|(id, n)| (id.as_str(), n)), cuts)
}

fn sentences<'a>(notices: impl Iterator<Item = (&'a str, &'a Notice)>, cuts: usize) -> Vec<String> {
    // What makes all the rest meaningless comes first.
    let mut by_kind: BTreeMap<(bool, &str), Vec<(&str, &str)>> = BTreeMap::new();
    for (id, notice) in notices {
        let key = (notice.kind != NOTHING_REPEATS, notice.kind);
        by_kind.entry(key).or_default().push((id, &notice.detail));
    }
    let sentence = |((_, kind), told): ((bool, &str), Vec<(&str, &str)>)| {
        let mut ids: Vec<&str> = told.iter().map(|(id, _)| *id).collect();
        ids.dedup();
        if [NO_AIR, NOTHING_REPEATS].contains(&kind) && ids.len() == cuts {
            return format!("all cuts: {kind}");
        }
        let one = |(id, detail): &(&str, &str)| match *detail {
            "" => id.to_string(),
            detail => format!("{id} ({detail})"),
        };
        let list = match told.first() {
            // Many of a kind: the first tells what it looks like.
            Some((id, detail)) if ids.len() > 4 && !detail.is_empty() => {
                format!("{} (e.g. {id}: {detail})", ids.join(", "))
            }
            _ => told.iter().map(one).collect::<Vec<_>>().join(", "),
        };
        format!("cut {list}: {kind}")
    };
    by_kind.into_iter().map(sentence).collect()
}

/// Where the teeth of every cut pass at another frequency by one factor, it is not the operator's speeds that are wrong.
fn common_speed_error(trials: &CuttingTrials, cuts: &[CutAnalysis]) -> Option<String> {
    let found = common_passing(trials, &cuts.iter().collect::<Vec<_>>())?;
    let (factor, teeth) = (found.ratio, found.stated_teeth);
    let teeth_text = found.teeth.map_or(String::new(), |other_teeth| {
        format!("the tool has {other_teeth} teeth and not {teeth}, or ")
    });
    let (first, rpm) = &found.example;
    Some(format!(
        "all cuts: the tooth-passing line stands at {factor:.3} times the frequency that spindle_rpm and {teeth} teeth give: \
         {teeth_text}the sampling rate in the files is wrong by that factor, or every spindle_rpm is (cut {first}: {rpm:.0} rpm and not {}); \
         the coefficients rest on it",
        rpm / factor
    ))
}

/// Milled with one feed: what tells cutting from edge coefficients then, where anything does.
pub(super) fn of_one_feed(trials: &CuttingTrials, cuts: &[&CutAnalysis], all: &ForceGroup) -> Option<String> {
    let feeds = distinct(cuts.iter().map(|c| c.feed_mm));
    let [feed] = feeds.as_slice() else { return None };
    // Where nothing tells them apart, another warning says it.
    let is_told = all.inseparable.is_empty() && all.process == Process::Milling;
    let by = match trials.tool.corner_radius_mm > 0.0 {
        true => "the rounded edge alone, where the chip is thinner,",
        false => "the immersion angles alone,",
    };
    is_told.then(|| {
        format!(
            "all cuts have one feed per tooth ({feed} mm): cutting and edge coefficients are told apart by {by} and so only as well \
             as the tool and the engagement are known; cut a second feed, half or twice as large"
        )
    })
}

/// Cells of a speed × feed plan that stayed empty, where there clearly was a plan.
pub(super) fn of_plan(trials: &CuttingTrials, cuts: &[&CutAnalysis], process: Process) -> Option<String> {
    let speeds = distinct(cuts.iter().map(|c| c.spindle_rpm));
    let feeds = distinct(cuts.iter().map(|c| c.feed_mm));
    // A bar gets thinner, so that its spindle speeds are no plan.
    if speeds.len() < 2 || feeds.len() < 2 || process == Process::Turning {
        return None;
    }
    let near = |a: f64, b: f64| (a - b).abs() <= 2e-3 * b.abs();
    let mut empty = Vec::new();
    for rpm in &speeds {
        for feed in &feeds {
            if !cuts
                .iter()
                .any(|c| near(c.spindle_rpm, *rpm) && near(c.feed_mm, *feed))
            {
                empty.push(format!("{rpm} rpm with {feed} mm"));
            }
        }
    }
    // More than a quarter empty: no such plan.
    if empty.is_empty() || 4 * empty.len() > speeds.len() * feeds.len() {
        return None;
    }
    let listed = trials
        .cuts
        .iter()
        .filter(|c| c.geometry.process() == process)
        .count();
    Some(format!(
        "the plan of {} speeds and {} feeds per {} has no usable cut at {} ({listed} cuts listed): errors grow most for the edge coefficients",
        speeds.len(),
        feeds.len(),
        process.feed_per(),
        empty.join(", ")
    ))
}

/// A cut that the others do not predict.
pub(super) fn of_misfit(trials: &CuttingTrials, misfit: &CutMisfit) -> String {
    let unit = misfit.axis.unit();
    let slip = match (
        misfit.swapped(),
        unit_slip(misfit.measured / misfit.predicted, misfit.axis),
    ) {
        (Some([a, b]), _) => format!(
            " ({} and {} look swapped: plugs or column names?)",
            a.label(),
            b.label()
        ),
        (None, Some(slip)) => format!(" ({slip}?)"),
        (None, None) => String::new(),
    };
    format!(
        "cut {} does not fit the others: {} {:.2} {unit} measured, {:.2} {unit} from the other cuts{slip}; check its feed, \
         speed, depth, file and units",
        trials.cuts[misfit.cut].id,
        misfit.axis.label(),
        misfit.measured,
        misfit.predicted
    )
}

/// With an edge that is not straight the axial force tells of the radial one: counted the wrong way round it makes that
/// negative.
pub(super) fn of_shape(trials: &CuttingTrials, fit: &ForceGroup) -> Option<String> {
    let shaped = fit.process == Process::Milling && !trials.tool.has_straight_edge();
    let radial = fit.coefficients.iter().find(|c| c.label == "Krc")?;
    let (value, std) = (radial.value?, radial.std_error?);
    (shaped && value < -2.0 * std).then(|| {
        format!(
            "Krc is {value:.0} ± {std:.0} N/mm²: no edge draws itself into the work like that. On an edge that is not straight the \
             radial force pushes the tool up; check that Fz is that of the work on the tool, away from the tip positive \
             (`tool_from_dyno` in [dynamometer])"
        )
    })
}

/// A dynamometer turned about the spindle's axis by some 20° to 30° puts the tangential force into the radial coefficient, and no waveform
/// tells it: turned forces fit as well.
pub(super) fn of_direction(trials: &CuttingTrials, fit: &ForceGroup) -> Option<String> {
    if fit.process != Process::Milling || !trials.tool.has_straight_edge() {
        return None;
    }
    let known = |label: &str| {
        let own = fit.coefficients.iter().find(|c| c.label == label)?;
        Some((own.value?, own.std_error?))
    };
    let ((tangential, tangential_std), (radial, radial_std)) = (known("Ktc")?, known("Krc")?);
    (tangential > 0.0 && radial - tangential > 2.0 * radial_std.hypot(tangential_std)).then(|| {
        format!(
            "Krc ({radial:.0} N/mm²) is larger than Ktc ({tangential:.0} N/mm²): few metals press back harder than they are cut. The axes \
             of a dynamometer that stands turned about z by 20° to 30° make it so, or x and y that are mixed up: check how it was mounted \
             (`tool_from_dyno` in [dynamometer]); a worn edge puts it into Kre rather"
        )
    })
}

/// Standard errors, without what teeth that differ add, and part of a coefficient, that they must move it by to be told.
const MOVED_SIGMAS: f64 = 2.0;
const MOVED_PART: f64 = 0.01;

/// Teeth that cut unequally, where that moves a coefficient.
pub(super) fn of_uneven_teeth(cuts: &[&CutAnalysis], fit: &ForceGroup) -> Option<String> {
    let moved = fit.coefficients.iter().filter_map(|c| {
        let (value, std, moved) = (c.value?, c.std_error?, c.moved_by_teeth);
        let without = (std * std - moved * moved).max(0.0).sqrt();
        let is_told = moved.abs() > MOVED_SIGMAS * without && moved.abs() > MOVED_PART * value.abs();
        let side = if moved < 0.0 { "low" } else { "high" };
        is_told.then(|| format!("{} {} {} {side}", c.label, figures(moved.abs(), 2), c.unit))
    });
    let moved: Vec<String> = moved.collect();
    let offsets: Vec<f64> = cuts
        .iter()
        .filter_map(|c| Some(c.uneven_teeth.as_ref()?.offset_mm))
        .collect();
    (!moved.is_empty()).then(|| {
        format!(
            "the teeth cut unequally, as a tool makes them that runs out by about {} mm: near the ends of the immersion the lower ones do \
             not cut, which makes {} (their standard errors allow for it); clamp the tool more truly, list its teeth in \
             tooth_radius_offset_mm, or let `lobestone add DIR tooth-radii` find them",
            figures(crate::signal::median(&offsets), 1),
            moved.join(", ")
        )
    })
}

/// Cuts in which the tool touches nothing by what is stated.
pub(super) fn of_missed(trials: &CuttingTrials, cuts: &[&CutAnalysis]) -> Option<String> {
    let touches = |c: &CutAnalysis| {
        let geometry = &trials.cuts[c.cut].geometry;
        let rows = ForceAxis::of(c.process)
            .iter()
            .map(|axis| average_row(trials.tool, geometry, *axis));
        rows.flatten().flatten().any(|value| value != 0.0)
    };
    let missed: Vec<&str> = cuts
        .iter()
        .filter(|c| !touches(c))
        .map(|c| c.id.as_str())
        .collect();
    (!missed.is_empty()).then(|| {
        format!(
            "cut {}: by the stated engagement the tool touches nothing: start_deg and exit_deg hold at the tool's diameter, and down at \
             this axial depth a rounded edge is narrower; a side of the work y mm from the axis, towards the side where a tooth \
             enters in up milling, is arccos(2 y / diameter_mm)",
            missed.join(", ")
        )
    })
}

/// Holes into the full: the chisel edge presses as well. Where some have a pilot hole and one set holds for all, it does not press.
pub(super) fn of_full_holes(
    trials: &CuttingTrials,
    cuts: &[&CutAnalysis],
    all: &ForceGroup,
) -> Option<String> {
    let is_full = |c: &&&CutAnalysis| {
        let geometry = &trials.cuts[c.cut].geometry;
        matches!(geometry, CutGeometry::Drilling { pilot_diameter_mm, .. } if *pilot_diameter_mm <= 0.0)
    };
    let full = cuts.iter().filter(is_full).count();
    let (holes, then) = match (full, cuts.len()) {
        (0, _) => return None,
        (full, count) if full == count => (
            "all holes are".to_string(),
            "for those of the lips drill some holes with a pilot hole as wide as the web",
        ),
        (full, count) => {
            scatters(all, ForceAxis::Z)?;
            (
                format!("{full} of {count} holes are"),
                "one set does not hold for these and the holes with a pilot hole; `lobestone add DIR chisel-edge` tells the two apart",
            )
        }
    };
    Some(format!(
        "{holes} drilled into the full, where the chisel edge presses besides the lips, often with a third to a half of the thrust: that \
         goes into Kfc and Kfe (the torque is hardly touched); {then}"
    ))
}

/// What the regressions themselves have to say: `all` cuts of a process, and its groups by speed.
pub(super) fn of_fits(all: &ForceGroup, groups: &[&ForceGroup]) -> Vec<String> {
    let mut warnings = Vec::new();
    let pooled_too = !groups.iter().any(|g| g.cuts == all.cuts);
    let listed: Vec<&ForceGroup> = groups.iter().copied().chain(pooled_too.then_some(all)).collect();

    // One sentence for all groups that lack the same.
    let mut lacking: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for group in &listed {
        for set in &group.inseparable {
            let names = match set.split_last() {
                Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
                _ => set.concat(),
            };
            let what = if set.len() == 1 {
                format!("{names} is not determined: no record carries it")
            } else if group.feeds < 2 {
                format!(
                    "{names} cannot be separated with one feed: cut at two feeds or more (best three, wide apart)"
                )
            } else {
                format!("{names} cannot be separated by these cuts")
            };
            lacking.entry(what).or_default().push(speed_text(group));
        }
    }
    for (what, speeds) in lacking {
        warnings.push(format!("at {} m/min: {what}", speeds.join(", ")));
    }
    for j in 0..all.coefficients.len() {
        of_coefficient(&listed, j, &mut warnings);
    }
    let two_feeds: Vec<String> = groups
        .iter()
        .filter(|g| g.feeds == 2)
        .map(|g| speed_text(g))
        .collect();
    if !two_feeds.is_empty() {
        warnings.push(format!(
            "at {} m/min: two feeds only, which a line always fits: nothing checks the model there",
            two_feeds.join(", ")
        ));
    }
    for &axis in ForceAxis::of(all.process) {
        if let Some(share) = scatters(all, axis) {
            warnings.push(format!(
                "{}: the averages of all cuts scatter by {:.2} {} ({:.0} %) more than their errors: one set of \
                 coefficients does not hold for all of them; compare the speeds, and look at wear and drift",
                axis.label(),
                all.extra_scatter[axis.index()],
                axis.unit(),
                100.0 * share
            ));
        }
    }
    warnings
}

/// By what part of their size the averages on an axis scatter beyond their errors, where that is plain: one set of coefficients does not
/// hold for all of them.
fn scatters(all: &ForceGroup, axis: ForceAxis) -> Option<f64> {
    let on_axis = || all.points.iter().filter(|p| p.axis == axis);
    let square_sum: f64 = on_axis().map(|p| p.measured.powi(2)).sum();
    let size = (square_sum / on_axis().count().max(1) as f64).sqrt();
    let extra = all.extra_scatter[axis.index()];
    let is_plain = all.chi2_per_dof[axis.index()].is_some_and(|c| c > 4.0) && extra > 0.02 * size;
    is_plain.then(|| extra / size)
}

/// Bootstrap and regression errors further apart than this factor contradict each other.
const ERRORS_APART: f64 = 2.5;
/// The bootstrap's own scatter with fewer cuts allows small values.
const CUTS_FOR_SMALL_BOOTSTRAP: usize = 10;
/// A cut with at least this leverage decides a coefficient by itself.
const ALONE: f64 = 0.95;

/// What robust regression, bootstrap and leverage say about `all` cuts of a process and its groups.
pub(super) fn of_methods(all: &ForceGroup, groups: &[&ForceGroup], options: CfcOptions) -> Vec<String> {
    let mut warnings = Vec::new();
    let pooled_too = !groups.iter().any(|g| g.cuts == all.cuts);
    for group in groups.iter().copied().chain(pooled_too.then_some(all)) {
        let speed = speed_text(group);
        let determined = || group.coefficients.iter().filter(|c| c.value.is_some());
        if options.robust && group.method != RegressionMethod::Huber && group.is_complete() {
            warnings.push(format!(
                "at {speed} m/min: too few cuts for robust regression (three more averages on every axis than \
                 coefficients they carry), least squares is used there"
            ));
        }
        let apart: Vec<String> = determined().filter_map(methods_apart).collect();
        if !apart.is_empty() {
            let (this, other, remedy) = match group.method {
                RegressionMethod::LeastSquares => (
                    "least squares",
                    "robust (Huber) regression",
                    "; mend or leave out the cuts that do not fit, or use --robust",
                ),
                RegressionMethod::Huber => ("robust (Huber) regression", "least squares", ""),
            };
            warnings.push(format!(
                "at {speed} m/min: {this} and {other} disagree by more than their standard errors ({}): single cuts \
                 pull the coefficients{remedy}",
                apart.join(", ")
            ));
        }
        let ratios: Vec<(f64, &Coefficient)> = determined()
            .filter_map(|c| Some((c.std_error_bootstrap? / c.std_error?, c)))
            .filter(|(ratio, _)| ratio.is_finite())
            .collect();
        let list = |picked: &dyn Fn(f64) -> bool| -> Vec<String> {
            ratios
                .iter()
                .filter(|(ratio, _)| picked(*ratio))
                .map(|(ratio, c)| format!("{} by {ratio:.1}", c.label))
                .collect()
        };
        let larger = list(&|r| r > ERRORS_APART);
        if !larger.is_empty() {
            warnings.push(format!(
                "at {speed} m/min: drawing the cuts again (bootstrap) gives larger standard errors than the regression \
                 ({} times): the answer hangs on which cuts were made; trust the larger ones",
                larger.join(", ")
            ));
        }
        let smaller = list(&|r| r < 1.0 / ERRORS_APART);
        // Scatter that is allowed for makes the regression's errors larger for a reason of its own.
        let errors_suffice = group.chi2_per_dof.iter().flatten().all(|c| *c < 1.0);
        if errors_suffice && !smaller.is_empty() && group.cuts.len() >= CUTS_FOR_SMALL_BOOTSTRAP {
            warnings.push(format!(
                "at {speed} m/min: drawing the cuts again (bootstrap) gives smaller standard errors than the regression \
                 ({} times): the averages agree better than their own errors say",
                smaller.join(", ")
            ));
        }
        let alone: Vec<&str> = group
            .influence
            .iter()
            .filter(|i| i.leverage >= ALONE)
            .map(|i| i.cut.as_str())
            .collect();
        // With two feeds every cut is; another warning says so.
        if group.feeds > 2 && !alone.is_empty() {
            warnings.push(format!(
                "at {speed} m/min: cut {} alone decides part of the coefficients (leverage near 1), nothing checks it: \
                 repeat it",
                alone.join(", ")
            ));
        }
    }
    warnings
}

/// `Ktc 930.1 ± 0.8 against 921.0 ± 0.7 N/mm²` where the two methods differ by more than the larger standard error.
fn methods_apart(c: &Coefficient) -> Option<String> {
    let (value, error, other) = (c.value?, c.std_error?, c.other_method?);
    let other_error = other.std_error?;
    let apart = (value - other.value).abs() > error.max(other_error);
    apart.then(|| {
        format!(
            "{} {value:.2} ± {error:.2} against {:.2} ± {other_error:.2} {}",
            c.label, other.value, c.unit
        )
    })
}

/// What is implausible or poorly known about one coefficient, over the groups.
fn of_coefficient(groups: &[&ForceGroup], j: usize, warnings: &mut Vec<String>) {
    let (mut negative, mut poor, mut held) = (Vec::new(), Vec::new(), Vec::new());
    for group in groups {
        let (speed, c) = (speed_text(group), &group.coefficients[j]);
        match (c.value, c.std_error) {
            _ if c.constraint_active => {
                let free = c.unconstrained.map_or(String::new(), |k| {
                    let error = k.std_error.map_or(String::new(), |e| format!(" ± {e:.2}"));
                    format!(" (without it {:.2}{error})", k.value)
                });
                held.push(format!("{speed}{free}"));
            }
            // Along a turning edge the chip goes to either side, as the inclination of the edge sends it.
            (Some(_), Some(_)) if group.process == Process::Turning && [2, 5].contains(&j) => {}
            (Some(value), Some(error)) if value < -2.0 * error => {
                negative.push(format!("{value:.2} at {speed}"));
            }
            (Some(value), Some(error)) if !c.edge && error > 0.5 * value.abs() => {
                poor.push(format!("{value:.1} ± {error:.1} at {speed}"));
            }
            _ => {}
        }
    }
    let Some(c) = groups.first().map(|g| &g.coefficients[j]) else {
        return;
    };
    if !negative.is_empty() {
        let remedy = if c.edge {
            "no edge pulls; check tool_from_dyno, the immersion angles and the drift, then look at effects the model lacks. Where all that is \
             right, --nonnegative-edges holds it at zero"
        } else if groups.iter().any(|g| g.process == Process::Turning) {
            "check tool_from_dyno, the nose radius and the cutting edge angle"
        } else {
            "check tool_from_dyno and the immersion angles"
        };
        warnings.push(format!(
            "{} is negative ({} m/min; {}): {remedy}",
            c.label,
            negative.join(", "),
            c.unit
        ));
    }
    if !poor.is_empty() {
        warnings.push(format!(
            "{} is poorly known ({} m/min; {}): feeds too few or too close, or its force too small",
            c.label,
            poor.join(", "),
            c.unit
        ));
    }
    if !held.is_empty() {
        warnings.push(format!(
            "{} is held at zero by the constraint at {} m/min; {}",
            c.label,
            held.join(", "),
            c.unit
        ));
    }
}

/// `58.3` or `45.1–81.4`, m/min.
pub fn speed_text(group: &ForceGroup) -> String {
    let [low, high] = group.cutting_speed_range_m_per_min;
    if high - low <= 2e-3 * high {
        format!("{:.1}", group.cutting_speed_m_per_min)
    } else {
        format!("{low:.1}–{high:.1}")
    }
}
