//! Milling: Fourier coefficients of the tool-frame forces over the orders of the tool's rotation.
//!
//! Tooth j stands at φ = θ + 2πj/N − ψz where θ is the tool's rotation and z ∈ [0, 1] runs up the engaged depth, ψ being
//! the lag of the helix over it (docs/physics.md, "Cutting forces"; Altintas, Manufacturing Automation, 2nd ed., §2.3–2.5).

use std::f64::consts::TAU;

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use num_complex::Complex64;

use super::edge_shape::EdgeShape;
use super::quadrature::gauss_legendre;
use super::tooth_place::{TeethSlopes, ToothPlace};
use crate::data::{CutGeometry, Immersion, Tool};

/// Ktc Krc Kac Kte Kre Kae.
pub const UNIT_COUNT: usize = 6;

/// What a milling cut's waveform depends on besides its coefficients.
#[derive(Debug, Clone, PartialEq)]
pub struct MillingCut {
    /// Number of teeth.
    pub teeth: usize,
    /// Feed per tooth, mm.
    pub feed_per_tooth_mm: f64,
    /// Depth of cut along the tool axis, mm.
    pub axial_depth_mm: f64,
    /// Angles between which a tooth is in the work, at the tool's full diameter.
    pub immersion: Immersion,
    /// Angle by which the top of the engaged depth lags behind the tip, rad: 2 a tan β / D.
    pub lag_rad: f64,
    /// `None` for an edge that runs straight up the side.
    pub shape: Option<EdgeShape>,
    /// The teeth where they differ; empty where they are alike and evenly spaced. [`Self::closed_form`] takes them for alike.
    pub places: Vec<ToothPlace>,
}

/// How the chip differs from c sin φ and the force from one proportional to it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ChipLaw {
    /// p in K ∝ (h / reference)^−p on the cutting coefficients.
    pub exponent: Option<f64>,
    /// Offset of the tool's axis from the spindle's, mm, and its direction from tooth 0, rad.
    pub runout: Option<[f64; 2]>,
}

impl ChipLaw {
    /// Chip thickness at which the coefficients of a size effect are given, mm.
    pub const REFERENCE_MM: f64 = 0.1;
}

/// Tool-frame forces x, y, z (N) for one unit of each coefficient, over orders 0..=K; order −n is the conjugate.
pub type UnitForces = [[Vec<Complex64>; 3]; UNIT_COUNT];

/// [`UnitForces`] with derivatives with respect to the chip law.
#[derive(Debug, Clone)]
pub struct SampledForces {
    /// The forces themselves.
    pub unit: UnitForces,
    /// By the exponent, the offset (per mm) and its direction (per rad); `None` where the law does not have them or
    /// no derivatives were asked for.
    pub slopes: [Option<Box<UnitForces>>; 3],
}

/// Axial positions at which runout is sampled for each this much lag, rad.
const LAG_PER_NODE_RAD: f64 = 0.25;
/// Besides, one for each radian by which the moment when a tooth leaves the cut wanders over the depth at this order: what
/// the edge puts on higher ones is little.
const WANDERING_ORDER: f64 = 24.0;
const MOST_NODES: usize = 16;

impl MillingCut {
    /// `None` for a drilling cut.
    pub fn new(tool: &Tool, geometry: &CutGeometry) -> Option<MillingCut> {
        let CutGeometry::Milling {
            feed_per_tooth_mm,
            axial_depth_mm,
            immersion,
        } = *geometry
        else {
            return None;
        };
        Some(MillingCut {
            teeth: tool.teeth.max(1),
            feed_per_tooth_mm,
            axial_depth_mm,
            immersion,
            lag_rad: 2.0 * axial_depth_mm * tool.helix_deg.to_radians().tan() / tool.diameter_mm,
            shape: EdgeShape::of(tool),
            places: ToothPlace::all(tool, axial_depth_mm),
        })
    }

    /// The same cut at `factor` times its depth.
    pub fn deeper(&self, factor: f64) -> MillingCut {
        MillingCut {
            axial_depth_mm: self.axial_depth_mm * factor,
            ..self.steeper(factor)
        }
    }

    /// The same cut with a helix of `factor` times the tangent (or a tool so many times thinner).
    pub fn steeper(&self, factor: f64) -> MillingCut {
        let mut cut = self.clone();
        cut.lag_rad *= factor;
        cut.places.iter_mut().for_each(|p| p.lag_rad *= factor);
        cut
    }

    /// Forces linear in the chip thickness: in closed form where all teeth are alike, or have one helix on an edge of another shape.
    pub fn linear(&self, orders: usize) -> UnitForces {
        match self.places.is_empty() {
            true => self.closed_form(orders),
            false if self.shape.is_some() && self.has_one_helix() => {
                self.own_teeth(orders, None, TeethSlopes::None).unit
            }
            false => self.sampled(orders, ChipLaw::default(), false).unit,
        }
    }

    pub(super) fn nothing(orders: usize) -> UnitForces {
        std::array::from_fn(|_| std::array::from_fn(|_| vec![Complex64::ZERO; orders + 1]))
    }

    /// a ∫ e^{−inψz} dz over the engaged depth: what the helix makes of order n, mm.
    fn helix(&self, n: usize) -> Complex64 {
        let half = 0.5 * n as f64 * self.lag_rad;
        let sinc = if half.abs() < 1e-6 {
            1.0 - half * half / 6.0
        } else {
            half.sin() / half
        };
        Complex64::from_polar(self.axial_depth_mm * sinc, -half)
    }

