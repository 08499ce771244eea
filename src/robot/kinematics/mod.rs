//! Where the tool is for joint angles, and the way back.

pub mod dh;
pub(crate) mod ik_solution;
pub mod inverse;
pub mod numeric_inverse;
pub mod spherical_wrist;
