//! Tunes the structural model to measured FRFs: maximum a posteriori, staged so that no peak is trapped next to the
//! one it belongs to, repeated from other starting points where the fit is not as good as the noise allows.

use nalgebra::DMatrix;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;

use crate::effects::Size;
use crate::identify::frfs::frf_data::FrfData;
use crate::identify::frfs::frf_problem::{FrfProblem, Misfit};
use crate::identify::frfs::rival_optima;
use crate::identify::frfs::structure::StructureModel;
use crate::identify::levenberg_marquardt::{Ending, Fit, LeastSquares, Stopping, minimise};
use crate::parameter::Parameter;
use crate::progress::Progress;
use crate::{Error, Result, stop};

/// One fitted parameter in natural units.
#[derive(Debug, Clone, Serialize)]
pub struct Estimate {
    /// As [`Parameter::name`].
    pub name: String,
    /// Natural units.
    pub value: f64,
    /// Of `value` and `std_error`.
    pub unit: &'static str,
    /// Standard error, natural units.
    pub std_error: f64,
    /// Nominal value, natural units.
    pub initial: f64,
    /// True where the estimate stopped at the end of its allowed range.
    pub at_bound: bool,
}

impl Estimate {
    /// Value and standard error alone.
    pub fn size(&self) -> Size {
        Size {
            value: self.value,
            std: self.std_error,
        }
    }
}

/// How to calibrate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Further starting points, tried where the first fit leaves more than noise.
    pub extra_starts: usize,
    /// Seed of those starting points.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            extra_starts: 6,
            seed: 1,
        }
    }
}

/// A calibrated model.
#[derive(Debug, Clone)]
pub struct Calibration {
    /// In the order of the model's parameters.
    pub parameters: Vec<Estimate>,
    /// On the solver's scale.
    pub theta: Vec<f64>,
    /// Covariance on the solver's scale, scaled up where the misfit exceeds the noise.
    pub covariance: DMatrix<f64>,
    /// By how much more than `covariance` says each standard error was widened, because parts of the data disagree (see
    /// [`covering`](Self::covering)): 1 where they do not.
    pub widened: Vec<f64>,
    /// Weighted misfit per real residual: 1 where only noise is left.
    pub reduced_chi2: f64,
    /// Steps of the solver.
    pub iterations: usize,
    /// Why it stopped.
    pub ending: Ending,
    /// Starting points tried.
    pub starts: usize,
    /// How many of them came to the answer given here (within 0.1 % of its misfit).
    pub starts_agreeing: usize,
    /// Other optima of about the same misfit that were found on the way, solver's scale; after [`covering`](Self::covering) those that
    /// the data do not tell from this one.
    pub rivals: Vec<Vec<f64>>,
}

impl Calibration {
    /// Correlation of every two parameters (their covariance is this times both standard errors); `None` where one of them
    /// is held and has no error.
    pub fn correlation(&self) -> Vec<Vec<Option<f64>>> {
        let std = self.covariance.diagonal().map(f64::sqrt);
        let of = |i: usize, j: usize| {
            let product = std[i] * std[j];
            let known = product > 0.0 && product.is_finite();
            known.then(|| (self.covariance[(i, j)] / product).clamp(-1.0, 1.0))
        };
        let all = 0..self.covariance.nrows();
        all.clone()
            .map(|i| all.clone().map(|j| of(i, j)).collect())
            .collect()
    }

    /// A fit from one starting point to so many real values: estimates with errors that are widened where the misfit exceeds
    /// the noise.
    ///
    /// # Errors
    /// Parameters that the fit does not determine.
    pub fn of_fit(parameters: &[Parameter], fit: Fit, real_values: usize) -> Result<Self> {
        let freedom = real_values as f64 - parameters.len() as f64;
        let reduced_chi2 = 2.0 * fit.cost / freedom.max(1.0);
        Ok(Calibration {
            parameters: estimates(parameters, &fit, reduced_chi2)?,
            covariance: covariance(&fit, reduced_chi2)?,
            widened: vec![1.0; fit.theta.len()],
            theta: fit.theta,
            reduced_chi2,
            iterations: fit.iterations,
            ending: fit.ending,
            starts: 1,
            starts_agreeing: 1,
            rivals: Vec::new(),
        })
    }

    /// Whether the solver found the optimum that it was looking for.
    pub fn converged(&self) -> bool {
        self.ending == Ending::Converged
    }

