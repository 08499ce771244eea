//! Fits models to measurements: parameters with priors, the least-squares solver, uncertainty.

pub mod case;
pub mod common_course;
pub mod departures;
pub mod first_size;
pub mod forces;
pub mod frfs;
pub mod levenberg_marquardt;
pub mod model;
pub mod model_history;
pub mod own_errors;
pub mod resonances;
pub mod rest;
pub mod rest_patterns;
pub mod study;

pub use crate::parameter::{Parameter, Prior, Scale};
pub use case::Case;
pub use forces::cutting_case::CuttingCase;
pub use forces::cutting_data::CuttingData;
pub use forces::cutting_model::CuttingModel;
pub use forces::cutting_problem::{CutFit, CuttingProblem};
pub use forces::cutting_study::CuttingStudy;
pub use frfs::calibrate::{Calibration, Estimate, Options};
pub use frfs::frf_data::FrfData;
pub use frfs::structure::StructureModel;
pub use frfs::structure_case::StructureCase;
pub use frfs::structure_study::StructureStudy;
pub use frfs::undetermined::Undetermined;
pub use levenberg_marquardt::{Fit, LeastSquares, Linearisation, minimise};
pub use model::{AddedEffect, Model, Modelled};
pub use study::{HeldOut, Study};