    /// [`Self::helix`] at orders of either sign.
    pub(super) fn helix_at(&self, n: i64) -> Complex64 {
        let helix = self.helix(n.unsigned_abs() as usize);
        if n < 0 { helix.conj() } else { helix }
    }

    /// Closed form for h = c sin φ and a force linear in h. All teeth are alike, so only multiples of their number appear.
    /// An edge that is not straight is summed up slice by slice.
    pub fn closed_form(&self, orders: usize) -> UnitForces {
        let mut unit = Self::nothing(orders);
        let teeth = self.teeth as f64;
        for part in self.edge_parts(orders, self.teeth) {
            let window = ImmersionWindow::new(part.immersion, orders);
            for (n, [depth, length]) in (0..).step_by(self.teeth).zip(&part.factors) {
                let integral = window.integrals(n);
                let cutting = integral
                    .by_sine
                    .map(|v| v * (depth * teeth * self.feed_per_tooth_mm));
                let edge = integral.plain.map(|v| v * (length * teeth));
                put(&mut unit, n, &cutting, &edge, part.kappa);
            }
        }
        unit
    }

    /// The edge in parts on which immersion and direction are one: a straight edge is one of them. Orders that are multiples of `step`.
    pub(super) fn edge_parts(&self, orders: usize, step: usize) -> Vec<EdgePart> {
        let multiples = (0..=orders).step_by(step);
        let Some(shape) = self.shape else {
            return vec![EdgePart {
                height: 0.5,
                immersion: self.immersion,
                kappa: (1.0, 0.0),
                factors: multiples.map(|n| [self.helix(n); 2]).collect(),
            }];
        };
        let slices = shape.slices(self.axial_depth_mm, self.immersion, orders);
        let cutting = slices.into_iter().filter_map(|slice| {
            let height = slice.height_mm / self.axial_depth_mm;
            let turn = |n: usize| Complex64::from_polar(1.0, -(n as f64) * self.lag_rad * height);
            Some(EdgePart {
                height,
                immersion: slice.immersion?,
                kappa: (slice.sin_kappa, slice.cos_kappa),
                factors: multiples
                    .clone()
                    .map(|n| [slice.depth_mm, slice.length_mm()].map(|mm| turn(n) * mm))
                    .collect(),
            })
        });
        cutting.collect()
    }

    /// By quadrature over the immersion, and over the depth where runout makes the chip differ along it. `derivatives`:
    /// those with respect to the law's own quantities too.
    pub fn sampled(&self, orders: usize, law: ChipLaw, derivatives: bool) -> SampledForces {
        let wanted = [law.exponent.is_some(), law.runout.is_some(), law.runout.is_some()];
        let mut sampled = SampledForces {
            unit: Self::nothing(orders),
            slopes: wanted.map(|w| (w && derivatives).then(|| Box::new(Self::nothing(orders)))),
        };
        // Teeth that are alike leave multiples of their number.
        let differ = law.runout.is_some() || !self.places.is_empty();
        let step = if differ { 1 } else { self.teeth };
        let rows = orders / step + 1;
        let parts = if derivatives { Chip::PARTS } else { Chip::VALUES };
        let edge_parts = match self.shape {
            Some(_) => self.edge_parts(orders, step),
            None => self.depth_parts(orders, step, law),
        };
        let (mut columns, mut products) = (Vec::new(), Vec::new());
        let mut immersion = None;
        let (mut directions, mut waves) = (Vec::new(), Vec::new());
        for part in &edge_parts {
            if immersion != Some(part.immersion) {
                immersion = Some(part.immersion);
                directions = self.directions(part.immersion, orders);
                waves = waves_of(&directions, step, rows);
            }
            let edges = self.edges(part.height, law);
            let before: Vec<Vec<Before>> = (0..edges.len()).map(|j| self.before(&edges, j, law)).collect();
            columns.clear();
            for at in &directions {
                for before in &before {
                    let chip = self.chip(at, part.kappa.0, law, before, derivatives);
                    for part in &chip.part[..parts] {
                        columns.extend(at.share.map(|share| share * part));
                    }
                }
            }
            // ∫ part · {cos φ, sin φ, 1} e^{−inφ} dφ / 2π of each tooth for all orders and parts at once.
            let count = 3 * parts * edges.len();
            products.resize(2 * rows * count, 0.0);
            matmul(
                MatMut::from_row_major_slice_mut(&mut products, 2 * rows, count),
                Accum::Replace,
                MatRef::from_column_major_slice(&waves, 2 * rows, directions.len()),
                MatRef::from_row_major_slice(&columns, directions.len(), count),
                1.0,
                Par::Seq,
            );
            // Ahead of tooth 0 by a, a tooth adds order n turned by na.
            let alike = if differ { 1.0 } else { self.teeth as f64 };
            let ahead = |edge: &Edge| TAU / self.teeth as f64 * edge.ahead_teeth;
            let turns: Vec<Complex64> = edges
                .iter()
                .map(|e| Complex64::from_polar(1.0, step as f64 * ahead(e)))
                .collect();
            let mut turned = vec![Complex64::from(alike); edges.len()];
            for (row, (re, im)) in products
                .chunks(2 * count)
                .map(|both| both.split_at(count))
                .enumerate()
            {
                let mut integrals = [[Complex64::ZERO; 3]; Chip::PARTS];
                let teeth = re.chunks(3 * parts).zip(im.chunks(3 * parts));
                for ((re, im), turned) in teeth.zip(&turned) {
                    let own = re.iter().zip(im).map(|(re, im)| Complex64::new(*re, *im));
                    for (sum, own) in integrals.as_flattened_mut().iter_mut().zip(own) {
                        *sum += turned * own;
                    }
                }
                add_order(&mut sampled, &integrals, step * row, part, row);
                turned
                    .iter_mut()
                    .zip(&turns)
                    .for_each(|(turned, turn)| *turned *= turn);
            }
        }
        sampled
    }

