//! Bounded, column-scaled Levenberg–Marquardt as an argmin solver.
//!
//! Works on normal equations (the problems here have at most some dozens of parameters and up to 10⁶ residuals, so the
//! Jacobian is never stored). Scaling after Moré (1978), damping update after Nielsen (1999), bounds by projection with
//! an active set.

use argmin::core::{Error as ArgminError, Executor, IterState, KV, Problem, Solver, State};
use argmin::core::{TerminationReason, TerminationStatus};
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use nalgebra::{DMatrix, DVector};

use crate::{Error, Result};

/// Half the sum of squares at a point with its gradient and Gauss–Newton Hessian (both of `cost`).
#[derive(Debug, Clone)]
pub struct Linearisation {
    /// ½ Σ r².
    pub cost: f64,
    /// Its first derivatives.
    pub gradient: DVector<f64>,
    /// Its second derivatives without those of the residuals.
    pub hessian: DMatrix<f64>,
}

impl Linearisation {
    /// Of no residuals; so many parameters.
    pub fn zero(count: usize) -> Self {
        Linearisation {
            cost: 0.0,
            gradient: DVector::zeros(count),
            hessian: DMatrix::zeros(count, count),
        }
    }

    /// Adds the sums over other residuals.
    pub fn add(&mut self, other: &Linearisation) {
        self.cost += other.cost;
        self.gradient += &other.gradient;
        self.hessian += &other.hessian;
    }

    /// Adds ½r² of one residual that depends on parameter `i` alone, as [`half_square`](crate::parameter::Prior::half_square) of a
    /// prior gives it; of a sum without derivatives its value alone.
    pub fn add_half_square(&mut self, i: usize, [value, slope, curvature]: [f64; 3]) {
        self.cost += value;
        if i < self.gradient.len() {
            self.gradient[i] += slope;
            self.hessian[(i, i)] += curvature;
        }
    }

    /// The step of Gauss and Newton, −H⁻¹g, with the columns scaled to a unit diagonal; parameters that change nothing stay. `None`
    /// where a direction is not determined at all.
    pub fn newton_step(&self) -> Option<DVector<f64>> {
        /// Against directions that the data do not tell apart.
        const RIDGE: f64 = 1e-9;
        let hessian = &self.hessian;
        let scale = hessian.diagonal().map(|h| {
            if h > f64::MIN_POSITIVE {
                h.sqrt().recip()
            } else {
                0.0
            }
        });
        let mut scaled = DMatrix::from_fn(hessian.nrows(), hessian.ncols(), |i, j| {
            scale[i] * hessian[(i, j)] * scale[j]
        });
        for i in 0..scaled.nrows() {
            scaled[(i, i)] = 1.0 + RIDGE;
        }
        let step = scaled.cholesky()?.solve(&-self.gradient.component_mul(&scale));
        Some(step.component_mul(&scale))
    }

    /// Adds residuals with their derivatives (residuals × parameters, column by column).
    pub fn push(&mut self, residual: &[f64], jacobian: &[f64]) {
        self.cost += 0.5 * residual.iter().map(|r| r * r).sum::<f64>();
        let count = self.gradient.len();
        if count == 0 {
            return;
        }
        let jacobian = MatRef::from_column_major_slice(jacobian, residual.len(), count);
        let residual = MatRef::from_column_major_slice(residual, residual.len(), 1);
        let add = |target: &mut [f64], columns: usize, right: MatRef<f64>| {
            let target = MatMut::from_column_major_slice_mut(target, count, columns);
            matmul(target, Accum::Add, jacobian.transpose(), right, 1.0, Par::Seq);
        };
        add(self.gradient.as_mut_slice(), 1, residual);
        add(self.hessian.as_mut_slice(), count, jacobian);
    }
}

/// A nonlinear least-squares problem, priors included.
pub trait LeastSquares {
    /// ½ Σ r².
    fn cost(&self, theta: &[f64]) -> Result<f64>;
    /// `cost` with its derivatives.
    fn linearise(&self, theta: &[f64]) -> Result<Linearisation>;
}

