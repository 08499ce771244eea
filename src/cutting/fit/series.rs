//! All cuts of one process and one material: their coefficients over speed, and against another material.

use crate::cutting::cutting_trials::CuttingTrials;
use crate::cutting::fit::group::{Rows, distinct, observations};
use crate::cutting::fit::trend::{ChangeReading, CoefficientChange, changes, doublings, reference_speed};
use crate::cutting::force_model::coefficients::{CoefficientKind, coefficients_of};
use crate::cutting::measured::cut_analysis::CutAnalysis;
use crate::data::Process;

/// The cuts of one process and one material.
pub(crate) struct MaterialSeries<'a> {
    pub process: Process,
    pub material: Option<&'a str>,
    pub cuts: Vec<&'a CutAnalysis>,
}

impl MaterialSeries<'_> {
    fn speed_of(&self, cut: usize) -> f64 {
        let found = self.cuts.iter().find(|c| c.cut == cut);
        found.map_or(f64::NAN, |c| c.cutting_speed_m_per_min)
    }

    fn speeds(&self) -> Vec<f64> {
        distinct(self.cuts.iter().map(|c| c.cutting_speed_m_per_min))
    }
}

/// Every coefficient over cutting speed, in the order of [`coefficients_of`]; the change is per doubling of speed.
#[derive(Debug, Clone)]
pub struct SpeedTrends {
    /// How the cuts were made.
    pub process: Process,
    /// What was cut, as the campaign names it.
    pub material: Option<String>,
    /// Where the reference values hold.
    pub reference_speed_m_per_min: f64,
    /// Slowest and fastest.
    pub speed_range_m_per_min: [f64; 2],
    /// Number of different speeds.
    pub speeds: usize,
    /// One a coefficient, in the order of [`coefficients_of`].
    pub changes: Vec<CoefficientChange>,
    /// Correlation of speed with the order in which the cuts were made, where that is known.
    pub order_correlation: Option<f64>,
}

/// Every coefficient of a material over that of the first one.
#[derive(Debug, Clone)]
pub struct MaterialComparison {
    /// How the cuts were made.
    pub process: Process,
    /// The material that is compared.
    pub material: String,
    /// The material that it is compared with.
    pub reference: String,
    /// The change is material less reference, the ratio material over reference.
    pub changes: Vec<CoefficientChange>,
}

/// Speeds beyond this correlation with the order of the cuts cannot be told from wear.
const CONFOUNDED: f64 = 0.7;
/// Turned cuts whose speeds differ by less than this factor have one speed.
const TRIAL_OF_SPEEDS: f64 = 1.2;

pub(crate) fn speed_trends(
    trials: &CuttingTrials,
    series: &MaterialSeries,
    rows: &Rows,
) -> Option<SpeedTrends> {
    let speeds = series.speeds();
    let (&low, &high) = (speeds.first()?, speeds.last()?);
    // A bar that gets thinner is no trial of speeds.
    if series.process == Process::Turning && high < TRIAL_OF_SPEEDS * low {
        return None;
    }
    let reference = reference_speed(speeds.iter().copied());
    let changes = changes(
        &observations(&series.cuts, rows),
        &|cut| doublings(series.speed_of(cut), reference),
        &[],
    )?;
    let order = series.cuts.iter().map(|c| {
        let order = trials.cuts[c.cut].order? as f64;
        Some((order, c.cutting_speed_m_per_min.ln()))
    });
    Some(SpeedTrends {
        process: series.process,
        material: series.material.map(str::to_string),
        reference_speed_m_per_min: reference,
        speed_range_m_per_min: [low, high],
        speeds: speeds.len(),
        changes,
        order_correlation: order.collect::<Option<Vec<_>>>().and_then(|o| correlation(&o)),
    })
}

/// Beside the material the coefficients may follow the speed, alike in both, where several speeds were cut.
pub(crate) fn compare(
    first: &MaterialSeries,
    other: &MaterialSeries,
    rows: &Rows,
) -> Option<MaterialComparison> {
    let both = MaterialSeries {
        process: first.process,
        material: None,
        cuts: first.cuts.iter().chain(&other.cuts).copied().collect(),
    };
    let is_other = |cut: usize| f64::from(u8::from(other.cuts.iter().any(|c| c.cut == cut)));
    let reference = reference_speed(both.speeds().into_iter());
    let speed = |cut: usize| doublings(both.speed_of(cut), reference);
    let observations = observations(&both.cuts, rows);
    let changes = if both.speeds().len() > 1 {
        changes(&observations, &is_other, &[&speed])
    } else {
        changes(&observations, &is_other, &[])
    }?;
    let name = |series: &MaterialSeries| series.material.unwrap_or("unnamed").to_string();
    Some(MaterialComparison {
        process: first.process,
        material: name(other),
        reference: name(first),
        changes,
    })
}

fn correlation(pairs: &[(f64, f64)]) -> Option<f64> {
    let n = pairs.len() as f64;
    let mean = |f: fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>() / n;
    let (a, b) = (mean(|p| p.0), mean(|p| p.1));
    let sum = |f: &dyn Fn(f64, f64) -> f64| pairs.iter().map(|p| f(p.0 - a, p.1 - b)).sum::<f64>();
    let size = (sum(&|x, _| x * x) * sum(&|_, y| y * y)).sqrt();
    (size > 0.0).then(|| sum(&|x, y| x * y) / size)
}

impl SpeedTrends {
    /// Coefficients that follow the speed by more than chance.
    pub fn found(&self) -> impl Iterator<Item = (&CoefficientKind, &CoefficientChange)> {
        let kinds = coefficients_of(self.process).iter();
        kinds
            .zip(&self.changes)
            .filter(|(_, c)| matches!(c.reading, ChangeReading::Rises | ChangeReading::Falls))
    }

    pub(crate) fn warnings(&self) -> Option<String> {
        let correlation = self.order_correlation.filter(|c| c.abs() > CONFOUNDED)?;
        self.found().next()?;
        let order = if correlation > 0.0 { "later" } else { "earlier" };
        Some(format!(
            "the faster cuts were made {order} (correlation {correlation:.2}): a trend over speed cannot be told from \
             tool wear; cut the speeds in random order"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_correlation_is_that_of_the_textbook() {
        // Deviations from the means (−4, −1, 5)/3 and (−5, 1, 4)/3: 39 of √(42 · 42).
        let found = correlation(&[(1.0, 1.0), (2.0, 3.0), (4.0, 4.0)]).unwrap();
        approx::assert_relative_eq!(found, 39.0 / 42.0, max_relative = 1e-12);
        let falling = correlation(&[(1.0, 8.0), (2.0, 6.0), (3.0, 4.0)]).unwrap();
        approx::assert_relative_eq!(falling, -1.0, max_relative = 1e-12);
        assert_eq!(
            correlation(&[(0.0, 1.0), (1.0, 0.0), (2.0, 1.0)]).map(|c| c.abs() < 1e-12),
            Some(true)
        );
        assert_eq!(correlation(&[(1.0, 1.0), (1.0, 2.0)]), None);
    }
}
