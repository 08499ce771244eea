//! A reading that may be right.

use super::super::reading::FileReading;

/// A reading with how much nearer the model comes by it.
pub struct Proposed {
    pub reading: Box<dyn FileReading>,
    /// In values that agreed not at all; from [`proposed`](super::proposed) as a share of all disagreement.
    pub gain: f64,
}
