//! An effect added to a campaign's model: everything refitted together, judged on postures left out, recorded.

use super::structure::study_of;
use crate::analysis::forces::cutting::cutting_comparison;
use crate::analysis::workbench::Workbench;
use crate::campaign::Campaign;
use crate::discrepancy::FrfComparison;
use crate::discrepancy::comparison::compare::ErrorTotals;
use crate::discrepancy::extension::{Extension, Fitted};
use crate::effects::cutting::{self, CuttingInstance};
use crate::effects::{self, Instance};
use crate::identify::model_history::{recorded_cutting_effect, recorded_effect};
use crate::identify::study::Residual;
use crate::identify::{
    Calibration, CuttingCase, CuttingModel, CuttingStudy, Options, StructureCase, StructureModel,
};
use crate::revision::{self, Domain, RecordedEffect, RecordedParameter, Revision, RevisionLog};
use crate::{InputError, Result};

/// A fit as it stands in the log.
struct Entry<'a> {
    domain: Domain,
    calibration: &'a Calibration,
    residual: Residual,
    held_out_nrms: Option<f64>,
    effects: Vec<RecordedEffect>,
}

impl Entry<'_> {
    fn of<'a, M>(domain: Domain, fitted: &'a Fitted<M>, effects: Vec<RecordedEffect>) -> Entry<'a> {
        Entry {
            domain,
            calibration: &fitted.calibration,
            residual: fitted.residual,
            held_out_nrms: fitted.held_out_nrms(),
            effects,
        }
    }

    fn revision(
        self,
        noise_floor_nrms: f64,
        progress: Option<bool>,
        when: &str,
        fingerprint: &str,
    ) -> Revision {
        let parameters = self.calibration.parameters.iter().map(|p| RecordedParameter {
            name: p.name.clone(),
            value: p.value,
            unit: p.unit.to_string(),
            std_error: Some(p.std_error).filter(|s| s.is_finite()),
            initial: p.initial,
        });
        Revision {
            // The log numbers them.
            revision: 0,
            domain: self.domain,
            effects: self.effects,
            parameters: parameters.collect(),
            nrms: self.residual.nrms,
            held_out_nrms: self.held_out_nrms,
            noise_floor_nrms,
            reduced_chi2: self.calibration.reduced_chi2,
            progress,
            when: when.to_string(),
            data: fingerprint.to_string(),
            why: None,
        }
    }
}

/// What adding an effect did.
pub struct Addition<M = StructureModel, I = Instance> {
    /// Number of the new revision.
    pub revision: usize,
    /// What was added, and the fits without and with it.
    pub extension: Extension<M, I>,
    /// Error with the effect.
    pub totals: ErrorTotals,
    /// `effect@site` of all that is in the model now.
    pub effects: Vec<String>,
    /// What was noticed while reading and fitting.
    pub warnings: Vec<String>,
}

impl Addition<CuttingModel, CuttingInstance> {
    /// Adds a cutting effect to the campaign's model of its force records, refits everything and records the revision.
    ///
    /// # Errors
    /// No such effect, one that is in the model already or that these records cannot show; a fit that fails; a log that
    /// is broken or was changed meanwhile. Nothing is recorded then.
    pub fn run_cutting(campaign: &Campaign, name: &str) -> Result<Self> {
        Self::cutting_after(RevisionLog::load(&campaign.dir)?, campaign, name)
    }

