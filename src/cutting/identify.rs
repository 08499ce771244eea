//! From a campaign's records to its cutting force coefficients.

use rayon::prelude::*;

use super::average::pool_scatter;
use super::average_force::{ForceAxis, average_row};
use super::group::{Group, Rows, distinct, observations};
use super::in_step::{InStep, read_in_step};
use super::orthogonal::{Prediction, predict};
use super::outlier::misfits;
use super::plausibility;
use super::record::{Average, CutAnalysis};
use super::series::{MaterialComparison, Series, SpeedTrends, compare, speed_trends};
use super::turning_checks::of_turning;
use super::warnings;
use crate::campaign::{Campaign, CutGeometry, Process};
use crate::progress::Progress;
use crate::{Error, InputError, Result};

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct CfcOptions {
    /// Edge coefficients are held at zero or above.
    pub nonnegative_edges: bool,
    /// Huber's robust regression where there are cuts enough; else it is the second opinion.
    pub robust: bool,
}

/// What the dynamometer records say.
#[derive(Debug, Clone)]
pub struct CfcResult {
    /// Every usable cut, in the campaign's order.
    pub cuts: Vec<CutAnalysis>,
    /// One per process, material and cutting speed where the feeds at that speed suffice; otherwise speeds are pooled.
    pub groups: Vec<Group>,
    /// All cuts of a process and a material together, one group each.
    pub pooled: Vec<Group>,
    /// What each coefficient does over cutting speed, per process and material with two speeds or more.
    pub trends: Vec<SpeedTrends>,
    /// Each further material against the first one of its process.
    pub materials: Vec<MaterialComparison>,
    /// Milling coefficients from the orthogonal database beside those of the cuts.
    pub prediction: Option<Prediction>,
    pub warnings: Vec<String>,
}

/// Reads every cut's record (in parallel, one record in memory per thread) and fits the coefficients.
/// A cut that cannot be used is left out with a warning that names it.
///
/// # Errors
/// No cuts, no tool, or not one usable record.
pub fn identify_forces(campaign: &Campaign, options: CfcOptions) -> Result<CfcResult> {
    if campaign.cuts.is_empty() {
        return Err(
            InputError::new("the campaign has no [[cut]]: nothing to identify cutting forces from")
                .file(campaign.dir.join("campaign.toml"))
                .key("cut")
                .remedy("add [[cut]] tables that name the force records")
                .into(),
        );
    }
    let progress = Progress::new("force records", campaign.cuts.len());
    let outcomes: Vec<Result<CutAnalysis>> = (0..campaign.cuts.len())
        .into_par_iter()
        .map(|i| {
            let outcome = read_in_step(campaign, i, InStep::Fully).map(|(_, analysis)| analysis);
            progress.step();
            outcome
        })
        .collect();
    from_analyses(campaign, outcomes, options)
}

