//! Which physical effect is missing: every effect of the library is added in turn, refitted together with the baseline
//! from several starting points, and judged by likelihood, by folds left out of the fit, and by whether what it leaves
//! over is noise. The same loop for every [`Study`].

mod several;

use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::candidate::{BaselineFit, EffectCandidate, share_taken};
use super::diagnosis::Diagnosis;
use super::faint::{self, Linear};
use super::ranking::keep_first_of_each;
use super::verdict::{self, DiagnosisVerdict};
use crate::Result;
use crate::effects::Site;
use crate::identify::frfs::calibrate::{Calibration, estimates};
use crate::identify::levenberg_marquardt::{Fit, Stopping, minimise};
use crate::identify::model::Modelled;
use crate::identify::rest::{BeyondSlips, Rest};
use crate::identify::study::{
    Effort, Extent, InstanceOf, ModelOf, Study, Tried, View, exchanged, fit_as_a_model, fit_from,
    from_possible_size, held_out, own_starts, paid, price_of_a_parameter, rescue, rounds_of_bases, try_again,
    try_effect, try_effects, vanished,
};
use crate::progress::Progress;

/// Leading candidates whose rest is tested for structure.
const TESTED: usize = 4;
/// Stated where there are too few data for a verdict.
const NO_CONFIDENCE: f64 = 0.05;
/// Candidates that are refined on all data, at most.
const REFINED: usize = 8;
/// Times the lowest misfit on the coarse view from which on a candidate is not refined: all data do not turn that round.
const BEHIND: f64 = 4.0;
/// Misfit per degree of freedom of the baseline below which what is missing is faint.
const FAINT: f64 = 1.5;
/// Times the baseline is fitted anew, and all candidates from it, where a candidate's fit leads to a better baseline.
const REBASED: usize = 2;
/// Share of its misfit by which a baseline must be better for that.
const BETTER: f64 = 1e-3;
/// Candidates whose solutions the baseline is tried from.
const LEADERS: usize = 3;
/// Times what small errors of the setup usually leave (Σ r²/σ²) that an effect takes away at most to be compared with them although it
/// leaves noise.
const WITHIN_SLIPS: f64 = 5.0;
/// Leaders that begin again at a possible size where they have ended at another.
const LED_AWAY: usize = 4;
/// Candidates that are fitted again from the best one's baseline.
const SHARED: usize = 6;
/// Share of the excess misfit that one effect of a pair must explain alone: where none does, the search is hopeless.
const PAIR_SHARE: f64 = 0.3;

const REFINE: Stopping = Stopping {
    max_iterations: 25,
    relative_decrease: 1e-6,
};
const REFIT_WITHOUT_FOLD: Stopping = Stopping {
    max_iterations: 4,
    relative_decrease: 1e-4,
};
/// Of candidates that are behind anyway: one step of Gauss and Newton.
const REFIT_BRIEFLY: Stopping = Stopping {
    max_iterations: 1,
    ..REFIT_WITHOUT_FOLD
};

/// Diagnoses `model` (with the effects it already has).
pub fn diagnose<S: Study>(study: &S, model: &ModelOf<S>) -> Result<Diagnosis<S::Domain>> {
    Engine::new(study, model)?.run()
}

/// As [`diagnose`]; one effect is tried from a point besides (the model's parameters and its own, solver's scale).
pub fn diagnose_from<S: Study>(
    study: &S,
    model: &ModelOf<S>,
    beginning: (InstanceOf<S>, Vec<f64>),
) -> Result<Diagnosis<S::Domain>> {
    Engine {
        beginning: Some(beginning),
        ..Engine::new(study, model)?
    }
    .run()
}

type TriedOf<S> = Tried<<S as Study>::Domain>;
type CandidateOf<S> = EffectCandidate<<S as Study>::Domain>;

/// Puts fits to the same data among those that there are, the better one of each instance, best first.
fn put_among<D: Modelled>(refined: &mut Vec<Tried<D>>, found: impl IntoIterator<Item = Tried<D>>) {
    for found in found {
        match refined.iter_mut().find(|t| t.instance == found.instance) {
            Some(known) if known.fit.cost <= found.fit.cost => {}
            Some(known) => *known = found,
            None => refined.push(found),
        }
    }
    refined.sort_by(|a, b| a.fit.cost.total_cmp(&b.fit.cost));
}

struct Engine<'a, S: Study> {
    study: &'a S,
    model: &'a ModelOf<S>,
    calibration: Calibration,
    hints: Vec<f64>,
    instances: Vec<InstanceOf<S>>,
    not_tried: Vec<(String, String)>,
    base_count: usize,
    /// An effect, and a point from which it is tried besides.
    beginning: Option<(InstanceOf<S>, Vec<f64>)>,
}

