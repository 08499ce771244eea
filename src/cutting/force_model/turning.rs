//! The edge of a turning tool in the work: where it stands, what chip each bit of it takes, and the force on the tool.
//!
//! Tool axes of turning: x against the feed, y away from the work (out of it, along the passive force), z along the cutting
//! speed. Feed force, passive force and cutting force of ISO 3002-4 are positive then in an ordinary cut.
//!
//! The straight part of the edge stands at κr from the direction of the feed, the nose of radius rε goes round from there to
//! κ = 0 where it touches the finished surface, and a bit beyond on its trailing side. Over one turn a bit of edge ds at the
//! angle κ sweeps f sin κ ds of chip; at the very tip, below the height at which the trailing side of the last turn has
//! already cut, it is 2 rε sin κ instead of f, so that the areas add up to that of the chip: depth of cut times feed less
//! the ridge that is left standing. The tangential force of a bit stands along the cutting speed, the radial one along the
//! normal of the edge out of the work, the axial one along the edge away from the tip (Altintas, Manufacturing Automation,
//! 2nd ed., §2.6 and ch. 2 on turning with a nose radius; the same frame as that of an end mill's corner, see
//! `waveform/edge_shape.rs`):
//!
//! F_x = F_r sin κ − F_a cos κ,  F_y = F_r cos κ + F_a sin κ,  F_z = F_t.

use crate::cutting::force_model::force_axis::ForceAxis;
use crate::cutting::waveform::gauss_legendre;
use crate::data::{CutGeometry, Tool};
use crate::{Error, Result};

/// A bit of the edge in the work.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeBit {
    /// Length along the edge, mm.
    pub length_mm: f64,
    /// Chip thickness: area of the chip over the length; 0 where the edge only rubs.
    pub chip_mm: f64,
    /// Sine of the angle κ between the edge and the direction of the feed.
    pub sin_kappa: f64,
    /// Cosine of κ.
    pub cos_kappa: f64,
}

/// Nodes on each smooth stretch of the nose.
const NODES: usize = 12;

impl EdgeBit {
    fn at(kappa: f64, length_mm: f64, width_mm: f64) -> EdgeBit {
        let (sin_kappa, cos_kappa) = kappa.sin_cos();
        // κr = 90°: nothing left of rounding.
        let cos_kappa = if cos_kappa.abs() < 1e-15 { 0.0 } else { cos_kappa };
        EdgeBit {
            length_mm,
            chip_mm: (width_mm * sin_kappa).max(0.0),
            sin_kappa,
            cos_kappa,
        }
    }

    /// What the radial and the axial force of the bit bring to an axis.
    pub fn directions(&self, axis: ForceAxis) -> [f64; 3] {
        match axis {
            ForceAxis::X => [0.0, self.sin_kappa, -self.cos_kappa],
            ForceAxis::Y => [0.0, self.cos_kappa, self.sin_kappa],
            ForceAxis::Z => [1.0, 0.0, 0.0],
            ForceAxis::Mz => [0.0; 3],
        }
    }
}

/// The edge in the work, bit by bit: integrals over it of what is smooth in κ are exact to rounding.
///
/// # Errors
/// Another process.
pub fn engaged_edge(tool: &Tool, geometry: &CutGeometry) -> Result<Vec<EdgeBit>> {
    let CutGeometry::Turning {
        feed_per_rev_mm: feed,
        depth_of_cut_mm: depth,
        ..
    } = *geometry
    else {
        return Err(Error::computation("not a turned cut"));
    };
    let (radius, kappa_r) = (tool.corner_radius_mm, tool.lead_angle_deg.to_radians());
    let mut edge = Vec::new();
    let nose_height = radius * (1.0 - kappa_r.cos());
    if radius > 0.0 {
        // The last turn's nose left a ridge half a feed away on either side.
        let ridge = (0.5 * feed / radius).min(1.0).asin();
        edge.push(EdgeBit {
            chip_mm: 0.0,
            ..mean_of_arc(-ridge, 0.0, radius)
        });
        let end = if depth < nose_height {
            (1.0 - depth / radius).clamp(-1.0, 1.0).acos()
        } else {
            kappa_r
        };
        for (from, to) in [(0.0, ridge.min(end)), (ridge.min(end), end)] {
            if to > from {
                let nodes = gauss_legendre(from, to, NODES).into_iter();
                edge.extend(nodes.map(|(kappa, width)| {
                    let swept = feed.min(2.0 * radius * kappa.sin());
                    EdgeBit::at(kappa, radius * width, swept)
                }));
            }
        }
    }
    if depth > nose_height {
        edge.push(EdgeBit::at(kappa_r, (depth - nose_height) / kappa_r.sin(), feed));
    }
    Ok(edge)
}

/// An arc as one bit: its length, and the mean direction of its normals (no unit vector).
fn mean_of_arc(from: f64, to: f64, radius: f64) -> EdgeBit {
    let angle = to - from;
    EdgeBit {
        length_mm: radius * angle,
        chip_mm: 0.0,
        sin_kappa: (from.cos() - to.cos()) / angle,
        cos_kappa: (to.sin() - from.sin()) / angle,
    }
}

