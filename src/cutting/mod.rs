//! Cutting forces: geometry, force models, regression of the coefficients.

mod air;
mod average;
mod average_force;
mod conic;
mod estimate;
mod faults;
mod group;
mod identify;
mod in_step;
mod kienzle;
#[cfg(test)]
pub(crate) mod made_records;
mod orthogonal;
mod outlier;
mod plausibility;
mod record;
mod regression;
mod series;
mod teeth;
mod trend;
mod turning;
mod turning_checks;
mod warnings;
pub mod waveform;

pub use average::TurnAverage;
#[cfg(test)]
pub(crate) use average_force::tests::drill as test_drill;
pub use average_force::{
    CoefficientKind, DRILLING_COEFFICIENTS, DrillGeometry, ForceAxis, MILLING_COEFFICIENTS, average_row,
    coefficients_of, cut_diameter_mm, cutting_speed_m_per_min, feed_mm,
};
pub use conic::{ConicFit, Loss, conic_fit};
pub use estimate::{BOOTSTRAP_CUTS, BOOTSTRAP_DRAWS, Estimate, HUBER_THRESHOLD, Method, bootstrap, estimate};
pub use faults::read_record;
pub use group::by_axis;
pub use group::{Coefficient, Group, Influence, Known, RegressionPoint};
pub use identify::depth_mm;
pub use identify::{CfcOptions, CfcResult, from_analyses, identify_forces};
pub use in_step::{InStep, read_in_step};
pub use kienzle::{KienzleComponent, KienzleFit, Preferred, TellingFeed, kienzle};
pub use orthogonal::{ObliqueCoefficients, ObliqueEdge, Prediction};
pub use outlier::{Misfit, misfits, studentized};
pub use record::{Average, ChannelAnalysis, CutAnalysis, Notice, Trace, analyse_cut};
pub use regression::{Fit, Observation, fit};
pub use series::{MaterialComparison, SpeedTrends};
pub use trend::{Change, Reading, table_trend};
pub use turning::{EdgeBit, edge_row, engaged_edge};
pub(crate) use warnings::of_notices;
pub use warnings::speed_text;
