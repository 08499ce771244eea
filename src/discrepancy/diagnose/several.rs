//! Several effects that explain together what none does alone.

use std::collections::VecDeque;

use rayon::prelude::*;

use super::{CandidateOf, Engine, Evidence, REFINE, REFIT_BRIEFLY, TriedOf};
use crate::Result;
use crate::discrepancy::candidate::EffectCandidate;
use crate::discrepancy::faint::Linear;
use crate::discrepancy::ranking::keep_first_of_each;
use crate::discrepancy::verdict::EffectSet;
use crate::identify::first_size::linear_size;
use crate::identify::frfs::calibrate::estimates;
use crate::identify::levenberg_marquardt::{Fit, LeastSquares};
use crate::identify::study::{
    Effort, Extent, InstanceOf, ModelOf, Study, Tried, View, exchanged, fit_as_a_model, fit_from, paid,
    try_effect,
};
use crate::progress::Progress;

/// Candidates whose combination with every other one is tried where none explains the data alone.
const PAIR_LEADERS: usize = 2;
/// Processor time that looks at pairs may take, s (see [`Study::work_s`]), the evaluations with derivatives of one look, and
/// the pairs that are looked at in any case.
const PAIRS_BUDGET_S: f64 = 4.0;
const LOOK_EVALUATIONS: f64 = 20.0;
const FEWEST_PAIRS: usize = 12;
/// Pairs to which a third effect is added, where they leave so many standard deviations of χ² above noise, and those to which one is
/// because another third effect has led to them.
const THREE_LEADERS: usize = 2;
const PLAIN_SIGMAS: f64 = 5.0;
const LED_TO: usize = 2;

/// How many effects are tried besides others.
#[derive(Clone, Copy)]
struct Search {
    /// Effects, each with all its discrete choices.
    looked_at: usize,
    /// Followed to their end on the coarse view, …
    settled: usize,
    /// … besides those that would gain most were the response linear in their sizes, …
    linear: usize,
    /// … and of those on all data.
    refined: usize,
}

const PAIRS: Search = Search {
    looked_at: usize::MAX,
    settled: 4,
    linear: 2,
    refined: 2,
};
const THREES: Search = Search {
    looked_at: 16,
    settled: 2,
    linear: 2,
    refined: 1,
};

/// Share of what stands above the noise that effects must take together for what is left to be followed further.
const NEARLY_ALL: f64 = 0.9;

/// Several effects fitted together.
struct Together<S: Study> {
    /// Each with the number of its parameters, in their order.
    parts: Vec<(InstanceOf<S>, usize)>,
    model: ModelOf<S>,
    theta: Vec<f64>,
    /// On all data.
    cost: f64,
    /// No size at the end of its range, none that cannot be. What is missing still may drive sizes there.
    possible: bool,
}

/// Effects that were tried together, and the labels of others by what they promised besides the first of them.
type Begun<S> = (Together<S>, Vec<String>);