    /// Nodes over the immersion: two for each period of the highest order, some more for what is not smooth.
    fn directions(&self, immersion: Immersion, orders: usize) -> Vec<Direction> {
        let Immersion { start_rad, exit_rad } = immersion;
        let smooth = if self.places.is_empty() { 40 } else { 160 };
        let count = smooth + (0.5 * orders as f64 * (exit_rad - start_rad)).ceil() as usize;
        let nodes = gauss_legendre(start_rad, exit_rad, count).into_iter();
        nodes.map(Direction::new).collect()
    }

    /// A straight edge in parts for [`Self::sampled`]: one where the chip is the same all along.
    fn depth_parts(&self, orders: usize, step: usize, law: ChipLaw) -> Vec<EdgePart> {
        let depths = match law.runout {
            Some([offset, _]) => {
                let lag = self.lag_rad.abs();
                let wander = WANDERING_ORDER * lag * (offset / self.feed_per_tooth_mm).abs().min(1.0);
                (2 + (lag / LAG_PER_NODE_RAD + wander).ceil() as usize).min(MOST_NODES)
            }
            None => 1,
        };
        // Lags that differ turn each tooth by its own angle, at the highest order by so many radians.
        let own_lag = |p: &ToothPlace| (p.lag_rad - self.lag_rad).abs();
        let turn = self.places.iter().map(own_lag).fold(0.0, f64::max) * orders.max(self.teeth) as f64;
        let depths = match turn > 0.0 {
            true => depths.max(8 + turn.ceil() as usize),
            false => depths,
        };
        let depth_nodes: Vec<f64> = gauss_legendre(0.0, 1.0, depths).iter().map(|n| n.0).collect();
        let weights = self.depth_weights(&depth_nodes, orders, step);
        let part = |(q, height): (usize, &f64)| EdgePart {
            height: *height,
            immersion: self.immersion,
            kappa: (1.0, 0.0),
            factors: (0..=orders).step_by(step).map(|n| [weights[n][q]; 2]).collect(),
        };
        depth_nodes.iter().enumerate().map(part).collect()
    }

    /// a ∫ L_q(z) e^{−inψz} dz with L_q the Lagrange polynomial of node q (Filon's rule): `[order][q]`. Only multiples of
    /// `step` are worked out.
    fn depth_weights(&self, depth_nodes: &[f64], orders: usize, step: usize) -> Vec<Vec<Complex64>> {
        let mut weights = vec![Vec::new(); orders + 1];
        if depth_nodes.len() == 1 {
            for n in (0..=orders).step_by(step) {
                weights[n] = vec![self.helix(n)];
            }
            return weights;
        }
        let count = 12 + (0.5 * orders as f64 * self.lag_rad.abs()).ceil() as usize;
        let fine = gauss_legendre(0.0, 1.0, count);
        let lagrange: Vec<Vec<f64>> = (0..depth_nodes.len())
            .map(|q| {
                let others = || depth_nodes.iter().enumerate().filter(move |(p, _)| *p != q);
                let at = |z: f64| {
                    others()
                        .map(|(_, x)| (z - x) / (depth_nodes[q] - x))
                        .product::<f64>()
                };
                fine.iter()
                    .map(|&(z, w)| self.axial_depth_mm * w * at(z))
                    .collect()
            })
            .collect();
        let turn: Vec<Complex64> = fine
            .iter()
            .map(|(z, _)| Complex64::from_polar(1.0, -(step as f64) * self.lag_rad * z))
            .collect();
        let mut lag = vec![Complex64::ONE; fine.len()];
        for n in (0..=orders).step_by(step) {
            weights[n] = lagrange
                .iter()
                .map(|l| l.iter().zip(&lag).map(|(l, e)| e * *l).sum())
                .collect();
            lag.iter_mut().zip(&turn).for_each(|(lag, turn)| *lag *= turn);
        }
        weights
    }

    /// Whether every order with the same remainder over the teeth sees the same sum over them.
    pub fn is_evenly_spaced(&self) -> bool {
        let even = |(j, p): (usize, &ToothPlace)| {
            (p.ahead_rad - TAU * j as f64 / self.teeth as f64).abs() < 1e-12 && p.lag_rad == self.lag_rad
        };
        self.places.iter().enumerate().all(even)
    }

    /// The edges of the teeth at depth `z`; one where they are alike.
    fn edges(&self, z: f64, law: ChipLaw) -> Vec<Edge> {
        let pitch = TAU / self.teeth as f64;
        let is_even = self.is_evenly_spaced();
        let places = self.places.iter().enumerate();
        match (law.runout, self.places.is_empty()) {
            (None, true) => vec![Edge::at(0.0, 0)],
            // Against the offset of the axis: the teeth differ by that alone.
            (Some([_, angle]), true) => (0..self.teeth)
                .map(|j| Edge::at(angle - TAU * j as f64 / self.teeth as f64 + self.lag_rad * z, j))
                .collect(),
            (runout, false) => places
                .map(|(j, place)| {
                    let ahead = place.ahead_rad - (place.lag_rad - self.lag_rad) * z;
                    let angle = runout.map_or(0.0, |r| r[1]);
                    Edge {
                        ahead_teeth: if is_even { j as f64 } else { ahead / pitch },
                        radius_mm: place.radius_mm,
                        ..Edge::at(angle - ahead + self.lag_rad * z, j)
                    }
                })
                .collect(),
        }
    }

