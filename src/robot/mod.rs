//! The robot as a structure: kinematics, a chain of compliant elements, frequency response.

pub mod file;
pub mod spec;
pub use spec::*;
