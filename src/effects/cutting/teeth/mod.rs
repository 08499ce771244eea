//! Effects that make the teeth of a milling cutter differ.

pub(in crate::effects) mod runout;
pub(in crate::effects) mod tooth_radii;
pub(in crate::effects) mod uneven_pitch;
