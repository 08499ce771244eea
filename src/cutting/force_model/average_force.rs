//! Average cutting forces, linear in the coefficients: milling (docs/physics.md, "Cutting forces"; Altintas,
//! Manufacturing Automation, 2nd ed., eqs 2.41–2.45, in axes with φ clockwise from +y), two-lip drilling (same section), and
//! turning (see [`crate::cutting::force_model::turning`]).

use std::f64::consts::PI;

use crate::cutting::force_model::coefficients::MILLING_COEFFICIENTS;
use crate::cutting::force_model::drill_geometry::DrillGeometry;
use crate::cutting::force_model::force_axis::ForceAxis;
use crate::cutting::force_model::turning::{edge_row, engaged_edge};
use crate::cutting::waveform::MillingCut;
use crate::data::{CutGeometry, Immersion, Tool};
use crate::{Error, Result};

/// Row of the linear model: average force (N; torque N·m) on `axis` = row · coefficients, coefficients in
/// N/mm² and N/mm as [`coefficients_of`](crate::cutting::coefficients_of) lists them.
///
/// # Errors
/// Drilling with a tool whose point is not given, or a geometry that cuts nothing.
pub fn average_row(tool: &Tool, geometry: &CutGeometry, axis: ForceAxis) -> Result<Vec<f64>> {
    let row = match *geometry {
        CutGeometry::Milling {
            feed_per_tooth_mm,
            axial_depth_mm,
            immersion,
        } if tool.has_straight_edge() && tool.each_tooth.is_empty() => {
            milling_row(tool.teeth, feed_per_tooth_mm, axial_depth_mm, immersion, axis).to_vec()
        }
        CutGeometry::Milling { .. } => shaped_row(tool, geometry, axis),
        CutGeometry::Drilling { .. } => DrillGeometry::new(tool, geometry)?.row(axis).to_vec(),
        CutGeometry::Turning { .. } => edge_row(&engaged_edge(tool, geometry)?, axis).to_vec(),
    };
    if row.iter().all(|v| v.is_finite()) {
        Ok(row)
    } else {
        Err(Error::computation(
            "the geometry of the cut gives no finite force",
        ))
    }
}

/// docs/physics.md, "Cutting forces", each bracket from entry to exit angle. Units mm, N; no torque.
fn milling_row(teeth: usize, feed_mm: f64, depth_mm: f64, immersion: Immersion, axis: ForceAxis) -> [f64; 6] {
    let (start, exit) = (immersion.start_rad, immersion.exit_rad);
    let over = |f: fn(f64) -> f64| f(exit) - f(start);
    let cos2 = over(|p| (2.0 * p).cos());
    let two_minus_sin2 = over(|p| 2.0 * p - (2.0 * p).sin());
    let (sin, cos, angle) = (over(f64::sin), over(f64::cos), over(|p| p));
    let n_a = teeth as f64 * depth_mm;
    let cut = n_a * feed_mm / (8.0 * PI);
    let edge = n_a / (2.0 * PI);
    match axis {
        ForceAxis::X => [
            cut * cos2,
            -cut * two_minus_sin2,
            0.0,
            -edge * sin,
            edge * cos,
            0.0,
        ],
        ForceAxis::Y => [
            cut * two_minus_sin2,
            cut * cos2,
            0.0,
            -edge * cos,
            -edge * sin,
            0.0,
        ],
        ForceAxis::Z => [0.0, 0.0, -edge * feed_mm * cos, 0.0, 0.0, edge * angle],
        ForceAxis::Mz => [0.0; 6],
    }
}

/// As [`milling_row`], of an edge that is not straight or teeth that differ: the waveform's mean.
fn shaped_row(tool: &Tool, geometry: &CutGeometry, axis: ForceAxis) -> Vec<f64> {
    let Some(cut) = MillingCut::new(tool, geometry).filter(|_| axis != ForceAxis::Mz) else {
        return vec![0.0; MILLING_COEFFICIENTS.len()];
    };
    let unit = cut.linear(0);
    unit.iter().map(|forces| forces[axis.index()][0].re).collect()
}

/// The diameter at which edge and work pass each other: the tool's, in turning the workpiece's; mm.
pub fn cut_diameter_mm(tool: &Tool, geometry: &CutGeometry) -> f64 {
    match *geometry {
        CutGeometry::Turning { diameter_mm, .. } => diameter_mm,
        _ => tool.diameter_mm,
    }
}

