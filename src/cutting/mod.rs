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

pub use cutting_trials::CuttingTrials;
pub use fit::conic::{ConicFit, Loss, conic_fit};
pub use fit::estimate::{
    BOOTSTRAP_CUTS, BOOTSTRAP_DRAWS, CfcOptions, CoefficientEstimate, HUBER_THRESHOLD, RegressionMethod,
    bootstrap, estimate,
};
pub use fit::group::{Coefficient, ForceGroup, Influence, KnownValue, RegressionPoint};
pub use fit::kienzle::{KienzleComponent, KienzleFit, Preferred, TellingFeed, kienzle};
pub use fit::outlier::{CutMisfit, misfits, studentized};
pub use fit::regression::{CoefficientFit, Observation, fit};
pub use fit::series::{MaterialComparison, SpeedTrends};
pub use fit::trend::{ChangeReading, CoefficientChange, table_trend};
pub use force_model::average_force::{
    average_row, cut_diameter_mm, cutting_speed_m_per_min, depth_mm, feed_mm,
};
pub use force_model::coefficients::{
    CoefficientKind, DRILLING_COEFFICIENTS, MILLING_COEFFICIENTS, coefficients_of,
};
pub use force_model::drill_geometry::DrillGeometry;
pub use force_model::drill_prediction::{
    ChiselShare, DrillCoefficients, DrillForces, DrillPrediction, LipElement,
};
pub use force_model::force_axis::ForceAxis;
pub use force_model::orthogonal::{ObliqueCoefficients, ObliqueEdge, OrthogonalPrediction};
pub use force_model::turning::{EdgeBit, edge_row, engaged_edge};
pub use force_model::twist_drill::{LipPlace, TwistDrill};
pub(crate) use identify::none_usable;
pub use identify::{CfcResult, fit_force_coefficients};
#[cfg(test)]
pub(crate) use made_tools::drill as test_drill;
pub(crate) use measured::contact::record_at_full_contact;
#[cfg(test)]
pub(crate) use measured::cut_analysis::WRONG_SPEED;
pub(crate) use measured::cut_analysis::contradicts_speed;
pub use measured::cut_analysis::{Average, ChannelAnalysis, CutAnalysis, Notice, Trace, TurnAverage};
pub use measured::faults::repair_record;
#[cfg(test)]
pub(crate) use measured::in_step::OTHER_SPEED;
pub use measured::in_step::{RecordReading, analyse_in_step};
pub use measured::record::analyse_cut;
pub use measured::record_slips::{CommonPassing, OtherSpeed, RecordSlips, Rectified};
pub use measured::uneven_teeth::UnevenTeeth;
pub(crate) use plausibility::USUAL;
pub(crate) use warnings::of_notices;
pub use warnings::speed_text;
