//! From candidates to a verdict: effect, none or unknown, and how sure.

use serde::Serialize;

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::candidate::{BaselineFit, EffectCandidate};
use super::something_else;
use crate::identify::HeldOut;
use crate::identify::Modelled;
use crate::identify::rest::{Rest, RestTest};

/// What the loop says about missing physics.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum DiagnosisVerdict {
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
/// √(2/ν) of χ²/ν by chance has to be smaller than what is allowed for, `NOISE_CHI2` − 1.
pub fn least_freedom() -> usize {
    (2.0 / (NOISE_CHI2 - 1.0).powi(2)).ceil() as usize
}

/// Whether a candidate improves the fit by more than chance, with parameters that are not stuck at the end of their range.
pub fn significant<D: Modelled>(c: &EffectCandidate<D>) -> bool {
    is_convincing(c.p_value, c.delta_bic) && !c.at_bound
}

/// Whether a candidate is significant, of a possible size, and improves the prediction of folds left out. `chance`: what
/// differences of χ² are divided by before they are held against noise.
pub fn credible<D: Modelled>(c: &EffectCandidate<D>, baseline: &BaselineFit, chance: f64) -> bool {
    improves_prediction(c, baseline, chance) && c.not_credible.is_none() && significant(c)
}

/// Whether a candidate explains what no chance does, but has gone to a size at the end of its range, or to one that cannot be: what
/// is missing besides it may have driven it there.
pub fn driven_too_far<D: Modelled>(c: &EffectCandidate<D>, baseline: &BaselineFit, chance: f64) -> bool {
    let too_far = c.at_bound || c.not_credible.is_some();
    too_far && c.refined && is_convincing(c.p_value, c.delta_bic) && improves_prediction(c, baseline, chance)
}

/// Whether `simpler` is the special case of `general` and leaves hardly more: what both leave is something else, which the general one
/// may follow a little.
pub fn says_as_much<D: Modelled>(simpler: &EffectCandidate<D>, general: &EffectCandidate<D>) -> bool {
    general.instance.effect.refines() == Some(simpler.instance.effect.id())
        && simpler.refined
        && general.refined
        && leaves_hardly_more(simpler.reduced_chi2, general.reduced_chi2)
}

/// Misfits per degree of freedom of the special and the general case.
fn leaves_hardly_more(simpler: f64, general: f64) -> bool {
    /// As a share of what the general one leaves above noise.
    const HARDLY: f64 = 0.1;
    simpler - general < HARDLY * (general - 1.0).max(0.0)
}

fn improves_prediction<D: Modelled>(c: &EffectCandidate<D>, baseline: &BaselineFit, chance: f64) -> bool {
    match (&c.held_out, &baseline.held_out) {
        (Some(with), Some(without)) => is_progress(without, with, c.parameters.len(), chance),
        _ => true,
    }
}

/// Chance that an effect which is not there would be called progress.
const CHANCE: f64 = 1e-3;
/// The held-out error as a share of the signal, which weighs values by size instead of by noise, may rise by this: a few
/// resonances make it up, so that the refits of faint effects that are there move it by some tenths of a per cent.
const NRMS_MARGIN: f64 = 5e-3;

/// Whether the error on folds left out of the fit fell by more than chance: the one test of progress, for candidates and
/// for effects that were added.
///
/// An effect that is not there makes predictions worse on average; that its `parameters` improve the held-out −2 ln L by
/// more than the (1 − p) quantile of χ² is less likely than p. Where more than noise is left, that rest is the measure of
/// chance (`chance`), and values that err together count once. The gain must not be that of one fold at the cost of
/// others either: it is larger than the standard error of the paired differences, or no fold is predicted worse by more
/// than chance.
pub fn is_progress(without: &HeldOut, with: &HeldOut, parameters: usize, chance: f64) -> bool {
    let threshold = gain_by_chance(parameters);
    let pairs = without.by_fold.iter().zip(&with.by_fold);
    let gains: Vec<f64> = pairs.map(|(before, after)| (before - after) / chance).collect();
    let (count, total) = (gains.len() as f64, gains.iter().sum::<f64>());
    let mean = total / count;
    let variance = gains.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    let steady = total > (count * variance).sqrt() || gains.iter().all(|g| *g > -threshold);
    total > threshold && steady && with.nrms() <= without.nrms() * (1.0 + NRMS_MARGIN)
}

