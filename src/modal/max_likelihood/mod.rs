//! Common poles refined by maximum likelihood.

pub(crate) mod alike;
pub(crate) mod condense;
pub(crate) mod joint_fit;
pub(crate) mod ml_fit;
pub(crate) mod ml_linear;
mod needless;
