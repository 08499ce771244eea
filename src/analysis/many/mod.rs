//! Many campaigns: in shards, robot by robot over time.

pub mod batch;
pub mod control_chart;
pub mod fleet;
pub(crate) mod shard;
