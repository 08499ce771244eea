//! What the loop "fit, compare, add an effect, fit again" needs to know of a model and its data, and the fits it is made
//! of. Structure and cutting forces are two studies; the loop is one.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::first_size::{faintest, linear_size};
use super::levenberg_marquardt::{Fit, LeastSquares, Stopping, minimise, one_step};
use super::model::{Model, Modelled};
use super::rest::{BeyondSlips, Rest};
use crate::effects::{Effect, Instance, Known, Registry, Size};
use crate::identify::frfs::calibrate::{Calibration, Estimate, scattered_starts};
use crate::parameter::{Parameter, Scale};
use crate::{Error, Result};

/// How much of the data a fit uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// Hardly more than shows the strong effects, for looks at very many models.
    Glance,
    /// A share of the data that shows every effect, for trying many starting points.
    Coarse,
    /// A share of the lines of every FRF, for one look at what is faint: some FRFs alone may show it.
    Thin,
    /// Everything.
    Full,
}

/// What is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measure {
    /// A smooth misfit for far away, where a model's peak stands next to the measured one.
    Rough,
    /// The likelihood.
    Likelihood,
}

/// A view of a study's data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct View {
    /// How much of the data.
    pub extent: Extent,
    /// What is compared.
    pub measure: Measure,
    /// A fold (posture, cut) that is left out.
    pub left_out: Option<usize>,
}

impl View {
    /// A share of the data, by likelihood.
    pub const COARSE: View = View {
        extent: Extent::Coarse,
        measure: Measure::Likelihood,
        left_out: None,
    };
    /// Hardly more than shows the strong effects, by likelihood.
    pub const GLANCE: View = View {
        extent: Extent::Glance,
        ..View::COARSE
    };
    /// A share of the lines of every FRF, by likelihood.
    pub const THIN: View = View {
        extent: Extent::Thin,
        ..View::COARSE
    };
    /// All data, by likelihood.
    pub const FULL: View = View {
        extent: Extent::Full,
        ..View::COARSE
    };
}

/// What a model's residual says about itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Residual {
    /// sqrt(Σ|model − measured|² / Σ|measured|²).
    pub nrms: f64,
    /// Σ r²/σ² per real value.
    pub chi2_per_value: f64,
    /// Share of the values that counts as independent, from the correlation of neighbours in the weighted residual:
    /// 1 for white noise.
    pub independent_share: f64,
}

/// Models of one domain, and the data that they are fitted to.
pub trait Study: Sync {
    /// What is modelled.
    type Domain: Modelled;
    /// A model's misfit to a view of the data.
    type Problem<'a>: LeastSquares + Sync
    where
        Self: 'a;

    /// The effects that may be missing.
    fn registry(&self) -> &Registry<Self::Domain>;

    /// What effects are told of the model and the data.
    fn known<'a>(&'a self, model: &'a Model<Self::Domain>) -> Known<'a, Self::Domain>;

    /// Why data of this kind cannot show the effect, whatever is measured; `None` if they can.
    fn blind_to(&self, _effect: &dyn Effect<Self::Domain>) -> Option<String> {
        None
    }

    /// What the residual of `model` at `theta` suggests: frequencies around which it stands out, most prominent first, Hz.
    fn hints(&self, _model: &Model<Self::Domain>, _theta: &[f64]) -> Result<Vec<f64>> {
        Ok(Vec::new())
    }

    /// The misfit of `model` to a view.
    fn problem<'a>(&'a self, model: &'a Model<Self::Domain>, view: View) -> Self::Problem<'a>;

    /// Roughly the processor time of one evaluation of `model` with its derivatives on a view, s: what budgets are counted in.
    /// From the sizes of the model and the data, not from a clock, so that the same work is done everywhere.
    fn work_s(&self, model: &Model<Self::Domain>, extent: Extent) -> f64;

    /// Real values in a view.
    fn real_values(&self, extent: Extent) -> usize;

    /// Postures or cuts; numbered from 0.
    fn folds(&self) -> usize;

    /// How well `theta` predicts one fold, on all of its data.
    fn predict_fold(&self, model: &Model<Self::Domain>, theta: &[f64], fold: usize) -> Result<HeldOut>;

    /// How much `model` at `theta` leaves of all data.
    fn residual(&self, model: &Model<Self::Domain>, theta: &[f64]) -> Result<Residual>;

