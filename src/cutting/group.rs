//! Cuts that share their coefficients, and the regression over them.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use super::average_force::{ForceAxis, coefficients_of};
use super::constrained::nonnegative_least_squares;
use super::record::CutAnalysis;
use super::regression::{Fit, Observation, fit};
use crate::Result;
use crate::campaign::Process;

/// A coefficient, or the admission that the data does not determine it.
#[derive(Debug, Clone, PartialEq)]
pub struct Coefficient {
    pub key: &'static str,
    pub label: &'static str,
    pub unit: &'static str,
    /// An edge coefficient (N/mm), else a cutting coefficient (N/mm²).
    pub edge: bool,
    pub value: Option<f64>,
    /// `None` too where a constraint holds the value.
    pub std_error: Option<f64>,
    /// Held at zero by `--nonnegative-edges`.
    pub constraint_active: bool,
}

/// A point of the regression, for lists and plots.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct RegressionPoint {
    pub cut: String,
    pub axis: ForceAxis,
    /// Per tooth (milling), per revolution (drilling).
    pub feed_mm: f64,
    /// N; N·m on the torque axis. So are the next two.
    pub measured: f64,
    pub std_error: f64,
    pub fitted: f64,
}

/// The regression over a set of cuts of one process.
#[derive(Debug, Clone)]
pub struct Group {
    pub process: Process,
    /// Mean over the cuts.
    pub cutting_speed_m_per_min: f64,
    /// Slowest and fastest cut.
    pub cutting_speed_range_m_per_min: [f64; 2],
    /// Cut ids, in the campaign's order.
    pub cuts: Vec<String>,
    /// Number of different feeds.
    pub feeds: usize,
    pub coefficients: Vec<Coefficient>,
    /// Names of coefficients that only a combination of is determined.
    pub inseparable: Vec<Vec<&'static str>>,
    /// By axis (x, y, z, torque).
    pub r2: [Option<f64>; 4],
    pub chi2_per_dof: [Option<f64>; 4],
    /// Scatter of the averages beyond their own errors (N; N·m), by axis.
    pub extra_scatter: [f64; 4],
    pub points: Vec<RegressionPoint>,
}

/// The averages of cuts as observations, with the model's row for each.
pub(super) fn observations(cuts: &[&CutAnalysis], rows: &Rows) -> Vec<Observation> {
    let mut all = Vec::new();
    for analysis in cuts {
        for &axis in ForceAxis::of(analysis.process) {
            let average = analysis.averages[axis.index()];
            if let (Some(average), Some(row)) = (average, rows.get(&(analysis.cut, axis))) {
                all.push(Observation {
                    cut: analysis.cut,
                    axis,
                    row: row.clone(),
                    value: average.value,
                    std_error: average.std_error,
                });
            }
        }
    }
    all
}

/// Rows of the linear model by cut index and axis.
pub(super) type Rows = BTreeMap<(usize, ForceAxis), Vec<f64>>;

impl Group {
    /// Fits one group; `None` where its cuts hold no average at all.
    ///
    /// # Errors
    /// The constrained regression fails.
    pub(super) fn fit(cuts: &[&CutAnalysis], rows: &Rows, nonnegative_edges: bool) -> Result<Option<Group>> {
        let observations = observations(cuts, rows);
        let (Some(first), Some(fit)) = (cuts.first(), fit(&observations)) else {
            return Ok(None);
        };
        let kinds = coefficients_of(first.process);
        let mut group = Group {
            process: first.process,
            cutting_speed_m_per_min: cuts.iter().map(|c| c.cutting_speed_m_per_min).sum::<f64>()
                / cuts.len() as f64,
            cutting_speed_range_m_per_min: [
                cuts.iter()
                    .map(|c| c.cutting_speed_m_per_min)
                    .fold(f64::INFINITY, f64::min),
                cuts.iter()
                    .map(|c| c.cutting_speed_m_per_min)
                    .fold(f64::NEG_INFINITY, f64::max),
            ],
            cuts: cuts.iter().map(|c| c.id.clone()).collect(),
            feeds: distinct(cuts.iter().map(|c| c.feed_mm)).len(),
            coefficients: kinds
                .iter()
                .enumerate()
                .map(|(j, kind)| Coefficient {
                    key: kind.key,
                    label: kind.label,
                    unit: kind.unit,
                    edge: kind.edge,
                    value: fit.value[j],
                    std_error: fit.std_error[j],
                    constraint_active: false,
                })
                .collect(),
            inseparable: fit
                .inseparable
                .iter()
                .map(|set| set.iter().map(|&j| kinds[j].label).collect())
                .collect(),
            r2: fit.r2,
            chi2_per_dof: fit.chi2_per_dof,
            extra_scatter: fit.extra_scatter,
            points: Vec::new(),
        };
        let mut solution = fit.solution.clone();
        if nonnegative_edges && fit.inseparable.is_empty() {
            solution = group.constrain(&observations, &fit)?;
        }
        group.points = observations
            .iter()
            .zip(cuts_of(&observations, cuts))
            .map(|(o, cut)| RegressionPoint {
                cut: cut.map_or_else(String::new, |c| c.id.clone()),
                axis: o.axis,
                feed_mm: cut.map_or(0.0, |c| c.feed_mm),
                measured: o.value,
                std_error: o.std_error,
                fitted: o.row.iter().zip(&solution).map(|(r, x)| r * x).sum(),
            })
            .collect();
        Ok(Some(group))
    }

