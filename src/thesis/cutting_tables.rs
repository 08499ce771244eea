//! Tables 20 and 23 of the thesis: milling coefficients of acetal (robot), cast and printed (WAAM) titanium (machine
//! tool) over cutting speed. The records behind them are not public; what the numbers alone can tell is worked out here.

use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::published::rows;
use crate::cutting::{ChangeReading, CoefficientChange, KnownValue, MILLING_COEFFICIENTS, table_trend};
use crate::{Error, Result};

const ACETAL: &str = include_str!("../../datasets/irb6640/cfc_acetal_milling.csv");
const TITANIUM: &str = include_str!("../../datasets/irb6640/cfc_titanium_milling.csv");
const CONDITIONS: &str = include_str!("../../datasets/irb6640/cutting_conditions.toml");
/// Cuts of the acetal plan without data, graph and feed per tooth in mm (`missing_cuts` in the conditions).
const MISSING_CUTS: [(&str, f64); 3] = [("A", 0.05), ("A", 0.15), ("H", 0.05)];
/// Two tools broke in the printed titanium: no row of it has all feeds, and which ones are missing is not printed (thesis,
/// 10.2.3 and 10.3.3).
const INCOMPLETE: &str = PRINTED;
/// Acetal, milled on the robot.
pub const ACETAL_NAME: &str = "acetal";
/// Cast titanium, milled on a machine tool.
pub const CAST: &str = "Ti6Al4V";
/// Printed (WAAM) titanium, milled on a machine tool.
pub const PRINTED: &str = "WAAM Ti";

/// One row of a table.
#[derive(Debug, Clone, Serialize)]
pub struct CoefficientRow {
    /// The thesis's letter.
    pub graph: String,
    /// What was cut.
    pub material: String,
    /// Cutting speed, m/min.
    pub cutting_speed_m_per_min: f64,
    /// Tooth-passing frequency at that speed.
    pub tooth_passing_hz: f64,
    /// Ktc Krc Kac (N/mm²) Kte Kre Kae (N/mm).
    pub coefficients: [f64; 6],
    /// Feeds that gave data; `None` where it is only known that some are missing.
    pub feeds: Option<usize>,
    /// Feeds of the plan.
    pub feeds_planned: usize,
    /// Standard error of the edge coefficients over that of the full plan, at the same scatter of the averages; `None` where
    /// the feeds are not known.
    pub edge_error_factor: Option<f64>,
    /// Coefficients below zero.
    pub negative: Vec<&'static str>,
}

impl CoefficientRow {
    /// Feeds with data of those planned.
    pub fn feeds_in_words(&self) -> String {
        match self.feeds {
            Some(feeds) => format!("{feeds}/{}", self.feeds_planned),
            None => format!("<{0}/{0}", self.feeds_planned),
        }
    }
}

/// A coefficient of one material over speed: least squares on log2(speed), errors from the scatter about the line.
#[derive(Debug, Clone, Serialize)]
pub struct TableTrend {
    /// What was cut.
    pub material: String,
    /// `slow`, `fast` or `all` speeds.
    pub speeds: &'static str,
    /// Lowest and highest cutting speed, m/min.
    pub speed_range_m_per_min: [f64; 2],
    /// Name of the coefficient, such as `Ktc`.
    pub coefficient: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// At the geometric mean of the range.
    pub value: Option<KnownValue>,
    /// Change per doubling of the speed.
    pub per_doubling: Option<KnownValue>,
    /// Probability of so steep a line where there is no trend.
    pub p_value: Option<f64>,
    /// What may be read from it.
    pub reading: ChangeReading,
}

/// Printed less cast titanium, pair by pair at the same speed.
#[derive(Debug, Clone, Serialize)]
pub struct CoefficientDifference {
    /// Name of the coefficient, such as `Ktc`.
    pub coefficient: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Mean over the pairs, cast.
    pub cast_mean: f64,
    /// Mean over the pairs, printed.
    pub printed_mean: f64,
    /// Mean over the pairs with its standard error.
    pub difference: KnownValue,
    /// Speeds at which both were cut.
    pub pairs: usize,
    /// Paired t test.
    pub p_value: f64,
}

