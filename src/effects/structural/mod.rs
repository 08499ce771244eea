//! Effects on the structure, one file each.

pub(crate) mod amplitude_dependent_stiffness;
pub(crate) mod base_compliance;
pub(crate) mod base_mounting;
pub(crate) mod branch;
pub(crate) mod contact;
mod domain;
pub(crate) mod joint_damping;
pub(crate) mod joint_transverse_compliance;
pub(crate) mod joints;
pub(crate) mod link_flexibility;
pub(crate) mod load_dependent_stiffness;
pub(crate) mod loads;
pub(crate) mod local_resonator;
pub(crate) mod sensor_misalignment;
pub(crate) mod time_delay;
pub(crate) mod tool_flexibility;

pub use domain::{ChannelFilter, Conditions, DataSummary, PostureSetting, Structure};
pub use link_flexibility::LINK_FLEXIBILITY;
