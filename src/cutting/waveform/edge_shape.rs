//! Edges of milling tools that do not run straight up the side: ball end, bull nose (corner radius), inserts with a lead
//! angle, tapered tools.
//!
//! Along the edge its outward normal stands at κ from the tool's axis: 90° on a straight end mill, 0 at the tip of a ball.
//! A slice dz of the axial depth is dz / sin κ of edge; the chip there is c sin φ sin κ thick; the tangential force stands
//! across, the radial one along the normal and the axial one along the edge's outline (Engin and Altintas, Mechanics and
//! dynamics of general milling cutters, part I, Int. J. Mach. Tools Manuf. 41 (2001) 2195, eqs 4–9; the axial force is
//! counted away from the tip, as on a straight end mill):
//!
//! F_x = −F_t cos φ − (F_r sin κ − F_a cos κ) sin φ,  F_y = F_t sin φ − (F_r sin κ − F_a cos κ) cos φ,
//! F_z = F_r cos κ + F_a sin κ.

use std::f64::consts::{FRAC_PI_2, PI};

use super::quadrature::gauss_legendre;
use crate::data::{Immersion, Tool};

/// The outline of an edge: a corner that begins at κ = 0, then a straight edge at the lead angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeShape {
    radius_mm: f64,
    corner_radius_mm: f64,
    /// κ of the straight part.
    lead_rad: f64,
}

/// Nodes on each part that is smooth, up to the turn's second orders; …
const NODES: usize = 32;
/// … and for each order where the angles of a narrow cut move along the part, by up to a quarter of a turn: two for a period.
const NODES_PER_ORDER: f64 = 0.5;

/// A slice of the edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct EdgeSlice {
    /// Above the tip, mm.
    pub height_mm: f64,
    /// Axial depth of the slice, mm.
    pub depth_mm: f64,
    pub sin_kappa: f64,
    pub cos_kappa: f64,
    /// Where it cuts; `None` where the slice misses the workpiece.
    pub immersion: Option<Immersion>,
}

impl EdgeSlice {
    /// Length of edge, mm.
    pub fn length_mm(&self) -> f64 {
        self.depth_mm / self.sin_kappa
    }
}

impl EdgeShape {
    /// `None` for an edge that runs straight up the side of the tool.
    pub fn of(tool: &Tool) -> Option<EdgeShape> {
        (!tool.has_straight_edge()).then_some(EdgeShape {
            radius_mm: 0.5 * tool.diameter_mm,
            corner_radius_mm: tool.corner_radius_mm,
            lead_rad: tool.lead_angle_deg.to_radians(),
        })
    }

    /// The edge up to an axial depth, cut into slices by Gauss–Legendre quadrature, for integrands of up to `orders` of the tool's
    /// rotation. `immersion`: at the tool's diameter.
    pub(super) fn slices(&self, depth_mm: f64, immersion: Immersion, orders: usize) -> Vec<EdgeSlice> {
        let r = self.corner_radius_mm;
        let corner_mm = (r * (1.0 - self.lead_rad.cos())).min(depth_mm);
        let reaches = self.reaches_mm(immersion);
        let nodes = match reaches.as_slice() {
            [] => NODES,
            _ => NODES + (NODES_PER_ORDER * orders as f64).ceil() as usize,
        };
        let mut slices = Vec::new();
        if corner_mm > 0.0 {
            let end = (1.0 - corner_mm / r).clamp(-1.0, 1.0).acos();
            let sines = reaches.iter().map(|reach| (reach - (self.radius_mm - r)) / r);
            for (kappa, width) in between(0.0, end, sines.map(f64::asin), nodes) {
                let (sin, cos) = kappa.sin_cos();
                slices.push(self.slice(r * (1.0 - cos), r * sin * width, (sin, cos), immersion));
            }
        }
        if depth_mm > corner_mm {
            let (sin, cos) = match self.lead_rad {
                FRAC_PI_2 => (1.0, 0.0),
                lead => lead.sin_cos(),
            };
            let touches = self.radius_at(corner_mm);
            let heights = reaches
                .iter()
                .map(|reach| corner_mm + (reach - touches) * self.lead_rad.tan());
            for (height, width) in between(corner_mm, depth_mm, heights, nodes) {
                slices.push(self.slice(height, width, (sin, cos), immersion));
            }
        }
        slices
    }