    /// What the earlier teeth, the tooth itself a revolution ago among them, left for tooth `j` of `edges`; empty where feed
    /// alone tells.
    fn before(&self, edges: &[Edge], j: usize, law: ChipLaw) -> Vec<Before> {
        if law.runout.is_none() && self.places.is_empty() {
            return Vec::new();
        }
        let offset = law.runout.map_or(0.0, |r| r[0]);
        let here = edges[j];
        (1..=edges.len())
            .map(|m| {
                let before = edges[(j + m) % edges.len()];
                // In even pitches: a whole turn more where the count begins again.
                let turns = ((j + m) / edges.len() * edges.len()) as f64;
                Before {
                    feed_mm: (turns + before.ahead_teeth - here.ahead_teeth) * self.feed_per_tooth_mm,
                    gap_mm: offset * (here.cos - before.cos) + (here.radius_mm - before.radius_mm),
                    by: [here.cos - before.cos, -offset * (here.sin - before.sin)],
                    is_as_far: law.runout.is_none() && here.radius_mm == before.radius_mm,
                }
            })
            .collect()
    }

    /// What a tooth cuts that has those `before` it, where the edge's normal has `sin_kappa` across the axis.
    fn chip(
        &self,
        at: &Direction,
        sin_kappa: f64,
        law: ChipLaw,
        before: &[Before],
        derivatives: bool,
    ) -> Chip {
        let size = law.exponent.map(|p| (p, sin_kappa));
        let left = |b: &Before| b.feed_mm * at.sin + b.gap_mm;
        // What is left to cut is the least that any of them left.
        let Some(least) = before.iter().reduce(|a, b| if left(b) < left(a) { b } else { a }) else {
            let h = self.feed_per_tooth_mm * at.sin;
            return Chip::new(h, 1.0, 0.0, [0.0; 2], size, derivatives);
        };
        let h = left(least);
        if least.is_as_far {
            // Feed alone: it cuts all the way.
            return Chip::new(h, 1.0, 0.0, [0.0; 2], size, derivatives);
        }
        // The tooth leaves the cut within a quadrature cell: the share of it that is engaged.
        let rise = (least.feed_mm * at.cos).abs() * at.width;
        let inside = if rise > 0.0 {
            0.5 + h / rise
        } else {
            f64::from(h > 0.0)
        };
        let edge_slope = if inside > 0.0 && inside < 1.0 {
            1.0 / rise
        } else {
            0.0
        };
        Chip::new(h, inside.clamp(0.0, 1.0), edge_slope, least.by, size, derivatives)
    }
}

/// A part of the edge on which immersion and direction are one.
#[derive(Debug, Clone)]
pub(super) struct EdgePart {
    /// Above the tip, as a share of the depth.
    pub(super) height: f64,
    pub(super) immersion: Immersion,
    /// Sine and cosine of the angle between the edge's normal and the tool's axis.
    pub(super) kappa: (f64, f64),
    /// Axial depth and length of edge, mm, turned by the helix: one pair an order.
    pub(super) factors: Vec<[Complex64; 2]>,
}

/// Adds to order `n` what a part of the edge makes. `cutting`: chip times depth, mm²; `edge`: length in the work, mm; each times cos φ,
/// sin φ and 1.
pub(super) fn put(
    unit: &mut UnitForces,
    n: usize,
    cutting: &[Complex64; 3],
    edge: &[Complex64; 3],
    (sin_kappa, cos_kappa): (f64, f64),
) {
    for (first, [cos, sin, one]) in [(0, cutting), (3, edge)] {
        unit[first][0][n] -= cos;
        unit[first][1][n] += sin;
        unit[first + 1][0][n] -= sin * sin_kappa;
        unit[first + 1][1][n] -= cos * sin_kappa;
        unit[first + 2][2][n] += one * sin_kappa;
        if cos_kappa != 0.0 {
            unit[first + 1][2][n] += one * cos_kappa;
            unit[first + 2][0][n] += sin * cos_kappa;
            unit[first + 2][1][n] += cos * cos_kappa;
        }
    }
}

/// A node of the quadrature over the immersion.
#[derive(Debug, Clone, Copy)]
struct Direction {
    sin: f64,
    cos: f64,
    /// Of its cell, rad.
    width: f64,
    /// cos φ, sin φ and 1, times the width over a turn.
    share: [f64; 3],
}

impl Direction {
    fn new((phi, width): (f64, f64)) -> Direction {
        let (sin, cos) = phi.sin_cos();
        Direction {
            sin,
            cos,
            width,
            share: [cos, sin, 1.0].map(|d| d * width / TAU),
        }
    }
}

/// A tooth that went through before: it left `feed_mm` sin φ + `gap_mm` to cut.
#[derive(Debug, Clone, Copy)]
struct Before {
    feed_mm: f64,
    gap_mm: f64,
    /// Derivatives of what it left by the offset of the axis and by its direction.
    by: [f64; 2],
    /// No nearer to the axis and no farther than the tooth itself.
    is_as_far: bool,
}

/// Real and imaginary part of e^{−inφ} for the first `rows` multiples n of `step`, one after the other, node by node.
fn waves_of(directions: &[Direction], step: usize, rows: usize) -> Vec<f64> {
    let mut waves = Vec::with_capacity(2 * rows * directions.len());
    for at in directions {
        let turn = Complex64::new(at.cos, -at.sin).powu(step as u32);
        let mut wave = Complex64::ONE;
        for _ in 0..rows {
            waves.extend([wave.re, wave.im]);
            wave *= turn;
        }
    }
    waves
}

