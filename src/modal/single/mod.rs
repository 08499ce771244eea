//! One FRF by itself: peaks, then the fits at each.

pub(crate) mod analysis;
#[cfg(test)]
pub(crate) mod analysis_tests;
pub(crate) mod circle_fit;
pub(crate) mod curve;
pub(crate) mod frf_modes;
pub(crate) mod half_power;
pub(crate) mod local_fit;
#[cfg(test)]
pub(crate) mod marks;
pub(crate) mod method_bias;
pub(crate) mod peaks;
pub(crate) mod split_columns;
