//! Lets the data draw the missing part: where in the structure one unknown law of force over displacement, the same at
//! all postures, explains what the model leaves over, what that law is over frequency, and which simple form fits it.
//!
//! Every place is screened by projection ([`screen`]): its unknown is taken out of residual and sensitivities line by
//! line, and what is left says how good the place is. The best places are then refitted with each simple form as part of
//! the model itself, the model's own parameters with them, and judged by BIC; where one displacement of a place leaves more
//! than noise, a second of the same place is tried with it. The leaders have to predict postures that were left out.

pub mod named;
pub mod screen;
#[cfg(test)]
pub(in crate::discrepancy) mod tests;

use std::collections::BTreeMap;

use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::Result;
use crate::effects::drawn::{self, DrawnForm};
use crate::effects::{Instance, Site, Spot, Structure};
use crate::identify::frfs::calibrate::{Calibration, Estimate, estimates};
use crate::identify::frfs::frf_data::FrfData;
use crate::identify::frfs::spot_response::{SpotResponses, free_spots};
use crate::identify::frfs::structure_study::{led_astray, starts_elsewhere};
use crate::identify::levenberg_marquardt::{Fit, Stopping, minimise};
use crate::identify::study::{
    Effort, Extent, HeldOut, Looked, OUT_OF_RACE, Study, Tried, View, fit_as_a_model, fit_from, held_out,
    look, race,
};
use crate::identify::{StructureModel, StructureStudy};
use screen::{CurvePoint, Screened};

use super::verdict::is_convincing;

/// One form tried at a place.
#[derive(Debug, Clone)]
pub struct FormFit {
    /// The law that was tried.
    pub form: DrawnForm,
    /// BIC less that of the model without it (coarse view of the data): below zero it pays for its parameters.
    pub delta_bic: f64,
}

/// One place, best form first in `forms`.
#[derive(Debug, Clone)]
pub struct LocalisedPlace {
    /// Where it is.
    pub spot: Spot,
    /// Misfit per complex value that is left: 1 is noise. Of the best form's fit where there is one, else of the screen.
    pub left: f64,
    /// Scatter of the drawn dynamic stiffness over postures, in units of its noise variance: 1 if it is the same everywhere.
    pub consistency: f64,
    /// Dynamic stiffness that the data ask for there, line by line; with the best form's law as its beginning where there is one.
    pub curve: Vec<CurvePoint>,
    /// Empty where the place was screened only.
    pub forms: Vec<FormFit>,
    /// The form that explains most; `None` where the place was screened only or no form led to a fit.
    pub best: Option<BestForm>,
    /// Labels of places that explain the data as well.
    pub tied_with: Vec<String>,
}

impl LocalisedPlace {
    /// `under the base (x)`; of both axes where what acts there is alike along two.
    pub fn in_words(&self) -> String {
        let form = self.best.as_ref().map(|best| best.first.form());
        form.map_or_else(|| self.spot.words(), |form| form.place_in_words(self.spot))
    }

    /// N/m, or N·m/rad where it turns.
    pub fn stiffness_unit(&self) -> &'static str {
        if self.spot.is_angle() { "N·m/rad" } else { "N/m" }
    }
}

/// A form at one displacement, fitted.
#[derive(Debug, Clone)]
pub struct DrawnPart {
    /// Where it is.
    pub spot: Spot,
    /// The form there, as an effect.
    pub instance: Instance<Structure>,
    /// Its own parameters.
    pub parameters: Vec<Estimate>,
}

impl DrawnPart {
    /// The law.
    pub fn form(&self) -> DrawnForm {
        drawn::form_of(self.instance.variant)
    }
}

/// What explains most at a place, fitted to all data.
#[derive(Debug, Clone)]
pub struct BestForm {
    /// What acts there.
    pub first: DrawnPart,
    /// What acts along another displacement of the same place, where one is not enough; fitted with the first.
    pub second: Option<DrawnPart>,
    /// The model with it.
    pub model: StructureModel,
    /// Where its fit stands, solver's scale.
    pub theta: Vec<f64>,
    /// Misfit Σ|r|²/σ² and priors.
    pub cost: f64,
    /// BIC less that of the model without it: below zero the form pays for its parameters.
    pub delta_bic: f64,
    /// Of the likelihood ratio, corrected for the places and forms tried.
    pub p_value: f64,
    /// One of its parameters stopped at the end of its range.
    pub at_bound: bool,
    /// On postures left out of the fit; of the best place and of those that are tied with it.
    pub held_out: Option<HeldOut>,
}

impl BestForm {
    /// One part or two.
    pub fn parts(&self) -> impl Iterator<Item = &DrawnPart> {
        std::iter::once(&self.first).chain(&self.second)
    }

    /// What to `add`, in order. The first of two is asked for by its form: alone, another one may seem to do for both.
    pub fn requests(&self) -> Vec<String> {
        let is_alone = self.second.is_none();
        self.parts()
            .map(|part| match is_alone {
                true => part.instance.label(),
                false => part.instance.request(),
            })
            .collect()
    }

    /// `a resonator on link 5 along z`; `of_part` stands behind each form.
    pub fn in_words(&self, of_part: impl Fn(&DrawnPart) -> String) -> String {
        let part = |p: &DrawnPart| {
            let place = p.form().place_in_words(p.spot);
            format!("{}{} {place}", p.form().words(), of_part(p))
        };
        self.parts().map(part).collect::<Vec<_>>().join(", and ")
    }
}

/// What the data draw.
#[derive(Debug, Clone)]
pub struct Localisation {
    /// Best first.
    pub places: Vec<LocalisedPlace>,
    /// Whether the best place explains more than chance, and the postures left out are predicted better with it.
    pub significant: bool,
    /// The model as it stands.
    pub baseline: Calibration,
    /// Its error on postures left out of the fit; `None` with one posture.
    pub baseline_held_out: Option<HeldOut>,
}

