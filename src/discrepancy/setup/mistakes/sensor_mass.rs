use nalgebra::Matrix3;
use num_complex::Complex64;

use super::super::finding::{SetupFinding, with_error};
use super::super::group::FrfGroup;
use super::super::mistake::{Distortion, Estimated, Mistake, MistakeSize, Pushed};
use super::super::truth::Truth;
use crate::identify::frfs::frf_data::{FrfData, FrfDatum};

/// The sensor's mass, kg, sits at each response point while that is measured (Ewins 2000, §3.12: H − H m s² (1 + m s² H)⁻¹ H).
pub struct SensorMass;

impl Distortion for SensorMass {
    fn forces(&self) -> Pushed {
        Pushed::AtBothPoints
    }

    fn shown(&self, values: &[f64], _omega: f64, truth: &Truth, frf: &FrfDatum) -> Complex64 {
        let inertia = truth.rate * truth.rate * values[0];
        let own = Matrix3::from_fn(|a, b| {
            let unit = if a == b { 1.0 } else { 0.0 };
            truth.at_response(a, b) * inertia + unit
        });
        let unloaded = nalgebra::Vector3::from_fn(|a, _| truth.bare(a, frf.reference.axis));
        let Some(inverse) = own.try_inverse() else {
            return truth.between(frf.response.axis, frf.reference.axis);
        };
        let loaded = inverse * unloaded;
        // What it changes is small: the channel need not mix its axes.
        let axis = frf.response.axis.index();
        truth.between(frf.response.axis, frf.reference.axis) + (loaded[axis] - unloaded[axis])
    }
}

impl Mistake for SensorMass {
    fn sizes(&self) -> Vec<MistakeSize> {
        vec![MistakeSize::positive(0.5, 20.0)]
    }

    fn groups(&self, data: &FrfData) -> Vec<FrfGroup> {
        // At one point only it is a payload like any other.
        let points = data.response_points();
        match points.len() > 1 {
            true => vec![FrfGroup::ALL],
            false => Vec::new(),
        }
    }

    fn finding(&self, estimated: &Estimated) -> SetupFinding {
        let (mass, error) = (estimated.values[0], estimated.errors[0]);
        SetupFinding {
            kind: "sensor-mass",
            place: "every response point in turn".into(),
            value: Some(mass),
            std_error: Some(error),
            unit: "kg",
            confidence: 0.0,
            remedy: format!(
                "Put dummy masses of {} kg at the points that are not being measured, or use a lighter sensor.",
                with_error(mass, error)
            ),
        }
    }
}
