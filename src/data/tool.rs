//! The tool.

/// What kind of cutting tool it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ToolKind {
    /// An end mill, ball ends included.
    Endmill,
    /// A twist drill.
    Drill,
    /// A turning tool with one insert; `teeth` is 1.
    Turning,
}

/// Chisel edge angle of common twist drills, °.
pub const USUAL_CHISEL_EDGE_ANGLE_DEG: f64 = 125.0;

/// The tool that cuts, as the `[tool]` section gives it.
#[derive(Debug, Clone, PartialEq)]
pub struct Tool {
    /// Kind of tool; it says which of the numbers below count.
    pub kind: ToolKind,
    /// 0 for a turning tool, which has none: the workpiece turns.
    pub diameter_mm: f64,
    /// Number of teeth, or of lips of a drill; at least 1.
    pub teeth: usize,
    /// Helix angle; 0: straight teeth, turning tools.
    pub helix_deg: f64,
    /// End mills: radius of the corner between face and side; half the diameter is a ball end, 0 a sharp corner. Turning:
    /// the nose radius rε.
    pub corner_radius_mm: f64,
    /// End mills: angle between the feed's plane and the straight part of the edge (κr of inserts); 90° up the side.
    /// Turning: κr, between the direction of the feed and the straight part of the edge.
    pub lead_angle_deg: f64,
    /// Drills: half of the point angle.
    pub half_point_angle_deg: Option<f64>,
    /// Drills: web thickness.
    pub web_thickness_mm: Option<f64>,
    /// Drills: chisel edge angle ψ, from a lip to the chisel edge in the view along the axis; 125° where nobody says.
    pub chisel_edge_angle_deg: f64,
    /// End mills whose teeth differ: each of the `teeth`, in the order in which they cut. Empty: all alike, evenly spaced.
    pub each_tooth: Vec<Tooth>,
}

/// One tooth of an end mill whose teeth differ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tooth {
    /// Angle at the tip from this tooth to the one that cuts next; those of all teeth add up to 360°.
    pub pitch_deg: f64,
    /// Its own helix angle.
    pub helix_deg: f64,
    /// How far its edge stands beyond the tool's radius; negative for one that is chipped, by more than the feed per
    /// revolution for one that is missing.
    pub radius_offset_mm: f64,
}

impl Tool {
    /// Whether the edge of an end mill runs straight up its side.
    pub fn has_straight_edge(&self) -> bool {
        self.corner_radius_mm == 0.0 && self.lead_angle_deg == 90.0
    }
}

/// `[[lobes.tool.segment]]`: a stretch of the tool of one section and material, from the holder face to the tip.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct ToolSegment {
    /// Length along the tool axis.
    pub length_mm: f64,
    /// Outer diameter; over the flutes where there are any.
    pub diameter_mm: f64,
    /// Diameter of the bore; 0: solid.
    pub bore_mm: f64,
    /// Diameter of the round bar that is as stiff over `diameter_mm`: below 1 for flutes.
    pub flute_ratio: f64,
    /// Young's modulus E.
    pub young_gpa: f64,
    /// Shear modulus G.
    pub shear_gpa: f64,
    /// Of the material, such as 7850 for steel.
    pub density_kg_per_m3: f64,
    /// Loss factor η in E (1 + iη): about twice the damping ratio.
    pub loss_factor: f64,
    /// See [`crate::lobes::BeamSegment::twist_coupling`].
    pub twist_coupling: f64,
}
