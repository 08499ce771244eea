//! The tables of cutting coefficients in plain words, from their numbers.

use super::cutting_tables::{
    ACETAL_NAME, CAST, CoefficientDifference, CoefficientRow, CuttingTables, PRINTED, TableTrend,
};
use crate::cutting::{ChangeReading, MILLING_COEFFICIENTS};
use crate::text::chance;

/// A paired difference less likely than this by chance is called one, after Bonferroni over the six coefficients.
const FALSE_ALARM: f64 = 0.05;
/// p below which a single trend is listed.
const LISTED: f64 = 0.05;

impl CuttingTables {
    /// What the rows rest on, trends, cast against printed, what is implausible, what the loop would test.
    pub(super) fn read(&self) -> Vec<String> {
        let mut reading = vec![self.few_cuts(), self.trend_text()];
        reading.extend(self.seesaw_text());
        reading.push(self.difference_text());
        reading.push(self.implausible_text());
        reading.push(self.next_text());
        reading
    }

    fn few_cuts(&self) -> String {
        let one = |r: &CoefficientRow| {
            let feeds = r.feeds.filter(|feeds| *feeds < r.feeds_planned)?;
            let check = if feeds == 2 {
                "a line through two points, which nothing checks"
            } else {
                "one point to spare"
            };
            Some(format!(
                "{} {} ({:.1} m/min) rests on {feeds} of {} feeds: {check}; its edge coefficients are {:.1} times as uncertain \
                 as with all feeds",
                r.material, r.graph, r.cutting_speed_m_per_min, r.feeds_planned, r.edge_error_factor?
            ))
        };
        let short: Vec<String> = self.rows.iter().filter_map(one).collect();
        let planned = self.of(PRINTED).map(|r| r.feeds_planned).max().unwrap_or(0);
        let [least, most] = self.printed_error_factors;
        format!(
            "Too few cuts: {}. No row of {PRINTED} has all {planned} feeds: two tools broke (thesis, 10.2.3 and 10.3.3), and which \
             feeds are missing is not printed; with {} feeds there is one degree of freedom at best, and a slope is {least:.2} to \
             {most:.1} times as uncertain as with {planned}. Every other row has one cut per feed and four feeds: two degrees of \
             freedom for two coefficients. The tables print no standard errors, so no single value can be judged by itself.",
            short.join("; "),
            planned.saturating_sub(1),
        )
    }

    fn trend_text(&self) -> String {
        let listed: Vec<&TableTrend> = self
            .trends
            .iter()
            .filter(|t| t.p_value.is_some_and(|p| p < LISTED))
            .collect();
        let one = |t: &&TableTrend| {
            let slope = t.per_doubling.map_or(0.0, |k| k.value);
            format!(
                "{} {} {} by {:.1} {} per doubling of speed ({})",
                t.coefficient,
                if t.speeds == "all" {
                    "over all speeds".to_string()
                } else {
                    format!("over the {} speeds", t.speeds)
                },
                if slope > 0.0 { "rises" } else { "falls" },
                slope.abs(),
                t.unit,
                chance(t.p_value.unwrap_or(1.0))
            )
        };
        let by_material: Vec<String> = [ACETAL_NAME, CAST, PRINTED]
            .iter()
            .map(|name| {
                let own: Vec<String> = listed.iter().filter(|t| t.material == *name).map(one).collect();
                let own = if own.is_empty() {
                    "none".to_string()
                } else {
                    own.join("; ")
                };
                format!("{name}: {own}")
            })
            .collect();
        let tried = self.trends.len();
        let strict: Vec<String> = self
            .trends
            .iter()
            .filter(|t| t.p_value.is_some_and(|p| p * tried as f64 <= FALSE_ALARM))
            .map(|t| format!("{} of {} over {} speeds", t.coefficient, t.material, t.speeds))
            .collect();
        format!(
            "Trends over cutting speed with p below {LISTED}: {}. Of {tried} lines tried, {:.1} would be on this list by \
             chance alone; {} stand{} up to that (Bonferroni).",
            by_material.join(". "),
            LISTED * tried as f64,
            if strict.is_empty() {
                "none".to_string()
            } else {
                strict.join(", ")
            },
            if strict.len() > 1 { "" } else { "s" },
        )
    }

    /// Where Ktc and Kte swing against each other as errors of slope and intercept do.
    fn seesaw_text(&self) -> Option<String> {
        let s = self
            .seesaw
            .iter()
            .find(|s| (s.correlation - s.of_mere_scatter).abs() < 0.05)?;
        let ktc: Vec<f64> = self.of(&s.material).map(|r| r.coefficients[0]).collect();
        let low = ktc.iter().copied().fold(f64::INFINITY, f64::min);
        let high = ktc.iter().copied().fold(0.0, f64::max);
        Some(format!(
            "In {} Ktc runs from {low:.0} to {high:.0} N/mm² while Kte runs the other way: their correlation over the rows is \
             {:.2}. Errors of the slope and the intercept of a line over these feeds have {:.2}. So what looks like an effect \
             of speed is what scatter of the averages alone would look like; the sum at a middle feed is known, its parts are \
             not.",
            s.material, s.correlation, s.of_mere_scatter
        ))
    }