/// The tables and what they tell.
#[derive(Debug, Clone, Serialize)]
pub struct CuttingTables {
    /// Rows of both tables.
    pub rows: Vec<CoefficientRow>,
    /// Coefficients over cutting speed.
    pub trends: Vec<TableTrend>,
    /// Printed against cast titanium, by coefficient.
    pub differences: Vec<CoefficientDifference>,
    /// Correlation over the rows of a material between Ktc and Kte, and what mere scatter of the averages would give.
    pub seesaw: Vec<Seesaw>,
    /// Standard error of the slopes of the printed titanium against four feeds, if one is missing: least and most.
    pub printed_error_factors: [f64; 2],
    /// In plain words, a paragraph each.
    pub reading: Vec<String>,
}

/// How Ktc and Kte of a material go together over its rows.
#[derive(Debug, Clone, Serialize)]
pub struct Seesaw {
    /// What was cut.
    pub material: String,
    /// Correlation between Ktc and Kte.
    pub correlation: f64,
    /// Of the errors of slope and intercept at the planned feeds.
    pub of_mere_scatter: f64,
}

#[derive(Deserialize)]
struct CsvRow {
    graph: String,
    material: Option<String>,
    cutting_speed_m_per_min: f64,
    ktc_n_per_mm2: f64,
    krc_n_per_mm2: f64,
    kac_n_per_mm2: f64,
    kte_n_per_mm: f64,
    kre_n_per_mm: f64,
    kae_n_per_mm: f64,
}

#[derive(Deserialize)]
struct Conditions {
    acetal: Plan,
    titanium: Plan,
}

#[derive(Deserialize)]
struct Plan {
    teeth: usize,
    tool_diameter_mm: f64,
    feed_per_tooth_mm: Vec<f64>,
}

/// Mean and centred sum of squares.
fn spread(values: &[f64]) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (mean, values.iter().map(|v| (v - mean).powi(2)).sum())
}

/// Standard error of the slope of a straight line over all but one of `feeds` against that over all of them: where the
/// best one is missing, and where the worst is.
fn without_one(feeds: &[f64]) -> [f64; 2] {
    let all = spread(feeds).1;
    let factors = (0..feeds.len()).map(|i| {
        let mut left = feeds.to_vec();
        left.remove(i);
        (all / spread(&left).1).sqrt()
    });
    factors.fold([f64::INFINITY, 0.0], |[low, high], f| [low.min(f), high.max(f)])
}

/// Variance of the intercept of a straight line over `feeds`, for unit scatter.
fn intercept_variance(feeds: &[f64]) -> f64 {
    let (mean, square_sum) = spread(feeds);
    1.0 / feeds.len() as f64 + mean * mean / square_sum
}

impl Plan {
    fn row(&self, csv: CsvRow, missing: &[f64], material: &str) -> CoefficientRow {
        let feeds: Vec<f64> = self
            .feed_per_tooth_mm
            .iter()
            .copied()
            .filter(|f| !missing.iter().any(|m| (m - f).abs() < 1e-9))
            .collect();
        let coefficients = [
            csv.ktc_n_per_mm2,
            csv.krc_n_per_mm2,
            csv.kac_n_per_mm2,
            csv.kte_n_per_mm,
            csv.kre_n_per_mm,
            csv.kae_n_per_mm,
        ];
        let material = csv.material.unwrap_or_else(|| material.to_string());
        let known = material != INCOMPLETE;
        let turns_per_min =
            csv.cutting_speed_m_per_min * 1000.0 / (std::f64::consts::PI * self.tool_diameter_mm);
        CoefficientRow {
            material,
            graph: csv.graph,
            cutting_speed_m_per_min: csv.cutting_speed_m_per_min,
            tooth_passing_hz: turns_per_min / 60.0 * self.teeth as f64,
            coefficients,
            feeds: known.then_some(feeds.len()),
            feeds_planned: self.feed_per_tooth_mm.len(),
            edge_error_factor: known
                .then(|| (intercept_variance(&feeds) / intercept_variance(&self.feed_per_tooth_mm)).sqrt()),
            negative: (0..6)
                .filter(|&j| coefficients[j] < 0.0)
                .map(|j| MILLING_COEFFICIENTS[j].label)
                .collect(),
        }
    }
}

