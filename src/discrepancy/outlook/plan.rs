//! What a campaign that is not measured yet would show: how plainly each effect of the library would stand out of the
//! noise, which effects would be taken for each other, and which further measurements would mend that.
//!
//! The FRFs of an effect of usual size are made without noise, a rival (the baseline, or another effect with it) is fitted
//! to them, and sqrt(Σ r²/σ²) of what it leaves is the number of standard deviations at which it would be found out.

use rayon::prelude::*;
use serde::{Serialize, Serializer};

use crate::Result;
use crate::data::Posture;
use crate::discrepancy::outlook::lab::Lab;
use crate::effects::{DataSummary, Instance, Registry, Structure};
use crate::identify::frfs::frf_problem::FrfProblem;
use crate::identify::levenberg_marquardt::{Stopping, minimise};
use crate::identify::{FrfData, LeastSquares, StructureModel};

/// Standard deviations from which on an effect counts as seen, and two as told apart.
pub const SEEN_SIGMAS: f64 = 5.0;
/// Complex values that the fits use, about: enough to tell effects apart.
const VALUES: usize = 700;
/// Starting points of an effect's own parameters that are followed.
const STARTS: usize = 2;
/// Lacks (unseen effects, confused pairs) for which further measurements are looked for.
const MOST_LACKS: usize = 12;
const STOPPING: Stopping = Stopping {
    max_iterations: 15,
    relative_decrease: 1e-3,
};

/// How plainly an effect of usual size would show.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlannedEffect {
    /// Its id.
    pub effect: String,
    /// `joint-2`, `link-4`; `None` where the effect has no place of its own.
    pub site: Option<String>,
    /// Standard deviations after the baseline has taken in what it can.
    pub sigmas: f64,
    /// The size that was assumed: name, value, unit.
    #[serde(serialize_with = "values_by_name")]
    pub size: Vec<(String, f64, &'static str)>,
}

/// An object with a number for each name.
fn values_by_name<S: Serializer>(
    size: &[(String, f64, &'static str)],
    serializer: S,
) -> std::result::Result<S::Ok, S::Error> {
    serializer.collect_map(size.iter().map(|(name, value, _)| (name, value)))
}

/// Two effects that the plan would not tell apart.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Confusable {
    /// `effect@site`.
    pub a: String,
    /// `effect@site`.
    pub b: String,
    /// The lesser of both directions: `a` true and `b` fitted, and the other way round.
    pub sigmas: f64,
}

/// A measurement that would mend a lack.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlannedAddition {
    /// In words.
    pub what: String,
    /// More standard deviations for the first of `mends`.
    pub sigmas_gained: f64,
    /// In units of one FRF with everything in place.
    pub cost: f64,
    /// `effect@site`, or `a / b` for a pair, that come to [`SEEN_SIGMAS`] with it.
    pub mends: Vec<String>,
    /// Standard deviations of the first of them with it.
    pub sigmas: f64,
}

/// What the plan would show.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanOutlook {
    /// Best seen first.
    pub effects: Vec<PlannedEffect>,
    /// Pairs of effects that are seen but not told apart, nearest first.
    pub confusable: Vec<Confusable>,
    /// Cheapest first.
    pub additions: Vec<PlannedAddition>,
    /// What no single measurement mends.
    pub out_of_reach: Vec<String>,
    /// Effects that the plan cannot show at all, with the reason.
    pub not_possible: Vec<(String, String)>,
}

/// An effect of usual size and its FRFs.
struct Subject {
    label: String,
    model: StructureModel,
    theta: Vec<f64>,
    /// Noise-free FRFs with the effect, on the lines that fits use.
    data: FrfData,
    /// The baseline fitted to them, and what it leaves.
    baseline: Fitted,
}

#[derive(Clone)]
struct Fitted {
    theta: Vec<f64>,
    /// Σ r²/σ² on all planned lines.
    chi2: f64,
}

