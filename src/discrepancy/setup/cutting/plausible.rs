//! The fitted force model, and whether a cut can have its coefficients.

use crate::Result;
use crate::cutting::USUAL;
use crate::identify::forces::cutting_study::{EXPLAINS_NRMS, calibrate_cutting, cutting_nrms};
use crate::identify::{Calibration, CuttingData, CuttingModel, CuttingProblem};

/// Another reading is believed for its waveform where it leaves this part of the misfit.
pub(super) const MUCH_BETTER: f64 = 0.4;
/// Misfit per value above which the waveform says that something is wrong.
pub(super) const SUSPICIOUS: f64 = 1.3;
/// Improbability (as χ²) of coefficients from which on they say that something is wrong.
pub(super) const IMPLAUSIBLE: f64 = 9.0;
/// Cuts that a wrong feed, depth or direction is looked for in: a wrong one pulls at the coefficients and need not be the worst itself.
const WORST_CUTS: usize = 3;

fn coefficient(calibration: &Calibration, name: &str) -> f64 {
    let found = calibration.parameters.iter().find(|p| p.name == name);
    found.map_or(0.0, |p| p.value)
}

/// The force model without effects, fitted to all waveforms.
pub(super) fn fit(data: &CuttingData) -> Option<Calibration> {
    let model = CuttingModel::new(data, true).ok()?;
    calibrate_cutting(&model, data).ok()
}

/// The [`WORST_CUTS`] of `cuts` that the model fits worst, by index into the data's.
pub(super) fn worst_cuts(data: &CuttingData, theta: &[f64], mut cuts: Vec<usize>) -> Result<Vec<usize>> {
    let model = CuttingModel::new(data, true)?;
    let fits = CuttingProblem { model: &model, data }.fits(theta)?;
    let misfit = |i: usize| fits[i].chi2 / data.cuts[i].value_count().max(1) as f64;
    cuts.sort_by(|a, b| misfit(*b).total_cmp(&misfit(*a)));
    cuts.truncate(WORST_CUTS);
    Ok(cuts)
}

/// A reading of the records, fitted.
pub(super) struct FittedReading {
    pub(super) calibration: Calibration,
    /// Error over the signal.
    nrms: f64,
    pub(super) improbability: f64,
    /// Ktc, Krc, Kac.
    cutting: [f64; 3],
}

impl FittedReading {
    /// `data` as they are read.
    pub(super) fn of(data: &CuttingData) -> Option<Self> {
        let model = CuttingModel::new(data, true).ok()?;
        let calibration = calibrate_cutting(&model, data).ok()?;
        Some(FittedReading {
            nrms: cutting_nrms(&model, data, &calibration.theta).ok()?,
            improbability: improbability(&calibration),
            cutting: ["ktc_n_per_mm2", "krc_n_per_mm2", "kac_n_per_mm2"]
                .map(|n| coefficient(&calibration, n)),
            calibration,
        })
    }

    /// χ² per degree of freedom.
    pub(super) fn chi2(&self) -> f64 {
        self.calibration.reduced_chi2
    }

    /// Whether a cut can have such coefficients, and they explain most of what was recorded.
    pub(super) fn is_plausible(&self) -> bool {
        let [low, high] = USUAL;
        self.improbability < IMPLAUSIBLE
            && (low..high).contains(&self.cutting[0])
            && self.nrms < EXPLAINS_NRMS
    }

    /// What it leaves and gives; `now_chi2` is left as the campaign has it.
    pub(super) fn in_words(&self, now_chi2: f64) -> String {
        let [ktc, krc, kac] = self.cutting;
        format!(
            "the waveforms leave {:.2} times the variance of the noise (as it is {now_chi2:.2}) and Ktc, Krc, Kac are {ktc:.0}, \
             {krc:.0}, {kac:.0} N/mm²",
            self.chi2()
        )
    }
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
