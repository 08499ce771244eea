//! The structural model and tables of resonances.

pub mod modal_table;
pub mod resonance_study;
