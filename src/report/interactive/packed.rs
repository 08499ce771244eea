//! What the page carries in compressed form: plotly.js, and the numbers of its figures.

use std::collections::HashMap;
use std::io::Write;

use base64::prelude::{BASE64_STANDARD, Engine};
use flate2::Compression;
use flate2::write::GzEncoder;
use num_complex::Complex64;
use serde_json::{Value, json};

use crate::{Error, Result};

/// `text`, compressed (gzip), in letters that HTML takes as they are (base64).
pub fn packed(text: &str) -> Result<String> {
    let failed =
        |e: std::io::Error| Error::computation(format!("the report's figures cannot be packed: {e}"));
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(text.as_bytes()).map_err(failed)?;
    Ok(BASE64_STANDARD.encode(encoder.finish().map_err(failed)?))
}

/// plotly.js with the kinds of traces that figures here have, compressed: 1.6 MB as text. `scripts/plotly_bundle.py` makes it.
const PLOTLY_JS: &[u8] = include_bytes!("plotly.min.js.gz");

/// plotly.js, [`packed`].
pub fn plotly_js() -> String {
    BASE64_STANDARD.encode(PLOTLY_JS)
}

/// Lists of numbers from this length on stand in the page's table of [`Arrays`].
const LONG: usize = 24;
/// Whole numbers up to here are exact in JavaScript.
const EXACT: i64 = 1 << 53;

/// Each long list of numbers once: curves of one figure share their frequencies, areas are filled between curves that are drawn
/// as well, and gzip sees repetitions no farther back than 32 kB.
#[derive(Debug, Default)]
pub struct Arrays {
    values: Vec<Value>,
    places: HashMap<String, usize>,
}

impl Arrays {
    /// `value` with `{"$": place}` for each long list of numbers in it.
    pub fn shared(&mut self, value: &Value) -> Value {
        match value {
            Value::Array(list) if list.len() >= LONG && list.iter().all(|v| v.is_number() || v.is_null()) => {
                let next = self.values.len();
                let place = *self.places.entry(value.to_string()).or_insert(next);
                if place == next {
                    self.values.push(stepwise(list).unwrap_or_else(|| value.clone()));
                }
                json!({ "$": place })
            }
            Value::Array(list) => list.iter().map(|v| self.shared(v)).collect(),
            Value::Object(entries) => {
                let entries = entries.iter().map(|(key, v)| (key.clone(), self.shared(v)));
                Value::Object(entries.collect())
            }
            other => other.clone(),
        }
    }

    /// The table: a list as it is, or as `{"decimals", "order", "steps"}`: whole numbers of the last decimal, of which `order`
    /// times the differences were taken. Nothing is lost.
    pub fn table(self) -> Value {
        Value::Array(self.values)
    }
}

/// `None` where a number is missing or has too many digits.
fn stepwise(list: &[Value]) -> Option<Value> {
    let texts: Vec<String> = list
        .iter()
        .map(|v| Some(v.as_f64()?.to_string()))
        .collect::<Option<_>>()?;
    let decimals_of = |text: &String| text.split_once('.').map_or(0, |(_, after)| after.len());
    let decimals = texts.iter().map(decimals_of).max()?;
    let whole = |text: &String| {
        let digits = text.replacen('.', "", 1) + &"0".repeat(decimals - decimals_of(text));
        digits.parse().ok().filter(|n: &i64| n.abs() < EXACT / 8)
    };
    // JavaScript divides by powers of ten, which are exact up to here.
    let whole: Vec<i64> = texts
        .iter()
        .map(whole)
        .collect::<Option<_>>()
        .filter(|_| decimals <= 22)?;
    let first = differences(whole.into_iter());
    let second = differences(first.iter().copied());
    let length = |steps: &[i64]| steps.iter().map(|s| s.to_string().len()).sum::<usize>();
    let (order, steps) = if length(&second) < length(&first) {
        (2, second)
    } else {
        (1, first)
    };
    Some(json!({ "decimals": decimals, "order": order, "steps": steps }))
}

/// Steps of ln |value|: four significant digits.
const LN_STEP: f64 = 1e-4;
/// Steps of the phase, degrees.
const PHASE_STEP_DEG: f64 = 0.01;
/// ln of what is zero or no number.
const NO_LN: f64 = -200.0;

/// Magnitudes as whole numbers: the first is ln(value)/10⁻⁴, each further one the difference from the one before it.
/// Curves are smooth and differences small, which is what a compressed file takes least room for.
pub fn magnitudes(values: impl IntoIterator<Item = f64>) -> Vec<i64> {
    differences(values.into_iter().map(|v| {
        let ln = if v > 0.0 && v.is_finite() { v.ln() } else { NO_LN };
        (ln / LN_STEP).round() as i64
    }))
}

