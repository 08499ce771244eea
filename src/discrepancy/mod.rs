//! Where the model fails, and which physical effect it lacks.

pub mod candidate;
pub mod compare;
pub mod compare_cutting;
pub mod cutting_lead;
pub mod diagnose;
pub mod diagnosis;
pub mod difference;
mod error_sums;
pub mod explained;
pub mod extension;
pub mod lab;
pub mod localise;
pub mod locate;
pub mod next_cut;
pub mod next_measurement;
mod noise_outlook;
pub mod place;
pub mod plan;
pub mod prospect;
#[cfg(test)]
mod resonance_tests;
pub mod setup;
pub mod something_else;
pub mod verdict;

pub use candidate::EffectCandidate;
pub use compare::{Band, FrfComparison, FrfError};
pub use compare_cutting::{CutError, CuttingComparison};
pub use cutting_lead::{CuttingLead, LineGroup, LineKind, cutting_lead};
pub use diagnose::diagnose;
pub use diagnosis::Diagnosis;
pub use explained::Explained;
pub use next_measurement::NextMeasurement;
pub use verdict::DiagnosisVerdict;
