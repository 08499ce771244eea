//! Effects in the joints themselves: gear, drive, bearing, temperature.

pub(crate) mod bearing_compliance;
pub(crate) mod counterbalance;
pub(crate) mod drive_dynamics;
pub(crate) mod hysteretic_damping;
pub(crate) mod thermal_drift;
