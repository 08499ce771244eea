//! A campaign's FRFs: calibration and comparison before and after.

use std::sync::Arc;

use num_complex::Complex64;

use crate::Result;
use crate::analysis::modes::modal::ModalAnalysis;
use crate::analysis::modes::mode_comparison::measured_modes;
use crate::analysis::workbench::Workbench;
use crate::campaign::Campaign;
use crate::discrepancy::FrfComparison;
use crate::discrepancy::setup::{SetupCheck, absorb_slips, examine, library_rival};
use crate::identify::frfs::calibrate::calibrate;
use crate::identify::frfs::modal_start::{ModalStart, PostureMeasurement, modal_start};
use crate::identify::{Calibration, Options, StructureCase, StructureStudy};

/// The robot model of a campaign against its FRFs: as the robot file has it, and calibrated with the effects that were
/// added.
pub struct StructureAnalysis {
    /// Model and data.
    pub case: StructureCase,
    /// The model fitted to the data.
    pub calibration: Calibration,
    /// Predictions in the order of `case.data.frfs()`, m/N.
    pub nominal: Vec<Vec<Complex64>>,
    /// The same after calibration.
    pub calibrated: Vec<Vec<Complex64>>,
    /// The model by the robot file against the measurement.
    pub before: FrfComparison,
    /// The calibrated model against the measurement.
    pub after: FrfComparison,
    /// The starting point that the measured modes gave; `None` where a revision gave one, or there are no modes.
    pub start: Option<ModalStart>,
    /// What was noticed while reading and fitting.
    pub warnings: Vec<String>,
}

impl StructureAnalysis {
    /// # Errors
    /// A case that cannot be loaded, or FRFs that do not determine the parameters.
    pub fn run(campaign: &Campaign, options: Options) -> Result<Self> {
        Self::of_case(StructureCase::load(campaign)?, options)
    }

    /// With the usual options, worked out once of what lies on the bench.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn on(campaign: &Workbench) -> Result<Arc<Self>> {
        campaign.once(|| {
            let case = StructureCase::on(campaign)?;
            // FRFs that show no modes can still be fitted.
            let modal = ModalAnalysis::usual(campaign).ok();
            Self::of(case, modal.as_deref(), Options::default())
        })
    }

    /// As [`run`](Self::run), of a case that is there already.
    ///
    /// # Errors
    /// FRFs that do not determine the parameters.
    pub fn of_case(case: StructureCase, options: Options) -> Result<Self> {
        let modal = match case.model.start() {
            Some(_) => None,
            None => modes_to_start_from(&case),
        };
        Self::of(case, modal.as_ref(), options)
    }

    /// `modal`: the campaign's measured modes, from which a case without a start of its own starts as well.
    ///
    /// # Errors
    /// FRFs that do not determine the parameters.
    pub fn of(case: StructureCase, modal: Option<&ModalAnalysis>, options: Options) -> Result<Self> {
        let start = match (case.model.start(), modal) {
            (None, Some(modal)) => start_of_modes(&case, modal)?,
            _ => None,
        };
        let measured = start.as_ref().map(|s| s.theta.as_slice());
        let calibration = calibrate(&case.model, &case.data, measured, case.options(options))?
            .covering(&case.model, &case.data)?;
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
            start,
            warnings,
        })
    }
}

impl StructureAnalysis {
    /// The case as calibrated here, for what goes on from it.
    pub fn settled_case(&self) -> StructureCase {
        self.case.clone().settled_at(&self.calibration.theta)
    }

    /// Wrong files and other mistakes of the setup, as far as the calibrated model shows them.
    ///
    /// # Errors
    /// A model without a response.
    pub fn setup_check(&self) -> Result<SetupCheck> {
        let (model, data, theta) = (&self.case.model, &self.case.data, &self.calibration.theta);
        let measured = self.start.as_ref().map(|s| s.theta.as_slice());
        let rival = || library_rival(model, data, theta);
        examine(model, data, theta, None, measured, rival)
    }
}

/// The case as the loop works on it, with the same starting points as [`StructureAnalysis`] has: one model of one set of
/// data has one optimum, whichever command asks for it.
pub fn study_of(case: &StructureCase, options: Options) -> StructureStudy {
    let modal = match case.model.start() {
        Some(_) => None,
        None => modes_to_start_from(case),
    };
    // Modes that lead nowhere are no reason to give up.
    let start = modal.and_then(|modal| start_of_modes(case, &modal).ok().flatten());
    let study = case.study(options).with_measured(start.map(|s| s.theta));
    study.with_slips(absorb_slips)
}

/// FRFs of a posture that show the modes well enough to start from.
const FRFS_TO_START_FROM: usize = 120;

/// The modes that a calibration starts from; `None` where the FRFs show none: they can still be fitted.
fn modes_to_start_from(case: &StructureCase) -> Option<ModalAnalysis> {
    let few = StructureCase {
        data: case.data.fewer_frfs(FRFS_TO_START_FROM),
        ..case.clone()
    };
    measured_modes(&few).ok()
}

/// Where the modes measured at the campaign's postures put the model.
///
/// # Errors
/// As [`modal_start`].
fn start_of_modes(case: &StructureCase, modal: &ModalAnalysis) -> Result<Option<ModalStart>> {
    let mut postures: Vec<PostureMeasurement> = Vec::new();
    for set in &modal.sets {
        let same = |id: &String| *id == set.set;
        let posture = case.data.posture_ids.iter().position(same);
        let block = case.data.blocks.iter().find(|b| Some(b.posture) == posture);
        if let Some(block) = block {
            postures.push(PostureMeasurement {
                kinematics: block.kinematics.clone(),
                modes: set
                    .global
                    .modes
                    .iter()
                    .map(|m| [m.frequency_hz, m.damping_ratio])
                    .collect(),
            });
        }
    }
    modal_start(&case.model, &postures)
}
