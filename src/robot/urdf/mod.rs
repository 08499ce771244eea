//! Robots from URDF files (the robot description of ROS) and back.
//!
//! A URDF has geometry and rigid bodies. It has no compliances and no damping: those of a robot that is read here are
//! guesses, said to be guesses in the robot file ([`guess`]).

mod body;
pub mod guess;
mod read;
mod tree;
mod write;

pub use read::{Request, UrdfRobot, read};
pub use write::{Sources, compliances, urdf};
