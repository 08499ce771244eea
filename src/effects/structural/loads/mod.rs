//! Loads on the flange.

pub(crate) mod payload;
pub(crate) mod payload_inertia;
