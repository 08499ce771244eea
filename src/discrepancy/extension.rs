//! An effect added to a model: everything refitted together, before and after compared on folds left out of the fit.

use rayon::prelude::*;

use super::verdict::{gain_by_chance, is_noise, is_progress};
use crate::identify::Calibration;
use crate::identify::levenberg_marquardt::{Stopping, minimise};
use crate::identify::study::{
    Effort, Extent, HeldOut, Residual, Study, Tried, View, held_out, rescue, try_effect,
};
use crate::{Error, Result};

/// A model fitted to all data.
#[derive(Debug, Clone)]
pub struct Fitted<M> {
    /// The model that was fitted.
    pub model: M,
    /// Its fit.
    pub calibration: Calibration,
    /// What that leaves.
    pub residual: Residual,
    /// On folds left out of the fit; `None` with one fold.
    pub held_out: Option<HeldOut>,
}

/// What adding an effect does.
#[derive(Debug, Clone)]
pub struct Extension<M, I> {
    /// The effect that was added.
    pub instance: I,
    /// The model as it stood, fitted to the same data.
    pub before: Fitted<M>,
    /// The model with it.
    pub after: Fitted<M>,
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

impl<M> Fitted<M> {
    fn new<S: Study<Model = M>>(study: &S, model: M, calibration: Calibration) -> Result<Self> {
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

impl<M, I> Extension<M, I> {
    /// Adds to `model` that one of `instances` (an effect's discrete choices at one site) which fits best.
    ///
    /// # Errors
    /// No form of the effect could be fitted.
    pub fn new<S>(study: &S, model: &M, instances: &[I]) -> Result<Self>
    where
        S: Study<Model = M, Instance = I>,
        M: Clone + Send + Sync,
        I: Clone + Send + Sync,
    {
        let mut before = study.calibrate(model)?;
        let hints = study.hints(model, &before.theta)?;
        let bases = [before.theta.clone(), study.nominal_theta(model)];
        let tried: Vec<Tried<M, I>> = instances
            .par_iter()
            .filter_map(|instance| try_effect(study, model, instance, &bases, &hints, Effort::Staged))
            .collect();
        // A discrete choice with more parameters has to pay for them (Schwarz 1978).
        let price = 0.5 * (study.real_values(Extent::Coarse) as f64).ln();
        let paid = |t: &Tried<M, I>| t.fit.cost + price * t.fit.theta.len() as f64;
        let mut best = tried
            .into_iter()
            .min_by(|a, b| paid(a).total_cmp(&paid(b)))
            .ok_or_else(|| Error::computation("no form of the effect could be fitted"))?;
        let bounds = study.bounds(&best.model);
        let problem = study.problem(&best.model, View::FULL);
        best.fit = minimise(&problem, &best.fit.theta, &bounds, REFINE)?;
        drop(problem);
        let freedom = study.real_values(Extent::Full) as f64 - best.fit.theta.len() as f64;
        if !is_noise(2.0 * best.fit.cost / freedom.max(1.0))
            && let Some(fit) = rescue(study, model, &best, &hints, REFINE)?
        {
            best.fit = fit;
        }
        let mut after = study.calibrate(&study.starting_from(&best.model, best.fit.theta.clone()))?;

        // The fit without the effect, also tried from where the one with it put the common parameters: a trapped
        // `before` would make any effect look good.
        let common = after.theta[..before.theta.len()].to_vec();
        let again = study.calibrate(&study.starting_from(model, common))?;
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
        let limit = study.vanishing(&best.model);
        let mut extended = best.model;
        let mut vanished = false;
        if let Some(limit) = limit
            && (gain < 0.0 || by_chance && is.nrms > was.nrms)
        {
            let own = &study.parameters(&extended)[before.theta.len()..];
            after = before.with_vanished(own, &limit);
            extended = study.starting_from(&extended, after.theta.clone());
            vanished = true;
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
            progress: progress::<S>(study, &before, &after),
            instance: best.instance,
            vanished,
            before,
            after,
        })
    }
}

/// Whether the error on folds left out of the fit fell by more than chance.
fn progress<S: Study>(study: &S, before: &Fitted<S::Model>, after: &Fitted<S::Model>) -> Option<bool> {
    let (was, is) = (before.held_out.as_ref()?, after.held_out.as_ref()?);
    let count = |f: &Fitted<S::Model>| study.parameters(&f.model).len();
    let chance = after.calibration.reduced_chi2.max(1.0) / after.residual.independent_share.min(1.0);
    Some(is_progress(was, is, count(after) - count(before), chance))
}
