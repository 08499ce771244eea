//! A campaign's FRFs: calibration and comparison before and after.

use num_complex::Complex64;

use crate::Result;
use crate::campaign::Campaign;
use crate::discrepancy::FrfComparison;
use crate::identify::calibrate::calibrate;
use crate::identify::{Calibration, Options, StructureCase};

/// The robot model of a campaign against its FRFs: as the robot file has it, and calibrated with the effects that were
/// added.
pub struct StructureAnalysis {
    pub case: StructureCase,
    pub calibration: Calibration,
    /// Predictions in the order of `case.data.frfs()`, m/N.
    pub nominal: Vec<Vec<Complex64>>,
    pub calibrated: Vec<Vec<Complex64>>,
    pub before: FrfComparison,
    pub after: FrfComparison,
    /// What was noticed while reading and fitting.
    pub warnings: Vec<String>,
}

impl StructureAnalysis {
    pub fn run(campaign: &Campaign, options: Options) -> Result<Self> {
        Self::of(StructureCase::load(campaign)?, options)
    }

    pub fn of(case: StructureCase, options: Options) -> Result<Self> {
        let calibration = calibrate(&case.model, &case.data, case.options(options))?;
        let nominal = case
            .baseline
            .predict(&case.baseline.nominal_theta(), &case.data)?;
        let calibrated = case.model.predict(&calibration.theta, &case.data)?;
        let before = FrfComparison::new(&case.data, &case.model.points, &nominal);
        let after = FrfComparison::new(&case.data, &case.model.points, &calibrated);
        let mut warnings = case.warnings.clone();
        warnings.extend(calibration.warnings());
        Ok(StructureAnalysis {
            case,
            calibration,
            nominal,
            calibrated,
            before,
            after,
            warnings,
        })
    }
}
