use num_complex::Complex64;

use super::super::finding::{SetupFinding, with_error};
use super::super::group::FrfGroup;
use super::super::mistake::{Distortion, Estimated, Mistake, MistakeSize};
use super::super::truth::Truth;
use super::sensor_high_pass::responses;
use crate::identify::frfs::frf_data::{FrfData, FrfDatum};

/// The response's amplifier is slow, value = 1/(2π × corner), s: 1/(1 + s·value), or Butterworth's second order. As long as
/// only its phase shows it is a time delay; this one is told by what it takes from the magnitudes.
pub struct AmplifierLowPass {
    pub order: i32,
}

impl Distortion for AmplifierLowPass {
    fn shown(&self, values: &[f64], _omega: f64, truth: &Truth, frf: &FrfDatum) -> Complex64 {
        let s = truth.rate * values[0];
        let divisor = match self.order {
            1 => 1.0 + s,
            _ => 1.0 + s * std::f64::consts::SQRT_2 + s * s,
        };
        truth.between(frf.response.axis, frf.reference.axis) / divisor
    }
}

impl Mistake for AmplifierLowPass {
    fn sizes(&self) -> Vec<MistakeSize> {
        vec![MistakeSize::positive(1e-3, 0.1)]
    }

    fn groups(&self, data: &FrfData) -> Vec<FrfGroup> {
        responses(data)
    }

    fn finding(&self, estimated: &Estimated) -> SetupFinding {
        let (time, error) = (estimated.values[0].max(1e-9), estimated.errors[0]);
        let corner = 1.0 / (std::f64::consts::TAU * time);
        let error = corner * error / time;
        SetupFinding {
            kind: "amplifier-low-pass",
            place: estimated.place(),
            value: Some(corner),
            std_error: Some(error),
            unit: "Hz",
            confidence: 0.0,
            remedy: format!(
                "Open the amplifier's filter, or filter the force channel alike: corner {} Hz, order {}.",
                with_error(corner, error),
                self.order
            ),
        }
    }
}
