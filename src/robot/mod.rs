//! The robot as a structure: kinematics, a chain of compliant elements, frequency response.
//!
//! The chain uses relative coordinates: every compliant element (a joint's rotation, half a link that bends,
//! a rocking base) has its own coordinates and its own stiffness, so the stiffness matrix is block diagonal and
//! positive definite at every posture. Masses see the elements before them through rigid-body Jacobians.

pub mod beam;
pub mod chain;
pub mod dual;
pub mod export;
pub mod file_number;
#[cfg(test)]
pub(crate) mod fixture;
pub mod frf;
pub mod kinematics;
pub mod model;
pub mod pose_compensation;
pub mod posture_report;
mod published_postures;
pub mod rigid;
pub mod static_deflection;
pub mod urdf;

pub use crate::data::*;
pub use chain::{Attachment, AttachmentLaw, Body, Branch, Chain, Element, Grip, Place, Role, Slot, System};
pub use dual::Dual;
pub use file_number::FileNumber;
pub use frf::{FrfBasis, ModalBasis};
pub use kinematics::dh::Kinematics;
pub use kinematics::ik_solution::IkSolution;
pub use kinematics::inverse::{IkReference, InverseKinematics};
pub use kinematics::numeric_inverse::NumericInverse;
pub use kinematics::spherical_wrist::SphericalWrist;
pub use model::{Baseline, RobotModel};
pub use pose_compensation::CompensatedPose;
pub use posture_report::PostureReport;
pub use published_postures::posture_deg;