/// What candidates are measured by.
struct Evidence {
    base_chi2: f64,
    coarse_base_chi2: f64,
    /// Misfit per degree of freedom of the baseline on all data, in multiples of that on the coarse view: the coarse view holds other
    /// shares of the FRFs and lines that fit worst.
    full_over_coarse: f64,
    /// Divides differences of χ²: the misfit that remains, and the values that are not independent.
    scale: f64,
    /// Share of the values that are independent.
    share: f64,
    tests: usize,
}

impl<'a, S: Study> Engine<'a, S> {
    fn new(study: &'a S, model: &'a ModelOf<S>) -> Result<Self> {
        let calibration = study.calibrate(model)?;
        let (instances, not_tried) = study.instances(model);
        let hints = study.hints(model, &calibration.theta)?;
        Ok(Engine {
            study,
            model,
            calibration,
            hints,
            instances,
            not_tried,
            base_count: model.parameters.len(),
            beginning: None,
        })
    }

    fn label(&self, instance: &InstanceOf<S>) -> String {
        instance.name().label()
    }

    fn freedom(&self, model: &ModelOf<S>, extent: Extent) -> f64 {
        let values = self.study.real_values(extent) as f64;
        (values - model.parameters.len() as f64).max(1.0)
    }

    /// As [`put_among`]; another choice of the same effect that is worse than what was found goes.
    fn put_choices_among(&self, refined: &mut Vec<TriedOf<S>>, found: Vec<TriedOf<S>>) {
        refined.retain(|r| {
            let label = self.label(&r.instance);
            let better = |f: &TriedOf<S>| self.label(&f.instance) == label && f.fit.cost < r.fit.cost;
            !found.iter().any(better)
        });
        put_among(refined, found);
    }

    fn reduced_chi2(&self, tried: &TriedOf<S>) -> f64 {
        2.0 * tried.fit.cost / self.freedom(&tried.model, Extent::Full)
    }

    fn minimise(&self, model: &ModelOf<S>, view: View, start: &[f64], stopping: Stopping) -> Result<Fit> {
        let bounds = model.bounds();
        minimise(&self.study.problem(model, view), start, &bounds, stopping)
    }

    /// The baseline's fit on the coarse view and on all data, and every effect on the coarse view, all from the best
    /// baseline that was found anywhere: where an effect's fit leads the baseline itself further down, the calibration was
    /// trapped, and all is fitted again from there.
    #[allow(clippy::type_complexity)]
    fn on_one_baseline(&mut self) -> Result<(Fit, Fit, Vec<TriedOf<S>>)> {
        let (study, model) = (self.study, self.model);
        let mut rebased = 0;
        let mut before = None;
        loop {
            let coarse = self.minimise(model, View::COARSE, &self.calibration.theta, REFINE)?;
            let (tried, better) = self.screen_all(&coarse, before)?;
            let base = self.minimise(model, View::FULL, &self.calibration.theta, REFINE)?;
            let Some(start) = better.filter(|_| rebased < REBASED) else {
                return Ok((coarse, base, tried));
            };
            let calibration = study.calibrate(&model.with_start(start))?;
            let other = self.minimise(model, View::FULL, &calibration.theta, REFINE)?;
            if other.cost > base.cost * (1.0 - BETTER) {
                return Ok((coarse, base, tried));
            }
            rebased += 1;
            self.hints = study.hints(model, &calibration.theta)?;
            self.calibration = calibration;
            before = Some(tried);
        }
    }

    /// `tried`, or where it is no better than the fit `without` the effect to the same view, `base` as one with it (the fit without the
    /// effect to all data); and whether it is that.
    fn nested(&self, tried: &TriedOf<S>, without: &Fit, base: &Fit) -> (TriedOf<S>, bool) {
        let worse = tried.fit.cost >= without.cost;
        match vanished(&tried.model, base).filter(|_| worse) {
            Some(fit) => {
                let model = tried.model.with_start(fit.theta.clone());
                let instance = tried.instance;
                (Tried { instance, model, fit }, true)
            }
            None => (tried.clone(), false),
        }
    }

