//! What coefficients do over cutting speed, and from one material to another: one regression over all cuts, with a
//! coefficient and its change side by side, so that every cut counts and errors are those of the averages.

use std::f64::consts::LN_2;

use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::cutting::fit::group::{KnownValue, distinct};
use crate::cutting::fit::regression::{CoefficientFit, Observation, fit};
use crate::cutting::force_model::force_axis::ForceAxis;

/// What a change amounts to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ChangeReading {
    /// The coefficient grows with the factor.
    Rises,
    /// The coefficient shrinks with the factor.
    Falls,
    /// No change that chance would not make.
    None,
    /// The data cannot tell the change from something else.
    NotDetermined,
}

/// A coefficient and what one unit of a factor (a doubling of speed, the other material) adds to it.
#[derive(Debug, Clone, PartialEq)]
pub struct CoefficientChange {
    /// At the reference (mean speed, reference material).
    pub reference: Option<KnownValue>,
    /// Same unit.
    pub change: Option<KnownValue>,
    /// (reference + change)/reference; `None` where the reference is not clearly (two standard errors) off zero.
    pub ratio: Option<KnownValue>,
    /// Chance of a change as large as this where there is none (Student's t).
    pub p_value: Option<f64>,
    /// What that amounts to.
    pub reading: ChangeReading,
}

/// Chance, over all coefficients of one question together, of calling mere scatter a change.
const FALSE_ALARM: f64 = 0.05;

/// Geometric mean of the slowest and the fastest: where a trend's reference value is given.
pub fn reference_speed(speeds: impl Iterator<Item = f64> + Clone) -> f64 {
    let low = speeds.clone().fold(f64::INFINITY, f64::min);
    let high = speeds.fold(0.0, f64::max);
    (low * high).sqrt()
}

/// Doublings from `reference` to `speed`.
pub fn doublings(speed: f64, reference: f64) -> f64 {
    (speed / reference).log2()
}

/// Every coefficient with its change per unit of `factor` (by cut), allowing for `others` alongside.
/// `None` without observations or where the factor is the same for all cuts.
pub fn changes(
    observations: &[Observation],
    factor: &dyn Fn(usize) -> f64,
    others: &[&dyn Fn(usize) -> f64],
) -> Option<Vec<CoefficientChange>> {
    let unknowns = observations.first()?.row.len();
    if distinct(observations.iter().map(|o| factor(o.cut))).len() < 2 {
        return None;
    }
    let extended: Vec<Observation> = observations
        .iter()
        .map(|o| {
            let factors = std::iter::once(factor(o.cut)).chain(others.iter().map(|f| f(o.cut)));
            let more = factors.flat_map(|x| o.row.iter().map(move |r| r * x));
            Observation {
                row: o.row.iter().copied().chain(more).collect(),
                ..o.clone()
            }
        })
        .collect();
    let fit = fit(&extended)?;
    let change = |j: usize| one_change(&extended, &fit, j, unknowns);
    Some((0..unknowns).map(change).collect())
}

fn one_change(
    observations: &[Observation],
    fit: &CoefficientFit,
    j: usize,
    unknowns: usize,
) -> CoefficientChange {
    let known = |k: usize| {
        Some(KnownValue {
            value: fit.value[k]?,
            std_error: fit.std_error[k],
        })
    };
    let (reference, change) = (known(j), known(unknowns + j));
    let carries = |axis: &ForceAxis| {
        observations
            .iter()
            .any(|o| o.axis == *axis && o.row[unknowns + j] != 0.0)
    };
    let dof = ForceAxis::ALL
        .iter()
        .filter(|a| carries(a))
        .map(|a| fit.dof[a.index()])
        .fold(f64::INFINITY, f64::min);
    let p_value = change.and_then(|c| {
        let t = c.value / c.std_error.filter(|e| *e > 0.0)?;
        // Less than one degree of freedom is no judgement.
        let distribution = StudentsT::new(0.0, 1.0, dof).ok().filter(|_| dof > 1.0 - 1e-6)?;
        Some(2.0 * distribution.cdf(-t.abs()))
    });
    let ratio = reference.zip(change).and_then(|(k, d)| {
        let error = k.std_error?;
        let c = |a: usize, b: usize| fit.covariance[(a, b)];
        // ρ = 1 + d/k: dρ = (dd − (d/k) dk)/k.
        let slope = d.value / k.value;
        let (a, b) = (unknowns + j, j);
        let variance = (c(a, a) - 2.0 * slope * c(a, b) + slope * slope * c(b, b)) / (k.value * k.value);
        (k.value.abs() > 2.0 * error).then(|| KnownValue {
            value: 1.0 + slope,
            std_error: Some(variance.max(0.0).sqrt()),
        })
    });
    let reading = match (change, p_value) {
        (Some(c), Some(p)) if p * unknowns as f64 <= FALSE_ALARM => {
            if c.value > 0.0 {
                ChangeReading::Rises
            } else {
                ChangeReading::Falls
            }
        }
        (Some(_), Some(_)) => ChangeReading::None,
        _ => ChangeReading::NotDetermined,
    };
    CoefficientChange {
        reference,
        change,
        ratio,
        p_value,
        reading,
    }
}