impl<P: LeastSquares + ?Sized> LeastSquares for &P {
    fn cost(&self, theta: &[f64]) -> Result<f64> {
        (**self).cost(theta)
    }
    fn linearise(&self, theta: &[f64]) -> Result<Linearisation> {
        (**self).linearise(theta)
    }
}

/// Why the solver stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// The undamped Gauss–Newton step over the parameters that are free promises less than the tolerance: ½ gᵀH⁻¹g, the
    /// gradient measured by the curvature.
    Converged,
    /// Steps still promise more than the tolerance, but bring less: a curved valley.
    Crawling,
    /// No step, however short, improves the fit.
    Stuck,
    /// The iterations ran out.
    OutOfIterations,
}

impl Ending {
    /// Why the fit did not converge; `None` where it did.
    pub fn reason(self) -> Option<&'static str> {
        match self {
            Ending::Converged => None,
            Ending::Crawling => Some(
                "steps along a curved valley bring less than they promise: two or more parameters can hardly be told apart",
            ),
            Ending::Stuck => Some("no step improves the fit, although its gradient is not zero"),
            Ending::OutOfIterations => Some("the iterations ran out"),
        }
    }
}

/// Where the solver stopped, and why.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Solver's scale.
    pub theta: Vec<f64>,
    /// ½ Σ r² there.
    pub cost: f64,
    /// Gauss–Newton Hessian there.
    pub hessian: DMatrix<f64>,
    /// Steps taken.
    pub iterations: usize,
    /// Why it stopped.
    pub ending: Ending,
    /// Indices of parameters that stopped at a bound.
    pub at_bound: Vec<usize>,
}

/// When to stop.
#[derive(Debug, Clone, Copy)]
pub struct Stopping {
    /// Steps taken at most.
    pub max_iterations: usize,
    /// Relative decrease of the cost that a converged step still promises.
    pub relative_decrease: f64,
}

impl Fit {
    /// Whether the optimum was found.
    pub fn converged(&self) -> bool {
        self.ending == Ending::Converged
    }
}

impl Stopping {
    /// Steps in a row that may bring less than the tolerance although they promise more. A search gives up at once, a
    /// final fit does not.
    fn patience(&self) -> usize {
        if self.relative_decrease < 1e-7 { 4 } else { 1 }
    }
}

impl Default for Stopping {
    fn default() -> Self {
        Stopping {
            max_iterations: 60,
            relative_decrease: 1e-9,
        }
    }
}

struct LevenbergMarquardt {
    bounds: Vec<[f64; 2]>,
    relative_decrease: f64,
    damping: f64,
    growth: f64,
    /// Largest diagonal of the Hessian seen so far (column scaling).
    scaling: DVector<f64>,
    /// At the current point; `None` until it is needed.
    here: Option<Linearisation>,
    /// The first trial of an iteration is linearised at once: most are accepted, and then nothing is worked out twice.
    speculative: bool,
    patience: usize,
    /// Steps in a row that brought less than the tolerance.
    crawled: usize,
    ending: Option<Ending>,
}

type LmState = IterState<Vec<f64>, (), (), (), (), f64>;

/// Decrease of the cost that is not worth a step: the share of the cost, and never less than what is no evidence at all
/// (costs are half of χ²).
fn tolerance(relative_decrease: f64, cost: f64) -> f64 {
    (relative_decrease * cost.abs()).max(1e-10)
}

/// Rejected trial steps in one iteration before the solver says that it cannot improve.
const MAX_TRIALS: usize = 12;

impl LevenbergMarquardt {
    fn clip(&self, theta: &mut [f64]) {
        for (t, [low, high]) in theta.iter_mut().zip(&self.bounds) {
            *t = t.clamp(*low, *high);
        }
    }

    /// Parameters free to move: not at a bound that the descent direction pushes against.
    fn free(&self, theta: &[f64], gradient: &DVector<f64>) -> Vec<usize> {
        (0..theta.len())
            .filter(|&i| {
                let [low, high] = self.bounds[i];
                low < high
                    && !((theta[i] <= low && gradient[i] > 0.0) || (theta[i] >= high && gradient[i] < 0.0))
            })
            .collect()
    }

