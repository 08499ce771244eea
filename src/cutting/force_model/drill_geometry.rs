//! A drill in a hole: which part of its lips cuts, how thick a chip, and the forces on it.

use crate::cutting::force_model::force_axis::ForceAxis;
use crate::data::{CutGeometry, Tool};
use crate::{Error, InputError, Result};

/// A drill in a hole: lengths of docs/physics.md, "Cutting forces", mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DrillGeometry {
    /// Number of lips.
    pub lips: f64,
    /// Radius of the drill, mm.
    pub radius_mm: f64,
    /// Where the lip begins: the pilot's radius, or the chisel's half length in the full.
    pub inner_radius_mm: f64,
    /// Half the point angle, rad.
    pub half_point_rad: f64,
    /// Feed per revolution, mm.
    pub feed_per_rev_mm: f64,
}

/// Feed per revolution and diameter of the pilot hole (0: none) of a drilled hole.
///
/// # Errors
/// Another process.
pub(crate) fn feed_and_pilot_mm(geometry: &CutGeometry) -> Result<[f64; 2]> {
    match *geometry {
        CutGeometry::Drilling {
            feed_per_rev_mm,
            pilot_diameter_mm,
            ..
        } => Ok([feed_per_rev_mm, pilot_diameter_mm]),
        _ => Err(Error::computation("not a drilling cut")),
    }
}

/// Half the length of the chisel edge, w/(2 sin ψ): where the lips begin (docs/physics.md, "Cutting forces").
pub fn chisel_half_length_mm(tool: &Tool, web_thickness_mm: f64) -> f64 {
    0.5 * web_thickness_mm / tool.chisel_edge_angle_deg.to_radians().sin()
}

impl DrillGeometry {
    /// # Errors
    /// No point angle, no web thickness where the hole has no pilot, or a pilot as large as the drill.
    pub fn new(tool: &Tool, geometry: &CutGeometry) -> Result<DrillGeometry> {
        let [feed_per_rev_mm, pilot_diameter_mm] = feed_and_pilot_mm(geometry)?;
        let half_point_deg = tool.half_point_angle_deg.ok_or_else(|| {
            InputError::new("drilling needs half the point angle, which is not given")
                .key("tool.half_point_angle_deg")
                .remedy("add half_point_angle_deg to [tool]: 59.0 for a drill with a point angle of 118°")
        })?;
        let inner_radius_mm = if pilot_diameter_mm > 0.0 {
            0.5 * pilot_diameter_mm
        } else {
            let web = tool.web_thickness_mm.ok_or_else(|| {
                InputError::new("a hole without pilot needs the web thickness, which is not given")
                    .key("tool.web_thickness_mm")
                    .remedy("add web_thickness_mm to [tool], measured at the point (about 0.15 of the diameter); a pilot hole goes into \
                             pilot_diameter_mm of its [[cut]]")
            })?;
            chisel_half_length_mm(tool, web)
        };
        let radius_mm = 0.5 * tool.diameter_mm;
        if inner_radius_mm >= radius_mm {
            return Err(Error::computation(format!(
                "nothing left to drill: lips from {inner_radius_mm} mm to {radius_mm} mm"
            )));
        }
        Ok(DrillGeometry {
            lips: tool.teeth as f64,
            radius_mm,
            inner_radius_mm,
            half_point_rad: half_point_deg.to_radians(),
            feed_per_rev_mm,
        })
    }

    /// Chip thickness normal to the lip.
    pub fn chip_thickness_mm(&self) -> f64 {
        self.feed_per_rev_mm / self.lips * self.half_point_rad.sin()
    }

    /// Travel from first contact of the lips to full diameter.
    pub fn entry_travel_mm(&self) -> f64 {
        (self.radius_mm - self.inner_radius_mm) / self.half_point_rad.tan()
    }

    /// Thrust N (Kfc h + Kfe)(R − r0); torque N (Ktc h + Kte)(R² − r0²)/(2 sin κ)/1000.
    pub(crate) fn row(&self, axis: ForceAxis) -> [f64; 4] {
        let h = self.chip_thickness_mm();
        let (outer, inner) = (self.radius_mm, self.inner_radius_mm);
        match axis {
            ForceAxis::Z => {
                let thrust = self.lips * (outer - inner);
                [0.0, 0.0, thrust * h, thrust]
            }
            ForceAxis::Mz => {
                let torque =
                    self.lips * (outer * outer - inner * inner) / (2.0 * self.half_point_rad.sin()) / 1000.0;
                [torque * h, torque, 0.0, 0.0]
            }
            ForceAxis::X | ForceAxis::Y => [0.0; 4],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutting::made_tools::drill;
    use approx::assert_relative_eq;

    #[test]
    fn drilling_equals_the_lip_integrals() {
        let geometry = CutGeometry::Drilling {
            feed_per_rev_mm: 0.2,
            pilot_diameter_mm: 3.5,
            hole_depth_mm: None,
        };
        let g = DrillGeometry::new(&drill(), &geometry).unwrap();
        let kappa = 67.5f64.to_radians();
        // Chip thickness f/N sin κ on lips of length (R − r0)/sin κ at mean radius (R + r0)/2.
        let h = 0.1 * kappa.sin();
        let lip = 3.0 / kappa.sin();
        let (ktc, kte, kfc, kfe) = (272.0, 5.7, 91.0, 3.9);
        let torque = 2.0 * (ktc * h + kte) * lip * 3.25 / 1000.0;
        let thrust = 2.0 * (kfc * h + kfe) * lip * kappa.sin();
        let force = |axis| -> f64 {
            g.row(axis)
                .iter()
                .zip([ktc, kte, kfc, kfe])
                .map(|(r, k)| r * k)
                .sum()
        };
        assert_relative_eq!(force(ForceAxis::Mz), torque, max_relative = 1e-12);
        assert_relative_eq!(force(ForceAxis::Z), thrust, max_relative = 1e-12);
        assert_relative_eq!(g.entry_travel_mm(), 3.0 / kappa.tan());
    }

    #[test]
    fn a_full_hole_starts_at_the_chisel_and_missing_geometry_is_said() {
        let full = CutGeometry::Drilling {
            feed_per_rev_mm: 0.2,
            pilot_diameter_mm: 0.0,
            hole_depth_mm: None,
        };
        // Half length in the truth file of a practice campaign with this tool.
        let g = DrillGeometry::new(&drill(), &full).unwrap();
        assert_relative_eq!(g.inner_radius_mm, 0.8698018944925375, max_relative = 1e-12);
        let blunt = Tool {
            web_thickness_mm: None,
            ..drill()
        };
        let error = DrillGeometry::new(&blunt, &full).unwrap_err().to_string();
        assert!(error.contains("web_thickness_mm"), "{error}");
    }
}