    /// Replaces the coefficients by those with edges ≥ 0. Errors are those of the fit without the held ones.
    fn constrain(&mut self, observations: &[Observation], free: &Fit) -> Result<Vec<f64>> {
        let edges: Vec<bool> = self.coefficients.iter().map(|c| c.edge).collect();
        let constrained = nonnegative_least_squares(observations, &free.weight, &edges)?;
        if !constrained.active.contains(&true) {
            return Ok(free.solution.clone());
        }
        let kept: Vec<usize> = (0..edges.len()).filter(|&j| !constrained.active[j]).collect();
        let reduced: Vec<Observation> = observations
            .iter()
            .map(|o| Observation {
                row: kept.iter().map(|&j| o.row[j]).collect(),
                ..o.clone()
            })
            .collect();
        let errors = fit(&reduced);
        for (j, coefficient) in self.coefficients.iter_mut().enumerate() {
            coefficient.value = Some(constrained.value[j]);
            coefficient.constraint_active = constrained.active[j];
            coefficient.std_error = kept
                .iter()
                .position(|&k| k == j)
                .and_then(|k| errors.as_ref().and_then(|e| e.std_error[k]));
        }
        if let Some(errors) = errors {
            (self.r2, self.chi2_per_dof, self.extra_scatter) =
                (errors.r2, errors.chi2_per_dof, errors.extra_scatter);
        }
        Ok(constrained.value)
    }

    pub fn coefficient(&self, label: &str) -> Option<&Coefficient> {
        self.coefficients.iter().find(|c| c.label == label)
    }

    /// True where every coefficient is determined.
    pub fn is_complete(&self) -> bool {
        self.coefficients.iter().all(|c| c.value.is_some())
    }

    /// The contract's form of a group (campaign.md), with a few keys more.
    pub fn to_json(&self) -> Value {
        let mut map = Map::new();
        map.insert("process".into(), json!(self.process));
        map.insert(
            "cutting_speed_m_per_min".into(),
            json!(self.cutting_speed_m_per_min),
        );
        map.insert(
            "cutting_speed_range_m_per_min".into(),
            json!(self.cutting_speed_range_m_per_min),
        );
        map.insert("cuts".into(), json!(self.cuts));
        map.insert("feeds".into(), json!(self.feeds));
        for c in &self.coefficients {
            let mut entry = json!({"value": c.value, "std_error": c.std_error});
            if c.constraint_active {
                entry["constraint_active"] = json!(true);
            }
            map.insert(c.key.into(), entry);
        }
        map.insert("inseparable".into(), json!(self.inseparable));
        map.insert("r2".into(), by_axis(self.process, &self.r2));
        map.insert("chi2_per_dof".into(), by_axis(self.process, &self.chi2_per_dof));
        map.insert(
            "extra_scatter".into(),
            by_axis(self.process, &self.extra_scatter.map(Some)),
        );
        map.insert("points".into(), json!(self.points));
        Value::Object(map)
    }
}

/// `{x, y, z}` and for drilling `mz`; what the process does not use is null.
pub(crate) fn by_axis(process: Process, values: &[Option<f64>; 4]) -> Value {
    let used = |axis: ForceAxis| values[axis.index()].filter(|_| ForceAxis::of(process).contains(&axis));
    let mut map = json!({"x": used(ForceAxis::X), "y": used(ForceAxis::Y), "z": used(ForceAxis::Z)});
    if process == Process::Drilling {
        map["mz"] = json!(used(ForceAxis::Mz));
    }
    map
}

fn cuts_of<'a>(observations: &[Observation], cuts: &[&'a CutAnalysis]) -> Vec<Option<&'a CutAnalysis>> {
    observations
        .iter()
        .map(|o| cuts.iter().find(|c| c.cut == o.cut).copied())
        .collect()
}

/// The different values, ascending; what agrees within 0.1 % is the same.
pub(super) fn distinct(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup_by(|b, a| (*b - *a).abs() <= 1e-3 * a.abs());
    sorted
}
