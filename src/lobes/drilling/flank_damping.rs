//! Process damping of a drill's flanks: an edge that moves into the work presses its worn flank into the waves there.
//!
//! The volume pressed in, times the material's indentation stiffness, is a force against the motion; for small waves it is
//! that of a viscous damper, C/V per width with C = K_sp L²/2 (K_sp indentation stiffness, L wear land, V cutting speed: Wu
//! 1989, "A new approach of formulating the transfer function for dynamic cutting processes", ASME J. Eng. Ind. 111; Chung &
//! Tu 2002; Eynian & Altintas 2009, "Chatter stability of general turning operations with process damping").
//!
//! The speed V = Ω r grows along the lip. With the flank normal leaning to the axis by the half point angle κ and the length
//! dr/sin κ of an element, N lips damp motion along the tool by N C sin κ ln(R/r₀)/Ω and motion across it by half of
//! N C cos²κ/sin κ ln(R/r₀)/Ω in each direction. Spread over the width b = R − r₀ of the hole this is c(n) b, exact where the
//! limit equals that width.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;

use crate::lobes::curve::{Limit, SpeedLimit};
use crate::lobes::dynamics::frf::{Receptance, ToolPointFrf};
use crate::lobes::force::RegenerativeForce;

/// Damping per width of cut, the greater the slower the drill turns.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct FlankDamping {
    /// c·Ω/b across the tool, N/m² (N·s/m per m of width, times rad/s).
    pub lateral_n_per_m2: f64,
    /// The same along the tool.
    pub axial_n_per_m2: f64,
    /// Slowest speed that is asked for: sets how closely frequencies are looked at, rpm.
    #[serde(skip)]
    pub slowest_rpm: f64,
}

impl FlankDamping {
    /// `coefficient_n_per_m`: C; `radii_mm`: where the lips begin and end.
    pub fn new(
        coefficient_n_per_m: f64,
        radii_mm: [f64; 2],
        half_point_rad: f64,
        lips: usize,
        slowest_rpm: f64,
    ) -> Self {
        let [inner_m, outer_m] = radii_mm.map(|mm| 1e-3 * mm);
        // A drill without web: the lips begin a thousandth of the radius off the axis, where V vanishes.
        let inner_m = inner_m.max(1e-3 * outer_m);
        let per_width = (outer_m / inner_m).ln() / (outer_m - inner_m);
        let (sin, cos) = half_point_rad.sin_cos();
        let all = lips as f64 * coefficient_n_per_m * per_width;
        FlankDamping {
            lateral_n_per_m2: 0.5 * all * cos * cos / sin,
            axial_n_per_m2: all * sin,
            slowest_rpm,
        }
    }
}

/// Frequencies per turn of the phase ωT at the slowest speed.
const PER_TURN: f64 = 24.0;
/// At most this many frequencies: a tool of kilohertz at a few rpm.
const MOST: f64 = 40_000.0;

/// The limit of a regenerative force with damping per width: the smallest real b > 0 with
/// det(I − b [(1 − e^{−iωT}) D − iω c(n)] Φ(iω)) = 0.
pub struct DampedSolver<'a> {
    force: RegenerativeForce,
    frf: &'a dyn ToolPointFrf,
    /// c(n)·Ω of both displacements, N/m².
    damping_n_per_m2: [f64; 2],
    /// Frequency and receptance, ascending.
    samples: Vec<(f64, Receptance)>,
}

impl<'a> DampedSolver<'a> {
    /// `damping_n_per_m2`: c·Ω per width against each of the two displacements.
    pub fn new(
        force: RegenerativeForce,
        frf: &'a dyn ToolPointFrf,
        damping_n_per_m2: [f64; 2],
        slowest_rpm: f64,
    ) -> Self {
        let (low, high) = frf.band_hz();
        let wanted = force.teeth as f64 * slowest_rpm / 60.0 / PER_TURN;
        let step = wanted.max((high - low) / MOST);
        let mut grid = frf.seed_grid_hz();
        let even = ((high - low) / step).ceil() as usize;
        grid.extend((0..=even).map(|i| (low + step * i as f64).min(high)));
        grid.sort_by(f64::total_cmp);
        grid.dedup_by(|b, a| *b - *a <= 1e-9 * *b);
        DampedSolver {
            force,
            frf,
            damping_n_per_m2,
            samples: grid.into_iter().map(|f| (f, frf.receptance(f))).collect(),
        }
    }