/// Share of what stands above the noise from which on a place is taken for the one.
const EXPLAINS: f64 = 0.8;

impl Localisation {
    /// Share of what stands above the noise that the best place explains, 0..1; `None` where nothing stands above it.
    pub fn explained_share(&self) -> Option<f64> {
        let above = self.baseline.reduced_chi2 - 1.0;
        let left = self.places.first()?.left - 1.0;
        (above > 0.0).then(|| (1.0 - left / above).clamp(0.0, 1.0))
    }

    /// That share, where the best place leaves so much that it may be the wrong one, or not the only one.
    pub fn partial_share(&self) -> Option<f64> {
        let is_partial = self.places.first()?.left > LEFT_OVER;
        self.explained_share()
            .filter(|share| is_partial && *share < EXPLAINS)
    }
}

/// Share of what stands above the noise that a place explains at least: where much is left that is no noise, every place takes some of it,
/// by more than noise could.
const LEAST_SHARE: f64 = 0.1;
/// Places that are refitted with a form, …
const FITTED: usize = 10;
/// … and such as promise most at each other starting point.
const FITTED_ELSEWHERE: usize = 5;
/// Forms of all places that are followed beyond their first steps.
const FOLLOWED: usize = 24;
/// Forms of a second displacement that are, and those of them that all data may have to judge.
const SECOND_FOLLOWED: usize = 6;
const SECOND_JUDGED: usize = 4;
/// Places whose curves leave the same to so many parts are one place to these data.
const SAME_LEFT: f64 = 1e-6;
/// Places at which a second displacement is tried, and displacements that are tried there.
const SECOND: [usize; 2] = [4, 2];
/// Squares per value that the best place leaves from which on two displacements may have something to explain …
const SECOND_FROM: f64 = 1.02;
/// … and from which on more than noise is left.
const LEFT_OVER: f64 = 1.1;
/// Times what the best place leaves, where that is next to nothing, from which on a second displacement does not help another.
const LEFT_FAR_MORE: f64 = 1.5;
/// Places whose best form is fitted to all data.
const SETTLED: usize = 4;
/// Lines of all postures together that the screen looks at.
const SCREENED_LINES: usize = 3000;
/// As many where the model is far off: most places are told apart there by far more than noise.
const SCREENED_ELSEWHERE: usize = 1000;
/// Share of the misfit that the leading form leaves at most to be fitted once more as the model itself is.
const TAKES_MOST: f64 = 0.7;
/// Forms of a place that are fitted to all data at most.
const CANDIDATES: usize = 3;
/// Places within this of the best one's 2 ln L are tied with it.
const TIED: f64 = 12.0;

const REFINE: Stopping = Stopping {
    max_iterations: 25,
    relative_decrease: 1e-6,
};
const REFIT_WITHOUT_FOLD: Stopping = Stopping {
    max_iterations: 6,
    relative_decrease: 1e-4,
};

/// Localises what `model` lacks on the data of `study`.
///
/// # Errors
/// A model that cannot be calibrated to the data.
pub fn localise(study: &StructureStudy, model: &StructureModel) -> Result<Localisation> {
    localise_from(study, model, study.calibrate(model)?)
}

