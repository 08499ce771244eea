//! What was tried: one effect at one site, and the model as it stands that it is compared with.

use super::something_else;
use crate::effects::{EffectName, Instance};
use crate::identify::frfs::calibrate::{Calibration, Estimate};
use crate::identify::rest::Rest;
use crate::identify::study::{HeldOut, Residual};
use crate::identify::{Model, Modelled};

/// One effect at one site, tried.
#[derive(Debug, Clone)]
pub struct EffectCandidate<D: Modelled> {
    /// The effect with its place and discrete choice.
    pub instance: Instance<D>,
    /// What it is called.
    pub name: EffectName,
    /// Error with it: sqrt(Σ|model − measured|² / Σ|measured|²).
    pub nrms: f64,
    /// On folds left out of the fit; `None` with one fold.
    pub held_out: Option<HeldOut>,
    /// BIC with the effect less BIC without: below zero the effect pays for its parameters.
    pub delta_bic: f64,
    /// Likelihood-ratio test, corrected for the number of candidates tried.
    pub p_value: f64,
    /// Weighted misfit per degree of freedom that is left with the effect: 1 is noise.
    pub reduced_chi2: f64,
    /// χ² that the effect takes away from the baseline's, on the data that it was fitted to.
    pub gain: f64,
    /// What tests of structure find in what it leaves; `None` for candidates that were not in question.
    pub rest: Option<Rest>,
    /// Why the effect cannot be as fitted: a size that is not possible.
    pub not_credible: Option<String>,
    /// The effect's own parameters.
    pub parameters: Vec<Estimate>,
    /// One of them stopped at the end of its range: evidence against.
    pub at_bound: bool,
    /// No fit with the effect is better than the one without it: the effect stands where it vanishes.
    pub vanished: bool,
    /// Fitted on all data; otherwise on the coarse view only, far behind the leaders there.
    pub refined: bool,
    /// Where its fit stands, solver's scale; the effect's own parameters last.
    pub theta: Vec<f64>,
    /// The model with it.
    pub model: Model<D>,
}

impl<D: Modelled> EffectCandidate<D> {
    /// `effect@site`, or the bare id.
    pub fn label(&self) -> String {
        self.name.label()
    }

    /// What a reader of a table should know of it; empty as a rule.
    pub fn remark(&self) -> &'static str {
        match (self.vanished, &self.not_credible, self.at_bound) {
            (true, ..) => "vanishes",
            (_, Some(_), _) => "not possible",
            (.., true) => "at the end of its range",
            _ => "",
        }
    }

    /// Effects of the model that choose otherwise beside it than in `effects`, those of the model as it stands.
    pub fn chosen_anew(&self, effects: impl Iterator<Item = Instance<D>>) -> Vec<Instance<D>> {
        let own = self.model.effects().iter().map(|added| added.instance);
        own.zip(effects)
            .filter(|(is, was)| is != was)
            .map(|(is, _)| is)
            .collect()
    }

    /// Share of what stands above the noise that the effect explains, and its standard deviation; `None` for candidates that
    /// were not in question.
    pub fn explained_share(&self) -> Option<[f64; 2]> {
        let rest = self.rest.as_ref().filter(|r| !r.tests.is_empty())?;
        Some(something_else::share_explained(self.gain, rest))
    }

    /// Share of what stands above the noise that the effect explains, by structure where that was tested, else by size.
    pub fn share_above_noise(&self, baseline: &BaselineFit) -> f64 {
        self.explained_share()
            .map_or_else(|| self.share_explained(baseline), |[share, _]| share)
    }

    /// Share of the misfit above noise that the effect takes away, by the size of the misfit alone.
    pub fn share_explained(&self, baseline: &BaselineFit) -> f64 {
        share_taken(baseline.reduced_chi2, self.reduced_chi2)
    }
}

/// Share of the misfit above noise that a further part of a model takes away, of misfits per degree of freedom without and with it.
pub fn share_taken(without: f64, with: f64) -> f64 {
    (without - with) / (without - 1.0).max(1e-9)
}

/// The model as it stands.
#[derive(Debug, Clone)]
pub struct BaselineFit {
    /// Its fit.
    pub calibration: Calibration,
    /// Where that stands, solver's scale.
    pub theta: Vec<f64>,
    /// What it leaves, by size.
    pub residual: Residual,
    /// Error on folds left out of the fit; `None` with one fold.
    pub held_out: Option<HeldOut>,
    /// Weighted misfit per degree of freedom: 1 is noise.
    pub reduced_chi2: f64,
    /// What tests of structure find in what it leaves.
    pub rest: Rest,
}
