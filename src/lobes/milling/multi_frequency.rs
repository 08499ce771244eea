//! Milling limits with the harmonics of the tooth passing frequency: finds the flip (period-doubling) lobes that the
//! averaged force of the zero-order solution cannot show.
//!
//! After Merdol & Altintas (2004), "Multi frequency solution of chatter stability for low immersion milling",
//! ASME J. Manuf. Sci. Eng. 126(3). At the limit the vibration is e^{iωt} times a T-periodic function, so that it
//! holds the lines ω + lω_T. With the Fourier series A(t) = Σ A_k e^{ikω_T t} the forces on the lines obey
//! F = b Q(θ) F, θ = ωT, Q_kl = ((1 − e^{−iθ}) A_{k−l} + i(ω + lω_T) P_{k−l}) H(ω + lω_T). For every θ in (0, π] each
//! positive real eigenvalue λ of Q is a limit b = 1/λ; the smallest over θ counts. (They truncate to few harmonics;
//! here the lines reach past the highest mode, and nothing is averaged.)

use std::f64::consts::{PI, TAU};

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

use crate::lobes::curve::{Limit, SpeedLimit};
use crate::lobes::dynamics::frf::{Receptance, ToolPointFrf};
use crate::lobes::milling::arnoldi;
use crate::lobes::milling::periodic_force::PeriodicForce;

/// Lines reach to this multiple of the highest frequency at which the structure still matters.
const BEYOND: f64 = 2.0;
/// Frequencies with less than this share of the greatest receptance do not matter for where to look.
const MATTERS: f64 = 0.03;
/// Eigenvalues below this share of a θ's greatest are limits too deep to be the least one.
const SHARE: f64 = 0.03;
/// Even steps of θ, in addition to those that resonances ask for.
const EVEN_STEPS: usize = 32;
/// An eigenvalue may move by this share of itself between neighbouring θ …
const STEP: f64 = 0.4;
/// … and by this share of its distance to the next one, or two that pass each other would be taken for each other, …
const SEPARATION: f64 = 0.5;
/// … unless it moves by less than this share of itself.
const SMALL_STEP: f64 = 0.01;
const MAX_HALVINGS: usize = 9;

/// The multi-frequency solution for one force on one structure.
pub struct MultiFrequency<'a> {
    force: PeriodicForce,
    frf: &'a dyn ToolPointFrf,
    /// Frequencies near resonances, Hz.
    seeds_hz: Vec<f64>,
    /// Axes that move at all.
    axes: Vec<usize>,
    top_hz: f64,
}

/// Frequencies at which the structure matters, ascending, Hz.
pub(crate) fn frequencies_that_matter(frf: &dyn ToolPointFrf) -> Vec<f64> {
    let norm = |f: &f64| -> f64 {
        let h = frf.receptance(*f);
        h.iter().flatten().map(|v| v.norm_sqr()).sum::<f64>().sqrt()
    };
    let seeds = frf.seed_grid_hz();
    let norms: Vec<f64> = seeds.iter().map(norm).collect();
    let greatest = norms.iter().copied().fold(0.0, f64::max);
    seeds
        .into_iter()
        .zip(norms)
        .filter(|(_, norm)| *norm >= MATTERS * greatest)
        .map(|(f, _)| f)
        .collect()
}

/// The line |θ + 2πl|/(2πT) on which the structure answers most, Hz.
pub(crate) fn strongest_line(frf: &dyn ToolPointFrf, theta: f64, period_s: f64, top_hz: f64) -> f64 {
    let mut best = (theta / (TAU * period_s), 0.0);
    let most = (top_hz * period_s).ceil() as i64 + 1;
    for l in -most..=most {
        let f = ((theta + TAU * l as f64) / (TAU * period_s)).abs();
        if f <= 0.0 || f > top_hz {
            continue;
        }
        let norm: f64 = frf.receptance(f).iter().flatten().map(|v| v.norm_sqr()).sum();
        if norm > best.1 {
            best = (f, norm);
        }
    }
    best.0
}

/// Greatest eigenvalues at one θ.
#[derive(Clone)]
struct Node {
    theta: f64,
    lambda: Vec<Complex64>,
}

impl Node {
    fn greatest(&self) -> f64 {
        self.lambda.iter().map(|l| l.norm()).fold(0.0, f64::max)
    }

    fn nearest(&self, to: Complex64) -> Option<Complex64> {
        let distance = |l: &Complex64| (l - to).norm_sqr();
        self.lambda
            .iter()
            .copied()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }
}

/// A stretch of θ in which a tracked eigenvalue crosses the positive real axis.
struct Crossing {
    theta: [f64; 2],
    lambda: [Complex64; 2],
}

impl Crossing {
    fn estimate(&self) -> f64 {
        let [a, b] = self.lambda;
        a.re + (b.re - a.re) * a.im / (a.im - b.im)
    }
}

