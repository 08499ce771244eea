//! The mistakes without a size, one file each, and which of them are worth a fit.

mod axes;
mod channel_sign;
mod dead_channel;
mod joint_angles;
mod joint_convention;
mod mistyped_angles;
mod phase_conjugated;
mod point_frame;
mod point_swap;
mod posture_swap;
mod promising;
mod proposal;
mod quantity;
mod reciprocal;
mod table;

pub use axes::Turn;
pub use promising::proposed;
pub use proposal::Proposed;
pub use table::distance;