    /// The same fit as one of a model with an effect that vanishes in it: `own` are the effect's parameters, `limit` the
    /// values (solver's scale) at which it is not there.
    pub fn with_vanished(&self, own: &[Parameter], limit: &[f64]) -> Calibration {
        let (front, count) = (self.theta.len(), self.theta.len() + own.len());
        let mut covariance = DMatrix::zeros(count, count);
        covariance
            .view_mut((0, 0), (front, front))
            .copy_from(&self.covariance);
        let mut parameters = self.parameters.clone();
        for (i, (p, t)) in own.iter().zip(limit).enumerate() {
            // All that is known of an effect that is not there.
            let std = p.prior.map_or(1.0, |prior| prior.std);
            covariance[(front + i, front + i)] = std * std;
            parameters.push(Estimate {
                name: p.name.clone(),
                value: p.natural(*t),
                unit: p.unit,
                std_error: p.natural_std(*t, std),
                initial: p.nominal,
                at_bound: true,
            });
        }
        Calibration {
            parameters,
            theta: [self.theta.as_slice(), limit].concat(),
            covariance,
            widened: [self.widened.as_slice(), &vec![1.0; own.len()]].concat(),
            rivals: self
                .rivals
                .iter()
                .map(|r| [r.as_slice(), limit].concat())
                .collect(),
            ..self.clone()
        }
    }

    fn told_of_rivals(&self) -> String {
        let far = |i: usize| {
            let std = self.covariance[(i, i)].sqrt();
            self.rivals.iter().any(|r| (r[i] - self.theta[i]).abs() > std)
        };
        let names: Vec<&str> = self
            .parameters
            .iter()
            .enumerate()
            .filter(|(i, _)| far(*i))
            .map(|(_, p)| p.name.as_str())
            .collect();
        format!(
            "the data do not determine the parameters: {} the data about as well \
             (a posture or a stretch of the frequency less would decide otherwise); standard errors are widened to hold both: {}",
            match self.rivals.len() {
                1 => "another set of them, far from these, explains".to_string(),
                more => format!("{more} other sets of them, far from these, explain"),
            },
            names.join(", ")
        )
    }

    /// Why the fit did not converge, as a warning; `None` where it did.
    pub fn convergence_warning(&self) -> Option<String> {
        let reason = self.ending.reason()?;
        Some(format!(
            "the fit did not converge ({reason}): treat the parameters with care"
        ))
    }

    /// What the user should know of the fit before believing it.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::from_iter(self.convergence_warning());
        for p in self.parameters.iter().filter(|p| p.at_bound) {
            warnings.push(format!(
                "{} stopped at the end of its range ({:.4e} {}): the model or the robot file is wrong there",
                p.name, p.value, p.unit
            ));
        }
        if self.reduced_chi2 > FAR_ABOVE_NOISE {
            warnings.push(format!(
                "the calibrated model leaves {:.1} times the variance of the noise: physics is missing, or a file is not \
                 what campaign.toml says (units, quantity, posture, node); standard errors are widened accordingly",
                self.reduced_chi2
            ));
        }
        if !self.rivals.is_empty() {
            warnings.push(self.told_of_rivals());
        }
        if self.starts > 1 && self.starts_agreeing < 2 && self.reduced_chi2 > SUSPICIOUS_CHI2 {
            warnings.push(format!(
                "only one of {} starting points led to this fit: there may be a better one (try --starts 20)",
                self.starts
            ));
        }
        warnings
    }
}

/// Misfit from which on the user is told.
pub(crate) const FAR_ABOVE_NOISE: f64 = 1.5;
/// Misfit above which noise alone is not credible any more and further starting points are tried.
const SUSPICIOUS_CHI2: f64 = 1.15;
/// Complex values on which starting points are followed, about; and those on which they are compared only.
const SKETCH_VALUES: usize = 6000;
pub(crate) const GLANCE_VALUES: usize = 1000;
/// Lines of each FRF that a sketch keeps at least: a robot's resonances are some per cent wide.
const SKETCH_LINES: usize = 100;
/// Every how many lines a sketch keeps at most, where there are more than enough.
const COARSE_STRIDE: usize = 4;

/// When to stop on few lines.
const ROUGH: Stopping = Stopping {
    max_iterations: 40,
    relative_decrease: 1e-4,
};
/// Iterations of a look at a further starting point.
const LOOK_ITERATIONS: usize = 10;
/// Times the lowest misfit from which on a starting point is given up after the look.
const HOPELESS: f64 = 1.5;
/// Share of the misfit that an optimum leaves at most where the one before it was a trap.
const TRAPPED: f64 = 0.9;