    /// Eigenvalues of [(1 − e^{−iωT}) D − iω c] Φ; b is one over one that is real and positive.
    fn eigenvalues(&self, frequency_hz: f64, h: &Receptance, rpm: f64) -> [Complex64; 2] {
        let omega = TAU * frequency_hz;
        let period_s = 60.0 / (self.force.teeth as f64 * rpm);
        let back = Complex64::ONE - Complex64::new(0.0, -omega * period_s).exp();
        let per_speed = omega / (TAU * rpm / 60.0);
        let d = &self.force.matrix_n_per_m2;
        let force = |i: usize, j: usize| {
            let damping = if i == j {
                self.damping_n_per_m2[i] * per_speed
            } else {
                0.0
            };
            back * d[i][j] - Complex64::new(0.0, damping)
        };
        let m = |i: usize, j: usize| force(i, 0) * h[0][j] + force(i, 1) * h[1][j];
        let (mean, half) = (0.5 * (m(0, 0) + m(1, 1)), 0.5 * (m(0, 0) - m(1, 1)));
        let root = (half * half + m(0, 1) * m(1, 0)).sqrt();
        [mean + root, mean - root]
    }

    /// A real eigenvalue between two frequencies where its imaginary part changes sign, by bisection and secant.
    fn crossing(&self, rpm: f64, ends: [f64; 2], values: [Complex64; 2]) -> Option<(f64, f64)> {
        let [mut a, mut b] = ends;
        let [mut at_a, mut at_b] = values;
        for step in 0..60 {
            if (b - a) <= 1e-12 * b {
                break;
            }
            let secant = a + (b - a) * at_a.im / (at_a.im - at_b.im);
            let inside = secant > a && secant < b && step % 4 != 3;
            let f = if inside { secant } else { 0.5 * (a + b) };
            let expected = at_a + (at_b - at_a) * ((f - a) / (b - a));
            let [p, q] = self.eigenvalues(f, &self.frf.receptance(f), rpm);
            let value = if (p - expected).norm() <= (q - expected).norm() {
                p
            } else {
                q
            };
            if value.im.abs() <= 1e-12 * value.norm() {
                return Some((f, value.re));
            }
            if (value.im > 0.0) == (at_a.im > 0.0) {
                (a, at_a) = (f, value);
            } else {
                (b, at_b) = (f, value);
            }
        }
        // A jump from one branch to the other is no root.
        let middle = 0.5 * (at_a + at_b);
        ((at_a - at_b).norm() <= 1e-6 * middle.norm()).then_some((0.5 * (a + b), middle.re))
    }
}

impl SpeedLimit for DampedSolver<'_> {
    fn limit_at(&self, spindle_rpm: f64) -> Option<Limit> {
        if !(spindle_rpm.is_finite() && spindle_rpm > 0.0) {
            return None;
        }
        let mut best: Option<(f64, f64)> = None;
        let mut before: Option<(f64, [Complex64; 2])> = None;
        for (frequency_hz, h) in &self.samples {
            let mut here = self.eigenvalues(*frequency_hz, h, spindle_rpm);
            if let Some((from_hz, last)) = before {
                let kept = (here[0] - last[0]).norm() + (here[1] - last[1]).norm();
                let crossed = (here[1] - last[0]).norm() + (here[0] - last[1]).norm();
                if crossed < kept {
                    here.swap(0, 1);
                }
                for i in 0..2 {
                    let changes = (here[i].im > 0.0) != (last[i].im > 0.0);
                    let could = here[i].re.max(last[i].re) > best.map_or(0.0, |(_, re)| 0.5 * re);
                    if changes
                        && could
                        && let Some((f, re)) =
                            self.crossing(spindle_rpm, [from_hz, *frequency_hz], [last[i], here[i]])
                        && re > best.map_or(0.0, |(_, re)| re)
                    {
                        best = Some((f, re));
                    }
                }
            }
            before = Some((*frequency_hz, here));
        }
        best.map(|(chatter_hz, re)| Limit {
            depth_mm: 1e3 / re,
            chatter_hz,
            lobe: (chatter_hz * 60.0 / (self.force.teeth as f64 * spindle_rpm)) as u32,
        })
    }

    fn speeds_per_task(&self) -> usize {
        4
    }
}

