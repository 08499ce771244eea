//! Where the teeth of an end mill stand that are not all alike: variable pitch and helix, a radius of each tooth's own.

use std::f64::consts::TAU;

use crate::data::Tool;

/// A tooth in the order in which [`super::MillingCut`] counts: each is ahead of the one before and cuts before it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToothPlace {
    /// Angle at the tip by which it is ahead of tooth 0, rad; 0 to 2π.
    pub ahead_rad: f64,
    /// Angle by which the top of the engaged depth lags behind the tip, rad.
    pub lag_rad: f64,
    /// How far it stands beyond the tool's radius, mm.
    pub radius_mm: f64,
}

/// Which derivatives of the forces of teeth that differ are wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TeethSlopes {
    /// None at all.
    None,
    /// By the offset of the tool's axis and its direction.
    OfRunout,
    /// Those, and by radius and angle of each tooth.
    All,
}

impl ToothPlace {
    /// The teeth of a tool over a depth; empty where they are alike.
    pub(super) fn all(tool: &Tool, axial_depth_mm: f64) -> Vec<ToothPlace> {
        let lag = |helix_deg: f64| 2.0 * axial_depth_mm * helix_deg.to_radians().tan() / tool.diameter_mm;
        let whole: f64 = tool.each_tooth.iter().map(|t| t.pitch_deg).sum();
        let mut behind_deg = 0.0;
        let mut places: Vec<ToothPlace> = tool
            .each_tooth
            .iter()
            .map(|tooth| {
                let place = ToothPlace {
                    ahead_rad: (whole - behind_deg) / whole * TAU % TAU,
                    lag_rad: lag(tooth.helix_deg),
                    radius_mm: tooth.radius_offset_mm,
                };
                behind_deg += tooth.pitch_deg;
                place
            })
            .collect();
        // The tool gives them as they cut, one behind the other.
        if let Some((_, behind)) = places.split_first_mut() {
            behind.reverse();
        }
        places
    }

    /// The same teeth where they follow one another the other way round.
    pub(crate) fn reversed(places: &[ToothPlace]) -> Vec<ToothPlace> {
        let mut places: Vec<ToothPlace> = places
            .iter()
            .map(|place| ToothPlace {
                ahead_rad: (TAU - place.ahead_rad) % TAU,
                ..*place
            })
            .collect();
        if let Some((_, others)) = places.split_first_mut() {
            others.reverse();
        }
        places
    }
}

#[cfg(test)]
mod tests {
    use num_complex::Complex64;

    use super::*;
    use crate::cutting::made_tools::endmill;
    use crate::cutting::waveform::{ChipLaw, MillingCut, UnitForces};
    use crate::cutting::{ForceAxis, average_row};
    use crate::data::{CutGeometry, Immersion, Tooth};

    const FEED_MM: f64 = 0.1;
    const DEPTH_MM: f64 = 3.0;

    fn tool(teeth: &[(f64, f64, f64)]) -> Tool {
        let each_tooth: Vec<Tooth> = teeth
            .iter()
            .map(|&(pitch_deg, helix_deg, radius_offset_mm)| Tooth {
                pitch_deg,
                helix_deg,
                radius_offset_mm,
            })
            .collect();
        Tool {
            teeth: teeth.len(),
            helix_deg: teeth[0].1,
            each_tooth,
            ..endmill(0.0, 90.0)
        }
    }

    fn geometry(start_deg: f64, exit_deg: f64) -> CutGeometry {
        CutGeometry::Milling {
            feed_per_tooth_mm: FEED_MM,
            axial_depth_mm: DEPTH_MM,
            immersion: Immersion {
                start_rad: start_deg.to_radians(),
                exit_rad: exit_deg.to_radians(),
            },
        }
    }

    fn average(tool: &Tool, geometry: &CutGeometry) -> [Vec<f64>; 3] {
        [ForceAxis::X, ForceAxis::Y, ForceAxis::Z].map(|axis| average_row(tool, geometry, axis).unwrap())
    }

