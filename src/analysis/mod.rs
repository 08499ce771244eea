//! Whole analyses of a campaign, as the commands and the report need them: each floor below called in its order.

pub mod addition;
pub mod campaign;
pub mod diagnosis;
pub mod expert;
pub mod forces;
pub mod freed_links;
pub mod many;
pub mod model_stages;
pub mod modes;
pub mod planning;
pub mod setup;
pub mod stability;
pub mod structure;
pub mod structure_case;
pub mod workbench;

pub use crate::analysis::forces::cutting::CuttingAnalysis;
pub use crate::analysis::many::shard::Shard;
pub use crate::analysis::modes::modal::{ModalAnalysis, SetModes};
pub use crate::analysis::stability::lobes::{LobeAnalysis, LobeCase, LobesBefore};
pub use crate::analysis::stability::redundancy::{HoleWeighing, RedundancyAnalysis};
pub use crate::analysis::stability::sweep::{Sweep, SweepRequest, SweepRow};
pub use addition::Addition;
pub use campaign::{CampaignFindings, LobeFindings, PostureFindings, StructureFindings};
pub use diagnosis::{CuttingFindings, DiagnosisFindings};
pub use expert::ExpertView;
pub use freed_links::FreedLinks;
pub use model_stages::ModelStage;
pub use structure::StructureAnalysis;
pub use workbench::Workbench;
