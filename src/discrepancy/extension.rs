//! An effect added to a model: everything refitted together, before and after compared on folds left out of the fit.

use rayon::prelude::*;

use super::verdict::{gain_by_chance, is_noise, is_progress};
use crate::effects::Instance;
use crate::identify::levenberg_marquardt::{Fit, LeastSquares, Stopping, minimise};
use crate::identify::study::{
    Effort, Extent, HeldOut, InstanceOf, ModelOf, Residual, Study, Tried, View, exchanged, held_out, paid,
    rescue, rounds_of_bases, try_effect,
};
use crate::identify::{Calibration, Model, Modelled};
use crate::{Error, Result};

/// A model fitted to all data.
#[derive(Debug, Clone)]
pub struct Fitted<D: Modelled> {
    /// The model that was fitted.
    pub model: Model<D>,
    /// Its fit.
    pub calibration: Calibration,
    /// What that leaves.
    pub residual: Residual,
    /// On folds left out of the fit; `None` with one fold.
    pub held_out: Option<HeldOut>,
}

/// What adding an effect does.
#[derive(Debug, Clone)]
pub struct Extension<D: Modelled> {
    /// The effect that was added.
    pub instance: Instance<D>,
    /// The model as it stood, fitted to the same data.
    pub before: Fitted<D>,
    /// The model with it.
    pub after: Fitted<D>,
    /// Effects that were in the model already and choose otherwise beside it.
    pub chosen_anew: Vec<Instance<D>>,
    /// The effect vanishes in these data: the fit with it is the fit without it.
    pub vanished: bool,
    /// Whether the held-out error fell by more than chance would let it; `None` with one fold.
    pub progress: Option<bool>,
}

const REFINE: Stopping = Stopping {
    max_iterations: 40,
    relative_decrease: 1e-8,
};
const REFIT_WITHOUT_FOLD: Stopping = Stopping {
    max_iterations: 15,
    relative_decrease: 1e-6,
};

impl<D: Modelled> Fitted<D> {
    fn new<S: Study<Domain = D>>(study: &S, model: Model<D>, calibration: Calibration) -> Result<Self> {
        let theta = &calibration.theta;
        Ok(Fitted {
            residual: study.residual(&model, theta)?,
            held_out: held_out(study, &model, theta, Extent::Full, REFIT_WITHOUT_FOLD)?,
            model,
            calibration,
        })
    }

    /// Error on folds left out of the fit; `None` with one fold.
    pub fn held_out_nrms(&self) -> Option<f64> {
        self.held_out.as_ref().map(|h| h.nrms())
    }
}

