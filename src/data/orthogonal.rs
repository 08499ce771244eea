//! What orthogonal cutting tests of a material gave.

/// What orthogonal cuts of the material gave, to predict the milling coefficients from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrthogonalSection {
    /// Shear stress τ in the shear plane, MPa (N/mm²).
    pub shear_stress_mpa: f64,
    /// Mean friction angle β_a on the rake face.
    pub friction_angle_deg: f64,
    /// Shear angle or chip ratio.
    pub chip: ChipFormation,
    /// Normal rake of the tool.
    pub rake_deg: f64,
    /// `None`: the tool's helix angle; none in turning.
    pub inclination_deg: Option<f64>,
    /// How shear stress, MPa, changes; `None`: it does not.
    pub shear_stress_law: Option<LinearLaw>,
    /// How the friction angle, °, changes; `None`: it does not.
    pub friction_angle_law: Option<LinearLaw>,
    /// How the chip ratio changes: (a + b α) h^(c + d α), α the rake in degrees, h the chip thickness in mm. `None`: it does
    /// not.
    pub chip_ratio_law: Option<[f64; 4]>,
    /// Edge force along the cutting speed, N/mm; 0: none.
    pub edge_force_tangential_n_per_mm: f64,
    /// Edge force normal to the edge, N/mm; 0: none.
    pub edge_force_normal_n_per_mm: f64,
}

/// A number that changes with rake (°), chip thickness (mm) and cutting speed (m/min): constant and slopes in that order.
pub type LinearLaw = [f64; 4];

/// How the chip forms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ChipFormation {
    /// Shear angle φ_n, from the direction of the cut to the shear plane, rad.
    ShearAngleRad(f64),
    /// Uncut over cut chip thickness.
    ChipRatio(f64),
}
