//! Tries every mistake on a fitted model.

use std::borrow::Cow;
use std::cell::LazyCell;

use rayon::prelude::*;

use super::apart::posture_apart;
use super::decide::{Noise, Rival, Rivals, TriedMistake, decide};
use super::finding::SetupFinding;
use super::fit::JointProblem;
use super::group::FrfGroup;
use super::mistake::{Estimated, Mistake, Score};
use super::reading::{FileReading, model_read};
use super::score::Linearised;
use super::{mistakes, numbers, readings, slips};
use crate::identify::frfs::calibrate::{Options, calibrate};
use crate::identify::frfs::frf_data::FrfData;
use crate::identify::frfs::frf_problem::FrfProblem;
use crate::identify::frfs::structure_study::{led_astray, small_errors, starts_elsewhere};
use crate::identify::levenberg_marquardt::{Fit, Stopping, minimise};
use crate::identify::rest::BeyondSlips;
use crate::identify::study::{Study, View, try_effects};
use crate::identify::{StructureModel, StructureStudy};
use crate::{Error, Result};

/// What was found.
#[derive(Debug, Clone, Default)]
pub struct SetupCheck {
    /// Most likely first.
    pub findings: Vec<SetupFinding>,
    /// How many of the last findings are [`Self::taken_out`].
    pub(super) last_taken_out: usize,
    /// Weighted misfit per value that the first finding leaves; of the model as it stands where there is none.
    pub reduced_chi2: f64,
    /// Share of what stands above the noise that the first finding explains, 0..1.
    pub explained_share: f64,
}

impl SetupCheck {
    /// What is told where a check failed: it is not one that found nothing.
    pub fn failed(error: &Error) -> String {
        format!("the files were not looked at for mistakes of the setup: {error}")
    }

    /// The finding that is believed and still in the measurements, if one is.
    pub fn likely(&self) -> Option<&SetupFinding> {
        self.still_there().first().filter(|f| f.is_likely())
    }

    /// Findings that are in the measurements as they were fitted.
    pub fn still_there(&self) -> &[SetupFinding] {
        &self.findings[..self.findings.len() - self.last_taken_out]
    }

    /// Findings that have been taken out of the measurements already: they are told, and no effect has to be doubted for them.
    pub fn taken_out(&self) -> &[SetupFinding] {
        &self.findings[self.findings.len() - self.last_taken_out..]
    }
}

/// Complex values that mistakes are tried on, about.
const THIN_VALUES: usize = 4000;
/// Complex values that mistakes are fitted to at most, about (ten campaigns of 54 FRFs and 436 lines).
const MOST_VALUES: usize = 240_000;
/// Decrease of χ² below which nothing is followed.
const LEAST_GAIN: f64 = 30.0;
/// Mistakes with a size that are fitted to the end on few lines, from where the model stands …
const FITTED: usize = 6;
/// … and from other places, where it may have been led astray: there the model is no optimum, and the order of promises a rough one.
const FITTED_ELSEWHERE: usize = 24;
/// Of those from one place, such as are followed beyond their first steps.
const FOLLOWED: usize = 8;
/// Readings that are fitted, for each starting point of the model.
const READ: usize = 6;
/// Share of all disagreement from which on a reading is fitted from the nominal values, too.
const PLAIN_READING: f64 = 0.1;
/// Relative standard deviation of the noise's variance as the lines of FRFs against one another show it.
const NOISE_KNOWN_TO: f64 = 0.05;
/// Share of χ² below which a reading has explained nearly all …
const NEARLY_ALL: f64 = 0.1;
/// … and χ² per value from which on more than noise is left.
const LEFT_OVER: f64 = 1.1;
/// Share of what stands above the noise on few lines below which a mistake is not followed: half of what is no explanation yet.
const HOPELESS_SHARE: f64 = 0.2;
/// Trials that are fitted to all data.
const REFINED: usize = 3;

const ROUGH: Stopping = Stopping {
    max_iterations: 12,
    relative_decrease: 1e-4,
};
const FIRST_STEPS: Stopping = Stopping {
    max_iterations: 4,
    ..ROUGH
};
const FINE: Stopping = Stopping {
    max_iterations: 6,
    relative_decrease: 1e-6,
};

/// What a trial changes.
enum Cause<'a> {
    Size(&'a dyn Mistake, FrfGroup, Vec<f64>),
    Read(&'a dyn FileReading),
}

struct Trial<'a> {
    cause: Cause<'a>,
    theta: Vec<f64>,
    /// χ² with the priors on the thinned data.
    chi2: f64,
    parameters: usize,
}

