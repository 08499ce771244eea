//! The modes of one FRF, by each method.

use num_complex::Complex64;
use serde::Serialize;

/// How a modal parameter was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Poles and residual terms fitted to the complex mobility around the peak.
    LocalFit,
    /// Angular sweep on the Nyquist circle of the mobility.
    CircleFit,
    /// Half-power width of |mobility|, crossings interpolated.
    HalfPower,
}

impl Method {
    /// As in JSON and tables.
    pub fn id(self) -> &'static str {
        match self {
            Method::LocalFit => "local-fit",
            Method::CircleFit => "circle-fit",
            Method::HalfPower => "half-power",
        }
    }
}

/// One mode by one method.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModeEstimate {
    /// How it was found.
    pub method: Method,
    /// Undamped natural frequency.
    pub frequency_hz: f64,
    /// Viscous damping ratio, > 0.
    pub damping_ratio: f64,
    /// From the residual of the fit, and what neighbours and residual do to the method (`frequency_bias_hz`) on top; `None`
    /// where there were only just enough lines.
    pub frequency_std_hz: Option<f64>,
    /// Standard deviation of the damping ratio, from the same residual, and `damping_bias` on top.
    pub damping_std: Option<f64>,
    /// By how much the method is off on the curve that the local fit has found, where that is known (simpler methods only).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frequency_bias_hz: Option<f64>,
    /// The same of the damping ratio.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub damping_bias: Option<f64>,
    /// Circle fit: standard deviation of ζ over the point pairs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub damping_spread: Option<f64>,
    /// Modal constant φ_out φ_in for mass-normalised modes, 1/kg (complex: real for a real mode).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub modal_constant: Option<Complex64>,
    /// Half-power: only one crossing was measured, the other is the fitted curve's.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub one_sided: bool,
}

/// One mode of one FRF.
#[derive(Debug, Clone, PartialEq)]
pub struct FrfMode {
    /// Best method first (local fit, circle fit, half-power); never empty.
    pub estimates: Vec<ModeEstimate>,
    /// Spectral lines in the half-power band, 2ζf₀/Δf.
    pub lines_in_half_power_band: f64,
    /// Prominence of the peak over the noise's standard deviation.
    pub significance: f64,
    /// A simpler method gave another answer than the local fit and was left out.
    pub contradicted: bool,
    /// What makes half-power or circle fit wrong here; `None` where they stand.
    pub disturbance: Option<Disturbance>,
    /// The answer to take, of those in `estimates`.
    pub recommended: Method,
    /// Why that one, for people.
    pub reason: String,
}

/// What makes the methods of one mode wrong at a peak.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Disturbance {
    /// Another mode lies close.
    Overlap,
    /// The flanks of modes farther away bend the circle and lift one flank of the peak.
    Residual,
}

impl Disturbance {
    /// For people.
    pub fn words(self) -> &'static str {
        match self {
            Disturbance::Overlap => "modes overlap",
            Disturbance::Residual => "the residual of other modes bends the circle",
        }
    }
}

impl FrfMode {
    /// The estimate of the best method.
    pub fn best(&self) -> &ModeEstimate {
        &self.estimates[0]
    }
}

/// All modes of one FRF.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FrfModes {
    /// Ascending in frequency.
    pub modes: Vec<FrfMode>,
    /// Peaks whose lines determine no mode: a ripple of a line or two, a pole that could be anywhere. Other FRFs of the set may
    /// say what they are; the remarks name them. Ascending in frequency.
    pub undetermined: Vec<FrfMode>,
    /// One of many FRFs, fitted with less effort as a start for the modes that all have together: the errors of its modes leave out what
    /// neighbours do to them.
    pub brief: bool,
    /// The FRF was recorded with the sign convention e^{−iωt} and was turned before the analysis.
    pub conjugated: bool,
    /// What changes the result.
    pub warnings: Vec<String>,
    /// What is usual and worth knowing: peaks that are no modes, coarse lines, methods that disagree.
    pub remarks: Vec<String>,
}

impl FrfModes {
    /// Leaves out the errors that a brief fit does not know, and says where they are to be had.
    pub(crate) fn leave_out_unknown_errors(&mut self) {
        if !self.brief {
            return;
        }
        for mode in &mut self.modes {
            for estimate in &mut mode.estimates {
                (estimate.frequency_std_hz, estimate.damping_std) = (None, None);
                (estimate.frequency_bias_hz, estimate.damping_bias) = (None, None);
            }
            mode.recommended = mode.best().method;
            mode.reason = "one of many FRFs, fitted briefly as a start for all of them together, whose modes are to be taken; --each fits \
                           every FRF by itself, with errors"
                .into();
        }
    }

    /// The modes and the peaks that may be some: what an analysis together with other FRFs begins with.
    pub(crate) fn peaks(&self) -> impl Iterator<Item = &FrfMode> {
        self.modes.iter().chain(&self.undetermined)
    }
}
