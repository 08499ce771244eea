//! Modes of the calibrated model beside the measured ones.
//!
//! The model's FRFs go through the same modal analysis as the measured ones, on the same lines: what differs is the model,
//! not the definition of a mode, of damping or of a shape.

use num_complex::Complex64;
use serde::Serialize;

use super::modal::{FrfInput, ModalAnalysis, SetModes, dof_name};
use super::structure::StructureAnalysis;
use crate::Result;
use crate::identify::StructureCase;
use crate::identify::frf_data::{FrfBlock, FrfDatum};
use crate::modal::Settings;
use crate::modal::tracking::{constants_mac, pair_by};

/// One measured mode and the model's that comes nearest in frequency and shape.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModePair {
    pub posture: String,
    pub measured_hz: f64,
    pub measured_std_hz: f64,
    pub measured_damping: f64,
    pub measured_damping_std: f64,
    /// `None` where the model has no mode within a quarter of the frequency.
    pub model_hz: Option<f64>,
    pub model_damping: Option<f64>,
    /// From the modal constants in all FRFs of the posture; `None` with fewer than two.
    pub mac: Option<f64>,
}

/// All measured modes (of [`measured_modes`]), posture by posture, ascending in frequency.
///
/// # Errors
/// The model's FRFs cannot be analysed.
pub fn compare_modes(analysis: &StructureAnalysis, measured: &ModalAnalysis) -> Result<Vec<ModePair>> {
    let model = modes_of(&analysis.case, |k, _| analysis.calibrated[k].clone())?;
    Ok(measured
        .sets
        .iter()
        .flat_map(|set| {
            let other = model.sets.iter().find(|s| s.set == set.set);
            pairs(set, other)
        })
        .collect())
}

/// The modes of a case's measured FRFs, one set a posture.
///
/// # Errors
/// The FRFs cannot be analysed.
pub fn measured_modes(case: &StructureCase) -> Result<ModalAnalysis> {
    modes_of(case, |_, datum| datum.receptance.clone())
}

fn modes_of(
    case: &StructureCase,
    receptance: impl Fn(usize, &FrfDatum) -> Vec<Complex64>,
) -> Result<ModalAnalysis> {
    let points = &case.model.points;
    let data = &case.data;
    let input = |(k, (block, datum)): (usize, (&FrfBlock, &FrfDatum))| FrfInput {
        name: datum.name.clone(),
        set: data.posture_ids[datum.posture].clone(),
        dofs: Some([
            dof_name(points, &datum.response),
            dof_name(points, &datum.reference),
        ]),
        frequency_hz: block.frequency_hz.clone(),
        receptance_m_per_n: receptance(k, datum),
        coherence: None,
        added_decay_per_s: 0.0,
    };
    let inputs = data.frfs().enumerate().map(input).collect();
    ModalAnalysis::of(inputs, Vec::new(), &Settings::default())
}

fn pairs(measured: &SetModes, model: Option<&SetModes>) -> Vec<ModePair> {
    let of_model = model.map_or(&[][..], |m| &m.global.modes);
    let paired = pair_by(&measured.global.modes, of_model, constants_mac);
    let modes = measured.global.modes.iter().enumerate();
    modes
        .map(|(k, mode)| {
            let pair = paired.iter().find(|p| p.first == k);
            let partner = pair.map(|p| &of_model[p.second]);
            ModePair {
                posture: measured.set.clone(),
                measured_hz: mode.frequency_hz,
                measured_std_hz: mode.frequency_std_hz,
                measured_damping: mode.damping_ratio,
                measured_damping_std: mode.damping_std,
                model_hz: partner.map(|m| m.frequency_hz),
                model_damping: partner.map(|m| m.damping_ratio),
                mac: pair.and_then(|p| p.mac),
            }
        })
        .collect()
}
