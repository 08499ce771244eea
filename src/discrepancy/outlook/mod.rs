//! What to measure next, and what it would say.

pub mod lab;
pub mod next_cut;
pub mod next_measurement;
pub(crate) mod noise_outlook;
pub mod plan;
pub mod prospect;
