//! The limit at a speed: the smallest width of cut over all eigenvalues and lobes.

use std::f64::consts::TAU;

use rayon::prelude::*;
use serde::Serialize;

use super::arcs::{self, Arc, parabola_real};
use super::force::RegenerativeForce;
use super::frf::DirectFrf;
use crate::{Error, Result};

/// Where chatter starts at one spindle speed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Limit {
    /// Width of cut b: axial depth in milling, (diameter − pilot diameter)/2 in drilling.
    pub depth_mm: f64,
    pub chatter_hz: f64,
    /// Whole waves between two teeth, k in ωT = 2πk + ε.
    pub lobe: u32,
}

/// The limit over spindle speeds; all three as long. `None` (JSON `null`): nothing limits the cut at that speed
/// within the band of the FRF.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LobeCurve {
    pub spindle_rpm: Vec<f64>,
    pub depth_limit_mm: Vec<Option<f64>>,
    pub chatter_hz: Vec<Option<f64>>,
}

/// The depth below which no speed whatever chatters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AbsoluteLimit {
    pub depth_mm: f64,
    pub chatter_hz: f64,
}

/// A local maximum of the limit over speed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Peak {
    pub spindle_rpm: f64,
    /// `None`: unlimited around this speed.
    pub depth_mm: Option<f64>,
}

/// Solves det(I − b (1 − e^{−iωT}) D Φ) = 0 along the lobes of one force on one structure.
pub struct StabilitySolver<'a> {
    force: RegenerativeForce,
    frf: &'a dyn DirectFrf,
    arcs: Vec<Arc>,
}

/// Phase left over at a root, in turns.
const ROOT_TOLERANCE: f64 = 1e-11;
/// A bracket closed on more than this is a jump to another branch, not a root.
const NOT_A_ROOT: f64 = 1e-7;
/// How far the parabola may be off the phase at a turning point, in turns.
const VERTEX_MARGIN: f64 = 0.01;

impl<'a> StabilitySolver<'a> {
    pub fn new(force: RegenerativeForce, frf: &'a dyn DirectFrf) -> Self {
        Self::with_halved_seeds(force, frf, 0)
    }

    /// As [`new`](Self::new) with every interval of the frequency grid halved so often: for convergence studies.
    pub fn with_halved_seeds(force: RegenerativeForce, frf: &'a dyn DirectFrf, halvings: usize) -> Self {
        StabilitySolver {
            force,
            frf,
            arcs: arcs::build(&force, frf, halvings),
        }
    }

