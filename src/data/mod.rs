//! What was measured, on what: plain values without files, which every other room speaks in.

mod contact;
mod cut;
mod dof;
mod frf;
mod lobe_request;
mod measured_frf;
mod measurement;
mod orthogonal;
mod robot_section;
mod robot_spec;
mod time_record;
mod tool;

pub use contact::{Contact, ContactDirection};
pub use cut::{Cut, CutGeometry, CutOutcome, Immersion, Process};
pub use dof::{Axis, Dof};
pub use frf::{FrfRecord, Quantity};
pub use lobe_request::{HoleSection, LobeAxis, LobeMethod, LobeMode, LobeSource, LobesSection, Redundancy};
pub use measured_frf::{FrfSet, MeasuredDof, MeasuredFrf};
pub use measurement::{AxesRef, BodyRef, Point, Posture};
pub use orthogonal::{ChipFormation, LinearLaw, OrthogonalSection};
pub use robot_section::{LinkGroup, LinkTolerances, RobotSection};
pub use robot_spec::{BeamSection, JointPlacement, JointSpec, LinkSpec, RobotSpec, SectionShape, ToolFrame};
pub use time_record::{Channel, ChannelRole, Sample, TimeRecord};
pub use tool::{Tool, ToolKind, ToolSegment, Tooth, USUAL_CHISEL_EDGE_ANGLE_DEG};
