//! Where the model fails, and which physical effect it lacks.

pub mod compare;
pub mod compare_cutting;
pub mod diagnose;
pub mod explained;
pub mod extension;
pub mod next_measurement;
pub mod place;
pub mod something_else;
pub mod verdict;

pub use compare::{Band, FrfComparison, FrfError};
pub use compare_cutting::{CutError, CuttingComparison};
pub use diagnose::{Candidate, Diagnosis, diagnose};
pub use explained::Explained;
pub use verdict::Verdict;
