//! What a modal analysis looks at.

use super::stabilisation::Tolerances;

/// So many FRFs are a set, whose modes are those that its FRFs show together: one seen by a single FRF must stand out far.
pub(crate) const SET: usize = 4;

/// What to look at.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Settings {
    /// From, to in Hz; everything that was measured where `None`.
    pub band_hz: Option<[f64; 2]>,
    /// Highest order of the stabilisation diagram: poles sought in all FRFs together; from the number of peaks where `None`.
    /// What the lines determine (a third of them) is never exceeded.
    pub max_order: Option<usize>,
    /// The modes of each FRF are asked for, and not only as starts of those that all have together: each is fitted as well as it can
    /// be, however many there are.
    pub each: bool,
    /// When a pole counts as having stayed from one order to the next.
    pub tolerances: Tolerances,
}