/// The likelihood from a point that is in the right basin already: log magnitudes could only lead out of it.
fn resume(model: &StructureModel, sketch: &FrfData, start: &[f64], rough: Stopping) -> Result<(Fit, usize)> {
    let fit = minimise(
        &problem(model, sketch, Misfit::Complex),
        start,
        &model.bounds(),
        rough,
    )?;
    let iterations = fit.iterations;
    Ok((fit, iterations))
}

/// Log magnitude first, then the complex values: gets into the right basin.
fn approach(
    model: &StructureModel,
    sketch: &FrfData,
    start: &[f64],
    rough: Stopping,
) -> Result<(Fit, usize)> {
    let bounds = model.bounds();
    let near = minimise(
        &problem(model, sketch, Misfit::LogMagnitude),
        start,
        &bounds,
        rough,
    )?;
    let fit = minimise(
        &problem(model, sketch, Misfit::Complex),
        &near.theta,
        &bounds,
        rough,
    )?;
    let iterations = near.iterations + fit.iterations;
    Ok((fit, iterations))
}

fn problem<'a>(model: &'a StructureModel, data: &'a FrfData, misfit: Misfit) -> FrfProblem<'a> {
    FrfProblem {
        model,
        data,
        misfit,
        stride: 1,
    }
}

/// Refines from a point that is already in the right basin, on all lines.
pub fn refine(model: &StructureModel, data: &FrfData, start: &[f64]) -> Result<Fit> {
    let values = (2 * data.value_count()).max(1) as f64;
    // Of N values a share of 10⁻³/N is what a thirtieth of a standard error brings, the errors being as wide as the misfit makes them.
    let stopping = Stopping {
        relative_decrease: (1e-3 / values).clamp(1e-9, 5e-8),
        ..Stopping::default()
    };
    minimise(
        &problem(model, data, Misfit::Complex),
        start,
        &model.bounds(),
        stopping,
    )
}

/// About so many complex values of the data, spread over lines, references, postures and levels of the hammer.
pub(crate) fn sketch(data: &FrfData, values: usize) -> FrfData {
    let lines = data.blocks.iter().map(|b| b.frequency_hz.len()).min();
    let lines = lines.unwrap_or(0).max(1);
    let share = |data: &FrfData| data.value_count().div_ceil(values).max(1);
    // Thinned measurements are left alone: a resonance needs its few lines.
    let stride = match lines {
        0..200 => 1,
        _ => share(data)
            .max(COARSE_STRIDE)
            .min((lines / SKETCH_LINES).max(COARSE_STRIDE)),
    };
    let fewer_lines = data.thinned(stride, 1);
    let fewer_references = fewer_lines.thinned(1, share(&fewer_lines).min(3));
    let every = share(&fewer_references);
    let blocks = fewer_references.blocks.iter().enumerate();
    FrfData {
        blocks: blocks
            .filter(|(i, _)| is_kept(*i, every))
            .map(|(_, block)| block.clone())
            .collect(),
        ..fewer_references
    }
}

/// Of `every` so many blocks one, at another place each time: where two levels of the hammer take turns, both stay.
fn is_kept(i: usize, every: usize) -> bool {
    i % every == (i / every) % every
}

/// Common factors on the joint stiffnesses that are tried: a robot file may be off by as much as its parameters' range.
const FACTORS: i32 = 10;
const LARGEST_LN_FACTOR: f64 = 3.5;
/// Values of one joint's stiffness that are tried with the others as they are: so many to either side, …
const ONE_JOINT: i32 = 8;
/// … this far apart, natural logarithm.
const ONE_JOINT_STEP: f64 = 0.25;
/// The same by the likelihood, whose valleys are as narrow as resonances are: a fortieth of a frequency apart.
const ONE_JOINT_NARROW: i32 = 40;
const ONE_JOINT_NARROW_STEP: f64 = 0.05;
/// A joint that is further than this from the robot file, natural logarithm, is tried there, too.
const FAR_LN_FACTOR: f64 = 1.5;
/// Starting points that a scan may give, and how often single joints are scanned.
const SCANNED: usize = 3;
const ROUNDS: usize = 4;

