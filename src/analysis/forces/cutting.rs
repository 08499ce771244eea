//! A campaign's force records: the waveform model fitted and compared, and its coefficients compared with those of the mean forces.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::Result;
use crate::analysis::forces::channel_check::wrong_channels;
use crate::analysis::workbench::Workbench;
use crate::campaign::{Campaign, Process};
use crate::cutting::{CfcResult, ForceGroup, KnownValue};
use crate::discrepancy::CuttingComparison;
use crate::discrepancy::setup::{SetupCheck, SetupFinding, examine_cutting};
use crate::identify::forces::cutting_data::processes;
use crate::identify::forces::cutting_problem::CuttingProblem;
use crate::identify::forces::cutting_study::{calibrate_cutting, held_out_cuts};
use crate::identify::{Calibration, CuttingCase, CuttingData, CuttingModel, Estimate};

/// The cutting model of a campaign's main process against its force records.
pub struct CuttingAnalysis {
    /// The measured forces over rotation or time.
    pub data: CuttingData,
    /// The force model with the effects that were added.
    pub model: CuttingModel,
    /// The model fitted to the data.
    pub calibration: Calibration,
    /// The fitted model against the data.
    pub comparison: CuttingComparison,
    /// nrms on cuts that were left out of the fit.
    pub held_out_nrms: Option<f64>,
    /// What was noticed while reading.
    pub noticed: Vec<String>,
    /// What is to be known of the fit.
    pub warnings: Vec<String>,
}

impl CuttingAnalysis {
    /// # Errors
    /// No cuts, or none that can be used.
    pub fn run(campaign: &Campaign) -> Result<Self> {
        Self::on(&Workbench::new(campaign))
    }

    /// As [`run`](Self::run), of files that other analyses read as well.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn on(campaign: &Workbench) -> Result<Self> {
        let CuttingCase {
            model,
            data,
            warnings: noticed,
            ..
        } = CuttingCase::on(campaign)?;
        let calibration = calibrate_cutting(&model, &data)?;
        let comparison = cutting_comparison(&model, &data, &calibration.theta)?;
        let held_out_nrms = held_out_cuts(&model, &data, &calibration.theta)?.map(|h| h.nrms());
        let warnings = warnings_of(&calibration);
        Ok(CuttingAnalysis {
            data,
            model,
            calibration,
            comparison,
            held_out_nrms,
            noticed,
            warnings,
        })
    }
}

impl CuttingAnalysis {
    /// Wrong wiring and filters, as far as the records show them. Nothing where effects were added: those may be what is
    /// wrong.
    ///
    /// # Errors
    /// Records that no model can be fitted to.
    pub fn setup_check(&self) -> Result<SetupCheck> {
        match self.model.effects().is_empty() {
            true => examine_cutting(&self.data, || None),
            false => Ok(SetupCheck::default()),
        }
    }
}

/// A cutting model at `theta` against the records.
pub fn cutting_comparison(
    model: &CuttingModel,
    data: &CuttingData,
    theta: &[f64],
) -> Result<CuttingComparison> {
    let fits = CuttingProblem { model, data }.fits(theta)?;
    Ok(CuttingComparison::new(data, &fits))
}

/// Misfit from which on the user is told.
const FAR_ABOVE_NOISE: f64 = 1.5;

fn warnings_of(calibration: &Calibration) -> Vec<String> {
    let mut warnings = Vec::new();
    if !calibration.converged() {
        warnings.push("the fit did not converge: treat the coefficients with care".to_string());
    }
    if calibration.reduced_chi2 > FAR_ABOVE_NOISE {
        warnings.push(format!(
            "the fitted waveform leaves {:.1} times the variance of the noise: physics is missing, or campaign.toml is not \
             what was cut (immersion, depth, speed, axes); standard errors are widened accordingly",
            calibration.reduced_chi2
        ));
    }
    warnings
}

/// Coefficients of a group of cuts from the whole waveform.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WaveformCoefficients {
    /// By their keys, which say the units; `None` where the waveform does not determine one.
    #[serde(flatten)]
    pub coefficients: BTreeMap<String, Option<KnownValue>>,
    /// Error over the signal.
    pub nrms: f64,
    /// nrms of a perfect model.
    pub noise_floor_nrms: f64,
    /// Weighted misfit per number compared: 1 where only noise is left.
    pub chi2_per_value: f64,
    /// Whether the fit came to its end.
    pub converged: bool,
}

/// Coefficients of each of `result`'s groups from the whole waveform; `None` where
/// its waveforms cannot be fitted. And what the waveforms say about channels that are wrong in all records, and about other
/// mistakes of the setup.
pub fn waveform_groups(
    campaign: &Workbench,
    result: &CfcResult,
) -> (Vec<Option<WaveformCoefficients>>, Vec<String>, Vec<SetupFinding>) {
    let loaded: Vec<(Process, Result<CuttingData>)> = processes(&campaign.cuts)
        .into_iter()
        .map(|p| (p, CuttingData::on(campaign, p)))
        .collect();
    let (mut warnings, mut setup) = (Vec::new(), Vec::new());
    for (_, data) in &loaded {
        let checked = data.as_ref().map_err(SetupCheck::failed).and_then(|data| {
            warnings.extend(wrong_channels(data, &result.pooled));
            examine_cutting(data, || None).map_err(|e| SetupCheck::failed(&e))
        });
        match checked {
            Ok(check) => setup.extend(check.findings),
            Err(untold) => warnings.push(untold),
        }
    }
    let groups = result
        .groups
        .iter()
        .map(|group| {
            let data = loaded
                .iter()
                .find(|(p, _)| *p == group.process)
                .and_then(|(_, d)| d.as_ref().ok());
            data.and_then(|data| waveform_group(data, group).ok())
        })
        .collect();
    (groups, warnings, setup)
}

fn waveform_group(data: &CuttingData, group: &ForceGroup) -> Result<WaveformCoefficients> {
    let own = data.filtered(|i| group.cuts.contains(&data.cuts[i].id));
    let model = CuttingModel::new(&own, true)?;
    let calibration = calibrate_cutting(&model, &own)?;
    let totals = cutting_comparison(&model, &own, &calibration.theta)?.totals;
    let estimates = model.parameters.iter().zip(&calibration.parameters);
    let coefficients = estimates.map(|(parameter, estimate)| {
        // What the prior says and the data do not is no answer.
        let prior = parameter.prior.map_or(f64::INFINITY, |p| p.std);
        let Estimate { value, std_error, .. } = *estimate;
        let known = (std_error < 0.1 * prior).then_some(KnownValue {
            value,
            std_error: Some(std_error),
        });
        (parameter.name.clone(), known)
    });
    Ok(WaveformCoefficients {
        coefficients: coefficients.collect(),
        nrms: totals.nrms,
        noise_floor_nrms: totals.noise_floor_nrms,
        chi2_per_value: calibration.reduced_chi2,
        converged: calibration.converged(),
    })
}