impl CoefficientChange {
    /// Exponent m of the power law K ∝ speed^m that has this trend at the reference, where the factor is doublings.
    pub fn exponent(&self) -> Option<KnownValue> {
        self.ratio.map(|r| KnownValue {
            value: (r.value - 1.0) / LN_2,
            std_error: r.std_error.map(|e| e / LN_2),
        })
    }
}

/// Trend of values known one by one (a table's) over speed: least squares on log2(speed / reference speed), errors
/// from the scatter about the line.
pub fn table_trend(points: &[(f64, f64)]) -> Option<CoefficientChange> {
    let reference = reference_speed(points.iter().map(|p| p.0));
    let observations: Vec<Observation> = points
        .iter()
        .enumerate()
        .map(|(cut, (_, value))| Observation {
            cut,
            axis: ForceAxis::Z,
            row: vec![1.0],
            value: *value,
            std_error: 0.0,
        })
        .collect();
    let change = changes(&observations, &|cut| doublings(points[cut].0, reference), &[])?;
    change.into_iter().next()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Slope, its standard error and p of the same four points by another library (scipy.stats.linregress).
    #[test]
    fn the_trend_of_a_table_is_the_textbooks() {
        let points = [
            (4.52389, 2610.0),
            (5.78053, 2580.0),
            (7.037168, 2580.0),
            (8.293805, 2480.0),
        ];
        let trend = table_trend(&points).unwrap();
        let change = trend.change.unwrap();
        assert_relative_eq!(change.value, -128.633504, max_relative = 1e-6);
        assert_relative_eq!(change.std_error.unwrap(), 55.5147293, max_relative = 1e-5);
        assert_relative_eq!(trend.p_value.unwrap(), 0.146423993, max_relative = 1e-5);
        assert_eq!(trend.reading, ChangeReading::None);
        assert!(table_trend(&points[..1]).is_none() && table_trend(&[]).is_none());
    }

    /// Forces of a coefficient pair that falls by `per_doubling` of itself, four feeds at each of four speeds.
    fn cuts(per_doubling: f64, second: f64) -> (Vec<Observation>, Vec<f64>) {
        let (mut all, mut doublings) = (Vec::new(), Vec::new());
        for material in [1.0, second] {
            for x in [-1.0, -0.3, 0.4, 1.0] {
                for feed in [0.05, 0.1, 0.15, 0.2] {
                    let cut = doublings.len();
                    let scatter = [0.4, -0.3, 0.1, -0.5, 0.2, 0.3, -0.2][cut % 7];
                    let k = material * (1000.0 + per_doubling * x);
                    all.push(Observation {
                        cut,
                        axis: ForceAxis::Z,
                        row: vec![feed, 1.0],
                        value: k * feed + 20.0 + scatter,
                        std_error: 0.4,
                    });
                    doublings.push(x);
                }
            }
        }
        (all, doublings)
    }

    #[test]
    fn a_trend_is_found_and_no_trend_is_not() {
        let (all, x) = cuts(-50.0, 1.0);
        let found = changes(&all, &|cut| x[cut], &[]).unwrap();
        let slope = found[0].change.unwrap();
        assert!(
            (slope.value + 50.0).abs() < 3.0 * slope.std_error.unwrap(),
            "{slope:?}"
        );
        assert_eq!(
            (found[0].reading, found[1].reading),
            (ChangeReading::Falls, ChangeReading::None)
        );
        // K ∝ v^m at the reference: m = −50/(1000 ln 2).
        let exponent = found[0].exponent().unwrap();
        assert!((exponent.value + 50.0 / 1000.0 / LN_2).abs() < 3.0 * exponent.std_error.unwrap());
        let (all, x) = cuts(0.0, 1.0);
        let quiet = changes(&all, &|cut| x[cut], &[]).unwrap();
        assert!(
            quiet.iter().all(|c| c.reading == ChangeReading::None),
            "{quiet:?}"
        );
    }

    #[test]
    fn materials_are_compared_beside_a_trend_and_confounding_is_said() {
        let (all, x) = cuts(-50.0, 1.2);
        let material = |cut: usize| if cut < 16 { 0.0 } else { 1.0 };
        let found = changes(&all, &material, &[&|cut| x[cut]]).unwrap();
        let ratio = found[0].ratio.unwrap();
        assert!(
            (ratio.value - 1.2).abs() < 3.0 * ratio.std_error.unwrap(),
            "{ratio:?}"
        );
        assert_eq!(
            (found[0].reading, found[1].reading),
            (ChangeReading::Rises, ChangeReading::None)
        );
        // The other material only at the other speed: nothing to tell them apart by.
        let confounded: Vec<Observation> = all
            .into_iter()
            .filter(|o| x[o.cut] == if o.cut < 16 { -1.0 } else { 1.0 })
            .collect();
        let found = changes(&confounded, &material, &[&|cut| x[cut]]).unwrap();
        assert_eq!(found[0].reading, ChangeReading::NotDetermined);
    }
}
