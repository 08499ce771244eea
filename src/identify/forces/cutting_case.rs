//! A cutting model with its force records, ready to be fitted.

use crate::Result;
use crate::identify::forces::cutting_data::CuttingData;
use crate::identify::forces::cutting_model::CuttingModel;
use crate::identify::model_history::Revision;

/// Model, data and what was noticed while reading them.
#[derive(Debug, Clone)]
pub struct CuttingCase {
    /// The campaign's current model: the baseline with the effects that were added, starting from where the last
    /// revision stood.
    pub model: CuttingModel,
    /// Force records arranged for fitting.
    pub data: CuttingData,
    /// What was added so far, oldest first; the first is the baseline. Empty where nothing was.
    pub revisions: Vec<Revision>,
    /// What was noticed while reading and arranging, for people.
    pub warnings: Vec<String>,
}

impl CuttingCase {
    /// The baseline model and the cuts it is to be fitted to.
    ///
    /// # Errors
    /// Cuts that do not determine where a fit starts.
    pub fn new(data: CuttingData) -> Result<Self> {
        Ok(CuttingCase {
            model: CuttingModel::new(&data, true)?,
            warnings: data.warnings.clone(),
            revisions: Vec::new(),
            data,
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