    /// The distances from the axis at which the edge reaches a side of the workpiece that lies within the tool's diameter, mm.
    /// Through the axis itself a side meets the edge at the same angle all the way up.
    fn reaches_mm(&self, immersion: Immersion) -> Vec<f64> {
        const THROUGH_THE_AXIS: f64 = 1e-9;
        let cosines = [immersion.start_rad, immersion.exit_rad].map(|angle| angle.cos().abs());
        let within = cosines
            .into_iter()
            .filter(|cos| *cos > THROUGH_THE_AXIS && *cos < 1.0);
        within.map(|cos| self.radius_mm * cos).collect()
    }

    fn slice(
        &self,
        height_mm: f64,
        depth_mm: f64,
        (sin_kappa, cos_kappa): (f64, f64),
        immersion: Immersion,
    ) -> EdgeSlice {
        EdgeSlice {
            height_mm,
            depth_mm,
            sin_kappa,
            cos_kappa,
            immersion: self.immersion_at(height_mm, immersion),
        }
    }

    /// Distance of the edge from the tool's axis, mm.
    fn radius_at(&self, height_mm: f64) -> f64 {
        let r = self.corner_radius_mm;
        let corner_mm = r * (1.0 - self.lead_rad.cos());
        let on_corner = height_mm.min(corner_mm);
        let inner = self.radius_mm - r + (on_corner * (2.0 * r - on_corner)).max(0.0).sqrt();
        inner + (height_mm - on_corner) * self.lead_rad.tan().recip().max(0.0)
    }

    /// The workpiece lies between two planes along the feed; the narrower the tool, the more of its way round lies between
    /// them. Beyond 180° nothing is cut.
    fn immersion_at(&self, height_mm: f64, at_diameter: Immersion) -> Option<Immersion> {
        let radius = self.radius_at(height_mm);
        let here = |angle: f64| -> f64 {
            if angle <= 0.0 || angle >= PI {
                return angle.clamp(0.0, PI);
            }
            (self.radius_mm * angle.cos() / radius.max(f64::MIN_POSITIVE))
                .clamp(-1.0, 1.0)
                .acos()
        };
        let (start_rad, exit_rad) = (here(at_diameter.start_rad), here(at_diameter.exit_rad));
        (start_rad < exit_rad).then_some(Immersion { start_rad, exit_rad })
    }
}

