//! Modal parameters from measured FRFs: peaks, then half-power, circle fit and a local rational fit at each
//! peak, then all FRFs of a posture together.
//!
//! Nothing is returned that was not found: a mode needs a peak that stands out of the noise, lies inside the
//! band, turns the right way round in the complex plane and whose fit converges there. What the lines cannot
//! tell is said in the standard deviation and in a warning.

use num_complex::Complex64;
use serde::Serialize;

mod alike;
mod analysis;
pub mod chosen;
mod circle_fit;
mod condense;
mod curve;
pub mod delay;
mod findings;
#[cfg(test)]
mod foreign_marks;
mod from_hits;
mod global;
#[cfg(test)]
mod global_marks;
mod half_power;
mod hits;
pub mod indicators;
mod joint_fit;
mod local_fit;
mod lscf;
#[cfg(test)]
mod marks;
mod ml_fit;
pub mod operational;
mod peaks;
pub mod quality;
pub mod scaling;
mod select;
mod set_noise;
pub mod shape;
mod sine_lines;
pub mod stabilisation;
#[cfg(test)]
mod synthetic;
pub mod tracking;
mod verify;

pub use analysis::{analyse_frf, analyse_frfs};
pub use from_hits::{Estimator, TapFrfs, TapRecord, TapSettings, frfs_from_hits};
pub use global::{SetMember, global};
pub use hits::Hit;
pub use sine_lines::{SineLine, sine_lines, without_sines};

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
    pub fn id(self) -> &'static str {
        match self {
            Method::LocalFit => "local-fit",
            Method::CircleFit => "circle-fit",
            Method::HalfPower => "half-power",
        }
    }
}

/// What to look at.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Settings {
    /// From, to in Hz; everything that was measured where `None`.
    pub band_hz: Option<[f64; 2]>,
    /// Highest order of the stabilisation diagram: poles sought in all FRFs together; from the number of peaks where `None`.
    /// What the lines determine (a third of them) is never exceeded.
    pub max_order: Option<usize>,
    pub tolerances: Tolerances,
}

/// How near a pole has to be to one of the order below to have stayed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerances {
    /// Relative change of frequency, at most.
    pub frequency: f64,
    /// Relative change of damping, at most.
    pub damping: f64,
    /// MAC of the residues over all FRFs, at least.
    pub mac: f64,
    /// Orders in a row over which a pole must stay.
    pub orders: usize,
}

impl Default for Tolerances {
    fn default() -> Self {
        Tolerances {
            frequency: stabilisation::FREQUENCY_TOLERANCE,
            damping: stabilisation::DAMPING_TOLERANCE,
            mac: stabilisation::MAC_TOLERANCE,
            orders: stabilisation::ORDERS,
        }
    }
}

/// One mode by one method.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModeEstimate {
    pub method: Method,
    /// Undamped natural frequency.
    pub frequency_hz: f64,
    /// Viscous damping ratio, > 0.
    pub damping_ratio: f64,
    /// From the residual of the fit; `None` where there were only just enough lines.
    pub frequency_std_hz: Option<f64>,
    pub damping_std: Option<f64>,
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
}

impl FrfMode {
    pub fn best(&self) -> &ModeEstimate {
        &self.estimates[0]
    }
}

/// All modes of one FRF.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FrfModes {
    /// Ascending in frequency.
    pub modes: Vec<FrfMode>,
    /// The FRF was recorded with the sign convention e^{−iωt} and was turned before the analysis.
    pub conjugated: bool,
    /// What changes the result.
    pub warnings: Vec<String>,
    /// What is usual and worth knowing: peaks that are no modes, coarse lines, methods that disagree.
    pub remarks: Vec<String>,
}

