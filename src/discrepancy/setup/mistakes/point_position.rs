use super::super::finding::{SetupFinding, with_error};
use super::super::group::FrfGroup;
use super::super::mistake::{Distortion, Estimated, Mistake, MistakeSize};
use crate::data::{BodyRef, Point};
use crate::identify::frfs::frf_data::FrfData;

/// A measuring point sits elsewhere on its body, m along the body's axes.
pub struct PointPosition {
    /// Index into the campaign's points.
    pub point: usize,
}

impl Distortion for PointPosition {
    fn point(&self, values: &[f64], index: usize, point: &Point) -> Point {
        let mut moved = point.clone();
        if index == self.point {
            for (p, v) in moved.position_m.iter_mut().zip(values) {
                *p += v;
            }
        }
        moved
    }
}

impl Mistake for PointPosition {
    fn sizes(&self) -> Vec<MistakeSize> {
        vec![MistakeSize::either_way(0.05, 1.0); 3]
    }

    fn groups(&self, _data: &FrfData) -> Vec<FrfGroup> {
        vec![FrfGroup::ALL]
    }

    fn finding(&self, estimated: &Estimated) -> SetupFinding {
        let (length, error) = estimated.length();
        let point = &estimated.points[self.point];
        let body = match point.body {
            BodyRef::Base => "base".to_string(),
            BodyRef::Link(i) => format!("link {i}"),
            BodyRef::Tool => "tool".to_string(),
        };
        let shift: Vec<String> = estimated
            .values
            .iter()
            .zip(estimated.errors)
            .map(|(v, e)| with_error(1e3 * v, 1e3 * e))
            .collect();
        let now: Vec<String> = point
            .position_m
            .iter()
            .zip(estimated.values)
            .map(|(p, v)| format!("{:.4}", p + v))
            .collect();
        SetupFinding {
            kind: "point-position",
            place: format!("node {} on the {body}", point.node),
            value: Some(1e3 * length),
            std_error: Some(1e3 * error),
            unit: "mm",
            confidence: 0.0,
            remedy: format!(
                "Measure where the point is: it fits best moved by ({}) mm along the body's axes, position_m = [{}] in \
                 campaign.toml.",
                shift.join(", "),
                now.join(", ")
            ),
        }
    }
}
