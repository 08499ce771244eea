//! What the data hint at where little is missing: effects on which neither a look at few data nor a fit from usual sizes finds
//! anything. Next to where an effect vanishes one step of Gauss and Newton tells its size and what it would gain ([`first_size`]); a
//! share of the lines tells for which effects that is worth asking all of them.
//!
//! [`first_size`]: crate::identify::first_size

use rayon::prelude::*;

use super::ranking::keep_first_of_each;
use super::verdict::gain_by_chance;
use crate::Result;
use crate::identify::first_size::{LinearSize, linear_size_of_shapes};
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

/// An effect at the size that it would have were the response linear in it.
pub(super) struct Linear<S: Study> {
    pub(super) instance: InstanceOf<S>,
    pub(super) size: LinearSize,
}

impl<S: Study> Linear<S> {
    /// `cost`: that of the fit without the effect. `None` for a size that would take more away than there is.
    pub(super) fn new(instance: InstanceOf<S>, size: LinearSize, cost: f64) -> Option<Self> {
        (size.gain < 2.0 * cost).then_some(Linear { instance, size })
    }
}

/// Where to begin the fits of those effects that would take more χ² away than chance and than they do already. `base`: the fit of
/// `model` to all data; `instances`: all effects, each with all its discrete choices, and frequencies at which much is left; `of_all`:
/// frequencies that only all data together show, at which they are asked without a share of them; `gained`: by how much the effect of a
/// label has made χ² fall so far.
pub(super) fn sizes<S: Study>(
    study: &S,
    model: &ModelOf<S>,
    base: &Fit,
    (instances, hints): (&[InstanceOf<S>], &[f64]),
    of_all: &[f64],
    gained: impl Fn(&str) -> f64 + Sync,
) -> Result<Vec<Linear<S>>> {
    let count = model.parameters.len();
    let label = |linear: &Linear<S>| linear.instance.name().label();
    let own_count = |linear: &Linear<S>| linear.size.theta.len() - count;
    let without = minimise(
        &study.problem(model, View::THIN),
        &base.theta,
        &model.bounds(),
        REFIT,
    )?;
    let best_of_each = |sizes: &mut Vec<Linear<S>>| {
        sizes.sort_by(|a, b| b.size.gain.total_cmp(&a.size.gain));
        keep_first_of_each(sizes, label);
    };
    let mut hinted: Vec<Linear<S>> = instances
        .par_iter()
        .filter_map(|instance| {
            let extended = study.extend(model, instance);
            let own = own_starts(study, &extended, count, instance, hints);
            let problem = study.problem(&extended, View::THIN);
            let size = linear_size_of_shapes(&problem, &extended, &without.theta, &own)?;
            let hint = Linear::new(*instance, size, without.cost)?;
            (hint.size.gain > (own_count(&hint) - 1) as f64 + HINT).then_some(hint)
        })
        .collect();
    best_of_each(&mut hinted);
    hinted.truncate(ASKED);
    let mut asked: Vec<(InstanceOf<S>, Vec<Vec<f64>>)> = hinted
        .into_iter()
        .map(|Linear { instance, size }| (instance, vec![size.shape, size.theta[count..].to_vec()]))
        .collect();
    for instance in instances.iter().filter(|_| !of_all.is_empty()) {
        let extended = study.extend(model, instance);
        let own = |hints| own_starts(study, &extended, count, instance, hints);
        let without = own(&[]);
        let shapes: Vec<Vec<f64>> = own(of_all).into_iter().filter(|s| !without.contains(s)).collect();
        match asked.iter_mut().find(|(known, _)| known == instance) {
            Some((_, known)) => known.extend(shapes),
            None if shapes.is_empty() => {}
            None => asked.push((*instance, shapes)),
        }
    }
    let mut sure: Vec<Linear<S>> = asked
        .into_par_iter()
        .filter_map(|(instance, shapes)| {
            let extended = study.extend(model, &instance);
            let problem = study.problem(&extended, View::FULL);
            let size = linear_size_of_shapes(&problem, &extended, &base.theta, &shapes)?;
            let sure = Linear::new(instance, size, base.cost)?;
            let least = gain_by_chance(own_count(&sure)) + MORE * gained(&label(&sure));
            (sure.size.gain > least).then_some(sure)
        })
        .collect();
    best_of_each(&mut sure);
    sure.truncate(FITTED);
    Ok(sure)
}
