//! How near the library comes to physics that it does not have.

use rayon::prelude::*;
use serde::Serialize;

use crate::Result;
use crate::effects::Registry;
use crate::effects::{DataSummary, Instance, Structure};
use crate::identify::first_size::linear_size;
use crate::identify::frfs::frf_problem::{FrfProblem, Misfit};
use crate::identify::{FrfData, StructureModel, levenberg_marquardt};
use crate::simulate::sizes::visibility::misfit;

/// The effect of the library that leaves least of what a foreign effect does, found by refits from the effect's starting
/// points and from the size that linear least squares give. Where little is left, `unknown` is not the only honest verdict.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Imitation {
    /// `effect@site`; `None`: no effect helps.
    pub effect: Option<String>,
    /// Σ|ΔH|²/σ² per complex value that it leaves.
    pub excess_chi2_per_value: f64,
    /// sqrt(2 Σ|ΔH|²/σ²).
    pub sigmas: f64,
}

/// Starting points that get a refit, the best by their cost.
const STARTS: usize = 2;

/// Refits noise-free `data` with every library effect in turn. `theta`: true parameters of `model` (solver's scale).
pub fn nearest(
    model: &StructureModel,
    theta: &[f64],
    summary: &DataSummary,
    data: &FrfData,
    stride: usize,
) -> Result<Imitation> {
    let known = model.known(summary);
    let instances: Vec<Instance<Structure>> = Registry::structure()
        .instances(known.object)
        .into_iter()
        .filter(|i| i.effect.obstacle(&known).is_none())
        .filter(|i| !model.has(&i.label()))
        .collect();
    let left: Vec<Option<f64>> = instances
        .par_iter()
        .map(|instance| {
            refit(
                &model.with_effect(*instance, &model.known(summary)),
                theta,
                summary,
                data,
                stride,
            )
            .ok()
        })
        .collect();
    let bare = refit(model, theta, summary, data, stride)?;
    let (mut effect, mut least) = (None, bare);
    for (instance, left) in instances.iter().zip(left) {
        if let Some(left) = left.filter(|l| *l < least) {
            least = left;
            effect = Some(instance.label());
        }
    }
    Ok(Imitation {
        effect,
        excess_chi2_per_value: least / data.value_count() as f64,
        sigmas: (2.0 * least).sqrt(),
    })
}

/// Least misfit found from the starting points of the last effect of `model`, the parameters in front starting at
/// `theta`.
fn refit(
    model: &StructureModel,
    theta: &[f64],
    summary: &DataSummary,
    data: &FrfData,
    stride: usize,
) -> Result<f64> {
    let problem = FrfProblem {
        model,
        data,
        misfit: Misfit::Complex,
        stride,
    };
    let own = &model.parameters[theta.len()..];
    let mut starts: Vec<Vec<f64>> = vec![own.iter().map(|p| p.nominal).collect()];
    if let Some(added) = model.effects().last().filter(|_| !own.is_empty()) {
        let known = model.known(summary);
        starts.extend(added.instance.effect.starts(added.instance.at(), &known, &[]));
    }
    let mut ranked: Vec<(f64, Vec<f64>)> = starts
        .into_iter()
        .map(|start| {
            let values = own.iter().zip(start).map(|(p, v)| p.internal_within(v));
            let full: Vec<f64> = theta.iter().copied().chain(values).collect();
            let cost = levenberg_marquardt::LeastSquares::cost(&problem, &full).unwrap_or(f64::INFINITY);
            (cost, full)
        })
        .collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    let stopping = levenberg_marquardt::Stopping {
        max_iterations: 30,
        relative_decrease: 1e-4,
    };
    let usual = ranked.into_iter().take(STARTS).map(|(_, start)| start);
    // What is faint lies far from usual sizes, and a fit from those need not get there.
    let faint = match own.is_empty() {
        true => None,
        false => linear_size(&problem, model, theta).map(|size| size.theta),
    };
    let mut least = f64::INFINITY;
    for start in usual.chain(faint) {
        let fit = levenberg_marquardt::minimise(&problem, &start, &model.bounds(), stopping)?;
        least = least.min(misfit(model, &fit.theta, data)?);
    }
    Ok(least)
}
