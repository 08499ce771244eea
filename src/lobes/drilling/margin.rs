//! The margins of a drill that is in its hole: the wall holds the tip across the axis.

use std::f64::consts::TAU;

use num_complex::Complex64;

use crate::lobes::dynamics::frf::{Receptance, ToolPointFrf};

/// Stiffness and damping between the margins and the wall of the hole, alike in all directions across the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarginContact {
    /// N/m.
    pub stiffness_n_per_m: f64,
    /// N·s/m.
    pub damping_ns_per_m: f64,
}

/// The lateral FRF of a tip that the wall holds: Φ' = (I + (k + iωc) Φ)⁻¹ Φ.
pub struct MarginFrf {
    free: Box<dyn ToolPointFrf>,
    margin: MarginContact,
}

impl MarginFrf {
    /// On the FRF of the tip in x and y, m/N.
    pub fn new(free: Box<dyn ToolPointFrf>, margin: MarginContact) -> Self {
        MarginFrf { free, margin }
    }
}

/// Ratio of neighbouring frequencies where resonances may stand anywhere: a mode of 0.5 % damping does not slip through.
const STEP: f64 = 0.0075;

/// Ascending seeds over a band that miss no resonance which a contact has moved.
pub(crate) fn moved_resonance_grid(mut seeds_hz: Vec<f64>, (low, high): (f64, f64)) -> Vec<f64> {
    let count = ((high / low).ln() / STEP).ceil() as i32;
    seeds_hz.extend((0..=count).map(|i| (low * (STEP * f64::from(i)).exp()).min(high)));
    seeds_hz.sort_by(f64::total_cmp);
    seeds_hz.dedup_by(|b, a| *b - *a <= 1e-9 * *b);
    seeds_hz
}

impl ToolPointFrf for MarginFrf {
    fn receptance(&self, frequency_hz: f64) -> Receptance {
        let h = self.free.receptance(frequency_hz);
        let k = Complex64::new(
            self.margin.stiffness_n_per_m,
            TAU * frequency_hz * self.margin.damping_ns_per_m,
        );
        let [[a, b], [c, d]] = [[h[0][0] * k + 1.0, h[0][1] * k], [h[1][0] * k, h[1][1] * k + 1.0]];
        let determinant = a * d - b * c;
        let inverse = [
            [d / determinant, -b / determinant],
            [-c / determinant, a / determinant],
        ];
        [0, 1].map(|i| [0, 1].map(|j| inverse[i][0] * h[0][j] + inverse[i][1] * h[1][j]))
    }

    fn band_hz(&self) -> (f64, f64) {
        self.free.band_hz()
    }

    fn seed_grid_hz(&self) -> Vec<f64> {
        moved_resonance_grid(self.free.seed_grid_hz(), self.free.band_hz())
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;
    use crate::lobes::{AxisMode, ModalFrf, RegenerativeForce, SpeedLimit, StabilitySolver};

    fn frf(frequency_hz: f64, damping_ratio: f64, stiffness_n_per_m: f64) -> ModalFrf {
        let mode = |axis| AxisMode {
            axis,
            frequency_hz,
            damping_ratio,
            stiffness_n_per_m,
        };
        ModalFrf::from_axis_modes(&[mode(0), mode(1)]).unwrap()
    }

    /// One mode in each direction: spring and damper of the wall simply add to the mode's, and the lobes are those of that mode.
    /// A wall of no stiffness changes nothing, a rigid one lets nothing chatter below any depth of interest.
    #[test]
    fn the_wall_adds_to_a_mode() {
        let (f, zeta, k) = (12.0, 0.03, 5e5);
        let (wall, damper) = (3.5e5, 400.0);
        let factor: f64 = (k + wall) / k;
        let omega = TAU * f;
        let c = 2.0 * zeta * k / omega + damper;
        let stiffer = frf(
            f * factor.sqrt(),
            c * omega * factor.sqrt() / (2.0 * (k + wall)),
            k + wall,
        );
        let held = |stiffness_n_per_m, damping_ns_per_m| {
            MarginFrf::new(
                Box::new(frf(f, zeta, k)),
                MarginContact {
                    stiffness_n_per_m,
                    damping_ns_per_m,
                },
            )
        };
        let force = RegenerativeForce::drilling_lateral(1014.2, 619.9, 1.178, 2).unwrap();
        let limit =
            |frf: &dyn ToolPointFrf, n: f64| StabilitySolver::new(force, frf).limit_at(n).unwrap().depth_mm;
        for n in [120.0, 300.0, 480.0, 800.0] {
            assert_relative_eq!(
                limit(&held(wall, damper), n),
                limit(&stiffer, n),
                max_relative = 1e-6
            );
            assert_relative_eq!(
                limit(&held(0.0, 0.0), n),
                limit(&frf(f, zeta, k), n),
                max_relative = 1e-6
            );
        }
        let rigid = held(1e13, 0.0).receptance(12.0)[0][0].norm();
        assert!(rigid < 1e-6 * frf(f, zeta, k).receptance(12.0)[0][0].norm());
    }

    /// The cross receptances take part: against the 2×2 system solved by hand at one frequency.
    #[test]
    fn cross_receptances_take_part() {
        let mode = crate::lobes::Mode {
            omega_n_rad_per_s: 80.0,
            damping_ratio: 0.03,
            shape: [0.08, 0.05],
        };
        let residual = [[1e-7, 2e-8], [2e-8, 3e-7]];
        let free = ModalFrf::from_mode_shapes(vec![mode], residual).unwrap();
        let h = free.receptance(11.0);
        let margin = MarginContact {
            stiffness_n_per_m: 2e6,
            damping_ns_per_m: 0.0,
        };
        let held = MarginFrf::new(Box::new(free), margin).receptance(11.0);
        // Displacement by a force along x: u = H (e_x − k u).
        for (i, row) in h.iter().enumerate() {
            let back = row[0] - (row[0] * held[0][0] + row[1] * held[1][0]) * 2e6;
            assert!((held[i][0] - back).norm() < 1e-12 * held[i][0].norm(), "{i}");
        }
    }
}