/// Gauss–Legendre nodes over `[from, to]`, `count` on each part between those `kinks` that lie within. Beyond a kink the angle at which
/// an edge meets the workpiece grows with the root of the distance: there the nodes are those of a square.
fn between(from: f64, to: f64, kinks: impl Iterator<Item = f64>, count: usize) -> Vec<(f64, f64)> {
    let mut ends: Vec<f64> = kinks.filter(|kink| *kink > from && *kink < to).collect();
    ends.sort_by(f64::total_cmp);
    let first = ends.first().copied().unwrap_or(to);
    let mut nodes = gauss_legendre(from, first, count);
    for (i, kink) in ends.iter().enumerate() {
        let span = ends.get(i + 1).unwrap_or(&to) - kink;
        let squared = gauss_legendre(0.0, 1.0, count).into_iter();
        nodes.extend(squared.map(|(root, width)| (kink + span * root * root, 2.0 * span * root * width)));
    }
    nodes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutting::made_tools::endmill as tool;

    fn sum(slices: &[EdgeSlice], of: impl Fn(&EdgeSlice) -> f64) -> f64 {
        slices.iter().map(of).sum()
    }

    #[test]
    fn a_straight_edge_has_no_shape() {
        assert_eq!(EdgeShape::of(&tool(0.0, 90.0)), None);
        assert!(EdgeShape::of(&tool(0.5, 90.0)).is_some());
        assert!(EdgeShape::of(&tool(0.0, 45.0)).is_some());
    }

    /// Lengths of a circle's arc, of its height and of its reach.
    #[test]
    fn a_ball_and_a_bull_nose_have_the_lengths_of_their_circle() {
        for (corner, depth) in [(6.0, 2.0), (6.0, 6.0), (1.0, 3.0), (1.0, 0.4)] {
            let shape = EdgeShape::of(&tool(corner, 90.0)).unwrap();
            let slices = shape.slices(depth, Immersion::SLOT, 0);
            let arc = f64::acos((1.0 - depth / corner).max(0.0));
            let above = f64::max(depth - corner, 0.0);
            assert!((sum(&slices, |s| s.depth_mm) - depth).abs() < 1e-12);
            assert!((sum(&slices, EdgeSlice::length_mm) - (corner * arc + above)).abs() < 1e-12);
            let reach = sum(&slices, |s| s.length_mm() * s.cos_kappa);
            assert!((reach - corner * arc.sin()).abs() < 1e-12);
            let area = sum(&slices, |s| s.depth_mm * s.sin_kappa);
            let exact = 0.5 * corner * (arc - arc.sin() * arc.cos()) + above;
            assert!((area - exact).abs() < 1e-12, "{corner} {depth}: {area} {exact}");
            assert!(slices.iter().all(|s| s.immersion == Some(Immersion::SLOT)));
        }
    }

    #[test]
    fn a_lead_angle_tilts_all_of_the_edge() {
        let slices = EdgeShape::of(&tool(0.0, 45.0))
            .unwrap()
            .slices(2.0, Immersion::SLOT, 0);
        assert!((sum(&slices, EdgeSlice::length_mm) - 2.0 * 2f64.sqrt()).abs() < 1e-12);
        assert!((sum(&slices, |s| s.depth_mm * s.cos_kappa) - 2f64.sqrt()).abs() < 1e-12);
    }

    /// A ball of 12 mm, 3 mm beside the wall of the workpiece (down milling): where it is narrower than 3 mm it cuts nothing;
    /// at its diameter it enters where cos φ is −3/6.
    #[test]
    fn a_narrow_cut_meets_only_the_wide_part_of_a_ball() {
        let at_diameter = Immersion {
            start_rad: f64::acos(-0.5),
            exit_rad: PI,
        };
        let shape = EdgeShape::of(&tool(6.0, 90.0)).unwrap();
        let height = |radius: f64| 6.0 - f64::sqrt(36.0 - radius * radius);
        assert_eq!(shape.immersion_at(height(2.9), at_diameter), None);
        for radius in [3.5, 5.0, 6.0] {
            let here = shape.immersion_at(height(radius), at_diameter).unwrap();
            assert!((radius * here.start_rad.cos() + 3.0).abs() < 1e-9);
            assert_eq!(here.exit_rad, PI);
        }
        // Half immersion is half at every height.
        let half = Immersion {
            start_rad: FRAC_PI_2,
            exit_rad: PI,
        };
        let here = shape.immersion_at(height(0.5), half).unwrap();
        assert!((here.start_rad - FRAC_PI_2).abs() < 1e-12);
    }

    /// Against the same ball in 40,000 slices of even height. The edge meets the work somewhere on its corner, and the angle where it does
    /// has a vertical tangent there.
    #[test]
    fn a_narrow_cut_on_the_side_of_a_ball_is_integrated_from_where_it_begins() {
        let shape = EdgeShape::of(&tool(6.0, 90.0)).unwrap();
        let cases: [(f64, f64, f64); 4] = [
            (110.0, 180.0, 3.0),
            (110.0, 180.0, 0.7),
            (0.0, 80.0, 3.0),
            (60.0, 140.0, 3.0),
        ];
        for (start, exit, depth) in cases {
            let immersion = Immersion {
                start_rad: start.to_radians(),
                exit_rad: exit.to_radians(),
            };
            for order in [0.0, 30.0] {
                let of = |immersion: Option<Immersion>| {
                    immersion.map_or(0.0, |i| {
                        (order * i.exit_rad).cos() * i.exit_rad - (order * i.start_rad).cos() * i.start_rad
                    })
                };
                let slices = shape.slices(depth, immersion, order as usize);
                let ours = sum(&slices, |s| of(s.immersion) * s.depth_mm);
                let many = 40_000;
                let step = depth / many as f64;
                let heights = (0..many).map(|k| (k as f64 + 0.5) * step);
                let theirs: f64 = heights.map(|z| of(shape.immersion_at(z, immersion)) * step).sum();
                assert!(
                    (ours - theirs).abs() < 2e-5 * depth,
                    "{start} {depth} {order}: {ours} {theirs}"
                );
            }
        }
    }

    /// A corner of 1 mm that goes over into an edge of 60°: they touch where the circle has that slope, half a millimetre up, and the
    /// edge leans outwards from there.
    #[test]
    fn a_corner_goes_over_smoothly_into_a_leaning_edge() {
        let shape = EdgeShape::of(&tool(1.0, 60.0)).unwrap();
        let touches = 5.0 + 60f64.to_radians().sin();
        assert!((shape.radius_at(0.5) - touches).abs() < 1e-12);
        assert!((shape.radius_at(0.1) - (5.0 + 0.19f64.sqrt())).abs() < 1e-12);
        assert!((shape.radius_at(2.0) - (touches + 1.5 / 3f64.sqrt())).abs() < 1e-12);
        let slices = shape.slices(2.0, Immersion::SLOT, 0);
        let length = 60f64.to_radians() + 1.5 / 60f64.to_radians().sin();
        assert!((sum(&slices, EdgeSlice::length_mm) - length).abs() < 1e-9);
    }
}