    /// The smallest b at a speed (> 0), `None` where no lobe passes over it within the band.
    pub fn limit_at(&self, spindle_rpm: f64) -> Option<Limit> {
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

    /// The limit at each speed, in parallel.
    pub fn curve(&self, spindle_rpm: &[f64]) -> LobeCurve {
        let limits: Vec<Option<Limit>> = spindle_rpm
            .par_iter()
            .with_min_len(32)
            .map(|n| self.limit_at(*n))
            .collect();
        LobeCurve {
            spindle_rpm: spindle_rpm.to_vec(),
            depth_limit_mm: limits.iter().map(|l| l.map(|l| l.depth_mm)).collect(),
            chatter_hz: limits.iter().map(|l| l.map(|l| l.chatter_hz)).collect(),
        }
    }

    /// The minimum of b over all frequencies: some speed of every lobe reaches it. `None`: always stable.
    pub fn absolute_limit(&self) -> Option<AbsoluteLimit> {
        let mut best = Best {
            re_lambda: 0.0,
            frequency_hz: 0.0,
        };
        for arc in &self.arcs {
            if arc.bound <= best.re_lambda {
                break;
            }
            let (s, re_lambda) = golden_maximum(0.0, 1.0, |s| arc.exact(&self.force, self.frf, s).re);
            best.offer(re_lambda, arc.frequency_hz(s));
        }
        (best.re_lambda > 0.0).then(|| AbsoluteLimit {
            depth_mm: depth_mm(best.re_lambda),
            chatter_hz: best.frequency_hz,
        })
    }

    /// The `count` deepest peaks of a curve of this solver, deepest first, each moved to the true tip between its
    /// neighbouring speeds. Where the curve has no peak inside, its deepest end stands for it.
    pub fn best(&self, curve: &LobeCurve, count: usize) -> Vec<Peak> {
        let mut found = peaks(curve);
        if found.is_empty() {
            found.extend(peak_near(curve, [f64::NEG_INFINITY, f64::INFINITY]));
        }
        found.sort_by(|a, b| depth_order(b.depth_mm).total_cmp(&depth_order(a.depth_mm)));
        found.truncate(count);
        found.iter().map(|peak| self.refined(curve, *peak)).collect()
    }

    /// A peak of a curve of this solver, moved to the true tip between the neighbouring speeds.
    fn refined(&self, curve: &LobeCurve, peak: Peak) -> Peak {
        let at = curve.spindle_rpm.partition_point(|n| *n < peak.spindle_rpm);
        let neighbour = |i: usize| curve.spindle_rpm.get(i).copied().unwrap_or(peak.spindle_rpm);
        let (low, high) = (neighbour(at.saturating_sub(1)), neighbour(at + 1));
        if peak.depth_mm.is_none() {
            return peak;
        }
        let depth = |n: f64| self.limit_at(n).map_or(f64::INFINITY, |l| l.depth_mm);
        let (spindle_rpm, depth_mm) = golden_maximum(low, high, depth);
        if depth_mm.is_finite() && Some(depth_mm) >= peak.depth_mm {
            Peak {
                spindle_rpm,
                depth_mm: Some(depth_mm),
            }
        } else {
            peak
        }
    }

    /// All roots of ωT = 2πk + ε(ω) on an arc that could beat the best so far.
    fn visit(&self, arc: &Arc, period_s: f64, best: &mut Best) {
        // Phase in turns: a whole number at a root.
        let turns = |s: f64, epsilon: f64| arc.frequency_hz(s) * period_s - epsilon / TAU;
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
        let mut whole = low.ceil();
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

/// Greatest value of a function with one maximum between `low` and `high`: place and value (golden section, with
/// the ends looked at too).
fn golden_maximum(low: f64, high: f64, f: impl Fn(f64) -> f64) -> (f64, f64) {
    const SHRINK: f64 = 0.618_033_988_749_894_9;
    let (mut a, mut b) = (low, high);
    let (mut x1, mut x2) = (b - SHRINK * (b - a), a + SHRINK * (b - a));
    let (mut f1, mut f2) = (f(x1), f(x2));
    // 0.618^48 < 1e-10 of the interval.
    for _ in 0..48 {
        if f1 >= f2 {
            (b, x2, f2) = (x2, x1, f1);
            x1 = b - SHRINK * (b - a);
            f1 = f(x1);
        } else {
            (a, x1, f1) = (x1, x2, f2);
            x2 = a + SHRINK * (b - a);
            f2 = f(x2);
        }
    }
    let inner = if f1 >= f2 { (x1, f1) } else { (x2, f2) };
    [(low, f(low)), (high, f(high))]
        .into_iter()
        .fold(inner, |best, end| if end.1 > best.1 { end } else { best })
}

/// Speeds from, to, step (rpm): `from`, `from + step`, … up to `to` (included within a millionth of a step).
///
/// # Errors
/// Where that is no ascending grid of positive speeds, or more than ten million of them.
pub fn speed_grid(from_to_step: [f64; 3]) -> Result<Vec<f64>> {
    let [from, to, step] = from_to_step;
    let count = ((to - from) / step + 1e-6).floor();
    if !(from > 0.0 && to >= from && step > 0.0 && to.is_finite() && count < 1e7) {
        return Err(Error::computation(format!(
            "lobes: from {from} to {to} rpm in steps of {step} is no grid of spindle speeds; \
             give [from, to, step] with 0 < from ≤ to and a positive step"
        )));
    }
    Ok((0..=count as usize).map(|i| from + step * i as f64).collect())
}

/// Unlimited counts as deepest.
fn depth_order(depth_mm: Option<f64>) -> f64 {
    depth_mm.unwrap_or(f64::INFINITY)
}

/// Local maxima of a curve inside its speed range, ascending in speed; a stretch of equal depth (or without limit)
/// counts once, at its middle.
pub fn peaks(curve: &LobeCurve) -> Vec<Peak> {
    let depth: Vec<f64> = curve.depth_limit_mm.iter().map(|d| depth_order(*d)).collect();
    let mut found = Vec::new();
    let mut start = 1;
    while start + 1 < depth.len() {
        let mut end = start;
        while end + 1 < depth.len() && depth[end + 1] == depth[start] {
            end += 1;
        }
        let falls = end + 1 < depth.len() && depth[end + 1] < depth[start];
        if depth[start - 1] < depth[start] && falls {
            found.push(peak_at(curve, (start + end) / 2));
        }
        start = end + 1;
    }
    found
}

/// The deepest point of a curve between two speeds (both included); `None` where the curve has no speed there.
pub fn peak_near(curve: &LobeCurve, rpm_range: [f64; 2]) -> Option<Peak> {
    let deepest = (0..curve.spindle_rpm.len())
        .filter(|i| (rpm_range[0]..=rpm_range[1]).contains(&curve.spindle_rpm[*i]))
        .max_by(|i, j| {
            let order = |i: &usize| depth_order(curve.depth_limit_mm[*i]);
            order(i).total_cmp(&order(j))
        })?;
    Some(peak_at(curve, deepest))
}

fn peak_at(curve: &LobeCurve, index: usize) -> Peak {
    Peak {
        spindle_rpm: curve.spindle_rpm[index],
        depth_mm: curve.depth_limit_mm[index],
    }
}

#[cfg(test)]
mod tests;