    /// What tests of structure find in what the model leaves; no tests where there is too little data.
    fn rest(&self, _model: &Model<Self::Domain>, _theta: &[f64]) -> Result<Rest> {
        Ok(Rest::default())
    }

    /// What tests of structure find in what small errors of the setup cannot take of that; `None` where nothing is known of
    /// such errors. `rest`: what [`Self::rest`] found.
    fn beyond_slips(
        &self,
        _model: &Model<Self::Domain>,
        _theta: &[f64],
        _rest: &Rest,
    ) -> Result<Option<BeyondSlips>> {
        Ok(None)
    }

    /// Whether the values' errors were given with them: then few values are enough. Where they are estimated from the scatter
    /// of the data themselves they are not.
    fn noise_is_given(&self) -> bool {
        false
    }

    /// The fair fit of a model as it stands.
    fn calibrate(&self, model: &Model<Self::Domain>) -> Result<Calibration>;

    /// Every instance that could be added to `model`, and the effects this data cannot show with the reason.
    #[allow(clippy::type_complexity)]
    fn instances(&self, model: &Model<Self::Domain>) -> (Vec<Instance<Self::Domain>>, Vec<(String, String)>) {
        let known = self.known(model);
        let (mut tried, mut not_tried) = (Vec::new(), Vec::new());
        for instance in self.registry().instances(known.object) {
            let label = instance.label();
            if model.has(&label)
                || instance
                    .effect
                    .choice_obstacle(instance.variant, &known)
                    .is_some()
            {
                continue;
            }
            let blind = self.blind_to(instance.effect);
            match blind.or_else(|| instance.effect.obstacle(&known)) {
                Some(reason) => not_tried.push((label, reason)),
                None => tried.push(instance),
            }
        }
        not_tried.dedup();
        (tried, not_tried)
    }

    /// Why the effect cannot be that large or that small, from the estimates of its own parameters; `None` if it can.
    fn impossible(
        &self,
        model: &Model<Self::Domain>,
        instance: &Instance<Self::Domain>,
        own: &[Estimate],
    ) -> Option<String> {
        let sizes: Vec<Size> = own.iter().map(Estimate::size).collect();
        let object = self.known(model).object;
        instance.effect.impossible(instance.site, object, &sizes)
    }

    /// `model` with one more effect; its parameters come last.
    fn extend(&self, model: &Model<Self::Domain>, instance: &Instance<Self::Domain>) -> Model<Self::Domain> {
        model.with_effect(*instance, &self.known(model))
    }
}

/// A model of a study.
pub type ModelOf<S> = Model<<S as Study>::Domain>;
/// An effect at a site, of a study.
pub type InstanceOf<S> = Instance<<S as Study>::Domain>;

/// Sums behind held-out errors of one fit.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct HeldOut {
    /// Σ|model − measured|² and Σ|measured|² on folds left out of the fit.
    pub error: f64,
    /// Σ|measured|² on the folds left out.
    pub signal: f64,
    /// −2 ln L there: Σ r²/σ² over real values.
    pub chi2: f64,
    /// The same of each fold.
    pub by_fold: Vec<f64>,
}

impl HeldOut {
    /// Held-out error over the signal; 0 where there is no signal.
    pub fn nrms(&self) -> f64 {
        if self.signal > 0.0 {
            (self.error / self.signal).sqrt()
        } else {
            0.0
        }
    }
}

/// Leaves out one fold at a time, refits from `theta` on the rest and predicts the fold left out. `None` with fewer than
/// two folds.
pub fn held_out<S: Study>(
    study: &S,
    model: &ModelOf<S>,
    theta: &[f64],
    extent: Extent,
    stopping: Stopping,
) -> Result<Option<HeldOut>> {
    if study.folds() < 2 {
        return Ok(None);
    }
    let bounds = model.bounds();
    let folds: Vec<HeldOut> = (0..study.folds())
        .into_par_iter()
        .map(|fold| {
            let view = View {
                extent,
                left_out: Some(fold),
                ..View::FULL
            };
            let fit = minimise(&study.problem(model, view), theta, &bounds, stopping)?;
            study.predict_fold(model, &fit.theta, fold)
        })
        .collect::<Result<_>>()?;
    let mut total = HeldOut::default();
    for fold in folds {
        total.error += fold.error;
        total.signal += fold.signal;
        total.chi2 += fold.chi2;
        total.by_fold.push(fold.chi2);
    }
    Ok(Some(total))
}