    fn run(mut self) -> Result<Diagnosis<S::Domain>> {
        let model = self.model;
        let (coarse_base, base, tried) = self.on_one_baseline()?;
        let mut refined = self.refine(&tried)?;
        let base_reduced = 2.0 * base.cost / self.freedom(model, Extent::Full);
        if let Some(best) = refined.first_mut() {
            self.try_harder(best, base_reduced)?;
        }
        if refined
            .first()
            .is_some_and(|best| !verdict::is_noise(self.reduced_chi2(best)))
        {
            self.begin_at_possible_sizes(&tried, &coarse_base, &mut refined)?;
        }

        let base_rest = self.study.rest(model, &base.theta)?;
        if base_reduced < FAINT {
            self.begin_at_linear_sizes(&base, &base_rest, &mut refined)?;
        }
        let bases = (&coarse_base, &base, &base_rest);
        let (diagnosis, alone) = self.conclude(bases, &tried, &refined)?;
        let better = match (alone, diagnosis.verdict) {
            (Some(alone), _) => Some(alone),
            (None, DiagnosisVerdict::Unknown) => {
                let lowest = refined.iter().map(|t| t.fit.cost).fold(base.cost, f64::min);
                self.with_another_choice(&base)?
                    .filter(|t| t.fit.cost < lowest * (1.0 - BETTER))
            }
            (None, _) => None,
        };
        let Some(better) = better else {
            return Ok(diagnosis);
        };
        self.put_choices_among(&mut refined, vec![better]);
        Ok(self.conclude(bases, &tried, &refined)?.0)
    }

    /// The verdict, from the fits of the model as it stands on the coarse view and on all data, and what this leaves, those of every effect
    /// on the coarse view and those of the leaders on all data. Besides, where several effects were tried together: one of them that alone explains
    /// more than any of the leaders does, which began elsewhere.
    #[allow(clippy::type_complexity)]
    fn conclude(
        &self,
        (coarse_base, base, base_rest): (&Fit, &Fit, &Rest),
        tried: &[TriedOf<S>],
        refined: &[TriedOf<S>],
    ) -> Result<(Diagnosis<S::Domain>, Option<TriedOf<S>>)> {
        let (study, model) = (self.study, self.model);
        let base_reduced = 2.0 * base.cost / self.freedom(model, Extent::Full);
        let base_residual = study.residual(model, &base.theta)?;
        // Where even the best explanation leaves more than noise, that rest scales what counts as chance, and its
        // correlation from value to value says how many of them are independent.
        let best = refined.first().filter(|best| best.fit.cost < base.cost);
        let (best_reduced, best_residual) = match best {
            Some(best) => (
                self.reduced_chi2(best),
                study.residual(&best.model, &best.fit.theta)?,
            ),
            None => (base_reduced, base_residual),
        };
        let share = best_residual.independent_share.min(1.0);
        // What a model leaves that is far off has structure from line to line, too, which is no noise.
        let noise_factor = match best {
            Some(best) if base_rest.noise_factor() > 1.0 => {
                study.rest(&best.model, &best.fit.theta)?.noise_factor()
            }
            _ => base_rest.noise_factor(),
        };
        let evidence = Evidence {
            base_chi2: 2.0 * base.cost,
            coarse_base_chi2: 2.0 * coarse_base.cost,
            full_over_coarse: base_reduced * self.freedom(model, Extent::Coarse) / (2.0 * coarse_base.cost),
            scale: (best_reduced.max(1.0) / share).max(noise_factor),
            share: share.min(1.0 / noise_factor),
            tests: self.instances.len(),
        };
        let labels: Vec<String> = refined.iter().map(|t| self.label(&t.instance)).collect();
        let rest = tried
            .iter()
            .filter(|t| !labels.contains(&self.label(&t.instance)));
        let all: Vec<(&TriedOf<S>, &Fit)> = refined
            .iter()
            .map(|t| (t, base))
            .chain(rest.map(|t| (t, coarse_base)))
            .collect();
        let mut candidates: Vec<CandidateOf<S>> = all
            .par_iter()
            .map(|(t, without)| {
                let (tried, vanished) = self.nested(t, without, base);
                let refined = vanished || std::ptr::eq(*without, base);
                let judged = self.judge(&tried, refined, &evidence)?;
                Ok(EffectCandidate { vanished, ..judged })
            })
            .collect::<Result<_>>()?;
        candidates.sort_by(|a, b| a.delta_bic.total_cmp(&b.delta_bic));
        let superseded =
            |c: &CandidateOf<S>| candidates.iter().any(|simpler| verdict::says_as_much(simpler, c));
        let mut kept = candidates
            .iter()
            .map(|c| !superseded(c))
            .collect::<Vec<_>>()
            .into_iter();
        candidates.retain(|_| kept.next() == Some(true));
        let mut baseline = BaselineFit {
            held_out: held_out(study, model, &base.theta, Extent::Coarse, REFIT_WITHOUT_FOLD)?,
            residual: base_residual,
            reduced_chi2: base_reduced,
            rest: base_rest.clone(),
            theta: base.theta.clone(),
            calibration: self.calibration.clone(),
        };

        if base_reduced < FAINT {
            self.held_out_on_all(&mut baseline, &mut candidates)?;
        }
        let credible: Vec<bool> = candidates
            .iter()
            .map(|c| verdict::credible(c, &baseline, evidence.scale))
            .collect();
        self.test_rests(&mut candidates, &credible)?;
        let winner = credible.iter().position(|c| *c);
        let leader = self.excuse(&mut baseline, &mut candidates, winner)?;
        let (mut pairs, mut alone) = (None, None);
        // What explains more than the winner, were its size possible, may be possible beside another.
        let leading: Vec<bool> = candidates
            .iter()
            .enumerate()
            .map(|(i, c)| match winner {
                Some(w) if i >= w => credible[i],
                _ => verdict::driven_too_far(c, &baseline, evidence.scale),
            })
            .collect();
        let set = match leading.iter().position(|leads| *leads) {
            Some(w)
                if verdict::leaves_room(&candidates[w], &baseline)
                    && candidates[w].share_above_noise(&baseline) > PAIR_SHARE =>
            {
                let (best, counts, last) = self.best_set(&candidates, &leading, &evidence)?;
                pairs = Some(counts);
                let lowest = refined.iter().map(|t| t.fit.cost).fold(base.cost, f64::min);
                alone = last.filter(|t| t.fit.cost < lowest * (1.0 - BETTER));
                best
            }
            _ => None,
        };
        let values = self.freedom(model, Extent::Full) * evidence.share;
        let mut decision = verdict::decide(
            &candidates,
            &credible,
            leader,
            &baseline,
            set,
            evidence.scale,
            values,
        );
        let too_little_data = self
            .too_little_data()
            .or_else(|| explains_nothing(baseline.residual.nrms, baseline.reduced_chi2));
        if too_little_data.is_some() {
            decision = verdict::Decision {
                verdict: DiagnosisVerdict::Unknown,
                effect: None,
                companions: Vec::new(),
                best_guess: None,
                confidence: NO_CONFIDENCE,
                indistinguishable: Vec::new(),
            };
        }
        let effects = || model.effects().iter().map(|added| added.instance);
        let diagnosis = Diagnosis {
            too_little_data,
            chosen_anew: decision
                .effect
                .map_or_else(Vec::new, |w| candidates[w].chosen_anew(effects())),
            verdict: decision.verdict,
            effect: decision.effect,
            best_guess: decision.best_guess,
            confidence: decision.confidence,
            indistinguishable: decision.indistinguishable,
            companions: decision.companions,
            candidates,
            baseline,
            not_tried: self.not_tried.clone(),
            pairs,
        };
        Ok((diagnosis, alone))
    }

