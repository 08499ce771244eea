//! Where a drill may whirl and leave a hole that is not round.
//!
//! A drill of N lips whose tip whirls at kN times the spindle frequency Ω lets every lip follow the one before: the wall gets
//! kN − 1 lobes where it whirls with the rotation and kN + 1 against it (seen by the turning drill: (kN ∓ 1) Ω). Cutting and
//! rubbing feed that motion where its frequency lies a little below kNΩ (Bayly, Lamar & Calvert 2002, "Low-frequency
//! regenerative vibration and the formation of lobed holes in drilling", ASME J. Manuf. Sci. Eng. 124; Bayly, Young, Calvert &
//! Halley 2001 on reaming). A lateral mode of the robot at that frequency gives way most, so the speeds to avoid are those
//! just above 60 f/(kN).

use serde::Serialize;

use crate::lobes::curve::SpeedLimit;
use crate::lobes::dynamics::frf::ToolPointFrf;

/// A speed at which a lateral mode lies where a drill whirls.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WhirlSpeed {
    /// Spindle speed with kN times its frequency at the mode: whirling is to be expected here and a little above, rpm.
    pub spindle_rpm: f64,
    /// Of the lateral mode, Hz.
    pub mode_hz: f64,
    /// k in kN.
    pub order: u32,
    /// Lobes of the hole when the tip whirls with the rotation, and against it.
    pub lobes: [u32; 2],
    /// Least limit from there to a tenth above, mm; `None`: nothing limits the cut.
    pub limit_mm: Option<f64>,
    /// The limit is below the width of the hole that is drilled; `None` where that width is not known.
    pub may_occur: Option<bool>,
}

/// Resonances lower than this share of the highest do not count.
const WEAK: f64 = 0.1;
/// Resonances that are looked at, strongest first.
const MODES: usize = 4;
/// Highest k: a hole of 4N + 1 lobes is round for any gauge.
const ORDERS: u32 = 4;
/// Whirling lies this share of the speed above the mode's at most.
const ABOVE: f64 = 0.1;

/// Frequencies at which the tip gives way most across the axis: maxima of |xx| + |yy|, strongest first, Hz.
pub fn lateral_resonances_hz(frf: &dyn ToolPointFrf) -> Vec<f64> {
    let seeds = frf.seed_grid_hz();
    let size = |f: f64| {
        let h = frf.receptance(f);
        h[0][0].norm() + h[1][1].norm()
    };
    // Between two seeds, too.
    let mut grid: Vec<(f64, f64)> = Vec::with_capacity(4 * seeds.len());
    for ends in seeds.windows(2) {
        for i in 0..4 {
            let f = ends[0] + 0.25 * f64::from(i) * (ends[1] - ends[0]);
            grid.push((f, size(f)));
        }
    }
    let mut found: Vec<(f64, f64)> = grid
        .windows(3)
        .filter(|w| w[1].1 > w[0].1 && w[1].1 >= w[2].1)
        .map(|w| w[1])
        .collect();
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    let highest = found.first().map_or(0.0, |f| f.1);
    found.retain(|f| f.1 >= WEAK * highest);
    found.truncate(MODES);
    found.into_iter().map(|f| f.0).collect()
}