/// Improvement of −2 ln L that so many parameters of an effect that is not there exceed with probability `CHANCE`.
pub fn gain_by_chance(parameters: usize) -> f64 {
    ChiSquared::new(parameters.max(1) as f64).map_or(0.0, |d| d.inverse_cdf(1.0 - CHANCE))
}

/// Whether an improvement is more than chance: corrected p-value and BIC difference.
pub fn is_convincing(p_value: f64, delta_bic: f64) -> bool {
    p_value < SIGNIFICANT_P && delta_bic < -STRONG_BIC
}

/// Effects that explain the data together.
#[derive(Debug, Clone)]
pub struct EffectSet {
    /// Index among the candidates of the one that explains most alone.
    pub strongest: usize,
    /// Labels of the others.
    pub others: Vec<String>,
    /// Their parameters.
    pub parameters: usize,
    /// χ² that they take away together.
    pub gain: f64,
    /// Half of −2 ln L, and what their parameters have to gain: sets are ranked by it.
    pub paid: f64,
    /// What they leave.
    pub rest: Rest,
}

impl EffectSet {
    /// Odds that something else is behind what they explain.
    pub fn odds_against(&self) -> f64 {
        something_else::odds_of_set(self.gain, &self.rest, 1 + self.others.len())
    }
}

/// What the loop concludes.
#[derive(Debug, Clone)]
pub struct Decision {
    /// The verdict.
    pub verdict: DiagnosisVerdict,
    /// Index among the candidates of the effect that is missing, if one is.
    pub effect: Option<usize>,
    /// The best of the library where the verdict is unknown.
    pub best_guess: Option<usize>,
    /// The other effects, where several together explain what one alone does not.
    pub companions: Vec<String>,
    /// Probability that the verdict is right.
    pub confidence: f64,
    /// `effect@site` of rivals that this data cannot tell from the verdict.
    pub indistinguishable: Vec<String>,
}

/// No verdict is surer than this: the library, the noise and the files have to be what they are taken for.
const MOST_SURE: f64 = 0.98;

/// Whether what is left is noise, by its structure; by its size where there is too little data for that.
pub(crate) fn leaves_noise(rest: &Rest, reduced_chi2: f64) -> bool {
    match rest.tests.is_empty() {
        true => is_noise(reduced_chi2),
        false => !rest.is_significant(),
    }
}

/// Whether a candidate leaves more than noise.
pub fn leaves_structure<D: Modelled>(c: &EffectCandidate<D>) -> bool {
    match &c.rest {
        Some(rest) => !leaves_noise(rest, c.reduced_chi2),
        None => !is_noise(c.reduced_chi2),
    }
}

/// Odds of something else below which nothing is sought besides an effect: what it leaves is what every setup leaves.
const SETTLED: f64 = 0.1;

/// Whether a candidate leaves room for a second effect besides it.
pub fn leaves_room<D: Modelled>(c: &EffectCandidate<D>, baseline: &BaselineFit) -> bool {
    leaves_structure(c) && odds_against(c, baseline) > SETTLED
}

