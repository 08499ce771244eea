use num_complex::Complex64;

use super::super::finding::{SetupFinding, with_error};
use super::super::group::FrfGroup;
use super::super::mistake::{Distortion, Estimated, Mistake, MistakeSize, turned_axis};
use super::super::truth::Truth;
use crate::identify::frfs::frf_data::{FrfData, FrfDatum};

/// The sensor stood askew at one posture or at one node: turned by a rotation vector, deg about x, y, z. A sensor that is
/// askew in all files is the effect `sensor-misalignment`.
pub struct TurnedSensor;

impl Distortion for TurnedSensor {
    fn shown(&self, values: &[f64], _omega: f64, truth: &Truth, frf: &FrfDatum) -> Complex64 {
        let direction = turned_axis(frf.response.axis, values);
        let terms = crate::data::Axis::ALL.into_iter().zip(direction);
        terms
            .map(|(axis, part)| truth.between(axis, frf.reference.axis) * part)
            .sum()
    }
}

impl Mistake for TurnedSensor {
    fn sizes(&self) -> Vec<MistakeSize> {
        vec![MistakeSize::either_way(5.0, 60.0); 3]
    }

    fn groups(&self, data: &FrfData) -> Vec<FrfGroup> {
        let mut groups = FrfGroup::postures(data);
        let points = data.response_points();
        if points.len() > 1 {
            groups.extend(points.into_iter().map(|p| FrfGroup {
                response_point: Some(p),
                ..FrfGroup::ALL
            }));
        }
        groups.retain(|g| *g != FrfGroup::ALL);
        groups
    }

    fn finding(&self, estimated: &Estimated) -> SetupFinding {
        let (angle, error) = estimated.length();
        SetupFinding {
            kind: "axes",
            place: format!("{}, sensor", estimated.place()),
            value: Some(angle),
            std_error: Some(error),
            unit: "deg",
            confidence: 0.0,
            remedy: format!(
                "Set the sensor straight there: it was turned by {} deg, rotation vector ({:.2}, {:.2}, {:.2}) deg about the \
                 node's axes.",
                with_error(angle, error),
                estimated.values[0],
                estimated.values[1],
                estimated.values[2]
            ),
        }
    }
}
