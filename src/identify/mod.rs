//! Fits models to measurements: parameters with priors, the least-squares solver, uncertainty.

pub mod calibrate;
pub mod case;
pub mod cutting_case;
pub mod cutting_data;
mod cutting_forces;
pub mod cutting_model;
pub mod cutting_problem;
pub mod cutting_study;
pub mod cutting_waves;
mod cutting_windows;
mod force_channel;
pub mod frf_data;
pub mod levenberg_marquardt;
pub mod modal_start;
pub mod modal_table;
pub mod off_comb;
pub mod posture_modes;
pub mod resonance_study;
pub mod rest;
pub mod structure;
pub mod structure_study;
pub mod study;
mod zero_line;

pub use crate::parameter::{Parameter, Prior, Scale};
pub use calibrate::{Calibration, Estimate, Options};
pub use case::StructureCase;
pub use cutting_case::CuttingCase;
pub use cutting_data::CuttingData;
pub use cutting_model::CuttingModel;
pub use cutting_problem::{CutFit, CuttingProblem};
pub use cutting_study::CuttingStudy;
pub use frf_data::FrfData;
pub use levenberg_marquardt::{Fit, LeastSquares, Linearisation, minimise};
pub use structure::StructureModel;
pub use structure_study::StructureStudy;
pub use study::{EffectName, HeldOut, Study};
