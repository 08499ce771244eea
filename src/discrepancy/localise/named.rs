//! Whether what the data draw is an effect of the library that a diagnosis did not see.

use rayon::prelude::*;

use super::{Localisation, REFINE};
use crate::Result;
use crate::discrepancy::candidate::EffectCandidate;
use crate::effects::{Instance, Structure};
use crate::identify::levenberg_marquardt::Stopping;
use crate::identify::study::{Extent, Study, View, fit_from, own_starts};
use crate::identify::{LeastSquares, StructureModel, StructureStudy, minimise};

/// Share of what the drawn form takes away that an effect must take away in a few steps to be worth another diagnosis.
const ALIKE: f64 = 0.7;
/// Share of its misfit by which its fit must be better than the one that is known.
const NEWS: f64 = 1e-3;
const FEW_STEPS: Stopping = Stopping {
    max_iterations: 8,
    relative_decrease: 1e-3,
};

/// The effect of the library that does nearly what the drawn form does at the best place of `found`, and its fit's parameters with
/// those of `model` in front (solver's scale). What is missing may drive the joints so far that its own name is not seen from there,
/// while the drawn form has put them right; sizes of the same name begin where it has them. `None` where one of `tried`, what a
/// diagnosis made of it, is as good already.
///
/// # Errors
/// A model that does not respond.
pub fn named(
    study: &StructureStudy,
    model: &StructureModel,
    found: &Localisation,
    tried: &[EffectCandidate<Structure>],
) -> Result<Option<(Instance<Structure>, Vec<f64>)>> {
    let Some(best) = found.places.first().and_then(|place| place.best.as_ref()) else {
        return Ok(None);
    };
    let count = model.parameters.len();
    let without = study.problem(model, View::GLANCE).cost(&found.baseline.theta)?;
    let drawn = study.problem(&best.model, View::GLANCE).cost(&best.theta)?;
    let instances = study.instances(model).0;
    let hints = study.hints(model, &found.baseline.theta)?;
    let fits = instances.par_iter().filter_map(|instance| {
        let extended = study.extend(model, instance);
        let problem = study.problem(&extended, View::GLANCE);
        let starts = own_starts(study, &extended, count, instance, &hints);
        let start = starts
            .into_iter()
            .map(|own| {
                let own = extended.parameters[count..].iter().zip(own).map(|(p, start)| {
                    let mut drawn = best.parts().flat_map(|part| &part.parameters);
                    // `branch@link-3.x.mass_kg`
                    let drawn = drawn.find(|d| d.name.rsplit('.').next() == p.name.rsplit('.').next());
                    drawn.map_or(start, |d| p.internal_within(d.value))
                });
                best.theta[..count].iter().copied().chain(own).collect()
            })
            .map(|start: Vec<f64>| (problem.cost(&start).unwrap_or(f64::INFINITY), start))
            .min_by(|a, b| a.0.total_cmp(&b.0))?
            .1;
        let fit = minimise(&problem, &start, &extended.bounds(), FEW_STEPS).ok()?;
        Some((fit.cost, *instance, fit.theta))
    });
    let nearest = fits.min_by(|a, b| a.0.total_cmp(&b.0));
    let nearest = nearest.filter(|(cost, ..)| drawn < without && without - cost > ALIKE * (without - drawn));
    let Some((_, instance, theta)) = nearest else {
        return Ok(None);
    };
    let Some(known) = tried.iter().find(|known| known.label() == instance.label()) else {
        return Ok(Some((instance, theta)));
    };
    let fit = fit_from(study, model, &instance, &theta, View::FULL, REFINE)?.fit;
    let freedom = study.real_values(Extent::Full) as f64 - fit.theta.len() as f64;
    let is_news = 2.0 * fit.cost < (1.0 - NEWS) * known.reduced_chi2 * freedom;
    Ok(is_news.then_some((instance, fit.theta)))
}
