//! Cuts that share their coefficients, and the regression over them.

use std::collections::BTreeMap;

use crate::Result;
use crate::cutting::fit::estimate::{CfcOptions, CoefficientEstimate, RegressionMethod, bootstrap, estimate};
use crate::cutting::fit::outlier::studentized;
use crate::cutting::fit::regression::{CoefficientFit, Observation, fit, r2};
use crate::cutting::force_model::coefficients::{CoefficientKind, coefficients_of};
use crate::cutting::force_model::force_axis::ForceAxis;
use crate::cutting::measured::cut_analysis::CutAnalysis;
use crate::data::Process;

/// A coefficient, or the admission that the data does not determine it.
#[derive(Debug, Clone, PartialEq)]
pub struct Coefficient {
    /// Key in JSON, with unit.
    pub key: &'static str,
    /// Symbol, for people: `Ktc`.
    pub label: &'static str,
    /// Unit, for people.
    pub unit: &'static str,
    /// An edge coefficient (N/mm), else a cutting coefficient (N/mm²).
    pub edge: bool,
    /// In `unit`; `None` where the data does not determine it.
    pub value: Option<f64>,
    /// `None` too where a constraint holds the value.
    pub std_error: Option<f64>,
    /// From drawing the cuts again; `None` with too few cuts.
    pub std_error_bootstrap: Option<f64>,
    /// By what teeth that cut unequally move it, in `unit`, as far as the records tell how unequally; the standard errors allow for it. 0
    /// where they cut alike.
    pub moved_by_teeth: f64,
    /// Held at zero by `--nonnegative-edges`.
    pub constraint_active: bool,
    /// What it would be with no constraint on any coefficient; only where a constraint is active on this one.
    pub unconstrained: Option<KnownValue>,
    /// By the other of the two methods; `None` where there are too few cuts for a robust one.
    pub other_method: Option<KnownValue>,
}

/// A value and its standard error.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct KnownValue {
    /// The value, in the unit of what it is a value of.
    pub value: f64,
    /// Its standard error, same unit; `None` where it is not known.
    pub std_error: Option<f64>,
}

/// How much one cut decides, and how it stands to the others.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Influence {
    /// The cut's id.
    pub cut: String,
    /// Largest over the axes; 1: nothing checks this cut.
    pub leverage: f64,
    /// Off the prediction from the other cuts, in standard errors of that difference; of the axis furthest off. `None`
    /// where too few other cuts are left to judge.
    pub studentized_residual: Option<f64>,
    /// Axis of `studentized_residual`.
    pub axis: Option<ForceAxis>,
    /// What robust regression leaves of its weight, 0…1, on the axis where it leaves least; 1 with least squares.
    pub weight_share: f64,
}

/// A point of the regression, for lists and plots.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct RegressionPoint {
    /// The cut's id.
    pub cut: String,
    /// Which of its averages.
    pub axis: ForceAxis,
    /// Per tooth (milling), per revolution (drilling, turning).
    pub feed_mm: f64,
    /// N; N·m on the torque axis. So are the next two.
    pub measured: f64,
    /// Measurement error of `measured`.
    pub std_error: f64,
    /// By the coefficients of the group.
    pub fitted: f64,
    /// Diagonal of the weighted hat matrix, 0…1.
    pub leverage: f64,
    /// Externally studentised, the whole cut left out; `None` where too few other cuts are left.
    pub studentized_residual: Option<f64>,
    /// What robust regression leaves of its weight, 0…1.
    pub weight_share: f64,
}

/// The regression over a set of cuts of one process.
#[derive(Debug, Clone)]
pub struct ForceGroup {
    /// How its cuts were made.
    pub process: Process,
    /// As the campaign names it.
    pub material: Option<String>,
    /// Mean over the cuts.
    pub cutting_speed_m_per_min: f64,
    /// Slowest and fastest cut.
    pub cutting_speed_range_m_per_min: [f64; 2],
    /// Cut ids, in the campaign's order.
    pub cuts: Vec<String>,
    /// Number of different feeds.
    pub feeds: usize,
    /// How the coefficients were drawn from the averages.
    pub method: RegressionMethod,
    /// In the order of [`coefficients_of`].
    pub coefficients: Vec<Coefficient>,
    /// Names of coefficients that only a combination of is determined.
    pub inseparable: Vec<Vec<&'static str>>,
    /// By axis (x, y, z, torque).
    pub r2: [Option<f64>; 4],
    /// Σ (residual/standard error)² per degree of freedom, by axis; `None` without degrees of freedom.
    pub chi2_per_dof: [Option<f64>; 4],
    /// Scatter of the averages beyond their own errors (N; N·m), by axis.
    pub extra_scatter: [f64; 4],
    /// Every average that was used.
    pub points: Vec<RegressionPoint>,
    /// By cut, as `cuts`.
    pub influence: Vec<Influence>,
}

