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
}

/// How the chip forms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ChipFormation {
    /// Shear angle φ_n, from the direction of the cut to the shear plane, rad.
    ShearAngleRad(f64),
    /// Uncut over cut chip thickness.
    ChipRatio(f64),
}