impl<D: Modelled> Extension<D> {
    /// Adds to `model` that one of `instances` (an effect's discrete choices at one site) which fits best.
    ///
    /// # Errors
    /// No form of the effect could be fitted.
    pub fn new<S: Study<Domain = D>>(study: &S, model: &Model<D>, instances: &[Instance<D>]) -> Result<Self> {
        let mut before = study.calibrate(model)?;
        let hints = study.hints(model, &before.theta)?;
        let rounds = rounds_of_bases(model, &before.theta);
        let tried: Vec<Tried<D>> = instances
            .par_iter()
            .flat_map_iter(|instance| rounds.iter().map(move |bases| (instance, bases)))
            .filter_map(|(instance, bases)| try_effect(study, model, instance, bases, &hints, Effort::Staged))
            .collect();
        // A discrete choice with more parameters has to pay for them.
        let paid = |t: &Tried<D>| paid(study, Extent::Coarse, t.fit.cost, t.fit.theta.len());
        let mut best = tried
            .into_iter()
            .min_by(|a, b| paid(a).total_cmp(&paid(b)))
            .ok_or_else(|| Error::computation("no form of the effect could be fitted"))?;
        let bounds = best.model.bounds();
        let problem = study.problem(&best.model, View::FULL);
        best.fit = minimise(&problem, &best.fit.theta, &bounds, REFINE)?;
        drop(problem);
        let freedom = study.real_values(Extent::Full) as f64 - best.fit.theta.len() as f64;
        if !is_noise(2.0 * best.fit.cost / freedom.max(1.0))
            && let Some(fit) = rescue(study, model, &best, &hints, REFINE)?
        {
            best.fit = fit;
        }
        let mut after = study.calibrate(&best.model.with_start(best.fit.theta.clone()))?;

        // The fit without the effect, also tried from where the one with it put the common parameters: a trapped
        // `before` would make any effect look good.
        let common = after.theta[..before.theta.len()].to_vec();
        let again = study.calibrate(&model.with_start(common))?;
        if again.reduced_chi2 < before.reduced_chi2 {
            before = again;
        }
        // The model without the effect is one with it, at the effect's vanishing limit: the fit with the effect is never
        // worse. The likelihood alone is compared; what is known of an effect beforehand supposes that it is there. A gain
        // in likelihood that chance would bring, paid for with a larger error, is none.
        let (was, is) = (
            study.residual(model, &before.theta)?,
            study.residual(&best.model, &after.theta)?,
        );
        let gain = (was.chi2_per_value - is.chi2_per_value) * study.real_values(Extent::Full) as f64;
        let chance = after.reduced_chi2.max(1.0) / is.independent_share.min(1.0);
        let by_chance = gain < chance * gain_by_chance(after.theta.len() - before.theta.len());
        let limit = best.model.vanishing_limit();
        let mut extended = best.model;
        let mut vanished = false;
        if let Some(limit) = limit
            && (gain < 0.0 || by_chance && is.nrms > was.nrms)
        {
            let own = &extended.parameters[before.theta.len()..];
            after = before.with_vanished(own, &limit);
            extended = extended.with_start(after.theta.clone());
            vanished = true;
        }
        let mut chosen_anew = Vec::new();
        if !vanished {
            chosen_anew = choose_anew(study, &mut extended, &mut after)?;
        }
        let before = Fitted::new(study, model.clone(), before)?;
        let after = if vanished {
            Fitted {
                model: extended,
                calibration: after,
                residual: before.residual,
                held_out: before.held_out.clone(),
            }
        } else {
            Fitted::new(study, extended, after)?
        };
        Ok(Extension {
            progress: progress(&before, &after),
            instance: best.instance,
            chosen_anew,
            vanished,
            before,
            after,
        })
    }
}

/// Lets the effects that stood in `model` before the last one choose anew (a direction, a form): a choice made while that was missing may
/// have stood in for it. Those that fit better by more than what their parameters cost stay, with their fit; they are told.
fn choose_anew<S: Study>(
    study: &S,
    model: &mut ModelOf<S>,
    calibration: &mut Calibration,
) -> Result<Vec<InstanceOf<S>>> {
    let mut chosen = Vec::new();
    let mut theta = calibration.theta.clone();
    let mut cost = study.problem(model, View::FULL).cost(&theta)?;
    for place in 0..model.effects().len().saturating_sub(1) {
        let others: Vec<InstanceOf<S>> = model.effects()[place].instance.other_choices().collect();
        let looks = others.into_par_iter().filter_map(|other| {
            let (model, start) = exchanged(study, model, &theta, place, &other);
            let fit = minimise(
                &study.problem(&model, View::COARSE),
                &start,
                &model.bounds(),
                REFINE,
            )
            .ok()?;
            Some((other, model, fit))
        });
        let paid_on = |extent, fit: &Fit| paid(study, extent, fit.cost, fit.theta.len());
        let Some((other, anew, look)) =
            looks.min_by(|a, b| paid_on(Extent::Coarse, &a.2).total_cmp(&paid_on(Extent::Coarse, &b.2)))
        else {
            continue;
        };
        let fit = minimise(
            &study.problem(&anew, View::FULL),
            &look.theta,
            &anew.bounds(),
            REFINE,
        )?;
        if paid_on(Extent::Full, &fit) < paid(study, Extent::Full, cost, theta.len()) {
            (*model, theta, cost) = (anew, fit.theta, fit.cost);
            chosen.push(other);
        }
    }
    if !chosen.is_empty() {
        *calibration = study.calibrate(&model.with_start(theta))?;
    }
    Ok(chosen)
}

/// Whether the error on folds left out of the fit fell by more than chance.
fn progress<D: Modelled>(before: &Fitted<D>, after: &Fitted<D>) -> Option<bool> {
    let (was, is) = (before.held_out.as_ref()?, after.held_out.as_ref()?);
    let count = |f: &Fitted<D>| f.model.parameters.len();
    let chance = after.calibration.reduced_chi2.max(1.0) / after.residual.independent_share.min(1.0);
    Some(is_progress(was, is, count(after) - count(before), chance))
}
