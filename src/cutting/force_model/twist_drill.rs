//! A twist drill as edges: how rake, inclination and chip change along its straight lips, and the wedge of its chisel edge.
//!
//! The lips run parallel to a line through the axis, half the web thickness away from it, on a cone of half point angle p.
//! In the view along the axis the lip stands at the web angle ω = asin(w/2r) to the radius (Galloway 1957, "Some experiments
//! on the influence of various factors on drill performance", Trans. ASME 79; Armarego & Cheng 1972, "Drilling with flat rake
//! face and conventional twist drills", Int. J. Mach. Tool Des. Res. 12; Roukema & Altintas 2007, Part I).

use std::f64::consts::TAU;

use crate::cutting::force_model::drill_geometry::chisel_half_length_mm;
use crate::data::Tool;
use crate::{Error, Result};

/// A twist drill with straight lips; lengths in mm, angles in rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwistDrill {
    /// Number of lips N.
    pub lips: f64,
    /// Radius R.
    pub radius_mm: f64,
    /// Web thickness w: the lips lie w/2 off the axis.
    pub web_mm: f64,
    /// Half point angle p.
    pub half_point_rad: f64,
    /// Helix angle at the radius R.
    pub helix_rad: f64,
    /// Half length of the chisel edge: where the lips begin.
    pub chisel_mm: f64,
    /// Chisel edge angle ψ.
    pub chisel_angle_rad: f64,
}

/// A lip at a radius, as an oblique edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LipPlace {
    /// From the drill's axis.
    pub radius_mm: f64,
    /// ω, in the view along the axis from the radius to the lip.
    pub web_angle_rad: f64,
    /// Normal rake α_n.
    pub rake_rad: f64,
    /// Inclination i.
    pub inclination_rad: f64,
    /// Chip thickness over the feed per lip, sin p cos ω / cos i.
    pub chip_share: f64,
}

impl TwistDrill {
    /// # Errors
    /// No point angle or web thickness, or a chisel edge as long as the drill is wide.
    pub fn new(tool: &Tool) -> Result<Self> {
        let needed = |value: Option<f64>, key: &str| {
            value.ok_or_else(|| {
                Error::computation(format!("a drill's forces need [tool] {key}, which is not given"))
            })
        };
        let web_mm = needed(tool.web_thickness_mm, "web_thickness_mm")?;
        let half_point_deg = needed(tool.half_point_angle_deg, "half_point_angle_deg")?;
        let drill = TwistDrill {
            lips: tool.teeth as f64,
            radius_mm: 0.5 * tool.diameter_mm,
            web_mm,
            half_point_rad: half_point_deg.to_radians(),
            helix_rad: tool.helix_deg.to_radians(),
            chisel_mm: chisel_half_length_mm(tool, web_mm),
            chisel_angle_rad: tool.chisel_edge_angle_deg.to_radians(),
        };
        match drill.chisel_mm < drill.radius_mm {
            true => Ok(drill),
            false => Err(Error::computation(format!(
                "the chisel edge of {:.3} mm leaves nothing of the lips",
                2.0 * drill.chisel_mm
            ))),
        }
    }

    /// The lip at a radius between the chisel edge and the corner: sin i = sin ω sin p; the flute rises by tan δ = (r/R) tan δ₀
    /// and gives tan γ = tan δ cos ω/(sin p − tan δ sin ω cos p), of which the turn of the lip takes ζ, tan ζ = tan ω cos p:
    /// α_n = γ − ζ (Armarego & Cheng 1972).
    pub fn lip(&self, radius_mm: f64) -> LipPlace {
        let (sin_p, cos_p) = self.half_point_rad.sin_cos();
        let web_angle_rad = (0.5 * self.web_mm / radius_mm).min(1.0).asin();
        let (sin_w, cos_w) = web_angle_rad.sin_cos();
        let tan_helix = radius_mm / self.radius_mm * self.helix_rad.tan();
        let flute = (tan_helix * cos_w).atan2(sin_p - tan_helix * sin_w * cos_p);
        let turn = (sin_w * cos_p).atan2(cos_w);
        let inclination_rad = (sin_w * sin_p).asin();
        LipPlace {
            radius_mm,
            web_angle_rad,
            rake_rad: flute - turn,
            inclination_rad,
            chip_share: sin_p * cos_w / inclination_rad.cos(),
        }
    }

    /// Half the angle of the wedge that the two flanks make at the chisel edge, from the axis: tan γ_w = tan p sin ψ, the
    /// flanks taken as planes through lip and chisel edge. The chisel's static rake is −γ_w.
    pub fn chisel_wedge_rad(&self) -> f64 {
        (self.half_point_rad.tan() * self.chisel_angle_rad.sin()).atan()
    }

