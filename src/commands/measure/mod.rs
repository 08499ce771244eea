//! Measure and cut.

pub(crate) mod cfc;
mod cfc_document;
pub(crate) mod drill;
mod hole;
pub(crate) mod lobe_tool;
pub(crate) mod lobes;
mod lobes_document;
pub(crate) mod modal;
mod modal_document;
pub(crate) mod modal_files;
pub(crate) mod operational;
pub(crate) mod sweep;