impl<'a> MultiFrequency<'a> {
    /// The limit of a periodic force on a structure that is given by its FRF.
    pub fn new(force: PeriodicForce, frf: &'a dyn ToolPointFrf) -> Self {
        let matters = frequencies_that_matter(frf);
        let highest = matters.last().copied().unwrap_or(frf.band_hz().1);
        let moves = |axis: usize| {
            let seen = |h: Receptance| h[axis].iter().chain([&h[1 - axis][axis]]).any(|v| v.norm() > 0.0);
            matters.iter().any(|f| seen(frf.receptance(*f)))
        };
        MultiFrequency {
            force,
            frf,
            axes: (0..2).filter(|a| moves(*a)).collect(),
            top_hz: BEYOND * highest,
            seeds_hz: matters,
        }
    }

    /// Receptance at a frequency of either sign; nothing answers above a measured band, and below it the lowest line
    /// stands.
    fn receptance(&self, f: f64) -> Receptance {
        let (low, high) = self.frf.band_hz();
        if f.abs() > high {
            return [[Complex64::ZERO; 2]; 2];
        }
        let h = self.frf.receptance(f.abs().max(low.min(1e-3 * high)));
        if f < 0.0 {
            h.map(|row| row.map(|v| v.conj()))
        } else {
            h
        }
    }

    fn matrix(&self, theta: f64, at: &Speed) -> DMatrix<Complex64> {
        let lines = at.lines();
        let axes = self.axes.len();
        let delay = 1.0 - Complex64::new(0.0, -theta).exp();
        let mut q = DMatrix::zeros(axes * lines, axes * lines);
        for (column, l) in (-at.reach - 1..=at.reach).enumerate() {
            let omega = (theta + TAU * l as f64) / at.period_s;
            let h = self.receptance(omega / TAU);
            for row in 0..lines {
                // Harmonic k − l of this pair of lines.
                let offset = row as i64 - column as i64;
                let index = (offset + lines as i64 - 1) as usize;
                let mut force = at.harmonics[index].map(|r| r.map(|v| v * delay));
                if let Some(damping) = &at.damping {
                    for (f, p) in force.iter_mut().flatten().zip(damping[index].iter().flatten()) {
                        *f += Complex64::new(0.0, omega) * p;
                    }
                }
                for (i, out) in self.axes.iter().enumerate() {
                    for (j, input) in self.axes.iter().enumerate() {
                        q[(axes * row + i, axes * column + j)] =
                            force[*out][0] * h[0][*input] + force[*out][1] * h[1][*input];
                    }
                }
            }
        }
        q
    }

    fn node(&self, theta: f64, at: &Speed) -> Node {
        let q = self.matrix(theta, at);
        let apply = |v: &DVector<Complex64>| &q * v;
        // A matrix that is not finite has no eigenvalues; the θ is skipped.
        let mut lambda = arnoldi::greatest::<Complex64>(q.nrows(), SHARE, apply).unwrap_or_default();
        let greatest = lambda.iter().map(|l| l.norm()).fold(0.0, f64::max);
        lambda.retain(|l| l.norm() >= 0.5 * SHARE * greatest);
        Node { theta, lambda }
    }

    /// Angles in (0, π], ascending, that no resonance slips through.
    fn angles(&self, period_s: f64) -> Vec<f64> {
        let folded = self.seeds_hz.iter().map(|f| {
            let theta = (TAU * f * period_s).rem_euclid(TAU);
            if theta > PI { TAU - theta } else { theta }
        });
        let even = (1..EVEN_STEPS).map(|i| PI * i as f64 / EVEN_STEPS as f64);
        let mut angles: Vec<f64> = folded
            .chain(even)
            .filter(|t| *t > 1e-3 && *t < PI - 1e-3)
            .collect();
        angles.extend([1e-3, PI]);
        angles.sort_by(f64::total_cmp);
        angles.dedup_by(|b, a| *b - *a < 2e-3);
        if let Some(last) = angles.last_mut() {
            *last = PI;
        }
        angles
    }