/// Weighted squares per real value from which on the rough misfit is fitted first: peaks may stand away from their places.
const TRAP_MISFIT: f64 = 3.0;

/// How hard a fit of an effect is tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effort {
    /// A few steps from the best starting point, on a glance at the data.
    Look,
    /// To the end, from every base that starts near enough.
    Direct,
    /// Besides, the rough misfit leads from every base where the likelihood's starting points are all far off.
    Staged,
    /// The same on a glance at the data and from the two nearest bases, for what is so large that it shows there.
    StagedAtAGlance,
}

/// Starting points that get a step.
const MOST_STARTS: usize = 8;
/// Times the lowest misfit from which on a starting point is not followed directly.
const HOPELESS: f64 = 3.0;

const LOOK: Stopping = Stopping {
    max_iterations: 6,
    relative_decrease: 1e-3,
};
const SETTLE: Stopping = Stopping {
    max_iterations: 20,
    relative_decrease: 1e-4,
};

/// Fits the effect added last to `model` on the coarse view, without being trapped by where the fit without it stood.
/// `bases`: points for the parameters in front of the effect's; `own`: points for its own; both on the solver's scale.
fn screen<S: Study>(
    study: &S,
    model: &ModelOf<S>,
    bases: &[Vec<f64>],
    own: &[Vec<f64>],
    effort: Effort,
) -> Result<Fit> {
    let mut fits = look(study, model, bases, own, effort)?;
    if effort == Effort::Look {
        return Ok(fits.swap_remove(0));
    }
    settle(study, model, &fits)
}

/// The first steps of the fit of the effect added last to `model` (see [`Looked`]): where short fits from the most promising
/// starting points lead, best first; at least one. `bases`: points for the parameters in front of the effect's; `own`: points for
/// its own; both on the solver's scale.
///
/// # Errors
/// No starting point at which the model can be set up.
pub fn look<S: Study>(
    study: &S,
    model: &ModelOf<S>,
    bases: &[Vec<f64>],
    own: &[Vec<f64>],
    effort: Effort,
) -> Result<Vec<Fit>> {
    let bounds = model.bounds();
    let extent = match effort {
        Effort::Look | Effort::StagedAtAGlance => Extent::Glance,
        Effort::Direct | Effort::Staged => Extent::Coarse,
    };
    let staged = matches!(effort, Effort::Staged | Effort::StagedAtAGlance);
    let view = |measure| View {
        extent,
        measure,
        ..View::COARSE
    };
    let likelihood = study.problem(model, view(Measure::Likelihood));
    // It only has to lead into the right basin.
    let rough = study.problem(
        model,
        View {
            measure: Measure::Rough,
            ..View::GLANCE
        },
    );
    let lowest = |problem: &S::Problem<'_>, base: &[f64]| -> Option<(f64, Vec<f64>)> {
        let starts = own.iter().map(|own| [base, own.as_slice()].concat());
        starts
            .map(|start| (problem.cost(&start).unwrap_or(f64::INFINITY), start))
            .min_by(|a, b| a.0.total_cmp(&b.0))
    };
    let mut fits = Vec::new();
    let mut failure = None;
    let mut keep = |fit: Result<Fit>| match fit {
        Ok(fit) => fits.push(fit),
        Err(error) => failure = Some(error),
    };
    // Few steps lead nowhere from near where a faint effect vanishes, and at its usual size the parameters in front have not made room
    // for it yet.
    let of_linear_size = match effort {
        Effort::Look => bases,
        Effort::Direct | Effort::Staged | Effort::StagedAtAGlance => &[],
    }
    .iter()
    .filter_map(|base| Some(linear_size(&likelihood, model, base)?.theta));
    let mut starts: Vec<(f64, Vec<f64>)> = bases
        .iter()
        .flat_map(|base| own.iter().map(move |own| [base.as_slice(), own].concat()))
        .chain(of_linear_size)
        .map(|start| (likelihood.cost(&start).unwrap_or(f64::INFINITY), start))
        .collect();
    starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let best = starts.first().map_or(f64::INFINITY, |s| s.0);
    starts.truncate(MOST_STARTS);
    // A start close to where the effect vanishes costs little and promises nothing: one step tells (it is a score test
    // there). A start that is hopelessly high needs the rough misfit first.
    let mut steps: Vec<(f64, Vec<f64>)> = starts
        .iter()
        .filter(|s| s.0 <= HOPELESS * best)
        .filter_map(|(_, start)| one_step(&likelihood, start, &bounds).ok())
        .collect();
    steps.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (_, step) in steps.iter().take(if effort == Effort::Look { 1 } else { 2 }) {
        keep(minimise(&likelihood, step, &bounds, LOOK));
    }
    if staged && 2.0 * best > TRAP_MISFIT * study.real_values(extent) as f64 {
        let longer = Stopping {
            max_iterations: 10,
            ..LOOK
        };
        let mut near: Vec<(f64, Vec<f64>)> = bases.iter().filter_map(|base| lowest(&rough, base)).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        if effort == Effort::StagedAtAGlance {
            near.truncate(2);
        }
        let near = near
            .into_iter()
            .filter_map(|(_, start)| minimise(&rough, &start, &bounds, longer).ok())
            .min_by(|a, b| a.cost.total_cmp(&b.cost));
        if let Some(near) = near {
            keep(minimise(&likelihood, &near.theta, &bounds, LOOK));
        }
    }
    // A fit that ends above where the effect is hardly there was led away: then it begins there.
    let lowest_fit = fits.iter().map(|f| f.cost).fold(f64::INFINITY, f64::min);
    let faint = faintest(model)
        .iter()
        .flat_map(|own| bases.iter().map(|base| [base.as_slice(), own].concat()))
        .map(|start| (likelihood.cost(&start).unwrap_or(f64::INFINITY), start))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    if let Some((_, start)) = faint.filter(|(cost, _)| *cost < lowest_fit)
        && let Ok(fit) = minimise(&likelihood, &start, &bounds, LOOK)
    {
        fits.push(fit);
    }
    fits.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    if fits.is_empty() {
        return Err(failure.unwrap_or_else(|| Error::computation("no starting point for the effect")));
    }
    Ok(fits)
}

