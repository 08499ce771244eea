//! The fitted force model as a line over feed, where it is one.

use crate::cutting::{ForceAxis, Group};

/// Intercept and slope of the fitted average force over feed (N and N/mm; for torque N·m and N·m/mm).
///
/// `None` where the cuts differ in more than feed (depth, immersion), so that no single line holds, or have one feed only.
pub fn feed_line(group: &Group, axis: ForceAxis) -> Option<(f64, f64)> {
    let points: Vec<(f64, f64)> = group
        .points
        .iter()
        .filter(|p| p.axis == axis)
        .map(|p| (p.feed_mm, p.fitted))
        .collect();
    let by_feed = |a: &&(f64, f64), b: &&(f64, f64)| a.0.total_cmp(&b.0);
    let (low, high) = (points.iter().min_by(by_feed)?, points.iter().max_by(by_feed)?);
    if !(high.0 > low.0) {
        return None;
    }
    let slope = (high.1 - low.1) / (high.0 - low.0);
    let intercept = low.1 - slope * low.0;
    let scale = points.iter().map(|p| p.1.abs()).fold(0.0, f64::max);
    points
        .iter()
        .all(|(feed, force)| (intercept + slope * feed - force).abs() <= 1e-6 * scale)
        .then_some((intercept, slope))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::Process;
    use crate::cutting::RegressionPoint;

    fn group(points: &[(f64, f64)]) -> Group {
        let point = |&(feed_mm, fitted): &(f64, f64)| RegressionPoint {
            cut: "1".into(),
            axis: ForceAxis::Z,
            feed_mm,
            measured: 0.0,
            std_error: 1.0,
            fitted,
        };
        Group {
            process: Process::Milling,
            cutting_speed_m_per_min: 60.0,
            cutting_speed_range_m_per_min: [60.0; 2],
            cuts: vec![],
            feeds: points.len(),
            coefficients: vec![],
            inseparable: vec![],
            r2: [None; 4],
            chi2_per_dof: [None; 4],
            extra_scatter: [0.0; 4],
            points: points.iter().map(point).collect(),
        }
    }

    #[test]
    fn a_line_is_drawn_only_where_there_is_one() {
        let (intercept, slope) = feed_line(&group(&[(0.1, 5.0), (0.2, 7.0), (0.05, 4.0)]), ForceAxis::Z).unwrap();
        approx::assert_relative_eq!(intercept, 3.0, max_relative = 1e-12);
        approx::assert_relative_eq!(slope, 20.0, max_relative = 1e-12);
        // Two depths of cut: two lines.
        assert_eq!(feed_line(&group(&[(0.1, 5.0), (0.2, 7.0), (0.15, 12.0)]), ForceAxis::Z), None);
        assert_eq!(feed_line(&group(&[(0.1, 5.0), (0.1, 5.0)]), ForceAxis::Z), None);
        assert_eq!(feed_line(&group(&[]), ForceAxis::Z), None);
    }
}
