//! Figures: each takes plain numbers and gives the bytes of a PNG image.
//!
//! The caller computes nothing graphical, a figure nothing physical. Numbers that are not finite are
//! left out; a figure with nothing left to show is an error that names it. Text uses an embedded font
//! (DejaVu Sans, see `fonts/LICENSE.txt`), so no system font is needed.

pub(crate) mod axis;
pub(crate) mod canvas;
mod panel;
pub(crate) mod style;

mod coherence;
mod compass;
mod control_chart;
mod drawn_curve;
pub(crate) mod force_record;
mod frf;
mod heat_map;
mod history;
mod hole;
mod indicators;
pub(crate) mod lobes;
mod mode_shapes;
mod nyquist;
mod parameters;
mod regression;
mod resonances;
mod robot;
mod side_by_side;
mod stabilisation;
mod waveform;
mod wire;

#[cfg(test)]
mod samples;
#[cfg(test)]
mod tests;

pub use coherence::{CoherenceCurve, CoherenceFigure};
pub use compass::CompassFigure;
pub use control_chart::{ControlChartFigure, ControlPanel, ControlPoint, MOST_PANELS};
pub use drawn_curve::DrawnCurveFigure;
pub use force_record::{ForceRecord, ForceTrace};
pub(crate) use frf::lowest_phase;
pub use frf::{FrfCurve, FrfFigure, NoiseLevel};
pub use heat_map::{CellFormat, HeatMap};
pub use history::{HistoryFigure, HistoryMark};
pub use hole::{HoleFigure, HolePanel};
pub use indicators::IndicatorFigure;
pub use lobes::{LobeMarker, LobeOutcome, LobePanel, LobeTrace, LobesFigure};
pub use mode_shapes::{ModeShapesFigure, StickPicture};
pub use nyquist::NyquistFigure;
pub use parameters::{DrawnEstimate, ParameterFigure, ParameterRow};
pub use regression::{RegressionFigure, RegressionMark, RegressionSeries};
pub use resonances::{ResonanceFigure, ResonanceRow};
pub use robot::{RobotFigure, posture_svg};
pub use side_by_side::{BarSeries, SideBySide};
pub use stabilisation::{StabilisationFigure, StabilisationPole};
pub use waveform::{WaveformFigure, WaveformPanel};
pub use wire::{WirePicture, WireShapesFigure};
