//! Modal analyses of files and campaigns.

pub(crate) mod frf_inputs;
pub mod modal;
pub mod modal_export;
pub mod mode_comparison;
pub mod mode_set;
pub mod operational;
pub mod shape_comparison;
pub mod stick_shapes;