/// As [`localise`], of a model that is calibrated already.
///
/// # Errors
/// A model without a response there.
pub fn localise_from(
    study: &StructureStudy,
    model: &StructureModel,
    baseline: Calibration,
) -> Result<Localisation> {
    let theta = &baseline.theta;
    let spots = free_spots(model);
    let lines: usize = study.data.blocks.iter().map(|b| b.frequency_hz.len()).sum();
    let every = |of: usize| lines.div_ceil(of).max(1);
    let thinned = study.data.thinned(every(SCREENED_LINES), 1);
    let mut screened = screen_at(model, theta, &thinned, &spots)?;
    let score = |s: &Screened| s.left_free.min(s.left_common);
    screened.sort_by(|a, b| score(a).total_cmp(&score(b)));

    let coarse_base = minimise(
        &study.problem(model, View::COARSE),
        theta,
        &model.bounds(),
        REFINE,
    )?;
    let values = study.real_values(Extent::Coarse) as f64;
    let starts = Starts::new(study, model, theta, led_astray(coarse_base.cost, values))?;
    let ties = ties(&screened);
    let place_of = |spot: Spot| screened.iter().position(|s| s.spot == spot).map(|i| ties[i]);
    let mut chosen: Vec<(usize, Sought)> = leaders(&screened, &ties, FITTED)
        .into_iter()
        .map(|i| (i, Sought::new(&screened[i], starts.clone())))
        .collect();
    // Where the model is far off, what is linear there says little: the nominal values may be nearer.
    let few = study.data.thinned(every(SCREENED_ELSEWHERE), 1);
    let elsewhere: Vec<Vec<Screened>> = starts
        .elsewhere
        .iter()
        .map(|at| screen_at(model, at, &few, &spots))
        .collect::<Result<_>>()?;
    for (k, there) in elsewhere.iter().enumerate() {
        for s in leaders(there, &self::ties(there), FITTED_ELSEWHERE) {
            let Some(place) = place_of(there[s].spot) else {
                continue;
            };
            if chosen.iter().all(|(known, _)| *known != place) {
                chosen.push((place, Sought::new(&there[s], starts.beginning_at(k))));
            }
        }
    }
    // A support that gives way leads the model far away, and what is linear there says least of it.
    let is_far = !starts.elsewhere.is_empty();
    let supports: Vec<(usize, Sought)> = unseen_supports(&screened, &ties, &chosen)
        .filter(|_| is_far)
        .map(|(i, form)| {
            let sought = Sought::new(&screened[i], starts.clone());
            let forms = vec![form];
            (i, Sought { forms, ..sought })
        })
        .collect();
    chosen.extend(supports);
    let own_forms = forms_of_its_own(&screened, &ties, &chosen);
    chosen.extend(own_forms);
    let base_count = model.parameters.len();
    let bic = |t: &Tried<Structure>| {
        2.0 * (t.fit.cost - coarse_base.cost) + (t.fit.theta.len() - base_count) as f64 * values.ln()
    };
    let better = |a: &Tried<Structure>, b: &Tried<Structure>| {
        let merit = |tried| merit(study, tried, base_count, Extent::Coarse);
        order(&merit(a), &merit(b))
    };
    let mut by_place: BTreeMap<usize, Vec<Tried<Structure>>> = BTreeMap::new();
    for (place, tried) in try_all(study, model, &chosen, place_of) {
        by_place.entry(place).or_default().push(tried);
    }
    let mut fitted: Vec<(usize, Vec<Tried<Structure>>)> = by_place
        .into_iter()
        .map(|(i, mut forms)| {
            forms.sort_by(better);
            // Found from another axis of its place as well.
            let mut known = Vec::new();
            forms.retain(|t| {
                let is_new = !known.contains(&t.instance.variant);
                known.push(t.instance.variant);
                is_new
            });
            (i, forms)
        })
        .collect();
    fitted.sort_by(|a, b| bic(&a.1[0]).total_cmp(&bic(&b.1[0])));
    let tests: usize =
        fitted.iter().map(|(_, forms)| forms.len()).sum::<usize>().max(1) * spots.len() / chosen.len().max(1);
    let least = fitted
        .first()
        .map_or(f64::INFINITY, |(_, forms)| forms[0].fit.cost);
    let is_enough = 2.0 * least <= SECOND_FROM * values;
    // Of a place that leaves next to nothing, what is found second is faint: sought at the best alone.
    let sought_at = if is_enough { 1 } else { SECOND[0] };
    // The coarse view shows too little of what is faint.
    let is_faint = 2.0 * least <= LEFT_OVER * values;
    let (extent, elsewhere) = match is_faint {
        // With the first in the model it is no longer far off.
        true => (Extent::Full, &[][..]),
        false => (Extent::Coarse, &starts.elsewhere[..]),
    };
    let merit = |tried: &Tried<Structure>| merit(study, tried, base_count, extent);
    let in_question = |forms: &[Tried<Structure>]| !is_faint || forms[0].fit.cost <= LEFT_FAR_MORE * least;
    let second: Vec<Option<Second>> = fitted
        .par_iter()
        .take(sought_at)
        .map(|(i, forms)| {
            if !in_question(forms) {
                return None;
            }
            let spot = screened[*i].spot;
            let mut found = second_form(study, (model, &thinned), forms, spot, elsewhere);
            if !is_faint {
                found.truncate(1);
            }
            let same = two_resonators(study, (model, &thinned), &forms[0], spot);
            found.extend(same.map(|tried| Second::Instead(spot, tried)));
            let judged = found
                .into_par_iter()
                .map(|second| (merit(second.tried()), second));
            let (best, second) = judged.min_by(|a, b| order(&a.0, &b.0))?;
            order(&best, &merit(&forms[0])).is_lt().then_some(second)
        })
        .collect();
    let mut fitted: Vec<Fitted> = fitted
        .into_iter()
        .map(|(place, forms)| Fitted {
            place,
            forms,
            pair: None,
        })
        .collect();
    for (k, second) in second.into_iter().enumerate() {
        match second {
            Some(Second::Beside(pair)) => fitted[k].pair = Some(pair),
            Some(Second::Instead(spot, tried)) => {
                let Some(place) = place_of(spot) else { continue };
                match fitted.iter_mut().find(|f| f.place == place) {
                    Some(known) => {
                        known.forms.retain(|t| t.instance != tried.instance);
                        known.forms.insert(0, tried);
                        if !is_faint {
                            known.forms.sort_by(better);
                        }
                    }
                    None => fitted.push(Fitted {
                        place,
                        forms: vec![tried],
                        pair: None,
                    }),
                }
            }
            None => (),
        }
    }
    fitted.sort_by(|a, b| bic(a.best()).total_cmp(&bic(b.best())));

    let without = Without {
        cost: minimise(&study.problem(model, View::FULL), theta, &model.bounds(), REFINE)?.cost,
        count: base_count,
        tests,
    };
    let mut settled: Vec<LocalisedPlace> = fitted
        .par_iter()
        .enumerate()
        .take(SETTLED)
        .map(|(number, fitted)| {
            let best = settled_form(study, screened[fitted.place].spot, fitted, &without, number == 0)?;
            let count = study.data.value_count() as f64;
            let (curve, consistency) = drawn_with(&best, &thinned)?;
            Ok(LocalisedPlace {
                left: best.cost / (count - 0.5 * best.theta.len() as f64).max(1.0),
                curve,
                consistency,
                ..place(&screened[fitted.place], &fitted.forms, &bic, Some(best))
            })
        })
        .collect::<Result<_>>()?;
    let bound = |p: &LocalisedPlace| p.best.as_ref().is_some_and(|b| b.at_bound);
    settled.sort_by(|a, b| bound(a).cmp(&bound(b)).then(rank(a).total_cmp(&rank(b))));
    let scale = settled.first().map_or(1.0, |best| best.left.max(1.0));
    let leader = settled.first().map(rank);
    for i in 0..settled.len() {
        let own = rank(&settled[i]);
        if (own - leader.unwrap_or(own)).abs() / scale < TIED {
            let others = settled
                .iter()
                .enumerate()
                .filter(|(j, other)| *j != i && (rank(other) - leader.unwrap_or(own)).abs() / scale < TIED);
            settled[i].tied_with = others.map(|(_, other)| other.spot.label()).collect();
        }
    }
    let without_folds = |model: &StructureModel, theta: &[f64]| {
        held_out(study, model, theta, Extent::Coarse, REFIT_WITHOUT_FOLD)
    };
    let in_question = settled.iter_mut().enumerate();
    let in_question = in_question.filter(|(i, place)| *i == 0 || !place.tied_with.is_empty());
    for best in in_question.filter_map(|(_, place)| place.best.as_mut()) {
        best.held_out = without_folds(&best.model, &best.theta)?;
    }
    let others = fitted.iter().skip(SETTLED);
    let fitted_only = others.map(|f| place(&screened[f.place], &f.forms, &bic, None));
    let mut places = settled.clone();
    places.extend(fitted_only);
    let known: Vec<Spot> = places.iter().map(|p| p.spot).collect();
    places.extend(
        screened
            .iter()
            .filter(|s| !known.contains(&s.spot))
            .map(|s| place(s, &[], &bic, None)),
    );
    for place in &mut places {
        let own = screened.iter().position(|s| s.spot == place.spot);
        // Those that were fitted themselves are tied where their fits are.
        let same = |(i, s): &(usize, &Screened)| {
            s.spot != place.spot && !known.contains(&s.spot) && own.is_some_and(|own| ties[*i] == ties[own])
        };
        let tied = screened.iter().enumerate().filter(same);
        place.tied_with.extend(tied.map(|(_, s)| s.spot.label()));
    }
    let baseline_held_out = without_folds(model, theta)?;
    let significant = settled.first().and_then(|p| p.best.as_ref()).is_some_and(|best| {
        let predicts = match (&best.held_out, &baseline_held_out) {
            (Some(with), Some(without)) => with.chi2 < without.chi2,
            _ => true,
        };
        predicts && !best.at_bound && is_convincing(best.p_value, best.delta_bic)
    });
    let mut found = Localisation {
        places,
        significant,
        baseline,
        baseline_held_out,
    };
    found.significant &= found.explained_share().is_none_or(|share| share > LEAST_SHARE);
    Ok(found)
}

