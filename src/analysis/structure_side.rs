//! The structural side of a campaign: robot model and FRFs.

use num_complex::Complex64;

use super::diagnosis::rival;
use super::side::CampaignSide;
use super::structure::study_of;
use super::workbench::Workbench;
use super::wrong_links::WrongLinks;
use crate::Result;
use crate::campaign::Campaign;
use crate::discrepancy::comparison::compare::ErrorTotals;
use crate::discrepancy::joint_trends::{JointTrends, joint_trends};
use crate::discrepancy::localise::named::named;
use crate::discrepancy::localise::{Localisation, localise, localise_from};
use crate::discrepancy::outlook::next_measurement;
use crate::discrepancy::setup::{SetupCheck, examine};
use crate::discrepancy::{Diagnosis, EffectCandidate, Explained, FrfComparison, NextMeasurement};
use crate::effects::{Instance, Known, Registry, Structure};
use crate::identify::model_history::Side;
use crate::identify::rest::Rest;
use crate::identify::{Calibration, Options, StructureCase, StructureModel, StructureStudy};

/// Share of what stands above the noise from which on an effect that is not all of it has a name for most of it.
const NAMES_MOST: f64 = 0.8;

/// A robot model against the FRFs.
pub struct FrfView {
    /// Predictions in the order of `case.data.frfs()`, m/N.
    pub predicted: Vec<Vec<Complex64>>,
    /// Their errors.
    pub comparison: FrfComparison,
}

/// What is known of a rest that no effect explains, or that the one which is missing leaves.
pub struct StructureLead {
    /// Where it sits and what it does there, if one place explains more than chance.
    pub place: Option<Localisation>,
    /// The effect that was in the model while that was drawn.
    pub beside: Option<String>,
    /// Numbers of the robot file that explain it.
    pub links: Option<WrongLinks>,
    /// Joint stiffness and damping as each posture alone wants them, and what they follow.
    pub joints: JointTrends,
}

impl StructureLead {
    /// Misfit per complex value that the best place leaves: 1 is noise.
    fn left(&self) -> Option<f64> {
        Some(self.place.as_ref()?.places.first()?.left)
    }
}

impl CampaignSide for Structure {
    const SIDE: Side = Side::Structure;
    const FOLDS: &'static str = "postures";
    type View = FrfView;
    type Explained = Explained;
    type Lead = StructureLead;
    type Study = StructureStudy;

    fn registry() -> Registry<Structure> {
        Registry::structure()
    }

    fn known(case: &StructureCase) -> Known<'_, Structure> {
        case.model.known(&case.data.summary())
    }

    fn case(campaign: &Workbench) -> Result<StructureCase> {
        StructureCase::on(campaign)
    }

    fn study(case: &StructureCase, options: Options) -> StructureStudy {
        study_of(case, options)
    }

    fn view(case: &StructureCase, model: &StructureModel, theta: &[f64]) -> Result<FrfView> {
        let predicted = model.predict(theta, &case.data)?;
        Ok(FrfView {
            comparison: FrfComparison::new(&case.data, &model.points, &predicted),
            predicted,
        })
    }

    fn totals(view: &FrfView) -> ErrorTotals {
        view.comparison.totals
    }

    fn explained(case: &StructureCase, now: &FrfView, with: &FrfView) -> Explained {
        Explained::new(&case.data, &case.model.points, &now.predicted, &with.predicted)
    }

    fn setup(
        case: &StructureCase,
        study: &StructureStudy,
        diagnosis: &Diagnosis<Structure>,
    ) -> Result<SetupCheck> {
        let baseline = &diagnosis.baseline;
        let slips = baseline.rest.beyond_slips.as_ref();
        let (model, data, theta) = (&case.model, &case.data, &baseline.theta);
        examine(model, data, theta, slips, study.measured(), || {
            rival(diagnosis, |_| true)
        })
    }

    fn lead(
        case: &StructureCase,
        campaign: &Campaign,
        study: &StructureStudy,
        diagnosis: &Diagnosis<Structure>,
        _now: &FrfView,
    ) -> Result<Option<StructureLead>> {
        let baseline = diagnosis.baseline.calibration.clone();
        let place = Some(localise_from(study, &case.model, baseline)?).filter(|found| found.significant);
        let mut lead = StructureLead {
            place,
            beside: None,
            links: WrongLinks::seek(campaign, case, study, diagnosis)?,
            joints: joint_trends(study, &case.model, &diagnosis.baseline.theta, &campaign.postures)?,
        };
        // Where an effect has a name for most of it already, the rest is what has to be drawn.
        if let Some(guess) = diagnosis.best_guess.map(|number| &diagnosis.candidates[number])
            && guess.share_above_noise(&diagnosis.baseline) >= NAMES_MOST
            && lead.left().is_none_or(|left| guess.reduced_chi2 < left)
            && let Some(beyond) = Self::lead_beyond(study, guess)?
        {
            (lead.place, lead.beside) = (beyond.place, beyond.beside);
        }
        Ok(Some(lead))
    }

    fn named(
        case: &StructureCase,
        study: &StructureStudy,
        diagnosis: &Diagnosis<Structure>,
        lead: &StructureLead,
    ) -> Result<Option<(Instance<Structure>, Vec<f64>)>> {
        match lead {
            StructureLead {
                place: Some(found),
                beside: None,
                ..
            } => named(study, &case.model, found, &diagnosis.candidates),
            _ => Ok(None),
        }
    }

    fn lead_beyond(
        study: &StructureStudy,
        with: &EffectCandidate<Structure>,
    ) -> Result<Option<StructureLead>> {
        let is_left = |rest: &Rest| rest.is_significant() && !rest.is_mostly_slips();
        if !with.rest.as_ref().is_some_and(is_left) {
            return Ok(None);
        }
        let found = localise(study, &with.model.with_start(with.theta.clone()))?;
        Ok(found.significant.then(|| StructureLead {
            place: Some(found),
            beside: Some(with.label()),
            links: None,
            joints: JointTrends::default(),
        }))
    }

    fn next(
        case: &StructureCase,
        campaign: &Campaign,
        diagnosis: &Diagnosis<Structure>,
    ) -> Result<NextMeasurement> {
        next_measurement::advise(&case.data, &campaign.postures, diagnosis)
    }

    fn warnings(calibration: &Calibration) -> Vec<String> {
        calibration.warnings()
    }

    fn one_fold() -> Option<String> {
        let text = "FRFs of one posture only: no posture can be left out of the fit, so whether the error fell for the right \
                    reason cannot be checked";
        Some(text.into())
    }
}
