//! What orthogonal cutting tests of a material gave.

/// What orthogonal cuts of the material gave, to predict the milling coefficients from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrthogonalSection {
    pub shear_stress_mpa: f64,
    pub friction_angle_deg: f64,
    pub chip: ChipFormation,
    /// Normal rake of the tool.
    pub rake_deg: f64,
    /// `None`: the tool's helix angle; none in turning.
    pub inclination_deg: Option<f64>,
}

/// How the chip forms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ChipFormation {
    ShearAngleRad(f64),
    /// Uncut over cut chip thickness.
    ChipRatio(f64),
}
