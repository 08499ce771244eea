//! What a `[lobes]` table asks for, as a force and a tool.

use super::blocks::AveragedCut;
use super::force::RegenerativeForce;
use crate::campaign::{CutGeometry, LobesSection, Tool, ToolSegment};
use crate::cutting::{DrillGeometry, DrillPrediction};
use crate::lobes::dynamics::tool_beam::{BeamSegment, ToolBeam};
use crate::lobes::milling::periodic_force::PeriodicForce;

/// Cutting coefficients that lobes need, N/mm².
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct LobeCoefficients {
    /// Tangential coefficient Ktc, N/mm².
    pub ktc_n_per_mm2: f64,
    /// Radial coefficient Krc (drilling: the part of Kfc in the plane of the lobes), N/mm².
    pub krc_n_per_mm2: f64,
    /// Drilling: thrust per chip area, Kac = Kfc sin κ; for the axial–torsional block.
    pub kac_n_per_mm2: Option<f64>,
}

impl LobeCoefficients {
    /// The ones the `[lobes]` table gives; `None` where it leaves one out (then they come from the cuts).
    pub fn given(section: &LobesSection) -> Option<Self> {
        Some(LobeCoefficients {
            ktc_n_per_mm2: section.ktc_n_per_mm2?,
            krc_n_per_mm2: section.krc_n_per_mm2?,
            kac_n_per_mm2: section.kac_n_per_mm2,
        })
    }

    /// Those of a drill that is predicted from an orthogonal database.
    pub fn of_drill(drill: &DrillPrediction) -> Self {
        let found = drill.for_lobes();
        LobeCoefficients {
            ktc_n_per_mm2: found.ktc_n_per_mm2,
            krc_n_per_mm2: found.krc_n_per_mm2,
            kac_n_per_mm2: Some(found.kac_n_per_mm2),
        }
    }
}

/// The force of a cut, as the method wants it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LobeCut {
    /// Zero-order milling, drilling and turning.
    Averaged(AveragedCut),
    /// Milling with its true dependence on time.
    Periodic(PeriodicForce),
}

impl LobeCut {
    /// The forces averaged over a revolution.
    pub fn average(&self) -> AveragedCut {
        match self {
            LobeCut::Averaged(cut) => *cut,
            LobeCut::Periodic(force) => force.average().into(),
        }
    }
}

/// The hole that a drill cuts, as the axial–torsional block needs it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DrilledHole {
    /// Radial width of cut, outer radius minus where the lip begins.
    pub width_mm: f64,
    /// Mean radius of the lips: the arm of their tangential force.
    pub arm_mm: f64,
}

impl DrilledHole {
    /// Where the lips begin and end, mm from the axis.
    pub fn radii_mm(&self) -> [f64; 2] {
        [-0.5, 0.5].map(|side| self.arm_mm + side * self.width_mm)
    }

    /// From `[tool]` and the pilot of `[lobes.hole]`; `None` where the diameter is not known.
    ///
    /// In the full the lips begin at the chisel's half length where the web is known (see
    /// [`crate::cutting::DrillGeometry`]), else at the axis.
    pub fn of(tool: Option<&Tool>, section: &LobesSection) -> Option<Self> {
        let tool = tool?;
        let hole = section.hole.as_ref();
        let geometry = CutGeometry::Drilling {
            feed_per_rev_mm: section.feed_per_rev_mm.unwrap_or(0.0),
            pilot_diameter_mm: hole.and_then(|h| h.pilot_diameter_mm).unwrap_or(0.0),
            hole_depth_mm: None,
        };
        let tool = Tool {
            half_point_angle_deg: section.half_point_angle_deg.or(tool.half_point_angle_deg),
            web_thickness_mm: tool.web_thickness_mm.or(Some(0.0)),
            ..tool.clone()
        };
        let g = DrillGeometry::new(&tool, &geometry).ok()?;
        Some(DrilledHole {
            width_mm: g.radius_mm - g.inner_radius_mm,
            arm_mm: 0.5 * (g.radius_mm + g.inner_radius_mm),
        })
    }
}

/// The axial–torsional force of a drill.
///
/// # Errors
/// In words for people: what is missing, and what to give.
pub fn axial_torsional_force(
    tool: Option<&Tool>,
    section: &LobesSection,
    coefficients: LobeCoefficients,
    teeth: usize,
) -> std::result::Result<RegenerativeForce, String> {
    let kac = coefficients
        .kac_n_per_mm2
        .ok_or("the thrust coefficient is not known: give lobes.kac_n_per_mm2")?;
    let hole = DrilledHole::of(tool, section)
        .ok_or("the arm of the torque is not known: add a [tool] table with the drill's diameter_mm")?;
    let feed_m = 1e-3 * section.feed_per_rev_mm.unwrap_or(0.0);
    let ktc = coefficients.ktc_n_per_mm2;
    RegenerativeForce::drilling_axial_torsional(ktc, kac, 1e-3 * hole.arm_mm, feed_m, teeth)
        .map_err(|e| e.to_string())
}

/// The tool of `[lobes.tool]` as a beam; without segments where there is none.
pub fn tool_beam(section: &LobesSection) -> ToolBeam {
    let segment = |s: &ToolSegment| BeamSegment {
        length_m: 1e-3 * s.length_mm,
        diameter_m: 1e-3 * s.diameter_mm * s.flute_ratio,
        bore_m: 1e-3 * s.bore_mm,
        young_pa: 1e9 * s.young_gpa,
        shear_pa: 1e9 * s.shear_gpa,
        density_kg_per_m3: s.density_kg_per_m3,
        loss_factor: s.loss_factor,
        twist_coupling: s.twist_coupling,
    };
    ToolBeam {
        segments: section.tool.iter().map(segment).collect(),
    }
}