/// e^{−inφ} of one angle, for all orders.
pub(super) struct Turns(Vec<Complex64>);

impl Turns {
    /// Up to `orders` of either sign.
    pub(super) fn new(angle_rad: f64, orders: usize) -> Turns {
        let one = Complex64::from_polar(1.0, -angle_rad);
        let powers = std::iter::successors(Some(Complex64::ONE), |at| Some(at * one));
        Turns(powers.take(orders + 1).collect())
    }

    pub(super) fn at(&self, order: i64) -> Complex64 {
        let turn = self.0[order.unsigned_abs() as usize];
        if order < 0 { turn.conj() } else { turn }
    }
}

/// An immersion as an integral over it sees it.
pub(super) struct ImmersionWindow {
    immersion: Immersion,
    /// Of the angles that it begins and ends at.
    pub(super) ends: [Turns; 2],
}

impl ImmersionWindow {
    /// For integrands of up to `orders`.
    pub(super) fn new(immersion: Immersion, orders: usize) -> ImmersionWindow {
        let ends = [immersion.start_rad, immersion.exit_rad].map(|at| Turns::new(at, orders + 2));
        ImmersionWindow { immersion, ends }
    }

    /// (1/2π) ∫ {cos φ, sin φ, 1} e^{−inφ} dφ as it is and with sin φ besides, by Euler's formulas.
    pub(super) fn integrals(&self, n: usize) -> Integrals {
        let i = Complex64::I;
        let w = [-2i64, -1, 0, 1, 2].map(|m| match n as i64 + m {
            0 => Complex64::from((self.immersion.exit_rad - self.immersion.start_rad) / TAU),
            order => (self.ends[1].at(order) - self.ends[0].at(order)) * (i / (TAU * order as f64)),
        });
        let cos = 0.5 * (w[1] + w[3]);
        let sin = (w[1] - w[3]) / (2.0 * i);
        let sin_cos = (w[0] - w[4]) / (4.0 * i);
        let sin_sin = 0.5 * w[2] - 0.25 * (w[0] + w[4]);
        Integrals {
            plain: [cos, sin, w[2]],
            by_sine: [sin_cos, sin_sin, sin],
        }
    }
}

/// [`ImmersionWindow::integrals`].
pub(super) struct Integrals {
    pub(super) plain: [Complex64; 3],
    pub(super) by_sine: [Complex64; 3],
}

/// Where the edge of a tooth stands.
#[derive(Debug, Clone, Copy)]
struct Edge {
    /// Of its direction, seen from that of the axis' offset.
    sin: f64,
    cos: f64,
    /// How far ahead of tooth 0, in even pitches.
    ahead_teeth: f64,
    /// Beyond the tool's radius.
    radius_mm: f64,
}

impl Edge {
    /// Tooth `j` of teeth that are evenly spaced.
    fn at(angle_rad: f64, j: usize) -> Edge {
        let (sin, cos) = angle_rad.sin_cos();
        Edge {
            sin,
            cos,
            ahead_teeth: j as f64,
            radius_mm: 0.0,
        }
    }
}

/// Adds to order `n` what a part of the edge makes (`row` of its factors). `integrals`: of each part of the force times cos φ, sin φ and
/// 1.
fn add_order(
    sampled: &mut SampledForces,
    integrals: &[[Complex64; 3]; Chip::PARTS],
    n: usize,
    part: &EdgePart,
    row: usize,
) {
    let [depth, length] = part.factors[row];
    let add = |unit: &mut UnitForces, cutting: &[Complex64; 3], edge: &[Complex64; 3]| {
        let (cutting, edge) = (cutting.map(|v| v * depth), edge.map(|v| v * length));
        put(unit, n, &cutting, &edge, part.kappa);
    };
    add(
        &mut sampled.unit,
        &integrals[Chip::CUTTING],
        &integrals[Chip::EDGE],
    );
    let none = [Complex64::ZERO; 3];
    let pairs = [
        (integrals[Chip::BY_EXPONENT], none),
        (integrals[Chip::BY_OFFSET], integrals[Chip::EDGE_BY_OFFSET]),
        (integrals[Chip::BY_ANGLE], integrals[Chip::EDGE_BY_ANGLE]),
    ];
    for (slope, (cutting, edge)) in sampled.slopes.iter_mut().zip(&pairs) {
        if let Some(slope) = slope {
            add(slope, cutting, edge);
        }
    }
}

/// What one tooth cuts at one angle: effective chip thickness along the radius (mm), edge in contact (0..1), and their slopes.
struct Chip {
    part: [f64; Chip::PARTS],
}

impl Chip {
    const CUTTING: usize = 0;
    const EDGE: usize = 1;
    const BY_EXPONENT: usize = 2;
    const BY_OFFSET: usize = 3;
    const BY_ANGLE: usize = 4;
    const EDGE_BY_OFFSET: usize = 5;
    const EDGE_BY_ANGLE: usize = 6;
    const PARTS: usize = 7;
    /// Those that are no slopes.
    const VALUES: usize = 2;