/// A further starting point.
#[derive(Debug, Clone)]
struct Start {
    theta: Vec<f64>,
    /// By what it is followed first: log magnitudes lead to an optimum from afar, and out of a narrow one.
    by: Misfit,
}

impl Start {
    fn afar(theta: Vec<f64>) -> Start {
        let by = Misfit::LogMagnitude;
        Start { theta, by }
    }
}

/// A look at few of the data along lines through the parameters: where further starting points promise most.
struct Scan<'a> {
    model: &'a StructureModel,
    sketch: &'a FrfData,
    /// Very few, which is enough for log magnitudes.
    glance: FrfData,
}

impl Scan<'_> {
    /// Where a scan of `moved`, so many steps to either side of `theta`, has its local minima, with their costs, other than the one in
    /// the middle.
    fn valleys(
        &self,
        by: Misfit,
        theta: &[f64],
        moved: &[usize],
        (count, step): (i32, f64),
    ) -> Vec<(f64, Start)> {
        let data = match by {
            Misfit::LogMagnitude => &self.glance,
            Misfit::Complex => self.sketch,
        };
        let (problem, bounds) = (problem(self.model, data, by), self.model.bounds());
        let offsets: Vec<f64> = (-count..=count).map(|k| f64::from(k) * step).collect();
        let points: Vec<(f64, Start)> = offsets
            .par_iter()
            .map(|offset| {
                stop::point();
                let mut theta = theta.to_vec();
                for &i in moved {
                    theta[i] = (theta[i] + offset).clamp(bounds[i][0], bounds[i][1]);
                }
                let cost = problem.cost(&theta).unwrap_or(f64::INFINITY);
                (cost, Start { theta, by })
            })
            .collect();
        let cost = |i: usize| points[i].0;
        (0..points.len())
            .filter(|&i| offsets[i] != 0.0)
            .filter(|&i| {
                (i == 0 || cost(i) < cost(i - 1)) && (i + 1 == points.len() || cost(i) <= cost(i + 1))
            })
            .map(|i| points[i].clone())
            .collect()
    }

    /// All joints stiffer or softer by one factor than the robot file says.
    fn common_factor(&self) -> Vec<Start> {
        let joints: Vec<usize> = (0..self.model.robot.joint_count()).collect();
        let steps = (FACTORS, LARGEST_LN_FACTOR / f64::from(FACTORS));
        lowest(self.valleys(Misfit::LogMagnitude, &self.model.nominal_theta(), &joints, steps))
    }

    /// Joints that `found` has far from where the robot file does, put back there: beyond the reach of the scan along each joint
    /// a joint may have gone where another one could have taken up the misfit.
    fn joints_put_back(&self, found: &[f64]) -> Option<Start> {
        let nominal = self.model.nominal_theta();
        let far = |i: &usize| (found[*i] - nominal[*i]).abs() > FAR_LN_FACTOR;
        let gone: Vec<usize> = (0..self.model.robot.joint_count()).filter(far).collect();
        let mut back = found.to_vec();
        gone.iter().for_each(|&i| back[i] = nominal[i]);
        (!gone.is_empty()).then(|| Start::afar(back))
    }

    /// Single joints away from where `found`, on the sketch, has them. By log magnitudes from afar; by the likelihood those that are
    /// hardly determined there, for it has narrow valleys: a joint whose resonance has left the measured band comes back so.
    fn single_joints(&self, found: &Fit) -> Vec<Start> {
        let along = |by, joint, steps| self.valleys(by, &found.theta, &[joint], steps);
        let joints = 0..self.model.robot.joint_count();
        let afar = joints
            .clone()
            .flat_map(|joint| along(Misfit::LogMagnitude, joint, (ONE_JOINT, ONE_JOINT_STEP)));
        let is_loose = |joint: &usize| {
            let rise = 0.5 * found.hessian[(*joint, *joint)] * ONE_JOINT_STEP.powi(2);
            rise < (HOPELESS - 1.0) * found.cost
        };
        let narrow = (ONE_JOINT_NARROW, ONE_JOINT_NARROW_STEP);
        let close = joints
            .filter(is_loose)
            .flat_map(|joint| along(Misfit::Complex, joint, narrow))
            .filter(|(cost, _)| *cost < HOPELESS * found.cost);
        let mut starts = lowest(afar.collect());
        starts.extend(lowest(close.collect()));
        starts
    }
}

/// The most promising starting points of a scan.
fn lowest(mut points: Vec<(f64, Start)>) -> Vec<Start> {
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    points.truncate(SCANNED);
    points.into_iter().map(|(_, point)| point).collect()
}

