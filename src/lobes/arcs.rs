//! The eigenvalue branches λ(ω) of D Φ(iω), cut into short arcs on which they are all but parabolas.

use std::f64::consts::TAU;

use num_complex::Complex64;

use super::force::RegenerativeForce;
use crate::lobes::dynamics::frf::ToolPointFrf;

/// How far, relative to |λ|, the middle of an arc may lie from its chord.
const CHORD_TOLERANCE: f64 = 4e-3;
/// How far the phase ε may turn along an arc, rad.
const PHASE_STEP: f64 = 0.5;
/// Eigenvalues smaller than the greatest by this factor limit no cut that anybody could make.
const NEGLIGIBLE: f64 = 1e-7;
/// Halvings of one interval of the seed grid.
const MAX_HALVINGS: usize = 16;

/// One branch over one short frequency interval.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arc {
    /// Ends, Hz.
    pub from_hz: f64,
    pub to_hz: f64,
    /// λ at the start, middle and end, 1/m.
    pub lambda: [Complex64; 3],
    /// ε at the same places, rad, without jumps along the arc.
    pub epsilon: [f64; 3],
    /// No point of the arc has a greater Re λ.
    pub bound: f64,
    /// Error of the parabola through `lambda`, generously.
    pub slack: f64,
}

impl Arc {
    pub fn frequency_hz(&self, s: f64) -> f64 {
        self.from_hz + s * (self.to_hz - self.from_hz)
    }

    /// The parabola through the three known points, s = 0..1 along the arc.
    pub fn lambda_at(&self, s: f64) -> Complex64 {
        parabola(self.lambda, s)
    }

    /// λ itself: the eigenvalue of D Φ that belongs to this branch.
    pub fn exact(&self, force: &RegenerativeForce, frf: &dyn ToolPointFrf, s: f64) -> Complex64 {
        let [a, b] = eigenvalues(force, frf, self.frequency_hz(s));
        let expected = self.lambda_at(s);
        if (a - expected).norm_sqr() <= (b - expected).norm_sqr() {
            a
        } else {
            b
        }
    }

    /// ε of a λ near `s` on this arc, on the same sheet as `epsilon`.
    pub fn epsilon_of(&self, lambda: Complex64, s: f64) -> f64 {
        let expected = parabola_real(self.epsilon, s);
        let raw = epsilon(lambda);
        raw + TAU * ((expected - raw) / TAU).round()
    }
}

/// ε = 2 atan2(Re λ, −Im λ): the phase of 1 − e^{−iωT} = 1/(b λ) fixes ωT up to whole turns.
pub(super) fn epsilon(lambda: Complex64) -> f64 {
    2.0 * lambda.re.atan2(-lambda.im)
}

/// Both eigenvalues of D Φ at a frequency.
pub(super) fn eigenvalues(
    force: &RegenerativeForce,
    frf: &dyn ToolPointFrf,
    frequency_hz: f64,
) -> [Complex64; 2] {
    let d = &force.matrix_n_per_m2;
    let h = frf.receptance(frequency_hz);
    let m = |i: usize, j: usize| d[i][0] * h[0][j] + d[i][1] * h[1][j];
    let (m00, m01, m10, m11) = (m(0, 0), m(0, 1), m(1, 0), m(1, 1));
    let mean = 0.5 * (m00 + m11);
    let half_difference = 0.5 * (m00 - m11);
    let root = (half_difference * half_difference + m01 * m10).sqrt();
    [mean + root, mean - root]
}

#[derive(Clone, Copy)]
struct Sample {
    frequency_hz: f64,
    lambda: [Complex64; 2],
}

impl Sample {
    /// The same sample with its eigenvalues in the order of a neighbour's branches.
    fn ordered_like(mut self, neighbour: &[Complex64; 2]) -> Self {
        let [a, b] = self.lambda;
        let kept = (a - neighbour[0]).norm() + (b - neighbour[1]).norm();
        let crossed = (b - neighbour[0]).norm() + (a - neighbour[1]).norm();
        if crossed < kept {
            self.lambda = [b, a];
        }
        self
    }
}