/// Each form of each place followed as far as it promises, with its place: that of the axis it mostly follows.
fn try_all(
    study: &StructureStudy,
    model: &StructureModel,
    chosen: &[(usize, Sought)],
    place_of: impl Fn(Spot) -> Option<usize>,
) -> Vec<(usize, Tried<Structure>)> {
    let look_at = |leading: bool, at: &(dyn Fn(usize) -> bool + Sync)| {
        let there = chosen.par_iter().filter(|(place, _)| at(*place));
        let each = there.flat_map_iter(|(place, sought)| {
            let forms = sought.look(study, model, &sought.part(leading));
            forms.into_iter().map(|form| (*place, form))
        });
        each.collect::<Vec<(usize, Looked<Structure>)>>()
    };
    let mut looked = look_at(true, &|_| true);
    let cost = |(_, looked): &(usize, Looked<Structure>)| looked.fits[0].cost;
    let lowest = looked.iter().map(cost).fold(f64::INFINITY, f64::min);
    let in_race: Vec<usize> = looked
        .iter()
        .filter(|form| cost(form) <= OUT_OF_RACE * lowest)
        .map(|(place, _)| *place)
        .collect();
    looked.extend(look_at(false, &|place| in_race.contains(&place)));
    let (own, looked): (Vec<usize>, Vec<Looked<Structure>>) = looked.into_iter().unzip();
    let followed = own.into_iter().zip(race(study, looked, FOLLOWED));
    let each = followed.filter_map(|(place, tried)| {
        let tried = tried?;
        let renamed = along_its_axis(study, model, &tried);
        Some(
            renamed
                .and_then(|(spot, renamed)| Some((place_of(spot)?, renamed)))
                .unwrap_or((place, tried)),
        )
    });
    each.collect()
}

/// Every one of `spots` without a law, at a point of the model (solver's scale).
fn screen_at(model: &StructureModel, theta: &[f64], data: &FrfData, spots: &[Spot]) -> Result<Vec<Screened>> {
    let responses = SpotResponses::new(model, theta, data, spots)?;
    Ok(screen::screen(&responses, &model.parameters, theta))
}

/// The dynamic stiffness that the data ask for where `best` is, and its scatter over postures: its law and what they want beyond it.
/// Without it the model's parameters stand for a part of what is missing, and where much is, what is drawn from there is not the law.
fn drawn_with(best: &BestForm, data: &FrfData) -> Result<(Vec<CurvePoint>, f64)> {
    let DrawnPart { spot, parameters, .. } = &best.first;
    let values: Vec<f64> = parameters.iter().map(|p| p.value).collect();
    let responses = SpotResponses::new(&best.model, &best.theta, data, &[*spot])?;
    let law = |frequency_hz| drawn::dynamic_stiffness(*spot, best.first.form(), &values, frequency_hz);
    Ok(screen::draw_beyond(&responses, law))
}

/// Order of the settled places, those whose form ran to the end of its range last: BIC on all data.
fn rank(place: &LocalisedPlace) -> f64 {
    place.best.as_ref().map_or(f64::INFINITY, |b| b.delta_bic)
}

/// By place, the first that leaves the same by both measures: kinematics makes them one (the base and the bearing of joint 1).
fn ties(screened: &[Screened]) -> Vec<usize> {
    let same = |a: f64, b: f64| (a - b).abs() <= SAME_LEFT * b;
    let is_tied = |a: &Screened, b: &Screened| {
        a.spot.is_series() == b.spot.is_series()
            && same(a.left_free, b.left_free)
            && same(a.left_common, b.left_common)
    };
    let first = |s: &Screened| screened.iter().position(|other| is_tied(s, other));
    let own = screened.iter().enumerate();
    own.map(|(i, s)| first(s).unwrap_or(i)).collect()
}