    fn difference_text(&self) -> String {
        let count = self.differences.len() as f64;
        let is_found = |d: &&CoefficientDifference| d.p_value * count <= FALSE_ALARM;
        let one = |d: &CoefficientDifference| {
            format!(
                "{} {:.0} against {:.0} {} (difference {:.1} ± {:.1}, {})",
                d.coefficient,
                d.printed_mean,
                d.cast_mean,
                d.unit,
                d.difference.value,
                d.difference.std_error.unwrap_or(f64::NAN),
                chance(d.p_value)
            )
        };
        let found: Vec<String> = self.differences.iter().filter(is_found).map(one).collect();
        let open: Vec<String> = self
            .differences
            .iter()
            .filter(|d| !is_found(d))
            .map(one)
            .collect();
        let pairs = self.differences.first().map_or(0, |d| d.pairs);
        let scatter = |material: &str| {
            let values: Vec<f64> = self.of(material).map(|r| r.coefficients[0]).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let var = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64;
            100.0 * var.sqrt() / mean
        };
        format!(
            "{PRINTED} against {CAST}, {pairs} pairs at the same speed: {} (beyond chance, Bonferroni over {count:.0}). Not beyond \
             chance: {}. The test takes its errors from the differences themselves, so that it holds although the rows of the printed \
             titanium are the less certain ones. Its Ktc scatters by {:.0} % over the speeds, that of the cast by {:.0} %: fewer feeds \
             behind each row are one reason, and how much of it is the material the tables cannot say.",
            if found.is_empty() {
                "none".to_string()
            } else {
                found.join("; ")
            },
            if open.is_empty() {
                "none".to_string()
            } else {
                open.join("; ")
            },
            scatter(PRINTED),
            scatter(CAST)
        )
    }

    fn implausible_text(&self) -> String {
        let mut lines = Vec::new();
        for name in [ACETAL_NAME, CAST, PRINTED] {
            let rows: Vec<&CoefficientRow> = self.of(name).collect();
            for kind in &MILLING_COEFFICIENTS {
                let negative: Vec<&str> = rows
                    .iter()
                    .filter(|r| r.negative.contains(&kind.label))
                    .map(|r| r.graph.as_str())
                    .collect();
                if negative.is_empty() {
                    continue;
                }
                let which = if negative.len() == rows.len() {
                    format!("all {} rows", rows.len())
                } else {
                    format!("rows {}", negative.join(", "))
                };
                lines.push(format!("{} of {name} in {which}", kind.label));
            }
        }
        format!(
            "Physically implausible (an edge cannot pull, and the axial force of one tool does not change its sign with the speed), negative are: {}. A \
             sign that holds in all rows is no scatter: drift, a leaking amplifier, a tilted dynamometer, or the sign of the z \
             channel. One that comes and goes is what slope and intercept do to each other.",
            lines.join("; ")
        )
    }

    fn next_text(&self) -> String {
        let range = |rows: Vec<&CoefficientRow>| {
            let hz: Vec<f64> = rows.iter().map(|r| r.tooth_passing_hz).collect();
            let low = hz.iter().copied().fold(f64::INFINITY, f64::min);
            format!("{low:.0}–{:.0} Hz", hz.iter().copied().fold(0.0, f64::max))
        };
        let fast = |name: &str| {
            let rows: Vec<&CoefficientRow> = self.of(name).collect();
            let top = rows.iter().map(|r| r.cutting_speed_m_per_min).fold(0.0, f64::max);
            range(
                rows.into_iter()
                    .filter(|r| r.cutting_speed_m_per_min > 0.5 * top)
                    .collect(),
            )
        };
        let speed_found = self
            .trends
            .iter()
            .any(|t| t.speeds == "all" && matches!(t.reading, ChangeReading::Rises | ChangeReading::Falls));
        format!(
            "If the records existed, `lobestone diagnose` would test: nonlinear-drift, dynamometer-misalignment and crosstalk \
             (negative axial and edge coefficients); dynamometer-resonance and chatter (teeth pass at {} in the fast cuts of acetal, \
             made by the robot, and at {} in those of titanium, made on a machine tool); tool-wear against speed-dependence{} (needs the \
             order in which the cuts were made); runout and size-effect (needs the waveform and all feeds). None of this can be \
             decided from averages of averages: the tables alone carry neither errors nor waveforms.",
            fast(ACETAL_NAME),
            fast(CAST),
            if speed_found {
                " (a trend over all speeds is there)"
            } else {
                ""
            }
        )
    }
}
