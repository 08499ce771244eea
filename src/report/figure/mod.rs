//! Figures: each takes plain numbers and gives the bytes of a PNG image.
//!
//! The caller computes nothing graphical, a figure nothing physical. Numbers that are not finite are
//! left out; a figure with nothing left to show is an error that names it. Text uses an embedded font
//! (DejaVu Sans, see `fonts/LICENSE.txt`), so no system font is needed.

mod control_chart;
pub(crate) mod dynamics;
mod heat_map;
mod history;
pub(crate) mod machining;
mod parameters;
pub(crate) mod sheet;
mod side_by_side;

#[cfg(test)]
mod samples;
#[cfg(test)]
mod tests;

pub use control_chart::{ControlChartFigure, ControlPanel, ControlPoint, MOST_PANELS};
pub use dynamics::coherence::{CoherenceCurve, CoherenceFigure};
pub use dynamics::compass::CompassFigure;
pub use dynamics::drawn_curve::DrawnCurveFigure;
pub(crate) use dynamics::frf::lowest_phase;
pub use dynamics::frf::{FrfCurve, FrfFigure, NoiseLevel};
pub use dynamics::indicators::IndicatorFigure;
pub use dynamics::mode_shapes::{ModeShapesFigure, StickPicture};
pub use dynamics::nyquist::NyquistFigure;
pub use dynamics::resonances::{ResonanceFigure, ResonanceRow};
pub use dynamics::robot::{RobotFigure, posture_svg};
pub use dynamics::stabilisation::{StabilisationFigure, StabilisationPole};
pub use dynamics::wire::{WirePicture, WireShapesFigure};
pub use heat_map::{CellFormat, HeatMap};
pub use history::{HistoryFigure, HistoryMark};
pub use machining::force_record::{ForceRecord, ForceTrace};
pub use machining::hole::{HoleFigure, HolePanel};
pub use machining::lobes::{LobeMarker, LobeOutcome, LobePanel, LobeTrace, LobesFigure};
pub use machining::regression::{RegressionFigure, RegressionMark, RegressionSeries};
pub use machining::trend::TrendFigure;
pub use machining::waveform::{WaveformFigure, WaveformPanel};
pub use parameters::{DrawnEstimate, ParameterFigure, ParameterRow};
pub use side_by_side::{BarSeries, SideBySide};
