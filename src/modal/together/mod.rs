//! All FRFs of a set at once: candidates, noise, the modes that the FRFs together bear out.

pub(crate) mod findings;
#[cfg(test)]
pub(crate) mod foreign_marks;
pub(crate) mod global;
#[cfg(test)]
pub(crate) mod global_marks;
pub(crate) mod global_modes;
mod halves;
pub(crate) mod lscf;
pub(crate) mod own_places;
pub(crate) mod reconstruction;
pub(crate) mod select;
pub(crate) mod set_member;
pub(crate) mod set_noise;
pub(crate) mod solve;
pub(crate) mod verify;
