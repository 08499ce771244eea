//! The library of physical effects that a baseline cutting force model may lack: one file an effect, one registry.
//!
//! An effect states its parameters and writes them into the [`CutPhysics`] of a cut. The way from the chip to the file
//! is the same whatever effects there are, in this order:
//!
//! 1. geometry: chip thickness, with [`runout`](Runout);
//! 2. force law: coefficients of this cut (speed, wear), size effect, chisel and margin of a drill;
//! 3. frame: the dynamometer's tilt against the tool;
//! 4. sensor dynamics, channel by channel;
//! 5. crosstalk between the channels;
//! 6. drift of each channel.
//!
//! Chatter adds lines off the tooth-passing comb. Derivatives come with the [`Dual`](crate::robot::Dual) numbers that all is written in.

mod chatter;
mod chisel_edge;
mod crosstalk;
mod dynamometer_misalignment;
mod dynamometer_resonance;
mod edge_force;
mod effect;
mod margin_friction;
mod nonlinear_drift;
mod registry;
mod runout;
mod size_effect;
mod speed_dependence;
mod tool_wear;

pub use effect::{
    CutPhysics, CutSetting, CuttingEffect, CuttingInstance, CuttingSummary, Mixing, Runout, Vibration,
};
pub use registry::{CUTTING, find, instances};