    /// `h`: along the radius, mm; `size`: exponent, and what `h` is multiplied with for the thickness across the edge.
    fn new(
        h: f64,
        engaged: f64,
        edge_slope: f64,
        [by_offset, by_angle]: [f64; 2],
        size: Option<(f64, f64)>,
        derivatives: bool,
    ) -> Chip {
        let mut part = [0.0; Chip::PARTS];
        part[Chip::EDGE] = engaged;
        let mut slope = 0.0;
        if h > 0.0 {
            let (p, across) = size.map_or((0.0, 1.0), |(p, sin)| (p, h * sin / ChipLaw::REFERENCE_MM));
            let harder = if size.is_some() { across.powf(-p) } else { 1.0 };
            part[Chip::CUTTING] = h * harder;
            slope = (1.0 - p) * harder;
            if derivatives && size.is_some() {
                part[Chip::BY_EXPONENT] = -across.ln() * h * harder;
            }
        }
        if derivatives {
            part[Chip::BY_OFFSET] = slope * by_offset;
            part[Chip::BY_ANGLE] = slope * by_angle;
            part[Chip::EDGE_BY_OFFSET] = edge_slope * by_offset;
            part[Chip::EDGE_BY_ANGLE] = edge_slope * by_angle;
        }
        Chip { part }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn cut(teeth: usize, start_deg: f64, exit_deg: f64, lag_rad: f64) -> MillingCut {
        MillingCut {
            teeth,
            feed_per_tooth_mm: 0.12,
            axial_depth_mm: 2.5,
            immersion: Immersion {
                start_rad: start_deg.to_radians(),
                exit_rad: exit_deg.to_radians(),
            },
            lag_rad,
            shape: None,
            places: Vec::new(),
        }
    }

    fn worst(a: &UnitForces, b: &UnitForces) -> f64 {
        let mut worst: f64 = 0.0;
        for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
            for (a, b) in a.iter().zip(b) {
                worst = worst.max((a - b).norm());
            }
        }
        worst
    }

    #[test]
    fn order_zero_is_the_average_force_of_a_slot() {
        let unit = cut(4, 0.0, 180.0, 0.3).closed_form(8);
        let (n, a, c) = (4.0, 2.5, 0.12);
        // Altintas eq. 2.45 in these axes.
        for (got, want) in [
            (unit[0][1][0].re, n * a * c / 4.0),
            (unit[1][0][0].re, -n * a * c / 4.0),
            (unit[2][2][0].re, n * a * c / PI),
            (unit[3][1][0].re, n * a / PI),
            (unit[4][0][0].re, -n * a / PI),
            (unit[5][2][0].re, n * a / 2.0),
            (unit[0][0][0].re, 0.0),
        ] {
            assert!((got - want).abs() < 1e-12, "{got} {want}");
        }
    }

    #[test]
    fn one_tooth_without_helix_sums_to_the_force_at_each_angle() {
        let cut = cut(1, 30.0, 130.0, 0.0);
        let unit = cut.closed_form(4000);
        for phi_deg in [10.0f64, 60.0, 100.0, 150.0] {
            let phi = phi_deg.to_radians();
            let inside = (30.0..130.0).contains(&phi_deg);
            let wave = |c: &[Complex64]| -> f64 {
                let sum: Complex64 = c
                    .iter()
                    .enumerate()
                    .skip(1)
                    .map(|(n, c)| c * Complex64::from_polar(2.0, n as f64 * phi))
                    .sum();
                c[0].re + sum.re
            };
            let tangential = if inside { 2.5 * 0.12 * phi.sin() } else { 0.0 };
            assert!((wave(&unit[0][0]) + tangential * phi.cos()).abs() < 3e-4);
            assert!((wave(&unit[0][1]) - tangential * phi.sin()).abs() < 3e-4);
            assert!((wave(&unit[5][2]) - if inside { 2.5 } else { 0.0 }).abs() < 3e-3);
        }
    }

    #[test]
    fn quadrature_equals_the_closed_form_where_there_is_one() {
        for cut in [
            cut(6, 0.0, 180.0, 0.225),
            cut(3, 90.0, 180.0, 0.5),
            cut(2, 20.0, 75.0, 2.0),
        ] {
            let closed = cut.closed_form(96);
            let plain = cut.sampled(
                96,
                ChipLaw {
                    exponent: Some(0.0),
                    runout: None,
                },
                false,
            );
            assert!(worst(&closed, &plain.unit) < 1e-11);
            let concentric = ChipLaw {
                exponent: None,
                runout: Some([0.0, 1.0]),
            };
            let run = cut.sampled(96, concentric, false);
            assert!(worst(&closed, &run.unit) < 2e-3, "{}", worst(&closed, &run.unit));
        }
    }

    /// Slices of the depth and a fine turn of the tool, tooth by tooth: nothing in common with the quadrature but physics.
    fn brute_force(cut: &MillingCut, law: ChipLaw, orders: usize) -> UnitForces {
        let (steps, slices) = (14400, 240);
        let mut unit = MillingCut::nothing(orders);
        let [offset, angle] = law.runout.unwrap_or([0.0; 2]);
        let radius =
            |j: usize, z: f64| offset * (angle - TAU * j as f64 / cut.teeth as f64 + cut.lag_rad * z).cos();
        let mut wave = vec![[[0.0f64; 3]; 6]; steps];
        for (i, w) in wave.iter_mut().enumerate() {
            let theta = TAU * i as f64 / steps as f64;
            for s in 0..slices {
                let z = (s as f64 + 0.5) / slices as f64;
                let dz = cut.axial_depth_mm / slices as f64;
                for j in 0..cut.teeth {
                    let phi = (theta + TAU * j as f64 / cut.teeth as f64 - cut.lag_rad * z).rem_euclid(TAU);
                    if !(cut.immersion.start_rad..cut.immersion.exit_rad).contains(&phi) {
                        continue;
                    }
                    let h = (1..=cut.teeth)
                        .map(|m| {
                            m as f64 * cut.feed_per_tooth_mm * phi.sin() + radius(j, z) - radius(j + m, z)
                        })
                        .fold(f64::INFINITY, f64::min);
                    if h <= 0.0 {
                        continue;
                    }
                    let g = h * (h / ChipLaw::REFERENCE_MM).powf(-law.exponent.unwrap_or(0.0));
                    let (sin, cos) = phi.sin_cos();
                    for (first, f) in [(0, g * dz), (3, dz)] {
                        w[first][0] -= f * cos;
                        w[first][1] += f * sin;
                        w[first + 1][0] -= f * sin;
                        w[first + 1][1] -= f * cos;
                        w[first + 2][2] += f;
                    }
                }
            }
        }
        for n in 0..=orders {
            for (i, w) in wave.iter().enumerate() {
                let e =
                    Complex64::from_polar(1.0 / steps as f64, -TAU * ((n * i) % steps) as f64 / steps as f64);
                for k in 0..6 {
                    for axis in 0..3 {
                        unit[k][axis][n] += e * w[k][axis];
                    }
                }
            }
        }
        unit
    }