/// The fit of a model without the effect added last to `model`, as one of `model`: the effect stands where it vanishes,
/// its prior uncharged (that prior is of an effect that is there). `None` where the effect has no such limit.
pub fn vanished<D: Modelled>(model: &Model<D>, without: &Fit) -> Option<Fit> {
    let limit = model.vanishing_limit()?;
    let (front, count) = (without.theta.len(), without.theta.len() + limit.len());
    let parameters = &model.parameters;
    let mut hessian = DMatrix::zeros(count, count);
    hessian
        .view_mut((0, 0), (front, front))
        .copy_from(&without.hessian);
    for i in front..count {
        // All that is known of an effect that is not there.
        let std = parameters[i].prior.map_or(1.0, |prior| prior.std);
        hessian[(i, i)] = 1.0 / (std * std);
    }
    Some(Fit {
        theta: [without.theta.as_slice(), &limit].concat(),
        hessian,
        at_bound: without.at_bound.iter().copied().chain(front..count).collect(),
        ..without.clone()
    })
}

/// Follows what [`look`] found to its end on the coarse view. The runner-up goes to the end too where it is close: the
/// leader of a short look need not win.
fn settle<S: Study>(study: &S, model: &ModelOf<S>, looks: &[Fit]) -> Result<Fit> {
    let bounds = model.bounds();
    let likelihood = study.problem(model, View::COARSE);
    let close = |fit: &&Fit| fit.cost < 1.5 * looks[0].cost;
    looks
        .iter()
        .take(2)
        .filter(close)
        .map(|fit| minimise(&likelihood, &fit.theta, &bounds, SETTLE))
        .reduce(|best, next| {
            let (best, next) = (best?, next?);
            Ok(if next.cost < best.cost { next } else { best })
        })
        .unwrap_or_else(|| Err(Error::computation("no starting point for the effect")))
}

