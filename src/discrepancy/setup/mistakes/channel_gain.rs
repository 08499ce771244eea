use num_complex::Complex64;

use super::super::finding::{SetupFinding, with_error};
use super::super::group::FrfGroup;
use super::super::mistake::{Distortion, Estimated, Mistake, MistakeSize};
use super::super::truth::Truth;
use crate::identify::frfs::frf_data::{FrfData, FrfDatum};

/// The file holds exp(value) times what was there.
pub struct ChannelGain;

impl Distortion for ChannelGain {
    fn shown(&self, values: &[f64], _omega: f64, truth: &Truth, frf: &FrfDatum) -> Complex64 {
        truth.between(frf.response.axis, frf.reference.axis) * values[0].exp()
    }
}

impl Mistake for ChannelGain {
    fn sizes(&self) -> Vec<MistakeSize> {
        vec![MistakeSize::either_way(0.5, 10.0)]
    }

    fn groups(&self, data: &FrfData) -> Vec<FrfGroup> {
        FrfGroup::channels(data)
    }

    fn finding(&self, estimated: &Estimated) -> SetupFinding {
        let factor = estimated.values[0].exp();
        let error = factor * estimated.errors[0];
        SetupFinding {
            kind: "channel-gain",
            place: estimated.place(),
            value: Some(factor),
            std_error: Some(error),
            unit: "1",
            confidence: 0.0,
            remedy: format!(
                "Check the sensitivities of sensor, hammer and amplifier: these FRFs are {} times what they should be.",
                with_error(factor, error)
            ),
        }
    }
}