    #[test]
    fn runout_and_size_effect_equal_brute_force_slices() {
        for (cut, offset) in [
            (cut(6, 90.0, 180.0, 0.225), 0.02),
            (cut(3, 0.0, 180.0, 0.9), 0.05),
        ] {
            let law = ChipLaw {
                exponent: Some(0.25),
                runout: Some([offset, 1.1]),
            };
            let fine = brute_force(&cut, law, 24);
            let fast = cut.sampled(96, law, false);
            for k in 0..6 {
                let scale = if k < 3 { 0.12 * 2.5 } else { 2.5 };
                for axis in 0..3 {
                    for n in 0..=24 {
                        let off = (fine[k][axis][n] - fast.unit[k][axis][n]).norm() / scale;
                        assert!(off < 5e-4, "k {k} axis {axis} order {n}: {off}");
                    }
                }
            }
        }
    }

    #[test]
    fn slopes_by_the_chip_law_equal_differences() {
        let straight = cut(4, 0.0, 140.0, 0.4);
        let ball = crate::cutting::made_tools::endmill(6.0, 90.0);
        let ball = MillingCut {
            shape: EdgeShape::of(&ball),
            ..straight.clone()
        };
        for cut in [straight, ball] {
            slopes_equal_differences(&cut);
        }
    }

    fn slopes_equal_differences(cut: &MillingCut) {
        let law = |p: f64, offset: f64, angle: f64| ChipLaw {
            exponent: Some(p),
            runout: Some([offset, angle]),
        };
        let at = cut.sampled(20, law(0.2, 0.01, 0.7), true);
        for (i, h) in [(0, 1e-6), (1, 1e-8), (2, 1e-6)] {
            let shifted = |sign: f64| {
                let d = |k: usize| if k == i { sign * h } else { 0.0 };
                cut.sampled(20, law(0.2 + d(0), 0.01 + d(1), 0.7 + d(2)), false)
                    .unit
            };
            let (up, down) = (shifted(1.0), shifted(-1.0));
            let slope = at.slopes[i].as_ref().unwrap();
            let mut scale: f64 = 1e-9;
            for f in slope.iter().flatten().flatten() {
                scale = scale.max(f.norm());
            }
            for k in 0..6 {
                for axis in 0..3 {
                    for n in 0..=20 {
                        let difference = (up[k][axis][n] - down[k][axis][n]) / (2.0 * h);
                        let off = (difference - slope[k][axis][n]).norm() / scale;
                        assert!(off < 1e-4, "law {i} k {k} axis {axis} order {n}: {off}");
                    }
                }
            }
        }
    }

    /// A tapered end mill in a slot, in closed form: κ is the same all along, a slice is dz / sin κ of edge with the chip c sin φ sin κ.
    #[test]
    fn a_tapered_end_mill_has_the_averages_of_its_closed_form() {
        for taper_deg in [3.0f64, 10.0, 45.0] {
            let tool = crate::cutting::made_tools::endmill(0.0, 90.0 - taper_deg);
            let (sin, cos) = (90.0 - taper_deg).to_radians().sin_cos();
            let own = MillingCut {
                shape: EdgeShape::of(&tool),
                ..cut(4, 0.0, 180.0, 0.3)
            };
            let unit = own.closed_form(8);
            let (n, a, c) = (4.0, 2.5, 0.12);
            for (got, want) in [
                (unit[0][1][0].re, n * a * c / 4.0),
                (unit[1][0][0].re, -n * a * c / 4.0 * sin),
                (unit[1][2][0].re, n * a * c / PI * cos),
                (unit[2][0][0].re, n * a * c / 4.0 * cos),
                (unit[2][2][0].re, n * a * c / PI * sin),
                (unit[3][1][0].re, n * a / (PI * sin)),
                (unit[4][0][0].re, -n * a / PI),
                (unit[4][2][0].re, n * a / 2.0 * cos / sin),
                (unit[5][0][0].re, n * a / PI * cos / sin),
                (unit[5][2][0].re, n * a / 2.0),
            ] {
                assert!((got - want).abs() < 1e-12, "{taper_deg}: {got} {want}");
            }
        }
    }