/// `leader`: the credible candidate that explains most; `set`: the best of several effects together, where that was sought; `scale`
/// divides differences of χ²; `values`: independent ones.
pub fn decide<D: Modelled>(
    candidates: &[EffectCandidate<D>],
    credible: &[bool],
    leader: Option<usize>,
    baseline: &BaselineFit,
    set: Option<EffectSet>,
    scale: f64,
    values: f64,
) -> Decision {
    let mut decision = Decision {
        verdict: DiagnosisVerdict::None,
        effect: None,
        best_guess: None,
        companions: Vec::new(),
        confidence: 0.0,
        indistinguishable: Vec::new(),
    };
    let alone = |w: usize| odds_against(&candidates[w], baseline);
    let odds_of_set = set.as_ref().map_or(f64::INFINITY, EffectSet::odds_against);
    let set = set.filter(|_| odds_of_set < leader.map_or(1.0, alone).min(1.0));
    // Effects that are credible together only.
    let first = match &set {
        Some(set) if !credible[set.strongest] => Some(set.strongest),
        _ => leader,
    };
    let needless = match (&set, first) {
        (Some(set), _) => weight_of_slips_alone(set.gain, Some(&set.rest), set.parameters, &baseline.rest),
        (None, Some(w)) => {
            let c = &candidates[w];
            weight_of_slips_alone(c.gain, c.rest.as_ref(), c.parameters.len(), &baseline.rest)
        }
        (None, None) => 1.0,
    };
    let excused = needless * slips_can_be_all(&baseline.rest);
    let Some(w) = first.filter(|_| excused < 0.5) else {
        decide_without_candidate(&mut decision, candidates, baseline, values);
        return decision;
    };
    let winner = &candidates[w];
    let (odds_else, named) = match &set {
        Some(set) => {
            decision.companions.clone_from(&set.others);
            (odds_of_set, set.strongest)
        }
        None => (alone(w), w),
    };
    let reference = winner.delta_bic;
    // Against rivals that small errors of the setup were fitted beside, too, the gains together with those count.
    let weight = |c: &EffectCandidate<D>| {
        let behind = match (gain_with_slips(winner), gain_with_slips(c)) {
            (Some((gain, noise)), Some((other, its))) => (gain - other) / noise.min(its),
            _ => c.delta_bic - reference,
        };
        evidence_weight(behind).min(1.0)
    };
    let rivals: f64 = candidates
        .iter()
        .enumerate()
        .filter(|(i, c)| *i != w && !c.at_bound && c.not_credible.is_none())
        .map(|(_, c)| weight(c))
        .sum();
    // What the model without any effect would weigh.
    let beaten = evidence_weight(-reference).min(1.0);
    if odds_else < 1.0 {
        decision.verdict = DiagnosisVerdict::Effect;
        decision.effect = Some(named);
        decision.confidence = 1.0 / (1.0 + rivals + beaten + excused + odds_else);
        let close =
            |c: &EffectCandidate<D>| (c.delta_bic - reference).abs() * scale.max(1.0) < INDISTINGUISHABLE;
        decision.indistinguishable = candidates
            .iter()
            .zip(credible)
            .enumerate()
            .filter(|(i, (c, credible))| *i != named && *i != w && **credible && close(c))
            .map(|(_, (c, _))| c.label())
            .collect();
    } else {
        decision.verdict = DiagnosisVerdict::Unknown;
        decision.companions.clear();
        decision.best_guess = Some(w);
        // Several effects that nearly answer it speak against something else as well.
        decision.confidence = 1.0 / (1.0 + (1.0 + beaten) / odds_else.min(odds_of_set));
    }
    decision.confidence = decision.confidence.clamp(LEAST_SURE, MOST_SURE);
    decision
}

/// Odds that something else is behind what a candidate explains.
fn odds_against<D: Modelled>(c: &EffectCandidate<D>, baseline: &BaselineFit) -> f64 {
    match &c.rest {
        Some(rest) if !rest.tests.is_empty() => something_else::odds(c.gain, rest),
        // Too little data for tests of structure: the size of the rest has to do.
        _ if is_noise(c.reduced_chi2) => 0.1,
        _ if c.share_explained(baseline) >= LARGE_SHARE => 0.3,
        _ => 3.0,
    }
}

/// χ² that a candidate and the small errors of the setup beside it take away, less the price of both, and the multiple of white noise
/// that neighbouring lines have in common. `None` where such errors were sought at none of its rests, or not at this one.
pub fn gain_with_slips<D: Modelled>(c: &EffectCandidate<D>) -> Option<(f64, f64)> {
    let beyond = c.rest.as_ref()?.beyond_slips.as_ref()?;
    let gain = c.gain + 2.0 * beyond.evidence - gain_by_chance(c.parameters.len());
    Some((gain, beyond.noise_factor()))
}