    /// Tests what the leading credible candidates leave for structure.
    fn test_rests(&self, candidates: &mut [CandidateOf<S>], credible: &[bool]) -> Result<()> {
        let leading: Vec<&mut CandidateOf<S>> = candidates
            .iter_mut()
            .zip(credible)
            .filter(|(c, credible)| **credible && c.refined)
            .map(|(c, _)| c)
            .take(TESTED)
            .collect();
        leading.into_par_iter().try_for_each(|c| {
            c.rest = Some(self.study.rest(&c.model, &c.theta)?);
            Ok(())
        })
    }

    /// What small errors of the setup leave of a rest that is more than noise.
    fn beyond_slips(&self, rest: &Rest, model: &ModelOf<S>, theta: &[f64]) -> Result<Option<BeyondSlips>> {
        match rest.is_significant() {
            true => self.study.beyond_slips(model, theta, rest),
            false => Ok(None),
        }
    }

    /// What small errors of the setup can take of the rest: the winner's, and the model's as it stands. Where they take nearly all of the
    /// winner's, the effect leads that explains most together with them: one that they can do themselves explains nothing.
    fn excuse(
        &self,
        baseline: &mut BaselineFit,
        candidates: &mut [CandidateOf<S>],
        winner: Option<usize>,
    ) -> Result<Option<usize>> {
        if let Some(w) = winner {
            let winner = &mut candidates[w];
            self.excuse_candidate(winner)?;
            let leaves_noise = winner
                .rest
                .as_ref()
                .is_none_or(|rest| rest.beyond_slips.is_none());
            if leaves_noise && winner.gain > WITHIN_SLIPS * baseline.rest.small_errors {
                return Ok(Some(w));
            }
        }
        // What is no larger than small errors of the setup, or nothing explains, may be such errors.
        let in_question = winner.is_some() || verdict::is_alarmed(candidates, &baseline.rest);
        baseline.rest.beyond_slips = match in_question || baseline.rest.is_significant() {
            true => self
                .study
                .beyond_slips(self.model, &baseline.theta, &baseline.rest)?,
            false => None,
        };
        let mostly_slips = |w: &usize| candidates[*w].rest.as_ref().is_some_and(Rest::is_mostly_slips);
        let Some(w) = winner.filter(mostly_slips) else {
            return Ok(winner);
        };
        let rivals: Vec<&mut CandidateOf<S>> = candidates[w + 1..]
            .iter_mut()
            .filter(|c| c.rest.is_some())
            .collect();
        rivals
            .into_par_iter()
            .try_for_each(|c| self.excuse_candidate(c))?;
        let gain =
            |i: usize| verdict::gain_with_slips(&candidates[i]).map_or(f64::NEG_INFINITY, |(gain, _)| gain);
        // The first of equals: candidates stand in the order of their BIC.
        Ok((w..candidates.len())
            .rev()
            .max_by(|a, b| gain(*a).total_cmp(&gain(*b))))
    }