    /// A ball end and an insert with a lead angle, in a slot and in a narrow cut, with and without runout and size effect: the force of
    /// each bit of edge in space, as a vector, with its own position and direction; nothing in common with the slices' formulas.
    #[test]
    fn shaped_edges_equal_vectors_summed_over_the_edge() {
        let (orders, steps, bits) = (6, 1440, 600);
        let runout = Some([0.03, 0.8]);
        for (corner_radius_mm, lead_angle_deg, start_deg, exponent, runout) in [
            (6.0, 90.0, 0.0, None, None),
            (6.0, 90.0, 110.0, None, None),
            (1.0, 60.0, 0.0, None, None),
            (2.0, 80.0, 0.0, None, None),
            (6.0, 90.0, 0.0, None, runout),
            (6.0, 90.0, 110.0, Some(0.25), None),
            (1.0, 60.0, 0.0, Some(0.3), runout),
        ] {
            let law = ChipLaw { exponent, runout };
            let [offset, direction] = runout.unwrap_or_default();
            let tool = crate::cutting::made_tools::endmill(corner_radius_mm, lead_angle_deg);
            let (depth, feed) = (2.5, 0.12);
            let immersion = Immersion {
                start_rad: f64::to_radians(start_deg),
                exit_rad: PI,
            };
            let cut = MillingCut {
                teeth: 2,
                feed_per_tooth_mm: feed,
                axial_depth_mm: depth,
                immersion,
                lag_rad: 0.24,
                shape: EdgeShape::of(&tool),
                places: Vec::new(),
            };
            // Points along the outline (distance from the axis, height), close enough to be straight between.
            let lead = f64::to_radians(lead_angle_deg);
            let outline: Vec<[f64; 2]> = (0..=bits)
                .map(|b| {
                    let z = depth * (b as f64 / bits as f64).powi(2);
                    let top = corner_radius_mm * (1.0 - lead.cos());
                    let on = z.min(top);
                    let reach = (on * (2.0 * corner_radius_mm - on)).sqrt() + (z - on) / lead.tan();
                    [6.0 - corner_radius_mm + reach, z]
                })
                .collect();
            let wall = 6.0 * immersion.start_rad.cos();
            let mut wave = vec![[[0.0f64; 3]; 6]; steps];
            for (i, wave) in wave.iter_mut().enumerate() {
                for tooth in 0..2 {
                    for ends in outline.windows(2) {
                        let (dr, dz) = (ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]);
                        let (radius, z) = (0.5 * (ends[0][0] + ends[1][0]), 0.5 * (ends[0][1] + ends[1][1]));
                        let turn = TAU * (i as f64 / steps as f64 + tooth as f64 / 2.0);
                        let phi = (turn - cut.lag_rad * z / depth).rem_euclid(TAU);
                        // Inside the workpiece: on the side of the feed, not beyond its wall.
                        if phi >= PI || (start_deg > 0.0 && radius * phi.cos() > wall) {
                            continue;
                        }
                        let length = dr.hypot(dz);
                        // φ runs from +y towards +x, the feed.
                        let outward = [phi.sin(), phi.cos()];
                        let normal = [outward[0] * dz / length, outward[1] * dz / length, -dr / length];
                        let along = [outward[0] * dr / length, outward[1] * dr / length, dz / length];
                        let against_cutting = [-phi.cos(), phi.sin(), 0.0];
                        let eccentric = |tooth: usize| {
                            offset * (direction - PI * tooth as f64 + cut.lag_rad * z / depth).cos()
                        };
                        let left = feed * phi.sin() + eccentric(tooth) - eccentric(tooth + 1);
                        // Along the radius; what the other tooth did not leave, its own pass a turn ago did.
                        let radial = left.min(2.0 * feed * phi.sin());
                        if radial <= 0.0 {
                            continue;
                        }
                        let thickness = radial * dz / length;
                        let chip =
                            thickness * (thickness / ChipLaw::REFERENCE_MM).powf(-exponent.unwrap_or(0.0));
                        for axis in 0..3 {
                            for (k, direction) in [against_cutting[axis], -normal[axis], along[axis]]
                                .iter()
                                .enumerate()
                            {
                                wave[k][axis] += direction * chip * length;
                                wave[3 + k][axis] += direction * length;
                            }
                        }
                    }
                }
            }
            let unit = match (exponent, runout) {
                (None, None) => cut.closed_form(orders),
                (None, runout) => cut.own_teeth(orders, runout, TeethSlopes::None).unit,
                _ => cut.sampled(orders, law, false).unit,
            };
            if exponent.is_none() {
                let off = worst(&unit, &cut.sampled(orders, law, false).unit) / depth;
                assert!(off < 3e-3, "r {corner_radius_mm} {start_deg}° {runout:?}: {off}");
            }
            for n in 0..=orders {
                for k in 0..6 {
                    for axis in 0..3 {
                        let sum: Complex64 = wave
                            .iter()
                            .enumerate()
                            .map(|(i, w)| {
                                let turn = TAU * ((n * i) % steps) as f64 / steps as f64;
                                w[k][axis] * Complex64::from_polar(1.0 / steps as f64, -turn)
                            })
                            .sum();
                        let scale = if k < 3 { feed * depth } else { depth };
                        let off = (sum - unit[k][axis][n]).norm() / scale;
                        assert!(
                            off < 3e-3,
                            "r {corner_radius_mm} {start_deg}° k {k} axis {axis} order {n}: {off}"
                        );
                        // The averages of the regression are order 0.
                        if n == 0 && law == ChipLaw::default() {
                            let geometry = CutGeometry::Milling {
                                feed_per_tooth_mm: feed,
                                axial_depth_mm: depth,
                                immersion,
                            };
                            let axis = crate::cutting::ForceAxis::ALL[axis];
                            let row = crate::cutting::average_row(&tool, &geometry, axis).unwrap();
                            assert!((row[k] - unit[k][axis.index()][0].re).abs() < 1e-9 * scale);
                        }
                    }
                }
            }
        }
    }
}