/// Phases likewise, in 0.01°.
pub fn phases(values: &[Complex64]) -> Vec<i64> {
    differences(values.iter().map(|v| {
        let degrees = v.arg().to_degrees();
        (if degrees.is_finite() { degrees } else { 0.0 } / PHASE_STEP_DEG).round() as i64
    }))
}

/// Differences of differences: a calculated curve has no noise, and they are smaller still.
pub fn bends(steps: Vec<i64>) -> Vec<i64> {
    differences(steps.into_iter())
}

fn differences(values: impl Iterator<Item = i64>) -> Vec<i64> {
    let mut before = 0;
    values
        .map(|value| {
            let difference = value - before;
            before = value;
            difference
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;

    #[test]
    fn curves_come_back_with_four_digits() {
        let sums = |steps: Vec<i64>| {
            let mut sum = 0;
            let add = |d| {
                sum += d;
                sum as f64
            };
            steps.into_iter().map(add).collect::<Vec<_>>()
        };
        let values = [2.5e-6, 2.6e-6, 1.3e-9, 4.0];
        for (back, value) in sums(magnitudes(values)).into_iter().zip(values) {
            assert!(((back * 1e-4).exp() / value - 1.0).abs() < 1e-4);
        }
        let angles = [-179.99, 0.0, 91.23];
        let turned: Vec<Complex64> = angles
            .iter()
            .map(|a: &f64| Complex64::from_polar(3.0, a.to_radians()))
            .collect();
        for (back, angle) in sums(phases(&turned)).into_iter().zip(angles) {
            assert!((back * 0.01 - angle).abs() < 0.006);
        }
        assert_eq!(magnitudes([0.0, f64::NAN]), [-2_000_000, 0]);
    }

    #[test]
    fn long_lists_stand_in_the_page_once_and_come_back_as_they_were() {
        let long: Vec<f64> = (0..100).map(|k| f64::from(k * k) / 1e7).collect();
        let gap: Vec<Value> = (0..40)
            .map(|k| if k == 7 { Value::Null } else { json!(k) })
            .collect();
        let figure = json!({ "a": { "x": long, "y": [long, [1, 2, 3]] }, "b": gap, "c": vec!["text"; 30] });
        let mut arrays = Arrays::default();
        let shared = arrays.shared(&figure);
        assert_eq!(
            shared["a"],
            json!({ "x": { "$": 0 }, "y": [{ "$": 0 }, [1, 2, 3]] })
        );
        assert_eq!((&shared["b"], &shared["c"]), (&json!({ "$": 1 }), &figure["c"]));
        let table = arrays.table();
        assert_eq!(table[1], figure["b"], "with a gap in it, as it is");
        assert_eq!(
            (&table[0]["decimals"], &table[0]["order"]),
            (&json!(7), &json!(2))
        );
        // As page.js does it.
        let mut numbers: Vec<i64> = table[0]["steps"]
            .as_array()
            .unwrap()
            .iter()
            .map(|s| s.as_i64().unwrap())
            .collect();
        for _ in 0..2 {
            let mut sum = 0;
            numbers.iter_mut().for_each(|n| {
                sum += *n;
                *n = sum;
            });
        }
        let back: Vec<f64> = numbers.iter().map(|n| *n as f64 / 1e7).collect();
        assert_eq!(
            back.iter().map(f64::to_string).collect::<Vec<_>>(),
            long.iter().map(f64::to_string).collect::<Vec<_>>()
        );
        for far in [vec![1e-30; 30], vec![1e300; 30], [1.0, 1e-20].repeat(20)] {
            let list: Vec<Value> = far.iter().map(|v| json!(v)).collect();
            assert_eq!(stepwise(&list), None, "{far:?}");
        }
    }

    #[test]
    fn the_library_is_there_with_its_licence() {
        let packed = plotly_js();
        assert!((500_000..900_000).contains(&packed.len()), "{}", packed.len());
        let mut script = String::new();
        flate2::read::GzDecoder::new(PLOTLY_JS)
            .read_to_string(&mut script)
            .unwrap();
        assert!(script.starts_with("/**\n* plotly.js (lobestone - minified) v"));
        assert!(script.contains("Licensed under the MIT license") && script.trim_end().ends_with("}));"));
        assert!(!script.contains("</script"));
        let version = script.split_once(" v").unwrap().1.lines().next().unwrap();
        assert!(include_str!("plotly-LICENSE.txt").starts_with(&format!("plotly.js {version} ")));
    }
}
