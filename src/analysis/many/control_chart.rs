//! Control charts of single values.
//!
//! Individuals chart (Shewhart 1931; NIST/SEMATECH e-Handbook of Statistical Methods, 6.3.2.2): the scatter of a process is
//! estimated from the mean absolute difference of neighbours, σ = MR̄ / d₂ with d₂ = 2/√π = 1.128, and a value is out of
//! control beyond x̄ ± 3 σ. Two additions. A value that is known to ±s cannot be judged more sharply than that, so σ is at least
//! the root mean square of the standard errors. And while there are few values, 3 is replaced by the Student quantile of
//! the same probability with ν = 0.605 (n − 1) degrees of freedom (the variance of MR̄ / d₂ is 0.826 σ²/(n − 1): Cryer and
//! Ryan 1990), and the error of the mean is added: three nights say little about the fourth.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

/// Mean of |x₁ − x₂| of two normal values with σ = 1.
const D2: f64 = std::f64::consts::FRAC_2_SQRT_PI;
/// Limits in σ where the scatter is known.
const WIDTH: f64 = 3.0;
/// Earlier values below which there are no limits.
const LEAST: usize = 4;

/// A value in its turn.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChartPoint {
    /// Where the value comes from.
    pub campaign: String,
    /// Of the measurement, as written.
    pub date: Option<String>,
    /// The value, in the unit of the chart's name.
    pub value: f64,
    /// Its standard error, where known.
    pub std_error: Option<f64>,
    /// Beyond the limits.
    pub outside: bool,
}

/// What σ rests on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Basis {
    /// The mean absolute difference of neighbours.
    MovingRange,
    /// The standard errors of the values.
    StandardErrors,
}

/// Between which limits a further value is expected, in the unit of the values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Limits {
    /// Mean of the values.
    pub centre: f64,
    /// Lower control limit.
    pub lower: f64,
    /// Upper control limit.
    pub upper: f64,
    /// Standard deviation of one value.
    pub sigma: f64,
    /// Where σ comes from.
    pub basis: Basis,
    /// Values that they were made of.
    pub values: usize,
}

/// One quantity of one robot over time, oldest first. The last value is judged by those before it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ControlChart {
    /// The quantity, with its unit.
    pub name: String,
    /// The values, oldest first.
    pub points: Vec<ChartPoint>,
    /// `None` with fewer than four values before the last.
    pub limits: Option<Limits>,
    /// From the centre to the last value, in thirds of the distance to the limit: beyond 3 it is outside.
    pub last_sigmas: Option<f64>,
    /// From the value before to the last, in their common standard error; `None` where one has none.
    pub change_sigmas: Option<f64>,
}

impl ControlChart {
    /// A chart of `points`, whose `outside` is filled in.
    pub fn new(name: String, mut points: Vec<ChartPoint>) -> Self {
        let earlier = &points[..points.len().saturating_sub(1)];
        let limits = limits(earlier).map(|limits| match is_never_negative(&name) {
            true => Limits {
                lower: limits.lower.max(0.0),
                ..limits
            },
            false => limits,
        });
        let last = points.last();
        let last_sigmas = limits.zip(last).map(|(limits, last)| {
            let third = (limits.upper - limits.centre) / WIDTH;
            (last.value - limits.centre) / third
        });
        let change_sigmas = match points.as_slice() {
            [.., before, last] => change(before, last),
            _ => None,
        };
        if let Some(limits) = limits {
            for point in &mut points {
                point.outside = !(limits.lower..=limits.upper).contains(&point.value);
            }
        }
        ControlChart {
            name,
            points,
            limits,
            last_sigmas: last_sigmas.filter(|s| s.is_finite()),
            change_sigmas,
        }
    }

    /// Whether the last value is beyond its limits.
    pub fn is_out(&self) -> bool {
        self.points.last().is_some_and(|p| p.outside)
    }
}

/// Whether a quantity of this name cannot be below zero, and a limit there would say nothing.
fn is_never_negative(name: &str) -> bool {
    const POSITIVE: [&str; 6] = ["nrms", "stiffness", "damping", "mass", "compliance", "frequency"];
    let quantity = name.rsplit('.').next().unwrap_or(name);
    POSITIVE.iter().any(|word| quantity.contains(word))
}

fn change(before: &ChartPoint, last: &ChartPoint) -> Option<f64> {
    let error = before.std_error?.hypot(last.std_error?);
    let sigmas = (last.value - before.value) / error;
    Some(sigmas).filter(|s| s.is_finite())
}

