//! Which physical effect is missing: every effect of the library is added in turn, refitted together with the baseline
//! from several starting points, and judged by likelihood, by postures left out of the fit, and by whether what it
//! leaves over is noise.

use rayon::prelude::*;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::next_measurement;
use crate::Result;
use crate::effects::{self, Instance};
use crate::identify::calibrate::{calibrate, estimates};
use crate::identify::extend::{HeldOut, held_out, screen, screening_stride};
use crate::identify::levenberg_marquardt::Fit;
use crate::identify::{Calibration, Estimate, FrfData, Options, StructureModel};
use crate::progress::Progress;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// A known effect is missing.
    Effect,
    /// What is left looks like noise.
    None,
    /// What is left is real, and nothing in the library explains it.
    Unknown,
}

/// One effect at one site, tried.
#[derive(Debug, Clone)]
pub struct Candidate {
    pub instance: Instance,
    pub nrms: f64,
    /// On postures left out of the fit; `None` with one posture.
    pub held_out: Option<HeldOut>,
    /// BIC with the effect less BIC without: below zero the effect pays for its parameters.
    pub delta_bic: f64,
    /// Likelihood-ratio test, corrected for the number of candidates tried.
    pub p_value: f64,
    /// Weighted misfit per degree of freedom that is left with the effect: 1 is noise.
    pub reduced_chi2: f64,
    /// The effect's own parameters.
    pub parameters: Vec<Estimate>,
    /// One of them stopped at the end of its range: evidence against.
    pub at_bound: bool,
    pub theta: Vec<f64>,
}

/// The answer.
#[derive(Debug, Clone)]
pub struct Diagnosis {
    pub verdict: Verdict,
    /// The effect that is missing, if one is.
    pub effect: Option<Instance>,
    /// Probability that the verdict is right.
    pub confidence: f64,
    /// Best first, one for each effect and site.
    pub candidates: Vec<Candidate>,
    /// `effect@site` of rivals that this data cannot tell from the verdict.
    pub indistinguishable: Vec<String>,
    /// What to measure next, in a sentence.
    pub next_measurement: String,
    /// The second effect, where two together explain what one alone does not.
    pub companion: Option<String>,
    pub baseline: Baseline,
    /// Effects that this robot or this data cannot show, with the reason.
    pub not_tried: Vec<(String, String)>,
}

/// The model as it stands.
#[derive(Debug, Clone)]
pub struct Baseline {
    pub calibration: Calibration,
    pub nrms: f64,
    pub noise_floor_nrms: f64,
    pub held_out: Option<HeldOut>,
    pub reduced_chi2: f64,
}

/// A misfit per degree of freedom up to which the rest is called noise. The noise itself is known to a few per cent only.
const NOISE_CHI2: f64 = 1.12;
/// Corrected p-value below which an improvement is not chance.
const SIGNIFICANT_P: f64 = 1e-3;
/// An effect must improve BIC by this much: "very strong" evidence (Kass & Raftery 1995).
const STRONG_BIC: f64 = 10.0;
/// Rivals within this difference of −2 ln L of the best cannot be told from it.
const INDISTINGUISHABLE: f64 = 12.0;
/// Candidates whose combination with every other one is tried where none explains the data alone.
const PAIR_LEADERS: usize = 3;
/// Share of the excess misfit that one effect must explain to be the verdict although more is left.
const LARGE_SHARE: f64 = 0.9;

/// A tried extension before it is judged: −2 ln L on the screened lines and the fit.
struct Tried {
    instance: Instance,
    model: StructureModel,
    fit: Fit,
}

impl Tried {
    fn chi2(&self) -> f64 {
        2.0 * self.fit.cost
    }
}