    /// Each tooth passes each direction once a turn; what it cuts there is how far it reaches beyond all that passed before.
    /// Taken from the tool as it is given, pass by pass in the order of time over three turns.
    fn pass_by_pass(tool: &Tool, geometry: &CutGeometry, law: ChipLaw, orders: usize) -> UnitForces {
        let CutGeometry::Milling { immersion, .. } = *geometry else {
            panic!("milling");
        };
        let (angles, slices) = (1800, 60);
        let feed_per_turn = FEED_MM * tool.teeth as f64;
        let [runout, towards] = law.runout.unwrap_or([0.0; 2]);
        let mut behind_deg = 0.0;
        // Behind the first, in turns, at the tip; helix; reach.
        let teeth: Vec<(f64, f64, f64)> = tool
            .each_tooth
            .iter()
            .map(|t| {
                let tooth = (behind_deg / 360.0, t.helix_deg, t.radius_offset_mm);
                behind_deg += t.pitch_deg;
                tooth
            })
            .collect();
        let mut unit: UnitForces =
            std::array::from_fn(|_| std::array::from_fn(|_| vec![Complex64::ZERO; orders + 1]));
        for slice in 0..slices {
            let z_mm = (slice as f64 + 0.5) / slices as f64 * DEPTH_MM;
            for step in 0..angles {
                let span = immersion.exit_rad - immersion.start_rad;
                let phi = immersion.start_rad + (step as f64 + 0.5) / angles as f64 * span;
                let (sin, cos) = phi.sin_cos();
                // When each tooth stands at φ, in turns since the first stood at 0 at the tip; how far it reaches there.
                let mut passes: Vec<(f64, f64)> = Vec::new();
                for turn in 0..3 {
                    for &(behind, helix_deg, radius_mm) in &teeth {
                        let lag = z_mm * helix_deg.to_radians().tan() / (0.5 * tool.diameter_mm) / TAU;
                        let time = phi / TAU + behind + lag + f64::from(turn);
                        // The offset of the axis turns with the tool.
                        let offset = runout * (towards + TAU * time - phi).cos();
                        passes.push((time, feed_per_turn * time * sin + radius_mm + offset));
                    }
                }
                passes.sort_by(|a, b| a.0.total_cmp(&b.0));
                let mut reached = f64::NEG_INFINITY;
                for (time, reach) in passes {
                    let h = reach - reached;
                    reached = reached.max(reach);
                    if h <= 0.0 || !(2.0..3.0).contains(&time) {
                        continue;
                    }
                    let cutting = h * (h / ChipLaw::REFERENCE_MM).powf(-law.exponent.unwrap_or(0.0));
                    let share = DEPTH_MM / slices as f64 * span / angles as f64 / TAU;
                    for (n, turn) in
                        (0..=orders).map(|n| (n, Complex64::from_polar(share, -TAU * n as f64 * time)))
                    {
                        for (first, f) in [(0, cutting), (3, 1.0)] {
                            unit[first][0][n] -= turn * f * cos;
                            unit[first][1][n] += turn * f * sin;
                            unit[first + 1][0][n] -= turn * f * sin;
                            unit[first + 1][1][n] -= turn * f * cos;
                            unit[first + 2][2][n] += turn * f;
                        }
                    }
                }
            }
        }
        unit
    }

