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

pub use crate::report::figure::dynamics::coherence::{CoherenceCurve, CoherenceFigure};
pub use crate::report::figure::dynamics::compass::CompassFigure;
pub use crate::report::figure::dynamics::drawn_curve::DrawnCurveFigure;
pub(crate) use crate::report::figure::dynamics::frf::lowest_phase;
pub use crate::report::figure::dynamics::frf::{FrfCurve, FrfFigure, NoiseLevel};
pub use crate::report::figure::dynamics::indicators::IndicatorFigure;
pub use crate::report::figure::dynamics::mode_shapes::{ModeShapesFigure, StickPicture};
pub use crate::report::figure::dynamics::nyquist::NyquistFigure;
pub use crate::report::figure::dynamics::resonances::{ResonanceFigure, ResonanceRow};
pub use crate::report::figure::dynamics::robot::{RobotFigure, posture_svg};
pub use crate::report::figure::dynamics::stabilisation::{StabilisationFigure, StabilisationPole};
pub use crate::report::figure::dynamics::wire::{WirePicture, WireShapesFigure};
pub use crate::report::figure::machining::force_record::{ForceRecord, ForceTrace};
pub use crate::report::figure::machining::hole::{HoleFigure, HolePanel};
pub use crate::report::figure::machining::lobes::{
    LobeMarker, LobeOutcome, LobePanel, LobeTrace, LobesFigure,
};
pub use crate::report::figure::machining::regression::{RegressionFigure, RegressionMark, RegressionSeries};
pub use crate::report::figure::machining::waveform::{WaveformFigure, WaveformPanel};
pub use control_chart::{ControlChartFigure, ControlPanel, ControlPoint, MOST_PANELS};
pub use heat_map::{CellFormat, HeatMap};
pub use history::{HistoryFigure, HistoryMark};
pub use parameters::{DrawnEstimate, ParameterFigure, ParameterRow};
pub use side_by_side::{BarSeries, SideBySide};