/// Speed at a diameter, m/min.
pub fn cutting_speed_m_per_min(diameter_mm: f64, spindle_rpm: f64) -> f64 {
    PI * diameter_mm * spindle_rpm / 1000.0
}

/// Feed that sets a cut apart from another: per tooth (milling) or per revolution (drilling, turning), mm.
pub fn feed_mm(geometry: &CutGeometry) -> f64 {
    match *geometry {
        CutGeometry::Milling {
            feed_per_tooth_mm, ..
        } => feed_per_tooth_mm,
        CutGeometry::Drilling { feed_per_rev_mm, .. } | CutGeometry::Turning { feed_per_rev_mm, .. } => {
            feed_per_rev_mm
        }
    }
}

/// Depth that a cut is known by: axial depth (milling), hole depth (drilling), depth of cut (turning), mm.
pub fn depth_mm(geometry: &CutGeometry) -> Option<f64> {
    match *geometry {
        CutGeometry::Milling { axial_depth_mm, .. } => Some(axial_depth_mm),
        CutGeometry::Drilling { hole_depth_mm, .. } => hole_depth_mm,
        CutGeometry::Turning { depth_of_cut_mm, .. } => Some(depth_of_cut_mm),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Sums the slice forces of docs/physics.md over one revolution and the helix, teeth and all.
    fn integrated(k: [f64; 6], teeth: usize, c: f64, a: f64, immersion: Immersion) -> [f64; 3] {
        let (turn_steps, slices) = (40_000, 7);
        let lag = 0.4; // rad of helix lag over the depth; must not matter to the average
        let mut sum = [0.0; 3];
        for i in 0..turn_steps {
            let turn = (i as f64 + 0.5) / turn_steps as f64 * 2.0 * PI;
            for tooth in 0..teeth {
                for slice in 0..slices {
                    let z = (slice as f64 + 0.5) / slices as f64;
                    let phi = (turn + 2.0 * PI * tooth as f64 / teeth as f64 - lag * z).rem_euclid(2.0 * PI);
                    if !(immersion.start_rad..immersion.exit_rad).contains(&phi) {
                        continue;
                    }
                    let (h, dz) = (c * phi.sin(), a / slices as f64);
                    let ft = (k[0] * h + k[3]) * dz;
                    let fr = (k[1] * h + k[4]) * dz;
                    let fa = (k[2] * h + k[5]) * dz;
                    sum[0] += -ft * phi.cos() - fr * phi.sin();
                    sum[1] += ft * phi.sin() - fr * phi.cos();
                    sum[2] += fa;
                }
            }
        }
        sum.map(|v| v / turn_steps as f64)
    }

    #[test]
    fn milling_averages_equal_the_integrated_slices_at_any_immersion() {
        let k = [930.0, 374.0, 219.0, 17.3, 16.5, -1.4];
        for (start_deg, exit_deg) in [
            (0.0, 90.0),
            (90.0, 180.0),
            (0.0, 180.0),
            (20.0, 75.0),
            (110.0, 171.0),
        ] {
            let immersion = Immersion {
                start_rad: f64::to_radians(start_deg),
                exit_rad: f64::to_radians(exit_deg),
            };
            let sum = integrated(k, 3, 0.12, 2.5, immersion);
            for (axis, expected) in ForceAxis::ALL.iter().zip(sum) {
                let row = milling_row(3, 0.12, 2.5, immersion, *axis);
                let force: f64 = row.iter().zip(k).map(|(r, k)| r * k).sum();
                assert!(
                    (force - expected).abs() < 2e-3 * 100.0,
                    "{start_deg}..{exit_deg} {axis:?}: {force} {expected}"
                );
            }
        }
    }

    #[test]
    fn a_slot_gives_the_textbook_averages() {
        let (n, a, c) = (4.0, 2.0, 0.1);
        let row = |axis| milling_row(4, c, a, Immersion::SLOT, axis);
        let close = |got: [f64; 6], want: [f64; 6]| {
            for (g, w) in got.iter().zip(want) {
                assert_relative_eq!(*g, w, epsilon = 1e-12);
            }
        };
        close(
            row(ForceAxis::X),
            [0.0, -n * a / 4.0 * c, 0.0, 0.0, -n * a / PI, 0.0],
        );
        close(
            row(ForceAxis::Y),
            [n * a / 4.0 * c, 0.0, 0.0, n * a / PI, 0.0, 0.0],
        );
        close(
            row(ForceAxis::Z),
            [0.0, 0.0, n * a / PI * c, 0.0, 0.0, n * a / 2.0],
        );
    }
}
