//! Coefficients from the averages of many cuts.

pub(crate) mod conic;
pub(crate) mod estimate;
pub(crate) mod group;
pub(crate) mod kienzle;
pub(crate) mod outlier;
pub(crate) mod regression;
pub(crate) mod series;
pub(crate) mod trend;