/// Reads both tables and works out what they say.
///
/// # Errors
/// A built-in table is damaged.
pub fn cutting_tables() -> Result<CuttingTables> {
    let conditions: Conditions = toml::from_str(CONDITIONS)
        .map_err(|e| Error::computation(format!("the built-in cutting conditions are damaged: {e}")))?;
    let missing = |graph: &str| -> Vec<f64> {
        let own = MISSING_CUTS.iter().filter(|(g, _)| *g == graph);
        own.map(|(_, feed)| *feed).collect()
    };
    let mut table: Vec<CoefficientRow> = rows::<CsvRow>(ACETAL)?
        .into_iter()
        .map(|row| {
            let missing = missing(&row.graph);
            conditions.acetal.row(row, &missing, ACETAL_NAME)
        })
        .collect();
    table.extend(
        rows::<CsvRow>(TITANIUM)?
            .into_iter()
            .map(|row| conditions.titanium.row(row, &[], CAST)),
    );
    let materials = [
        (ACETAL_NAME, &conditions.acetal),
        (CAST, &conditions.titanium),
        (PRINTED, &conditions.titanium),
    ];
    let mut tables = CuttingTables {
        trends: materials
            .iter()
            .flat_map(|(name, _)| trends(&table, name))
            .collect(),
        differences: differences(&table),
        seesaw: materials
            .iter()
            .map(|(name, plan)| seesaw(&table, name, &plan.feed_per_tooth_mm))
            .collect(),
        rows: table,
        printed_error_factors: without_one(&conditions.titanium.feed_per_tooth_mm),
        reading: Vec::new(),
    };
    tables.reading = tables.read();
    Ok(tables)
}

impl CuttingTables {
    /// The rows of a material.
    pub fn of<'a>(&'a self, material: &'a str) -> impl Iterator<Item = &'a CoefficientRow> {
        self.rows.iter().filter(move |r| r.material == material)
    }
}

fn of<'a>(table: &'a [CoefficientRow], material: &str) -> Vec<&'a CoefficientRow> {
    let mut own: Vec<&CoefficientRow> = table.iter().filter(|r| r.material == material).collect();
    own.sort_by(|a, b| a.cutting_speed_m_per_min.total_cmp(&b.cutting_speed_m_per_min));
    own
}

/// Slow and fast cuts were made as two series, a factor of ten or so apart: each by itself, and both.
fn trends(table: &[CoefficientRow], material: &str) -> Vec<TableTrend> {
    let own = of(table, material);
    let gap = |i: &usize| own[i + 1].cutting_speed_m_per_min / own[*i].cutting_speed_m_per_min;
    let split = (0..own.len().saturating_sub(1))
        .max_by(|a, b| gap(a).total_cmp(&gap(b)))
        .map_or(own.len(), |i| i + 1);
    let ranges = [
        ("slow", &own[..split]),
        ("fast", &own[split..]),
        ("all", &own[..]),
    ];
    let mut found = Vec::new();
    for (speeds, part) in ranges {
        let (Some(first), Some(last)) = (part.first(), part.last()) else {
            continue;
        };
        for (j, kind) in MILLING_COEFFICIENTS.iter().enumerate() {
            let points: Vec<(f64, f64)> = part
                .iter()
                .map(|r| (r.cutting_speed_m_per_min, r.coefficients[j]))
                .collect();
            let Some(CoefficientChange {
                reference,
                change,
                p_value,
                reading,
                ..
            }) = table_trend(&points)
            else {
                continue;
            };
            found.push(TableTrend {
                material: material.into(),
                speeds,
                speed_range_m_per_min: [first.cutting_speed_m_per_min, last.cutting_speed_m_per_min],
                coefficient: kind.label,
                unit: kind.unit,
                value: reference,
                per_doubling: change,
                p_value,
                reading,
            });
        }
    }
    found
}

fn differences(table: &[CoefficientRow]) -> Vec<CoefficientDifference> {
    let (cast, printed) = (of(table, CAST), of(table, PRINTED));
    let one = |(j, kind): (usize, &crate::cutting::CoefficientKind)| {
        let pairs: Vec<(f64, f64)> = cast
            .iter()
            .filter_map(|c| {
                let same = |p: &&&CoefficientRow| {
                    (p.cutting_speed_m_per_min - c.cutting_speed_m_per_min).abs() < 1e-6
                };
                Some((c.coefficients[j], printed.iter().find(same)?.coefficients[j]))
            })
            .collect();
        let apart: Vec<f64> = pairs.iter().map(|(c, p)| p - c).collect();
        let n = apart.len() as f64;
        let (mean, square_sum) = spread(&apart);
        let std_error = (square_sum / (n - 1.0) / n).sqrt();
        let t = StudentsT::new(0.0, 1.0, n - 1.0).ok()?;
        Some(CoefficientDifference {
            coefficient: kind.label,
            unit: kind.unit,
            cast_mean: pairs.iter().map(|p| p.0).sum::<f64>() / n,
            printed_mean: pairs.iter().map(|p| p.1).sum::<f64>() / n,
            difference: KnownValue {
                value: mean,
                std_error: Some(std_error),
            },
            pairs: pairs.len(),
            p_value: 2.0 * t.cdf(-(mean / std_error).abs()),
        })
    };
    MILLING_COEFFICIENTS.iter().enumerate().filter_map(one).collect()
}

