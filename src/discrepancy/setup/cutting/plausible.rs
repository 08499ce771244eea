//! The fitted force model, and whether a cut can have its coefficients.

use crate::identify::forces::cutting_study::calibrate_cutting;
use crate::identify::{Calibration, CuttingData, CuttingModel};

/// Another reading is believed for its waveform where it leaves this part of the misfit.
pub(super) const MUCH_BETTER: f64 = 0.4;
/// Misfit per value above which the waveform says that something is wrong.
pub(super) const SUSPICIOUS: f64 = 1.3;
/// Improbability (as χ²) of coefficients from which on they say that something is wrong.
pub(super) const IMPLAUSIBLE: f64 = 9.0;

pub(super) fn coefficient(calibration: &Calibration, name: &str) -> f64 {
    let found = calibration.parameters.iter().find(|p| p.name == name);
    found.map_or(0.0, |p| p.value)
}

/// The force model without effects, fitted to all waveforms.
pub(super) fn fit(data: &CuttingData) -> Option<Calibration> {
    let model = CuttingModel::new(data, true).ok()?;
    calibrate_cutting(&model, data).ok()
}

/// How far coefficients are from those that metal cutting has, as a χ²: radial to tangential 0.4 within a factor of two,
/// axial to tangential 0.2 ± 0.25, no edge force that pulls the tool along (Altintas 2012, tables of §2).
pub(super) fn improbability(calibration: &Calibration) -> f64 {
    let get = |name: &str| coefficient(calibration, name);
    let [ktc, krc, kac] = [get("ktc_n_per_mm2"), get("krc_n_per_mm2"), get("kac_n_per_mm2")];
    if ktc <= 0.0 {
        return 60.0;
    }
    let radial = match krc > 0.02 * ktc {
        true => ((krc / ktc / 0.4).ln() / 0.7).powi(2),
        false => 20.0,
    };
    // Negative: the workpiece would pull the tool along its axis the wrong way for the sense of the helix.
    let pulled = if kac < -0.02 * ktc { 6.0 } else { 0.0 };
    let axial = ((kac / ktc - 0.2) / 0.25).powi(2) + pulled;
    let edges =
        ["kte_n_per_mm", "kre_n_per_mm"].map(|name| (get(name).min(0.0) / (0.01 * ktc)).powi(2).min(10.0));
    radial + axial.min(20.0) + edges[0] + edges[1]
}
