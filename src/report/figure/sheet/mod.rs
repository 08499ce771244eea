//! What figures are drawn on.

pub(crate) mod axis;
pub(crate) mod canvas;
pub(crate) mod panel;
pub(crate) mod style;
