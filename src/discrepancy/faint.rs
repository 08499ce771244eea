//! What the data hint at where little is missing: effects on which neither a look at few data nor a fit from usual sizes finds
//! anything. Next to where an effect vanishes one step of Gauss and Newton tells its size and what it would gain ([`first_size`]); a
//! share of the lines tells for which effects that is worth asking all of them.
//!
//! [`first_size`]: crate::identify::first_size

use rayon::prelude::*;

use super::verdict::gain_by_chance;
use crate::Result;
use crate::identify::first_size::linear_size_of_shapes;
use crate::identify::levenberg_marquardt::{Fit, Stopping, minimise};
use crate::identify::study::{InstanceOf, ModelOf, Study, View, own_starts};

/// Fall of χ² on a share of the lines, besides one for each parameter but the first, from which on all data are asked. What means
/// nothing and can only grow gains as much in one case of six.
const HINT: f64 = 1.0;
/// Effects about which all data are asked, at most.
const ASKED: usize = 24;
/// Effects that are fitted, at most.
const FITTED: usize = 6;
/// Times what an effect has gained already from which on its fit is begun anew.
const MORE: f64 = 1.2;

const REFIT: Stopping = Stopping {
    max_iterations: 4,
    relative_decrease: 1e-6,
};

/// Where the fit of an effect to all data begins.
pub(super) struct FaintStart<S: Study> {
    pub(super) instance: InstanceOf<S>,
    /// With the effect.
    pub(super) model: ModelOf<S>,
    /// All parameters, solver's scale.
    pub(super) theta: Vec<f64>,
}

/// An effect that gains.
struct Hint<S: Study> {
    start: FaintStart<S>,
    /// Points for its own parameters next to where it vanishes.
    shapes: Vec<Vec<f64>>,
    /// By how much χ² would fall.
    gain: f64,
}

/// Where to begin the fits of those effects that would take more χ² away than chance and than they do already. `base`: the fit of
/// `model` to all data; `instances`: all effects, each with all its discrete choices, and frequencies at which much is left; `gained`: by
/// how much the effect of a label has made χ² fall so far.
pub(super) fn starts<S: Study>(
    study: &S,
    model: &ModelOf<S>,
    base: &Fit,
    (instances, hints): (&[InstanceOf<S>], &[f64]),
    gained: impl Fn(&str) -> f64 + Sync,
) -> Result<Vec<FaintStart<S>>> {
    let count = model.parameters.len();
    let label = |hint: &Hint<S>| hint.start.instance.name().label();
    let without = minimise(
        &study.problem(model, View::THIN),
        &base.theta,
        &model.bounds(),
        REFIT,
    )?;
    let mut hinted: Vec<Hint<S>> = instances
        .par_iter()
        .filter_map(|instance| {
            let extended = study.extend(model, instance);
            let own = own_starts(study, &extended, count, instance, hints);
            let hint = hint(study, *instance, extended, &own, (&without, View::THIN))?;
            let by_chance = (hint.start.model.parameters.len() - count - 1) as f64;
            (hint.gain > by_chance + HINT).then_some(hint)
        })
        .collect();
    best_of_each(&mut hinted, label);
    hinted.truncate(ASKED);
    let mut sure: Vec<Hint<S>> = hinted
        .into_par_iter()
        .filter_map(|Hint { start, shapes, .. }| {
            let hint = hint(study, start.instance, start.model, &shapes, (base, View::FULL))?;
            let by_chance = gain_by_chance(hint.start.model.parameters.len() - count);
            (hint.gain > by_chance + MORE * gained(&label(&hint))).then_some(hint)
        })
        .collect();
    best_of_each(&mut sure, label);
    sure.truncate(FITTED);
    Ok(sure.into_iter().map(|hint| hint.start).collect())
}

/// What a view of the data says of an effect besides the fit `without` it; `own`: points for its parameters.
fn hint<S: Study>(
    study: &S,
    instance: InstanceOf<S>,
    model: ModelOf<S>,
    own: &[Vec<f64>],
    (without, view): (&Fit, View),
) -> Option<Hint<S>> {
    let size = linear_size_of_shapes(&study.problem(&model, view), &model, &without.theta, own)?;
    let moved = size.theta[without.theta.len()..].to_vec();
    // More than there is is not to be had.
    (size.gain < 2.0 * without.cost).then_some(Hint {
        start: FaintStart {
            instance,
            model,
            theta: size.theta,
        },
        shapes: vec![size.shape, moved],
        gain: size.gain,
    })
}

/// Keeps the best choice of each effect, best first.
fn best_of_each<S: Study>(hints: &mut Vec<Hint<S>>, label: impl Fn(&Hint<S>) -> String) {
    hints.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let mut known = Vec::new();
    hints.retain(|hint| {
        let label = label(hint);
        let new = !known.contains(&label);
        known.push(label);
        new
    });
}