/// Degrees of freedom that every axis must have for a robust regression to know what is off.
const ROBUST_DOF: f64 = 3.0 - 1e-6;

/// The averages of cuts as observations, with the model's row for each.
pub(crate) fn observations(cuts: &[&CutAnalysis], rows: &Rows) -> Vec<Observation> {
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
pub(crate) type Rows = BTreeMap<(usize, ForceAxis), Vec<f64>>;

impl ForceGroup {
    /// Fits one group; `None` where its cuts hold no average at all.
    ///
    /// # Errors
    /// The conic program fails.
    pub(crate) fn fit(
        cuts: &[&CutAnalysis],
        material: Option<&str>,
        rows: &Rows,
        options: CfcOptions,
    ) -> Result<Option<ForceGroup>> {
        let observations = observations(cuts, rows);
        let (Some(first), Some(fitted)) = (cuts.first(), fit(&observations)) else {
            return Ok(None);
        };
        let moved_by_teeth = moved_by_teeth(&fitted, &observations, cuts);
        let free = fitted.covering(&observations);
        let speeds = || cuts.iter().map(|c| c.cutting_speed_m_per_min);
        let mut group = ForceGroup {
            process: first.process,
            material: material.map(str::to_string),
            cutting_speed_m_per_min: speeds().sum::<f64>() / cuts.len() as f64,
            cutting_speed_range_m_per_min: [
                speeds().fold(f64::INFINITY, f64::min),
                speeds().fold(f64::NEG_INFINITY, f64::max),
            ],
            cuts: cuts.iter().map(|c| c.id.clone()).collect(),
            feeds: distinct(cuts.iter().map(|c| c.feed_mm)).len(),
            method: RegressionMethod::LeastSquares,
            coefficients: free_coefficients(first.process, &free),
            inseparable: free
                .inseparable
                .iter()
                .map(|set| {
                    set.iter()
                        .map(|&j| coefficients_of(first.process)[j].label)
                        .collect()
                })
                .collect(),
            r2: free.r2,
            chi2_per_dof: free.chi2_per_dof,
            extra_scatter: free.extra_scatter,
            points: Vec::new(),
            influence: Vec::new(),
        };
        let (mut solution, mut share) = (free.solution.clone(), vec![1.0; observations.len()]);
        if free.inseparable.is_empty() {
            let chosen = group.choose(&observations, &free, options)?;
            (solution, share) = (chosen.value, chosen.share);
        }
        for (coefficient, moved) in group.coefficients.iter_mut().zip(moved_by_teeth) {
            coefficient.moved_by_teeth = moved;
            for std in [&mut coefficient.std_error, &mut coefficient.std_error_bootstrap] {
                *std = std.map(|std| std.hypot(moved));
            }
        }
        group.points = observations
            .iter()
            .zip(cuts_of(&observations, cuts))
            .zip(studentized(&observations))
            .enumerate()
            .map(|(i, ((o, cut), studentized_residual))| RegressionPoint {
                cut: cut.map_or_else(String::new, |c| c.id.clone()),
                axis: o.axis,
                feed_mm: cut.map_or(0.0, |c| c.feed_mm),
                measured: o.value,
                std_error: o.std_error,
                fitted: o.row.iter().zip(&solution).map(|(r, x)| r * x).sum(),
                leverage: free.leverage[i],
                studentized_residual,
                weight_share: share[i],
            })
            .collect();
        group.influence = group
            .cuts
            .iter()
            .map(|cut| influence(cut, &group.points))
            .collect();
        Ok(Some(group))
    }

    /// Puts in the coefficients by the method that was asked for, with what the other method, a fit without
    /// constraints and the bootstrap say. Errors are those of the fit without the held coefficients.
    fn choose(
        &mut self,
        observations: &[Observation],
        free: &CoefficientFit,
        options: CfcOptions,
    ) -> Result<CoefficientEstimate> {
        let edges = |c: &Coefficient| options.nonnegative_edges && c.edge;
        let bounds: Vec<bool> = self.coefficients.iter().map(edges).collect();
        let used = |axis: &&ForceAxis| observations.iter().any(|o| o.axis == **axis);
        let robust_possible = ForceAxis::ALL
            .iter()
            .filter(used)
            .all(|a| free.dof[a.index()] >= ROBUST_DOF);
        let (method, other) = match options.robust && robust_possible {
            true => (RegressionMethod::Huber, RegressionMethod::LeastSquares),
            false => (RegressionMethod::LeastSquares, RegressionMethod::Huber),
        };
        let chosen = estimate(observations, free, &bounds, method)?;
        // Second opinions: where they fail there is none.
        let other = robust_possible
            .then(|| estimate(observations, free, &bounds, other).ok())
            .flatten();
        let unbounded = chosen
            .active
            .contains(&true)
            .then(|| estimate(observations, free, &vec![false; bounds.len()], method).ok())
            .flatten();
        let drawn = bootstrap(observations, &chosen, &bounds, method);
        let known = |estimate: &CoefficientEstimate, j: usize| KnownValue {
            value: estimate.value[j],
            std_error: estimate.std_error[j],
        };
        self.method = method;
        for (j, c) in self.coefficients.iter_mut().enumerate() {
            c.value = Some(chosen.value[j]);
            c.std_error = chosen.std_error[j];
            c.std_error_bootstrap = drawn.as_ref().map(|d| d[j]).filter(|_| !chosen.active[j]);
            c.constraint_active = chosen.active[j];
            c.unconstrained = unbounded
                .as_ref()
                .filter(|_| chosen.active[j])
                .map(|e| known(e, j));
            c.other_method = other.as_ref().map(|e| known(e, j));
        }
        self.extra_scatter = chosen.extra_scatter;
        self.r2 = r2(observations, &chosen.value);
        Ok(chosen)
    }

    /// Whether both are of one process and one material.
    pub fn is_beside(&self, other: &ForceGroup) -> bool {
        self.process == other.process && self.material == other.material
    }

    /// The coefficient with this symbol (`Ktc`).
    pub fn coefficient(&self, label: &str) -> Option<&Coefficient> {
        self.coefficients.iter().find(|c| c.label == label)
    }

    /// True where every coefficient is determined.
    pub fn is_complete(&self) -> bool {
        self.coefficients.iter().all(|c| c.value.is_some())
    }
}

/// By what the coefficients are off because teeth cut unequally.
fn moved_by_teeth(fitted: &CoefficientFit, observations: &[Observation], cuts: &[&CutAnalysis]) -> Vec<f64> {
    let change = cuts_of(observations, cuts)
        .into_iter()
        .zip(observations)
        .map(|(cut, o)| {
            let own = cut.and_then(|c| c.uneven_teeth.as_ref()?.change.get(o.axis.index()));
            own.map_or(0.0, |row| {
                row.iter().zip(&fitted.solution).map(|(r, k)| r * k).sum()
            })
        });
    fitted.change_with(observations, &change.collect::<Vec<f64>>())
}

/// What the ordinary fit says, before constraints and second opinions.
fn free_coefficients(process: Process, free: &CoefficientFit) -> Vec<Coefficient> {
    let one = |(j, kind): (usize, &CoefficientKind)| Coefficient {
        key: kind.key,
        label: kind.label,
        unit: kind.unit,
        edge: kind.edge,
        value: free.value[j],
        std_error: free.std_error[j],
        std_error_bootstrap: None,
        constraint_active: false,
        unconstrained: None,
        other_method: None,
        moved_by_teeth: 0.0,
    };
    coefficients_of(process).iter().enumerate().map(one).collect()
}

fn influence(cut: &str, points: &[RegressionPoint]) -> Influence {
    let own = || points.iter().filter(|p| p.cut == cut);
    let worst = own()
        .filter_map(|p| Some((p.studentized_residual?, p.axis)))
        .max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
    Influence {
        cut: cut.to_string(),
        leverage: own().map(|p| p.leverage).fold(0.0, f64::max),
        studentized_residual: worst.map(|w| w.0),
        axis: worst.map(|w| w.1),
        weight_share: own().map(|p| p.weight_share).fold(1.0, f64::min),
    }
}

fn cuts_of<'a>(observations: &[Observation], cuts: &[&'a CutAnalysis]) -> Vec<Option<&'a CutAnalysis>> {
    observations
        .iter()
        .map(|o| cuts.iter().find(|c| c.cut == o.cut).copied())
        .collect()
}

/// The different values, ascending; what agrees within 0.1 % is the same.
pub(crate) fn distinct(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup_by(|b, a| (*b - *a).abs() <= 1e-3 * a.abs());
    sorted
}