    fn excuse_candidate(&self, c: &mut CandidateOf<S>) -> Result<()> {
        if let Some(rest) = &mut c.rest {
            rest.beyond_slips = self.beyond_slips(rest, &c.model, &c.theta)?;
        }
        Ok(())
    }

    /// Faint effects change held-out errors by less than the scatter that refits on the coarse view bring along: there the
    /// refits of whatever else speaks for an effect use all data.
    fn held_out_on_all(&self, baseline: &mut BaselineFit, candidates: &mut [CandidateOf<S>]) -> Result<()> {
        let study = self.study;
        let in_question: Vec<&mut CandidateOf<S>> = candidates
            .iter_mut()
            .filter(|c| c.refined && verdict::significant(c))
            .collect();
        if in_question.is_empty() {
            return Ok(());
        }
        let all = |model: &ModelOf<S>, theta: &[f64]| {
            held_out(study, model, theta, Extent::Full, REFIT_WITHOUT_FOLD)
        };
        baseline.held_out = all(self.model, &baseline.theta)?;
        in_question.into_par_iter().try_for_each(|c| {
            c.held_out = all(&c.model, &c.theta)?;
            Ok(())
        })
    }

    /// Why the data are too few for a verdict; `None` where they are not.
    fn too_little_data(&self) -> Option<String> {
        if self.study.noise_is_given() {
            return None;
        }
        let values = self.study.real_values(Extent::Full);
        let parameters = self.base_count;
        let least = parameters + verdict::least_freedom();
        (values < least).then(|| {
            format!(
                "too little data for a verdict: {values} numbers for {parameters} parameters of the model, and it takes {least} \
                 to tell what is left from noise"
            )
        })
    }

    /// Every effect on the coarse view, best first, one for each effect and site; and a better starting point for the
    /// baseline, if one turned up. `before`: what was found from another baseline.
    #[allow(clippy::type_complexity)]
    fn screen_all(
        &self,
        base: &Fit,
        before: Option<Vec<TriedOf<S>>>,
    ) -> Result<(Vec<TriedOf<S>>, Option<Vec<f64>>)> {
        let (study, model) = (self.study, self.model);
        let rounds = rounds_of_bases(model, &base.theta);
        let all = self.instances.len() * rounds.len();
        let progress = Progress::new("trying effects", before.as_ref().map_or(all, Vec::len));
        let step = || progress.step();
        let mut tried = Vec::new();
        match before {
            None => {
                for bases in &rounds {
                    let found = try_effects(study, model, &self.instances, bases, &self.hints, step);
                    put_among(&mut tried, found);
                }
            }
            Some(before) => tried = try_again(study, model, before, &base.theta, &self.hints, step),
        }
        drop(progress);
        if let Some((instance, start)) = &self.beginning {
            tried.extend(fit_from(study, model, instance, start, View::COARSE, REFINE).ok());
        }
        let by_cost = |a: &TriedOf<S>, b: &TriedOf<S>| a.fit.cost.total_cmp(&b.fit.cost);
        // One for each effect and site: its best discrete choice, of which one with more parameters has to pay for them.
        let paid = |t: &TriedOf<S>| paid(study, Extent::Coarse, t.fit.cost, t.fit.theta.len());
        tried.sort_by(|a, b| paid(a).total_cmp(&paid(b)));
        keep_first_of_each(&mut tried, |t| self.label(&t.instance));
        tried.sort_by(by_cost);
        let Some(best) = tried.first() else {
            return Ok((tried, None));
        };
        // The rivals' solutions are starting points too, for the baseline and for each other.
        let front = |t: &TriedOf<S>| t.fit.theta[..self.base_count].to_vec();
        let best_front = front(best);
        let from_leaders: Vec<Fit> = tried[..tried.len().min(LEADERS)]
            .par_iter()
            .filter_map(|t| self.minimise(model, View::COARSE, &front(t), REFINE).ok())
            .collect();
        let base_start = from_leaders
            .into_iter()
            .min_by(|a, b| a.cost.total_cmp(&b.cost))
            .filter(|fit| fit.cost < base.cost * (1.0 - BETTER))
            .map(|fit| fit.theta);
        let shared = [best_front];
        let again: Vec<Option<TriedOf<S>>> = tried
            .par_iter()
            .skip(1)
            .take(SHARED)
            .map(|t| try_effect(study, model, &t.instance, &shared, &self.hints, Effort::Direct))
            .collect();
        for (t, again) in tried.iter_mut().skip(1).zip(again) {
            if let Some(again) = again.filter(|a| a.fit.cost < t.fit.cost) {
                *t = again;
            }
        }
        tried.sort_by(by_cost);
        Ok((tried, base_start))
    }

