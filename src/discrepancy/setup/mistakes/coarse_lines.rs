use super::super::finding::{SetupFinding, with_error};
use super::super::group::FrfGroup;
use super::super::mistake::{Distortion, Estimated, Mistake, MistakeSize};
use crate::identify::frfs::frf_data::FrfData;

/// Every line is a mean over its neighbourhood: records too short for the damping under a Hann window (leakage), or FRFs smoothed over
/// their lines. Square of the distance, Hz², that three lines of weights 1/6, 2/3, 1/6 are apart: those are the shares of power of a Hann
/// window's main lobe (Harris 1978: On the use of windows for harmonic analysis with the discrete Fourier transform), and any narrow mean
/// by its variance (three points after Gauss and Hermite).
pub struct CoarseLines;

impl Distortion for CoarseLines {
    fn spread(&self, values: &[f64]) -> Vec<(f64, f64)> {
        let apart = std::f64::consts::TAU * values[0].max(0.0).sqrt();
        vec![(2.0 / 3.0, 0.0), (1.0 / 6.0, apart), (1.0 / 6.0, -apart)]
    }
}

impl Mistake for CoarseLines {
    fn sizes(&self) -> Vec<MistakeSize> {
        // A fifth of a hertz is a record of five seconds.
        vec![MistakeSize::positive(0.05, 9.0)]
    }

    fn groups(&self, data: &FrfData) -> Vec<FrfGroup> {
        FrfGroup::postures(data)
    }

    fn finding(&self, estimated: &Estimated) -> SetupFinding {
        let apart_hz = estimated.values[0].max(0.0).sqrt();
        let error_hz = estimated.errors[0] / (2.0 * apart_hz.max(1e-6));
        SetupFinding {
            kind: "coarse-lines",
            place: estimated.place(),
            value: Some(apart_hz),
            std_error: Some(error_hz),
            unit: "Hz",
            confidence: 0.0,
            remedy: format!(
                "Each line is a mean over about ± {} Hz: record longer (a response has to die out in the block, or the damping comes out too \
                 high), or export FRFs that are not smoothed over their lines.",
                with_error(apart_hz, error_hz)
            ),
        }
    }
}
