//! From a campaign's records to its cutting force coefficients.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::average_force::{ForceAxis, average_row};
use super::group::{Group, Rows, distinct, observations};
use super::outlier::misfits;
use super::record::{Average, CutAnalysis, NO_AIR, analyse_cut};
use crate::campaign::{Campaign, CutGeometry, Process};
use crate::progress::Progress;
use crate::{Error, Result, ingest};

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct CfcOptions {
    /// Edge coefficients are held at zero or above.
    pub nonnegative_edges: bool,
}

/// What the dynamometer records say.
#[derive(Debug, Clone)]
pub struct CfcResult {
    /// Every usable cut, in the campaign's order.
    pub cuts: Vec<CutAnalysis>,
    /// One per process and cutting speed where the feeds at that speed suffice; otherwise speeds are pooled.
    pub groups: Vec<Group>,
    /// All cuts of a process together, one group per process.
    pub pooled: Vec<Group>,
    pub warnings: Vec<String>,
}

/// Reads every cut's record (in parallel, one record in memory per thread) and fits the coefficients.
/// A cut that cannot be used is left out with a warning that names it.
///
/// # Errors
/// No cuts, no tool, or not one usable record.
pub fn identify_forces(campaign: &Campaign, options: CfcOptions) -> Result<CfcResult> {
    if campaign.cuts.is_empty() {
        return Err(Error::computation(format!(
            "{}: the campaign has no [[cut]]: nothing to identify cutting forces from",
            campaign.dir.display()
        )));
    }
    let progress = Progress::new("force records", campaign.cuts.len());
    let outcomes: Vec<Result<CutAnalysis>> = (0..campaign.cuts.len())
        .into_par_iter()
        .map(|i| {
            let outcome = read_cut(campaign, i);
            progress.step();
            outcome
        })
        .collect();
    from_analyses(campaign, outcomes, options)
}