impl Trial<'_> {
    /// χ² with what a parameter has to pay for.
    fn price(&self, values: usize) -> f64 {
        self.chi2 + self.parameters as f64 * (values as f64).ln()
    }
}

/// Tries the mistakes on `model` at `theta`, its optimum on `data`. `beyond_slips`: what small errors take there, where that is
/// known already. `measured`: a starting point of the model that the measured modes give, solver's scale. `rival` is asked for only where
/// something is found.
///
/// # Errors
/// A model without a response.
pub fn examine(
    model: &StructureModel,
    data: &FrfData,
    theta: &[f64],
    beyond_slips: Option<&BeyondSlips>,
    measured: Option<&[f64]>,
    rival: impl FnOnce() -> Option<Rival>,
) -> Result<SetupCheck> {
    let mut check = SetupCheck {
        findings: numbers::without_model(data, &model.points),
        ..SetupCheck::default()
    };
    let whole = data;
    let data = &*enough(whole);
    let share = data.value_count() as f64 / whole.value_count() as f64;
    let thin = thinned(data);
    let values = 2 * thin.value_count();
    let base = cost(model, &thin, theta)?;
    let all = mistakes::all(model, &thin);
    let (mut elsewhere, mut apart) = (Vec::new(), None);
    let is_astray = led_astray(base, values as f64);
    if is_astray {
        elsewhere = starts_elsewhere(model, measured);
        apart = posture_apart(model, &thin, theta, measured);
    }
    // What is wrong at one posture shows best from where the others put the model.
    elsewhere.extend(apart.as_ref().map(|a| a.theta.clone()));
    let mut trials = sized(model, &thin, theta, &elsewhere, &all)?;
    let nominal = model.nominal_theta();
    let mut starts = vec![theta];
    starts.extend(apart.as_ref().map(|a| a.theta.as_slice()));
    let read = readings::proposed(model, &thin, &[&starts[..], &[&nominal]].concat(), READ)?;
    trials.extend(read_trials(model, &thin, &starts, measured, &read, base)?);
    // Few lines tell how much it explains where much is to be explained.
    let hopeless = match is_astray {
        true => HOPELESS_SHARE * (2.0 * base - values as f64),
        false => 0.0,
    };
    trials.retain(|t| 2.0 * base - t.chi2 > hopeless.max(LEAST_GAIN));
    trials.sort_by(|a, b| a.price(values).total_cmp(&b.price(values)));
    let full_base = 2.0 * cost(model, data, theta)?;
    check.reduced_chi2 = full_base / (2 * data.value_count()) as f64;
    let tried: Vec<TriedMistake> = trials
        .iter()
        .take(REFINED)
        .collect::<Vec<_>>()
        .par_iter()
        .filter_map(|t| refined(model, data, t, measured, full_base).ok())
        .collect();
    let library = LazyCell::new(rival);
    let rivals = || Rivals {
        library: LazyCell::force(&library).clone(),
        small_errors: match beyond_slips {
            Some(known) => Some(share * known.gain()),
            None => slips::gain(model, data, theta).ok(),
        },
    };
    let noise = Noise {
        values: 2 * data.value_count(),
        known_to: NOISE_KNOWN_TO,
        small_errors: small_errors(data),
    };
    if let Some(decision) = decide(&tried, full_base, noise, rivals) {
        check.reduced_chi2 = decision.reduced_chi2;
        check.explained_share = decision.explained_share;
        check.findings.extend(decision.findings);
    }
    if let Some(apart) = apart
        && !check.findings.iter().any(SetupFinding::is_likely)
    {
        check.findings.extend(apart.finding(data, library.as_ref()));
    }
    check
        .findings
        .sort_by(|a, b| b.confidence.total_cmp(&a.confidence));
    Ok(check)
}

/// As many lines of every FRF as tell a mistake for certain: of thousands of FRFs not all are needed, and a check that took
/// longer than the fit itself would not be made.
fn enough(data: &FrfData) -> Cow<'_, FrfData> {
    match data.value_count() / MOST_VALUES {
        0 => Cow::Borrowed(data),
        times => Cow::Owned(data.thinned(times + 1, 1)),
    }
}

/// Few lines of every FRF, for many trials.
fn thinned(data: &FrfData) -> FrfData {
    let lines = data
        .blocks
        .iter()
        .map(|b| b.frequency_hz.len())
        .min()
        .unwrap_or(0);
    let stride = data
        .value_count()
        .div_ceil(THIN_VALUES)
        .min((lines / 80).max(1))
        .max(1);
    data.thinned(stride, 1)
}

