//! Tables and folders for other programs.

pub(crate) mod batch_folder;
pub(crate) mod batch_table;
#[cfg(feature = "parquet")]
pub(crate) mod parquet_columns;
#[cfg(feature = "parquet")]
pub(crate) mod sweep_folder;
// Only the Parquet map of a sweep is summed up.
#[cfg_attr(not(feature = "parquet"), allow(dead_code))]
pub(crate) mod sweep_summary;
#[cfg(feature = "parquet")]
pub(crate) mod sweep_table;
#[cfg(feature = "parquet")]
pub(crate) mod tables;
