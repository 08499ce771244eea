//! Figures of forces, lobes and holes.

pub(crate) mod force_record;
pub(crate) mod hole;
pub(crate) mod lobes;
pub(crate) mod regression;
pub(crate) mod trend;
pub(crate) mod waveform;