fn cost(model: &StructureModel, data: &FrfData, theta: &[f64]) -> Result<f64> {
    use crate::identify::levenberg_marquardt::LeastSquares;
    FrfProblem::likelihood(model, data).cost(theta)
}

/// The mistakes with a size that promise most at `theta` and `elsewhere`, fitted on few lines from there.
fn sized<'a>(
    model: &StructureModel,
    thin: &FrfData,
    theta: &[f64],
    elsewhere: &[Vec<f64>],
    all: &'a [Box<dyn Mistake>],
) -> Result<Vec<Trial<'a>>> {
    let joint = |mistake: &'a dyn Mistake, group: FrfGroup| JointProblem {
        model,
        data: thin,
        mistake,
        group,
    };
    let count = theta.len();
    let mut first: Vec<(Fit, usize, FrfGroup)> = Vec::new();
    let places = elsewhere.iter().map(|start| (start.as_slice(), FITTED_ELSEWHERE));
    for (start, most) in std::iter::once((theta, FITTED)).chain(places) {
        let mut from_here: Vec<(Fit, usize, FrfGroup)> = most_promising(model, thin, start, all, most)?
            .into_par_iter()
            .filter_map(|(index, Score { group, values, .. })| {
                let fit = joint(all[index].as_ref(), group)
                    .fit(start, &values, FIRST_STEPS)
                    .ok()?;
                Some((fit, index, group))
            })
            .collect();
        // Most lead nowhere, and a few steps tell.
        from_here.sort_by(|a, b| a.0.cost.total_cmp(&b.0.cost));
        first.extend(from_here.into_iter().take(FOLLOWED));
    }
    let fits: Vec<Option<((usize, FrfGroup), Trial)>> = first
        .into_par_iter()
        .map(|(fit, index, group)| {
            let mistake = all[index].as_ref();
            let joint = joint(mistake, group);
            let (values, _) = joint.values(&fit, 1.0)?;
            let fit = joint.fit(&fit.theta[..count], &values, ROUGH).ok()?;
            let (values, _) = joint.values(&fit, 1.0)?;
            let (chi2, parameters) = (2.0 * fit.cost, values.len());
            let trial = Trial {
                cause: Cause::Size(mistake, group, values),
                theta: fit.theta[..count].to_vec(),
                chi2,
                parameters,
            };
            Some(((index, group), trial))
        })
        .collect();
    let mut best: Vec<((usize, FrfGroup), Trial)> = Vec::new();
    for (which, trial) in fits.into_iter().flatten() {
        match best.iter_mut().find(|(known, _)| *known == which) {
            Some((_, known)) if known.chi2 <= trial.chi2 => (),
            Some((_, known)) => *known = trial,
            None => best.push((which, trial)),
        }
    }
    Ok(best.into_iter().map(|(_, trial)| trial).collect())
}

/// Index of a mistake and its linear estimate at `start`: the `most` mistakes with the greatest promise, on at most two groups of FRFs
/// each.
fn most_promising(
    model: &StructureModel,
    thin: &FrfData,
    start: &[f64],
    all: &[Box<dyn Mistake>],
    most: usize,
) -> Result<Vec<(usize, Score)>> {
    let here = Linearised::new(model, thin, start)?;
    let mut scored = Vec::new();
    let small = all.iter().enumerate().filter(|(_, m)| m.is_ever_small());
    for (index, mistake) in small {
        let price = 8.0 * mistake.sizes().len() as f64;
        let mut scores = here.scores(mistake.as_ref())?;
        scores.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        scored.extend(scores.into_iter().take(2).map(|s| (s.gain - price, index, s)));
    }
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    let promising = scored.into_iter().filter(|s| s.0 > LEAST_GAIN).take(most);
    let mut promising: Vec<_> = promising.map(|(_, index, score)| (index, score)).collect();
    for (index, mistake) in all.iter().enumerate() {
        let far = mistake.far(model, thin, start)?;
        promising.extend(far.into_iter().map(|score| (index, score)));
    }
    Ok(promising)
}

