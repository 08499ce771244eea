//! A cutting model with its force records, ready to be fitted.

use crate::Result;
use crate::effects::Cutting;
use crate::identify::case::Case;
use crate::identify::forces::cutting_data::CuttingData;
use crate::identify::forces::cutting_model::CuttingModel;

/// The campaign's cutting model with its force records.
pub type CuttingCase = Case<Cutting>;

impl CuttingCase {
    /// The baseline model and the cuts it is to be fitted to.
    ///
    /// # Errors
    /// Cuts that do not determine where a fit starts.
    pub fn new(data: CuttingData) -> Result<Self> {
        let warnings = data.warnings.clone();
        Ok(Case::without_history(
            CuttingModel::new(&data, true)?,
            data,
            warnings,
        ))
    }
}