/// Short fits from `points`, and to their end those that are not left far behind, `first` among them; best first. Those that begin at a
/// point of the likelihood's own count only where they lead out of a trap: most lead back or next to `first`, and between optima about as
/// good those found from afar decide.
fn race(model: &StructureModel, sketch: &FrfData, points: &[Start], first: Fit) -> Vec<Fit> {
    let progress = Progress::new("calibrating from further starting points", points.len());
    let look = Stopping {
        max_iterations: LOOK_ITERATIONS,
        ..ROUGH
    };
    let looks: Vec<(Misfit, Fit)> = points
        .par_iter()
        .filter_map(|start| {
            let fit = match start.by {
                Misfit::LogMagnitude => approach(model, sketch, &start.theta, look),
                Misfit::Complex => resume(model, sketch, &start.theta, look),
            };
            progress.step();
            fit.ok().map(|(fit, _)| (start.by, fit))
        })
        .collect();
    // Starts that a look leaves far behind the others would only end in another optimum.
    let lowest = looks.iter().map(|(_, f)| f.cost).fold(first.cost, f64::min);
    let mut fits: Vec<Fit> = looks
        .par_iter()
        .filter(|(_, look)| look.cost < HOPELESS * lowest)
        .filter_map(|(by, look)| {
            let (fit, _) = resume(model, sketch, &look.theta, ROUGH).ok()?;
            (*by == Misfit::LogMagnitude || fit.cost < TRAPPED * first.cost).then_some(fit)
        })
        .collect();
    fits.push(first);
    fits.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    fits
}

/// Calibrates `model` to `data`, from the solution that the model brings along where it has one, else from its nominal
/// values and from `measured` (such as [`crate::identify::frfs::modal_start`] gives), whichever leads further down.
pub fn calibrate(
    model: &StructureModel,
    data: &FrfData,
    measured: Option<&[f64]>,
    options: Options,
) -> Result<Calibration> {
    let sketch_data = sketch(data, SKETCH_VALUES);
    let nominal = model.nominal_theta();
    let (mut first, mut iterations) = match model.start() {
        Some(start) => resume(model, &sketch_data, start, ROUGH)?,
        None => approach(model, &sketch_data, &nominal, ROUGH)?,
    };
    let (mut starts, mut agreeing) = (1, 1);
    // Optima other than the answer.
    let mut others = Vec::new();
    let misfit = |fit: &Fit, data: &FrfData| {
        2.0 * fit.cost / ((2 * data.value_count()) as f64 - model.parameters.len() as f64).max(1.0)
    };
    // As with the further starting points below, one that leads nowhere is no reason to give up.
    let measured = measured.filter(|start| start.len() == nominal.len());
    if let (Some(start), None) = (measured, model.start())
        && let Ok((other, more)) = approach(model, &sketch_data, start, ROUGH)
    {
        starts += 1;
        iterations += more;
        let alike = (other.cost / first.cost - 1.0).abs() < 1e-3;
        agreeing += usize::from(alike);
        match other.cost < first.cost {
            true => others.push(std::mem::replace(&mut first, other)),
            false => others.push(other),
        }
    }
    if misfit(&first, &sketch_data) > SUSPICIOUS_CHI2 && options.extra_starts > 0 {
        let scan = Scan {
            model,
            sketch: &sketch_data,
            glance: sketch(&sketch_data, GLANCE_VALUES),
        };
        let mut points = scan.common_factor();
        let centre = points.first().map_or(&nominal, |start| &start.theta);
        let scattered = scattered_about(&model.parameters, centre, options.extra_starts, options.seed);
        points.extend(scattered.into_iter().map(Start::afar));
        for _ in 0..ROUNDS {
            points.extend(scan.single_joints(&first));
            points.extend(scan.joints_put_back(&first.theta));
            let before = first.cost;
            let mut fits = race(model, &sketch_data, &points, first);
            starts += points.len();
            let lowest = fits[0].cost;
            agreeing = fits.iter().filter(|f| f.cost < lowest * 1.001).count();
            first = fits.remove(0);
            others.extend(fits);
            // A joint that was trapped lets go of the others: from a better point the next look along each joint may help.
            if first.cost > before * (1.0 - 1e-3) || misfit(&first, &sketch_data) < SUSPICIOUS_CHI2 {
                break;
            }
            points.clear();
        }
    }
    let of_sketch = misfit(&first, &sketch_data);
    let others = match of_sketch > SUSPICIOUS_CHI2 {
        true => rival_optima::close_to(&first, others, of_sketch),
        false => Vec::new(),
    };
    // A solution that the model brings along is left only for a better one: where physics is missing the optimum lies in a flat
    // valley, and a way round by the sketch would end elsewhere in it.
    let whole = problem(model, data, Misfit::Complex);
    let from = match model.start() {
        Some(start) if whole.cost(start)? <= whole.cost(&first.theta)? => start,
        _ => &first.theta,
    };
    let best = refine(model, data, from)?;
    let (best, rivals) = rival_optima::settled(data, best, &others, |theta| refine(model, data, theta));
    iterations += best.iterations;

    let reduced_chi2 = misfit(&best, data);
    let covariance = covariance(&best, reduced_chi2)?;
    let parameters = estimates(&model.parameters, &best, reduced_chi2)?;
    Ok(Calibration {
        parameters,
        widened: vec![1.0; best.theta.len()],
        theta: best.theta,
        covariance,
        reduced_chi2,
        iterations,
        ending: best.ending,
        starts,
        starts_agreeing: agreeing,
        rivals,
    })
}

