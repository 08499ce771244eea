//! Where the model fails, and which physical effect it lacks.

pub mod compare;
pub mod correlation;
pub mod diagnose;
pub mod next_measurement;

pub use compare::{Band, FrfComparison, FrfError};
pub use diagnose::{Candidate, Diagnosis, Verdict, diagnose};
