use num_complex::Complex64;

use super::super::finding::{SetupFinding, with_error};
use super::super::group::FrfGroup;
use super::super::mistake::{Distortion, Estimated, Mistake, MistakeSize};
use super::super::truth::Truth;
use crate::data::Axis;
use crate::identify::frfs::frf_data::{FrfData, FrfDatum};

/// The sensor's channel loses low frequencies: (s/(s + value))^order, value = 2π × corner, 1/s.
pub struct SensorHighPass {
    pub order: i32,
}

impl Distortion for SensorHighPass {
    fn shown(&self, values: &[f64], _omega: f64, truth: &Truth, frf: &FrfDatum) -> Complex64 {
        let factor = truth.rate / (truth.rate + values[0]);
        truth.between(frf.response.axis, frf.reference.axis) * factor.powi(self.order)
    }
}

impl Mistake for SensorHighPass {
    fn sizes(&self) -> Vec<MistakeSize> {
        vec![MistakeSize::positive(10.0, 200.0)]
    }

    fn groups(&self, data: &FrfData) -> Vec<FrfGroup> {
        responses(data)
    }

    fn finding(&self, estimated: &Estimated) -> SetupFinding {
        let tau = std::f64::consts::TAU;
        let (corner, error) = (estimated.values[0] / tau, estimated.errors[0] / tau);
        SetupFinding {
            kind: "sensor-high-pass",
            place: estimated.place(),
            value: Some(corner),
            std_error: Some(error),
            unit: "Hz",
            confidence: 0.0,
            remedy: format!(
                "Use DC coupling or a sensor that reaches lower, or divide the FRFs by the sensor's response: corner {} Hz, \
                 order {}.",
                with_error(corner, error),
                self.order
            ),
        }
    }
}

/// All files, each posture, each response axis, each response node.
pub(super) fn responses(data: &FrfData) -> Vec<FrfGroup> {
    let mut groups = FrfGroup::postures(data);
    groups.extend(Axis::ALL.map(|axis| FrfGroup {
        response_axis: Some(axis),
        ..FrfGroup::ALL
    }));
    let points = data.response_points();
    if points.len() > 1 {
        groups.extend(points.into_iter().map(|p| FrfGroup {
            response_point: Some(p),
            ..FrfGroup::ALL
        }));
    }
    groups.retain(|g| data.frfs().any(|(_, f)| g.holds(f)));
    groups
}