    /// What the undamped step over the free parameters promises: zero at an optimum. Infinite where the curvature is
    /// singular.
    fn promise(&self, here: &Linearisation, free: &[usize]) -> f64 {
        let m = free.len();
        // On unit diagonal: the parameters' curvatures differ by many orders of magnitude.
        let root: Vec<f64> = free
            .iter()
            .map(|&i| here.hessian[(i, i)].sqrt().max(f64::MIN_POSITIVE))
            .collect();
        let hessian = DMatrix::from_fn(m, m, |i, j| {
            here.hessian[(free[i], free[j])] / (root[i] * root[j])
        });
        let gradient = DVector::from_fn(m, |i, _| here.gradient[free[i]] / root[i]);
        match hessian.cholesky() {
            Some(cholesky) => 0.5 * gradient.dot(&cholesky.solve(&gradient)),
            None => f64::INFINITY,
        }
    }

    /// Damped step over the free parameters.
    fn step(&self, here: &Linearisation, free: &[usize]) -> Option<DVector<f64>> {
        let m = free.len();
        let hessian = DMatrix::from_fn(m, m, |i, j| {
            let damping = if i == j {
                self.damping * self.scaling[free[i]]
            } else {
                0.0
            };
            here.hessian[(free[i], free[j])] + damping
        });
        let gradient = DVector::from_fn(m, |i, _| here.gradient[free[i]]);
        let reduced = -hessian.cholesky()?.solve(&gradient);
        let mut step = DVector::zeros(here.gradient.len());
        for (i, &index) in free.iter().enumerate() {
            step[index] = reduced[i];
        }
        Some(step)
    }
}

fn predicted_decrease(here: &Linearisation, step: &DVector<f64>) -> f64 {
    -(here.gradient.dot(step) + 0.5 * step.dot(&(&here.hessian * step)))
}

impl<O: LeastSquares> Solver<O, LmState> for LevenbergMarquardt {
    fn name(&self) -> &str {
        "bounded Levenberg-Marquardt"
    }

    fn init(
        &mut self,
        problem: &mut Problem<O>,
        mut state: LmState,
    ) -> std::result::Result<(LmState, Option<KV>), ArgminError> {
        let mut theta = state.take_param().unwrap_or_default();
        self.clip(&mut theta);
        let here = problem.problem("linearise_count", |p| Ok(p.linearise(&theta)?))?;
        let cost = here.cost;
        self.here = Some(here);
        Ok((state.param(theta).cost(cost), None))
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<O>,
        mut state: LmState,
    ) -> std::result::Result<(LmState, Option<KV>), ArgminError> {
        let theta = state.take_param().unwrap_or_default();
        let here = match self.here.take() {
            Some(here) => here,
            None => problem.problem("linearise_count", |p| Ok(p.linearise(&theta)?))?,
        };
        for (s, d) in self.scaling.iter_mut().zip(here.hessian.diagonal().iter()) {
            *s = s.max(*d);
        }
        let free = self.free(&theta, &here.gradient);
        let tolerance = tolerance(self.relative_decrease, here.cost);
        if self.promise(&here, &free) <= tolerance {
            self.ending = Some(Ending::Converged);
            let cost = here.cost;
            self.here = Some(here);
            let finished = state.param(theta).cost(cost);
            return Ok((finished.terminate_with(TerminationReason::SolverConverged), None));
        }
        let mut next = None;
        for number in 0..MAX_TRIALS {
            let Some(step) = self.step(&here, &free) else {
                self.damping = (self.damping * 10.0).max(1e-6);
                continue;
            };
            let mut trial: Vec<f64> = theta.iter().zip(step.iter()).map(|(t, s)| t + s).collect();
            self.clip(&mut trial);
            let taken = DVector::from_iterator(theta.len(), trial.iter().zip(&theta).map(|(a, b)| a - b));
            let promised = predicted_decrease(&here, &taken).max(f64::MIN_POSITIVE);
            // A trial point where the model has no answer counts as infinitely bad.
            let there = if self.speculative && number == 0 {
                problem.problem("linearise_count", |p| Ok(p.linearise(&trial).ok()))?
            } else {
                None
            };
            let cost = match &there {
                Some(there) => there.cost,
                None if self.speculative && number == 0 => f64::INFINITY,
                None => problem.problem("cost_count", |p| Ok(p.cost(&trial).unwrap_or(f64::INFINITY)))?,
            };
            let gain = (here.cost - cost) / promised;
            if cost.is_finite() && cost < here.cost && gain > 1e-4 {
                self.damping *= (1.0 - (2.0 * gain - 1.0).powi(3)).max(1.0 / 3.0);
                self.growth = 2.0;
                next = Some((trial, cost, there));
                break;
            }
            self.damping *= self.growth;
            self.growth *= 2.0;
        }
        match next {
            Some((trial, cost, there)) => {
                let crawls = here.cost - cost <= tolerance && self.damping <= 1.0;
                self.crawled = if crawls { self.crawled + 1 } else { 0 };
                self.here = there;
                let next = state.param(trial).cost(cost);
                if self.crawled < self.patience {
                    return Ok((next, None));
                }
                self.ending = Some(Ending::Crawling);
                let reason = TerminationReason::SolverExit("steps bring too little".into());
                Ok((next.terminate_with(reason), None))
            }
            None => {
                self.ending = Some(Ending::Stuck);
                let cost = here.cost;
                self.here = Some(here);
                let finished = state.param(theta).cost(cost);
                let reason = TerminationReason::SolverExit("no step improves the fit".into());
                Ok((finished.terminate_with(reason), None))
            }
        }
    }

