//! Whole analyses of a campaign, as the commands and the report need them: each floor below called in its order.

pub mod addition;
pub mod batch;
pub mod campaign;
pub mod channel_check;
pub mod control_chart;
pub mod cutting;
pub mod diagnosis;
pub mod expert;
pub mod fleet;
pub mod freed_links;
mod lobe_model;
mod lobe_structure;
pub mod lobes;
pub mod modal;
pub mod modal_export;
pub mod mode_comparison;
pub mod model_stages;
pub mod operational;
pub mod planning;
mod redundancy;
pub mod regression_line;
pub mod setup;
pub mod shape_comparison;
mod shard;
pub mod stick_shapes;
pub mod structure;
pub mod sweep;
#[cfg(feature = "report")]
pub mod thesis_findings;

pub use addition::Addition;
pub use campaign::{CampaignFindings, LobeFindings, PostureFindings, StructureFindings};
pub use cutting::CuttingAnalysis;
pub use diagnosis::{CuttingFindings, DiagnosisFindings};
pub use expert::ExpertView;
pub use freed_links::FreedLinks;
pub use lobes::{LobeAnalysis, LobeCase, LobesBefore};
pub use modal::{ModalAnalysis, SetModes};
pub use model_stages::ModelStage;
pub use redundancy::{HoleWeighing, RedundancyAnalysis};
pub use shard::Shard;
pub use structure::StructureAnalysis;
pub use sweep::{Sweep, SweepRequest, SweepRow};
#[cfg(feature = "report")]
pub use thesis_findings::ThesisFindings;
