//! Whole analyses of a campaign, as the commands and the report need them: each floor below called in its order.

pub mod lobes;
pub mod structure;

pub use lobes::{LobeAnalysis, LobeCase};
pub use structure::StructureAnalysis;