impl PlanOutlook {
    /// `model`: without effects. `data`: the FRFs planned, with their noise; their values are not looked at.
    ///
    /// # Errors
    /// A model that has no response.
    pub fn new(model: &StructureModel, postures: &[Posture], data: &FrfData) -> Result<Self> {
        let summary = data.summary();
        let base = model.nominal_theta();
        let full = filled(model, &base, data)?;
        let lines = data
            .blocks
            .iter()
            .map(|b| b.frequency_hz.len())
            .min()
            .unwrap_or(0);
        let stride = full
            .value_count()
            .div_ceil(VALUES)
            .min((lines / 25).max(1))
            .max(1);
        let thin = full.thinned(stride, 1);
        let share = full.value_count() as f64 / thin.value_count().max(1) as f64;
        let (mut possible, mut not_possible) = (Vec::new(), Vec::new());
        let known = model.known(&summary);
        // Every pair of effects is compared: rare ones, and those that have many places, would make that several times longer.
        let instances = Registry::structure().instances(known.object);
        for instance in instances.into_iter().filter(|i| !i.effect.on_promise()) {
            match instance.effect.obstacle(&known) {
                Some(why) => not_possible.push((instance.label(), why)),
                None => possible.push(instance),
            }
        }
        not_possible.dedup();
        let all: Vec<Subject> = possible
            .par_iter()
            .map(|instance| Subject::new(model, &base, *instance, &summary, &thin, share))
            .collect::<Result<_>>()?;
        let subjects = one_each(all, &possible);
        let instances: Vec<(String, Vec<Instance<Structure>>)> = subjects
            .iter()
            .map(|s| {
                let same = possible.iter().filter(|i| i.label() == s.label);
                (s.label.clone(), same.copied().collect())
            })
            .collect();

        let seen: Vec<usize> = (0..subjects.len())
            .filter(|i| subjects[*i].baseline.chi2.sqrt() >= SEEN_SIGMAS)
            .collect();
        let pairs: Vec<(usize, usize)> = seen
            .iter()
            .flat_map(|a| seen.iter().filter(move |b| *b != a).map(move |b| (*a, *b)))
            .collect();
        let imitations: Vec<(StructureModel, Fitted)> = pairs
            .par_iter()
            .map(|(a, b)| imitate(model, &subjects[*a], &instances[*b].1, &summary, share))
            .collect::<Result<_>>()?;
        let of = |a: usize, b: usize| pairs.iter().position(|p| *p == (a, b)).map(|k| &imitations[k]);
        let mut confused: Vec<Lack> = Vec::new();
        for (a, b) in pairs.iter().filter(|(a, b)| a < b) {
            if let (Some(ab), Some(ba)) = (of(*a, *b), of(*b, *a)) {
                let (truth, rival) = if ab.1.chi2 <= ba.1.chi2 {
                    (*a, ab)
                } else {
                    (*b, ba)
                };
                if rival.1.chi2.sqrt() < SEEN_SIGMAS {
                    confused.push(Lack {
                        name: format!("{} / {}", subjects[*a].label, subjects[*b].label),
                        pair: Some([*a, *b]),
                        truth,
                        rival: rival.0.clone(),
                        fitted: rival.1.clone(),
                    });
                }
            }
        }
        confused.sort_by(|x, y| x.fitted.chi2.total_cmp(&y.fitted.chi2));
        let confusable = confused
            .iter()
            .filter_map(|lack| {
                let [a, b] = lack.pair?;
                Some(Confusable {
                    a: subjects[a].label.clone(),
                    b: subjects[b].label.clone(),
                    sigmas: lack.fitted.chi2.sqrt(),
                })
            })
            .collect();

        let unseen = subjects
            .iter()
            .enumerate()
            .filter(|(i, _)| !seen.contains(i))
            .map(|(i, s)| Lack {
                name: s.label.clone(),
                pair: None,
                truth: i,
                rival: model.clone(),
                fitted: s.baseline.clone(),
            });
        let mut lacks: Vec<Lack> = unseen.collect();
        lacks.extend(confused);
        lacks.truncate(MOST_LACKS);
        let (additions, out_of_reach) = additions(model, postures, &full, &subjects, &lacks)?;
        let mut effects: Vec<PlannedEffect> = subjects.iter().map(|s| s.planned(model)).collect();
        effects.sort_by(|a, b| b.sigmas.total_cmp(&a.sigmas));
        Ok(PlanOutlook {
            effects,
            confusable,
            additions,
            out_of_reach,
            not_possible,
        })
    }
}

