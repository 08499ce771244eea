//! Lobestone fits physical models of machining robots to measurements and shows where they fail.
//!
//! Data flows one way: [`ingest`] → [`campaign`] → [`robot`] and [`cutting`] → [`identify`] →
//! [`discrepancy`] → [`lobes`] → [`report`]. A module knows nothing of the ones after it.

pub mod analysis;
pub mod builtin;
pub mod campaign;
pub mod commands;
pub mod cutting;
pub mod data;
pub mod discrepancy;
pub mod effects;
pub mod error;
pub(crate) mod files;
pub mod identify;
pub mod ingest;
pub mod lobes;
pub mod modal;
pub mod parameter;
pub mod progress;
pub mod report;
pub mod revision;
pub mod robot;
pub(crate) mod serve;
pub mod signal;
pub mod simulate;
pub mod stop;
pub mod text;
pub mod thesis;

pub use error::{Error, InputError, Result};

/// Keeps each decomposition and each product of dense matrices on one thread: split over threads their sums would run in
/// another order, and results would differ in the last digits with the number of threads. (The loops around them run in
/// parallel.)
pub fn sums_in_order() {
    faer::set_global_parallelism(faer::Par::Seq);
}
