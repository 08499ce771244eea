//! Cutting forces: geometry, force models, regression of the coefficients.

mod cutting_trials;
pub(crate) mod fit;
pub(crate) mod force_model;
mod identify;
#[cfg(test)]
pub(crate) mod made_tools;
pub(crate) mod measured;
mod plausibility;
mod turning_checks;
mod warnings;
pub mod waveform;

pub use crate::cutting::fit::conic::{ConicFit, Loss, conic_fit};
pub use crate::cutting::fit::estimate::{
    BOOTSTRAP_CUTS, BOOTSTRAP_DRAWS, CfcOptions, CoefficientEstimate, HUBER_THRESHOLD, RegressionMethod,
    bootstrap, estimate,
};
pub use crate::cutting::fit::group::by_axis;
pub use crate::cutting::fit::group::{Coefficient, ForceGroup, Influence, Known, RegressionPoint};
pub use crate::cutting::fit::kienzle::{KienzleComponent, KienzleFit, Preferred, TellingFeed, kienzle};
pub use crate::cutting::fit::outlier::{CutMisfit, misfits, studentized};
pub use crate::cutting::fit::regression::{CoefficientFit, Observation, fit};
pub use crate::cutting::fit::series::{MaterialComparison, SpeedTrends};
pub use crate::cutting::fit::trend::{ChangeReading, CoefficientChange, table_trend};
pub use crate::cutting::force_model::average_force::{
    average_row, cut_diameter_mm, cutting_speed_m_per_min, feed_mm,
};
pub use crate::cutting::force_model::coefficients::{
    CoefficientKind, DRILLING_COEFFICIENTS, MILLING_COEFFICIENTS, coefficients_of,
};
pub use crate::cutting::force_model::drill_geometry::DrillGeometry;
pub use crate::cutting::force_model::force_axis::ForceAxis;
pub use crate::cutting::force_model::orthogonal::{ObliqueCoefficients, ObliqueEdge, OrthogonalPrediction};
pub use crate::cutting::force_model::turning::{EdgeBit, edge_row, engaged_edge};
#[cfg(test)]
pub(crate) use crate::cutting::measured::cut_analysis::WRONG_SPEED;
pub use crate::cutting::measured::cut_analysis::{
    Average, ChannelAnalysis, CutAnalysis, Notice, Trace, TurnAverage,
};
pub use crate::cutting::measured::faults::repair_record;
#[cfg(test)]
pub(crate) use crate::cutting::measured::in_step::OTHER_SPEED;
pub use crate::cutting::measured::in_step::{InStep, analyse_in_step};
pub use crate::cutting::measured::record::analyse_cut;
pub use cutting_trials::CuttingTrials;
pub use identify::depth_mm;
pub(crate) use identify::none_usable;
pub use identify::{CfcResult, fit_force_coefficients};
#[cfg(test)]
pub(crate) use made_tools::drill as test_drill;
pub(crate) use warnings::of_notices;
pub use warnings::speed_text;
