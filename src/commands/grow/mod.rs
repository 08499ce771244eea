//! Grow the model.

pub(crate) mod add;
pub(crate) mod history;
pub(crate) mod model;
pub(crate) mod undo;