fn seesaw(table: &[CoefficientRow], material: &str, feeds: &[f64]) -> Seesaw {
    let own = of(table, material);
    let column = |j: usize| -> Vec<f64> { own.iter().map(|r| r.coefficients[j]).collect() };
    let (ktc, kte) = (column(0), column(3));
    let ((a, aa), (b, bb)) = (spread(&ktc), spread(&kte));
    let ab: f64 = ktc.iter().zip(&kte).map(|(x, y)| (x - a) * (y - b)).sum();
    let (mean, square_sum) = spread(feeds);
    Seesaw {
        material: material.into(),
        correlation: ab / (aa * bb).sqrt(),
        // Of slope and intercept of a straight line: −mean/√(mean square).
        of_mere_scatter: -mean / (mean * mean + square_sum / feeds.len() as f64).sqrt(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn rows_with_missing_cuts_say_what_they_rest_on() {
        let tables = cutting_tables().unwrap();
        assert_eq!(tables.rows.len(), 24);
        let row = |graph: &str| tables.of(ACETAL_NAME).find(|r| r.graph == graph).unwrap();
        // Two feeds, 0.1 and 0.2: variance of the intercept 1/2 + 0.15²/0.005 = 5 against 1/4 + 0.125²/0.0125 = 1.5.
        assert_eq!((row("A").feeds, row("A").feeds_planned), (Some(2), 4));
        assert_relative_eq!(
            row("A").edge_error_factor.unwrap(),
            (5.0f64 / 1.5).sqrt(),
            max_relative = 1e-9
        );
        assert_eq!((row("H").feeds, row("B").feeds), (Some(3), Some(4)));
        assert_eq!(row("H").negative, ["Kac", "Kte", "Kre", "Kae"]);
        // 4800 rpm, six teeth.
        assert_relative_eq!(row("E").tooth_passing_hz, 480.0, max_relative = 1e-4);
        assert!(tables.of(CAST).all(|r| r.feeds == Some(4)));
        // Two tools broke: no row of the printed titanium has four.
        assert!(
            tables
                .of(PRINTED)
                .all(|r| r.feeds.is_none() && r.edge_error_factor.is_none())
        );
        let told = &tables.reading[0];
        assert!(
            told.contains("No row of WAAM Ti has all 4 feeds") && told.contains("1.6 times"),
            "{told}"
        );
        assert!(
            tables
                .reading
                .iter()
                .any(|t| t.contains("fewer feeds behind each row"))
        );
    }

    /// Against another library (scipy.stats: linregress on log2 of the speed, ttest_rel).
    #[test]
    fn trends_and_differences_are_the_textbooks() {
        let tables = cutting_tables().unwrap();
        let trend = |material: &str, speeds: &str, label: &str| {
            let found = tables
                .trends
                .iter()
                .find(|t| t.material == material && t.speeds == speeds && t.coefficient == label);
            let t = found.unwrap();
            (t.per_doubling.unwrap().value, t.p_value.unwrap())
        };
        for (material, speeds, label, slope, p) in [
            ("acetal", "all", "Kac", -12.8209393, 0.0413082131),
            ("Ti6Al4V", "fast", "Kre", 64.1278222, 0.000668144836),
            ("Ti6Al4V", "all", "Ktc", -81.0149083, 5.06975216e-05),
            ("WAAM Ti", "slow", "Kre", -25.4618464, 0.00762513459),
        ] {
            let got = trend(material, speeds, label);
            assert_relative_eq!(got.0, slope, max_relative = 1e-5);
            assert_relative_eq!(got.1, p, max_relative = 1e-4);
        }
        for (label, difference, p) in [
            ("Ktc", 613.75, 0.0030192769),
            ("Krc", 631.25, 0.07713378),
            ("Kac", 279.5, 0.00620916233),
            ("Kte", 16.81625, 0.0188866985),
            ("Kre", 76.4425, 0.000335667614),
            ("Kae", -0.8775, 0.504089406),
        ] {
            let d = tables
                .differences
                .iter()
                .find(|d| d.coefficient == label)
                .unwrap();
            assert_eq!(d.pairs, 8);
            assert_relative_eq!(d.difference.value, difference, max_relative = 1e-6);
            assert_relative_eq!(d.p_value, p, max_relative = 1e-5);
        }
    }
}