/// Something that the plan would not show: an effect against the baseline, or against another effect.
struct Lack {
    name: String,
    pair: Option<[usize; 2]>,
    /// Index of the subject that is true.
    truth: usize,
    rival: StructureModel,
    fitted: Fitted,
}

impl Subject {
    fn new(
        base_model: &StructureModel,
        base: &[f64],
        instance: Instance<Structure>,
        summary: &DataSummary,
        thin: &FrfData,
        share: f64,
    ) -> Result<Self> {
        let model = base_model.with_effect(instance, &base_model.known(summary));
        let own = model.parameters[base.len()..]
            .iter()
            .map(|p| p.internal(p.nominal));
        let theta: Vec<f64> = base.iter().copied().chain(own).collect();
        let data = filled(&model, &theta, thin)?;
        let baseline = fit(base_model, base, &data, share)?;
        Ok(Subject {
            label: instance.label(),
            model,
            theta,
            data,
            baseline,
        })
    }

    fn planned(&self, base: &StructureModel) -> PlannedEffect {
        let (effect, site) = match self.label.split_once('@') {
            Some((effect, site)) => (effect, Some(site.to_string())),
            None => (self.label.as_str(), None),
        };
        let own = self.model.parameters[base.parameters.len()..].iter();
        PlannedEffect {
            effect: effect.into(),
            site,
            sigmas: self.baseline.chi2.sqrt(),
            size: own
                .map(|p| {
                    let name = p.name.rsplit_once('.').map_or(p.name.as_str(), |(_, n)| n);
                    (name.to_string(), p.nominal, p.unit)
                })
                .collect(),
        }
    }
}

/// One subject for each label: of the discrete choices the one that shows least.
fn one_each(all: Vec<Subject>, instances: &[Instance<Structure>]) -> Vec<Subject> {
    let mut out: Vec<Subject> = Vec::new();
    for (subject, instance) in all.into_iter().zip(instances) {
        match out.iter_mut().find(|s| s.label == instance.label()) {
            Some(known) if subject.baseline.chi2 < known.baseline.chi2 => *known = subject,
            Some(_) => (),
            None => out.push(subject),
        }
    }
    out
}

/// The data with the model's values in place of measured ones; the noise stays.
fn filled(model: &StructureModel, theta: &[f64], data: &FrfData) -> Result<FrfData> {
    let mut data = data.clone();
    let mut predicted = model.predict(theta, &data)?.into_iter();
    for block in &mut data.blocks {
        for frf in &mut std::sync::Arc::make_mut(block).frfs {
            frf.receptance = predicted.next().unwrap_or_default();
        }
    }
    Ok(data)
}

/// Fits `model` from `start`; `share`: all planned values over those of `data`.
fn fit(model: &StructureModel, start: &[f64], data: &FrfData, share: f64) -> Result<Fitted> {
    let problem = FrfProblem::likelihood(model, data);
    let found = minimise(&problem, start, &model.bounds(), STOPPING)?;
    Ok(Fitted {
        // The priors are part of what is fitted, not of what the measurement shows.
        chi2: (2.0 * (found.cost - prior_cost(model, &found.theta)) * share).max(0.0),
        theta: found.theta,
    })
}

fn prior_cost(model: &StructureModel, theta: &[f64]) -> f64 {
    let each = model.parameters.iter().zip(theta);
    each.filter_map(|(p, t)| Some(p.prior?.half_square(*t)[0])).sum()
}