/// Row of the linear model, Ktc Krc Kac Kte Kre Kae: force on an axis (N) by N/mm² and N/mm.
pub fn edge_row(edge: &[EdgeBit], axis: ForceAxis) -> [f64; 6] {
    let mut row = [0.0; 6];
    for bit in edge {
        for (k, direction) in bit.directions(axis).into_iter().enumerate() {
            row[k] += direction * bit.length_mm * bit.chip_mm;
            row[k + 3] += direction * bit.length_mm;
        }
    }
    row
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::ToolKind;
    use approx::assert_relative_eq;

    fn edge(nose_mm: f64, kappa_deg: f64, feed_mm: f64, depth_mm: f64) -> Vec<EdgeBit> {
        let tool = Tool {
            kind: ToolKind::Turning,
            diameter_mm: 0.0,
            teeth: 1,
            helix_deg: 0.0,
            corner_radius_mm: nose_mm,
            lead_angle_deg: kappa_deg,
            half_point_angle_deg: None,
            web_thickness_mm: None,
            chisel_edge_angle_deg: 125.0,
            each_tooth: Vec::new(),
        };
        let geometry = CutGeometry::Turning {
            feed_per_rev_mm: feed_mm,
            depth_of_cut_mm: depth_mm,
            diameter_mm: 50.0,
        };
        engaged_edge(&tool, &geometry).unwrap()
    }

    #[test]
    fn a_sharp_edge_is_orthogonal_cutting_turned_by_kappa() {
        for kappa_deg in [45.0, 75.0, 90.0, 95.0] {
            let (feed, depth) = (0.2, 2.0);
            let (sin, cos) = f64::to_radians(kappa_deg).sin_cos();
            let edge = edge(0.0, kappa_deg, feed, depth);
            let (area, length) = (feed * depth, depth / sin);
            for (axis, want) in [
                (ForceAxis::X, [0.0, sin, -cos]),
                (ForceAxis::Y, [0.0, cos, sin]),
                (ForceAxis::Z, [1.0, 0.0, 0.0]),
                (ForceAxis::Mz, [0.0; 3]),
            ] {
                let row = edge_row(&edge, axis);
                for k in 0..3 {
                    assert_relative_eq!(row[k], want[k] * area, epsilon = 1e-12);
                    assert_relative_eq!(row[k + 3], want[k] * length, epsilon = 1e-12);
                }
            }
        }
    }

    /// Area of the chip: feed times depth, less what the nose leaves standing between two turns, f²/(8 r) high.
    #[test]
    fn area_length_and_directions_of_a_nosed_edge_have_their_closed_forms() {
        for (nose, kappa_deg, feed, depth) in [
            (0.8, 95.0, 0.25, 2.0),
            (0.8, 75.0, 0.4, 0.3),
            (1.6, 45.0, 0.1, 3.0),
            (0.4, 107.5, 0.3, 1.0),
        ] {
            let edge = edge(nose, kappa_deg, feed, depth);
            let ridge = f64::asin(0.5 * feed / nose);
            let standing =
                feed * nose * (1.0 - ridge.cos()) - nose * nose * (ridge - ridge.sin() * ridge.cos());
            assert!(standing > 0.0 && standing < feed * feed * feed / nose / 20.0);
            let z = edge_row(&edge, ForceAxis::Z);
            assert_relative_eq!(z[0], feed * depth - standing, max_relative = 1e-9);
            let kappa = f64::to_radians(kappa_deg);
            let corner = nose * (1.0 - kappa.cos());
            let (end, straight) = match depth < corner {
                true => ((1.0 - depth / nose).acos(), 0.0),
                false => (kappa, (depth - corner) / kappa.sin()),
            };
            assert_relative_eq!(z[3], nose * (end + ridge) + straight, max_relative = 1e-12);
            // A constant force normal to the edge acts on the chord: its components are the chord's extents.
            let up = depth - nose * (1.0 - ridge.cos());
            let along = nose * (end.sin() + ridge.sin()) + straight * kappa.cos();
            assert_relative_eq!(edge_row(&edge, ForceAxis::X)[4], up, max_relative = 1e-9);
            assert_relative_eq!(edge_row(&edge, ForceAxis::Y)[4], along, max_relative = 1e-9);
        }
    }

    #[test]
    fn a_nose_that_shrinks_becomes_a_sharp_corner() {
        let (sharp, nearly) = (edge(0.0, 80.0, 0.2, 1.0), edge(1e-7, 80.0, 0.2, 1.0));
        for axis in ForceAxis::ALL {
            for (a, b) in edge_row(&sharp, axis).iter().zip(edge_row(&nearly, axis)) {
                assert_relative_eq!(*a, b, epsilon = 1e-6);
            }
        }
    }
}
