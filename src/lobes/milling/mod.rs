//! Milling with its true dependence on time.

pub(crate) mod arnoldi;
#[cfg(test)]
pub(crate) mod milling_tests;
pub mod multi_frequency;
pub mod periodic_force;
pub mod semi_discretisation;
pub mod state_space;