/// Weight of the small errors of the setup alone against the same with effects of so many `parameters` that take `gain` of χ² away
/// and leave `rest`, `baseline` being that of the model without them: 1 where they need them not. Zero where such errors are not in
/// question.
fn weight_of_slips_alone(gain: f64, rest: Option<&Rest>, parameters: usize, baseline: &Rest) -> f64 {
    let compared = || {
        let alone = baseline.beyond_slips.as_ref()?;
        // Where the effects leave noise no such errors were sought.
        let rest = rest?;
        let (evidence, known_to, together) = match &rest.beyond_slips {
            Some(with) => (with.evidence, with.known_to, with.noise_factor()),
            None if !rest.is_significant() => (0.0, 0.0, rest.noise_factor()),
            None => return None,
        };
        let more = gain + 2.0 * (evidence - alone.evidence) - alone.known_to - known_to;
        // Values that err together count once; where much is left, that is not noise and no measure of it.
        Some(more / together.min(alone.noise_factor()))
    };
    compared().map_or(0.0, |more| {
        evidence_weight(more - gain_by_chance(parameters)).min(1.0)
    })
}

/// Probability that small errors of the setup are all there is behind a rest. Of a model that is far off the slopes promise what such
/// errors do not do; 1 where no test finds more than noise.
fn slips_can_be_all(rest: &Rest) -> f64 {
    match rest.is_significant() {
        true => 1.0 / (1.0 + something_else::odds_against_slips(rest)),
        false => 1.0,
    }
}

/// Odds of something faint above which an alarm is raised although no single test is sure of it: an alarm at nothing costs as
/// much as so many faint effects that were missed.
const ALARM: f64 = 20.0;
/// ln of a Bayes factor beyond which more is no more.
const MOST_EVIDENCE: f64 = 100.0;
/// No verdict is less sure than this.
const LEAST_SURE: f64 = 0.05;

/// Bayes factor of something hidden against noise, of the test that noise passes least.
fn evidence_of_tests(tests: &[RestTest]) -> f64 {
    let least = tests.iter().map(|t| t.p_value).fold(1.0, f64::min);
    something_else::evidence_of_chance(least * tests.len().max(1) as f64)
}

/// Whether all together says that something is hidden, although no single test is sure. Few data make nothing less sure, they are no
/// reason for an alarm.
pub(super) fn is_alarmed<D: Modelled>(candidates: &[EffectCandidate<D>], rest: &Rest) -> bool {
    odds_of_something_faint(candidates, rest, f64::INFINITY) >= ALARM
}

/// Odds of small errors of the setup against something hidden, where all together raises an alarm: how likely their sizes are, their
/// evidence against that of the best candidate, and what they leave for chance to explain.
fn odds_of_small_errors<D: Modelled>(candidates: &[EffectCandidate<D>], rest: &Rest) -> f64 {
    let Some(beyond) = &rest.beyond_slips else {
        return 0.0;
    };
    let refined = candidates.iter().filter(|c| c.refined);
    let best = refined.map(|c| -c.delta_bic).fold(0.0, f64::max);
    let more = beyond.gain() / beyond.noise_factor() - best;
    let left = evidence_of_tests(&beyond.tests);
    something_else::VISIBLE_ERRORS * (-beyond.unlikely).exp() * evidence_weight(-more.min(MOST_EVIDENCE))
        / (1.0 + left)
}

/// Odds that something is hidden although no candidate is credible and no test is sure, against nothing. `values`: independent ones.
fn odds_of_something_faint<D: Modelled>(candidates: &[EffectCandidate<D>], rest: &Rest, values: f64) -> f64 {
    let of_tests = evidence_of_tests(&rest.tests);
    // Credible or not: an effect of an impossible size may stand in for what there is. BIC counts what a free frequency or
    // place can make of noise, which the p-value does not.
    let refined = candidates.iter().filter(|c| c.refined);
    let sum: f64 = refined
        .map(|c| (-0.5 * c.delta_bic).min(MOST_EVIDENCE).exp())
        .sum();
    something_else::odds_of_something_faint(of_tests, sum / candidates.len().max(1) as f64, values)
}