/// The best `count` of the screen by either measure, one of each that are tied.
fn leaders(screened: &[Screened], ties: &[usize], count: usize) -> Vec<usize> {
    let best_by = |score: fn(&Screened) -> f64| {
        let mut order: Vec<usize> = (0..screened.len()).filter(|&i| ties[i] == i).collect();
        order.sort_by(|a, b| score(&screened[*a]).total_cmp(&score(&screened[*b])));
        order
    };
    let (free, common) = (best_by(|s| s.left_free), best_by(|s| s.left_common));
    let mut chosen = Vec::new();
    for (a, b) in free.into_iter().zip(common) {
        for i in [a, b] {
            if !chosen.contains(&i) && chosen.len() < count {
                chosen.push(i);
            }
        }
    }
    chosen
}

fn place(
    screened: &Screened,
    forms: &[Tried<Structure>],
    bic: &impl Fn(&Tried<Structure>) -> f64,
    best: Option<BestForm>,
) -> LocalisedPlace {
    LocalisedPlace {
        spot: screened.spot,
        left: screened.left_free.min(screened.left_common),
        consistency: screened.consistency,
        curve: screened.curve.clone(),
        forms: forms
            .iter()
            .map(|t| FormFit {
                form: drawn::form_of(t.instance.variant),
                delta_bic: bic(t),
            })
            .collect(),
        best,
        tied_with: Vec::new(),
    }
}

/// The supports that are not among the chosen places, by their number, with what is tried at them.
fn unseen_supports<'a>(
    screened: &'a [Screened],
    ties: &'a [usize],
    chosen: &'a [(usize, Sought)],
) -> impl Iterator<Item = (usize, DrawnForm)> + 'a {
    screened.iter().enumerate().filter_map(move |(i, support)| {
        let form = support_form(support.spot)?;
        let is_known = |own: usize| chosen.iter().any(|(known, _)| *known == own);
        // What leans does so from any axis of its place: from the one that promises most.
        let leans = form == DrawnForm::ObliqueSpringDamper;
        let shares = |(other, s): (usize, &Screened)| {
            (other < i || is_known(other)) && s.spot.shares_place_with(support.spot)
        };
        let is_sought = is_known(i) || (leans && screened.iter().enumerate().any(shares));
        (ties[i] == i && !is_sought).then_some((i, form))
    })
}

/// What stands at places that kinematics makes one with the chosen, and can be only there: a rotor behind the gear of joint 1, but not
/// under the base.
fn forms_of_its_own<'a>(
    screened: &'a [Screened],
    ties: &[usize],
    chosen: &[(usize, Sought<'a>)],
) -> Vec<(usize, Sought<'a>)> {
    let at_tied = chosen.iter().flat_map(|(place, sought)| {
        let others = screened.iter().enumerate();
        let tied = others.filter(move |(i, _)| i != place && ties[*i] == ties[*place]);
        tied.map(|(i, other)| {
            let mut own = Sought::new(other, sought.starts.clone());
            own.forms
                .retain(|form| !drawn::forms(sought.screened.spot).contains(form));
            (i, own)
        })
    });
    at_tied.filter(|(_, own)| !own.forms.is_empty()).collect()
}

/// What is tried wherever a support may give way, along the axis of a bearing or alike both ways across it, or one be there that the
/// model does not have. `None` for what turns with a joint, and where one way across is the other's.
fn support_form(spot: Spot) -> Option<DrawnForm> {
    match spot {
        Spot::Base(2) | Spot::Bearing(_, 2) => Some(DrawnForm::Spring),
        Spot::ToolGround(_) | Spot::LinkGround(..) => Some(DrawnForm::ObliqueSpringDamper),
        _ => spot.alike().map(|_| DrawnForm::IsotropicSpring),
    }
}

/// The forms that are sought at a place.
struct Sought<'a> {
    /// What was seen there, from where the fits begin.
    screened: &'a Screened,
    starts: Starts,
    forms: Vec<DrawnForm>,
}

impl<'a> Sought<'a> {
    /// All that it can have.
    fn new(screened: &'a Screened, starts: Starts) -> Self {
        Sought {
            screened,
            forms: drawn::forms(screened.spot),
            starts,
        }
    }

    /// The `leading` forms, which have others as their special cases or stand alone, or the others: these are not needed at a place where
    /// the leading ones leave far too much.
    fn part(&self, leading: bool) -> Vec<DrawnForm> {
        let leads = |form: &DrawnForm| {
            matches!(
                form,
                DrawnForm::SpringDamper
                    | DrawnForm::Resonator
                    | DrawnForm::Maxwell
                    | DrawnForm::ObliqueSpringDamper
                    | DrawnForm::RotorOnSpring
                    | DrawnForm::FloorMode
                    | DrawnForm::IsotropicSpringDamper
            )
        };
        let all_lead = !self.forms.iter().any(leads);
        let forms = self.forms.iter().copied();
        forms
            .filter(|form| (all_lead || leads(form)) == leading)
            .collect()
    }

