//! What only drilling has: the hole itself, its tolerances, and the contacts that hold the drilling tool.

pub mod contact;
#[cfg(test)]
mod drilling_tests;
pub mod flank_damping;
pub mod hole;
pub mod iso_tolerance;
pub mod margin;
pub mod whirling;