/// No candidate is credible: nothing is missing, or something else.
fn decide_without_candidate<D: Modelled>(
    decision: &mut Decision,
    candidates: &[EffectCandidate<D>],
    baseline: &BaselineFit,
    values: f64,
) {
    if leaves_noise(&baseline.rest, baseline.reduced_chi2) {
        let hidden = odds_of_something_faint(candidates, &baseline.rest, values);
        let small_errors = odds_of_small_errors(candidates, &baseline.rest);
        if !is_alarmed(candidates, &baseline.rest) {
            decision.verdict = DiagnosisVerdict::None;
            decision.confidence = MOST_SURE / (1.0 + hidden);
        } else if small_errors > 1.0 {
            decision.verdict = DiagnosisVerdict::None;
            decision.confidence = MOST_SURE / (1.0 + 1.0 / small_errors);
        } else {
            decision.verdict = DiagnosisVerdict::Unknown;
            decision.best_guess = (!candidates.is_empty()).then_some(0);
            decision.confidence = MOST_SURE / (1.0 + 1.0 / hidden + small_errors);
        }
        decision.confidence = decision.confidence.max(LEAST_SURE);
        return;
    }
    let foreign = something_else::odds_against_slips(&baseline.rest);
    if foreign < 1.0 {
        decision.verdict = DiagnosisVerdict::None;
        decision.confidence = MOST_SURE / (1.0 + foreign);
    } else {
        decision.verdict = DiagnosisVerdict::Unknown;
        decision.best_guess = (!candidates.is_empty()).then_some(0);
        decision.confidence = 0.97 / (1.0 + 1.0 / foreign);
    }
}

