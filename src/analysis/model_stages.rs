//! The model as it stood at each revision, against the FRFs as they are now.

use num_complex::Complex64;

use crate::Result;
use crate::campaign::Campaign;
use crate::discrepancy::FrfComparison;
use crate::identify::StructureCase;

/// The model at one moment of its growth.
#[derive(Debug, Clone)]
pub struct ModelStage {
    /// As [`Revision::title`](crate::revision::Revision::title).
    pub title: String,
    /// Predictions in the order of `case.data.frfs()`, m/N.
    pub predicted: Vec<Vec<Complex64>>,
    /// These predictions against the measurement.
    pub comparison: FrfComparison,
}

/// Every revision but the present one, oldest first, with the parameters that it was recorded with.
///
/// # Errors
/// A revision whose model the robot cannot have any more.
pub fn earlier_stages(campaign: &Campaign, case: &StructureCase) -> Result<Vec<ModelStage>> {
    let Some((_, earlier)) = case.revisions.split_last() else {
        return Ok(Vec::new());
    };
    earlier
        .iter()
        .map(|revision| {
            let model = case.model_of(campaign, revision)?;
            let theta = model
                .start()
                .map_or_else(|| model.nominal_theta(), <[f64]>::to_vec);
            let predicted = model.predict(&theta, &case.data)?;
            Ok(ModelStage {
                title: revision.title(),
                comparison: FrfComparison::new(&case.data, &model.points, &predicted),
                predicted,
            })
        })
        .collect()
}
