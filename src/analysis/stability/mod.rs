//! Lobes, the hole and the workspace of a campaign.

pub(crate) mod hole_check;
pub(crate) mod lobe_case;
pub(crate) mod lobe_model;
pub(crate) mod lobe_setup;
pub(crate) mod lobe_structure;
pub mod lobes;
pub(crate) mod measured_structures;
pub(crate) mod noted_cuts;
pub(crate) mod redundancy;
pub mod sweep;
