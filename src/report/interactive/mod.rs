//! Figures that answer to the mouse: zoom, values under the pointer, cells that lead on.
//!
//! Each file here describes one kind of figure in the terms of plotly.js (<https://plotly.com/javascript/reference/>), from
//! the same plain numbers that the static figure of [`super::figure`] is drawn from. plotly.js itself lies next to them, without
//! what no figure here uses (`scripts/plotly_bundle.py`); `page.js` unpacks both and holds what little joins them: choosing an FRF, choosing a model.
//! Printed, and where scripts are off, the page shows the static figures.

mod drawn_curve;
mod explorer;
mod force_record;
mod frf;
mod heat_map;
mod lobes;
mod packed;
pub(super) mod plot;
mod regression;
mod robot;
mod surface;
mod waveform;

pub use explorer::{Explorer, stages};
pub(super) use packed::{Arrays, packed, plotly_js};
pub use plot::Plot;
pub use surface::Surface;

/// What joins figures and choices, as a whole `<script>`.
pub(super) const GLUE: &str = include_str!("page.js");
