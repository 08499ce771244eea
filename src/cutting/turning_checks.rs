//! What a technician should know about turned cuts in particular: which channel is which, and what
//! cuts of one depth leave open.

use super::cutting_trials::CuttingTrials;
use crate::cutting::fit::group::distinct;
use crate::cutting::force_model::average_force::average_row;
use crate::cutting::force_model::force_axis::ForceAxis;
use crate::cutting::measured::cut_analysis::CutAnalysis;
use crate::data::CutGeometry;
use crate::signal::median;
use crate::text::figures;

/// What the axes of turning are, for messages.
const AXES: &str = "x against the feed, y away from the work, z along the cutting speed";
/// Part of the other forces from which on a force of the wrong sign is no scatter.
const CLEARLY: f64 = 0.05;
/// The passive force is said to have the wrong sign where the edge's normal stands at least this much out of the work.
const OUTWARD: f64 = 0.3;

/// Warnings about the turned cuts of one material.
pub(super) fn of_turning(trials: &CuttingTrials, cuts: &[&CutAnalysis]) -> Vec<String> {
    let mut warnings: Vec<String> = axes(trials, cuts).into_iter().collect();
    warnings.extend(one_feed(trials, cuts));
    warnings.extend(one_depth(trials, cuts));
    warnings
}

/// Cutting force largest, and no force that pulls the tool into the work.
fn axes(trials: &CuttingTrials, cuts: &[&CutAnalysis]) -> Option<String> {
    let middle = |axis: ForceAxis| {
        let values: Vec<f64> = cuts
            .iter()
            .filter_map(|c| c.averages[axis.index()])
            .map(|a| a.value)
            .collect();
        (!values.is_empty()).then(|| median(&values))
    };
    let cutting = middle(ForceAxis::Z)?;
    let others = [ForceAxis::X, ForceAxis::Y].map(|axis| (axis, middle(axis)));
    let list = || {
        let known = others
            .iter()
            .filter_map(|(axis, value)| Some((axis.label(), (*value)?)));
        let all: Vec<String> = known
            .chain([("Fz", cutting)])
            .map(|(name, value)| format!("{name} {}", figures(value, 3)))
            .collect();
        format!("{} N in the middle of the cuts", all.join(", "))
    };
    let larger = others
        .iter()
        .filter_map(|(axis, value)| Some((axis.label(), (*value)?)))
        .filter(|(_, value)| value.abs() > cutting.abs())
        .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    if let Some((name, _)) = larger {
        return Some(format!(
            "Fz is not the largest force ({}): in turning the cutting force is, unless the edge is worn or the depth is far below the \
             nose radius. {name} may be the cutting force: in tool axes ({AXES}) row 3 of tool_from_dyno picks the channel \
             along the cutting speed",
            list()
        ));
    }
    let size = cutting.abs();
    let out_of_the_work = cuts.iter().all(|c| {
        let row = |axis| average_row(trials.tool, &trials.cuts[c.cut].geometry, axis).ok();
        row(ForceAxis::X)
            .zip(row(ForceAxis::Y))
            .is_some_and(|(x, y)| y[1] > OUTWARD * x[1].hypot(y[1]))
    });
    let mut wrong: Vec<&str> = Vec::new();
    for (axis, value) in others {
        let tells = axis == ForceAxis::X || out_of_the_work;
        if value.is_some_and(|v| v < -CLEARLY * size) && tells {
            wrong.push(axis.label());
        }
    }
    wrong.extend((cutting < 0.0).then_some("Fz"));
    (!wrong.is_empty()).then(|| {
        format!(
            "{} negative ({}): in tool axes ({AXES}) all three are positive in an ordinary cut; turn the sign of the row in \
             tool_from_dyno, or check which channel is which",
            match wrong.as_slice() {
                [one] => format!("{one} is"),
                several => format!("{} are", several.join(" and ")),
            },
            list()
        )
    })
}

/// Without a second feed only the nose, where the chip is thinner, separates cutting from edge forces.
fn one_feed(trials: &CuttingTrials, cuts: &[&CutAnalysis]) -> Option<String> {
    let feeds = distinct(cuts.iter().map(|c| c.feed_mm));
    let [feed] = feeds.as_slice() else {
        return None;
    };
    (trials.tool.corner_radius_mm > 0.0 && depths(trials, cuts).len() > 1).then(|| {
        format!(
            "all cuts have one feed ({feed} mm): cutting and edge coefficients are told apart by the nose alone, where the chip is thinner, \
             and so only as well as nose radius and cutting edge angle are known; cut a second feed, half or twice as large"
        )
    })
}

fn depths(trials: &CuttingTrials, cuts: &[&CutAnalysis]) -> Vec<f64> {
    distinct(cuts.iter().filter_map(|c| match trials.cuts[c.cut].geometry {
        CutGeometry::Turning { depth_of_cut_mm, .. } => Some(depth_of_cut_mm),
        _ => None,
    }))
}

/// Feeds alone separate cutting from edge forces, but nothing checks how the force follows the depth.
fn one_depth(trials: &CuttingTrials, cuts: &[&CutAnalysis]) -> Option<String> {
    let depths = depths(trials, cuts);
    let [depth] = depths.as_slice() else {
        return None;
    };
    // The angle of a sharp edge is checked by no depth: it only turns radial and axial force into each other.
    let shape = match trials.tool.corner_radius_mm > 0.0 {
        true => ", nor the nose radius and the cutting edge angle",
        false => "",
    };
    Some(format!(
        "all cuts have one depth ({depth} mm): the coefficients hold for it, but nothing checks that the force grows with the depth as \
         the edge in the work does{shape}; add a cut at half or twice the depth"
    ))
}
