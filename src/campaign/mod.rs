//! A campaign folder: what was measured, where, and on what. SI values keep the unit of the file in their name.

pub mod beside_urdf;
mod channels;
mod contacts;
pub mod draft;
mod each_tooth;
pub mod form;
pub mod frf_set;
mod guesses;
mod load;
mod lobes_section;
mod named_files;
pub mod robot_file;
pub mod robot_text;
pub mod schema;
mod shared_keys;
mod tool_and_cut;

pub use crate::data::{
    AxesRef, BodyRef, ChipFormation, Contact, ContactDirection, Cut, CutGeometry, CutOutcome, FrfSet,
    HoleSection, Immersion, LinkGroup, LinkTolerances, LobeAxis, LobeMethod, LobeMode, LobeSource,
    LobesSection, MeasuredDof, MeasuredFrf, OrthogonalSection, Point, Posture, Process, Redundancy,
    RobotSection, Tool, ToolKind, ToolSegment, Tooth,
};
pub use form::json_schema::{SchemaOf, json_schema};
pub use form::paths::campaign_file;
pub use form::section::Section;
pub use frf_set::FrfFiles;
pub use guesses::Guesses;
pub use named_files::named_files;
pub use schema::{Campaign, CutChannel, Dynamometer, FrfFile, PlanSection};
