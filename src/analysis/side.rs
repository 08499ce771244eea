//! A side of a campaign: how its measurements become a case, what the model is looked at with, and where a lead is sought.
//! All that the loop over campaigns (diagnose, add) needs to know of FRFs and force records.

use crate::Result;
use crate::analysis::workbench::Workbench;
use crate::campaign::Campaign;
use crate::discrepancy::comparison::compare::ErrorTotals;
use crate::discrepancy::setup::SetupCheck;
use crate::discrepancy::{Diagnosis, EffectCandidate, NextMeasurement};
use crate::effects::{Instance, Known, Registry};
use crate::identify::model_history::Side;
use crate::identify::{Calibration, Case, Model, Modelled, Options, Study};

/// A domain that campaigns have measurements of.
pub trait CampaignSide: Modelled {
    /// In the log of revisions.
    const SIDE: Side;
    /// What is left out of a fit in turn: `postures`.
    const FOLDS: &'static str;
    /// A model against the measurements: predictions and errors.
    type View;
    /// What an effect takes away of the misfit, and where.
    type Explained;
    /// What is known of a rest that no effect of the library explains.
    type Lead;
    /// The case as the loop works on it.
    type Study: Study<Domain = Self>;

    /// The effects of its models.
    fn registry() -> Registry<Self>;

    /// What effects are told of a case.
    fn known(case: &Case<Self>) -> Known<'_, Self>;

    /// Model and measurements of a campaign.
    ///
    /// # Errors
    /// Files that cannot be read, a broken log of revisions.
    fn case(campaign: &Workbench) -> Result<Case<Self>>;

    /// The case as the loop works on it.
    fn study(case: &Case<Self>, options: Options) -> Self::Study;

    /// The model at `theta` (solver's scale) against the measurements.
    ///
    /// # Errors
    /// A model that does not respond.
    fn view(case: &Case<Self>, model: &Model<Self>, theta: &[f64]) -> Result<Self::View>;

    /// Its error over everything.
    fn totals(view: &Self::View) -> ErrorTotals;

    /// What `with` takes away of what `now` leaves.
    fn explained(case: &Case<Self>, now: &Self::View, with: &Self::View) -> Self::Explained;

    /// Wrong files and other mistakes of the setup.
    ///
    /// # Errors
    /// A model that does not respond.
    fn setup(case: &Case<Self>, study: &Self::Study, diagnosis: &Diagnosis<Self>) -> Result<SetupCheck>;

    /// Where what has no name sits and what it does; `None` where nothing can be said of it.
    ///
    /// # Errors
    /// A fit that fails.
    fn lead(
        case: &Case<Self>,
        campaign: &Campaign,
        study: &Self::Study,
        diagnosis: &Diagnosis<Self>,
        now: &Self::View,
    ) -> Result<Option<Self::Lead>>;

    /// An effect of the library that `diagnosis` missed, by what `lead` has found, and a point from which it is seen (the model's
    /// parameters and its own, solver's scale).
    ///
    /// # Errors
    /// A model that does not respond.
    fn named(
        _case: &Case<Self>,
        _study: &Self::Study,
        _diagnosis: &Diagnosis<Self>,
        _lead: &Self::Lead,
    ) -> Result<Option<(Instance<Self>, Vec<f64>)>> {
        Ok(None)
    }

    /// What is known of the rest that the missing effect leaves, `with` that in the model, where it is more than noise and small errors
    /// of the setup.
    ///
    /// # Errors
    /// A fit that fails.
    fn lead_beyond(_study: &Self::Study, _with: &EffectCandidate<Self>) -> Result<Option<Self::Lead>> {
        Ok(None)
    }

    /// The measurement that would tell most.
    ///
    /// # Errors
    /// A model that does not respond.
    fn next(case: &Case<Self>, campaign: &Campaign, diagnosis: &Diagnosis<Self>) -> Result<NextMeasurement>;

    /// What the user should know of a fit before believing it.
    fn warnings(calibration: &Calibration) -> Vec<String>;

    /// What to say where nothing can be left out of the fit.
    fn one_fold() -> Option<String> {
        None
    }
}