    /// The leaders of `tried` (best first), fitted to all data, best first.
    fn refine(&self, tried: &[TriedOf<S>]) -> Result<Vec<TriedOf<S>>> {
        let lowest = tried.first().map_or(0.0, |t| t.fit.cost);
        let mut refined: Vec<TriedOf<S>> = tried
            .par_iter()
            .take(REFINED)
            .filter(|t| t.fit.cost <= BEHIND * lowest)
            .map(|t| {
                let fit = self.minimise(&t.model, View::FULL, &t.fit.theta, REFINE)?;
                Ok(Tried { fit, ..t.clone() })
            })
            .collect::<Result<_>>()?;
        refined.sort_by(|a, b| a.fit.cost.total_cmp(&b.fit.cost));
        Ok(refined)
    }

    /// What explains most and leaves more than noise may be stuck away from its best fit, or be another choice of the same effect.
    fn try_harder(&self, best: &mut TriedOf<S>, base_reduced: f64) -> Result<()> {
        let is_noise = |t: &TriedOf<S>| verdict::is_noise(self.reduced_chi2(t));
        if is_noise(best) {
            // By its size; what many data leave may have structure all the same, and another choice would follow it.
            let choices = self.other_choices(best).count();
            if choices > 0 && self.study.rest(&best.model, &best.fit.theta)?.is_significant() {
                self.try_other_choices(best)?;
            }
            return Ok(());
        }
        if let Some(fit) = rescue(self.study, self.model, best, &self.hints, REFINE)? {
            best.fit = fit;
        }
        if !is_noise(best) && share_taken(base_reduced, self.reduced_chi2(best)) > PAIR_SHARE {
            let fit = fit_as_a_model(self.study, &best.model, &best.fit.theta, REFINE)?;
            if fit.cost < best.fit.cost {
                best.fit = fit;
            }
            if !is_noise(best) {
                self.try_other_choices(best)?;
            }
        }
        Ok(())
    }

    /// Those of the same effect and site that choose otherwise.
    fn other_choices<'e>(&'e self, tried: &'e TriedOf<S>) -> impl Iterator<Item = &'e InstanceOf<S>> {
        let label = self.label(&tried.instance);
        self.instances
            .iter()
            .filter(move |other| **other != tried.instance && self.label(other) == label)
    }

    /// Of the other choices of the effect in `best`, from what that has made of the model and of the sizes that both have: the one that is
    /// better by more than what its parameters cost.
    fn try_other_choices(&self, best: &mut TriedOf<S>) -> Result<()> {
        // What it leaves tells where those of the others have resonances that it has not.
        let hints = self.study.hints(&best.model, &best.fit.theta)?;
        let (front, sizes) = best.fit.theta.split_at(self.base_count);
        let common: Vec<(&str, f64)> = best.model.parameters[self.base_count..]
            .iter()
            .map(|p| p.name.as_str())
            .zip(sizes.iter().copied())
            .collect();
        let starts = |model: &ModelOf<S>, other: &InstanceOf<S>| -> Vec<Vec<f64>> {
            let mut starts = own_starts(self.study, model, self.base_count, other, &hints);
            for start in &mut starts {
                for (value, parameter) in start.iter_mut().zip(&model.parameters[self.base_count..]) {
                    let known = common.iter().find(|(name, _)| *name == parameter.name);
                    *value = known.map_or(*value, |(_, known)| *known);
                }
            }
            starts.dedup();
            starts
        };
        let others: Vec<&InstanceOf<S>> = self.other_choices(best).collect();
        let others: Vec<TriedOf<S>> = others
            .into_par_iter()
            .filter_map(|other| {
                let model = self.study.extend(self.model, other);
                let fits = starts(&model, other).into_iter().filter_map(|own| {
                    let start = [front, &own].concat();
                    self.minimise(&model, View::COARSE, &start, REFINE).ok()
                });
                let lowest = fits.min_by(|a, b| a.cost.total_cmp(&b.cost))?;
                Some((*other, model, lowest))
            })
            .map(|(instance, model, lowest)| {
                let fit = self.minimise(&model, View::FULL, &lowest.theta, REFINE)?;
                Ok(Tried { instance, model, fit })
            })
            .collect::<Result<_>>()?;
        let paid = |t: &TriedOf<S>| paid(self.study, Extent::Full, t.fit.cost, t.fit.theta.len());
        if let Some(other) = others.into_iter().min_by(|a, b| paid(a).total_cmp(&paid(b)))
            && paid(&other) < paid(best)
        {
            *best = other;
        }
        Ok(())
    }

