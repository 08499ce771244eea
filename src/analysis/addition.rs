//! An effect added to a campaign's model: everything refitted together, judged on postures or cuts left out, recorded.

use super::side::CampaignSide;
use super::workbench::Workbench;
use crate::campaign::Campaign;
use crate::discrepancy::comparison::compare::ErrorTotals;
use crate::discrepancy::extension::{Extension, Fitted};
use crate::effects::{self, Structure};
use crate::identify::model_history::recorded_effects;
use crate::identify::{Case, Options};
use crate::revision::{self, RecordedParameter, Revision, RevisionLog};
use crate::text::shell_word;
use crate::{InputError, Result};

/// What adding an effect did.
pub struct Addition<D: CampaignSide = Structure> {
    /// Number of the new revision.
    pub revision: usize,
    /// What was added, and the fits without and with it.
    pub extension: Extension<D>,
    /// Error with the effect.
    pub totals: ErrorTotals,
    /// `effect@site` of all that is in the model now.
    pub effects: Vec<String>,
    /// What was noticed while reading.
    pub noticed: Vec<String>,
    /// What is to be known of the fit.
    pub warnings: Vec<String>,
}

/// What all revisions of one addition have in common.
struct Entry<'a> {
    noise_floor_nrms: f64,
    when: &'a str,
    fingerprint: &'a str,
}

impl Entry<'_> {
    /// A fit as it stands in the log.
    fn revision<D: CampaignSide>(&self, fitted: &Fitted<D>, progress: Option<bool>) -> Revision {
        let calibration = &fitted.calibration;
        let parameters = calibration.parameters.iter().map(|p| RecordedParameter {
            name: p.name.clone(),
            value: p.value,
            unit: p.unit.to_string(),
            std_error: Some(p.std_error).filter(|s| s.is_finite()),
            initial: p.initial,
        });
        Revision {
            // The log numbers them.
            revision: 0,
            domain: D::SIDE,
            effects: recorded_effects(&fitted.model),
            parameters: parameters.collect(),
            nrms: fitted.residual.nrms,
            held_out_nrms: fitted.held_out_nrms(),
            noise_floor_nrms: self.noise_floor_nrms,
            reduced_chi2: calibration.reduced_chi2,
            progress,
            when: self.when.to_string(),
            data: self.fingerprint.to_string(),
            why: None,
        }
    }
}

impl<D: CampaignSide> Addition<D> {
    /// Adds the effect `name` (`EFFECT[@SITE][:choice=value]`) to the campaign's model, refits everything and records the revision.
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
        Self::to(D::case(campaign)?, log, campaign, name, options)
    }

    /// As [`after`](Self::after), to a case that is there already.
    ///
    /// # Errors
    /// As there.
    pub fn to(
        case: Case<D>,
        mut log: RevisionLog,
        campaign: &Workbench,
        name: &str,
        options: Options,
    ) -> Result<Self> {
        // Taken with the data that were read, not after the fit.
        let fingerprint = campaign.fingerprint(D::SIDE)?;
        let instances = effects::requested(&D::registry(), &D::known(&case), name)?;
        if let Some(known) = instances
            .iter()
            .map(|i| i.label())
            .find(|label| case.model.has(label))
        {
            return Err(InputError::new(format!("{known} is in the model already"))
                .key("EFFECT")
                .remedy(format!(
                    "the model is: {}; see what else is missing with `lobestone diagnose {}`",
                    case.model_description(),
                    shell_word(&campaign.dir)
                ))
                .into());
        }
        let extension = Extension::new(&D::study(&case, options), &case.model, &instances)?;
        let (before, after) = (&extension.before, &extension.after);
        let totals = D::totals(&D::view(&case, &after.model, &after.calibration.theta)?);
        let when = revision::now();
        let entry = Entry {
            noise_floor_nrms: totals.noise_floor_nrms,
            when: &when,
            fingerprint: &fingerprint,
        };
        let without = entry.revision(before, None);
        let with = Revision {
            why: revision::recall(&campaign.dir, D::SIDE, &fingerprint, &without.effects),
            ..entry.revision(after, extension.progress)
        };
        let revision = log.append(without, with)?;
        let mut warnings = D::warnings(&after.calibration);
        if extension.progress.is_none() {
            warnings.extend(D::one_fold());
        }
        Ok(Addition {
            revision,
            totals,
            effects: after.model.effect_labels(),
            noticed: case.warnings,
            warnings,
            extension,
        })
    }
}
