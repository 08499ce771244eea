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