/// Starting points of an effect's own parameters on the solver's scale: the nominal values, what the effect proposes, and
/// near both ends of the range, where an effect that is hardly there begins.
pub fn own_starts<S: Study>(
    study: &S,
    extended: &ModelOf<S>,
    count_before: usize,
    instance: &InstanceOf<S>,
    hints: &[f64],
) -> Vec<Vec<f64>> {
    let parameters = &extended.parameters[count_before..];
    let nominal: Vec<f64> = parameters.iter().map(|p| p.nominal).collect();
    let mut starts: Vec<Vec<f64>> = std::iter::once(nominal)
        .chain(
            instance
                .effect
                .starts(instance.at(), &study.known(extended), hints),
        )
        .map(|start| {
            let pairs = parameters.iter().zip(start);
            pairs.map(|(p, v)| p.internal_within(v)).collect()
        })
        .collect();
    if let [only] = parameters {
        let [low, high] = only.internal_bounds();
        if low.is_finite() && high.is_finite() {
            starts.extend([0.05, 0.95].map(|share| vec![low + share * (high - low)]));
        }
    }
    starts
}

/// An effect tried: the model with it and its fit.
#[derive(Debug, Clone)]
pub struct Tried<D: Modelled> {
    /// The effect with its place and discrete choice.
    pub instance: Instance<D>,
    /// The model with it.
    pub model: Model<D>,
    /// Its fit.
    pub fit: Fit,
}

/// `model` fitted to all data from the starting points that a model without effects added is fitted from, and from `theta` (solver's
/// scale).
///
/// # Errors
/// A model that cannot be calibrated to the data.
pub fn fit_as_a_model<S: Study>(
    study: &S,
    model: &ModelOf<S>,
    theta: &[f64],
    stopping: Stopping,
) -> Result<Fit> {
    let calibration = study.calibrate(&model.with_start(theta.to_vec()))?;
    minimise(
        &study.problem(model, View::FULL),
        &calibration.theta,
        &model.bounds(),
        stopping,
    )
}

/// `model` with `instance`, fitted to a view from one point (solver's scale).
///
/// # Errors
/// A model that cannot be set up there.
pub fn fit_from<S: Study>(
    study: &S,
    model: &ModelOf<S>,
    instance: &InstanceOf<S>,
    start: &[f64],
    view: View,
    stopping: Stopping,
) -> Result<Tried<S::Domain>> {
    let model = study.extend(model, instance);
    let fit = minimise(&study.problem(&model, view), start, &model.bounds(), stopping)?;
    let instance = *instance;
    Ok(Tried { instance, model, fit })
}

/// `model` with the effect at `place` of those added to it exchanged for `other`, and the point of that at `theta` (solver's scale): sizes
/// that both have stay, others are nominal.
pub fn exchanged<S: Study>(
    study: &S,
    model: &ModelOf<S>,
    theta: &[f64],
    place: usize,
    other: &InstanceOf<S>,
) -> (ModelOf<S>, Vec<f64>) {
    let mut new = model.without_effects();
    for (i, added) in model.effects().iter().enumerate() {
        new = study.extend(&new, if i == place { other } else { &added.instance });
    }
    // A parameter's name begins with the label of its effect.
    let (was, is) = (model.effects()[place].instance.label(), other.label());
    let own = new.effects()[place].parameters.clone();
    let known = |(i, p): (usize, &Parameter)| {
        let shared = p.name.strip_prefix(&is).filter(|_| own.contains(&i));
        let name = shared.map_or_else(|| p.name.clone(), |rest| format!("{was}{rest}"));
        let before = model.parameters.iter().position(|known| known.name == name);
        before.map_or_else(|| p.internal_within(p.nominal), |before| theta[before])
    };
    let theta = new.parameters.iter().enumerate().map(known).collect();
    (new, theta)
}

/// What each parameter must gain in χ², for so many independent values: their logarithm (Schwarz 1978), and in any case what
/// a parameter that means nothing gains by chance, twice (Akaike 1974). Far from the noise so much of the misfit is correlated
/// that hardly a value counts as independent; parameters would be rewarded there.
pub fn price_of_a_parameter(independent_values: f64) -> f64 {
    const BY_CHANCE_TWICE: f64 = 2.0;
    independent_values.ln().max(BY_CHANCE_TWICE)
}

/// Half of −2 ln L on a view, `cost`, and what so many parameters have to gain of it: models with other numbers of them are ranked by that.
pub fn paid<S: Study>(study: &S, extent: Extent, cost: f64, parameters: usize) -> f64 {
    cost + 0.5 * price_of_a_parameter(study.real_values(extent) as f64) * parameters as f64
}

/// Logarithm of the factor from its nominal value beyond which a parameter may be gone for want of data.
const GONE_LN_FACTOR: f64 = 1.0;

