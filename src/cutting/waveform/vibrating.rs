//! Milling forces while the tool vibrates at a frequency of its own against the surface that the tooth before left.
//!
//! The chip becomes h + w cos ψ with w = Δx sin φ + Δy cos φ and ψ the vibration's phase, which wanders through all values
//! since its frequency is none of the tool's orders. Averaged over ψ it gives the orders of rotation: where |w| > h the
//! tooth leaves the cut for a while, so they change too. The part in step with cos ψ gives the lines at the vibration's
//! frequency and its side bands; where the tooth stays in the cut that is the directional matrix of the lobe theory with its
//! harmonics (Altintas & Budak 1995).

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;

use super::milling::{ChipLaw, MillingCut, UNIT_COUNT, UnitForces};
use super::quadrature::gauss_legendre;

/// Tool-frame force amplitudes x, y, z (N) of one line for one unit of each coefficient.
pub type LineForces = [[Complex64; 3]; UNIT_COUNT];

/// Forces with derivatives.
#[derive(Debug, Clone)]
pub struct VibratingForces {
    /// On the orders of the tool's rotation.
    pub unit: UnitForces,
    /// By the size exponent, Δx and Δy (per mm).
    pub slopes: Box<[UnitForces; 3]>,
    /// At the vibration's frequency shifted by r tooth-passing frequencies, r = −most..=most.
    pub lines: Vec<LineForces>,
    /// By Δx and Δy.
    pub line_slopes: [Vec<LineForces>; 2],
}

/// Phases of the vibration that the chip is averaged over; ψ and −ψ are alike.
const PHASES: usize = 24;

/// What one angle of immersion contributes; see [`contributions`].
const PARTS: usize = 13;
/// Cutting and edge part of the mean, its slopes by p, Δx and Δy, of the lines and their slopes by Δx and Δy.
const PAIRS: [(usize, Option<usize>); 7] = [
    (0, Some(1)),
    (2, None),
    (3, Some(5)),
    (4, Some(6)),
    (7, Some(8)),
    (9, Some(11)),
    (10, Some(12)),
];

impl MillingCut {
    /// `change_mm`: amplitude Δx, Δy of the change of the chip's boundary from one tooth to the next.
    pub fn vibrating(
        &self,
        orders: usize,
        exponent: Option<f64>,
        change_mm: [f64; 2],
        most: usize,
    ) -> VibratingForces {
        let span = self.immersion.exit_rad - self.immersion.start_rad;
        let count = 60 + (0.5 * orders as f64 * span).ceil() as usize;
        let nodes = gauss_legendre(self.immersion.start_rad, self.immersion.exit_rad, count);
        let parts: Vec<[f64; PARTS]> = nodes
            .iter()
            .map(|(phi, _)| contributions(self.feed_per_tooth_mm, exponent, change_mm, *phi))
            .collect();
        let nothing = || -> UnitForces {
            std::array::from_fn(|_| std::array::from_fn(|_| vec![Complex64::ZERO; orders + 1]))
        };
        let mut all = VibratingForces {
            unit: nothing(),
            slopes: Box::new([nothing(), nothing(), nothing()]),
            lines: Vec::new(),
            line_slopes: [Vec::new(), Vec::new()],
        };
        for n in (0..=orders).step_by(self.teeth) {
            let at = |pair: usize| self.order_forces(&nodes, &parts, PAIRS[pair], n as i64);
            let put = |unit: &mut UnitForces, forces: LineForces| {
                for (unit, forces) in unit.iter_mut().zip(forces) {
                    for (axis, force) in unit.iter_mut().zip(forces) {
                        axis[n] = force;
                    }
                }
            };
            put(&mut all.unit, at(0));
            for (k, slope) in all.slopes.iter_mut().enumerate() {
                put(slope, at(1 + k));
            }
        }
        for r in -(most as i64)..=most as i64 {
            let at = |pair: usize| self.order_forces(&nodes, &parts, PAIRS[pair], r * self.teeth as i64);
            all.lines.push(at(4));
            all.line_slopes[0].push(at(5));
            all.line_slopes[1].push(at(6));
        }
        all
    }

    /// Forces at order `n` of what `pair` (cutting part, edge part) contributes.
    fn order_forces(
        &self,
        nodes: &[(f64, f64)],
        parts: &[[f64; PARTS]],
        (cutting, edge): (usize, Option<usize>),
        n: i64,
    ) -> LineForces {
        let mut sums = [[Complex64::ZERO; 3]; 2];
        for ((phi, weight), part) in nodes.iter().zip(parts) {
            let (sin, cos) = phi.sin_cos();
            let carrier = Complex64::from_polar(weight / TAU, -(n as f64) * phi);
            for (sum, value) in sums
                .iter_mut()
                .zip([part[cutting], edge.map_or(0.0, |e| part[e])])
            {
                let value = carrier * value;
                sum[0] += value * cos;
                sum[1] += value * sin;
                sum[2] += value;
            }
        }
        let factor = self.helix_at(n) * self.teeth as f64;
        let mut forces = [[Complex64::ZERO; 3]; UNIT_COUNT];
        for (first, [cos, sin, one]) in [(0, sums[0]), (3, sums[1])] {
            forces[first][0] = -factor * cos;
            forces[first][1] = factor * sin;
            forces[first + 1][0] = -factor * sin;
            forces[first + 1][1] = -factor * cos;
            forces[first + 2][2] = factor * one;
        }
        forces
    }
}