    /// The first steps of the fit of each of `forms`, started from the drawn curve.
    fn look(
        &self,
        study: &StructureStudy,
        model: &StructureModel,
        forms: &[DrawnForm],
    ) -> Vec<Looked<Structure>> {
        let (from, screened) = (&self.starts, self.screened);
        let bounds = model.bounds();
        let moved: Vec<f64> = from
            .theta
            .iter()
            .zip(&screened.step)
            .zip(&bounds)
            .map(|((t, d), b)| (t + d.clamp(-1.0, 1.0)).clamp(b[0], b[1]))
            .collect();
        let mut bases = vec![from.theta.clone(), moved];
        bases.extend(from.elsewhere.iter().cloned());
        let effort = match from.elsewhere.is_empty() {
            true => Effort::Direct,
            false => Effort::StagedAtAGlance,
        };
        forms
            .par_iter()
            .filter_map(|&form| {
                let instance = drawn::instance(screened.spot, form);
                let extended = study.extend(model, &instance);
                let own = &extended.parameters[model.parameters.len()..];
                let proposed = instance
                    .effect
                    .starts(instance.at(), &study.known(model), &from.peaks_hz);
                // A resonator is found from near its frequency only.
                let most = if form == DrawnForm::Resonator { 12 } else { 4 };
                let alike = from
                    .stiffness
                    .filter(|_| !screened.spot.is_angle())
                    .and_then(|k| match form {
                        DrawnForm::Spring => Some(vec![k]),
                        DrawnForm::SpringDamper => Some(vec![k, 1e-3 * k]),
                        DrawnForm::LossFactor => Some(vec![k, 0.05]),
                        _ => None,
                    });
                let usual = own.iter().map(|p| p.nominal).collect();
                let starts: Vec<Vec<f64>> = starting_values(form, screened)
                    .into_iter()
                    .chain(alike)
                    .chain([usual])
                    .chain(proposed.into_iter().take(most))
                    .map(|start| own.iter().zip(start).map(|(p, v)| p.internal_within(v)).collect())
                    .collect();
                let fits = look(study, &extended, &bases, &starts, effort).ok()?;
                Some(Looked {
                    instance,
                    model: extended,
                    fits,
                })
            })
            .collect()
    }
}

/// What was fitted at a place.
struct Fitted {
    /// Index of the screened place.
    place: usize,
    /// Each form alone, best first.
    forms: Vec<Tried<Structure>>,
    /// Where that explains more.
    pair: Option<Pair>,
}

impl Fitted {
    fn best(&self) -> &Tried<Structure> {
        self.pair.as_ref().map_or(&self.forms[0], |pair| &pair.tried)
    }
}

/// Two forms at two displacements of one place.
struct Pair {
    first: Instance<Structure>,
    /// Parameters of the model with the first.
    first_count: usize,
    second: Spot,
    /// The second, with the first in the model.
    tried: Tried<Structure>,
}

/// What a second displacement of a place gives.
enum Second {
    /// Both are needed.
    Beside(Pair),
    /// It explains as much without the first.
    Instead(Spot, Tried<Structure>),
}

impl Second {
    fn tried(&self) -> &Tried<Structure> {
        match self {
            Second::Beside(pair) => &pair.tried,
            Second::Instead(_, tried) => tried,
        }
    }
}

/// From where the model's parameters are fitted.
#[derive(Clone)]
struct Starts {
    theta: Vec<f64>,
    /// Further points: where what is missing may have led `theta` away, the nominal values and what the measured modes say.
    elsewhere: Vec<Vec<f64>>,
    /// Where the residual is largest, Hz.
    peaks_hz: Vec<f64>,
    /// What another displacement of the place has, N/m: a bearing is often as stiff one way as the other.
    stiffness: Option<f64>,
}

impl Starts {
    /// The same points, that of number `k` elsewhere first.
    fn beginning_at(&self, k: usize) -> Self {
        let mut elsewhere = self.elsewhere.clone();
        let theta = std::mem::replace(&mut elsewhere[k], self.theta.clone());
        Starts {
            theta,
            elsewhere,
            ..self.clone()
        }
    }

    fn new(study: &StructureStudy, model: &StructureModel, theta: &[f64], astray: bool) -> Result<Self> {
        Ok(Starts {
            theta: theta.to_vec(),
            peaks_hz: study.hints(model, theta)?,
            elsewhere: match astray {
                true => starts_elsewhere(model, study.measured()),
                false => Vec::new(),
            },
            stiffness: None,
        })
    }
}

fn at_bound(fit: &Fit, base_count: usize) -> bool {
    (base_count..fit.theta.len()).any(|i| fit.at_bound.contains(&i))
}

/// How good a fit is, the less the better: whether a size ran to the end of its range, since a form whose size did stands for another;
/// then BIC. On the coarse view, on which it was made, or fitted again to all data.
fn merit(study: &StructureStudy, tried: &Tried<Structure>, base_count: usize, extent: Extent) -> (bool, f64) {
    let values = study.real_values(extent) as f64;
    let of = |fit: &Fit| {
        let bic = 2.0 * fit.cost + fit.theta.len() as f64 * values.ln();
        (at_bound(fit, base_count), bic)
    };
    let Tried { model, fit, .. } = tried;
    match extent {
        Extent::Full => {
            let problem = study.problem(model, View::FULL);
            let fit = minimise(&problem, &fit.theta, &model.bounds(), REFINE);
            fit.as_ref().map_or((true, f64::INFINITY), of)
        }
        _ => of(fit),
    }
}

fn order(a: &(bool, f64), b: &(bool, f64)) -> std::cmp::Ordering {
    a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
}

