//! A campaign folder: what was measured, where, and on what. SI values keep the unit of the file in their name.

pub mod frf_set;
pub mod schema;
pub use frf_set::*;
pub use schema::*;