    fn terminate(&mut self, state: &LmState) -> TerminationStatus {
        if state.terminated() {
            return state.get_termination_status().clone();
        }
        TerminationStatus::NotTerminated
    }
}

/// Minimises ½ Σ r² from `start` within `bounds` (one pair a parameter; infinities allowed).
pub fn minimise<P: LeastSquares>(
    problem: &P,
    start: &[f64],
    bounds: &[[f64; 2]],
    stopping: Stopping,
) -> Result<Fit> {
    let Descent {
        theta,
        iterations,
        solver,
        ..
    } = descend(problem, start, bounds, stopping, true)?;
    let ending = solver.ending;
    let here = match &solver.here {
        Some(here) => here.clone(),
        None => problem.linearise(&theta)?,
    };
    // The last step may have reached the optimum.
    let ending = match ending {
        Some(Ending::Converged) => Ending::Converged,
        other => {
            let free = solver.free(&theta, &here.gradient);
            if solver.promise(&here, &free) <= tolerance(stopping.relative_decrease, here.cost) {
                Ending::Converged
            } else {
                other.unwrap_or(Ending::OutOfIterations)
            }
        }
    };
    let at_bound = theta
        .iter()
        .zip(bounds)
        .enumerate()
        .filter(|(_, (t, [low, high]))| **t <= *low || **t >= *high)
        .map(|(i, _)| i)
        .collect();
    let mut hessian = here.hessian;
    for i in (0..bounds.len()).filter(|i| bounds[*i][0] == bounds[*i][1]) {
        // What is held is known: it takes nothing from what the data say of the others.
        let own = hessian[(i, i)];
        hessian.row_mut(i).fill(0.0);
        hessian.column_mut(i).fill(0.0);
        hessian[(i, i)] = own.max(f64::MIN_POSITIVE);
    }
    Ok(Fit {
        theta,
        cost: here.cost,
        hessian,
        iterations,
        ending,
        at_bound,
    })
}

/// One step from `start`: where it leads and the cost (½ Σ r²) there, without the derivatives there.
pub fn one_step<P: LeastSquares>(problem: &P, start: &[f64], bounds: &[[f64; 2]]) -> Result<(f64, Vec<f64>)> {
    let stopping = Stopping {
        max_iterations: 1,
        ..Stopping::default()
    };
    let descent = descend(problem, start, bounds, stopping, false)?;
    Ok((descent.cost, descent.theta))
}

struct Descent {
    theta: Vec<f64>,
    cost: f64,
    iterations: usize,
    solver: LevenbergMarquardt,
}

