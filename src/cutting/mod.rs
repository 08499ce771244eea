//! Cutting forces: geometry, force models, regression of the coefficients.

mod air;
mod average;
mod average_force;
mod coefficients;
mod conic;
mod cut_analysis;
mod cutting_trials;
mod drill_geometry;
mod estimate;
mod faults;
mod force_axis;
mod group;
mod identify;
mod in_step;
mod kienzle;
mod kienzle_law;
#[cfg(test)]
pub(crate) mod made_tools;
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

pub use average_force::{average_row, cut_diameter_mm, cutting_speed_m_per_min, feed_mm};
pub use coefficients::{CoefficientKind, DRILLING_COEFFICIENTS, MILLING_COEFFICIENTS, coefficients_of};
pub use conic::{ConicFit, Loss, conic_fit};
#[cfg(test)]
pub(crate) use cut_analysis::WRONG_SPEED;
pub use cut_analysis::{Average, ChannelAnalysis, CutAnalysis, Notice, Trace, TurnAverage};
pub use cutting_trials::CuttingTrials;
pub use drill_geometry::DrillGeometry;
pub use estimate::{
    BOOTSTRAP_CUTS, BOOTSTRAP_DRAWS, CfcOptions, CoefficientEstimate, HUBER_THRESHOLD, RegressionMethod,
    bootstrap, estimate,
};
pub use faults::repair_record;
pub use force_axis::ForceAxis;
pub use group::by_axis;
pub use group::{Coefficient, ForceGroup, Influence, Known, RegressionPoint};
pub use identify::depth_mm;
pub(crate) use identify::none_usable;
pub use identify::{CfcResult, fit_force_coefficients};
#[cfg(test)]
pub(crate) use in_step::OTHER_SPEED;
pub use in_step::{InStep, analyse_in_step};
pub use kienzle::{KienzleComponent, KienzleFit, Preferred, TellingFeed, kienzle};
#[cfg(test)]
pub(crate) use made_tools::drill as test_drill;
pub use orthogonal::{ObliqueCoefficients, ObliqueEdge, OrthogonalPrediction};
pub use outlier::{CutMisfit, misfits, studentized};
pub use record::analyse_cut;
pub use regression::{CoefficientFit, Observation, fit};
pub use series::{MaterialComparison, SpeedTrends};
pub use trend::{ChangeReading, CoefficientChange, table_trend};
pub use turning::{EdgeBit, edge_row, engaged_edge};
pub(crate) use warnings::of_notices;
pub use warnings::speed_text;
