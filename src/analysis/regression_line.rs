//! The fitted force model as lines over feed.

use crate::campaign::{Campaign, CutGeometry};
use crate::cutting::{ForceAxis, ForceGroup, RegressionPoint};

/// Cuts that differ in nothing but feed (and speed), along one axis.
#[derive(Debug, Clone, PartialEq)]
pub struct FeedLine<'a> {
    /// What sets them apart from the others, such as `pilot hole 5 mm`.
    pub what: String,
    /// Average forces of these cuts along the axis.
    pub points: Vec<&'a RegressionPoint>,
    /// Intercept and slope of the fitted average (N and N/mm; for torque N·m and N·m/mm); `None` with one feed only.
    pub line: Option<(f64, f64)>,
}

/// One line for each set of cuts of the same geometry, in order of appearance.
pub fn feed_lines<'a>(campaign: &Campaign, group: &'a ForceGroup, axis: ForceAxis) -> Vec<FeedLine<'a>> {
    let mut lines: Vec<FeedLine> = Vec::new();
    for point in group.points.iter().filter(|p| p.axis == axis) {
        let cut = campaign.cuts.iter().find(|c| c.id == point.cut);
        let what = cut.map_or_else(String::new, |c| describe(&c.geometry));
        match lines.iter_mut().find(|l| l.what == what) {
            Some(line) => line.points.push(point),
            None => lines.push(FeedLine {
                what,
                points: vec![point],
                line: None,
            }),
        }
    }
    for line in &mut lines {
        line.line = through(&line.points);
    }
    lines
}

/// The geometry but for its feed.
fn describe(geometry: &CutGeometry) -> String {
    match geometry {
        CutGeometry::Milling {
            axial_depth_mm,
            immersion,
            ..
        } => {
            let degrees = |rad: f64| (rad.to_degrees() * 10.0).round() / 10.0;
            let (start, exit) = (degrees(immersion.start_rad), degrees(immersion.exit_rad));
            format!("depth {axial_depth_mm} mm, immersion {start}–{exit}°")
        }
        CutGeometry::Drilling {
            pilot_diameter_mm, ..
        } if *pilot_diameter_mm > 0.0 => format!("pilot hole {pilot_diameter_mm} mm"),
        CutGeometry::Drilling { .. } => "no pilot hole".into(),
        CutGeometry::Turning { depth_of_cut_mm, .. } => format!("depth {depth_of_cut_mm} mm"),
    }
}

/// Distance from the line that does not show, as a part of the largest force.
const ON_THE_LINE: f64 = 1e-2;

/// The force models are linear in feed at a given geometry (round the nose of a turning tool nearly): two feeds give the line.
/// Where the points are not on it after all there is none.
fn through(points: &[&RegressionPoint]) -> Option<(f64, f64)> {
    let by_feed = |a: &&&RegressionPoint, b: &&&RegressionPoint| a.feed_mm.total_cmp(&b.feed_mm);
    let (low, high) = (points.iter().min_by(by_feed)?, points.iter().max_by(by_feed)?);
    if !(high.feed_mm > low.feed_mm) {
        return None;
    }
    let slope = (high.fitted - low.fitted) / (high.feed_mm - low.feed_mm);
    let intercept = low.fitted - slope * low.feed_mm;
    let scale = points.iter().map(|p| p.fitted.abs()).fold(0.0, f64::max);
    points
        .iter()
        .all(|p| (intercept + slope * p.feed_mm - p.fitted).abs() <= ON_THE_LINE * scale)
        .then_some((intercept, slope))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::Immersion;

    fn points(values: &[(f64, f64)]) -> Vec<RegressionPoint> {
        let point = |&(feed_mm, fitted): &(f64, f64)| RegressionPoint {
            cut: "1".into(),
            axis: ForceAxis::Z,
            feed_mm,
            measured: 0.0,
            std_error: 1.0,
            fitted,
            leverage: 0.5,
            studentized_residual: None,
            weight_share: 1.0,
        };
        values.iter().map(point).collect()
    }

    fn line(values: &[(f64, f64)]) -> Option<(f64, f64)> {
        through(&points(values).iter().collect::<Vec<_>>())
    }

    #[test]
    fn a_line_is_drawn_only_where_there_is_one() {
        let (intercept, slope) = line(&[(0.1, 5.0), (0.2, 7.0), (0.05, 4.0)]).unwrap();
        approx::assert_relative_eq!(intercept, 3.0, max_relative = 1e-12);
        approx::assert_relative_eq!(slope, 20.0, max_relative = 1e-12);
        assert_eq!(line(&[(0.1, 5.0), (0.2, 7.0), (0.15, 12.0)]), None);
        assert_eq!(line(&[(0.1, 5.0), (0.1, 5.0)]), None);
        assert_eq!(line(&[]), None);
    }

    #[test]
    fn geometries_are_told_apart_by_all_but_feed() {
        let drilling = |pilot_diameter_mm, feed_per_rev_mm| CutGeometry::Drilling {
            feed_per_rev_mm,
            pilot_diameter_mm,
            hole_depth_mm: None,
        };
        assert_eq!(describe(&drilling(5.0, 0.1)), describe(&drilling(5.0, 0.2)));
        assert_eq!(describe(&drilling(5.0, 0.1)), "pilot hole 5 mm");
        assert_eq!(describe(&drilling(0.0, 0.1)), "no pilot hole");
        let milling = CutGeometry::Milling {
            feed_per_tooth_mm: 0.1,
            axial_depth_mm: 2.0,
            immersion: Immersion::SLOT,
        };
        assert_eq!(describe(&milling), "depth 2 mm, immersion 0–180°");
    }
}
