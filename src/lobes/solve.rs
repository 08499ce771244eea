//! The limit at a speed: the smallest width of cut over all eigenvalues and lobes.

use std::f64::consts::TAU;

use super::arcs::{self, Arc, parabola_real};
use super::curve::{AbsoluteLimit, Limit, SpeedLimit, golden_maximum};
use super::force::RegenerativeForce;
use crate::lobes::dynamics::frf::ToolPointFrf;

/// Solves det(I − b (1 − e^{−iωT}) D Φ) = 0 along the lobes of one force on one structure.
pub struct StabilitySolver<'a> {
    force: RegenerativeForce,
    frf: &'a dyn ToolPointFrf,
    arcs: Vec<Arc>,
    /// First lobe that counts.
    first_lobe: f64,
    /// Added to k + ε/2π, in turns.
    extra_turns: f64,
}

/// Phase left over at a root, in turns.
const ROOT_TOLERANCE: f64 = 1e-11;
/// A bracket closed on more than this is a jump to another branch, not a root.
const NOT_A_ROOT: f64 = 1e-7;
/// How far the parabola may be off the phase at a turning point, in turns.
const VERTEX_MARGIN: f64 = 0.01;

impl<'a> StabilitySolver<'a> {
    /// The limit of an averaged force on a structure that is given by its FRF.
    pub fn new(force: RegenerativeForce, frf: &'a dyn ToolPointFrf) -> Self {
        Self::with_halved_seeds(force, frf, 0)
    }

    /// As [`new`](Self::new) with every interval of the frequency grid halved so often: for convergence studies.
    pub fn with_halved_seeds(force: RegenerativeForce, frf: &'a dyn ToolPointFrf, halvings: usize) -> Self {
        StabilitySolver {
            force,
            frf,
            arcs: arcs::build(&force, frf, halvings),
            first_lobe: f64::NEG_INFINITY,
            extra_turns: 0.0,
        }
    }

    /// Lobes as a program finds them that starts at another lobe than k = 0, or has ωT = 2π(k + `extra_turns`) + ε (½:
    /// the delayed term has the wrong sign). Not for cuts: to see whether such a slip explains somebody's
    /// numbers. `first_lobe`: k of the first one; `extra_turns` in turns.
    pub fn with_lobes(mut self, first_lobe: f64, extra_turns: f64) -> Self {
        (self.first_lobe, self.extra_turns) = (first_lobe, extra_turns);
        self
    }

    /// All roots of ωT = 2πk + ε(ω) on an arc that could beat the best so far.
    fn visit(&self, arc: &Arc, period_s: f64, best: &mut Best) {
        // Phase in turns: a whole number at a root.
        let turns = |s: f64, epsilon: f64| arc.frequency_hz(s) * period_s - epsilon / TAU - self.extra_turns;
        let p = [
            turns(0.0, arc.epsilon[0]),
            turns(0.5, arc.epsilon[1]),
            turns(1.0, arc.epsilon[2]),
        ];
        let (c1, c2) = (4.0 * p[1] - 3.0 * p[0] - p[2], 2.0 * (p[0] - 2.0 * p[1] + p[2]));
        let vertex = -c1 / (2.0 * c2);
        if !(vertex > 0.0 && vertex < 1.0) {
            self.visit_monotone(arc, &turns, [0.0, 1.0], [p[0], p[2]], p, best);
            return;
        }
        // The lobe turns back within this arc (its curve over speed has a vertical tangent).
        let estimate = parabola_real(p, vertex);
        let low = p[0].min(p[2]).min(estimate) - VERTEX_MARGIN;
        let high = p[0].max(p[2]).max(estimate) + VERTEX_MARGIN;
        if low.ceil() > high {
            return;
        }
        let at_vertex = turns(
            vertex,
            arc.epsilon_of(arc.exact(&self.force, self.frf, vertex), vertex),
        );
        self.visit_monotone(arc, &turns, [0.0, vertex], [p[0], at_vertex], p, best);
        self.visit_monotone(arc, &turns, [vertex, 1.0], [at_vertex, p[2]], p, best);
    }

    fn visit_monotone(
        &self,
        arc: &Arc,
        turns: &impl Fn(f64, f64) -> f64,
        ends: [f64; 2],
        end_turns: [f64; 2],
        p: [f64; 3],
        best: &mut Best,
    ) {
        let (low, high) = (end_turns[0].min(end_turns[1]), end_turns[0].max(end_turns[1]));
        let mut whole = low.ceil().max(self.first_lobe);
        while whole <= high {
            let residual = |s: f64| {
                let lambda = arc.exact(&self.force, self.frf, s);
                (turns(s, arc.epsilon_of(lambda, s)) - whole, lambda.re)
            };
            let estimate = bisect_parabola(p, whole, ends, end_turns);
            if arc.lambda_at(estimate).re + arc.slack > best.re_lambda {
                let f = [end_turns[0] - whole, end_turns[1] - whole];
                if let Some((s, re_lambda)) = root(&residual, ends, f, estimate) {
                    best.offer(re_lambda, arc.frequency_hz(s));
                }
            }
            whole += 1.0;
        }
    }
}

