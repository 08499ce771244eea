//! Model against measurement: how far apart, and where.

pub mod compare;
pub mod compare_cutting;
pub mod difference;
pub(crate) mod error_sums;
pub mod explained;
pub mod locate;
pub mod place;