    /// Where eigenvalues cross the positive real axis between two angles, halving the stretch while they jump.
    fn crossings(&self, start: Node, end: Node, at: &Speed, greatest: f64, found: &mut Vec<Crossing>) {
        let mut pending = vec![(start, end, 0)];
        while let Some((a, b, depth)) = pending.pop() {
            let floor = SHARE * greatest;
            let pairs: Vec<(Complex64, Complex64)> = a
                .lambda
                .iter()
                .filter(|l| l.norm() >= floor)
                .filter_map(|l| Some((*l, b.nearest(*l)?)))
                .collect();
            let jumps = pairs.iter().any(|(l, m)| {
                let moved = (m - l).norm();
                let next = b.lambda.iter().filter(|o| *o != m).map(|o| (o - l).norm());
                let room = next.fold(f64::INFINITY, f64::min);
                let unclear = moved > STEP * l.norm() || moved > SEPARATION * room;
                unclear && moved > SMALL_STEP * l.norm() && (l.re > floor || m.re > floor)
            });
            if jumps && depth < MAX_HALVINGS {
                let middle = self.node(0.5 * (a.theta + b.theta), at);
                pending.push((middle.clone(), b, depth + 1));
                pending.push((a, middle, depth + 1));
                continue;
            }
            for (l, m) in pairs {
                if l.im * m.im < 0.0 {
                    let crossing = Crossing {
                        theta: [a.theta, b.theta],
                        lambda: [l, m],
                    };
                    if crossing.estimate() > 0.0 {
                        found.push(crossing);
                    }
                }
            }
        }
    }

    /// θ and λ of a crossing: secant steps, bisection where they leave the bracket.
    fn solve(&self, crossing: &Crossing, at: &Speed) -> Option<(f64, f64)> {
        let Crossing {
            theta: [mut a, mut b],
            lambda: [mut la, mut lb],
        } = *crossing;
        for iteration in 0..40 {
            let share = la.im / (la.im - lb.im);
            let share = if iteration % 3 == 2 {
                0.5
            } else {
                share.clamp(0.02, 0.98)
            };
            let theta = a + share * (b - a);
            let lambda = self.node(theta, at).nearest(la + (lb - la) * share)?;
            if lambda.im.abs() <= 1e-7 * lambda.norm() || b - a <= 1e-12 {
                // A bracket that closed on a jump from one branch to another holds no crossing.
                return (lambda.im.abs() <= 1e-4 * lambda.norm()).then_some((theta, lambda.re));
            }
            if (lambda.im > 0.0) == (la.im > 0.0) {
                (a, la) = (theta, lambda);
            } else {
                (b, lb) = (theta, lambda);
            }
        }
        None
    }
}

/// What does not change with θ.
struct Speed {
    period_s: f64,
    /// Lines −reach − 1 … reach: symmetric about zero at θ = π.
    reach: i64,
    /// A_k for k from −(lines − 1) to lines − 1.
    harmonics: Vec<[[Complex64; 2]; 2]>,
    damping: Option<Vec<[[Complex64; 2]; 2]>>,
}

impl Speed {
    fn lines(&self) -> usize {
        (2 * self.reach + 2) as usize
    }
}

impl SpeedLimit for MultiFrequency<'_> {
    fn limit_at(&self, spindle_rpm: f64) -> Option<Limit> {
        let period_s = self.force.period_s(spindle_rpm);
        if !(period_s.is_finite() && period_s > 0.0) || self.axes.is_empty() {
            return None;
        }
        let reach = (self.top_hz * period_s).ceil() as i64 + 3;
        let orders = || -(2 * reach + 1)..=2 * reach + 1;
        let at = Speed {
            period_s,
            reach,
            harmonics: orders().map(|k| self.force.harmonic(k)).collect(),
            damping: orders()
                .map(|k| self.force.damping_harmonic(k, spindle_rpm))
                .collect(),
        };
        let nodes: Vec<Node> = self
            .angles(period_s)
            .into_iter()
            .map(|theta| self.node(theta, &at))
            .collect();
        let greatest = nodes.iter().map(Node::greatest).fold(0.0, f64::max);
        // Flip: at θ = π the problem is real, and its real eigenvalues are limits as they stand.
        let flip = nodes.last().into_iter().flat_map(|node| {
            node.lambda
                .iter()
                .filter(|l| l.re > 0.0 && l.im.abs() <= 1e-6 * l.re)
                .map(|l| (PI, l.re))
        });
        let mut best = flip.max_by(|a, b| a.1.total_cmp(&b.1));
        let mut crossings = Vec::new();
        for pair in nodes.windows(2) {
            self.crossings(pair[0].clone(), pair[1].clone(), &at, greatest, &mut crossings);
        }
        crossings.sort_by(|a, b| b.estimate().total_cmp(&a.estimate()));
        for crossing in &crossings {
            let ends = crossing.lambda.iter().map(|l| l.norm()).fold(0.0, f64::max);
            if best.is_some_and(|(_, lambda)| lambda >= ends.max(1.2 * crossing.estimate())) {
                continue;
            }
            if let Some((theta, lambda)) = self.solve(crossing, &at)
                && lambda > best.map_or(0.0, |b| b.1)
            {
                best = Some((theta, lambda));
            }
        }
        let (theta, lambda) = best?;
        let chatter_hz = strongest_line(self.frf, theta, period_s, self.top_hz);
        Some(Limit {
            depth_mm: 1e3 / lambda,
            chatter_hz,
            lobe: (chatter_hz * period_s) as u32,
        })
    }

    fn golden_steps(&self) -> usize {
        12
    }
}