fn limits(points: &[ChartPoint]) -> Option<Limits> {
    let count = points.len();
    if count < LEAST {
        return None;
    }
    let n = count as f64;
    let centre = points.iter().map(|p| p.value).sum::<f64>() / n;
    let ranges = points.windows(2).map(|w| (w[1].value - w[0].value).abs());
    let of_ranges = ranges.sum::<f64>() / (n - 1.0) / D2;
    let errors: Vec<f64> = points.iter().filter_map(|p| p.std_error).collect();
    let of_errors = match errors.len() {
        0 => 0.0,
        known => (errors.iter().map(|e| e * e).sum::<f64>() / known as f64).sqrt(),
    };
    // The standard errors are what the fits state; of the ranges there are few.
    let by_ranges = of_ranges * factor(0.605 * (n - 1.0));
    let by_errors = of_errors * WIDTH;
    let (sigma, half, basis) = match by_ranges >= by_errors {
        true => (of_ranges, by_ranges, Basis::MovingRange),
        false => (of_errors, by_errors, Basis::StandardErrors),
    };
    let half = half * (1.0 + 1.0 / n).sqrt();
    // Values that are all the same, without errors: nothing is known of their scatter.
    (half > 0.0 && half.is_finite()).then_some(Limits {
        centre,
        lower: centre - half,
        upper: centre + half,
        sigma,
        basis,
        values: count,
    })
}

/// The quantile of Student's t that is exceeded as rarely as 3 by a normal value.
fn factor(degrees_of_freedom: f64) -> f64 {
    let probability = Normal::standard().cdf(WIDTH);
    match StudentsT::new(0.0, 1.0, degrees_of_freedom) {
        Ok(law) => law.inverse_cdf(probability),
        Err(_) => f64::INFINITY,
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;

    fn chart(values: &[f64], std_error: Option<f64>) -> ControlChart {
        chart_of("k", values, std_error)
    }

    fn chart_of(name: &str, values: &[f64], std_error: Option<f64>) -> ControlChart {
        let points = values.iter().enumerate().map(|(i, value)| ChartPoint {
            campaign: format!("c{i}"),
            date: None,
            value: *value,
            std_error,
            outside: false,
        });
        ControlChart::new(name.into(), points.collect())
    }

    /// The example of the NIST handbook (6.3.2.2): ten flow rates, mean 50.81, mean moving range 1.8778, limits 45.82 and 55.80.
    #[test]
    fn the_example_of_the_handbook() {
        let values = [49.6, 47.6, 49.9, 51.3, 47.8, 51.2, 52.6, 52.4, 53.6, 52.1, 50.0];
        let limits = chart(&values, None).limits.unwrap();
        assert_relative_eq!(limits.centre, 50.81, epsilon = 1e-9);
        assert_relative_eq!(limits.sigma, 1.8778 / 1.128, epsilon = 2e-3);
        assert_relative_eq!(limits.centre + 3.0 * limits.sigma, 55.8041, epsilon = 5e-3);
        assert_relative_eq!(limits.centre - 3.0 * limits.sigma, 45.8159, epsilon = 5e-3);
        assert_eq!((limits.basis, limits.values), (Basis::MovingRange, 10));
        // Nine ranges: wider than three, as Student's t with 5.4 degrees of freedom.
        let half = (limits.upper - limits.centre) / limits.sigma;
        assert!(half > 5.0 && half < 6.0, "{half}");
    }

    #[test]
    fn many_values_have_the_limits_of_the_book() {
        let values: Vec<f64> = (0..2001).map(|i| if i % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let limits = chart(&values, None).limits.unwrap();
        assert_relative_eq!(limits.upper, 3.0 * 2.0 / D2, epsilon = 0.02);
    }

    #[test]
    fn a_step_is_outside_and_scatter_is_not() {
        let quiet = [100.0, 101.0, 99.5, 100.5, 99.0, 100.2, 100.9];
        let same = chart(&[&quiet[..], &[99.4]].concat(), None);
        assert!(!same.is_out(), "{same:?}");
        let step = chart(&[&quiet[..], &[80.0]].concat(), None);
        assert!(step.is_out() && step.last_sigmas.unwrap() < -3.0, "{step:?}");
        assert_eq!(step.points.iter().filter(|p| p.outside).count(), 1);
        // What is not known to better than ±10 is no step.
        let vague = chart(&[&quiet[..], &[80.0]].concat(), Some(10.0));
        assert!(!vague.is_out(), "{vague:?}");
        assert_eq!(vague.limits.unwrap().basis, Basis::StandardErrors);
        assert_relative_eq!(
            vague.change_sigmas.unwrap(),
            -20.9 / 200f64.sqrt(),
            epsilon = 1e-12
        );
    }

    #[test]
    fn few_or_equal_values_have_no_limits() {
        assert!(chart(&[], None).limits.is_none());
        assert!(chart(&[1.0, 1.1, 0.9, 1.0], None).limits.is_none());
        assert!(chart(&[1.0; 9], None).limits.is_none());
        assert!(chart(&[1.0; 9], Some(0.1)).limits.is_some());
    }

    #[test]
    fn what_cannot_be_negative_has_no_limit_below_zero() {
        let limits = |name| chart_of(name, &[1.0, 4.0, 0.5, 5.0, 2.0], None).limits.unwrap();
        let angle = limits("sensor.about_z_deg");
        let stiffness = limits("joint-1.stiffness_nm_per_rad");
        assert!(angle.lower < 0.0);
        assert_eq!((stiffness.lower, stiffness.upper), (0.0, angle.upper));
    }
}