/// A second form beside the best of `forms`, at the displacement of the same place that promises most with the first in the model;
/// fitted from `elsewhere`, too, points of the model without either. `bare`: that model, and thinned data. Best first by the coarse view.
fn second_form(
    study: &StructureStudy,
    (bare, thinned): (&StructureModel, &FrfData),
    forms: &[Tried<Structure>],
    spot: Spot,
    elsewhere: &[Vec<f64>],
) -> Vec<Second> {
    let base_count = bare.parameters.len();
    // Two resonators at one displacement may have stood for one at each of two.
    let law = |t: &Tried<Structure>| drawn::form_of(t.instance.variant);
    let first = match law(&forms[0]) {
        // It has its direction in all three already.
        DrawnForm::ObliqueSpringDamper => None,
        DrawnForm::TwoResonators => forms.iter().find(|t| law(t) == DrawnForm::Resonator),
        // Its stiffness along the second axis may be another one.
        form if form.is_isotropic() => forms.iter().find(|t| !law(t).is_isotropic()),
        _ => forms.first(),
    };
    let Some(first) = first else { return Vec::new() };
    let (model, theta) = (&first.model, &first.fit.theta);
    let spots: Vec<Spot> = free_spots(model)
        .into_iter()
        .filter(|other| other.shares_place_with(spot))
        .collect();
    let Ok(mut promising) = screen_at(model, theta, thinned, &spots) else {
        return Vec::new();
    };
    promising.sort_by(|a, b| a.left_free.total_cmp(&b.left_free));
    let own = &theta[base_count..];
    let starts = Starts {
        theta: theta.clone(),
        elsewhere: elsewhere.iter().map(|at| [at, own].concat()).collect(),
        peaks_hz: study.hints(model, theta).unwrap_or_default(),
        stiffness: first_stiffness(first, base_count),
    };
    let looked = promising.iter().take(SECOND[1]).flat_map(|second| {
        let mut sought = Sought::new(second, starts.clone());
        sought.forms.retain(|form| !form.is_isotropic());
        let forms = sought.look(study, model, &sought.forms);
        forms.into_iter().map(|form| (second.spot, form))
    });
    let (spots, looked): (Vec<Spot>, Vec<Looked<Structure>>) = looked.unzip();
    let mut pairs: Vec<Pair> = spots
        .into_iter()
        .zip(race(study, looked, SECOND_FOLLOWED))
        .filter_map(|(second, tried)| {
            Some(Pair {
                first: first.instance,
                first_count: theta.len(),
                second,
                tried: tried?,
            })
        })
        .collect();
    let merit = |tried: &Tried<Structure>| merit(study, tried, base_count, Extent::Coarse);
    pairs.sort_by(|a, b| order(&merit(&a.tried), &merit(&b.tried)));
    let alone = pairs.first().and_then(|pair| {
        let alone = without_the_first(study, bare, pair)?;
        let is_enough = order(&merit(&alone), &merit(&pair.tried)).is_lt();
        is_enough.then_some(Second::Instead(pair.second, alone))
    });
    let pairs = pairs.into_iter().map(Second::Beside);
    alone.into_iter().chain(pairs).take(SECOND_JUDGED).collect()
}

/// A second resonator at the displacement where `first` is one, started from what is left with that.
fn two_resonators(
    study: &StructureStudy,
    (bare, thinned): (&StructureModel, &FrfData),
    first: &Tried<Structure>,
    spot: Spot,
) -> Option<Tried<Structure>> {
    if drawn::form_of(first.instance.variant) != DrawnForm::Resonator {
        return None;
    }
    let left = screen_at(&first.model, &first.fit.theta, thinned, &[spot])
        .ok()?
        .pop()?;
    let (base, own) = first.fit.theta.split_at(bare.parameters.len());
    let instance = drawn::instance(spot, DrawnForm::TwoResonators);
    let extended = study.extend(bare, &instance);
    let of_second = &extended.parameters[base.len() + own.len()..];
    let starts: Vec<Vec<f64>> = screen::resonators(&left.curve, 3)
        .into_iter()
        .map(|second| {
            let second = of_second.iter().zip(second);
            let second = second.map(|(p, v)| p.internal_within(v));
            own.iter().copied().chain(second).collect()
        })
        .collect();
    let fits = look(study, &extended, &[base.to_vec()], &starts, Effort::Direct).ok()?;
    let looked = Looked {
        instance,
        model: extended,
        fits,
    };
    race(study, vec![looked], 1).pop()?
}

/// The second form of a pair alone, from where it stands beside the first.
fn without_the_first(study: &StructureStudy, bare: &StructureModel, pair: &Pair) -> Option<Tried<Structure>> {
    let both = &pair.tried.fit.theta;
    let start = [&both[..bare.parameters.len()], &both[pair.first_count..]].concat();
    fit_from(study, bare, &pair.tried.instance, &start, View::COARSE, REFINE).ok()
}

/// The stiffness of a form that is a spring or has one, N/m.
fn first_stiffness(first: &Tried<Structure>, base_count: usize) -> Option<f64> {
    let parameter = first.model.parameters.get(base_count)?;
    let is_stiffness = parameter.name.ends_with("stiffness_n_per_m");
    is_stiffness.then(|| parameter.natural(first.fit.theta[base_count]))
}

/// A fitted form whose direction mostly follows another axis than the one it was started along, named after that.
fn along_its_axis(
    study: &StructureStudy,
    model: &StructureModel,
    tried: &Tried<Structure>,
) -> Option<(Spot, Tried<Structure>)> {
    let Site::At(spot) = tried.instance.site else {
        return None;
    };
    let count = model.parameters.len();
    let (front, own) = tried.fit.theta.split_at(count);
    let own = tried.model.parameters[count..].iter().zip(own);
    let own: Vec<f64> = own.map(|(p, t)| p.natural(*t)).collect();
    let form = drawn::form_of(tried.instance.variant);
    let (spot, values) = drawn::along_its_axis(spot, form, &own)?;
    let instance = drawn::instance(spot, form);
    let own = study.extend(model, &instance).parameters[count..]
        .iter()
        .zip(values)
        .map(|(p, v)| p.internal_within(v))
        .collect::<Vec<f64>>();
    let start = [front, &own].concat();
    let renamed = fit_from(study, model, &instance, &start, View::COARSE, REFINE).ok()?;
    Some((spot, renamed))
}