    /// Within this radius the flank behind the chisel edge runs into the work, whose surface sinks by a feed per turn: it is
    /// pressed in there instead of cutting. Feed angle = clearance, f/(2πr) = cot γ_w (Mauch & Lauderbaugh 1990).
    pub fn indentation_radius_mm(&self, feed_per_rev_mm: f64) -> f64 {
        (feed_per_rev_mm * self.chisel_wedge_rad().tan() / TAU).min(self.chisel_mm)
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use nalgebra::Vector3;

    use super::*;
    use crate::cutting::made_tools::drill;

    fn made(helix_deg: f64) -> TwistDrill {
        TwistDrill::new(&Tool { helix_deg, ..drill() }).unwrap()
    }

    /// Rake and inclination from the surfaces themselves: the flute is swept by the lip along the helix, so that its face
    /// holds the lip's direction and the helix's tangent; the drill turns, so that the speed is tangential.
    #[test]
    fn angles_are_those_of_the_faces_in_space() {
        let drill = made(30.0);
        let p = drill.half_point_rad;
        for radius in [drill.chisel_mm, 1.3, 2.6, drill.radius_mm] {
            let lip = drill.lip(radius);
            // x along the lip in the view along the axis, z into the workpiece; the lip lies w/2 off the axis.
            let at = Vector3::new(
                (radius * radius - 0.25 * drill.web_mm.powi(2)).sqrt(),
                0.5 * drill.web_mm,
                0.0,
            );
            let edge = Vector3::new(p.sin(), 0.0, -p.cos());
            let speed = Vector3::z().cross(&at).normalize();
            // The flutes of a right-hand drill run back from the tip against the rotation.
            let rise = radius / drill.radius_mm * drill.helix_rad.tan();
            let helix = (-Vector3::z() - speed * rise).normalize();
            assert_relative_eq!(lip.inclination_rad.sin(), -speed.dot(&edge), epsilon = 1e-12);
            let into_work = {
                let normal = edge.cross(&speed).normalize();
                normal * normal.z.signum()
            };
            assert_relative_eq!(lip.chip_share, into_work.z, epsilon = 1e-12);
            // In the plane normal to the edge: from the normal of the cut surface to the face.
            let across = into_work.cross(&edge).normalize();
            let ahead = across * across.dot(&speed).signum();
            let face_normal = edge.cross(&helix);
            let along_face = edge.cross(&face_normal).normalize();
            let away = along_face * -along_face.dot(&into_work).signum();
            // A positive rake leans back from the speed.
            let rake = (-away.dot(&ahead)).atan2(-away.dot(&into_work));
            assert_relative_eq!(lip.rake_rad, rake, epsilon = 1e-12);
        }
    }

    /// No web: no inclination, the rake of the flute alone. No helix: the turn of the lip alone, negative.
    #[test]
    fn limits_of_web_and_helix() {
        let p = 59f64.to_radians();
        let thin = TwistDrill {
            web_mm: 0.0,
            half_point_rad: p,
            ..made(30.0)
        };
        let lip = thin.lip(0.5 * thin.radius_mm);
        assert_eq!((lip.inclination_rad, lip.web_angle_rad), (0.0, 0.0));
        assert_relative_eq!(
            lip.rake_rad.tan(),
            0.5 * 30f64.to_radians().tan() / p.sin(),
            max_relative = 1e-12
        );
        assert_relative_eq!(lip.chip_share, p.sin(), max_relative = 1e-12);
        let straight = TwistDrill {
            half_point_rad: p,
            ..made(0.0)
        };
        let lip = straight.lip(2.0);
        assert_relative_eq!(
            lip.rake_rad.tan(),
            -lip.web_angle_rad.tan() * p.cos(),
            max_relative = 1e-12
        );
        // A common drill: about 30° at the corner, far below nothing at the chisel.
        let common = made(30.0);
        assert!((28.0..33.0).contains(&common.lip(common.radius_mm).rake_rad.to_degrees()));
        assert!(common.lip(common.chisel_mm).rake_rad.to_degrees() < -15.0);
    }

    /// A chisel across the lips is the ridge of a roof as steep as the point; at 125° and 118° of point the wedge is the 107°
    /// that handbooks give as "about 110°".
    #[test]
    fn the_chisels_wedge() {
        let of = |point_deg: f64, psi_deg: f64| {
            TwistDrill {
                half_point_rad: (0.5 * point_deg).to_radians(),
                chisel_angle_rad: psi_deg.to_radians(),
                ..made(30.0)
            }
            .chisel_wedge_rad()
            .to_degrees()
        };
        assert_relative_eq!(of(118.0, 90.0), 59.0, max_relative = 1e-12);
        assert_relative_eq!(2.0 * of(118.0, 125.0), 107.5, max_relative = 2e-3);
    }

    #[test]
    fn missing_geometry_is_said() {
        let blunt = Tool {
            web_thickness_mm: None,
            ..drill()
        };
        assert!(
            TwistDrill::new(&blunt)
                .unwrap_err()
                .to_string()
                .contains("web_thickness_mm")
        );
    }
}
