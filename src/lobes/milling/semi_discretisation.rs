//! Milling limits by semi-discretisation in time, first order: Insperger & Stépán, "Semi-Discretization for
//! Time-Delay Systems" (Springer 2011), chapters 3 and 5.
//!
//! The period T between two teeth is cut into steps. In each the structure and the present displacement are exact
//! (matrix exponential), the directional matrix is its mean over the step, and the delayed displacement runs straight
//! between its values at the ends. The cut is stable where every multiplier of the map over one period lies within the
//! unit circle.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector, Matrix2};
use num_complex::Complex64;

use crate::lobes::arcs::eigenvalues;
use crate::lobes::curve::{Limit, SpeedLimit};
use crate::lobes::dynamics::frf::ToolPointFrf;
use crate::lobes::milling::arnoldi;
use crate::lobes::milling::multi_frequency::{frequencies_that_matter, strongest_line};
use crate::lobes::milling::periodic_force::PeriodicForce;
use crate::lobes::milling::state_space::StateSpace;

/// Steps on one wave of the highest frequency that matters.
const STEPS_PER_WAVE: f64 = 36.0;
const FEWEST_STEPS: usize = 40;
/// The search climbs from this share of the depth below which even the averaged force could not chatter …
const FIRST_DEPTH: f64 = 0.3;
/// … by this factor a time, so that unstable islands thinner than that may be missed …
const CLIMB: f64 = 1.15;
/// … up to this multiple; deeper counts as no limit.
const DEEPEST: f64 = 1000.0;
/// Relative accuracy of the limit.
const TOLERANCE: f64 = 2e-4;

/// Semi-discretisation for one force on one structure.
pub struct SemiDiscretisation<'a> {
    force: PeriodicForce,
    structure: StateSpace,
    frf: &'a dyn ToolPointFrf,
    steps_per_wave: f64,
    top_hz: f64,
    /// 1/(2 max|λ|) of the averaged force, m.
    scale_m: f64,
}

impl<'a> SemiDiscretisation<'a> {
    /// `structure` and `frf` are the same structure.
    pub fn new(force: PeriodicForce, structure: StateSpace, frf: &'a dyn ToolPointFrf) -> Self {
        let matters = frequencies_that_matter(frf);
        let highest = matters.last().copied().unwrap_or(structure.highest_hz);
        let average = force.average();
        let greatest = matters
            .iter()
            .flat_map(|f| eigenvalues(&average, frf, *f))
            .map(|l| l.norm())
            .fold(0.0, f64::max);
        SemiDiscretisation {
            force,
            top_hz: highest.min(structure.highest_hz * 1.1),
            structure,
            frf,
            steps_per_wave: STEPS_PER_WAVE,
            scale_m: 0.5 / greatest,
        }
    }

    /// As [`new`](Self::new) with other steps in time, for convergence studies.
    pub fn with_steps_per_wave(mut self, steps: f64) -> Self {
        self.steps_per_wave = steps;
        self
    }

    /// The multiplier of greatest modulus at a depth; `None` where it is not finite or not found.
    pub fn greatest_multiplier(&self, spindle_rpm: f64, depth_m: f64) -> Option<Complex64> {
        let map = PeriodMap::new(self, spindle_rpm, depth_m)?;
        let multipliers = arnoldi::greatest::<f64>(map.size(), 0.95, |v| map.apply(v)).ok()?;
        multipliers
            .into_iter()
            .filter(|m| m.is_finite())
            .max_by(|a, b| a.norm().total_cmp(&b.norm()))
    }
}

/// y_{i+1} = E y_i + G₀ d_i + G₁ d_{i+1}, d the displacement one period earlier.
struct Step {
    state: DMatrix<f64>,
    /// `None` where no tooth cuts.
    delayed: Option<[DMatrix<f64>; 2]>,
    /// Displacement at the start of the step: r = S y + U d (present and delayed parts).
    out_state: DMatrix<f64>,
    out_delayed: Matrix2<f64>,
}

/// The map of state and displacements over one period. A vector holds the state, then the displacements of the
/// period before at the starts of all steps, then that at its end.
struct PeriodMap {
    states: usize,
    steps: Vec<Step>,
}

