//! How large a hidden effect is, and how plainly it shows.

pub(crate) mod imitation;
pub(crate) mod magnitude;
pub(crate) mod strength;
pub(crate) mod visibility;
