//! The library of physical effects that a baseline cutting force model may lack: one file an effect, one registry.
//!
//! An effect states its parameters and writes them into the [`CutPhysics`] of a cut. The way from the chip to the file
//! is the same whatever effects there are, in this order:
//!
//! 1. geometry: chip thickness, with [`runout`](Runout) and [teeth that differ](OwnTeeth); depth, with what the force pushes off;
//! 2. force law: coefficients of this cut (speed, wear), size effect, chisel and margin of a drill;
//! 3. frame: the dynamometer's tilt against the tool;
//! 4. sensor dynamics, channel by channel;
//! 5. crosstalk between the channels;
//! 6. drift of each channel.
//!
//! Chatter adds lines off the tooth-passing comb. Derivatives come with the [`Dual`](crate::robot::Dual) numbers that all is written in.

pub(super) mod chatter;
pub(super) mod chisel_edge;
mod common;
pub(super) mod crosstalk;
mod domain;
pub(super) mod dynamometer_misalignment;
pub(super) mod dynamometer_resonance;
pub(super) mod edge_force;
pub(super) mod margin_friction;
pub(super) mod nonlinear_drift;
pub(super) mod push_off;
pub(super) mod size_effect;
pub(super) mod speed_dependence;
pub(super) mod teeth;
pub(super) mod tool_wear;

pub use domain::{CutPhysics, CutSetting, Cutting, CuttingSummary, Mixing, OwnTeeth, Runout, Vibration};