/// Mean effective chip, mean contact, slopes of the chip by p, Δx, Δy, of the contact by Δx, Δy; the same in step with the
/// vibration (chip, contact, chip by Δx, Δy, contact by Δx, Δy).
fn contributions(feed_mm: f64, exponent: Option<f64>, [dx, dy]: [f64; 2], phi: f64) -> [f64; PARTS] {
    let (sin, cos) = phi.sin_cos();
    let h = feed_mm * sin;
    let signed = dx * sin + dy * cos;
    let (w, sign) = (signed.abs(), if signed < 0.0 { -1.0 } else { 1.0 });
    let p = exponent.unwrap_or(0.0);
    let (mut chip, mut by_p, mut by_w, mut line, mut line_by_w) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for k in 0..PHASES {
        let c = (PI * (k as f64 + 0.5) / PHASES as f64).cos();
        let own = h + w * c;
        if own <= 0.0 {
            continue;
        }
        let size = if exponent.is_some() {
            (own / ChipLaw::REFERENCE_MM).powf(-p)
        } else {
            1.0
        };
        let share = 1.0 / PHASES as f64;
        chip += share * own * size;
        by_p -= share * own * size * (own / ChipLaw::REFERENCE_MM).ln();
        by_w += share * (1.0 - p) * size * c;
        line += share * 2.0 * c * own * size;
        line_by_w += share * 2.0 * c * c * (1.0 - p) * size;
    }
    // Share of the phases in contact: h + w cos ψ > 0.
    let (mut contact, mut contact_by_w, mut contact_line, mut contact_line_by_w) = (1.0, 0.0, 0.0, 0.0);
    if h < w {
        let x = (h / w).clamp(-1.0, 1.0);
        let root = (1.0 - x * x).sqrt();
        contact = 1.0 - x.acos() / PI;
        contact_line = 2.0 / PI * root;
        // The slopes' singularity where the tooth just begins to leave is integrable, and cut off.
        let soft = root.max(0.05);
        contact_by_w = -x / (PI * soft * w);
        contact_line_by_w = 2.0 / PI * x * x / (soft * w);
    }
    [
        chip,
        contact,
        by_p,
        by_w * sign * sin,
        by_w * sign * cos,
        contact_by_w * sign * sin,
        contact_by_w * sign * cos,
        line * sign,
        contact_line * sign,
        line_by_w * sin,
        line_by_w * cos,
        contact_line_by_w * sin,
        contact_line_by_w * cos,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Immersion;

    fn slot() -> MillingCut {
        MillingCut {
            teeth: 3,
            feed_per_tooth_mm: 0.1,
            axial_depth_mm: 1.0,
            immersion: Immersion::SLOT,
            lag_rad: 0.0,
            shape: None,
            places: Vec::new(),
        }
    }

    #[test]
    fn a_small_vibration_gives_the_zero_order_directional_matrix() {
        let small = 1e-6;
        // Σ over the teeth of a slot without helix, N/2π · α with αxx = −πKr, αxy = −π, αyx = π, αyy = −πKr, halved
        // (Altintas's factor ½ is taken out): docs/physics.md, "Reference cases", D.
        for (direction, want) in [
            ([small, 0.0], [0.0, 1.5 / 2.0, -1.5 / 2.0]),
            ([0.0, small], [-1.5 / 2.0, 0.0, 0.0]),
        ] {
            let line = &slot().vibrating(0, None, direction, 0).lines[0];
            let close =
                |got: Complex64, want: f64| assert!((got.re / small - want).abs() < 2e-3, "{got} {want}");
            close(line[0][0], want[0]);
            close(line[0][1], want[1]);
            if direction[0] > 0.0 {
                close(line[1][0], want[2]);
            }
        }
    }

    #[test]
    fn without_vibration_the_orders_are_the_closed_form() {
        let closed = slot().closed_form(30);
        let still = slot().vibrating(30, None, [1e-12, 0.0], 0);
        for (a, b) in closed
            .iter()
            .flatten()
            .flatten()
            .zip(still.unit.iter().flatten().flatten())
        {
            assert!((a - b).norm() < 1e-6);
        }
    }
}