/// Diagnoses `model` (with the effects it already has) on `data`.
pub fn diagnose(model: &StructureModel, data: &FrfData, options: Options) -> Result<Diagnosis> {
    let calibration = calibrate(model, data, options)?;
    let stride = screening_stride(data);
    let freedom = |m: &StructureModel| (2 * screened_values(data, stride)) as f64 - m.parameters.len() as f64;
    let summary = data.summary();
    let spec = &model.robot.spec;

    let (mut instances, mut not_tried) = (Vec::new(), Vec::new());
    for instance in effects::instances(spec) {
        if model.has(&instance.label()) {
            continue;
        }
        match instance.effect.obstacle(spec, &summary) {
            Some(reason) => not_tried.push((instance.label(), reason)),
            None => instances.push(instance),
        }
    }
    not_tried.dedup();

    let bases = vec![calibration.theta.clone(), model.nominal_theta()];
    let peaks = residual_peaks_hz(model, data, &calibration.theta)?;
    let extend = |from: &StructureModel, instance: Instance, bases: &[Vec<f64>]| -> Option<Tried> {
        let model = from.with_effect(instance, &summary);
        let own = effect_starts(&model, instance, &peaks, &summary);
        let fit = screen(&model, data, stride, bases, &own).ok()?;
        Some(Tried { instance, model, fit })
    };
    let progress = Progress::new("trying effects", instances.len());
    let mut tried: Vec<Tried> = instances
        .par_iter()
        .filter_map(|instance| {
            let tried = extend(model, *instance, &bases);
            progress.step();
            tried
        })
        .collect();
    drop(progress);

    // The rivals' solutions are starting points too, for the baseline and for each other.
    let base_count = model.parameters.len();
    tried.sort_by(|a, b| a.chi2().total_cmp(&b.chi2()));
    let mut base = screen_baseline(model, data, stride, &calibration.theta)?;
    if let Some(best) = tried.first() {
        let from_best = screen_baseline(model, data, stride, &best.fit.theta[..base_count])?;
        if from_best.cost < base.cost {
            base = from_best;
        }
        let shared = vec![best.fit.theta[..base_count].to_vec(), base.theta.clone()];
        let again: Vec<Option<Tried>> = tried
            .par_iter()
            .take(2 * PAIR_LEADERS)
            .map(|t| extend(model, t.instance, &shared))
            .collect();
        for (t, again) in tried.iter_mut().zip(again) {
            if let Some(again) = again.filter(|a| a.fit.cost < t.fit.cost) {
                *t = again;
            }
        }
        tried.sort_by(|a, b| a.chi2().total_cmp(&b.chi2()));
    }
    // One for each effect and site: its best discrete choice.
    let mut kept: Vec<Tried> = Vec::new();
    let tests = tried.len();
    for t in tried {
        if !kept.iter().any(|k| k.instance.label() == t.instance.label()) {
            kept.push(t);
        }
    }

    let base_chi2 = 2.0 * base.cost;
    let base_reduced = base_chi2 / freedom(model);
    // Where even the best explanation leaves more than noise, that rest scales what counts as chance.
    let best_reduced = kept
        .first()
        .map_or(base_reduced, |t| t.chi2() / freedom(&t.model));
    let scale = best_reduced.min(base_reduced).max(1.0);
    let effective = 2.0 * screened_values(data, stride) as f64;
    let base_held_out = held_out(model, data, &base.theta, stride)?;
    let mut candidates: Vec<Candidate> = kept
        .par_iter()
        .map(|t| judge(t, data, stride, base_count, base_chi2, scale, effective, tests))
        .collect::<Result<_>>()?;
    candidates.sort_by(|a, b| a.delta_bic.total_cmp(&b.delta_bic));

    let comparison = |theta: &[f64]| -> Result<(f64, f64)> {
        let predicted = model.predict(theta, data)?;
        let c = super::FrfComparison::new(data, &model.points, &predicted);
        Ok((c.totals.nrms, c.totals.noise_floor_nrms))
    };
    let (nrms, noise_floor_nrms) = comparison(&calibration.theta)?;
    let baseline = Baseline {
        calibration,
        nrms,
        noise_floor_nrms,
        held_out: base_held_out,
        reduced_chi2: base_reduced,
    };

    let credible = |c: &Candidate| {
        let improves = match (&c.held_out, &baseline.held_out) {
            (Some(with), Some(without)) => with.chi2 < without.chi2,
            _ => true,
        };
        c.p_value < SIGNIFICANT_P && c.delta_bic < -STRONG_BIC && improves && !c.at_bound
    };
    let mut companion = None;
    let winner = candidates.iter().position(credible);
    let mut verdict = Verdict::None;
    let mut effect = None;
    if let Some(w) = winner {
        let excess = (base_reduced - 1.0).max(1e-9);
        let explained = (base_reduced - candidates[w].reduced_chi2) / excess;
        if candidates[w].reduced_chi2 <= NOISE_CHI2 {
            (verdict, effect) = (Verdict::Effect, Some(w));
        } else if let Some((leader, second, rest)) =
            best_pair(&candidates, &kept, &instances, &credible, &extend, &freedom)
        {
            if rest <= NOISE_CHI2 || explained >= LARGE_SHARE {
                (verdict, effect) = (Verdict::Effect, Some(leader));
                companion = Some(second);
            } else {
                verdict = Verdict::Unknown;
            }
        } else {
            verdict = if explained >= LARGE_SHARE {
                Verdict::Effect
            } else {
                Verdict::Unknown
            };
            effect = (verdict == Verdict::Effect).then_some(w);
        }
    } else if base_reduced > NOISE_CHI2 {
        verdict = Verdict::Unknown;
    }

    let indistinguishable: Vec<String> = effect
        .map(|w| {
            let reference = candidates[w].delta_bic;
            let rivals = candidates.iter().enumerate().filter(|(i, c)| {
                *i != w && credible(c) && (c.delta_bic - reference).abs() * scale < INDISTINGUISHABLE
            });
            rivals.map(|(_, c)| c.instance.label()).collect()
        })
        .unwrap_or_default();
    let confidence = confidence(
        verdict,
        effect.map(|w| &candidates[w]),
        &candidates,
        base_reduced,
        companion.is_some(),
    );
    let next_measurement =
        next_measurement::advise(model, data, &candidates, effect, verdict, &indistinguishable)?;
    Ok(Diagnosis {
        verdict,
        effect: effect.map(|w| candidates[w].instance),
        confidence,
        candidates,
        indistinguishable,
        next_measurement,
        companion,
        baseline,
        not_tried,
    })
}