/// Readings with the baseline fitted anew, from `starts`, from the nominal values and from where the measured modes put it: most
/// readings leave those where they are.
fn read_trials<'a>(
    model: &StructureModel,
    thin: &FrfData,
    starts: &[&[f64]],
    measured: Option<&[f64]>,
    read: &'a [readings::Proposed],
    base: f64,
) -> Result<Vec<Trial<'a>>> {
    let trials: Vec<Option<Trial>> = read
        .par_iter()
        .map(|proposed| {
            let reading = proposed.reading.as_ref();
            let data = reading.corrected(thin);
            let read = model_read(model, reading);
            let fits = starts.iter().filter_map(|start| {
                minimise(
                    &FrfProblem::likelihood(&read, &data),
                    start,
                    &read.bounds(),
                    ROUGH,
                )
                .ok()
            });
            let near = fits.min_by(|a, b| a.cost.total_cmp(&b.cost))?;
            let mut best = (near.cost, near.theta);
            // Where the baseline was led astray its old place is no start.
            if led_astray(near.cost, 2.0 * data.value_count() as f64)
                && (near.cost < base || proposed.gain > PLAIN_READING)
            {
                let options = Options {
                    extra_starts: 0,
                    ..Options::default()
                };
                if let Ok(fresh) = calibrate(&read, &data, measured, options) {
                    let cost = cost(&read, &data, &fresh.theta).ok()?;
                    if cost < best.0 {
                        best = (cost, fresh.theta);
                    }
                }
            }
            Some(Trial {
                cause: Cause::Read(reading),
                theta: best.1,
                chi2: 2.0 * best.0,
                parameters: 0,
            })
        })
        .collect();
    Ok(trials.into_iter().flatten().collect())
}

/// A trial on all data. `base`: χ² of the model as it stands there.
fn refined(
    model: &StructureModel,
    data: &FrfData,
    trial: &Trial,
    measured: Option<&[f64]>,
    base: f64,
) -> Result<TriedMistake> {
    let freedom = 2.0 * data.value_count() as f64;
    match &trial.cause {
        Cause::Read(reading) => {
            let corrected = reading.corrected(data);
            let read = model_read(model, *reading);
            let fit = minimise(
                &FrfProblem::likelihood(&read, &corrected),
                &trial.theta,
                &read.bounds(),
                FINE,
            )?;
            let mut chi2 = 2.0 * fit.cost;
            // What explains nearly all and leaves more than noise may stand beside its optimum: it is sought as the model's was.
            if chi2 < NEARLY_ALL * base
                && chi2 > LEFT_OVER * freedom
                && let Ok(fresh) = calibrate(&read, &corrected, measured, Options::default())
            {
                chi2 = chi2.min(2.0 * cost(&read, &corrected, &fresh.theta)?);
            }
            Ok(TriedMistake {
                finding: reading.finding(data, &model.points),
                chi2,
                parameters: 0,
                tried: reading.tried(),
                at_bound: false,
            })
        }
        Cause::Size(mistake, group, values) => {
            let joint = JointProblem {
                model,
                data,
                mistake: *mistake,
                group: *group,
            };
            let fit = joint.fit(&trial.theta, values, FINE)?;
            let scale = (2.0 * fit.cost / freedom).max(1.0);
            let (values, errors) = joint
                .values(&fit, scale)
                .ok_or_else(|| Error::computation("the size of the mistake is not determined"))?;
            let estimated = Estimated {
                group: *group,
                values: &values,
                errors: &errors,
                data,
                points: &model.points,
            };
            Ok(TriedMistake {
                finding: mistake.finding(&estimated),
                chi2: 2.0 * fit.cost,
                parameters: values.len(),
                tried: mistake.groups(data).len() as f64,
                at_bound: fit.at_bound.iter().any(|i| *i >= model.parameters.len()),
            })
        }
    }
}

/// The best single effect of the library on few data, for commands that do not try them all anyway.
pub fn library_rival(model: &StructureModel, data: &FrfData, theta: &[f64]) -> Option<Rival> {
    let study = StructureStudy::new(enough(data).into_owned(), Options::default());
    let (instances, _) = study.instances(model);
    let hints = study.hints(model, theta).ok()?;
    let bounds = model.bounds();
    let base = minimise(&study.problem(model, View::COARSE), theta, &bounds, ROUGH).ok()?;
    let tried = try_effects(
        &study,
        model,
        &instances,
        std::slice::from_ref(&base.theta),
        &hints,
        || (),
    );
    let best = tried.iter().min_by(|a, b| a.fit.cost.total_cmp(&b.fit.cost))?;
    Some(Rival {
        label: best.instance.name().label(),
        gain_share: (1.0 - best.fit.cost / base.cost).max(0.0),
        parameters: best.model.parameters.len() - model.parameters.len(),
    })
}
