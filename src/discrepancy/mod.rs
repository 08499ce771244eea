//! Where the model fails, and which physical effect it lacks.

pub mod candidate;
pub mod comparison;
pub mod cutting_lead;
pub mod cutting_trends;
pub mod diagnose;
pub mod diagnosis;
pub mod extension;
mod faint;
pub mod joint_trends;
pub mod localise;
pub mod outlook;
mod ranking;
#[cfg(test)]
mod resonance_tests;
pub mod setup;
pub mod something_else;
pub mod trend;
pub mod verdict;

pub use candidate::EffectCandidate;
pub use comparison::compare::{Band, FrfComparison, FrfError};
pub use comparison::compare_cutting::{CutError, CuttingComparison};
pub use comparison::explained::Explained;
pub use cutting_lead::{CuttingLead, LineGroup, LineKind, cutting_lead};
pub use cutting_trends::{Against, Trend, cutting_trends};
pub use diagnose::{diagnose, diagnose_from};
pub use diagnosis::Diagnosis;
pub use outlook::next_measurement::NextMeasurement;
pub use trend::TrendPoint;
pub use verdict::DiagnosisVerdict;