    /// Variable pitch, helix and radii, one by one and together, a chipped and a missing tooth, an offset axis besides.
    #[test]
    fn teeth_that_differ_equal_a_count_pass_by_pass() {
        let plain = ChipLaw::default();
        let all = ChipLaw {
            exponent: Some(0.25),
            runout: Some([0.012, 0.8]),
        };
        for (name, teeth, law, (start_deg, exit_deg)) in [
            (
                "pitch",
                vec![
                    (84.0, 30.0, 0.0),
                    (98.0, 30.0, 0.0),
                    (84.0, 30.0, 0.0),
                    (94.0, 30.0, 0.0),
                ],
                plain,
                (0.0, 180.0),
            ),
            (
                "helix",
                vec![
                    (90.0, 35.0, 0.0),
                    (90.0, 38.0, 0.0),
                    (90.0, 35.0, 0.0),
                    (90.0, 38.0, 0.0),
                ],
                plain,
                (90.0, 180.0),
            ),
            (
                "radii",
                vec![(120.0, 30.0, 0.01), (120.0, 30.0, -0.03), (120.0, 30.0, 0.0)],
                plain,
                (0.0, 110.0),
            ),
            (
                "missing",
                vec![(120.0, 30.0, 0.0), (120.0, 30.0, -1.0), (120.0, 30.0, 0.0)],
                plain,
                (0.0, 180.0),
            ),
            (
                "all",
                vec![(100.0, 30.0, 0.0), (110.0, 34.0, -0.02), (150.0, 32.0, 0.015)],
                all,
                (20.0, 160.0),
            ),
        ] {
            let (tool, geometry) = (tool(&teeth), geometry(start_deg, exit_deg));
            let orders = 3 * teeth.len();
            let exact = pass_by_pass(&tool, &geometry, law, orders);
            let cut = MillingCut::new(&tool, &geometry).unwrap();
            let ours = cut.sampled(orders, law, false).unit;
            for k in 0..6 {
                let scale = if k < 3 { FEED_MM * DEPTH_MM } else { DEPTH_MM };
                for axis in 0..3 {
                    for n in 0..=orders {
                        let off = (exact[k][axis][n] - ours[k][axis][n]).norm() / scale;
                        assert!(off < 2e-3, "{name}: k {k} axis {axis} order {n}: {off}");
                    }
                }
            }
            if law == plain {
                let rows = average(&tool, &geometry);
                for (k, axis) in (0..6).flat_map(|k| (0..3).map(move |axis| (k, axis))) {
                    let scale = if k < 3 { FEED_MM * DEPTH_MM } else { DEPTH_MM };
                    let off = (exact[k][axis][0].re - rows[axis][k]).abs() / scale;
                    assert!(off < 2e-3, "{name}: mean, k {k} axis {axis}: {off}");
                }
            }
        }
    }

    /// Over a turn every direction is fed through once, whoever cuts it: pitch, helix and radii leave the averages as they are,
    /// and a tooth that does not cut takes its edge force with it and nothing else.
    #[test]
    fn averages_are_those_of_even_teeth_but_for_edges_that_do_not_cut() {
        let geometry = geometry(0.0, 180.0);
        let even = average(&tool(&[(90.0, 30.0, 0.0); 4]), &geometry);
        let alike = average(
            &Tool {
                each_tooth: Vec::new(),
                ..tool(&[(90.0, 30.0, 0.0); 4])
            },
            &geometry,
        );
        let varied = average(
            &tool(&[
                (80.0, 30.0, 0.0),
                (95.0, 36.0, 0.0),
                (85.0, 31.0, 0.0),
                (100.0, 33.0, 0.0),
            ]),
            &geometry,
        );
        let missing = average(
            &tool(&[
                (90.0, 30.0, 0.0),
                (90.0, 30.0, -1.0),
                (90.0, 30.0, 0.0),
                (90.0, 30.0, 0.0),
            ]),
            &geometry,
        );
        for axis in 0..3 {
            for k in 0..6 {
                let scale = if k < 3 { FEED_MM * DEPTH_MM } else { DEPTH_MM };
                let (want, edges) = (alike[axis][k], if k < 3 { 1.0 } else { 0.75 });
                assert!((even[axis][k] - want).abs() < 1e-12 * scale);
                assert!(
                    (varied[axis][k] - want).abs() < 1e-9 * scale,
                    "k {k}: {} {want}",
                    varied[axis][k]
                );
                assert!(
                    (missing[axis][k] - edges * want).abs() < 1e-3 * scale,
                    "k {k}: {} {want}",
                    missing[axis][k]
                );
            }
        }
    }
}
