//! The modes that a set of FRFs has in common.

use num_complex::Complex64;
use serde::Serialize;

use crate::modal::quality::SetQuality;
use crate::modal::shape::Complexity;
use crate::modal::sine_lines::SineLine;
use crate::modal::single::local_fit::Pole;
use crate::modal::stabilisation::Stabilisation;
use crate::modal::together::reconstruction::Reconstruction;

/// One mode of a set of FRFs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GlobalMode {
    /// Undamped natural frequency, Hz.
    pub frequency_hz: f64,
    /// Viscous damping ratio.
    pub damping_ratio: f64,
    /// From the noise that the common fit leaves (Cramér–Rao), raised where it leaves more than noise.
    pub frequency_std_hz: f64,
    /// Standard deviation of the damping ratio, likewise.
    pub damping_std: f64,
    /// Number of FRFs in which the mode stands out of the noise.
    pub found_in: usize,
    /// Spectral lines in the half-power band, 2ζf₀/Δf.
    pub lines_in_half_power_band: f64,
    /// How far the shape is from a standing wave; `None` for a single degree of freedom.
    pub complexity: Option<Complexity>,
    /// Degree of freedom (as in [`crate::modal::SetMember::dofs`], or the FRF's index) and component; the largest is 1.
    #[serde(skip)]
    pub shape: Vec<(usize, Complex64)>,
    /// By FRF: modal constant φ_out φ_in, 1/kg, and the standard deviation of its real and imaginary part; `None` for
    /// an FRF that took no part.
    #[serde(skip)]
    pub constants: Vec<Option<(Complex64, f64)>>,
}

/// A pole that was looked at and is not given as a mode.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RejectedMode {
    /// Frequency of the pole, Hz.
    pub frequency_hz: f64,
    /// Its damping ratio.
    pub damping_ratio: f64,
    /// In plain words.
    pub reason: String,
}

impl RejectedMode {
    pub(crate) fn new(pole: &Pole, reason: impl Into<String>) -> RejectedMode {
        RejectedMode {
            frequency_hz: pole.frequency_hz,
            damping_ratio: pole.damping_ratio,
            reason: reason.into(),
        }
    }
}

/// All modes of a set of FRFs.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GlobalModes {
    /// Ascending in frequency.
    pub modes: Vec<GlobalMode>,
    /// What resembled a mode but is not one, or is not one that these FRFs prove; ascending in frequency.
    pub rejected: Vec<RejectedMode>,
    /// Lines without a shape that were taken out before the fits.
    pub sine_lines: Vec<SineLine>,
    /// What the modes are worth.
    pub quality: SetQuality,
    /// MAC of every two modes, of their shapes.
    pub mac: Vec<Vec<f64>>,
    /// Poles of all orders, and those that stayed.
    pub stabilisation: Stabilisation,
    /// By FRF; `None` for one that took no part (too few lines, zero).
    pub reconstructions: Vec<Option<Reconstruction>>,
    /// What changes the result, in words.
    pub warnings: Vec<String>,
}
