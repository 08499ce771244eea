//! The cutting side of a campaign: force model and force records.

use crate::Result;
use crate::analysis::diagnosis::rival;
use crate::analysis::side::CampaignSide;
use crate::analysis::workbench::Workbench;
use crate::campaign::Campaign;
use crate::discrepancy::comparison::compare::ErrorTotals;
use crate::discrepancy::outlook::next_cut;
use crate::discrepancy::setup::{SetupCheck, examine_cutting};
use crate::discrepancy::{
    CuttingComparison, CuttingLead, Diagnosis, EffectCandidate, NextMeasurement, cutting_lead,
};
use crate::effects::{Cutting, Known, Registry};
use crate::identify::forces::cutting_problem::{CutFit, CuttingProblem};
use crate::identify::model_history::Side;
use crate::identify::{Calibration, CuttingCase, CuttingModel, CuttingStudy, Options};

/// A cutting model against the records.
pub struct CuttingView {
    /// In the order of the data's cuts.
    pub fits: Vec<CutFit>,
    /// Errors by cut and axis.
    pub comparison: CuttingComparison,
}

impl CampaignSide for Cutting {
    const SIDE: Side = Side::Cutting;
    const FOLDS: &'static str = "cuts";
    type View = CuttingView;
    type Explained = ();
    type Lead = CuttingLead;
    type Study = CuttingStudy;

    fn registry() -> Registry<Cutting> {
        Registry::cutting()
    }

    fn known(case: &CuttingCase) -> Known<'_, Cutting> {
        case.model.known(&case.data)
    }

    fn case(campaign: &Workbench) -> Result<CuttingCase> {
        CuttingCase::on(campaign)
    }

    /// The misfit of forces is nearly quadratic: one start is enough.
    fn study(case: &CuttingCase, _options: Options) -> CuttingStudy {
        CuttingStudy::new(case.data.clone())
    }

    fn view(case: &CuttingCase, model: &CuttingModel, theta: &[f64]) -> Result<CuttingView> {
        let data = &case.data;
        let fits = CuttingProblem { model, data }.fits(theta)?;
        let comparison = CuttingComparison::new(data, &fits);
        Ok(CuttingView { fits, comparison })
    }

    fn totals(view: &CuttingView) -> ErrorTotals {
        view.comparison.totals
    }

    fn explained(_case: &CuttingCase, _now: &CuttingView, _with: &CuttingView) {}

    /// With effects in the model what they took up may be what is wrong: nothing is sought then.
    fn setup(
        case: &CuttingCase,
        _study: &CuttingStudy,
        diagnosis: &Diagnosis<Cutting>,
    ) -> Result<SetupCheck> {
        match case.model.effects().is_empty() {
            true => examine_cutting(&case.data, || rival(diagnosis, is_possible)),
            false => Ok(SetupCheck::default()),
        }
    }

    fn lead(
        case: &CuttingCase,
        _campaign: &Campaign,
        _study: &CuttingStudy,
        _diagnosis: &Diagnosis<Cutting>,
        now: &CuttingView,
    ) -> Result<Option<CuttingLead>> {
        Ok(cutting_lead(&case.data, &now.fits))
    }

    fn next(
        case: &CuttingCase,
        _campaign: &Campaign,
        diagnosis: &Diagnosis<Cutting>,
    ) -> Result<NextMeasurement> {
        next_cut::advise_cutting(&case.data, diagnosis)
    }

    fn warnings(calibration: &Calibration) -> Vec<String> {
        Vec::from_iter(calibration.convergence_warning())
    }
}

/// A dynamometer that is damped like a filter is a filter (quartz dynamometers have a few per cent).
fn is_possible(candidate: &EffectCandidate<Cutting>) -> bool {
    const MOST_DAMPING: f64 = 0.3;
    let damping = candidate.parameters.iter().filter(|p| p.name.contains("zeta["));
    let least = damping.map(|p| p.value).fold(f64::INFINITY, f64::min);
    candidate.name.effect != "dynamometer-resonance" || least < MOST_DAMPING
}
