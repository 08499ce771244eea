//! Whole analyses of a campaign, as the commands and the report need them: each floor below called in its order.

pub mod addition;
pub mod campaign;
pub mod diagnosis;
pub mod expert;
pub mod export;
pub mod forces;
pub mod freed_links;
pub mod grown;
pub mod many;
pub mod model_stages;
pub mod modes;
pub mod planning;
pub mod setup;
pub mod side;
pub mod stability;
pub mod structure;
pub mod structure_case;
pub mod structure_side;
pub mod workbench;

pub use addition::Addition;
pub use campaign::{CampaignFindings, LobeFindings, PostureFindings, StructureFindings};
pub use diagnosis::{CuttingFindings, DiagnosisFindings, Findings};
pub use expert::ExpertView;
pub use forces::cutting::CuttingAnalysis;
pub use forces::cutting_side::CuttingView;
pub use freed_links::FreedLinks;
pub use many::shard::Shard;
pub use model_stages::ModelStage;
pub use modes::modal::{ModalAnalysis, SetModes};
pub use side::CampaignSide;
pub use stability::lobes::{LobeAnalysis, LobeCase, LobesBefore};
pub use stability::redundancy::{HoleWeighing, RedundancyAnalysis};
pub use stability::sweep::{Sweep, SweepRequest, SweepRow};
pub use structure::StructureAnalysis;
pub use structure_side::FrfView;
pub use workbench::Workbench;