/// From where effects are tried besides `model`, which stands at `found` (solver's scale): points of its parameters, in rounds. First there
/// and at the nominal values; then with those parameters put back to these that are a multiple or a fraction of them. What is missing may
/// have driven the resonance of a joint out of the measured band, and an effect of that joint shows only where it has come back. Where most
/// are so far off the robot file is what is wrong, and there is one round.
pub fn rounds_of_bases<D: Modelled>(model: &Model<D>, found: &[f64]) -> Vec<Vec<Vec<f64>>> {
    let nominal = model.nominal_theta();
    let factors: Vec<usize> = (0..found.len())
        .filter(|i| model.parameters[*i].scale == Scale::Logarithmic)
        .collect();
    let is_gone = |i: &&usize| (found[**i] - nominal[**i]).abs() > GONE_LN_FACTOR;
    let gone: Vec<usize> = factors.iter().filter(is_gone).copied().collect();
    let mut back = found.to_vec();
    gone.iter().for_each(|&i| back[i] = nominal[i]);
    let mut rounds = vec![vec![found.to_vec(), nominal]];
    if !gone.is_empty() && 2 * gone.len() <= factors.len() {
        rounds.push(vec![back]);
    }
    rounds
}

/// Adds `instance` to `model` and fits it on the coarse view from the given points of the parameters in front; `None` if
/// no start leads to a fit.
pub fn try_effect<S: Study>(
    study: &S,
    model: &ModelOf<S>,
    instance: &InstanceOf<S>,
    bases: &[Vec<f64>],
    hints: &[f64],
    effort: Effort,
) -> Option<Tried<S::Domain>> {
    let extended = study.extend(model, instance);
    let before = model.parameters.len();
    let own = own_starts(study, &extended, before, instance, hints);
    let fit = screen(study, &extended, bases, &own, effort).ok()?;
    Some(Tried {
        instance: *instance,
        model: extended,
        fit,
    })
}

/// An effect after the first steps of its fit on the coarse view.
pub struct Looked<D: Modelled> {
    /// The effect with its place and discrete choice.
    pub instance: Instance<D>,
    /// The model with it.
    pub model: Model<D>,
    /// Where short fits led, best first; at least one (see [`look`]).
    pub fits: Vec<Fit>,
}

/// Times the lowest misfit from which on a candidate is out of the race: it is not followed to its end.
pub const OUT_OF_RACE: f64 = 10.0;

/// Follows each to its end on the coarse view; those out of the race after the first steps, or not among so
/// many of the first (`most`), stay where these ended. In the order given; `None` where the fit failed.
pub fn race<S: Study>(
    study: &S,
    looked: Vec<Looked<S::Domain>>,
    most: usize,
) -> Vec<Option<Tried<S::Domain>>> {
    let mut costs: Vec<f64> = looked.iter().map(|l| l.fits[0].cost).collect();
    costs.sort_by(f64::total_cmp);
    let lowest = costs.first().copied().unwrap_or(f64::INFINITY);
    let highest = costs.get(most).copied().unwrap_or(f64::INFINITY);
    let is_in = |cost: f64| cost <= OUT_OF_RACE * lowest && cost < highest;
    let followed = looked.into_par_iter().map(|mut looked| {
        let fit = match is_in(looked.fits[0].cost) {
            true => settle(study, &looked.model, &looked.fits).ok()?,
            false => {
                // The first steps may have been on a glance.
                let fit = looked.fits.swap_remove(0);
                let cost = study.problem(&looked.model, View::COARSE).cost(&fit.theta).ok()?;
                Fit { cost, ..fit }
            }
        };
        Some(Tried {
            instance: looked.instance,
            model: looked.model,
            fit,
        })
    });
    followed.collect()
}

/// Effects on promise that are followed, at most.
const PROMISES: usize = 4;
/// Share of what the best other effect takes away that an effect on promise must take away at first sight.
const PROMISING_SHARE: f64 = 0.1;

