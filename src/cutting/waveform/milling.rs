//! Milling: Fourier coefficients of the tool-frame forces over the orders of the tool's rotation.
//!
//! Tooth j stands at φ = θ + 2πj/N − ψz where θ is the tool's rotation and z ∈ [0, 1] runs up the engaged depth, ψ being
//! the lag of the helix over it (physics.md §4; Altintas, Manufacturing Automation, 2nd ed., §2.3–2.5).

use std::f64::consts::TAU;

use num_complex::Complex64;

use super::quadrature::gauss_legendre;
use crate::campaign::{CutGeometry, Immersion, Tool};

/// Ktc Krc Kac Kte Kre Kae.
pub const UNIT_COUNT: usize = 6;

/// What a milling cut's waveform depends on besides its coefficients.
#[derive(Debug, Clone, PartialEq)]
pub struct MillingCut {
    pub teeth: usize,
    pub feed_per_tooth_mm: f64,
    pub axial_depth_mm: f64,
    pub immersion: Immersion,
    /// Angle by which the top of the engaged depth lags behind the tip, rad: 2 a tan β / D.
    pub lag_rad: f64,
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
        })
    }

    fn nothing(orders: usize) -> UnitForces {
        std::array::from_fn(|_| std::array::from_fn(|_| vec![Complex64::ZERO; orders + 1]))
    }

    /// (1/2π) ∫ e^{−imφ} dφ over the immersion.
    fn window(&self, m: i64) -> Complex64 {
        let Immersion { start_rad, exit_rad } = self.immersion;
        if m == 0 {
            return Complex64::from((exit_rad - start_rad) / TAU);
        }
        let m = m as f64;
        let end = |angle: f64| Complex64::from_polar(1.0, -m * angle);
        (end(exit_rad) - end(start_rad)) * Complex64::new(0.0, 1.0 / (TAU * m))
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
    pub fn closed_form(&self, orders: usize) -> UnitForces {
        let mut unit = Self::nothing(orders);
        let c = self.feed_per_tooth_mm;
        let i = Complex64::I;
        for n in (0..=orders).step_by(self.teeth) {
            let factor = self.helix(n) * self.teeth as f64;
            let w = |m: i64| self.window(n as i64 + m);
            // cos φ, sin φ, sin φ cos φ and sin² φ by Euler's formulas.
            let cos = 0.5 * (w(-1) + w(1));
            let sin = (w(-1) - w(1)) / (2.0 * i);
            let sin_cos = (w(-2) - w(2)) / (4.0 * i);
            let sin_sin = 0.5 * w(0) - 0.25 * (w(-2) + w(2));
            let mut set = |k: usize, axis: usize, value: Complex64| unit[k][axis][n] = value * factor;
            set(0, 0, -c * sin_cos);
            set(0, 1, c * sin_sin);
            set(1, 0, -c * sin_sin);
            set(1, 1, -c * sin_cos);
            set(2, 2, c * sin);
            set(3, 0, -cos);
            set(3, 1, sin);
            set(4, 0, -sin);
            set(4, 1, -cos);
            set(5, 2, w(0));
        }
        unit
    }

    /// By quadrature over the immersion, and over the depth where runout makes the chip differ along it. `derivatives`:
    /// those with respect to the law's own quantities too.
    pub fn sampled(&self, orders: usize, law: ChipLaw, derivatives: bool) -> SampledForces {
        let span = self.immersion.exit_rad - self.immersion.start_rad;
        // Two nodes for each period of the highest order, some more for what is not smooth.
        let count = 40 + (0.5 * orders as f64 * span).ceil() as usize;
        let nodes = gauss_legendre(self.immersion.start_rad, self.immersion.exit_rad, count);
        let depths = match law.runout {
            Some([offset, _]) => {
                let lag = self.lag_rad.abs();
                let wander = WANDERING_ORDER * lag * (offset / self.feed_per_tooth_mm).abs().min(1.0);
                (2 + (lag / LAG_PER_NODE_RAD + wander).ceil() as usize).min(MOST_NODES)
            }
            None => 1,
        };
        let depth_nodes: Vec<f64> = gauss_legendre(0.0, 1.0, depths).iter().map(|n| n.0).collect();
        let wanted = [law.exponent.is_some(), law.runout.is_some(), law.runout.is_some()];
        let mut sampled = SampledForces {
            unit: Self::nothing(orders),
            slopes: wanted.map(|w| (w && derivatives).then(|| Box::new(Self::nothing(orders)))),
        };
        let step = if law.runout.is_some() { 1 } else { self.teeth };
        let parts = if derivatives { Chip::PARTS } else { Chip::VALUES };
        let weights = self.depth_weights(&depth_nodes, orders, step);
        let turn: Vec<Complex64> = nodes
            .iter()
            .map(|(phi, _)| Complex64::from_polar(1.0, -(step as f64) * phi))
            .collect();
        let directions: Vec<(f64, f64)> = nodes.iter().map(|(phi, _)| phi.sin_cos()).collect();
        for (q, &z) in depth_nodes.iter().enumerate() {
            let residues: Vec<Vec<Complex64>> = self.tooth_sums(&nodes, z, law, derivatives, parts);
            let mut carrier: Vec<Complex64> = nodes.iter().map(|(_, w)| Complex64::from(w / TAU)).collect();
            for (at, n) in (0..=orders).step_by(step).enumerate() {
                let teeth = &residues[n % residues.len()];
                add_order(
                    &mut sampled,
                    &directions,
                    &carrier,
                    teeth,
                    parts,
                    n,
                    weights[at][q],
                );
                carrier.iter_mut().zip(&turn).for_each(|(c, t)| *c *= t);
            }
        }
        sampled
    }

    /// a ∫ L_q(z) e^{−inψz} dz with L_q the Lagrange polynomial of node q (Filon's rule): `[order][q]`.
    fn depth_weights(&self, depth_nodes: &[f64], orders: usize, step: usize) -> Vec<Vec<Complex64>> {
        if depth_nodes.len() == 1 {
            return (0..=orders).step_by(step).map(|n| vec![self.helix(n)]).collect();
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
        (0..=orders)
            .step_by(step)
            .map(|n| {
                let lag: Vec<Complex64> = fine
                    .iter()
                    .map(|(z, _)| Complex64::from_polar(1.0, -(n as f64) * self.lag_rad * z))
                    .collect();
                lagrange
                    .iter()
                    .map(|l| l.iter().zip(&lag).map(|(l, e)| e * *l).sum())
                    .collect()
            })
            .collect()
    }

    /// Σ_j e^{2πi rj/N} part_j for r = 0..N at depth `z`: `[r][node · parts + part]`; one entry where teeth are alike.
    fn tooth_sums(
        &self,
        nodes: &[(f64, f64)],
        z: f64,
        law: ChipLaw,
        derivatives: bool,
        parts: usize,
    ) -> Vec<Vec<Complex64>> {
        let residues = if law.runout.is_some() { self.teeth } else { 1 };
        let mut sums = vec![vec![Complex64::ZERO; nodes.len() * parts]; residues];
        // Tooth j is ahead of tooth 0.
        let ahead = |m: usize| Complex64::from_polar(1.0, TAU * m as f64 / self.teeth as f64);
        let ahead: Vec<Complex64> = (0..self.teeth).map(ahead).collect();
        for (k, &(phi, width)) in nodes.iter().enumerate() {
            let chips = self.chips(phi, width, z, law, derivatives);
            let weight = if chips.len() == 1 { self.teeth as f64 } else { 1.0 };
            for (r, sum) in sums.iter_mut().enumerate() {
                for (j, chip) in chips.iter().enumerate() {
                    let turn = ahead[(r * j) % self.teeth] * weight;
                    for part in 0..parts {
                        sum[k * parts + part] += turn * chip.part[part];
                    }
                }
            }
        }
        sums
    }

    /// What each tooth cuts at immersion angle `phi`. `width`: of the quadrature cell, rad.
    fn chips(&self, phi: f64, width: f64, z: f64, law: ChipLaw, derivatives: bool) -> Vec<Chip> {
        let teeth = if law.runout.is_some() { self.teeth } else { 1 };
        let c = self.feed_per_tooth_mm;
        (0..teeth)
            .map(|j| {
                let (mut h, mut by_offset, mut by_angle, mut periods) = (c * phi.sin(), 0.0, 0.0, 1.0);
                if let Some([offset, angle]) = law.runout {
                    // Radius of tooth j' over that of the tool; what is left to cut is the least that any earlier
                    // tooth left, the tooth itself a revolution ago among them.
                    let at = |j: usize| angle - TAU * j as f64 / self.teeth as f64 + self.lag_rad * z;
                    let here = at(j);
                    h = f64::INFINITY;
                    for m in 1..=self.teeth {
                        let before = at(j + m);
                        let left = m as f64 * c * phi.sin() + offset * (here.cos() - before.cos());
                        if left < h {
                            h = left;
                            by_offset = here.cos() - before.cos();
                            by_angle = -offset * (here.sin() - before.sin());
                            periods = m as f64;
                        }
                    }
                }
                // The tooth leaves the cut within a quadrature cell: the share of it that is engaged.
                let rise = (periods * c * phi.cos()).abs() * width;
                let inside = if rise > 0.0 {
                    0.5 + h / rise
                } else {
                    f64::from(h > 0.0)
                };
                let engaged = if law.runout.is_some() {
                    inside.clamp(0.0, 1.0)
                } else {
                    1.0
                };
                let edge_slope = if law.runout.is_some() && inside > 0.0 && inside < 1.0 {
                    1.0 / rise
                } else {
                    0.0
                };
                Chip::new(
                    h,
                    engaged,
                    edge_slope,
                    [by_offset, by_angle],
                    law.exponent,
                    derivatives,
                )
            })
            .collect()
    }
}

/// Adds one depth node's share of order `n`. `directions`: sin φ and cos φ a node; `carrier`: quadrature
/// weight × e^{−inφ} / 2π; `teeth`: the sum over the
/// teeth, `[node · parts + part]`.
fn add_order(
    sampled: &mut SampledForces,
    directions: &[(f64, f64)],
    carrier: &[Complex64],
    teeth: &[Complex64],
    parts: usize,
    n: usize,
    factor: Complex64,
) {
    // Per part of the force (cutting, edge and their slopes): ∫ part · {cos φ, sin φ, 1} e^{−inφ} dφ.
    let mut sums = [[Complex64::ZERO; 3]; Chip::PARTS];
    for (k, ((sin, cos), carrier)) in directions.iter().zip(carrier).enumerate() {
        for (sum, tooth) in sums.iter_mut().zip(&teeth[k * parts..(k + 1) * parts]) {
            let value = carrier * tooth;
            sum[0] += value * cos;
            sum[1] += value * sin;
            sum[2] += value;
        }
    }
    let put = |unit: &mut UnitForces, cutting: &[Complex64; 3], edge: &[Complex64; 3]| {
        for (first, [cos, sin, one]) in [(0, cutting), (3, edge)] {
            unit[first][0][n] -= factor * cos;
            unit[first][1][n] += factor * sin;
            unit[first + 1][0][n] -= factor * sin;
            unit[first + 1][1][n] -= factor * cos;
            unit[first + 2][2][n] += factor * one;
        }
    };
    put(&mut sampled.unit, &sums[Chip::CUTTING], &sums[Chip::EDGE]);
    let none = [Complex64::ZERO; 3];
    let pairs = [
        (sums[Chip::BY_EXPONENT], none),
        (sums[Chip::BY_OFFSET], sums[Chip::EDGE_BY_OFFSET]),
        (sums[Chip::BY_ANGLE], sums[Chip::EDGE_BY_ANGLE]),
    ];
    for (slope, (cutting, edge)) in sampled.slopes.iter_mut().zip(&pairs) {
        if let Some(slope) = slope {
            put(slope, cutting, edge);
        }
    }
}

/// What one tooth cuts at one angle: effective chip thickness (mm), edge in contact (0..1), and their slopes.
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

    fn new(
        h: f64,
        engaged: f64,
        edge_slope: f64,
        [by_offset, by_angle]: [f64; 2],
        exponent: Option<f64>,
        derivatives: bool,
    ) -> Chip {
        let mut part = [0.0; Chip::PARTS];
        part[Chip::EDGE] = engaged;
        let mut slope = 0.0;
        if h > 0.0 {
            let reference = ChipLaw::REFERENCE_MM;
            let p = exponent.unwrap_or(0.0);
            let size = if exponent.is_some() {
                (h / reference).powf(-p)
            } else {
                1.0
            };
            part[Chip::CUTTING] = h * size;
            slope = (1.0 - p) * size;
            if derivatives && exponent.is_some() {
                part[Chip::BY_EXPONENT] = -(h / reference).ln() * h * size;
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
        let cut = cut(4, 0.0, 140.0, 0.4);
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
}