/// One mode of a set of FRFs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GlobalMode {
    pub frequency_hz: f64,
    pub damping_ratio: f64,
    /// From the noise that the common fit leaves (Cramér–Rao), raised where it leaves more than noise.
    pub frequency_std_hz: f64,
    pub damping_std: f64,
    /// Number of FRFs in which the mode stands out of the noise.
    pub found_in: usize,
    /// Spectral lines in the half-power band, 2ζf₀/Δf.
    pub lines_in_half_power_band: f64,
    /// How far the shape is from a standing wave; `None` for a single degree of freedom.
    pub complexity: Option<shape::Complexity>,
    /// Degree of freedom (as in [`SetMember::dofs`], or the FRF's index) and component; the largest is 1.
    #[serde(skip)]
    pub shape: Vec<(usize, Complex64)>,
    /// By FRF: modal constant φ_out φ_in, 1/kg, and the standard deviation of its real and imaginary part; `None` for
    /// an FRF that took no part.
    #[serde(skip)]
    pub constants: Vec<Option<(Complex64, f64)>>,
}

/// What the common modes say of one FRF.
#[derive(Debug, Clone, PartialEq)]
pub struct Reconstruction {
    /// sqrt(Σ|fitted − measured|² / Σ|measured|²) of the mobility: in receptance a robot's lowest mode alone would
    /// count, in accelerance its highest.
    pub error_nrms: f64,
    /// The same for the noise alone.
    pub noise_nrms: f64,
    pub frequency_hz: Vec<f64>,
    /// Turned where it was conjugated.
    pub measured_m_per_n: Vec<Complex64>,
    pub fitted_m_per_n: Vec<Complex64>,
}

/// A pole that was looked at and is not given as a mode.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RejectedMode {
    pub frequency_hz: f64,
    pub damping_ratio: f64,
    /// In plain words.
    pub reason: String,
}

/// All modes of a set of FRFs.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GlobalModes {
    /// Ascending in frequency.
    pub modes: Vec<GlobalMode>,
    /// What resembled a mode and is none, or none that these FRFs prove; ascending in frequency.
    pub rejected: Vec<RejectedMode>,
    /// Lines without a shape that were taken out before the fits.
    pub sine_lines: Vec<SineLine>,
    /// What the modes are worth.
    pub quality: quality::SetQuality,
    /// MAC of every two modes, from their residues in all FRFs.
    pub mac: Vec<Vec<f64>>,
    pub stabilisation: stabilisation::Stabilisation,
    /// By FRF; `None` for one that took no part (too few lines, zero).
    pub reconstructions: Vec<Option<Reconstruction>>,
    pub warnings: Vec<String>,
}

#[cfg(test)]
mod tests {
    use super::synthetic::{Mode, Synthetic};
    use super::*;

    const MODES: [Mode; 3] = [
        Mode {
            frequency_hz: 3.6,
            damping_ratio: 0.03,
            constant: 0.01,
        },
        Mode {
            frequency_hz: 12.0,
            damping_ratio: 0.03,
            constant: -0.01,
        },
        Mode {
            frequency_hz: 40.0,
            damping_ratio: 0.02,
            constant: 0.02,
        },
    ];

    fn analyse(case: Synthetic) -> FrfModes {
        let (f, h) = case.frf();
        analyse_frf(&f, &h, &Settings::default()).unwrap()
    }

    #[test]
    fn a_conjugated_frf_is_turned_and_that_is_said() {
        let (f, mut h) = Synthetic::new(3.0, 90.0, 0.1, &MODES)
            .with_noise(0.0, 0.02, 3)
            .frf();
        let right = analyse_frf(&f, &h, &Settings::default()).unwrap();
        h.iter_mut().for_each(|h| *h = h.conj());
        let turned = analyse_frf(&f, &h, &Settings::default()).unwrap();
        assert!(!right.conjugated && turned.conjugated);
        assert!(turned.warnings.iter().any(|w| w.contains("conjugated")));
        assert_eq!(right.modes.len(), 3);
        for (a, b) in right.modes.iter().zip(&turned.modes) {
            approx::assert_relative_eq!(
                a.best().damping_ratio,
                b.best().damping_ratio,
                max_relative = 1e-6
            );
        }
    }

    #[test]
    fn a_mode_of_negative_damping_is_named_and_left_out() {
        let unstable = Mode::new(25.0, -0.02, 0.01);
        let modes: Vec<Mode> = MODES.into_iter().chain([unstable]).collect();
        let found = analyse(Synthetic::new(3.0, 90.0, 0.1, &modes).with_noise(0.0, 0.02, 3));
        assert_eq!(found.modes.len(), 3);
        assert!(
            found
                .warnings
                .iter()
                .any(|w| w.contains("25.0") && w.contains("negative damping")),
            "{:?}",
            found.warnings
        );
    }

