//! Where the model fails: comparison of model and measurement.

pub mod compare;

pub use compare::{Band, FrfComparison, FrfError, held_out_nrms};
