//! Cutting forces: geometry, force models, regression of the coefficients.

mod average_force;
mod constrained;
mod faults;
mod group;
mod identify;
mod outlier;
mod plausibility;
mod record;
mod regression;
mod warnings;
pub mod waveform;

#[cfg(test)]
pub(crate) use average_force::tests::drill as test_drill;
pub use average_force::{
    CoefficientKind, DRILLING_COEFFICIENTS, DrillGeometry, ForceAxis, MILLING_COEFFICIENTS, average_row,
    coefficients_of, cutting_speed_m_per_min, feed_mm,
};
pub use constrained::{Constrained, nonnegative_least_squares};
pub use faults::read_record;
pub(crate) use group::by_axis;
pub use group::{Coefficient, Group, RegressionPoint};
pub(crate) use identify::depth_mm;
pub use identify::{CfcOptions, CfcResult, from_analyses, identify_forces};
pub use outlier::{Misfit, misfits};
pub use record::{Average, ChannelAnalysis, CutAnalysis, Notice, Trace, analyse_cut};
pub use regression::{Fit, Observation, fit};
pub(crate) use warnings::{of_faults, speed_text};