/// The speeds between `rpm_range` at which a lateral resonance lies where a drill of so many lips whirls, ascending.
/// `width_mm`: of the hole that is drilled.
pub fn whirl_speeds(
    frf: &dyn ToolPointFrf,
    lateral: &dyn SpeedLimit,
    lips: usize,
    rpm_range: [f64; 2],
    width_mm: Option<f64>,
) -> Vec<WhirlSpeed> {
    let mut found = Vec::new();
    for mode_hz in lateral_resonances_hz(frf) {
        for order in 1..=ORDERS {
            let passes = order * lips as u32;
            let spindle_rpm = 60.0 * mode_hz / f64::from(passes);
            if !(rpm_range[0]..=rpm_range[1]).contains(&spindle_rpm) {
                continue;
            }
            let near = (0..=10).map(|i| spindle_rpm * (1.0 + ABOVE * 0.1 * f64::from(i)));
            let limit_mm = near
                .filter_map(|n| lateral.limit_at(n).map(|l| l.depth_mm))
                .reduce(f64::min);
            found.push(WhirlSpeed {
                spindle_rpm,
                mode_hz,
                order,
                lobes: [passes - 1, passes + 1],
                limit_mm,
                may_occur: width_mm.map(|width| limit_mm.is_some_and(|limit| limit < width)),
            });
        }
    }
    found.sort_by(|a, b| a.spindle_rpm.total_cmp(&b.spindle_rpm));
    found
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::lobes::{AxisMode, ModalFrf, RegenerativeForce, StabilitySolver};

    /// The wall that the lips of a whirling drill leave: tip displacement a e^{±i kN Ωt}, lip j at Ωt + 2πj/N. Every lip must cut
    /// the same wall, with as many lobes as said; at any other whirl frequency the lips disagree.
    #[test]
    fn the_wall_has_as_many_lobes_as_said() {
        let wall = |per_turn: f64, lips: usize, lip: usize, phi: f64| {
            let offset = TAU * lip as f64 / lips as f64;
            // Time in units of 1/Ω when this lip passes the angle; the displacement's part along it.
            let t = phi - offset;
            (per_turn * t - phi).cos()
        };
        let maxima = |per_turn: f64, lips: usize| {
            let count = 3600;
            let r: Vec<f64> = (0..count)
                .map(|i| wall(per_turn, lips, 0, TAU * f64::from(i) / f64::from(count)))
                .collect();
            (0..r.len())
                .filter(|i| {
                    let (before, after) = (r[(i + r.len() - 1) % r.len()], r[(i + 1) % r.len()]);
                    r[*i] > before && r[*i] >= after
                })
                .count()
        };
        for lips in [2, 3] {
            for order in 1..=3 {
                let passes = (order * lips) as f64;
                for (sign, lobes) in [(1.0, order * lips - 1), (-1.0, order * lips + 1)] {
                    assert_eq!(maxima(sign * passes, lips), lobes);
                    for lip in 1..lips {
                        for phi in [0.3, 1.7, 4.0] {
                            let off = wall(sign * passes, lips, lip, phi) - wall(sign * passes, lips, 0, phi);
                            assert!(off.abs() < 1e-9, "{lips} lips, {passes}: {off}");
                        }
                    }
                }
                let other = wall(passes + 0.4, lips, 1, 0.3) - wall(passes + 0.4, lips, 0, 0.3);
                assert!(other.abs() > 0.1);
            }
        }
    }

    /// One mode of 12 Hz and two lips: 360, 180, 120 and 90 rpm; a hole narrower than the limit does not whirl, and speeds outside
    /// the range are not told. A mode ten times as stiff as another does not count.
    #[test]
    fn speeds_of_one_mode() {
        let mode = |axis, frequency_hz, stiffness_n_per_m| AxisMode {
            axis,
            frequency_hz,
            damping_ratio: 0.03,
            stiffness_n_per_m,
        };
        let frf =
            ModalFrf::from_axis_modes(&[mode(0, 12.0, 5e5), mode(1, 12.0, 5e5), mode(0, 40.0, 5e7)]).unwrap();
        let force = RegenerativeForce::drilling_lateral(1014.2, 619.9, 1.178, 2).unwrap();
        let solver = StabilitySolver::new(force, &frf);
        let found = whirl_speeds(&frf, &solver, 2, [100.0, 900.0], Some(3.0));
        let speeds: Vec<f64> = found.iter().map(|w| w.spindle_rpm).collect();
        assert_eq!(speeds.len(), 3, "{speeds:?}");
        for (speed, expected) in speeds.iter().zip([120.0, 180.0, 360.0]) {
            assert!((speed / expected - 1.0).abs() < 0.01, "{speeds:?}");
        }
        assert_eq!((found[2].order, found[2].lobes), (1, [1, 3]));
        assert_eq!((found[1].order, found[1].lobes), (2, [3, 5]));
        let limit = found[2].limit_mm.unwrap();
        assert!(limit < 3.0 && found[2].may_occur == Some(true));
        // Just above the speed the regenerative model itself chatters a little below twice the spindle's frequency.
        let at = solver.limit_at(1.04 * found[2].spindle_rpm).unwrap();
        let per_turn = at.chatter_hz * 60.0 / (1.04 * found[2].spindle_rpm);
        assert!((1.7..2.0).contains(&per_turn), "{per_turn}");
        let narrow = whirl_speeds(&frf, &solver, 2, [100.0, 900.0], Some(0.5 * limit));
        assert_eq!(narrow[2].may_occur, Some(false));
        assert!(whirl_speeds(&frf, &solver, 2, [400.0, 900.0], None).is_empty());
    }
}