/// Starting values of a form from the drawn curve, natural units in the order of its parameters.
fn starting_values(form: DrawnForm, screened: &Screened) -> Vec<Vec<f64>> {
    let (mut weight, mut re, mut im) = (0.0, 0.0, 0.0);
    let (mut along, mut square, mut inertia, mut fourth) = (0.0, 0.0, 0.0, 0.0);
    for point in screened.curve.iter().filter(|p| p.std.is_finite() && p.std > 0.0) {
        let w = 1.0 / (point.std * point.std);
        let omega = std::f64::consts::TAU * point.frequency_hz;
        weight += w;
        re += w * point.stiffness.re;
        im += w * point.stiffness.im;
        along += w * omega * point.stiffness.im;
        square += w * omega * omega;
        inertia -= w * omega * omega * point.stiffness.re;
        fourth += w * omega.powi(4);
    }
    if !(weight > 0.0) {
        return Vec::new();
    }
    let (spring, damper, mass) = (re / weight, along / square, inertia / fourth);
    let loss = im / weight;
    // Re z = k − ω² m by least squares.
    let rotor = (inertia * weight + square * re) / (weight * fourth - square * square);
    let stiff = (re + rotor * square) / weight;
    match form {
        DrawnForm::Spring | DrawnForm::IsotropicSpring => vec![vec![spring]],
        DrawnForm::Damper => vec![vec![damper]],
        DrawnForm::SpringDamper | DrawnForm::IsotropicSpringDamper => vec![vec![spring, damper]],
        DrawnForm::Mass => vec![vec![mass]],
        DrawnForm::LossFactor if matches!(screened.spot, Spot::Joint(_)) => vec![vec![loss]],
        DrawnForm::LossFactor => vec![vec![spring, (loss / spring).abs()]],
        DrawnForm::Resonator => screen::resonators(&screened.curve, 3)
            .into_iter()
            .map(Vec::from)
            .collect(),
        DrawnForm::TwoResonators => {
            let single = screen::resonators(&screened.curve, 3);
            let mut pairs = Vec::new();
            for (i, a) in single.iter().enumerate() {
                pairs.extend(single[i + 1..].iter().map(|b| [*a, *b].concat()));
            }
            pairs
        }
        DrawnForm::Maxwell => vec![vec![spring.abs(), spring.abs() / 100.0]],
        DrawnForm::ObliqueSpringDamper => drawn::leaning(&[spring.abs(), damper.abs()]),
        DrawnForm::RotorOnSpring => vec![
            vec![spring.abs(), damper, mass.abs()],
            vec![stiff.abs(), damper.abs(), rotor.abs()],
        ],
        DrawnForm::FloorMode => {
            let natural = (stiff / rotor).abs().sqrt();
            let ratio = damper.abs() / (2.0 * rotor.abs() * natural);
            drawn::leaning(&[rotor.abs(), natural / std::f64::consts::TAU, ratio])
        }
    }
}

/// What the forms of all places are held against.
struct Without {
    /// On all data, of the model without any.
    cost: f64,
    /// Its parameters.
    count: usize,
    /// Forms and places that were tried.
    tests: usize,
}

/// The best form of a place fitted to all data. One whose size runs to the end of its range there stands for another: then the next.
/// Where the one that `leads` takes most and still leaves more than noise, it may be stuck on its way: fitted as the model itself is.
fn settled_form(
    study: &StructureStudy,
    spot: Spot,
    fitted: &Fitted,
    without: &Without,
    leads: bool,
) -> Result<BestForm> {
    let values = study.real_values(Extent::Full) as f64;
    let alone = fitted.forms.iter().map(|tried| (tried, None));
    let pair = fitted.pair.iter().map(|pair| (&pair.tried, Some(pair)));
    let mut first = None;
    for (tried, pair) in pair.chain(alone).take(CANDIDATES) {
        let problem = study.problem(&tried.model, View::FULL);
        let mut fit = minimise(&problem, &tried.fit.theta, &tried.model.bounds(), REFINE)?;
        if !at_bound(&fit, without.count) {
            if leads && 2.0 * fit.cost > LEFT_OVER * values && fit.cost < TAKES_MOST * without.cost {
                let again = fit_as_a_model(study, &tried.model, &fit.theta, REFINE)?;
                if again.cost < fit.cost {
                    fit = again;
                }
            }
            return settle(study, spot, (tried, pair), fit, without);
        }
        first.get_or_insert((tried, pair, fit));
    }
    let (tried, pair, fit) = first.ok_or_else(|| crate::Error::computation("no form was fitted"))?;
    settle(study, spot, (tried, pair), fit, without)
}

/// A form at `spot`, or two at its place, at the `fit` to all data: judged.
fn settle(
    study: &StructureStudy,
    spot: Spot,
    (tried, pair): (&Tried<Structure>, Option<&Pair>),
    fit: Fit,
    without: &Without,
) -> Result<BestForm> {
    let (model, base_count) = (&tried.model, without.count);
    let values = study.real_values(Extent::Full) as f64;
    let extra = (fit.theta.len() - base_count) as f64;
    let reduced = 2.0 * fit.cost / (values - fit.theta.len() as f64).max(1.0);
    let residual = study.residual(model, &fit.theta)?;
    // What is left scales what counts as chance, and neighbours that move together count once.
    let share = residual.independent_share.min(1.0);
    let gain = (2.0 * (without.cost - fit.cost) * share / reduced.max(1.0)).max(0.0);
    let single = ChiSquared::new(extra).map_or(1.0, |d| d.sf(gain));
    let all = estimates(&model.parameters, &fit, reduced)?;
    let part = |spot, instance, own: std::ops::Range<usize>| DrawnPart {
        spot,
        instance,
        parameters: all[own].to_vec(),
    };
    let (first, second) = match pair {
        Some(pair) => (
            part(spot, pair.first, base_count..pair.first_count),
            Some(part(pair.second, tried.instance, pair.first_count..all.len())),
        ),
        None => (part(spot, tried.instance, base_count..all.len()), None),
    };
    Ok(BestForm {
        first,
        second,
        cost: fit.cost,
        delta_bic: extra * (share * values).ln() - gain,
        p_value: (single * without.tests as f64).min(1.0),
        at_bound: at_bound(&fit, base_count),
        held_out: None,
        theta: fit.theta,
        model: model.clone(),
    })
}
