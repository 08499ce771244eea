//! An effect added to a campaign's model: everything refitted together, judged on postures left out, recorded.

use crate::campaign::Campaign;
use crate::discrepancy::FrfComparison;
use crate::discrepancy::compare::ErrorTotals;
use crate::discrepancy::extension::{Extension, Fitted};
use crate::effects::{self, Instance};
use crate::identify::case::recorded_effect;
use crate::identify::{Options, StructureCase, StructureModel};
use crate::revision::{self, Domain, RecordedParameter, Revision, RevisionLog, structure_fingerprint};
use crate::{InputError, Result};

/// A fit as it stands in the log.
fn recorded(
    fitted: &Fitted<StructureModel>,
    noise_floor_nrms: f64,
    progress: Option<bool>,
    when: &str,
    fingerprint: &str,
) -> Revision {
    let calibration = &fitted.calibration;
    let parameters = calibration.parameters.iter().map(|p| RecordedParameter {
        name: p.name.clone(),
        value: p.value,
        unit: p.unit.to_string(),
        std_error: Some(p.std_error).filter(|s| s.is_finite()),
        initial: p.initial,
    });
    let effects = fitted.model.effects().iter();
    Revision {
        // The log numbers them.
        revision: 0,
        domain: Domain::Structure,
        effects: effects.map(|added| recorded_effect(&added.instance)).collect(),
        parameters: parameters.collect(),
        nrms: fitted.residual.nrms,
        held_out_nrms: fitted.held_out_nrms(),
        noise_floor_nrms,
        reduced_chi2: calibration.reduced_chi2,
        progress,
        when: when.to_string(),
        data: fingerprint.to_string(),
    }
}

/// What adding an effect did.
pub struct Addition {
    /// Number of the new revision.
    pub revision: usize,
    pub extension: Extension<StructureModel, Instance>,
    /// Error with the effect.
    pub totals: ErrorTotals,
    pub warnings: Vec<String>,
}

impl Addition {
    /// Adds the effect `name` (`EFFECT[@SITE]`) to the campaign's model, refits everything and records the revision.
    ///
    /// # Errors
    /// No such effect or site, one that is in the model already or that this data cannot show; a fit that fails; a log
    /// that is broken or was changed meanwhile. Nothing is recorded then.
    pub fn run(campaign: &Campaign, name: &str, options: Options) -> Result<Self> {
        let mut log = RevisionLog::load(&campaign.dir)?;
        let case = StructureCase::load(campaign)?;
        let data = &case.data;
        // Taken with the data that were read, not after the fit.
        let fingerprint = structure_fingerprint(campaign)?;
        let instances = effects::requested(&case.model.robot.spec, &data.summary(), name)?;
        if case.model.has(name) {
            return Err(InputError::new(format!("{name} is in the model already"))
                .key("EFFECT")
                .remedy(format!(
                    "the model is: {}; see what else is missing with `lobestone diagnose {}`",
                    case.model_description(),
                    campaign.dir.display()
                ))
                .into());
        }
        let extension = Extension::new(&case.study(options), &case.model, &instances)?;
        let Extension {
            before,
            after,
            progress,
            ..
        } = &extension;
        let predicted = after.model.predict(&after.calibration.theta, data)?;
        let totals = FrfComparison::new(data, &after.model.points, &predicted).totals;
        let noise_floor_nrms = totals.noise_floor_nrms;

        let when = revision::now();
        let revision = log.append(
            recorded(before, noise_floor_nrms, None, &when, &fingerprint),
            recorded(after, noise_floor_nrms, *progress, &when, &fingerprint),
        )?;
        let mut warnings = case.warnings.clone();
        warnings.extend(extension.after.calibration.warnings());
        if extension.progress.is_none() {
            warnings.push(
                "FRFs of one posture only: no posture can be left out of the fit, so whether the error fell for the right \
                 reason cannot be checked"
                    .into(),
            );
        }
        Ok(Addition {
            revision,
            extension,
            totals,
            warnings,
        })
    }
}