fn descend<P: LeastSquares>(
    problem: &P,
    start: &[f64],
    bounds: &[[f64; 2]],
    stopping: Stopping,
    speculative: bool,
) -> Result<Descent> {
    let solver = LevenbergMarquardt {
        bounds: bounds.to_vec(),
        relative_decrease: stopping.relative_decrease,
        damping: 1e-3,
        growth: 2.0,
        scaling: DVector::from_element(start.len(), f64::MIN_POSITIVE),
        here: None,
        speculative,
        patience: stopping.patience(),
        crawled: 0,
        ending: None,
    };
    let result = Executor::new(problem, solver)
        .configure(|state| {
            state
                .param(start.to_vec())
                .max_iters(stopping.max_iterations as u64)
        })
        .timer(false)
        .run()
        .map_err(|error| match error.downcast::<Error>() {
            Ok(ours) => ours,
            Err(other) => Error::computation(format!("the fit failed: {other}")),
        })?;
    let iterations = result.state.get_iter() as usize;
    let cost = result.state.best_cost;
    let theta = result
        .state
        .best_param
        .or(result.state.param)
        .ok_or_else(|| Error::computation("the fit returned no parameters"))?;
    Ok(Descent {
        theta,
        cost,
        iterations,
        solver: result.solver,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock as least squares: r = (10 (y − x²), 1 − x).
    struct Rosenbrock;

    impl LeastSquares for Rosenbrock {
        fn cost(&self, t: &[f64]) -> Result<f64> {
            Ok(self.linearise(t)?.cost)
        }
        fn linearise(&self, t: &[f64]) -> Result<Linearisation> {
            let r = DVector::from_vec(vec![10.0 * (t[1] - t[0] * t[0]), 1.0 - t[0]]);
            let j = DMatrix::from_row_slice(2, 2, &[-20.0 * t[0], 10.0, -1.0, 0.0]);
            Ok(Linearisation {
                cost: 0.5 * r.norm_squared(),
                gradient: j.transpose() * &r,
                hessian: j.transpose() * j,
            })
        }
    }

    #[test]
    fn rosenbrock_is_solved() {
        let free = [[f64::NEG_INFINITY, f64::INFINITY]; 2];
        let fit = minimise(&Rosenbrock, &[-1.2, 1.0], &free, Stopping::default()).unwrap();
        assert!(fit.converged() && fit.at_bound.is_empty());
        assert!(
            (fit.theta[0] - 1.0).abs() < 1e-6 && (fit.theta[1] - 1.0).abs() < 1e-6,
            "{:?}",
            fit.theta
        );
    }

    /// Cut short, the fit says so: a small step is no convergence.
    #[test]
    fn what_did_not_converge_says_why() {
        let free = [[f64::NEG_INFINITY, f64::INFINITY]; 2];
        let short = Stopping {
            max_iterations: 3,
            ..Stopping::default()
        };
        let fit = minimise(&Rosenbrock, &[-1.2, 1.0], &free, short).unwrap();
        assert_eq!(fit.ending, Ending::OutOfIterations);
        assert!(fit.ending.reason().is_some() && Ending::Converged.reason().is_none());
        // At the optimum nothing is left to do.
        let fit = minimise(&Rosenbrock, &[1.0, 1.0], &free, short).unwrap();
        assert!(fit.converged());
    }

    /// A held parameter stays, and tells the others nothing.
    #[test]
    fn what_is_held_stays() {
        let bounds = [[0.5, 0.5], [-2.0, 2.0]];
        let fit = minimise(&Rosenbrock, &[-1.2, 1.0], &bounds, Stopping::default()).unwrap();
        assert!(fit.converged() && (fit.theta[1] - 0.25).abs() < 1e-6 && fit.theta[0] == 0.5);
        assert_eq!(fit.hessian[(0, 1)], 0.0);
        assert!((fit.hessian[(1, 1)] - 100.0).abs() < 1e-9);
    }

    /// With x ≤ 0.5 the optimum is on the bound, at y = x² (closed form).
    #[test]
    fn an_active_bound_is_found_and_said() {
        let bounds = [[-2.0, 0.5], [-2.0, 2.0]];
        let fit = minimise(&Rosenbrock, &[-1.2, 1.0], &bounds, Stopping::default()).unwrap();
        assert!(fit.converged());
        assert_eq!(fit.at_bound, vec![0]);
        assert!(
            (fit.theta[0] - 0.5).abs() < 1e-12 && (fit.theta[1] - 0.25).abs() < 1e-6,
            "{:?}",
            fit.theta
        );
    }
}