    /// Of all effects, beside all other choices (a direction, a form) of those that are in the model already, the one that explains most: a
    /// choice that was made while something was missing may hide it. `None` where there is no other choice.
    fn with_another_choice(&self, base: &Fit) -> Result<Option<TriedOf<S>>> {
        let places = self.model.effects().iter().enumerate();
        let choices: Vec<(usize, InstanceOf<S>)> = places
            .flat_map(|(place, added)| added.instance.other_choices().map(move |other| (place, other)))
            .collect();
        let models: Vec<(ModelOf<S>, Fit)> = choices
            .par_iter()
            .filter_map(|(place, other)| {
                let (model, start) = exchanged(self.study, self.model, &base.theta, *place, other);
                // All candidates are measured against one number of parameters in front of their own.
                if start.len() != self.base_count {
                    return None;
                }
                let fit = self.minimise(&model, View::COARSE, &start, REFINE).ok()?;
                Some((model, fit))
            })
            .collect();
        let each = models
            .iter()
            .flat_map(|model| self.instances.iter().map(move |instance| (model, instance)));
        let mut looks: Vec<(&ModelOf<S>, TriedOf<S>)> = each
            .collect::<Vec<_>>()
            .into_par_iter()
            .filter_map(|((model, fit), instance)| {
                let bases = [fit.theta.clone()];
                let look = try_effect(self.study, model, instance, &bases, &self.hints, Effort::Look)?;
                Some((model, look))
            })
            .collect();
        looks.sort_by(|a, b| a.1.fit.cost.total_cmp(&b.1.fit.cost));
        looks.truncate(LEADERS);
        let settled = looks.into_par_iter().filter_map(|(model, look)| {
            fit_from(
                self.study,
                model,
                &look.instance,
                &look.fit.theta,
                View::COARSE,
                REFINE,
            )
            .ok()
        });
        let Some(best) = settled.min_by(|a, b| a.fit.cost.total_cmp(&b.fit.cost)) else {
            return Ok(None);
        };
        let fit = self.minimise(&best.model, View::FULL, &best.fit.theta, REFINE)?;
        Ok(Some(Tried { fit, ..best }))
    }

    /// Where nothing explains the data: effects of the whole structure, and leaders, that have ended at sizes which cannot be, and those
    /// on promise that a look from where the model stands has passed over, from possible sizes. What comes to lie before others is put
    /// among the leaders.
    fn begin_at_possible_sizes(
        &self,
        tried: &[TriedOf<S>],
        coarse_base: &Fit,
        refined: &mut Vec<TriedOf<S>>,
    ) -> Result<()> {
        let bases = [self.calibration.theta.clone(), self.model.nominal_theta()];
        let cannot_be = |t: &&TriedOf<S>| {
            let own = self.base_count..t.model.parameters.len();
            let sizes = estimates(&t.model.parameters, &t.fit, 1.0);
            let impossible = sizes.is_ok_and(|all| {
                self.study
                    .impossible(&t.model, &t.instance, &all[own.clone()])
                    .is_some()
            });
            impossible || own.clone().any(|i| t.fit.at_bound.contains(&i))
        };
        // Every choice of it: they differ in what they do, and the one that led need not be the one that explains.
        let everywhere = |i: &InstanceOf<S>| i.site == Site::Everywhere;
        let passed_over = self
            .instances
            .iter()
            .filter(|i| everywhere(i) && i.effect.on_promise());
        let passed_over = passed_over.filter_map(|instance| {
            let model = self.study.extend(self.model, instance);
            let fit = vanished(&model, coarse_base)?;
            let instance = *instance;
            Some(Tried { instance, model, fit })
        });
        let stuck: Vec<TriedOf<S>> = tried
            .iter()
            .enumerate()
            .filter(|(place, t)| *place < LED_AWAY || everywhere(&t.instance))
            .map(|(_, t)| t)
            .filter(|t| !t.instance.effect.on_promise())
            .filter(cannot_be)
            .cloned()
            .chain(passed_over)
            .collect();
        let found: Vec<Option<TriedOf<S>>> = stuck
            .par_iter()
            .map(|t| from_possible_size(self.study, t, &bases, REFINE))
            .collect::<Result<_>>()?;
        put_among(refined, found.into_iter().flatten());
        Ok(())
    }