fn screened_values(data: &FrfData, stride: usize) -> usize {
    data.frfs()
        .map(|(_, f)| f.receptance.len().div_ceil(stride))
        .sum()
}

fn screen_baseline(model: &StructureModel, data: &FrfData, stride: usize, start: &[f64]) -> Result<Fit> {
    use crate::identify::levenberg_marquardt::{Stopping, minimise};
    use crate::identify::structure::{FrfProblem, Misfit};
    let problem = FrfProblem {
        model,
        data,
        misfit: Misfit::Complex,
        stride,
    };
    minimise(&problem, start, &model.bounds(), Stopping::default())
}

/// Starting points for the last effect of `model`, solver's scale.
pub fn effect_starts(
    model: &StructureModel,
    instance: Instance,
    peaks_hz: &[f64],
    summary: &effects::DataSummary,
) -> Vec<Vec<f64>> {
    let own = model
        .effects()
        .last()
        .map_or(0..0, |added| added.parameters.clone());
    let parameters = &model.parameters[own];
    let nominal: Vec<f64> = parameters.iter().map(|p| p.nominal).collect();
    let further = instance.effect.starts(&model.robot.spec, summary, peaks_hz);
    std::iter::once(nominal)
        .chain(further)
        .map(|start| {
            let pairs = parameters.iter().zip(start);
            pairs
                .map(|(p, v)| p.internal(v.clamp(p.bounds[0], p.bounds[1])))
                .collect()
        })
        .collect()
}

/// Frequencies at which the weighted residual is largest, most prominent first.
pub fn residual_peaks_hz(model: &StructureModel, data: &FrfData, theta: &[f64]) -> Result<Vec<f64>> {
    const PEAKS: usize = 4;
    const BINS: usize = 60;
    let summary = data.summary();
    let ratio = (summary.highest_hz / summary.lowest_hz).ln();
    let mut bins = vec![(0.0, 0usize); BINS];
    let predicted = model.predict(theta, data)?;
    for ((block, frf), model) in data.frfs().zip(&predicted) {
        for (k, f) in block.frequency_hz.iter().enumerate() {
            let position = (f / summary.lowest_hz).ln() / ratio * BINS as f64;
            let bin = &mut bins[(position.max(0.0) as usize).min(BINS - 1)];
            bin.0 += (model[k] - frf.receptance[k]).norm_sqr() / frf.noise_std[k].powi(2);
            bin.1 += 1;
        }
    }
    let level: Vec<f64> = bins
        .iter()
        .map(|(s, n)| if *n > 0 { s / *n as f64 } else { 0.0 })
        .collect();
    let mut peaks: Vec<usize> = (0..BINS)
        .filter(|&i| {
            let left = if i > 0 { level[i - 1] } else { 0.0 };
            let right = level.get(i + 1).copied().unwrap_or(0.0);
            level[i] > left && level[i] >= right && level[i] > 1.5
        })
        .collect();
    peaks.sort_by(|a, b| level[*b].total_cmp(&level[*a]));
    let centre = |i: usize| summary.lowest_hz * (ratio * (i as f64 + 0.5) / BINS as f64).exp();
    Ok(peaks.into_iter().take(PEAKS).map(centre).collect())
}

#[allow(clippy::too_many_arguments)]
fn judge(
    tried: &Tried,
    data: &FrfData,
    stride: usize,
    base_count: usize,
    base_chi2: f64,
    scale: f64,
    effective: f64,
    tests: usize,
) -> Result<Candidate> {
    let Tried { instance, model, fit } = tried;
    let extra = (model.parameters.len() - base_count) as f64;
    let gain = ((base_chi2 - tried.chi2()) / scale).max(0.0);
    let single = ChiSquared::new(extra).map_or(1.0, |d| d.sf(gain));
    let predicted = model.predict(&fit.theta, data)?;
    let comparison = super::FrfComparison::new(data, &model.points, &predicted);
    let freedom = effective - model.parameters.len() as f64;
    let all = estimates(model, fit, tried.chi2() / freedom)?;
    let own = base_count..model.parameters.len();
    Ok(Candidate {
        instance: *instance,
        nrms: comparison.totals.nrms,
        held_out: held_out(model, data, &fit.theta, stride)?,
        delta_bic: extra * effective.ln() - gain,
        p_value: (single * tests as f64).min(1.0),
        reduced_chi2: tried.chi2() / freedom,
        at_bound: own.clone().any(|i| fit.at_bound.contains(&i)),
        parameters: all[own].to_vec(),
        theta: fit.theta.clone(),
    })
}

