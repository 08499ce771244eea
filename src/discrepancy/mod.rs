//! Where the model fails, and which physical effect it lacks.

pub mod candidate;
pub mod comparison;
pub mod cutting_lead;
pub mod diagnose;
pub mod diagnosis;
pub mod extension;
pub mod localise;
pub mod outlook;
#[cfg(test)]
mod resonance_tests;
pub mod setup;
pub mod something_else;
pub mod verdict;

pub use crate::discrepancy::comparison::compare::{Band, FrfComparison, FrfError};
pub use crate::discrepancy::comparison::compare_cutting::{CutError, CuttingComparison};
pub use crate::discrepancy::comparison::explained::Explained;
pub use crate::discrepancy::outlook::next_measurement::NextMeasurement;
pub use candidate::EffectCandidate;
pub use cutting_lead::{CuttingLead, LineGroup, LineKind, cutting_lead};
pub use diagnose::diagnose;
pub use diagnosis::Diagnosis;
pub use verdict::DiagnosisVerdict;