    #[test]
    fn nothing_is_found_in_noise_or_in_a_line() {
        for seed in 0..20 {
            // Only the foot of a far mode, under 20 % noise.
            let found = analyse(
                Synthetic::new(0.0, 90.0, 0.1, &[Mode::new(900.0, 0.02, 1.0)]).with_noise(0.2, 0.0, seed),
            );
            assert!(found.modes.is_empty(), "seed {seed}: {:?}", found.modes);
        }
        // A free mass, with its infinite receptance at 0 Hz.
        let f: Vec<f64> = (0..400).map(|k| 0.1 * f64::from(k)).collect();
        let h: Vec<Complex64> = f.iter().map(|f| Complex64::new(-1.0 / (f * f), 0.0)).collect();
        assert!(
            analyse_frf(&f, &h, &Settings::default())
                .unwrap()
                .modes
                .is_empty()
        );
    }

    #[test]
    fn modes_outside_the_band_are_not_reported() {
        let (f, h) = Synthetic::new(3.0, 90.0, 0.1, &MODES).frf();
        let settings = Settings {
            band_hz: Some([5.0, 30.0]),
            ..Settings::default()
        };
        let found = analyse_frf(&f, &h, &settings).unwrap();
        assert_eq!(found.modes.len(), 1);
        approx::assert_relative_eq!(found.modes[0].best().frequency_hz, 12.0, max_relative = 1e-4);
    }

    #[test]
    fn the_modal_constant_is_that_of_the_mode() {
        let found = analyse(Synthetic::new(3.0, 90.0, 0.1, &MODES));
        for (found, mode) in found.modes.iter().zip(&MODES) {
            let constant = found.best().modal_constant.unwrap();
            approx::assert_relative_eq!(constant.re, mode.constant, max_relative = 0.01);
            assert!(constant.im.abs() < 0.01 * mode.constant.abs());
        }
    }

    #[test]
    fn lines_too_coarse_for_the_damping_are_said() {
        let found =
            analyse(Synthetic::new(3.0, 90.0, 0.5, &[Mode::new(12.3, 0.01, 1.0)]).with_noise(0.02, 0.0, 5));
        assert_eq!(found.modes.len(), 1);
        let best = found.modes[0].best();
        assert!((best.damping_ratio - 0.01).abs() < 4.0 * best.damping_std.unwrap());
        assert!(
            found.remarks.iter().any(|w| w.contains("too coarse lines")),
            "{:?}",
            found.remarks
        );
    }

    #[test]
    fn constant_zero_and_short_curves_are_no_trouble() {
        for n in [0, 1, 5, 9, 300] {
            let f: Vec<f64> = (0..n).map(f64::from).collect();
            for value in [0.0, 1.0, 1e-300, 1e300] {
                let h = vec![Complex64::new(value, value); f.len()];
                let found = analyse_frf(&f, &h, &Settings::default()).unwrap();
                assert!(found.modes.is_empty());
            }
        }
    }

    /// With less effort on each of many FRFs every mode is found all the same.
    #[test]
    fn many_frfs_are_analysed_as_one_is() {
        let frfs: Vec<(Vec<f64>, Vec<Complex64>)> = (0..41)
            .map(|seed| {
                Synthetic::new(3.0, 90.0, 0.1, &MODES)
                    .with_noise(0.0, 0.02, seed)
                    .frf()
            })
            .collect();
        let settings = Settings::default();
        for many in [&frfs[..], &frfs[..3]] {
            for found in analyse_frfs(many, &settings).unwrap() {
                assert_eq!(found.modes.len(), 3);
                for (found, mode) in found.modes.iter().zip(&MODES) {
                    let best = found.best();
                    assert!(
                        (best.damping_ratio - mode.damping_ratio).abs() < 5.0 * best.damping_std.unwrap(),
                        "{best:?}"
                    );
                }
            }
        }
        let mut wrong = frfs;
        wrong[7].0.swap(2, 3);
        assert!(analyse_frfs(&wrong, &settings).is_err());
    }
}
