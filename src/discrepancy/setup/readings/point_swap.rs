use super::super::finding::SetupFinding;
use super::super::reading::FileReading;
use super::super::scene::predict;
use super::proposal::Proposed;
use super::table::DistanceTable;
use crate::Result;
use crate::data::Point;
use crate::identify::StructureModel;
use crate::identify::frfs::frf_data::{FrfData, FrfDatum};

/// More points than this have too many pairs to look at.
const MOST_POINTS: usize = 12;

/// Two points each of which sits where campaign.toml has the other: nodes exchanged in the files, or sensors on the robot.
pub struct PointSwap {
    /// Indices into the campaign's points.
    both: [usize; 2],
}

impl FileReading for PointSwap {
    fn points(&self, points: &[Point]) -> Vec<Point> {
        let mut points = points.to_vec();
        let [a, b] = self.both;
        points.swap(a, b);
        let node = points[a].node;
        points[a].node = points[b].node;
        points[b].node = node;
        points
    }

    fn finding(&self, _data: &FrfData, points: &[Point]) -> SetupFinding {
        let [a, b] = self.both.map(|k| points[k].node);
        SetupFinding {
            kind: "point-position",
            place: format!("nodes {a} and {b}: exchanged"),
            value: None,
            std_error: None,
            unit: "",
            confidence: 0.0,
            remedy: format!(
                "Exchange node = {a} and node = {b} of these two [[point]] of campaign.toml, if the sensors sat so or the files were \
                 written so."
            ),
        }
    }
}

/// Every two points that were measured.
pub fn proposed(
    table: &DistanceTable,
    model: &StructureModel,
    data: &FrfData,
    theta: &[f64],
) -> Result<Vec<Proposed>> {
    let at = |frf: &FrfDatum, point: usize| frf.response.point == point || frf.reference.point == point;
    let measured: Vec<usize> = (0..model.points.len())
        .filter(|point| data.frfs().any(|(_, frf)| at(frf, *point)))
        .collect();
    let mut all = Vec::new();
    if measured.len() > MOST_POINTS {
        return Ok(all);
    }
    for (k, &b) in measured.iter().enumerate() {
        for &a in &measured[..k] {
            let reading = PointSwap { both: [a, b] };
            let read = model.with_fixed(|fixed| fixed.points = reading.points(&model.points));
            let curves = predict(&read, theta, data, None)?;
            all.push(Proposed {
                gain: table.gain_by_curves(data, &curves, |frf| at(frf, a) || at(frf, b)),
                reading: Box::new(reading),
            });
        }
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{AxesRef, BodyRef};

    #[test]
    fn places_are_exchanged_and_nodes_stay() {
        let point = |node: i64, link: usize| Point {
            node,
            body: BodyRef::Link(link),
            position_m: [0.1 * node as f64, 0.0, 0.0],
            axes: AxesRef::Body,
        };
        let points = [point(1, 6), point(2, 3), point(3, 5)];
        let read = PointSwap { both: [1, 2] }.points(&points);
        assert_eq!(read[0], points[0]);
        assert_eq!((read[1].node, read[1].body), (2, BodyRef::Link(5)));
        assert_eq!((read[2].node, read[2].position_m), (3, points[1].position_m));
    }
}
