//! Fits models to measurements: parameters with priors, the least-squares solver, uncertainty.

pub mod departures;
pub mod forces;
pub mod frfs;
pub mod levenberg_marquardt;
pub mod model_history;
pub mod resonances;
pub mod rest;
pub mod rest_patterns;
pub mod study;

pub use crate::identify::forces::cutting_case::CuttingCase;
pub use crate::identify::forces::cutting_data::CuttingData;
pub use crate::identify::forces::cutting_model::CuttingModel;
pub use crate::identify::forces::cutting_problem::{CutFit, CuttingProblem};
pub use crate::identify::forces::cutting_study::CuttingStudy;
pub use crate::identify::frfs::calibrate::{Calibration, Estimate, Options};
pub use crate::identify::frfs::case::StructureCase;
pub use crate::identify::frfs::frf_data::FrfData;
pub use crate::identify::frfs::structure::StructureModel;
pub use crate::identify::frfs::structure_study::StructureStudy;
pub use crate::identify::frfs::undetermined::Undetermined;
pub use crate::parameter::{Parameter, Prior, Scale};
pub use levenberg_marquardt::{Fit, LeastSquares, Linearisation, minimise};
pub use study::{EffectName, HeldOut, Study};