/// The part after the records are read: regression and warnings.
pub fn from_analyses(
    campaign: &Campaign,
    outcomes: Vec<Result<CutAnalysis>>,
    options: CfcOptions,
) -> Result<CfcResult> {
    let mut warnings = Vec::new();
    let (mut cuts, mut first_error, mut rows) = (Vec::new(), None, Rows::new());
    for (cut, outcome) in campaign.cuts.iter().zip(outcomes) {
        let usable = outcome.and_then(|analysis| {
            add_rows(campaign, &analysis, &mut rows)?;
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
        let cause = first_error.map_or_else(String::new, |e| format!("; the first: {e}"));
        let problem = format!("none of the {} cuts can be used{cause}", campaign.cuts.len());
        return Err(InputError::new(problem)
            .file(campaign.dir.join("campaign.toml"))
            .key("cut")
            .into());
    }
    pool_scatter(&mut cuts, &campaign.dynamometer.tool_from_dyno);
    turn_torque(&mut cuts, &mut warnings);
    let counted = without_duplicates(campaign, &cuts, &mut warnings);
    warnings.extend(warnings::of_records(campaign, &cuts));

    let (mut groups, mut pooled) = (Vec::new(), Vec::new());
    let (mut trends, mut materials) = (Vec::new(), Vec::new());
    for process in Process::ALL {
        let of_process: Vec<&CutAnalysis> =
            counted.iter().copied().filter(|c| c.process == process).collect();
        let mut series: Vec<Series> = Vec::new();
        for cut in of_process {
            let material = campaign.cuts[cut.cut].material.as_deref();
            match series.iter_mut().find(|s| s.material == material) {
                Some(one) => one.cuts.push(cut),
                None => series.push(Series {
                    process,
                    material,
                    cuts: vec![cut],
                }),
            }
        }
        for one in &series {
            let Some(all) = Group::fit(&one.cuts, one.material, &rows, options)? else {
                continue;
            };
            let mut told = plausibility::of_scales(campaign, &one.cuts, process);
            told.extend(warnings::of_plan(campaign, &one.cuts, process));
            if process == Process::Turning {
                told.extend(of_turning(campaign, &one.cuts));
            }
            let first_group = groups.len();
            for set in by_speed(&one.cuts, &mut told) {
                groups.extend(Group::fit(&set, one.material, &rows, options)?);
            }
            let misfits = misfits(&observations(&one.cuts, &rows));
            told.extend(misfits.iter().map(|m| warnings::of_misfit(campaign, m)));
            let by_speed: Vec<&Group> = groups[first_group..].iter().collect();
            told.extend(warnings::of_fits(&all, &by_speed));
            told.extend(warnings::of_shape(campaign, &all));
            told.extend(warnings::of_methods(&all, &by_speed, options));
            if let Some(found) = speed_trends(campaign, one, &rows) {
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
    let prediction = predict(campaign, &pooled, &mut warnings);
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

fn add_rows(campaign: &Campaign, analysis: &CutAnalysis, rows: &mut Rows) -> Result<()> {
    let Some(tool) = campaign.tool.as_ref() else {
        return Err(Error::computation(
            "[tool] is missing: cutting forces need its teeth and diameter",
        ));
    };
    for &axis in ForceAxis::of(analysis.process) {
        let row = average_row(tool, &campaign.cuts[analysis.cut].geometry, axis)?;
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
    campaign: &Campaign,
    cuts: &'a [CutAnalysis],
    warnings: &mut Vec<String>,
) -> Vec<&'a CutAnalysis> {
    let mut kept: Vec<&CutAnalysis> = Vec::new();
    for cut in cuts {
        let same_data = |a: &CutAnalysis| {
            campaign.cuts[a.cut].file == campaign.cuts[cut.cut].file
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
/// the diameter that they were told.
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

/// Depth that a cut is known by: axial depth (milling), hole depth (drilling), depth of cut (turning), mm.
pub fn depth_mm(geometry: &CutGeometry) -> Option<f64> {
    match *geometry {
        CutGeometry::Milling { axial_depth_mm, .. } => Some(axial_depth_mm),
        CutGeometry::Drilling { hole_depth_mm, .. } => hole_depth_mm,
        CutGeometry::Turning { depth_of_cut_mm, .. } => Some(depth_of_cut_mm),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutting::made_records::{MadeCut, TRUTH, write_campaign_of};

    /// Slots with a ball end: the radial force has an axial part, so that all six coefficients hang together.
    #[test]
    fn a_ball_end_gives_back_its_coefficients() {
        let dir = tempfile::tempdir().unwrap();
        let cuts = [0.04, 0.08, 0.12, 0.16].map(|feed_mm| MadeCut {
            rpm: 1500.0,
            feed_mm,
            speed: &|_| 1.0,
        });
        let campaign = write_campaign_of(dir.path(), 5.0, &cuts, &|_, _, _, _, _| 0.0);
        let result = identify_forces(&campaign, CfcOptions::default()).unwrap();
        let found = &result.pooled[0];
        for (coefficient, truth) in found.coefficients.iter().zip(TRUTH) {
            let (value, std) = (coefficient.value.unwrap(), coefficient.std_error.unwrap());
            assert!((value - truth).abs() < 4.0 * std, "{value} ± {std} for {truth}");
            assert!(std < 0.02 * truth.max(50.0), "± {std} of {truth}");
        }
        assert!(found.r2.iter().flatten().all(|r2| *r2 > 0.999));
        assert!(result.warnings.is_empty(), "{:?}", result.warnings);
        // Taken for a straight end mill the radial force comes out a third too small.
        let straight = write_campaign_of(dir.path(), 0.0, &[], &|_, _, _, _, _| 0.0);
        let wrong = Campaign {
            tool: straight.tool,
            ..campaign
        };
        let wrong = identify_forces(&wrong, CfcOptions::default()).unwrap();
        assert!(wrong.pooled[0].coefficients[1].value.unwrap() < 0.7 * TRUTH[1]);
    }
}