/// Of `instances`, on promise all of them, those that take away most at a first look on a glance at the data, if that is more
/// than their parameters do by chance and not next to nothing against `best`: the lowest misfit there of another effect.
fn promising<'i, S: Study>(
    study: &S,
    model: &ModelOf<S>,
    instances: &[&'i InstanceOf<S>],
    bases: &[Vec<f64>],
    hints: &[f64],
    best: f64,
) -> Vec<&'i InstanceOf<S>> {
    let problem = study.problem(model, View::GLANCE);
    // Fitted to the glance like the effects: else each of them would be credited with what that alone takes away.
    let bounds = model.bounds();
    let fits = bases
        .iter()
        .filter_map(|base| minimise(&problem, base, &bounds, LOOK).ok());
    let without = fits.map(|fit| fit.cost).fold(f64::INFINITY, f64::min);
    let mut promises: Vec<(f64, &InstanceOf<S>)> = instances
        .par_iter()
        .filter_map(|instance| {
            let tried = try_effect(study, model, instance, bases, hints, Effort::Look)?;
            let gain = without - tried.fit.cost;
            let by_chance = (tried.model.parameters.len() - model.parameters.len()) as f64;
            let enough = gain > by_chance && gain > PROMISING_SHARE * (without - best);
            enough.then_some((gain - by_chance, *instance))
        })
        .collect();
    promises.sort_by(|a, b| b.0.total_cmp(&a.0));
    promises.truncate(PROMISES);
    promises.into_iter().map(|(_, instance)| instance).collect()
}

/// Adds each instance to `model` in turn and fits it on the coarse view from the given points of the parameters in front;
/// those out of the race after a first look stay where that look ended. In the order of the instances, those on promise
/// last, without those that promise nothing or that no start led to a fit of. `done` is called after each.
pub fn try_effects<'i, S: Study>(
    study: &S,
    model: &ModelOf<S>,
    instances: &'i [InstanceOf<S>],
    bases: &[Vec<f64>],
    hints: &[f64],
    done: impl Fn() + Sync,
) -> Vec<Tried<S::Domain>> {
    let before = model.parameters.len();
    let look_at = |instances: Vec<&'i InstanceOf<S>>| -> Vec<Looked<S::Domain>> {
        instances
            .into_par_iter()
            .filter_map(|instance| {
                let extended = study.extend(model, instance);
                let own = own_starts(study, &extended, before, instance, hints);
                let looks = look(study, &extended, bases, &own, Effort::Staged);
                done();
                Some(Looked {
                    instance: *instance,
                    model: extended,
                    fits: looks.ok()?,
                })
            })
            .collect()
    };
    let (on_promise, always): (Vec<_>, Vec<_>) = instances.iter().partition(|i| i.effect.on_promise());
    let mut looks = look_at(always);
    let at_a_glance = |looked: &Looked<S::Domain>| {
        let cost = study
            .problem(&looked.model, View::GLANCE)
            .cost(&looked.fits[0].theta);
        cost.unwrap_or(f64::INFINITY)
    };
    let leading = looks
        .iter()
        .min_by(|a, b| a.fits[0].cost.total_cmp(&b.fits[0].cost));
    let best = leading.map_or(f64::INFINITY, at_a_glance);
    let promising = promising(study, model, &on_promise, bases, hints, best);
    for _ in promising.len()..on_promise.len() {
        done();
    }
    looks.extend(look_at(promising));
    race(study, looks, usize::MAX).into_iter().flatten().collect()
}

/// Candidates that [`try_again`] follows.
const FOLLOWED: usize = 10;

/// Effects that were tried from another baseline, tried again from `base`: a few steps of each on a glance at the data tell
/// which of them the new baseline changes; those and the leaders are followed on the coarse view, and whichever fit is better
/// is kept. `done` is called after each.
pub fn try_again<S: Study>(
    study: &S,
    model: &ModelOf<S>,
    tried: Vec<Tried<S::Domain>>,
    base: &[f64],
    hints: &[f64],
    done: impl Fn() + Sync,
) -> Vec<Tried<S::Domain>> {
    let bases = [base.to_vec()];
    let looked: Vec<f64> = tried
        .par_iter()
        .map(|t| {
            let before = study
                .problem(&t.model, View::GLANCE)
                .cost(&t.fit.theta)
                .unwrap_or(f64::INFINITY);
            let now = try_effect(study, model, &t.instance, &bases, hints, Effort::Look);
            done();
            now.map_or(before, |now| now.fit.cost.min(before))
        })
        .collect();
    let best_by = |cost: &(dyn Fn(usize) -> f64 + Sync)| {
        let mut order: Vec<usize> = (0..tried.len()).collect();
        order.sort_by(|a, b| cost(*a).total_cmp(&cost(*b)));
        order.truncate(FOLLOWED);
        order
    };
    let mut followed = best_by(&|i| looked[i]);
    followed.extend(best_by(&|i| tried[i].fit.cost));
    tried
        .into_par_iter()
        .enumerate()
        .map(|(i, t)| {
            let again = followed
                .contains(&i)
                .then(|| try_effect(study, model, &t.instance, &bases, hints, Effort::Direct));
            match again.flatten() {
                Some(again) if again.fit.cost < t.fit.cost => again,
                _ => t,
            }
        })
        .collect()
}

