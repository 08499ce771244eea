//! Measure and cut.

pub(crate) mod cfc;
pub(crate) mod drill;
mod hole;
pub(crate) mod lobe_tool;
pub(crate) mod lobes;
pub(crate) mod modal;
pub(crate) mod modal_files;
pub(crate) mod operational;
pub(crate) mod sweep;