/// Weight of an explanation against another whose BIC is lower by `delta_bic`: exp(−Δ/2) tempered, because model error is
/// not noise.
pub fn evidence_weight(delta_bic: f64) -> f64 {
    const TEMPER: f64 = 6.0;
    (-delta_bic / (2.0 * TEMPER)).exp()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::Structure;
    use crate::identify::rest::{BeyondSlips, LIKE_FOLDS};

    /// A rest after small errors of this evidence, with noise of which the folds show this multiple.
    fn after_slips(evidence: f64, noise_factor: f64) -> Rest {
        let tests = vec![RestTest {
            looks_like: LIKE_FOLDS,
            excess: 0.0,
            std: 10.0,
            p_value: 0.5,
            noise_factor,
            frequency_hz: None,
        }];
        Rest {
            tests: tests.clone(),
            small_errors: 100.0,
            beyond_slips: Some(BeyondSlips {
                tests,
                unlikely: 1.0,
                evidence,
                known_to: 0.0,
                own_errors: None,
            }),
        }
    }

    #[test]
    fn a_general_law_leads_only_where_its_special_case_leaves_clearly_more() {
        // Both leave half of the noise's variance above it, of which the general law follows a fiftieth.
        assert!(leaves_hardly_more(1.51, 1.50));
        assert!(!leaves_hardly_more(1.60, 1.50));
        // Where the general one leaves noise, that decides.
        assert!(!leaves_hardly_more(1.02, 1.0) && !leaves_hardly_more(1.001, 0.99));
    }

    /// One parameter gains 10.8 by chance.
    #[test]
    fn an_effect_that_small_errors_need_not_is_excused() {
        let weight = |gain: f64, with: &Rest, alone: &Rest| weight_of_slips_alone(gain, Some(with), 1, alone);
        let (with, alone) = (after_slips(500.0, 1.0), after_slips(1000.0, 1.0));
        assert_eq!(weight(1010.0, &with, &alone), 1.0);
        assert!(weight(1030.0, &with, &alone) < 0.25);
        // Of values that err together half say as much.
        let (with, alone) = (after_slips(500.0, 2.0), after_slips(1000.0, 2.0));
        assert_eq!(weight(1020.0, &with, &alone), 1.0);
        assert!(weight(1060.0, &with, &alone) < 0.25);
        // What small errors alone leave of a model that is far off is not noise, however alike its values are.
        let far_off = after_slips(1000.0, 5000.0);
        assert!(weight(40_000.0, &with, &far_off) < 1e-6);
    }

    #[test]
    fn small_errors_are_no_excuse_for_what_they_leave() {
        let found = |excess: f64, left: f64| {
            let test = |excess: f64, p_value: f64| RestTest {
                looks_like: LIKE_FOLDS,
                excess,
                std: 10.0,
                p_value,
                noise_factor: 1.0,
                frequency_hz: None,
            };
            let mut rest = after_slips(0.5 * (excess - left), 1.0);
            rest.tests = vec![test(excess, 1e-20)];
            rest.beyond_slips.as_mut().unwrap().tests = vec![test(left, 0.5)];
            slips_can_be_all(&rest)
        };
        // Errors of about the usual energy, 100, of which nothing is left; a model that is far off, of which they leave half.
        assert!(found(150.0, 0.0) > 0.5, "{}", found(150.0, 0.0));
        assert!(found(1e6, 5e5) < 1e-3, "{}", found(1e6, 5e5));
        // Nothing plain to explain.
        assert_eq!(slips_can_be_all(&after_slips(10.0, 1.0)), 1.0);
    }

    #[test]
    fn an_alarm_may_be_small_errors_that_explain_it_and_leave_noise() {
        let odds = |rest: &Rest| odds_of_small_errors::<Structure>(&[], rest);
        assert!(odds(&after_slips(200.0, 1.0)) > 5.0);
        assert!(odds(&after_slips(10.0, 1.0)) < 0.5);
        // Of values that err together half say as much.
        assert!(odds(&after_slips(20.0, 2.0)) < odds(&after_slips(20.0, 1.0)));
        let mut leaves_more = after_slips(200.0, 1.0);
        leaves_more.beyond_slips.as_mut().unwrap().tests[0].p_value = 1e-12;
        assert!(odds(&leaves_more) < 1e-3);
        let never_sought = Rest {
            beyond_slips: None,
            ..after_slips(200.0, 1.0)
        };
        assert_eq!(odds(&never_sought), 0.0);
    }

    fn errors(by_fold: &[f64]) -> HeldOut {
        HeldOut {
            error: 1.0,
            signal: 100.0,
            chi2: by_fold.iter().sum(),
            by_fold: by_fold.to_vec(),
        }
    }

    #[test]
    fn progress_takes_more_than_chance() {
        let before = errors(&[1000.0; 5]);
        // χ² of one degree of freedom exceeds 10.83 once in a thousand.
        assert!(!is_progress(&before, &errors(&[997.9; 5]), 1, 1.0));
        assert!(is_progress(&before, &errors(&[997.8; 5]), 1, 1.0));
        // More parameters, or values that err together, take more.
        assert!(!is_progress(&before, &errors(&[997.8; 5]), 2, 1.0));
        assert!(!is_progress(&before, &errors(&[997.8; 5]), 1, 1.1));
    }

    #[test]
    fn progress_is_not_that_of_one_fold_at_the_cost_of_another() {
        let before = errors(&[1000.0; 4]);
        assert!(!is_progress(
            &before,
            &errors(&[800.0, 1100.0, 1000.0, 1000.0]),
            1,
            1.0
        ));
        // One fold that shows the effect, while the others do not, is.
        assert!(is_progress(
            &before,
            &errors(&[800.0, 1000.0, 1001.0, 1000.0]),
            1,
            1.0
        ));
    }

    #[test]
    fn progress_does_not_make_the_error_grow() {
        let before = errors(&[1000.0; 4]);
        let mut after = errors(&[900.0; 4]);
        assert!(is_progress(&before, &after, 1, 1.0));
        after.error = 1.02;
        assert!(!is_progress(&before, &after, 1, 1.0));
    }

    /// Of two folds that one is predicted worse is no progress, however much better the other is: their difference is as large as
    /// its standard error.
    #[test]
    fn one_of_two_folds_that_gets_worse_is_no_progress() {
        let before = errors(&[1000.0; 2]);
        assert!(!is_progress(&before, &errors(&[800.0, 1030.0]), 1, 1.0));
        assert!(is_progress(&before, &errors(&[800.0, 1005.0]), 1, 1.0));
    }
}
