//! The cutting model and its force records.

pub mod asynchronous_lines;
pub(crate) mod baseline_drift;
pub mod cutting_case;
pub mod cutting_data;
pub(crate) mod cutting_forces;
pub mod cutting_model;
pub mod cutting_problem;
pub mod cutting_study;
pub mod cutting_waves;
pub(crate) mod cutting_windows;
pub(crate) mod force_channel;
#[cfg(test)]
pub(crate) mod made_cuts;
mod noise_of_means;