    /// As [`run_cutting`](Self::run_cutting), and only if the campaign's log still is `log` in the end.
    ///
    /// # Errors
    /// As there.
    pub fn cutting_after(mut log: RevisionLog, campaign: &Campaign, name: &str) -> Result<Self> {
        let campaign = &Workbench::with_revisions(campaign, log.clone());
        let case = CuttingCase::on(campaign)?;
        let fingerprint = campaign.fingerprint(Domain::Cutting)?;
        let instances = cutting::find(name);
        let wrong = |problem: String| {
            InputError::new(problem).key("EFFECT").remedy(format!(
                "see what is missing with `lobestone diagnose {}`",
                campaign.dir.display()
            ))
        };
        if case.effects().iter().any(|e| e == name) {
            return Err(wrong(format!("{name} is in the model already")).into());
        }
        let summary = case.model.summary(&case.data);
        match instances.first().map(|i| i.effect.obstacle(&summary)) {
            None => return Err(wrong(format!("there is no cutting effect {name}")).into()),
            Some(Some(obstacle)) => {
                return Err(wrong(format!("this campaign cannot show {name}: {obstacle}")).into());
            }
            Some(None) => {}
        }
        let study = CuttingStudy::new(case.data.clone());
        let extension = Extension::new(&study, &case.model, &instances)?;
        let Extension {
            before,
            after,
            progress,
            ..
        } = &extension;
        let totals = cutting_comparison(&after.model, &case.data, &after.calibration.theta)?.totals;
        let noise = totals.noise_floor_nrms;
        let recorded = |fitted: &Fitted<CuttingModel>| -> Vec<RecordedEffect> {
            let effects = fitted.model.effects().iter();
            effects
                .map(|added| recorded_cutting_effect(&added.instance))
                .collect()
        };
        let when = revision::now();
        let entry = |fitted, progress| {
            Entry::of(Domain::Cutting, fitted, recorded(fitted)).revision(
                noise,
                progress,
                &when,
                &fingerprint,
            )
        };
        let without = entry(before, None);
        let with = Revision {
            why: revision::recall(&campaign.dir, Domain::Cutting, &fingerprint, &without.effects),
            ..entry(after, *progress)
        };
        let revision = log.append(without, with)?;
        let mut warnings = case.warnings.clone();
        warnings.extend(after.calibration.convergence_warning());
        let effects = after.model.effects().iter();
        Ok(Addition {
            revision,
            totals,
            effects: effects.map(|added| added.instance.label()).collect(),
            warnings,
            extension,
        })
    }
}

impl Addition {
    /// Adds the effect `name` (`EFFECT[@SITE]`) to the campaign's model, refits everything and records the revision.
    ///
    /// # Errors
    /// No such effect or site, one that is in the model already or that this data cannot show; a fit that fails; a log
    /// that is broken or was changed meanwhile. Nothing is recorded then.
    pub fn run(campaign: &Campaign, name: &str, options: Options) -> Result<Self> {
        Self::after(RevisionLog::load(&campaign.dir)?, campaign, name, options)
    }

    /// As [`run`](Self::run), and only if the campaign's log still is `log` in the end.
    ///
    /// # Errors
    /// As there.
    pub fn after(log: RevisionLog, campaign: &Campaign, name: &str, options: Options) -> Result<Self> {
        let campaign = &Workbench::with_revisions(campaign, log.clone());
        Self::to(StructureCase::on(campaign)?, log, campaign, name, options)
    }

    /// As [`after`](Self::after), to a case that is there already.
    ///
    /// # Errors
    /// As there.
    pub fn to(
        case: StructureCase,
        mut log: RevisionLog,
        campaign: &Workbench,
        name: &str,
        options: Options,
    ) -> Result<Self> {
        let data = &case.data;
        // Taken with the data that were read, not after the fit.
        let fingerprint = campaign.fingerprint(Domain::Structure)?;
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
        let extension = Extension::new(&study_of(&case, options), &case.model, &instances)?;
        let Extension {
            before,
            after,
            progress,
            ..
        } = &extension;
        let predicted = after.model.predict(&after.calibration.theta, data)?;
        let totals = FrfComparison::new(data, &after.model.points, &predicted).totals;
        let noise_floor_nrms = totals.noise_floor_nrms;

        let recorded = |fitted: &Fitted<StructureModel>| -> Vec<RecordedEffect> {
            let effects = fitted.model.effects().iter();
            effects.map(|added| recorded_effect(&added.instance)).collect()
        };
        let when = revision::now();
        let entry = |fitted, progress| {
            let entry = Entry::of(Domain::Structure, fitted, recorded(fitted));
            entry.revision(noise_floor_nrms, progress, &when, &fingerprint)
        };
        let without = entry(before, None);
        let with = Revision {
            why: revision::recall(&campaign.dir, Domain::Structure, &fingerprint, &without.effects),
            ..entry(after, *progress)
        };
        let revision = log.append(without, with)?;
        let effects = after.model.effects().iter();
        let effects = effects.map(|added| added.instance.label()).collect();
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
            effects,
            warnings,
        })
    }
}
