//! A mode known from responses alone.

use num_complex::Complex64;
use serde::Serialize;

use crate::modal::shape::Complexity;

/// One mode found from responses alone.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OperationalMode {
    /// Undamped natural frequency, Hz.
    pub frequency_hz: f64,
    /// Viscous damping ratio.
    pub damping_ratio: f64,
    /// Standard deviation of the frequency, Hz.
    pub frequency_std_hz: f64,
    /// Standard deviation of the damping ratio.
    pub damping_std: f64,
    /// Orders at which the pole stays.
    pub orders: usize,
    /// How far the shape is from a standing wave; `None` for a single channel.
    pub complexity: Option<Complexity>,
    /// By channel, the largest component 1; unscaled: without the force there is no modal mass.
    #[serde(skip)]
    pub shape: Vec<Complex64>,
    /// Why this may be no mode of the structure, in words; empty for one without doubt.
    pub doubts: Vec<String>,
}
