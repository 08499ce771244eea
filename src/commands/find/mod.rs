//! Find what the model lacks.

pub(crate) mod calibrate;
pub(crate) mod compare;
pub(crate) mod diagnose;
pub(crate) mod explain;
pub(crate) mod localise;
pub(crate) mod plan;