impl SpeedLimit for StabilitySolver<'_> {
    /// `None` where no lobe passes over the speed within the band of the FRF.
    fn limit_at(&self, spindle_rpm: f64) -> Option<Limit> {
        let period_s = 60.0 / (self.force.teeth as f64 * spindle_rpm);
        if !(period_s.is_finite() && period_s > 0.0) {
            return None;
        }
        let mut best = Best {
            re_lambda: 0.0,
            frequency_hz: 0.0,
        };
        // Greatest Re λ first: as soon as a root beats what an arc could give at best, all later arcs are beaten.
        for arc in &self.arcs {
            if arc.bound <= best.re_lambda {
                break;
            }
            self.visit(arc, period_s, &mut best);
        }
        (best.re_lambda > 0.0).then(|| Limit {
            depth_mm: depth_mm(best.re_lambda),
            chatter_hz: best.frequency_hz,
            lobe: (best.frequency_hz * period_s) as u32,
        })
    }

    /// The minimum of b over all frequencies: some speed of every lobe reaches it. `None`: always stable.
    fn absolute_limit(&self) -> Option<AbsoluteLimit> {
        let mut best = Best {
            re_lambda: 0.0,
            frequency_hz: 0.0,
        };
        for arc in &self.arcs {
            if arc.bound <= best.re_lambda {
                break;
            }
            let (s, re_lambda) = golden_maximum(0.0, 1.0, 48, |s| arc.exact(&self.force, self.frf, s).re);
            best.offer(re_lambda, arc.frequency_hz(s));
        }
        (best.re_lambda > 0.0).then(|| AbsoluteLimit {
            depth_mm: depth_mm(best.re_lambda),
            chatter_hz: best.frequency_hz,
        })
    }

    fn speeds_per_task(&self) -> usize {
        32
    }
}

struct Best {
    re_lambda: f64,
    frequency_hz: f64,
}

impl Best {
    fn offer(&mut self, re_lambda: f64, frequency_hz: f64) {
        if re_lambda > self.re_lambda {
            self.re_lambda = re_lambda;
            self.frequency_hz = frequency_hz;
        }
    }
}

/// b = 1/(2 Re λ), in mm.
fn depth_mm(re_lambda: f64) -> f64 {
    1e3 / (2.0 * re_lambda)
}

/// Where the parabola through `p` (at 0, ½, 1) meets `level` between `ends`: a first guess for [`root`].
fn bisect_parabola(p: [f64; 3], level: f64, ends: [f64; 2], end_values: [f64; 2]) -> f64 {
    let rising = end_values[1] >= end_values[0];
    let [mut a, mut b] = ends;
    for _ in 0..12 {
        let middle = 0.5 * (a + b);
        if (parabola_real(p, middle) < level) == rising {
            a = middle;
        } else {
            b = middle;
        }
    }
    0.5 * (a + b)
}

/// Root of `residual` (first value; the second is carried along) in a bracket whose end values `f` differ in sign
/// or touch zero: secant steps from the estimate, bisection whenever they leave the bracket or dawdle.
fn root(
    residual: &impl Fn(f64) -> (f64, f64),
    ends: [f64; 2],
    f: [f64; 2],
    estimate: f64,
) -> Option<(f64, f64)> {
    for (end, value) in ends.into_iter().zip(f) {
        if value == 0.0 {
            return Some((end, residual(end).1));
        }
    }
    let [mut a, mut b] = ends;
    let rising = f[1] > 0.0;
    let (mut last_s, mut last_f) = if f[0].abs() < f[1].abs() {
        (a, f[0])
    } else {
        (b, f[1])
    };
    let mut s = estimate;
    for iteration in 0..80 {
        let (value, carried) = residual(s);
        if value.abs() <= ROOT_TOLERANCE {
            return Some((s, carried));
        }
        if b - a <= 1e-13 {
            return (value.abs() <= NOT_A_ROOT).then_some((s, carried));
        }
        if (value > 0.0) == rising {
            b = s;
        } else {
            a = s;
        }
        let secant = s - value * (s - last_s) / (value - last_f);
        (last_s, last_f) = (s, value);
        s = if secant > a && secant < b && iteration % 8 != 7 {
            secant
        } else {
            0.5 * (a + b)
        };
    }
    None
}

#[cfg(test)]
mod tests;