impl PeriodMap {
    fn new(method: &SemiDiscretisation, spindle_rpm: f64, depth_m: f64) -> Option<Self> {
        let s = &method.structure;
        let n = s.dynamics.nrows();
        let period_s = method.force.period_s(spindle_rpm);
        let count = ((method.steps_per_wave * method.top_hz * period_s).ceil() as usize).max(FEWEST_STEPS);
        let dt = period_s / count as f64;
        let dphi = TAU / (method.force.teeth * count) as f64;
        let residual = Matrix2::from_fn(|i, j| s.residual_m_per_n[i][j]);
        let free = Step {
            state: (&s.dynamics * dt).exp(),
            delayed: None,
            out_state: s.output.clone(),
            out_delayed: Matrix2::zeros(),
        };
        let mut steps = Vec::with_capacity(count);
        for i in 0..count {
            let phi = dphi * i as f64;
            let mean = method.force.mean_over(phi, dphi);
            if mean.iter().flatten().all(|v| *v == 0.0) {
                steps.push(Step {
                    state: free.state.clone(),
                    delayed: None,
                    out_state: free.out_state.clone(),
                    out_delayed: free.out_delayed,
                });
                continue;
            }
            let regenerative = Matrix2::from_fn(|i, j| depth_m * mean[i][j]);
            // The residual gives way at once: F = bA (C y + R F − d).
            let inverse = (Matrix2::identity() - regenerative * residual).try_inverse()?;
            let gain = inverse * regenerative;
            let gain = DMatrix::from_fn(2, 2, |i, j| gain[(i, j)]);
            let mut dynamics = &s.dynamics + &s.input * &gain * &s.output;
            if let Some(p) = method.force.damping_mean_over(phi, dphi, spindle_rpm) {
                let p = DMatrix::from_fn(2, 2, |i, j| depth_m * p[i][j]);
                dynamics += &s.input * p * &s.output * &s.dynamics;
            }
            // One exponential holds the state and the straight line of the delayed displacement.
            let mut augmented = DMatrix::zeros(n + 4, n + 4);
            augmented.view_mut((0, 0), (n, n)).copy_from(&(dynamics * dt));
            augmented
                .view_mut((0, n), (n, 2))
                .copy_from(&(&s.input * &gain * -dt));
            augmented[(n, n + 2)] = 1.0;
            augmented[(n + 1, n + 3)] = 1.0;
            let exponential = augmented.exp();
            let constant = exponential.view((0, n), (n, 2)).into_owned();
            let slope = exponential.view((0, n + 2), (n, 2)).into_owned();
            let give = DMatrix::from_fn(2, 2, |i, j| residual[(i, j)]) * &gain;
            steps.push(Step {
                state: exponential.view((0, 0), (n, n)).into_owned(),
                delayed: Some([constant - &slope, slope]),
                out_state: &s.output + &give * &s.output,
                out_delayed: Matrix2::from_fn(|i, j| -give[(i, j)]),
            });
        }
        Some(PeriodMap { states: n, steps })
    }

    fn size(&self) -> usize {
        self.states + 2 * (self.steps.len() + 1)
    }

    fn apply(&self, v: &DVector<f64>) -> DVector<f64> {
        let n = self.states;
        let mut out = DVector::zeros(v.len());
        let mut y = v.rows(0, n).into_owned();
        let mut next = y.clone();
        for (i, step) in self.steps.iter().enumerate() {
            let at = n + 2 * i;
            let delayed = v.rows(at, 2);
            let mut displacement = out.rows_mut(at, 2);
            displacement.gemv(1.0, &step.out_state, &y, 0.0);
            displacement.gemv(1.0, &step.out_delayed, &delayed, 1.0);
            next.gemv(1.0, &step.state, &y, 0.0);
            if let Some([from, to]) = &step.delayed {
                next.gemv(1.0, from, &delayed, 1.0);
                next.gemv(1.0, to, &v.rows(at + 2, 2), 1.0);
            }
            std::mem::swap(&mut y, &mut next);
        }
        // The end of this period is the start of the next, with the force there.
        if let Some(first) = self.steps.first() {
            let end = n + 2 * self.steps.len();
            let delayed = out.rows(n, 2).into_owned();
            let mut displacement = out.rows_mut(end, 2);
            displacement.gemv(1.0, &first.out_state, &y, 0.0);
            displacement.gemv(1.0, &first.out_delayed, &delayed, 1.0);
        }
        out.rows_mut(0, n).copy_from(&y);
        out
    }
}

impl SpeedLimit for SemiDiscretisation<'_> {
    fn limit_at(&self, spindle_rpm: f64) -> Option<Limit> {
        let period_s = self.force.period_s(spindle_rpm);
        if !(period_s.is_finite() && period_s > 0.0 && self.scale_m.is_finite()) {
            return None;
        }
        let unstable = |depth_m: f64| -> Option<Complex64> {
            self.greatest_multiplier(spindle_rpm, depth_m)
                .filter(|m| m.norm() > 1.0)
        };
        let mut high = FIRST_DEPTH * self.scale_m;
        // Low immersions may chatter below what the average says.
        let mut low = high;
        while unstable(low).is_some() {
            high = low;
            low *= 0.5;
            if low < 1e-6 * self.scale_m {
                return None;
            }
        }
        let mut multiplier = None;
        while multiplier.is_none() {
            if high > low {
                multiplier = unstable(high);
                if multiplier.is_some() {
                    break;
                }
            }
            low = high;
            high *= CLIMB;
            if high > DEEPEST * self.scale_m {
                return None;
            }
        }
        while high - low > TOLERANCE * low {
            let middle = 0.5 * (low + high);
            match unstable(middle) {
                Some(m) => {
                    high = middle;
                    multiplier = Some(m);
                }
                None => low = middle,
            }
        }
        let theta = multiplier?.arg().abs();
        let chatter_hz = strongest_line(self.frf, theta, period_s, 2.0 * self.top_hz);
        Some(Limit {
            depth_mm: 1e3 * 0.5 * (low + high),
            chatter_hz,
            lobe: (chatter_hz * period_s) as u32,
        })
    }

    fn golden_steps(&self) -> usize {
        10
    }
}
