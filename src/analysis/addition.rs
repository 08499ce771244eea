//! An effect added to a campaign's model: everything refitted together, judged on postures left out, recorded.

use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::campaign::Campaign;
use crate::discrepancy::FrfComparison;
use crate::discrepancy::compare::ErrorTotals;
use crate::discrepancy::correlation::lines_together;
use crate::discrepancy::diagnose::{effect_starts, residual_peaks_hz};
use crate::effects::{self, Instance};
use crate::identify::calibrate::{calibrate, refine};
use crate::identify::case::recorded_effect;
use crate::identify::extend::{HeldOut, held_out, screen, screening_stride};
use crate::identify::{Calibration, Fit, FrfData, Options, StructureCase, StructureModel};
use crate::revision::{self, Domain, RecordedParameter, Revision, RevisionLog, structure_fingerprint};
use crate::{Error, InputError, Result};

/// A model fitted to the campaign's FRFs.
pub struct Fitted {
    pub model: StructureModel,
    pub calibration: Calibration,
    pub totals: ErrorTotals,
    /// On postures left out of the fit; `None` with one posture.
    pub held_out: Option<HeldOut>,
    /// How many neighbouring lines err together: 1 where only noise is left.
    pub lines_together: f64,
}

impl Fitted {
    fn new(model: StructureModel, calibration: Calibration, data: &FrfData) -> Result<Self> {
        let predicted = model.predict(&calibration.theta, data)?;
        let totals = FrfComparison::new(data, &model.points, &predicted).totals;
        let held_out = held_out(&model, data, &calibration.theta, 1)?;
        Ok(Fitted {
            model,
            calibration,
            totals,
            held_out,
            lines_together: lines_together(data, &predicted),
        })
    }

    pub fn held_out_nrms(&self) -> Option<f64> {
        self.held_out.map(|h| h.nrms())
    }

    fn revision(&self, progress: Option<bool>, when: &str, fingerprint: &str) -> Revision {
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
            domain: Domain::Structure,
            effects: self
                .model
                .effects()
                .iter()
                .map(|added| recorded_effect(&added.instance))
                .collect(),
            parameters: parameters.collect(),
            nrms: self.totals.nrms,
            held_out_nrms: self.held_out_nrms(),
            noise_floor_nrms: self.totals.noise_floor_nrms,
            reduced_chi2: self.calibration.reduced_chi2,
            progress,
            when: when.to_string(),
            data: fingerprint.to_string(),
        }
    }
}

/// What adding an effect did.
pub struct Addition {
    pub instance: Instance,
    /// Number of the new revision.
    pub revision: usize,
    /// The model as it stood, fitted to the same data.
    pub before: Fitted,
    pub after: Fitted,
    /// Whether the held-out error fell by more than chance would let it; `None` with one posture.
    pub progress: Option<bool>,
    pub warnings: Vec<String>,
}

/// Chance that an effect which is not there would be called progress.
const CHANCE: f64 = 1e-3;

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
        let before = calibrate(&case.model, data, case.options(options))?;
        let (instance, model, fit) = best_variant(&case.model, data, &before, &instances)?;
        let after = calibrate(&model.with_start(fit.theta), data, options)?;
        let before = fair(&case.model, data, before, &after, options)?;
        let before = Fitted::new(case.model.clone(), before, data)?;
        let after = Fitted::new(model, after, data)?;
        let progress = progress(&before, &after);

        let when = revision::now();
        let revision = log.append(
            before.revision(None, &when, &fingerprint),
            after.revision(progress, &when, &fingerprint),
        )?;
        let mut warnings = case.warnings.clone();
        warnings.extend(after.calibration.warnings());
        if progress.is_none() {
            warnings.push(
                "FRFs of one posture only: no posture can be left out of the fit, so whether the error fell for the right \
                 reason cannot be checked"
                    .into(),
            );
        }
        Ok(Addition {
            instance,
            revision,
            before,
            after,
            progress,
            warnings,
        })
    }
}

/// The discrete choice that fits best, from the current solution, the nominal one and the effect's own starts.
fn best_variant(
    model: &StructureModel,
    data: &FrfData,
    calibration: &Calibration,
    instances: &[Instance],
) -> Result<(Instance, StructureModel, Fit)> {
    let summary = data.summary();
    let stride = screening_stride(data);
    let bases = [calibration.theta.clone(), model.nominal_theta()];
    let peaks = residual_peaks_hz(model, data, &calibration.theta)?;
    let fits: Vec<Result<(Instance, StructureModel, Fit)>> = instances
        .par_iter()
        .map(|instance| {
            let extended = model.with_effect(*instance, &summary);
            let own = effect_starts(&extended, *instance, &peaks, &summary);
            let fit = screen(&extended, data, stride, &bases, &own)?;
            Ok((*instance, extended, fit))
        })
        .collect();
    let mut best: Option<(Instance, StructureModel, Fit)> = None;
    let mut failure = Error::computation("no form of the effect could be fitted");
    for fit in fits {
        match fit {
            Ok(fit) if best.as_ref().is_none_or(|b| fit.2.cost < b.2.cost) => best = Some(fit),
            Ok(_) => {}
            Err(error) => failure = error,
        }
    }
    best.ok_or(failure)
}

/// The fit without the effect, also tried from where the one with it put the common parameters: a trapped `before` would
/// make any effect look good.
fn fair(
    model: &StructureModel,
    data: &FrfData,
    before: Calibration,
    after: &Calibration,
    options: Options,
) -> Result<Calibration> {
    let common = after.theta[..model.parameters.len()].to_vec();
    let freedom = (2 * data.value_count()) as f64 - model.parameters.len() as f64;
    let fit = refine(model, data, &common)?;
    if 2.0 * fit.cost / freedom.max(1.0) < 0.999 * before.reduced_chi2 {
        return calibrate(&model.with_start(fit.theta), data, options);
    }
    Ok(before)
}

/// Whether the error on postures left out of the fit fell by more than chance.
///
/// An effect that is not there makes predictions worse on average; that its k parameters improve the held-out −2 ln L by
/// more than the (1 − p) quantile of χ²(k) is less likely than p. Where more than noise is left, that rest is the
/// measure of chance, and lines that err together count once. The held-out nrms, which weighs lines by size instead of by
/// noise, must fall too.
fn progress(before: &Fitted, after: &Fitted) -> Option<bool> {
    let (was, is) = (before.held_out?, after.held_out?);
    let parameters = after.model.parameters.len() - before.model.parameters.len();
    let threshold = ChiSquared::new(parameters as f64).map_or(0.0, |d| d.inverse_cdf(1.0 - CHANCE));
    let chance = after.calibration.reduced_chi2.max(1.0) * after.lines_together;
    let gain = 2.0 * (was.chi2 - is.chi2) / chance;
    Some(gain > threshold && is.nrms() < was.nrms())
}