/// The nearest that an effect (any of its discrete choices) comes to the FRFs of another.
fn imitate(
    base: &StructureModel,
    truth: &Subject,
    instances: &[Instance<Structure>],
    summary: &DataSummary,
    share: f64,
) -> Result<(StructureModel, Fitted)> {
    let mut best: Option<(StructureModel, Fitted)> = None;
    for instance in instances {
        let model = base.with_effect(*instance, &base.known(summary));
        let own = &model.parameters[truth.baseline.theta.len()..];
        let proposed = instance.effect.starts(instance.at(), &base.known(summary), &[]);
        let starts = std::iter::once(own.iter().map(|p| p.nominal).collect::<Vec<f64>>()).chain(proposed);
        let problem = FrfProblem::likelihood(&model, &truth.data);
        let mut ranked: Vec<(f64, Vec<f64>)> = starts
            .map(|start| {
                let inside = own.iter().zip(start).map(|(p, v)| p.internal_within(v));
                let full: Vec<f64> = truth.baseline.theta.iter().copied().chain(inside).collect();
                (problem.cost(&full).unwrap_or(f64::INFINITY), full)
            })
            .collect();
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, start) in ranked.iter().take(STARTS) {
            let fitted = fit(&model, start, &truth.data, share)?;
            if best.as_ref().is_none_or(|(_, b)| fitted.chi2 < b.chi2) {
                best = Some((model.clone(), fitted));
            }
        }
    }
    Ok(best.unwrap_or_else(|| (base.clone(), truth.baseline.clone())))
}

/// For each lack the cheapest measurement that mends it; those that mend several are named once.
fn additions(
    model: &StructureModel,
    postures: &[Posture],
    data: &FrfData,
    subjects: &[Subject],
    lacks: &[Lack],
) -> Result<(Vec<PlannedAddition>, Vec<String>)> {
    if lacks.is_empty() {
        return Ok((Vec::new(), Vec::new()));
    }
    let lab = Lab::new(&model.robot, &model.points, postures, data)?;
    // Standard deviations with each measurement, lack by lack.
    let with: Vec<Vec<f64>> = lacks
        .par_iter()
        .map(|lack| {
            let truth = &subjects[lack.truth];
            let table = lab.prospects((&truth.model, &truth.theta), (&lack.rival, &lack.fitted.theta))?;
            let problem = FrfProblem::likelihood(&lack.rival, data);
            let known = problem.linearise(&lack.fitted.theta)?.hessian;
            let grown = |m: &crate::discrepancy::outlook::lab::Measurement| {
                let growth = m.prospect(&table, lack.fitted.theta.len()).growth(&known);
                (lack.fitted.chi2 + growth).sqrt()
            };
            Ok(lab.measurements.iter().map(grown).collect())
        })
        .collect::<Result<_>>()?;
    let cost = |m: usize| lab.measurements[m].cost;
    let mut chosen: Vec<(usize, Vec<usize>)> = Vec::new();
    let mut out_of_reach = Vec::new();
    for (l, lack) in lacks.iter().enumerate() {
        let mends = |m: &usize| with[l][*m] >= SEEN_SIGMAS;
        if chosen.iter().any(|(m, _)| mends(m)) {
            continue;
        }
        let cheapest = (0..lab.measurements.len()).filter(mends).min_by(|a, b| {
            cost(*a)
                .total_cmp(&cost(*b))
                .then(with[l][*b].total_cmp(&with[l][*a]))
        });
        match cheapest {
            Some(m) => chosen.push((m, Vec::new())),
            None => out_of_reach.push(lack.name.clone()),
        }
    }
    for (m, mended) in &mut chosen {
        *mended = (0..lacks.len()).filter(|l| with[*l][*m] >= SEEN_SIGMAS).collect();
        mended.sort_by(|a, b| with[*b][*m].total_cmp(&with[*a][*m]));
    }
    chosen.sort_by(|a, b| cost(a.0).total_cmp(&cost(b.0)));
    let additions = chosen
        .into_iter()
        .filter_map(|(m, mended)| {
            let first = *mended.first()?;
            Some(PlannedAddition {
                what: lab.measurements[m].what.clone(),
                sigmas_gained: with[first][m] - lacks[first].fitted.chi2.sqrt(),
                cost: cost(m),
                mends: mended.iter().map(|l| lacks[*l].name.clone()).collect(),
                sigmas: with[first][m],
            })
        })
        .collect();
    Ok((additions, out_of_reach))
}
