//! Whether the robot file's links are not those of the robot: asked where no effect explains what is left.

use serde::Serialize;

use super::freed_links::{by_name, fitted_departing};
use super::structure_case::Freed;
use crate::Result;
use crate::campaign::{Campaign, LinkGroup};
use crate::discrepancy::candidate::share_taken;
use crate::discrepancy::verdict::is_noise;
use crate::discrepancy::{Diagnosis, EffectCandidate};
use crate::effects::{LINK_FLEXIBILITY, Structure};
use crate::identify::levenberg_marquardt::{Fit, LeastSquares, Stopping, minimise};
use crate::identify::study::{Extent, Study, View};
use crate::identify::{Calibration, Estimate, StructureCase, StructureModel, StructureStudy};

/// Numbers of the robot file that the data contradict, and that explain what no effect does.
#[derive(Debug, Clone, Serialize)]
pub struct WrongLinks {
    /// As fitted; the robot file's as `initial`.
    pub departing: Vec<Estimate>,
    /// Weighted misfit per value that is left with them.
    pub reduced_chi2: f64,
    /// Share of what stands above the noise that they explain, 0..1.
    pub explained_share: f64,
    /// The effect that the model has besides; `None` where it stands as it is.
    pub beside: Option<String>,
}

/// Share of what stands above the noise in a glance at the data that all numbers together must explain to be followed.
const PROMISING: f64 = 0.5;
/// Numbers that must differ, at most, to be told: more of them imitate much that is not of the links.
const FEW: usize = 8;

const LOOK: Stopping = Stopping {
    max_iterations: 8,
    relative_decrease: 1e-3,
};
const SETTLE: Stopping = Stopping {
    max_iterations: 25,
    relative_decrease: 1e-6,
};

impl WrongLinks {
    /// Sought from where the diagnosis left the model as it stands, and where the links bend that the robot file has as rigid, from
    /// where that left them; `None` where such numbers do not explain what is left, or no better than an effect.
    ///
    /// # Errors
    /// A model that cannot be set up, and a fit that fails.
    pub fn seek(
        campaign: &Campaign,
        case: &StructureCase,
        study: &StructureStudy,
        diagnosis: &Diagnosis<Structure>,
    ) -> Result<Option<Self>> {
        let standing = &diagnosis.baseline.calibration;
        if let Some(found) = Self::beside(campaign, case, study, diagnosis, (None, standing))? {
            return Ok(Some(found));
        }
        let Some(bending) = diagnosis.best_guess.map(|i| &diagnosis.candidates[i]) else {
            return Ok(None);
        };
        if bending.name.effect != LINK_FLEXIBILITY || !bending.refined {
            return Ok(None);
        }
        let problem = study.problem(&bending.model, View::FULL);
        let fit = minimise(&problem, &bending.theta, &bending.model.bounds(), SETTLE)?;
        let fit = Calibration::of_fit(&bending.model.parameters, fit, study.real_values(Extent::Full))?;
        Self::beside(campaign, case, study, diagnosis, (Some(bending), &fit))
    }

    /// From the fit of the case's model, or of that with one effect more.
    fn beside(
        campaign: &Campaign,
        case: &StructureCase,
        study: &StructureStudy,
        diagnosis: &Diagnosis<Structure>,
        (effect, before): (Option<&EffectCandidate<Structure>>, &Calibration),
    ) -> Result<Option<Self>> {
        let as_it_stands = effect.map_or(&case.model, |effect| &effect.model);
        let groups: Vec<LinkGroup> = LinkGroup::of_model(as_it_stands.has(LINK_FLEXIBILITY));
        let free = |only: Option<&[String]>| -> Result<StructureModel> {
            let groups = &groups;
            let freed = case.freeing(campaign, &Freed { groups, only })?.model;
            Ok(match effect {
                Some(effect) => study.extend(&freed, &effect.instance),
                None => freed,
            })
        };
        let every = free(None)?;
        if every.parameters.len() == before.parameters.len() {
            return Ok(None);
        }
        let fit = |model: &StructureModel, view: View, start: &[f64], stopping| {
            minimise(&study.problem(model, view), start, &model.bounds(), stopping)
        };
        let start = by_name(&every.parameters, &before.parameters);
        let above_noise = study.problem(as_it_stands, View::GLANCE).cost(&before.theta)?
            - 0.5 * study.real_values(Extent::Glance) as f64;
        // What one step of Gauss and Newton promises is soon known, and mostly enough.
        let here = study.problem(&every, View::GLANCE).linearise(&start)?;
        let promised = here
            .newton_step()
            .map_or(0.0, |step| -0.5 * here.gradient.dot(&step));
        if above_noise <= 0.0 || promised < PROMISING * above_noise {
            return Ok(None);
        }
        let with = fit(&every, View::GLANCE, &start, LOOK)?;
        let without = fit(as_it_stands, View::GLANCE, &before.theta, LOOK)?;
        if without.cost - with.cost < PROMISING * above_noise {
            return Ok(None);
        }
        let calibrated = |model: StructureModel, fit: Fit, extent| {
            let found = Calibration::of_fit(&model.parameters, fit, study.real_values(extent))?;
            Ok::<_, crate::Error>((model, found))
        };
        let near = fit(&every, View::COARSE, &with.theta, SETTLE)?;
        let every = calibrated(every, near, Extent::Coarse)?;
        let (names, (_, after)) = fitted_departing(
            before,
            &every,
            |(model, found)| (&model.parameters, found),
            |kept, (_, found)| {
                let model = free(Some(kept))?;
                let start = by_name(&model.parameters, &found.parameters);
                let fit = fit(&model, View::FULL, &start, SETTLE)?;
                calibrated(model, fit, Extent::Full)
            },
        )?;
        let base = diagnosis.baseline.reduced_chi2;
        let possible = |c: &&EffectCandidate<Structure>| c.refined && !c.at_bound && c.not_credible.is_none();
        let effects = diagnosis.candidates.iter().filter(possible);
        let best = effects.map(|c| c.reduced_chi2).fold(base, f64::min);
        let told = (1..=FEW).contains(&names.len())
            && after.reduced_chi2 < best
            && is_noise(after.reduced_chi2)
            && !is_noise(base);
        Ok(told.then(|| WrongLinks {
            departing: after
                .parameters
                .iter()
                .filter(|p| names.contains(&p.name))
                .cloned()
                .collect(),
            reduced_chi2: after.reduced_chi2,
            explained_share: share_taken(base, after.reduced_chi2).clamp(0.0, 1.0),
            beside: effect.map(EffectCandidate::label),
        }))
    }
}
