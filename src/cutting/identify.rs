//! From what the force records say to the cutting force coefficients.

use super::cutting_trials::CuttingTrials;
use super::plausibility;
use super::turning_checks::of_turning;
use super::warnings;
use crate::cutting::fit::estimate::CfcOptions;
use crate::cutting::fit::group::{ForceGroup, Rows, distinct, observations};
use crate::cutting::fit::outlier::misfits;
use crate::cutting::fit::series::{MaterialComparison, MaterialSeries, SpeedTrends, compare, speed_trends};
use crate::cutting::force_model::average_force::average_row;
use crate::cutting::force_model::force_axis::ForceAxis;
use crate::cutting::force_model::orthogonal::{OrthogonalPrediction, predict};
use crate::cutting::measured::average::pool_scatter;
use crate::cutting::measured::cut_analysis::{Average, CutAnalysis};
use crate::data::Process;
use crate::{Error, InputError, Result};

/// What the dynamometer records say.
#[derive(Debug, Clone)]
pub struct CfcResult {
    /// Every usable cut, in the campaign's order.
    pub cuts: Vec<CutAnalysis>,
    /// One per process, material and cutting speed where the feeds at that speed suffice; otherwise speeds are pooled.
    pub groups: Vec<ForceGroup>,
    /// All cuts of a process and a material together, one group each.
    pub pooled: Vec<ForceGroup>,
    /// What each coefficient does over cutting speed, per process and material with two speeds or more.
    pub trends: Vec<SpeedTrends>,
    /// Each further material against the first one of its process.
    pub materials: Vec<MaterialComparison>,
    /// Milling coefficients from the orthogonal database, next to those of the cuts.
    pub prediction: Option<OrthogonalPrediction>,
    /// What a technician should know, in plain words.
    pub warnings: Vec<String>,
}

/// The coefficients from what the cuts' records say, with the warnings that go with them. A cut that cannot be used is left
/// out with a warning that names it.
///
/// # Errors
/// Not one usable record, or none on an axis that carries coefficients.
pub fn fit_force_coefficients(
    trials: &CuttingTrials,
    outcomes: Vec<Result<CutAnalysis>>,
    options: CfcOptions,
) -> Result<CfcResult> {
    let mut warnings = Vec::new();
    let (mut cuts, mut first_error, mut rows) = (Vec::new(), None, Rows::new());
    for (cut, outcome) in trials.cuts.iter().zip(outcomes) {
        let usable = outcome.and_then(|analysis| {
            add_rows(trials, &analysis, &mut rows)?;
            Ok(analysis)
        });
        match usable {
            Ok(analysis) => cuts.push(analysis),
            Err(error) => {
                warnings.push(format!("cut {} is left out: {error}", cut.id));
                first_error.get_or_insert(error);
            }
        }
    }
    if cuts.is_empty() {
        return Err(none_usable(trials.cuts.len(), first_error));
    }
    pool_scatter(&mut cuts, trials.tool_from_dyno);
    turn_torque(&mut cuts, &mut warnings);
    let counted = without_duplicates(trials, &cuts, &mut warnings);
    warnings.extend(warnings::of_records(trials, &cuts));

    let (mut groups, mut pooled) = (Vec::new(), Vec::new());
    let (mut trends, mut materials) = (Vec::new(), Vec::new());
    for process in Process::ALL {
        let of_process: Vec<&CutAnalysis> =
            counted.iter().copied().filter(|c| c.process == process).collect();
        let mut series: Vec<MaterialSeries> = Vec::new();
        for cut in of_process {
            let material = trials.cuts[cut.cut].material.as_deref();
            match series.iter_mut().find(|s| s.material == material) {
                Some(one) => one.cuts.push(cut),
                None => series.push(MaterialSeries {
                    process,
                    material,
                    cuts: vec![cut],
                }),
            }
        }
        for one in &series {
            let Some(all) = ForceGroup::fit(&one.cuts, one.material, &rows, options)? else {
                continue;
            };
            let mut told = plausibility::of_scales(trials, &one.cuts, process);
            told.extend(warnings::of_plan(trials, &one.cuts, process));
            if process == Process::Turning {
                told.extend(of_turning(trials, &one.cuts));
            }
            let first_group = groups.len();
            for set in by_speed(&one.cuts, &mut told) {
                groups.extend(ForceGroup::fit(&set, one.material, &rows, options)?);
            }
            let misfits = misfits(&observations(&one.cuts, &rows));
            told.extend(misfits.iter().map(|m| warnings::of_misfit(trials, m)));
            let by_speed: Vec<&ForceGroup> = groups[first_group..].iter().collect();
            told.extend(warnings::of_one_feed(trials, &one.cuts, &all));
            told.extend(warnings::of_fits(&all, &by_speed));
            told.extend(warnings::of_shape(trials, &all));
            told.extend(warnings::of_direction(trials, &all));
            told.extend(warnings::of_uneven_teeth(&one.cuts, &all));
            told.extend(warnings::of_missed(trials, &one.cuts));
            told.extend(warnings::of_full_holes(trials, &one.cuts, &all));
            told.extend(warnings::of_methods(&all, &by_speed, options));
            if let Some(found) = speed_trends(trials, one, &rows) {
                told.extend(found.warnings());
                trends.push(found);
            }
            let about = |warning: String| match one.material {
                Some(material) if series.len() > 1 => format!("{material}: {warning}"),
                _ => warning,
            };
            warnings.extend(told.into_iter().map(about));
            pooled.push(all);
        }
        if let Some((first, others)) = series.split_first() {
            materials.extend(others.iter().filter_map(|other| compare(first, other, &rows)));
        }
    }
    if groups.is_empty() {
        return Err(Error::computation(
            "no cut holds an average on an axis that carries coefficients: check that Fx, Fy, Fz (drilling: Fz, Mz) are recorded",
        ));
    }
    let prediction = predict(trials, &pooled, &mut warnings);
    Ok(CfcResult {
        cuts,
        groups,
        pooled,
        trends,
        materials,
        prediction,
        warnings,
    })
}

