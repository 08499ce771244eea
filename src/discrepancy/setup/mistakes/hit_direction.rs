use num_complex::Complex64;

use super::super::finding::{SetupFinding, with_error};
use super::super::group::FrfGroup;
use super::super::mistake::{Distortion, Estimated, Mistake, MistakeSize, turned_axis};
use super::super::truth::Truth;
use crate::data::Axis;
use crate::identify::frfs::frf_data::{FrfData, FrfDatum};

/// The force was not along the axis that the file names: turned by a rotation vector, deg about x, y, z.
pub struct HitDirection;

impl Distortion for HitDirection {
    fn shown(&self, values: &[f64], _omega: f64, truth: &Truth, frf: &FrfDatum) -> Complex64 {
        let direction = turned_axis(frf.reference.axis, values);
        let terms = Axis::ALL.into_iter().zip(direction);
        terms
            .map(|(axis, part)| truth.between(frf.response.axis, axis) * part)
            .sum()
    }
}

impl Mistake for HitDirection {
    fn sizes(&self) -> Vec<MistakeSize> {
        vec![MistakeSize::either_way(5.0, 60.0); 3]
    }

    fn groups(&self, data: &FrfData) -> Vec<FrfGroup> {
        let of_axis = |group: FrfGroup| {
            Axis::ALL.map(|axis| FrfGroup {
                reference_axis: Some(axis),
                ..group
            })
        };
        let postures = FrfGroup::postures(data);
        let mut groups = postures.clone();
        groups.extend(postures.into_iter().flat_map(of_axis));
        groups.retain(|g| data.frfs().any(|(_, f)| g.holds(f)));
        groups
    }

    fn finding(&self, estimated: &Estimated) -> SetupFinding {
        let (angle, error) = estimated.length();
        let place = match estimated.group.reference_axis {
            Some(_) => estimated.place(),
            None => format!("{}, all hits", estimated.place()),
        };
        SetupFinding {
            kind: "hit-direction",
            place,
            value: Some(angle),
            std_error: Some(error),
            unit: "deg",
            confidence: 0.0,
            remedy: format!(
                "Hit again along the axis: the force was turned by {} deg, rotation vector ({:.2}, {:.2}, {:.2}) deg about \
                 the axes of the node that was hit.",
                with_error(angle, error),
                estimated.values[0],
                estimated.values[1],
                estimated.values[2]
            ),
        }
    }
}