/// Damping ratio that flank damping adds to one mode of stiffness k (N/m) and natural frequency (Hz) at a speed and width:
/// c b/(2√(km)), for people.
pub fn added_damping_ratio(
    damping_n_per_m2: f64,
    width_m: f64,
    spindle_rpm: f64,
    stiffness_n_per_m: f64,
    natural_hz: f64,
) -> f64 {
    let c = damping_n_per_m2 * width_m / (TAU * spindle_rpm / 60.0);
    c * PI * natural_hz / stiffness_n_per_m
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;
    use crate::lobes::{AxisMode, ModalFrf, StabilitySolver};

    fn mode(axis: usize, frequency_hz: f64, damping_ratio: f64, stiffness_n_per_m: f64) -> AxisMode {
        AxisMode {
            axis,
            frequency_hz,
            damping_ratio,
            stiffness_n_per_m,
        }
    }

    /// Without damping the limit is that of the solver that follows the lobes.
    #[test]
    fn no_damping_is_the_lobe_solver() {
        let modes = [
            mode(0, 12.3, 0.03, 5e5),
            mode(1, 14.0, 0.025, 4e5),
            mode(0, 33.0, 0.02, 2e6),
        ];
        let frf = ModalFrf::from_axis_modes(&modes).unwrap();
        let force = RegenerativeForce::drilling_lateral(1014.2, 619.9, 1.178, 2).unwrap();
        let plain = StabilitySolver::new(force, &frf);
        let damped = DampedSolver::new(force, &frf, [0.0, 0.0], 100.0);
        for n in [100.0, 137.0, 250.0, 361.0, 420.0, 777.0, 900.0] {
            let (a, b) = (plain.limit_at(n).unwrap(), damped.limit_at(n).unwrap());
            assert_relative_eq!(a.depth_mm, b.depth_mm, max_relative = 1e-6);
            assert_relative_eq!(a.chatter_hz, b.chatter_hz, max_relative = 1e-6);
        }
    }

    /// One mode along the tool: with the flank's damper taken into the mode the least limit of a lobe is 2kζ'(1 + ζ')/(N Kac) at
    /// f√(1 + 2ζ'), and the speed follows from the phase. The solver finds that width at that speed; slower it is more, and
    /// far faster it is the undamped one.
    #[test]
    fn one_axial_mode_has_its_closed_form() {
        let (f, zeta, k, kac) = (45.0, 0.02, 1.2e6, 700e6);
        let frf = ModalFrf::from_axis_modes(&[mode(0, f, zeta, k)]).unwrap();
        let force = RegenerativeForce::drilling_axial_torsional(1500.0, 700.0, 0.0, 0.0, 2).unwrap();
        let zeta_with: f64 = 0.035;
        let b = 2.0 * k * zeta_with * (1.0 + zeta_with) / (2.0 * kac);
        let omega = TAU * f * (1.0 + 2.0 * zeta_with).sqrt();
        // λ = −N Kac H with Re H = −1/(4kζ(1+ζ)): 1 − e^{−iωT} = 1/(bλ).
        let r = omega / (TAU * f);
        let h = Complex64::new(1.0 - r * r, 2.0 * zeta_with * r).inv() / k;
        let lambda = -2.0 * kac * h;
        let epsilon = 2.0 * lambda.re.atan2(-lambda.im);
        for lobe in [3.0, 8.0] {
            let n = 60.0 / (2.0 * (TAU * lobe + epsilon) / omega);
            let c = (zeta_with - zeta) * k / (std::f64::consts::PI * f) / b;
            let damping = c * TAU * n / 60.0;
            let solver = DampedSolver::new(force, &frf, [damping, 0.0], 50.0);
            let found = solver.limit_at(n).unwrap();
            assert_relative_eq!(1e-3 * found.depth_mm, b, max_relative = 1e-6);
            assert_relative_eq!(TAU * found.chatter_hz, omega, max_relative = 1e-5);
            assert_relative_eq!(
                added_damping_ratio(damping, b, n, k, f),
                zeta_with - zeta,
                max_relative = 1e-9
            );
            let plain = StabilitySolver::new(force, &frf);
            let gain = |n: f64| solver.limit_at(n).unwrap().depth_mm / plain.limit_at(n).unwrap().depth_mm;
            assert!(gain(n) > 1.5 && gain(0.5 * n) > 1.5);
            // The lobe k = 0, many times as fast: a small part of that damping is left.
            let fastest = 60.0 / (2.0 * epsilon / omega);
            assert!(
                fastest > 4.0 * n && (1.0..1.25).contains(&gain(fastest)),
                "{}",
                gain(fastest)
            );
        }
    }

    /// The sums over a lip against the integral of C/(Ω r) over its length, element by element.
    #[test]
    fn the_damping_is_the_integral_over_the_lip() {
        let (kappa, lips, c) = (1.1f64, 2, 4e4);
        let found = FlankDamping::new(c, [1.25, 4.75], kappa, lips, 100.0);
        let (mut axial, mut lateral) = (0.0, 0.0);
        let steps = 20_000;
        for i in 0..steps {
            let r = 1e-3 * (1.25 + 3.5 * (f64::from(i) + 0.5) / f64::from(steps));
            let length = 3.5e-3 / f64::from(steps) / kappa.sin();
            axial += 2.0 * c / r * length * kappa.sin().powi(2);
            lateral += 2.0 * c / r * length * kappa.cos().powi(2) * 0.5;
        }
        assert_relative_eq!(found.axial_n_per_m2, axial / 3.5e-3, max_relative = 1e-6);
        assert_relative_eq!(found.lateral_n_per_m2, lateral / 3.5e-3, max_relative = 1e-6);
    }
}
