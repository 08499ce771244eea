//! Φ(iω) at the tool: of modes, of the robot model, of measured lines, with the tool as a beam.

pub mod feed_stiffness;
pub mod frf;
pub mod poles;
pub mod robot;
pub mod sampled;
pub mod tool_beam;
pub mod tool_point;
