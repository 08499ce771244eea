//! Many campaigns.

pub(crate) mod batch;
pub(crate) mod fleet;