/// All arcs that can limit a cut, those with the greatest Re λ (smallest b) first.
///
/// `halvings` splits every interval of the seed grid that often before refinement starts (0 in use; a test
/// shows with 1 that nothing moves).
pub(super) fn build(force: &RegenerativeForce, frf: &dyn ToolPointFrf, halvings: usize) -> Vec<Arc> {
    let sample = |frequency_hz: f64| Sample {
        frequency_hz,
        lambda: eigenvalues(force, frf, frequency_hz),
    };
    let seeds: Vec<Sample> = frf.seed_grid_hz().into_iter().map(sample).collect();
    let greatest = seeds
        .iter()
        .flat_map(|s| s.lambda)
        .map(|l| l.norm())
        .filter(|n| n.is_finite())
        .fold(0.0, f64::max);
    let floor = NEGLIGIBLE * greatest;
    let mut arcs = Vec::with_capacity(4 * seeds.len());
    // Depth-first over the halves of each interval; left half on top, so arcs come in ascending order.
    let mut pending: Vec<(Sample, Sample, usize)> = Vec::new();
    for ends in seeds.windows(2) {
        pending.push((ends[0], ends[1], 0));
        while let Some((start, end, depth)) = pending.pop() {
            let middle = sample(0.5 * (start.frequency_hz + end.frequency_hz)).ordered_like(&start.lambda);
            let end = end.ordered_like(&middle.lambda);
            let smooth = (0..2).all(|p| is_smooth(start.lambda[p], middle.lambda[p], end.lambda[p], floor));
            if depth < halvings || (!smooth && depth < MAX_HALVINGS + halvings) {
                pending.push((middle, end, depth + 1));
                pending.push((start, middle, depth + 1));
            } else {
                arcs.extend((0..2).filter_map(|p| {
                    let lambda = [start.lambda[p], middle.lambda[p], end.lambda[p]];
                    arc(start.frequency_hz, end.frequency_hz, lambda, floor)
                }));
            }
        }
    }
    arcs.sort_by(|a, b| b.bound.total_cmp(&a.bound));
    arcs
}

fn is_smooth(start: Complex64, middle: Complex64, end: Complex64, floor: f64) -> bool {
    let scale = start.norm().max(middle.norm()).max(end.norm());
    if scale <= floor {
        return true;
    }
    let off_chord = (middle - 0.5 * (start + end)).norm();
    let turn = |a: Complex64, b: Complex64| 2.0 * (b * a.conj()).arg().abs();
    let smallest = start.norm().min(middle.norm()).min(end.norm());
    off_chord <= CHORD_TOLERANCE * scale
        && (smallest <= floor || turn(start, middle) + turn(middle, end) <= PHASE_STEP)
}

fn arc(from_hz: f64, to_hz: f64, lambda: [Complex64; 3], floor: f64) -> Option<Arc> {
    let scale = lambda.iter().map(|l| l.norm()).fold(0.0, f64::max);
    let finite = lambda.iter().all(|l| l.is_finite());
    let greatest_re = lambda.iter().map(|l| l.re).fold(f64::NEG_INFINITY, f64::max);
    // The middle may stand off the chord by the tolerance; the curve can overshoot its three points by a fraction
    // of that only.
    let slack = CHORD_TOLERANCE * scale;
    let bound = greatest_re + slack;
    if !finite || bound <= floor {
        return None;
    }
    let mut eps = lambda.map(epsilon);
    // ε counts modulo 2π only, so −λ has the phases of λ: a root is one only where Re λ > 0.
    for i in 1..3 {
        eps[i] += TAU * ((eps[i - 1] - eps[i]) / TAU).round();
    }
    Some(Arc {
        from_hz,
        to_hz,
        lambda,
        epsilon: eps,
        bound,
        slack,
    })
}

fn parabola(v: [Complex64; 3], s: f64) -> Complex64 {
    let (a, b, c) = lagrange(s);
    v[0] * a + v[1] * b + v[2] * c
}

pub(super) fn parabola_real(v: [f64; 3], s: f64) -> f64 {
    let (a, b, c) = lagrange(s);
    v[0] * a + v[1] * b + v[2] * c
}

/// Weights of the values at 0, ½, 1.
fn lagrange(s: f64) -> (f64, f64, f64) {
    (
        (1.0 - s) * (1.0 - 2.0 * s),
        4.0 * s * (1.0 - s),
        s * (2.0 * s - 1.0),
    )
}
