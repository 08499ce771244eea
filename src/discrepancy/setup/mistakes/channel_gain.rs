use num_complex::Complex64;

use super::super::finding::{SetupFinding, with_error};
use super::super::group::FrfGroup;
use super::super::mistake::{Distortion, Estimated, Mistake, MistakeSize};
use super::super::truth::Truth;
use crate::identify::frfs::frf_data::{FrfData, FrfDatum};

/// Units that are mixed up, by what the FRFs come out too large by.
const UNITS: [(f64, &str); 10] = [
    (1e3, "mm called m"),
    (1e-3, "m called mm"),
    (1e6, "µm called m"),
    (1e-6, "m called µm"),
    (9.806_65, "m/s² called g"),
    (1.0 / 9.806_65, "g called m/s²"),
    (4.448_221_6, "N called lbf"),
    (1.0 / 4.448_221_6, "lbf called N"),
    (25.4, "mm called inch"),
    (1.0 / 25.4, "inch called mm"),
];
/// A factor this near to one of them is no accident.
const NEAR: f64 = 0.01;

/// `: mm called m?`
fn suspected(factor: f64) -> String {
    let unit = UNITS.iter().find(|(of, _)| (factor / of - 1.0).abs() < NEAR);
    unit.map_or_else(String::new, |(_, what)| format!(" ({what}?)"))
}

/// The file holds exp(value) times what was there.
pub struct ChannelGain;

impl Distortion for ChannelGain {
    fn shown(&self, values: &[f64], _omega: f64, truth: &Truth, frf: &FrfDatum) -> Complex64 {
        truth.between(frf.response.axis, frf.reference.axis) * values[0].exp()
    }
}

impl Mistake for ChannelGain {
    fn sizes(&self) -> Vec<MistakeSize> {
        // Up to a factor of 9e6: micrometres called metres.
        vec![MistakeSize::either_way(0.5, 16.0)]
    }

    fn beyond_the_first_order(&self, values: &mut [f64]) {
        // To the first order a factor of a thousand is a logarithm of 999.
        values[0] = values[0].max(1e-6 - 1.0).ln_1p();
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
                "Check the units and the sensitivities of sensor, hammer and amplifier: these FRFs are {} times what they should be{}.",
                with_error(factor, error),
                suspected(factor)
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factor_of_units_is_called_by_them() {
        assert_eq!(suspected(1000.4), " (mm called m?)");
        assert_eq!(suspected(9.808), " (m/s² called g?)");
        assert_eq!(suspected(1.3), "");
        let mut linear = [999.0];
        ChannelGain.beyond_the_first_order(&mut linear);
        assert!((linear[0] - 1000.0_f64.ln()).abs() < 1e-12);
    }
}
