use super::super::finding::SetupFinding;
use super::super::reading::FileReading;
use super::super::scene::predict;
use super::proposal::Proposed;
use super::table::DistanceTable;
use crate::Result;
use crate::data::{AxesRef, BodyRef, Point};
use crate::identify::StructureModel;
use crate::identify::frfs::frf_data::FrfData;

/// A point on another body, or with axes of another frame, than campaign.toml says.
pub struct PointFrame {
    /// Index into the campaign's points.
    point: usize,
    body: BodyRef,
    axes: AxesRef,
    /// Whether it is the body that is wrong.
    on_other_body: bool,
}

fn body_name(body: BodyRef) -> String {
    match body {
        BodyRef::Base => "base".into(),
        BodyRef::Link(i) => format!("link{i}"),
        BodyRef::Tool => "tool".into(),
    }
}

fn axes_name(axes: AxesRef) -> &'static str {
    match axes {
        AxesRef::Base => "base",
        AxesRef::Body => "body",
        AxesRef::Tool => "tool",
    }
}

impl FileReading for PointFrame {
    fn points(&self, points: &[Point]) -> Vec<Point> {
        let mut points = points.to_vec();
        points[self.point].body = self.body;
        points[self.point].axes = self.axes;
        points
    }

    fn finding(&self, _data: &FrfData, points: &[Point]) -> SetupFinding {
        let node = points[self.point].node;
        let (kind, place, remedy) = match self.on_other_body {
            true => {
                let body = body_name(self.body);
                (
                    "point-position",
                    format!(
                        "node {node}: on {body}, not on {}",
                        body_name(points[self.point].body)
                    ),
                    format!("Write body = \"{body}\" for this [[point]] of campaign.toml."),
                )
            }
            false => {
                let axes = axes_name(self.axes);
                (
                    "axes",
                    format!(
                        "node {node}: axes of the {axes}, not of the {}",
                        axes_name(points[self.point].axes)
                    ),
                    format!("Write axes = \"{axes}\" for this [[point]] of campaign.toml."),
                )
            }
        };
        SetupFinding {
            kind,
            place,
            value: None,
            std_error: None,
            unit: "",
            confidence: 0.0,
            remedy,
        }
    }
}

pub fn proposed(
    table: &DistanceTable,
    model: &StructureModel,
    data: &FrfData,
    theta: &[f64],
) -> Result<Vec<Proposed>> {
    let mut all = Vec::new();
    for (point, now) in model.points.iter().enumerate() {
        let concerned = |f: &crate::identify::frfs::frf_data::FrfDatum| {
            f.response.point == point || f.reference.point == point
        };
        if !data.frfs().any(|(_, f)| concerned(f)) {
            continue;
        }
        let mut readings: Vec<PointFrame> = Vec::new();
        for axes in [AxesRef::Base, AxesRef::Body, AxesRef::Tool] {
            let same = axes == now.axes
                || (now.body == BodyRef::Tool && axes == AxesRef::Body)
                || (now.body == BodyRef::Base && axes == AxesRef::Body);
            if !same {
                readings.push(PointFrame {
                    point,
                    body: now.body,
                    axes,
                    on_other_body: false,
                });
            }
        }
        let bodies = (1..=model.robot.joint_count())
            .map(BodyRef::Link)
            .chain([BodyRef::Tool]);
        readings.extend(bodies.filter(|b| *b != now.body).map(|body| PointFrame {
            point,
            body,
            axes: now.axes,
            on_other_body: true,
        }));
        for reading in readings {
            let read = model.with_fixed(|fixed| fixed.points = reading.points(&model.points));
            let curves = predict(&read, theta, data, None)?;
            all.push(Proposed {
                gain: table.gain_by_curves(data, &curves, concerned),
                reading: Box::new(reading),
            });
        }
    }
    Ok(all)
}
