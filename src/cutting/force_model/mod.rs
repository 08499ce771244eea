//! Forces from geometry and coefficients.

pub(crate) mod average_force;
pub(crate) mod coefficients;
pub(crate) mod drill_geometry;
pub(crate) mod drill_prediction;
pub(crate) mod force_axis;
pub(crate) mod kienzle_law;
pub(crate) mod orthogonal;
pub(crate) mod turning;
pub(crate) mod twist_drill;