/// Share of the misfit by which a fit from a possible size must be better to be followed.
const CLEARLY_BETTER: f64 = 0.05;

/// `tried`, whose effect has led to a size that cannot be: fitted anew with the effect held at its nominal size until the parameters in
/// front, from `bases`, have made room for it, then with all free. `tried` stands on the coarse view; what is found is fitted to all
/// data. `None` where it is not clearly better.
pub fn from_possible_size<S: Study>(
    study: &S,
    tried: &Tried<S::Domain>,
    bases: &[Vec<f64>],
    stopping: Stopping,
) -> Result<Option<Tried<S::Domain>>> {
    let model = &tried.model;
    let bounds = model.bounds();
    let view = |measure| View {
        measure,
        ..View::GLANCE
    };
    let (rough, likelihood) = (
        study.problem(model, view(Measure::Rough)),
        study.problem(model, view(Measure::Likelihood)),
    );
    let from = |base: &Vec<f64>| -> Result<Fit> {
        let mut start = base.clone();
        let mut held = bounds.clone();
        for (parameter, bound) in model.parameters.iter().zip(&mut held).skip(base.len()) {
            let nominal = parameter.internal(parameter.nominal);
            start.push(nominal);
            *bound = [nominal; 2];
        }
        let near = minimise(&rough, &start, &held, LOOK)?;
        let near = minimise(&likelihood, &near.theta, &held, LOOK)?;
        minimise(&likelihood, &near.theta, &bounds, SETTLE)
    };
    let fits = bases.iter().filter_map(|base| from(base).ok());
    let best = fits.min_by(|a, b| a.cost.total_cmp(&b.cost));
    let before = likelihood.cost(&tried.fit.theta)?;
    let Some(best) = best.filter(|fit| fit.cost < before * (1.0 - CLEARLY_BETTER)) else {
        return Ok(None);
    };
    let coarse = minimise(&study.problem(model, View::COARSE), &best.theta, &bounds, SETTLE)?;
    if coarse.cost > tried.fit.cost * (1.0 - CLEARLY_BETTER) {
        return Ok(None);
    }
    let fit = minimise(
        &study.problem(model, View::FULL),
        &coarse.theta,
        &bounds,
        stopping,
    )?;
    Ok(Some(Tried { fit, ..tried.clone() }))
}

/// The effect added last may be stuck away from its best fit: from further starting points a better one, if there is any.
/// `tried` is fitted on all data; `model` is the one without the effect.
pub fn rescue<S: Study>(
    study: &S,
    model: &ModelOf<S>,
    tried: &Tried<S::Domain>,
    hints: &[f64],
    stopping: Stopping,
) -> Result<Option<Fit>> {
    /// Starting points, and their seed.
    const STARTS: (usize, u64) = (4, 1);
    let parameters = &model.parameters;
    let own = own_starts(study, &tried.model, parameters.len(), &tried.instance, hints);
    let bounds = tried.model.bounds();
    let fit =
        |view: View, start: &[f64]| minimise(&study.problem(&tried.model, view), start, &bounds, stopping);
    let coarse = fit(View::COARSE, &tried.fit.theta)?;
    let fits: Vec<Fit> = scattered_starts(parameters, STARTS.0, STARTS.1)
        .par_iter()
        .filter_map(|base| {
            let base = std::slice::from_ref(base);
            look(study, &tried.model, base, &own, Effort::Staged).ok()
        })
        // What a look leaves that far above would only end in another optimum.
        .filter(|looks| looks[0].cost <= OUT_OF_RACE * coarse.cost)
        .filter_map(|looks| settle(study, &tried.model, &looks).ok())
        .collect();
    let lowest = fits.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
    let Some(lowest) = lowest.filter(|l| l.cost < coarse.cost * (1.0 - 1e-3)) else {
        return Ok(None);
    };
    let better = fit(View::FULL, &lowest.theta)?;
    Ok((better.cost < tried.fit.cost).then_some(better))
}
