//! How plainly a hidden effect shows, and how large it must be to show so plainly.

use num_complex::Complex64;
use serde::Serialize;

use crate::Result;
use crate::effects::DataSummary;
use crate::identify::frfs::frf_problem::{FrfProblem, Misfit};
use crate::identify::{FrfData, StructureModel, levenberg_marquardt};
use crate::simulate::request::HiddenEffect;

/// What is seen of an effect when everything else is in the model.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Visibility {
    /// Standard deviations at which an ideal test (one that knows noise and effect) sees it: sqrt(2 Σ|ΔH|²/σ²), with ΔH
    /// what the model without the effect leaves after its parameters are refitted. 5 is barely visible.
    pub sigmas: f64,
    /// Σ|ΔH|²/σ² per complex value after that refit: the excess over 1 of the misfit per value.
    pub excess_chi2_per_value: f64,
    /// The same before any refit: what the effect alone does to the FRFs.
    pub without_refit_chi2_per_value: f64,
}

/// A model with hidden effects at their true values.
pub struct HiddenTruth<'a> {
    /// Without any effect.
    pub bare: &'a StructureModel,
    /// Its true parameters, solver's scale.
    pub bare_theta: &'a [f64],
    pub summary: DataSummary,
}

impl HiddenTruth<'_> {
    /// Model and true parameters with these effects.
    pub fn with(&self, effects: &[HiddenEffect]) -> (StructureModel, Vec<f64>) {
        let mut model = self.bare.clone();
        let mut theta = self.bare_theta.to_vec();
        for hidden in effects {
            model = model.with_effect(hidden.instance, &model.known(&self.summary));
            let values = hidden.values();
            theta.extend(hidden.parameters.iter().zip(values).map(|(p, v)| p.internal(v)));
        }
        (model, theta)
    }
}

/// Sets every FRF of `data` to what the model says, without noise, and its noise to what the sensor adds.
pub fn fill(
    data: &mut FrfData,
    model: &StructureModel,
    theta: &[f64],
    noise: impl Fn(f64) -> f64,
) -> Result<()> {
    set(data, model.predict(theta, data)?, noise);
    Ok(())
}

/// Sets every FRF of `data` to `receptances` (in the order of `data.frfs()`, m/N), and its noise to what the sensor adds.
pub fn set(data: &mut FrfData, receptances: Vec<Vec<Complex64>>, noise: impl Fn(f64) -> f64) {
    let mut receptances = receptances.into_iter();
    for block in &mut data.blocks {
        for frf in &mut std::sync::Arc::make_mut(block).frfs {
            frf.receptance = receptances.next().unwrap_or_default();
            frf.noise_std = frf.receptance.iter().map(|h| noise(h.norm())).collect();
        }
    }
}

/// Misfit Σ|ΔH|²/σ² of a model against noise-free data.
pub fn misfit(model: &StructureModel, theta: &[f64], data: &FrfData) -> Result<f64> {
    let predicted = model.predict(theta, data)?;
    Ok(data
        .frfs()
        .zip(&predicted)
        .map(|((_, frf), model)| {
            let lines = frf.receptance.iter().zip(model).zip(&frf.noise_std);
            lines
                .map(|((h, m), std)| (m - h).norm_sqr() / (std * std))
                .sum::<f64>()
        })
        .sum())
}

/// How plainly effect `i` of `effects` shows in noise-free `data` made with all of them. `stride`: every how many lines
/// the refit uses.
pub fn of(
    truth: &HiddenTruth,
    effects: &[HiddenEffect],
    i: usize,
    data: &FrfData,
    stride: usize,
) -> Result<Visibility> {
    let others: Vec<HiddenEffect> = effects
        .iter()
        .enumerate()
        .filter(|(j, _)| *j != i)
        .map(|(_, e)| e.clone())
        .collect();
    let (model, theta) = truth.with(&others);
    without(&model, &theta, data, stride)
}

/// How plainly noise-free `data` departs from `model`, whose true parameters are `theta`.
pub fn without(model: &StructureModel, theta: &[f64], data: &FrfData, stride: usize) -> Result<Visibility> {
    let values = data.value_count() as f64;
    let before = misfit(model, theta, data)?;
    let problem = FrfProblem {
        model,
        data,
        misfit: Misfit::Complex,
        stride,
    };
    let stopping = levenberg_marquardt::Stopping {
        max_iterations: 30,
        relative_decrease: 1e-4,
    };
    let fit = levenberg_marquardt::minimise(&problem, theta, &model.bounds(), stopping)?;
    // On few lines the refit may miss the whole; it is never taken to make things worse.
    let after = misfit(model, &fit.theta, data)?.min(before);
    Ok(Visibility {
        sigmas: (2.0 * after).sqrt(),
        excess_chi2_per_value: after / values,
        without_refit_chi2_per_value: before / values,
    })
}

const SIZES: [f64; 2] = [1e-5, 4.0];
const ATTEMPTS: usize = 10;
/// Relative deviation from the visibility asked for that is good enough.
const CLOSE: f64 = 0.03;

/// Sets the size of effect `i` so that it shows at `sigmas` standard deviations, as far as its size can do that, but not
/// larger than `largest`, and where `possible_only` of a size that is possible. `data` is scratch.
pub fn resize(
    truth: &HiddenTruth,
    effects: &mut [HiddenEffect],
    i: usize,
    sigmas: f64,
    (largest, possible_only): (f64, bool),
    (data, noise, stride): (&mut FrfData, &dyn Fn(f64) -> f64, usize),
) -> Result<()> {
    if !effects[i].has_size() {
        return Ok(());
    }
    // Newton's method on log sigmas over log size; the slope is 1 where the effect is small.
    let range = [SIZES[0], SIZES[1].min(largest)];
    let sizes = match possible_only {
        true => effects[i].possible_sizes(&truth.bare.robot.spec, range),
        false => range,
    };
    let [low, high] = sizes.map(f64::ln);
    let mut at = effects[i].size.ln().clamp(low, high.max(low));
    let mut earlier: Option<(f64, f64)> = None;
    for _ in 0..ATTEMPTS {
        effects[i].size = at.exp();
        let (model, theta) = truth.with(effects);
        fill(data, &model, &theta, noise)?;
        let off = (of(truth, effects, i, data, stride)?.sigmas.max(1e-9) / sigmas).ln();
        if off.abs() < CLOSE || (at >= high && off < 0.0) || (at <= low && off > 0.0) {
            return Ok(());
        }
        let slope = earlier
            .map(|(x, y): (f64, f64)| (off - y) / (at - x))
            .filter(|s| s.is_finite())
            .map_or(1.0, |s| s.clamp(0.3, 2.5));
        earlier = Some((at, off));
        at = (at - (off / slope).clamp(-4.0, 4.0)).clamp(low, high);
    }
    Ok(())
}