/// Adds an effect to a model and refits it from the given points of the parameters in front; `None` if that fails.
type Extend<'a> = dyn Fn(&StructureModel, Instance, &[Vec<f64>]) -> Option<Tried> + Sync + 'a;

/// The pair of effects that explains most: index of its stronger member among `candidates`, label of the other one, and
/// the misfit per degree of freedom that the pair leaves.
fn best_pair(
    candidates: &[Candidate],
    kept: &[Tried],
    instances: &[Instance],
    credible: &dyn Fn(&Candidate) -> bool,
    extend: &Extend,
    freedom: &(dyn Fn(&StructureModel) -> f64 + Sync),
) -> Option<(usize, String, f64)> {
    let leaders: Vec<(usize, &Tried)> = candidates
        .iter()
        .enumerate()
        .filter(|(_, c)| credible(c))
        .take(PAIR_LEADERS)
        .filter_map(|(i, c)| kept.iter().find(|t| t.instance == c.instance).map(|t| (i, t)))
        .collect();
    let progress = Progress::new("trying pairs of effects", leaders.len() * instances.len());
    let mut best: Option<(usize, Instance, f64)> = None;
    for (i, leader) in leaders {
        let seconds: Vec<Instance> = instances
            .iter()
            .copied()
            .filter(|s| s.label() != leader.instance.label())
            .collect();
        let pairs: Vec<Option<(usize, Instance, f64)>> = seconds
            .par_iter()
            .map(|second| {
                let pair = extend(&leader.model, *second, std::slice::from_ref(&leader.fit.theta));
                progress.step();
                let pair = pair.filter(|p| p.fit.at_bound.is_empty())?;
                Some((i, *second, pair.chi2() / freedom(&pair.model)))
            })
            .collect();
        for pair in pairs.into_iter().flatten() {
            if best.is_none_or(|b| pair.2 < b.2) {
                best = Some(pair);
            }
        }
        // Two effects that leave only noise are the answer; other leaders cannot do better.
        if best.is_some_and(|b| b.2 <= NOISE_CHI2) {
            break;
        }
    }
    let (first, second, rest) = best?;
    // The stronger of the two alone is named first.
    let other = candidates
        .iter()
        .position(|c| c.instance.label() == second.label());
    match other {
        Some(other) if other < first && credible(&candidates[other]) => {
            Some((other, candidates[first].instance.label(), rest))
        }
        _ => Some((first, second.label(), rest)),
    }
}

/// Probability that the verdict is right. The evidence ratio of the best against its rivals is tempered, because
/// model error is not noise; what stays unexplained takes confidence away.
fn confidence(
    verdict: Verdict,
    winner: Option<&Candidate>,
    candidates: &[Candidate],
    base_reduced: f64,
    with_companion: bool,
) -> f64 {
    const TEMPER: f64 = 6.0;
    let most = 0.98;
    match (verdict, winner) {
        (Verdict::Effect, Some(winner)) => {
            let weight = |c: &Candidate| (-(c.delta_bic - winner.delta_bic) / (2.0 * TEMPER)).exp();
            let rivals: f64 = candidates
                .iter()
                .filter(|c| c.instance != winner.instance && !c.at_bound)
                .map(|c| weight(c).min(1.0))
                .sum();
            // What the model without any effect would weigh.
            let beaten = (winner.delta_bic / (2.0 * TEMPER)).exp().min(1.0);
            let left = if with_companion {
                0.92
            } else {
                (NOISE_CHI2 / winner.reduced_chi2).min(1.0)
            };
            (most / (1.0 + rivals + beaten) * left).clamp(0.05, most)
        }
        (Verdict::None, _) => {
            let best = candidates.first().map_or(1.0, |c| c.p_value);
            // p-values near the threshold leave doubt; so does a rest above noise.
            let calm = (best / (best + 0.05)).max(0.5);
            (0.95 * calm.max(0.7) * (1.05 / base_reduced).min(1.0)).clamp(0.3, 0.97)
        }
        _ => {
            // The further the rest stands above noise, the surer it is real.
            let rest = candidates
                .first()
                .map_or(base_reduced, |c| c.reduced_chi2.min(base_reduced));
            (0.5 + 0.45 * (1.0 - (NOISE_CHI2 / rest).min(1.0)).sqrt()).clamp(0.5, 0.95)
        }
    }
}
