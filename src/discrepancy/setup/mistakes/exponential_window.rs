use super::super::finding::{SetupFinding, with_error};
use super::super::group::FrfGroup;
use super::super::mistake::{Distortion, Estimated, Mistake, MistakeSize};
use crate::identify::frfs::frf_data::FrfData;

/// An exponential window was put on the records and not taken out: every pole decays faster by `value`, 1/s. What the file
/// shows is H(ω − i/τ) (Fladung, Rost 1997: Application and correction of the exponential window for frequency response
/// functions).
pub struct ExponentialWindow;

impl Distortion for ExponentialWindow {
    fn decay_per_s(&self, values: &[f64]) -> f64 {
        values[0]
    }
}

impl Mistake for ExponentialWindow {
    fn sizes(&self) -> Vec<MistakeSize> {
        vec![MistakeSize::positive(5.0, 100.0)]
    }

    fn groups(&self, data: &FrfData) -> Vec<FrfGroup> {
        FrfGroup::postures(data)
    }

    fn finding(&self, estimated: &Estimated) -> SetupFinding {
        let (rate, error) = (estimated.values[0], estimated.errors[0]);
        let time = 1.0 / rate.max(1e-9);
        SetupFinding {
            kind: "exponential-window",
            place: estimated.place(),
            value: Some(rate),
            std_error: Some(error),
            unit: "1/s",
            confidence: 0.0,
            remedy: format!(
                "Take the window's decay out of the damping, or export FRFs without it: its time constant is {} s.",
                with_error(time, time * error / rate.max(1e-9))
            ),
        }
    }
}