/// Covariance on the solver's scale, widened where the misfit exceeds the noise.
pub(crate) fn covariance(fit: &Fit, reduced_chi2: f64) -> Result<DMatrix<f64>> {
    // Solved on unit diagonal: the parameters' information differs by many orders of magnitude.
    let n = fit.hessian.nrows();
    let scale: Vec<f64> = (0..n).map(|i| fit.hessian[(i, i)].sqrt()).collect();
    let scaled = DMatrix::from_fn(n, n, |i, j| fit.hessian[(i, j)] / (scale[i] * scale[j]));
    let inverse = scaled
        .cholesky()
        .ok_or_else(|| {
            Error::computation("the data do not determine the parameters (singular information matrix)")
        })?
        .inverse();
    Ok(DMatrix::from_fn(n, n, |i, j| {
        inverse[(i, j)] / (scale[i] * scale[j]) * reduced_chi2.max(1.0)
    }))
}

/// The fitted parameters in natural units with standard errors.
pub fn estimates(parameters: &[Parameter], fit: &Fit, reduced_chi2: f64) -> Result<Vec<Estimate>> {
    let covariance = covariance(fit, reduced_chi2)?;
    Ok(parameters
        .iter()
        .enumerate()
        .map(|(i, p)| Estimate {
            name: p.name.clone(),
            value: p.natural(fit.theta[i]),
            unit: p.unit,
            std_error: p.natural_std(fit.theta[i], covariance[(i, i)].sqrt()),
            initial: p.nominal,
            at_bound: fit.at_bound.contains(&i),
        })
        .collect())
}

/// Draws from the priors, twice as wide, within the bounds; on the solver's scale.
pub fn scattered_starts(parameters: &[Parameter], count: usize, seed: u64) -> Vec<Vec<f64>> {
    let nominal: Vec<f64> = parameters.iter().map(|p| p.internal(p.nominal)).collect();
    scattered_about(parameters, &nominal, count, seed)
}

/// As [`scattered_starts`], about another centre.
fn scattered_about(parameters: &[Parameter], centre: &[f64], count: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (0..count)
        .map(|_| {
            let draw = |(p, centre): (&Parameter, &f64)| {
                // Uniform on ±√3·2σ has the standard deviation 2σ and no far tails.
                let half = p.prior.map_or(0.1, |prior| prior.std) * 2.0 * 3f64.sqrt();
                let [low, high] = p.internal_bounds();
                (centre + half * random.random_range(-1.0..1.0)).clamp(low, high)
            };
            parameters.iter().zip(centre).map(draw).collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::is_kept;

    /// Blocks of a strong and a soft hit by turns, two a posture: a sketch of every second one had strong hits only.
    #[test]
    fn a_sketch_keeps_both_levels_of_the_hammer() {
        for every in 2..=4 {
            let kept: Vec<usize> = (0..24).filter(|i| is_kept(*i, every)).collect();
            assert_eq!(kept.len(), 24 / every, "{every}");
            let strong = kept.iter().filter(|i| *i % 2 == 0).count();
            assert!(
                (kept.len() / 3..=2 * kept.len() / 3 + 1).contains(&strong),
                "{every}: {kept:?}"
            );
        }
    }
}