impl<S: Study> Engine<'_, S> {
    /// The effects that explain most together: the best pair with one that leads, and where every pair leaves more than noise of what
    /// is plain, the best three. Besides, what came last into those that leave least, alone.
    #[allow(clippy::type_complexity)]
    pub(super) fn best_set(
        &self,
        candidates: &[CandidateOf<S>],
        leading: &[bool],
        evidence: &Evidence,
    ) -> Result<(Option<EffectSet>, [usize; 2], Option<TriedOf<S>>)> {
        let mut counts = [0, 0];
        let mut best: Option<EffectSet> = None;
        let answers = |best: &Option<EffectSet>| best.as_ref().is_some_and(|b| b.odds_against() < 1.0);
        let leaders = candidates
            .iter()
            .zip(leading)
            .filter(|(_, leads)| **leads)
            .map(|(c, _)| c)
            .take(PAIR_LEADERS);
        let leaders: Vec<Together<S>> = leaders
            .map(|c| Together {
                parts: vec![(c.instance, c.parameters.len())],
                model: c.model.clone(),
                theta: c.theta.clone(),
                cost: 0.5 * (evidence.base_chi2 - c.gain),
                possible: true,
            })
            .collect();
        let labels: Vec<String> = candidates.iter().map(EffectCandidate::label).collect();
        let mut pairs: Vec<Begun<S>> = Vec::new();
        for leader in &leaders {
            // Those that explain most alone come first, should the budget not reach to the end.
            let linear = self.by_linear_gain(leader);
            let (found, promising) = self.with_another(leader, &labels, linear, PAIRS, &mut counts)?;
            for pair in found {
                let pair = self.or_simpler(pair)?;
                self.keep_better(&mut best, &pair, (candidates, leading), evidence)?;
                pairs.push((pair, promising.clone()));
            }
            // Effects that leave only noise are the answer; other leaders cannot do better.
            if answers(&best) {
                let last = self.last_alone(pairs.iter().map(|(pair, _)| pair))?;
                return Ok((best, counts, last));
            }
        }
        pairs.sort_by(|a, b| self.paid(&a.0).total_cmp(&self.paid(&b.0)));
        // Both leaders may have ended at the same two.
        keep_first_of_each(&mut pairs, |(pair, _)| {
            let mut labels = self.labels(&pair.parts);
            labels.sort();
            labels
        });
        let above = evidence.base_chi2 - self.freedom(self.model, Extent::Full);
        let nearly_all = |set: &Together<S>| evidence.base_chi2 - 2.0 * set.cost > NEARLY_ALL * above;
        let mut threes: Vec<Together<S>> = Vec::new();
        let is_plain = |(pair, _): &Begun<S>| self.leaves_plain(pair, nearly_all(pair));
        let (mut begun, mut queue) = match pairs.first().map_or(Ok(false), is_plain)? {
            true => (Vec::new(), pairs.into_iter().take(THREE_LEADERS).collect()),
            false => (pairs, VecDeque::new()),
        };
        while let Some((pair, promising)) = queue.pop_front() {
            let linear = self.by_linear_gain(&pair);
            let order = self.by_turns(&linear, &promising);
            let (found, _) = self.with_another(&pair, &order, linear, THREES, &mut [0, 0])?;
            for three in found {
                let three = match nearly_all(&three) {
                    true => self.or_simpler(self.or_last_elsewhere(three)?)?,
                    false => three,
                };
                self.keep_better(&mut best, &three, (candidates, leading), evidence)?;
                if nearly_all(&three)
                    && begun.len() < LED_TO
                    && let Some(two) = self.without_needless(&three)?
                {
                    self.keep_better(&mut best, &two, (candidates, leading), evidence)?;
                    // What the search was led to comes first.
                    queue.push_front((two, promising.clone()));
                }
                threes.push(three);
            }
            begun.push((pair, promising));
            if answers(&best) {
                break;
            }
        }
        let last = self.last_alone(begun.iter().map(|(pair, _)| pair).chain(&threes))?;
        if answers(&best) {
            return Ok((best, counts, last));
        }
        // So many parameters at once may have stopped on their way: what explains nearly all is fitted as the model was, where that
        // does not take long.
        threes.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        if let Some(three) = threes
            .first()
            .filter(|three| nearly_all(three))
            .filter(|three| self.looks_affordable(&three.model) >= FEWEST_PAIRS)
        {
            let fit = fit_as_a_model(self.study, &three.model, &three.theta, REFINE)?;
            let fresh = self.together(three.parts.clone(), three.model.clone(), fit)?;
            self.keep_better(&mut best, &fresh, (candidates, leading), evidence)?;
        }
        Ok((best, counts, last))
    }

    /// Half of −2 ln L of a set, and what its parameters have to gain.
    fn paid(&self, set: &Together<S>) -> f64 {
        paid(self.study, Extent::Full, set.cost, set.theta.len())
    }

    /// Whether a pair of effects leaves more than noise of what is plain. Of many data what is small beside the scatter of χ² may be plain,
    /// too, by its structure; that is asked where the pair takes nearly all.
    fn leaves_plain(&self, pair: &Together<S>, takes_nearly_all: bool) -> Result<bool> {
        let freedom = self.freedom(&pair.model, Extent::Full);
        let plain = 2.0 * pair.cost - freedom > PLAIN_SIGMAS * (2.0 * freedom).sqrt();
        Ok(plain || takes_nearly_all && self.study.rest(&pair.model, &pair.theta)?.is_significant())
    }

    /// The model with further effects.
    fn model_of(&self, parts: &[InstanceOf<S>]) -> ModelOf<S> {
        let mut model = self.model.clone();
        for instance in parts {
            model = self.study.extend(&model, instance);
        }
        model
    }

    /// `set` with the effect at `place` of it replaced by `other` and fitted to a view, from the sizes that both have.
    fn replaced(
        &self,
        set: &Together<S>,
        place: usize,
        other: &InstanceOf<S>,
        view: View,
    ) -> Result<(ModelOf<S>, Fit)> {
        let before = set.model.effects().len() - set.parts.len();
        let (model, start) = exchanged(self.study, &set.model, &set.theta, before + place, other);
        let fit = self.minimise(&model, view, &start, REFINE)?;
        Ok((model, fit))
    }

    /// `set`, or the same with the special case of one of its effects where that says as much.
    fn or_simpler(&self, set: Together<S>) -> Result<Together<S>> {
        let mut set = set;
        for place in 0..set.parts.len() {
            let (general, _) = set.parts[place];
            let is_simpler = |other: &&InstanceOf<S>| {
                general.effect.refines() == Some(other.effect.id()) && other.site == general.site
            };
            let Some(simpler) = self.instances.iter().find(is_simpler) else {
                continue;
            };
            // One that cannot be set up with these sizes is no better.
            let Ok((model, fit)) = self.replaced(&set, place, simpler, View::FULL) else {
                continue;
            };
            let fewer = self.exchanged(&set, place, *simpler, model, fit)?;
            if self.paid(&fewer) < self.paid(&set) {
                set = fewer;
            }
        }
        Ok(set)
    }

    /// `set`, or the same with its last effect at another of its places, or another choice of it, where that is better: looks at few data
    /// may have taken one for the other.
    fn or_last_elsewhere(&self, set: Together<S>) -> Result<Together<S>> {
        let Some(place) = set.parts.len().checked_sub(1) else {
            return Ok(set);
        };
        let last = set.parts[place].0;
        let taken = self.labels(&set.parts[..place]);
        let elsewhere = |other: &&InstanceOf<S>| {
            **other != last && other.effect.id() == last.effect.id() && !taken.contains(&self.label(other))
        };
        let places: Vec<&InstanceOf<S>> = self.instances.iter().filter(elsewhere).collect();
        let looks = places.into_par_iter().filter_map(|other| {
            let (model, fit) = self.replaced(&set, place, other, View::COARSE).ok()?;
            Some((*other, model, fit))
        });
        let Some((other, model, look)) = looks.min_by(|a, b| a.2.cost.total_cmp(&b.2.cost)) else {
            return Ok(set);
        };
        let Ok(fit) = self.minimise(&model, View::FULL, &look.theta, REFINE) else {
            return Ok(set);
        };
        let moved = self.exchanged(&set, place, other, model, fit)?;
        Ok(if self.paid(&moved) < self.paid(&set) {
            moved
        } else {
            set
        })
    }

    /// `set` with the effect at `place` exchanged for `other`, which made it `model` with this fit.
    fn exchanged(
        &self,
        set: &Together<S>,
        place: usize,
        other: InstanceOf<S>,
        model: ModelOf<S>,
        fit: Fit,
    ) -> Result<Together<S>> {
        let mut parts = set.parts.clone();
        let others: usize = parts.iter().map(|(_, count)| count).sum::<usize>() - parts[place].1;
        parts[place] = (other, model.parameters.len() - self.base_count - others);
        self.together(parts, model, fit)
    }

    /// Of three effects the two that are left without those whose sizes ended at the end of their range: the third has made another one
    /// needless. `None` where that are not two.
    fn without_needless(&self, set: &Together<S>) -> Result<Option<Together<S>>> {
        let bounds = set.model.bounds();
        let mut parts = Vec::new();
        let mut theta = set.theta[..self.base_count].to_vec();
        let mut first = self.base_count;
        for (instance, count) in &set.parts {
            let own = first..first + count;
            first = own.end;
            if !own.clone().any(|i| bounds[i].contains(&set.theta[i])) {
                parts.push((*instance, *count));
                theta.extend_from_slice(&set.theta[own]);
            }
        }
        if parts.len() == set.parts.len() || parts.len() < 2 {
            return Ok(None);
        }
        let instances: Vec<InstanceOf<S>> = parts.iter().map(|(instance, _)| *instance).collect();
        let model = self.model_of(&instances);
        match self.minimise(&model, View::FULL, &theta, REFINE) {
            Ok(fit) => self.together(parts, model, fit).map(Some),
            Err(_) => Ok(None),
        }
    }

    /// Of the set that leaves least, the effect that came last, without the others: they may only have led to where it explains all.
    fn last_alone<'t>(&self, sets: impl Iterator<Item = &'t Together<S>>) -> Result<Option<TriedOf<S>>>
    where
        S: 't,
    {
        let Some(best) = sets.min_by(|a, b| a.cost.total_cmp(&b.cost)) else {
            return Ok(None);
        };
        let Some((instance, own)) = best.parts.last() else {
            return Ok(None);
        };
        let (front, last) = (
            &best.theta[..self.base_count],
            &best.theta[best.theta.len() - own..],
        );
        let start = [front, last].concat();
        fit_from(self.study, self.model, instance, &start, View::FULL, REFINE).map(Some)
    }

    /// Effects besides those of `leader` at the sizes that they would have were the response linear in them, most gain first.
    fn by_linear_gain(&self, leader: &Together<S>) -> Vec<Linear<S>> {
        let study = self.study;
        let taken = self.labels(&leader.parts);
        let cost = study.problem(&leader.model, View::COARSE).cost(&leader.theta);
        let cost = cost.unwrap_or(f64::INFINITY);
        let mut gains: Vec<Linear<S>> = self
            .instances
            .par_iter()
            .filter(|instance| !taken.contains(&self.label(instance)))
            .filter_map(|instance| {
                let model = study.extend(&leader.model, instance);
                let size = linear_size(&study.problem(&model, View::COARSE), &model, &leader.theta)?;
                Linear::new(*instance, size, cost)
            })
            .collect();
        gains.sort_by(|a, b| b.size.gain.total_cmp(&a.size.gain));
        gains
    }

    /// Labels of further effects: by turns the next of `linear` and of `promising`.
    fn by_turns(&self, linear: &[Linear<S>], promising: &[String]) -> Vec<String> {
        let gains: Vec<String> = linear.iter().map(|l| self.label(&l.instance)).collect();
        let mut order: Vec<String> = Vec::new();
        for k in 0..gains.len().max(promising.len()) {
            for label in gains.get(k).into_iter().chain(promising.get(k)) {
                if !order.contains(label) {
                    order.push(label.clone());
                }
            }
        }
        order
    }

    /// `leader` with each other effect, in the order of `labels`: the best of them and of `linear` fitted to all data,
    /// best first, and the labels of all by what they promise. `counts`: how many were tried, of how many.
    #[allow(clippy::type_complexity)]
    fn with_another(
        &self,
        leader: &Together<S>,
        labels: &[String],
        linear: Vec<Linear<S>>,
        effort: Search,
        counts: &mut [usize; 2],
    ) -> Result<(Vec<Together<S>>, Vec<String>)> {
        let study = self.study;
        let bases = [leader.theta.clone()];
        let hints = study.hints(&leader.model, &leader.theta)?;
        let taken = self.labels(&leader.parts);
        let standing = |instance: &InstanceOf<S>| {
            let label = self.label(instance);
            labels.iter().position(|l| *l == label).unwrap_or(labels.len())
        };
        let mut others: Vec<&InstanceOf<S>> = self
            .instances
            .iter()
            .filter(|i| !taken.contains(&self.label(i)))
            .collect();
        others.sort_by_key(|i| standing(i));
        let affordable = self.looks_affordable(&leader.model);
        counts[1] += others.len();
        others.truncate(affordable.max(FEWEST_PAIRS));
        others.retain(|i| standing(i) < effort.looked_at);
        counts[0] += others.len();
        let progress = Progress::new("trying several effects together", others.len());
        let mut tried: Vec<TriedOf<S>> = others
            .par_iter()
            .filter_map(|other| {
                let tried = try_effect(study, &leader.model, other, &bases, &hints, Effort::Look);
                progress.step();
                tried
            })
            .collect();
        tried.sort_by(|a, b| a.fit.cost.total_cmp(&b.fit.cost));
        let promising = tried.iter().map(|t| self.label(&t.instance)).collect();
        tried.truncate(effort.settled);
        // A look may be too short for what is faint beside the leader.
        let missed = linear.into_iter();
        let missed = missed.filter(|linear| tried.iter().all(|t| t.instance != linear.instance));
        let missed: Vec<TriedOf<S>> = missed
            .take(effort.linear)
            .filter_map(|Linear { instance, size }| {
                let (view, briefly) = (View::COARSE, REFIT_BRIEFLY);
                fit_from(study, &leader.model, &instance, &size.theta, view, briefly).ok()
            })
            .collect();
        tried.extend(missed);
        let follow = |tried: Vec<TriedOf<S>>, view: View| -> Result<Vec<TriedOf<S>>> {
            let mut settled: Vec<TriedOf<S>> = tried
                .into_par_iter()
                .map(|t| {
                    let fit = self.minimise(&t.model, view, &t.fit.theta, REFINE)?;
                    Ok(Tried { fit, ..t })
                })
                .collect::<Result<_>>()?;
            settled.sort_by(|a, b| a.fit.cost.total_cmp(&b.fit.cost));
            Ok(settled)
        };
        let mut near = follow(tried, View::COARSE)?;
        near.truncate(effort.refined);
        let mut found = Vec::new();
        for t in follow(near, View::FULL)? {
            let first = leader.model.parameters.len();
            let mut parts = leader.parts.clone();
            parts.push((t.instance, t.model.parameters.len() - first));
            found.push(self.together(parts, t.model, t.fit)?);
        }
        Ok((found, promising))
    }

    /// Puts a set of effects in the place of `best` where it leaves less.
    fn keep_better(
        &self,
        best: &mut Option<EffectSet>,
        together: &Together<S>,
        (candidates, leading): (&[CandidateOf<S>], &[bool]),
        evidence: &Evidence,
    ) -> Result<()> {
        let paid = self.paid(together);
        if !together.possible || best.as_ref().is_some_and(|b| b.paid <= paid) {
            return Ok(());
        }
        let mut labels = self.labels(&together.parts);
        // The strongest of them alone is named first.
        let place = |label: &String| candidates.iter().position(|c| c.label() == *label);
        let standing = labels.iter().map(place);
        let strongest = standing.flatten().filter(|i| leading[*i]).min();
        let Some(strongest) = strongest else { return Ok(()) };
        labels.retain(|label| *label != candidates[strongest].label());
        let mut rest = self.study.rest(&together.model, &together.theta)?;
        rest.beyond_slips = self.beyond_slips(&rest, &together.model, &together.theta)?;
        *best = Some(EffectSet {
            strongest,
            others: labels,
            parameters: together.parts.iter().map(|(_, count)| count).sum(),
            gain: evidence.base_chi2 - 2.0 * together.cost,
            paid,
            rest,
        });
        Ok(())
    }

    fn labels(&self, parts: &[(InstanceOf<S>, usize)]) -> Vec<String> {
        parts.iter().map(|(instance, _)| self.label(instance)).collect()
    }

    /// Looks at further effects of `model` that fit into the budget.
    fn looks_affordable(&self, model: &ModelOf<S>) -> usize {
        let look_s = LOOK_EVALUATIONS * self.study.work_s(model, Extent::Glance);
        (PAIRS_BUDGET_S / look_s.max(1e-9)) as usize
    }

    /// Several effects fitted to all data.
    fn together(
        &self,
        parts: Vec<(InstanceOf<S>, usize)>,
        model: ModelOf<S>,
        fit: Fit,
    ) -> Result<Together<S>> {
        let all = estimates(&model.parameters, &fit, 1.0)?;
        let mut start = self.base_count;
        let impossible = parts.iter().any(|(instance, count)| {
            let own = start..start + count;
            start = own.end;
            self.study.impossible(&model, instance, &all[own]).is_some()
        });
        Ok(Together {
            possible: fit.at_bound.is_empty() && !impossible,
            parts,
            model,
            theta: fit.theta,
            cost: fit.cost,
        })
    }
}
