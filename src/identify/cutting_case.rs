//! A campaign's cutting side, loaded and ready to be fitted.

use super::cutting_data::{CuttingData, processes};
use super::cutting_model::CuttingModel;
use crate::campaign::Campaign;
use crate::effects::cutting::{self, CuttingInstance};
use crate::revision::{Domain, RecordedEffect, Revision, RevisionLog, log_file};
use crate::{InputError, Result};

/// Model, data and what was noticed while reading them.
#[derive(Debug, Clone)]
pub struct CuttingCase {
    /// The campaign's current model: the baseline with the effects that were added, starting from where the last
    /// revision stood.
    pub model: CuttingModel,
    pub data: CuttingData,
    /// What was added so far, oldest first; the first is the baseline. Empty where nothing was.
    pub revisions: Vec<Revision>,
    pub warnings: Vec<String>,
}

/// How an instance stands in the log.
pub fn recorded_cutting_effect(instance: &CuttingInstance) -> RecordedEffect {
    let variant = instance.effect.variant_label(instance.variant);
    RecordedEffect {
        effect: instance.label(),
        variant: variant.map(|(_, value)| value.to_string()),
    }
}

fn material(campaign: &Campaign, cut: usize) -> &str {
    campaign.cuts[cut].material.as_deref().unwrap_or("no material")
}

/// The material of most cuts (the first of equals) and the names of the others; `None` where there is one only.
fn materials(campaign: &Campaign, data: &CuttingData) -> Option<(String, String)> {
    let mut counts: Vec<(&str, usize)> = Vec::new();
    for cut in &data.cuts {
        let material = material(campaign, cut.cut);
        match counts.iter_mut().find(|c| c.0 == material) {
            Some(one) => one.1 += 1,
            None => counts.push((material, 1)),
        }
    }
    let most = counts.iter().map(|c| c.1).max()?;
    let main = counts.iter().position(|c| c.1 == most)?;
    let (name, _) = counts.remove(main);
    let others: Vec<&str> = counts.iter().map(|c| c.0).collect();
    (!others.is_empty()).then(|| (name.to_string(), others.join(", ")))
}

impl CuttingCase {
    /// The cuts of the campaign's main process.
    ///
    /// # Errors
    /// No cuts, records that cannot be read, a broken revision log.
    pub fn load(campaign: &Campaign) -> Result<Self> {
        let processes = processes(campaign);
        let Some(&process) = processes.first() else {
            return Err(
                InputError::new("the campaign has no [[cut]]: no force records to compare")
                    .file(campaign.dir.join("campaign.toml"))
                    .key("cut")
                    .remedy("add [[cut]] tables that name the force records")
                    .into(),
            );
        };
        let mut data = CuttingData::load(campaign, process)?;
        let mut warnings = data.warnings.clone();
        if let Some((main, others)) = materials(campaign, &data) {
            warnings.push(format!(
                "the cuts of {others} are not compared: one material at a time, here {main}, of which most cuts are"
            ));
            data = data.filtered(|i| material(campaign, data.cuts[i].cut) == main);
        }
        if let Some(other) = processes.get(1) {
            let name = other.name();
            warnings.push(format!("the {name} cuts are not compared: one process at a time"));
        }
        let log = RevisionLog::load(&campaign.dir)?;
        let revisions: Vec<Revision> = log.revisions(Domain::Cutting).cloned().collect();
        let mut model = CuttingModel::new(&data, true)?;
        if let Some(current) = revisions.last() {
            for (i, recorded) in current.effects.iter().enumerate() {
                let instance = cutting::find(&recorded.effect)
                    .into_iter()
                    .find(|instance| recorded_cutting_effect(instance) == *recorded)
                    .ok_or_else(|| {
                        InputError::new(format!("there is no cutting effect {}", recorded.effect))
                            .file(log_file(&campaign.dir))
                            .key(format!("revisions[{}].effects[{i}]", current.revision))
                            .remedy("undo the revision with `lobestone undo DIR`")
                    })?;
                model = model.with_effect(instance, &data);
            }
            let start = model.parameters.iter().map(|parameter| {
                let known = current.parameters.iter().find(|r| r.name == parameter.name);
                let value = known.map_or(parameter.nominal, |r| r.value);
                parameter.internal(value)
            });
            let start = start.collect();
            model = model.with_start(start);
        }
        Ok(CuttingCase {
            model,
            data,
            revisions,
            warnings,
        })
    }

    /// Number of the current revision; `None` where nothing was ever added.
    pub fn revision(&self) -> Option<usize> {
        self.revisions.last().map(|r| r.revision)
    }

    /// Ids of what is in the model beside the baseline.
    pub fn effects(&self) -> Vec<String> {
        let effects = self.model.effects().iter();
        effects.map(|added| added.instance.label()).collect()
    }
}