    /// Where little is missing: a look at few data may show too little of an effect to lead its fit away from where it vanishes, or to
    /// promise anything, and all data show it. Those that gain more by the size that all data give than they did are fitted from there.
    fn begin_at_linear_sizes(&self, base: &Fit, rest: &Rest, refined: &mut Vec<TriedOf<S>>) -> Result<()> {
        let effects = (self.instances.as_slice(), self.hints.as_slice());
        let of_all: Vec<f64> = rest.tests.iter().filter_map(|t| t.frequency_hz).collect();
        let gained = |label: &str| {
            let known = refined.iter().filter(|r| self.label(&r.instance) == label);
            known.map(|r| 2.0 * (base.cost - r.fit.cost)).fold(0.0, f64::max)
        };
        let sizes = faint::sizes(self.study, self.model, base, effects, &of_all, gained)?;
        // A size that no robot stands with is no start.
        let found: Vec<TriedOf<S>> = sizes
            .into_par_iter()
            .filter_map(|Linear { instance, size }| {
                fit_from(self.study, self.model, &instance, &size.theta, View::FULL, REFINE).ok()
            })
            .collect();
        self.put_choices_among(refined, found);
        Ok(())
    }

    fn judge(&self, tried: &TriedOf<S>, refined: bool, evidence: &Evidence) -> Result<CandidateOf<S>> {
        let study = self.study;
        let Tried { instance, model, fit } = tried;
        let extra = (model.parameters.len() - self.base_count) as f64;
        let chi2 = 2.0 * fit.cost;
        // On the coarse view the evidence is that of the coarse view: scaled up, chance would look like an effect.
        let (raw_gain, reduced_chi2, values) = if refined {
            let gain = evidence.base_chi2 - chi2;
            (gain, self.reduced_chi2(tried), study.real_values(Extent::Full))
        } else {
            let gain = evidence.coarse_base_chi2 - chi2;
            let reduced = chi2 / self.freedom(model, Extent::Coarse) * evidence.full_over_coarse;
            (gain, reduced, study.real_values(Extent::Coarse))
        };
        let gain = (raw_gain / evidence.scale).max(0.0);
        let single = ChiSquared::new(extra).map_or(1.0, |d| d.sf(gain));
        let refit = if refined {
            REFIT_WITHOUT_FOLD
        } else {
            REFIT_BRIEFLY
        };
        let all = estimates(&model.parameters, fit, reduced_chi2)?;
        let own = self.base_count..all.len();
        Ok(EffectCandidate {
            instance: *instance,
            name: instance.name(),
            nrms: study.residual(model, &fit.theta)?.nrms,
            held_out: held_out(study, model, &fit.theta, Extent::Coarse, refit)?,
            delta_bic: extra * price_of_a_parameter(evidence.share * values as f64) - gain,
            p_value: (single * evidence.tests as f64).min(1.0),
            reduced_chi2,
            gain: raw_gain,
            rest: None,
            not_credible: study.impossible(model, instance, &all[own.clone()]),
            at_bound: own.clone().any(|i| fit.at_bound.contains(&i)),
            vanished: false,
            parameters: all[own].to_vec(),
            refined,
            theta: fit.theta.clone(),
            model: model.clone(),
        })
    }
}

/// Error over the signal from which on a model explains nothing of it.
const EXPLAINS_NOTHING_NRMS: f64 = 0.95;

/// Whether the signal itself is noise: a model whose error is as large as it leaves no more.
pub(crate) fn is_all_noise(nrms: f64, reduced_chi2: f64) -> bool {
    nrms > EXPLAINS_NOTHING_NRMS && verdict::is_noise(reduced_chi2)
}

/// Why there is nothing to judge where the signal itself is noise; `None` where there is.
fn explains_nothing(nrms: f64, reduced_chi2: f64) -> Option<String> {
    is_all_noise(nrms, reduced_chi2).then(|| {
        format!(
            "the model's error is as large as the signal ({:.0} %) and no larger than the noise, so that nothing in the data is told \
             from noise: check columns, sampling rates and speeds in campaign.toml (column, rate_hz, spindle_rpm), and that there was \
             something to measure",
            100.0 * nrms
        )
    })
}

#[cfg(test)]
mod tests {
    use super::explains_nothing;

    #[test]
    fn noise_is_not_called_a_complete_model() {
        assert!(explains_nothing(1.0, 1.02).is_some_and(|why| why.contains("rate_hz")));
        // A faint signal that the model explains in part, and a wrong model of a clear one.
        assert_eq!(explains_nothing(0.8, 1.0), None);
        assert_eq!(explains_nothing(1.0, 40.0), None);
    }
}
