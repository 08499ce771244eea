//! What is left, or has to be different, held against one quantity: whether it follows it by more than chance.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

/// One value of the rest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TrendPoint {
    /// In the abscissa's unit.
    pub x: f64,
    /// Record less model, in the trend's unit.
    pub rest: f64,
    /// Standard deviation that the noise gives it.
    pub std: f64,
}

/// Below this a trend is no chance.
pub const SIGNIFICANT: f64 = 0.01;

/// A polynomial against points.
pub(crate) struct TrendTest {
    /// Those that count.
    pub points: Vec<TrendPoint>,
    /// The least x, and how far the largest is from it.
    pub low: f64,
    pub span: f64,
    /// Probability that noise follows x as much.
    pub p_value: f64,
    /// Decrease of Σ r²/σ².
    pub explained: f64,
}

/// Whether a polynomial of this degree (a line, where no x lies between the ends) explains more of the points than chance: the F test
/// of nested models, with the noise or the scatter about the polynomial, whichever is larger. `None` where there are too few points.
pub(crate) fn test(points: Vec<TrendPoint>, degree: usize) -> Option<TrendTest> {
    let points: Vec<TrendPoint> = points
        .into_iter()
        .filter(|p| p.x.is_finite() && p.rest.is_finite() && p.std > 0.0)
        .collect();
    let low = points.iter().map(|p| p.x).fold(f64::INFINITY, f64::min);
    let high = points.iter().map(|p| p.x).fold(f64::NEG_INFINITY, f64::max);
    let span = high - low;
    if points.is_empty() || span <= 1e-6 * high.abs() {
        return None;
    }
    let place = |x: f64| 2.0 * (x - low) / span - 1.0;
    let has_middle = points.iter().any(|p| place(p.x).abs() < 0.98);
    let degree = if has_middle { degree } else { 1 };
    let left = points.len().checked_sub(degree + 1).filter(|n| *n >= 2)? as f64;
    let without = misfit(&points, 0, &place)?;
    let with = misfit(&points, degree, &place)?;
    let scale = (with / left).max(1.0);
    let ratio = ((without - with) / degree as f64 / scale).max(0.0);
    Some(TrendTest {
        p_value: FisherSnedecor::new(degree as f64, left).ok()?.sf(ratio),
        explained: without - with,
        points,
        low,
        span,
    })
}

/// Σ r²/σ² about the polynomial of this degree that fits best.
fn misfit(points: &[TrendPoint], degree: usize, place: &dyn Fn(f64) -> f64) -> Option<f64> {
    let basis = DMatrix::from_fn(points.len(), degree + 1, |i, k| {
        place(points[i].x).powi(k as i32) / points[i].std
    });
    let values = DVector::from_fn(points.len(), |i, _| points[i].rest / points[i].std);
    let normal = basis.transpose() * &basis;
    let solution = normal.cholesky()?.solve(&(basis.transpose() * &values));
    Some((values - basis * solution).norm_squared())
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn points(values: &[(f64, f64)], std: f64) -> Vec<TrendPoint> {
        values
            .iter()
            .map(|&(x, rest)| TrendPoint { x, rest, std })
            .collect()
    }

    /// Slope of four points against chance by another library (scipy.stats.linregress: p = 0.146423993), whose scatter is far above
    /// the noise; the F test of a line is the square of its t test.
    #[test]
    fn a_line_against_scatter_is_the_textbooks() {
        let table = [
            (4.52389, 2610.0),
            (5.78053, 2580.0),
            (7.037168, 2580.0),
            (8.293805, 2480.0),
        ];
        // That line is over the doublings of the speed.
        let over = table.map(|(speed, value): (f64, f64)| (speed.log2(), value));
        let found = test(points(&over, 1.0), 1).unwrap();
        assert_relative_eq!(found.p_value, 0.146423993, max_relative = 1e-6);
        assert_relative_eq!(found.low, 4.52389f64.log2(), max_relative = 1e-12);
        assert_relative_eq!(found.span, (8.293805f64 / 4.52389).log2(), max_relative = 1e-12);
    }

    /// Points that lie nearer to a line than their noise are no better known than that; three of them are too few to tell.
    #[test]
    fn scatter_below_the_noise_is_luck() {
        let few = [(-1.0, -4.0), (0.0, 0.1), (1.0, 4.0)];
        assert!(test(points(&few, 1.0), 1).is_none());
        let four = [(-1.0, -4.0), (-1.0, -4.0), (1.0, 4.0), (1.0, 4.0)];
        let found = test(points(&four, 1.0), 1).unwrap();
        assert_relative_eq!(found.explained, 64.0, max_relative = 1e-9);
        // F(1, 2) = t² with two degrees of freedom: P(|t| > 8) = 1 − 8/√66.
        assert_relative_eq!(found.p_value, 1.0 - 8.0 / 66f64.sqrt(), max_relative = 1e-6);
    }

    /// At two speeds there is no parabola: a line is tested, whatever the distance of the two.
    #[test]
    fn two_abscissae_have_a_line_only() {
        for span in [0.01, 0.5, 300.0] {
            let two = [
                (10.0, 1.0),
                (10.0, 1.2),
                (10.0 + span, 9.0),
                (10.0 + span, 9.2),
                (10.0 + span, 8.8),
            ];
            let found = test(points(&two, 0.2), 2).unwrap();
            assert!(found.p_value < 1e-3, "{span}: {}", found.p_value);
            let line = test(points(&two, 0.2), 1).unwrap();
            assert_eq!(found.p_value, line.p_value);
        }
        let one = [(10.0, 1.0), (10.0, 1.2), (10.0, 9.0)];
        assert!(test(points(&one, 0.2), 1).is_none());
    }
}
