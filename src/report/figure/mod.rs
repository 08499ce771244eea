//! Figures: each takes plain numbers and gives the bytes of a PNG image.
//!
//! The caller computes nothing graphical, a figure nothing physical. Numbers that are not finite are
//! left out; a figure with nothing left to show is an error that names it. Text uses an embedded font
//! (DejaVu Sans, see `fonts/LICENSE.txt`), so no system font is needed.

pub(in crate::report) mod axis;
pub(in crate::report) mod canvas;
mod panel;
pub(in crate::report) mod style;

mod coherence;
mod compass;
mod control_chart;
mod drawn_curve;
pub(in crate::report) mod force_record;
mod frf;
mod heat_map;
mod history;
mod hole;
mod indicators;
pub(in crate::report) mod lobes;
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
pub use force_record::{ForceChannel, ForceRecord};
pub(in crate::report) use frf::lowest_phase;
pub use frf::{FrfCurve, FrfFigure, NoiseLevel};
pub use heat_map::{CellFormat, HeatMap};
pub use history::{HistoryFigure, Revision};
pub use hole::{HoleFigure, HolePanel};
pub use indicators::IndicatorFigure;
pub use lobes::{LobeCurve, LobeMarker, LobeOutcome, LobePanel, LobesFigure};
pub use mode_shapes::{ModeShapesFigure, StickPicture};
pub use nyquist::NyquistFigure;
pub use parameters::{Estimate, ParameterFigure, ParameterRow};
pub use regression::{RegressionFigure, RegressionPoint, RegressionSeries};
pub use resonances::{ResonanceFigure, ResonanceRow};
pub use robot::{RobotFigure, posture_svg};
pub use side_by_side::{BarSeries, SideBySide};
pub use stabilisation::{StabilisationFigure, StabilisationPole};
pub use waveform::{WaveformFigure, WaveformPanel};
pub use wire::{WirePicture, WireShapesFigure};

use crate::Error;

/// All figures are this wide.
const WIDTH: u32 = 1200;

fn nothing_to_draw(title: &str, what: &str) -> Error {
    Error::computation(format!("figure \"{title}\" has nothing to draw: {what}"))
}
