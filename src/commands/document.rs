//! What the documents of several commands have in common (docs/json.md).

use std::collections::BTreeMap;

use serde::Serialize;

use crate::discrepancy::comparison::compare::{ErrorTotals, GroupError};
use crate::identify::{Calibration, Estimate};

/// Errors over everything, and on what was left out of the fit.
#[derive(Serialize)]
pub(crate) struct ErrorHeldOut {
    #[serde(flatten)]
    pub totals: ErrorTotals,
    pub held_out_nrms: Option<f64>,
}

/// Whether a fit came to its end.
#[derive(Serialize)]
pub(crate) struct Convergence {
    converged: bool,
    not_converged_because: Option<&'static str>,
}

impl Convergence {
    pub fn of(calibration: &Calibration) -> Self {
        Convergence {
            converged: calibration.converged(),
            not_converged_because: calibration.ending.reason(),
        }
    }
}

/// A fit and how it was found.
#[derive(Serialize)]
pub(crate) struct FitFound<'a> {
    parameters: &'a [Estimate],
    iterations: usize,
    #[serde(flatten)]
    convergence: Convergence,
    reduced_chi2: f64,
    starts: usize,
    starts_agreeing: usize,
}

impl<'a> FitFound<'a> {
    pub fn of(calibration: &'a Calibration) -> Self {
        FitFound {
            parameters: &calibration.parameters,
            iterations: calibration.iterations,
            convergence: Convergence::of(calibration),
            reduced_chi2: calibration.reduced_chi2,
            starts: calibration.starts,
            starts_agreeing: calibration.starts_agreeing,
        }
    }
}

/// Something that cannot be, and why.
#[derive(Serialize)]
pub(crate) struct EffectBarred<'a> {
    effect: &'a str,
    why: &'a str,
}

impl EffectBarred<'_> {
    pub fn all(effects: &[(String, String)]) -> Vec<EffectBarred<'_>> {
        let each = effects.iter();
        each.map(|(effect, why)| EffectBarred { effect, why }).collect()
    }
}

/// Error of each group by its name.
pub(crate) fn nrms_by_name(groups: &[GroupError]) -> BTreeMap<&str, f64> {
    groups.iter().map(|g| (g.name.as_str(), g.nrms)).collect()
}
