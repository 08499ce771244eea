//! From candidates to a verdict: effect, none or unknown, and how sure.

use serde::Serialize;

use super::diagnose::{Baseline, Candidate};

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

/// A misfit per degree of freedom up to which the rest is called noise. The noise itself is known to a few per cent only.
const NOISE_CHI2: f64 = 1.12;
/// Corrected p-value below which an improvement is not chance.
const SIGNIFICANT_P: f64 = 1e-3;
/// An effect must improve BIC by this much: "very strong" evidence (Kass & Raftery 1995).
pub const STRONG_BIC: f64 = 10.0;
/// Rivals within this difference of −2 ln L of the best cannot be told from it.
const INDISTINGUISHABLE: f64 = 12.0;
/// Share of the excess misfit that one effect must explain to be the verdict although more is left.
const LARGE_SHARE: f64 = 0.9;

/// Whether a misfit per degree of freedom is what noise leaves.
pub fn is_noise(reduced_chi2: f64) -> bool {
    reduced_chi2 <= NOISE_CHI2
}

/// Values beyond the model's parameters from which on a misfit per degree of freedom can be told from noise: the scatter
/// √(2/ν) of χ²/ν by chance has to be smaller than what is allowed for, [`NOISE_CHI2`] − 1.
pub fn least_freedom() -> usize {
    (2.0 / (NOISE_CHI2 - 1.0).powi(2)).ceil() as usize
}

/// Whether a candidate improves the fit by more than chance, with parameters that are not stuck at the end of their range.
pub fn significant<M, I>(c: &Candidate<M, I>) -> bool {
    is_convincing(c.p_value, c.delta_bic) && !c.at_bound
}

/// Whether a candidate is significant and improves the prediction of folds left out.
pub fn credible<M, I>(c: &Candidate<M, I>, baseline: &Baseline) -> bool {
    let improves = match (&c.held_out, &baseline.held_out) {
        (Some(with), Some(without)) => with.chi2 < without.chi2,
        _ => true,
    };
    improves && significant(c)
}

/// Whether an improvement is more than chance: corrected p-value and BIC difference.
pub fn is_convincing(p_value: f64, delta_bic: f64) -> bool {
    p_value < SIGNIFICANT_P && delta_bic < -STRONG_BIC
}

/// Two effects that explain the data together.
#[derive(Debug, Clone)]
pub struct Pair {
    /// Index among the candidates of the one that explains more alone.
    pub stronger: usize,
    /// The other one's label.
    pub other: String,
    /// Weighted misfit per degree of freedom that both together leave.
    pub reduced_chi2: f64,
}

/// What the loop concludes.
#[derive(Debug, Clone)]
pub struct Decision {
    pub verdict: Verdict,
    pub effect: Option<usize>,
    pub companion: Option<String>,
    pub confidence: f64,
    pub indistinguishable: Vec<String>,
}

/// `pair`: the best pair of effects, where one was sought.
pub fn decide<M, I>(
    candidates: &[Candidate<M, I>],
    credible: &[bool],
    baseline: &Baseline,
    pair: Option<Pair>,
    scale: f64,
) -> Decision {
    let mut decision = Decision {
        verdict: Verdict::None,
        effect: None,
        companion: None,
        confidence: 0.0,
        indistinguishable: Vec::new(),
    };
    match credible.iter().position(|c| *c) {
        Some(w) => {
            let explained = candidates[w].share_explained(baseline);
            decision.verdict = Verdict::Effect;
            if is_noise(candidates[w].reduced_chi2) {
                decision.effect = Some(w);
            } else {
                match pair {
                    Some(pair) if is_noise(pair.reduced_chi2) || explained >= LARGE_SHARE => {
                        decision.effect = Some(pair.stronger);
                        decision.companion = Some(pair.other);
                    }
                    None if explained >= LARGE_SHARE => decision.effect = Some(w),
                    _ => decision.verdict = Verdict::Unknown,
                }
            }
        }
        None if !is_noise(baseline.reduced_chi2) => decision.verdict = Verdict::Unknown,
        None => (),
    }
    if let Some(w) = decision.effect {
        let reference = candidates[w].delta_bic;
        let close =
            |c: &Candidate<M, I>| (c.delta_bic - reference).abs() * scale.max(1.0) < INDISTINGUISHABLE;
        let rivals = candidates.iter().zip(credible).enumerate();
        decision.indistinguishable = rivals
            .filter(|(i, (c, credible))| *i != w && **credible && close(c))
            .map(|(_, (c, _))| c.label())
            .collect();
    }
    decision.confidence = confidence(&decision, candidates, baseline.reduced_chi2);
    decision
}

/// Weight of an explanation against another whose BIC is lower by `delta_bic`: exp(−Δ/2) tempered, because model error is
/// not noise.
pub fn evidence_weight(delta_bic: f64) -> f64 {
    const TEMPER: f64 = 6.0;
    (-delta_bic / (2.0 * TEMPER)).exp()
}

/// Probability that the verdict is right. The evidence ratio of the best against its rivals is tempered, because model
/// error is not noise; what stays unexplained takes confidence away.
fn confidence<M, I>(decision: &Decision, candidates: &[Candidate<M, I>], base_reduced: f64) -> f64 {
    let most = 0.98;
    match (decision.verdict, decision.effect) {
        (Verdict::Effect, Some(w)) => {
            let winner = &candidates[w];
            let weight = |c: &Candidate<M, I>| evidence_weight(c.delta_bic - winner.delta_bic);
            let rivals: f64 = candidates
                .iter()
                .enumerate()
                .filter(|(i, c)| *i != w && !c.at_bound)
                .map(|(_, c)| weight(c).min(1.0))
                .sum();
            // What the model without any effect would weigh.
            let beaten = evidence_weight(-winner.delta_bic).min(1.0);
            let left = if decision.companion.is_some() {
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
