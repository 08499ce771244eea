//! Whole analyses of a campaign, as the commands and the report need them: each floor below called in its order.

pub mod addition;
pub mod campaign;
pub mod channel_check;
pub mod cutting;
pub mod diagnosis;
mod lobe_model;
mod lobe_structure;
pub mod lobes;
pub mod modal;
pub mod modal_export;
pub mod mode_comparison;
pub mod model_stages;
pub mod operational;
mod redundancy;
pub mod regression_line;
pub mod shape_comparison;
pub mod stick_shapes;
pub mod structure;
pub mod sweep;
pub mod thesis_findings;

pub use addition::Addition;
pub use campaign::{CampaignFindings, LobeFindings, PostureFindings, StructureFindings};
pub use cutting::CuttingAnalysis;
pub use diagnosis::{CuttingFindings, DiagnosisFindings};
pub use lobes::{LobeAnalysis, LobeCase, LobesBefore};
pub use modal::{ModalAnalysis, SetModes};
pub use model_stages::ModelStage;
pub use redundancy::{HoleWeighing, RedundancyAnalysis};
pub use structure::StructureAnalysis;
pub use sweep::{Sweep, SweepRequest, SweepRow};
pub use thesis_findings::ThesisFindings;
