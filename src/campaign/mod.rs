//! A campaign folder: what was measured, where, and on what. SI values keep the unit of the file in their name.

pub mod schema;
pub use schema::*;

// STAND-IN, dropped at merge.
mod standin;
