//! A campaign's model as its log of revisions says that it grew.

use crate::campaign::Campaign;
use crate::effects::{Known, Registry};
use crate::identify::model_history::{Revision, recorded_effect};
use crate::identify::{Model, Modelled};
use crate::revision::log_file;
use crate::{InputError, Result};

/// The model of a revision, starting from where that stood.
///
/// # Errors
/// Effects that cannot be in this model.
pub fn with_revision<D: Modelled>(
    campaign: &Campaign,
    registry: &Registry<D>,
    baseline: &Model<D>,
    known: &Known<'_, D>,
    revision: &Revision,
) -> Result<Model<D>> {
    let mut model = baseline.clone();
    for (i, recorded) in revision.effects.iter().enumerate() {
        let wrong = |problem: String| {
            InputError::new(problem)
                .file(log_file(&campaign.dir))
                .key(format!("revisions[{}].effects[{i}]", revision.revision))
        };
        let instance = registry
            .find(known.object, &recorded.effect)
            .into_iter()
            .find(|instance| recorded_effect(instance) == *recorded)
            .ok_or_else(|| {
                let variant = recorded.variant.as_ref();
                let choice = variant.map_or(String::new(), |v| format!(" ({v})"));
                wrong(format!(
                    "there is no effect {}{choice} here",
                    crate::text::shown_briefly(&recorded.effect)
                ))
                .remedy("was the robot changed? undo the revision with `lobestone undo DIR`")
            })?;
        if let Some(obstacle) = instance.effect.obstacle(known) {
            return Err(wrong(format!(
                "{} is in the model, but cannot be any more: {obstacle}",
                recorded.effect
            ))
            .remedy("were files taken away? undo the revision with `lobestone undo DIR`")
            .into());
        }
        model = model.with_effect(instance, known);
    }
    // By name: a tolerance that campaign.toml got since brings parameters that the revision did not have.
    // Into the range, or at an effect's vanishing limit: `with_start` sees to it.
    let start = model.theta_of(|parameter| {
        let recorded = revision.parameters.iter().find(|r| r.name == parameter.name);
        recorded.map(|r| r.value)
    });
    Ok(model.with_start(start))
}