fn read_cut(campaign: &Campaign, index: usize) -> Result<CutAnalysis> {
    let (record, _) = ingest::read_time(&campaign.cuts[index].file)?;
    analyse_cut(campaign, index, &record)
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
        return Err(Error::computation(format!(
            "none of the {} cuts can be used{cause}",
            campaign.cuts.len()
        )));
    }
    turn_torque(&mut cuts, &mut warnings);
    let counted = without_duplicates(campaign, &cuts, &mut warnings);
    record_warnings(&cuts, &mut warnings);

    let (mut groups, mut pooled) = (Vec::new(), Vec::new());
    for process in [Process::Milling, Process::Drilling] {
        let of_process: Vec<&CutAnalysis> =
            counted.iter().copied().filter(|c| c.process == process).collect();
        let Some(all) = Group::fit(&of_process, &rows, options.nonnegative_edges)? else {
            continue;
        };
        missing_cells(campaign, &of_process, process, &mut warnings);
        for set in by_speed(&of_process, &mut warnings) {
            groups.extend(Group::fit(&set, &rows, options.nonnegative_edges)?);
        }
        for misfit in misfits(&observations(&of_process, &rows)) {
            let unit = misfit.axis.unit();
            warnings.push(format!(
                "cut {} does not fit the others: {} {:.2} {unit} measured, {:.2} {unit} from the other cuts",
                campaign.cuts[misfit.cut].id,
                misfit.axis.label(),
                misfit.measured,
                misfit.predicted
            ));
        }
        fit_warnings(&all, &groups, &mut warnings);
        pooled.push(all);
    }
    if groups.is_empty() {
        return Err(Error::computation(
            "no cut holds an average on an axis that carries coefficients: check that Fx, Fy, Fz (drilling: Fz, Mz) are recorded",
        ));
    }
    Ok(CfcResult {
        cuts,
        groups,
        pooled,
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

/// Notices of all records, one sentence a kind.
fn record_warnings(cuts: &[CutAnalysis], warnings: &mut Vec<String>) {
    let mut by_kind: BTreeMap<&str, Vec<(&str, &str)>> = BTreeMap::new();
    for cut in cuts {
        for notice in &cut.notices {
            by_kind
                .entry(notice.kind)
                .or_default()
                .push((&cut.id, &notice.detail));
        }
    }
    for (kind, told) in by_kind {
        let list: Vec<String> = told
            .iter()
            .map(|(id, detail)| {
                if detail.is_empty() {
                    (*id).to_string()
                } else {
                    format!("{id} ({detail})")
                }
            })
            .collect();
        let mut ids: Vec<&str> = told.iter().map(|(id, _)| *id).collect();
        ids.dedup();
        let who = if ids.len() == cuts.len() && kind == NO_AIR {
            "all cuts".to_string()
        } else {
            format!("cut {}", list.join(", "))
        };
        warnings.push(format!("{who}: {kind}"));
    }
}

/// One set per cutting speed that has two feeds or more; the cuts at other speeds together, if they have.
fn by_speed<'a>(cuts: &[&'a CutAnalysis], warnings: &mut Vec<String>) -> Vec<Vec<&'a CutAnalysis>> {
    let speeds = distinct(cuts.iter().map(|c| c.cutting_speed_m_per_min));
    let (mut sets, mut rest): (Vec<Vec<&CutAnalysis>>, Vec<&CutAnalysis>) = (Vec::new(), Vec::new());
    for speed in &speeds {
        let same = |c: &&&CutAnalysis| (c.cutting_speed_m_per_min - speed).abs() <= 2e-3 * speed;
        let set: Vec<&CutAnalysis> = cuts.iter().filter(same).copied().collect();
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

/// Cells of a speed × feed plan that stayed empty, where there clearly was a plan.
fn missing_cells(campaign: &Campaign, cuts: &[&CutAnalysis], process: Process, warnings: &mut Vec<String>) {
    let speeds = distinct(cuts.iter().map(|c| c.spindle_rpm));
    let feeds = distinct(cuts.iter().map(|c| c.feed_mm));
    if speeds.len() < 2 || feeds.len() < 2 {
        return;
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
        return;
    }
    let per = match process {
        Process::Milling => "tooth",
        Process::Drilling => "revolution",
    };
    let listed = campaign
        .cuts
        .iter()
        .filter(|c| c.geometry.process() == process)
        .count();
    warnings.push(format!(
        "the plan of {} speeds and {} feeds per {per} has no usable cut at {} ({listed} cuts listed): errors grow most for the edge coefficients",
        speeds.len(),
        feeds.len(),
        empty.join(", ")
    ));
}

/// What the regression itself has to say.
fn fit_warnings(all: &Group, groups: &[Group], warnings: &mut Vec<String>) {
    let mine: Vec<&Group> = groups.iter().filter(|g| g.process == all.process).collect();
    let told = |g: &Group| format!("{} m/min", speed_text(g));
    for group in mine
        .iter()
        .copied()
        .chain((!mine.iter().any(|g| g.cuts == all.cuts)).then_some(all))
    {
        for set in &group.inseparable {
            let why = if set.len() == 1 {
                "is not determined: no record carries it".to_string()
            } else if group.feeds < 2 {
                "cannot be separated with one feed: cut at two feeds or more (best three, wide apart)"
                    .to_string()
            } else {
                "cannot be separated by these cuts".to_string()
            };
            warnings.push(format!("{}: {} {why}", told(group), set.join(" and ")));
        }
        for c in &group.coefficients {
            let (Some(value), Some(error)) = (c.value, c.std_error) else {
                if c.constraint_active {
                    warnings.push(format!(
                        "{}: {} is held at zero by the constraint",
                        told(group),
                        c.label
                    ));
                }
                continue;
            };
            if value < -2.0 * error {
                let remedy = if c.edge {
                    "physically implausible; drift or a missing effect is likely, --nonnegative-edges holds it at zero"
                } else {
                    "check tool_from_dyno and the immersion angles"
                };
                warnings.push(format!(
                    "{}: {} = {value:.2} {} is negative: {remedy}",
                    told(group),
                    c.label,
                    c.unit
                ));
            } else if !c.edge && error > 0.5 * value.abs() {
                warnings.push(format!(
                    "{}: {} = {value:.1} ± {error:.1} {}: feeds too few or too close",
                    told(group),
                    c.label,
                    c.unit
                ));
            }
        }
    }
    let two_feeds: Vec<String> = mine.iter().filter(|g| g.feeds == 2).map(|g| told(g)).collect();
    if !two_feeds.is_empty() {
        warnings.push(format!(
            "{}: two feeds only: a line always fits them, so nothing checks the model there",
            two_feeds.join(", ")
        ));
    }
    for &axis in ForceAxis::of(all.process) {
        let a = axis.index();
        let on_axis = || all.points.iter().filter(|p| p.axis == axis);
        let size =
            (on_axis().map(|p| p.measured.powi(2)).sum::<f64>() / on_axis().count().max(1) as f64).sqrt();
        let extra = all.extra_scatter[a];
        if all.chi2_per_dof[a].is_some_and(|c| c > 4.0) && extra > 0.02 * size {
            warnings.push(format!(
                "{}: the averages of all cuts scatter by {:.2} {} ({:.0} %) more than their errors: one set of coefficients does not hold for all; compare the speeds, and look at runout, wear and drift",
                axis.label(),
                extra,
                axis.unit(),
                100.0 * extra / size
            ));
        }
    }
}

/// `58.3` or `45.1–81.4`, m/min.
pub(crate) fn speed_text(group: &Group) -> String {
    let [low, high] = group.cutting_speed_range_m_per_min;
    if high - low <= 2e-3 * high {
        format!("{:.1}", group.cutting_speed_m_per_min)
    } else {
        format!("{low:.1}–{high:.1}")
    }
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

/// Depth that a cut is known by: axial depth (milling), hole depth (drilling), mm.
pub(crate) fn depth_mm(geometry: &CutGeometry) -> Option<f64> {
    match *geometry {
        CutGeometry::Milling { axial_depth_mm, .. } => Some(axial_depth_mm),
        CutGeometry::Drilling { hole_depth_mm, .. } => hole_depth_mm,
    }
}
