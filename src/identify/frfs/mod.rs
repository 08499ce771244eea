//! The structural model and its FRFs.

pub mod calibrate;
pub(crate) mod channels;
mod covering;
pub mod frf_data;
pub mod frf_problem;
pub mod modal_start;
mod place_test;
pub mod posture_modes;
mod rival_optima;
pub mod sensitivity;
pub mod spot_response;
pub mod structure;
pub mod structure_case;
pub mod structure_study;
pub mod undetermined;
