use num_complex::Complex64;

use super::super::finding::{SetupFinding, with_error};
use super::super::group::FrfGroup;
use super::super::mistake::{Distortion, Estimated, Mistake, MistakeSize};
use super::super::truth::Truth;
use super::sensor_high_pass::responses;
use crate::identify::frfs::frf_data::{FrfData, FrfDatum};

/// The response of some files is late against the force, value in s: e^(−s·value). One that is late in all files is the effect
/// `time-delay`.
pub struct LateChannel;

impl Distortion for LateChannel {
    fn shown(&self, values: &[f64], _omega: f64, truth: &Truth, frf: &FrfDatum) -> Complex64 {
        truth.between(frf.response.axis, frf.reference.axis) * (-truth.rate * values[0]).exp()
    }
}

impl Mistake for LateChannel {
    fn sizes(&self) -> Vec<MistakeSize> {
        vec![MistakeSize::either_way(1e-3, 0.05)]
    }

    fn groups(&self, data: &FrfData) -> Vec<FrfGroup> {
        let mut groups = responses(data);
        // A group that holds every file is all of them by another name.
        groups.retain(|g| data.frfs().any(|(_, f)| !g.holds(f)));
        groups
    }

    fn finding(&self, estimated: &Estimated) -> SetupFinding {
        let [late, error] = [estimated.values[0], estimated.errors[0]].map(|seconds| 1e3 * seconds);
        let [which, other] = match late > 0.0 {
            true => ["response", "force"],
            false => ["force", "response"],
        };
        SetupFinding {
            kind: "late-channel",
            place: estimated.place(),
            value: Some(late),
            std_error: Some(error),
            unit: "ms",
            confidence: 0.0,
            remedy: format!(
                "The {which} channel is late against the {other} channel by {} ms: look for a filter far above the band or a delay in \
                 one channel only, or turn the phase back.",
                with_error(late.abs(), error)
            ),
        }
    }
}