/// Not one of so many cuts can be used: why the first cannot, with what would help it.
pub(crate) fn none_usable(cuts: usize, first_error: Option<Error>) -> Error {
    let none = format!("none of the {cuts} cuts can be used");
    match first_error {
        Some(Error::Input(first)) => InputError {
            problem: format!("{none}; the first: {}", first.problem),
            ..*first
        },
        Some(other) => InputError::new(format!("{none}; the first: {other}")),
        None => InputError::new(none),
    }
    .into()
}

fn add_rows(trials: &CuttingTrials, analysis: &CutAnalysis, rows: &mut Rows) -> Result<()> {
    for &axis in ForceAxis::of(analysis.process) {
        let row = average_row(trials.tool, &trials.cuts[analysis.cut].geometry, axis)?;
        rows.insert((analysis.cut, axis), row);
    }
    Ok(())
}

/// Torque opposes rotation; where all of it is negative the amplifier counts it the other way round.
fn turn_torque(cuts: &mut [CutAnalysis], warnings: &mut Vec<String>) {
    let torque = ForceAxis::Mz.index();
    let drilled = || {
        cuts.iter()
            .filter(|c| c.process == Process::Drilling)
            .filter_map(|c| c.averages[torque])
    };
    if drilled().count() == 0 || !drilled().all(|t| t.value < 0.0) {
        return;
    }
    for average in cuts.iter_mut().filter_map(|c| c.averages[torque].as_mut()) {
        average.value = -average.value;
    }
    warnings.push("Mz is negative in every hole: it is taken as counted the other way round".into());
}

/// The same record twice would count double; a repeated cut is welcome.
fn without_duplicates<'a>(
    trials: &CuttingTrials,
    cuts: &'a [CutAnalysis],
    warnings: &mut Vec<String>,
) -> Vec<&'a CutAnalysis> {
    let mut kept: Vec<&CutAnalysis> = Vec::new();
    for cut in cuts {
        let same_data = |a: &CutAnalysis| {
            (trials.cuts[a.cut].file == trials.cuts[cut.cut].file && a.is_same_stretch(cut))
                || (a.averages == cut.averages
                    && a.steady_s == cut.steady_s
                    && a.spindle_rpm == cut.spindle_rpm)
        };
        match kept.iter().find(|a| same_data(a)) {
            Some(first) => warnings.push(format!(
                "cut {} holds the same data as cut {} and is not counted again: one of the two has a wrong file",
                cut.id, first.id
            )),
            None => kept.push(cut),
        }
    }
    kept
}

/// Cutting speeds that differ by less, as a part, are one speed. A bar gets thinner with every cut, and lathes hold the speed at
/// the diameter that was entered.
fn one_speed(process: Process) -> f64 {
    match process {
        Process::Milling | Process::Drilling => 2e-3,
        Process::Turning => 0.05,
    }
}

/// One set per cutting speed that has two feeds or more; the cuts at other speeds together, if they have.
fn by_speed<'a>(cuts: &[&'a CutAnalysis], warnings: &mut Vec<String>) -> Vec<Vec<&'a CutAnalysis>> {
    let part = cuts.first().map_or(0.0, |c| one_speed(c.process));
    let mut speeds = distinct(cuts.iter().map(|c| c.cutting_speed_m_per_min));
    // Each set begins where the one before ends.
    speeds.dedup_by(|next, first| *next - *first <= part * *first);
    let set_of = |c: &CutAnalysis| {
        let at = speeds.partition_point(|s| *s <= c.cutting_speed_m_per_min * (1.0 + 1e-9));
        at.saturating_sub(1)
    };
    let (mut sets, mut rest): (Vec<Vec<&CutAnalysis>>, Vec<&CutAnalysis>) = (Vec::new(), Vec::new());
    for k in 0..speeds.len() {
        let set: Vec<&CutAnalysis> = cuts.iter().filter(|c| set_of(c) == k).copied().collect();
        if distinct(set.iter().map(|c| c.feed_mm)).len() >= 2 {
            sets.push(set);
        } else {
            rest.extend(set);
        }
    }
    if rest.is_empty() {
        return sets;
    }
    rest.sort_by_key(|c| c.cut);
    let ids: Vec<&str> = rest.iter().map(|c| c.id.as_str()).collect();
    let enough = distinct(rest.iter().map(|c| c.feed_mm)).len() >= 2;
    if enough && speeds.len() > 1 {
        warnings.push(format!(
            "cut {}: one feed only at its speed; these cuts are taken as one group over their speeds",
            ids.join(", ")
        ));
    } else if !sets.is_empty() {
        warnings.push(format!(
            "cut {}: one feed only at its speed, so that cutting and edge parts cannot be separated there; used in the pooled fit alone",
            ids.join(", ")
        ));
    }
    if enough || sets.is_empty() {
        sets.push(rest);
    }
    sets
}

impl CfcResult {
    /// The pooled fit's R² by axis (x, y, z, torque) of the first process.
    pub fn r2(&self) -> [Option<f64>; 4] {
        self.pooled.first().map_or([None; 4], |g| g.r2)
    }

    /// An average by cut and axis.
    pub fn average(&self, cut: usize, axis: ForceAxis) -> Option<Average> {
        self.cuts
            .iter()
            .find(|c| c.cut == cut)
            .and_then(|c| c.averages[axis.index()])
    }
}
