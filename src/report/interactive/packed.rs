//! What the page carries in compressed form: plotly.js is 4.6 MB as text and 1.4 MB compressed.

use std::io::Write;
use std::sync::OnceLock;

use base64::prelude::{BASE64_STANDARD, Engine};
use flate2::Compression;
use flate2::write::GzEncoder;
use num_complex::Complex64;

use crate::{Error, Result};

/// `text`, compressed (gzip), in letters that HTML takes as they are (base64).
pub fn packed(text: &str) -> Result<String> {
    let failed =
        |e: std::io::Error| Error::computation(format!("the report's figures cannot be packed: {e}"));
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(text.as_bytes()).map_err(failed)?;
    Ok(BASE64_STANDARD.encode(encoder.finish().map_err(failed)?))
}

/// plotly.js as the crate `plotly` has it, [`packed`].
///
/// # Errors
/// The crate does not hold what it held when this was written.
pub fn plotly_js() -> Result<&'static str> {
    static PACKED: OnceLock<String> = OnceLock::new();
    if let Some(packed) = PACKED.get() {
        return Ok(packed);
    }
    let scripts = plotly::Plot::offline_js_sources();
    let packed = packed(first_script(&scripts)?)?;
    Ok(PACKED.get_or_init(|| packed))
}

/// The content of the first of several script elements; the second is for formulas, which no figure here has.
fn first_script(scripts: &str) -> Result<&str> {
    let body = scripts.split_once('>').map(|(_, rest)| rest);
    let body = body.and_then(|rest| rest.split_once("</script>"));
    body.map(|(script, _)| script)
        .filter(|script| script.contains("plotly.js v"))
        .ok_or_else(|| Error::computation("the crate plotly does not hold plotly.js"))
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
    fn the_library_is_there_and_much_smaller_packed() {
        let packed = plotly_js().unwrap();
        assert!((1_500_000..2_200_000).contains(&packed.len()), "{}", packed.len());
        assert!(
            packed
                .bytes()
                .all(|b| b.is_ascii_alphanumeric() || b"+/=".contains(&b))
        );
        let scripts = plotly::Plot::offline_js_sources();
        let script = first_script(&scripts).unwrap();
        assert!(!script.contains("MathJax=") && script.trim_end().ends_with("}));"));
        let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(script.as_bytes()).unwrap();
        let mut back = String::new();
        flate2::read::GzDecoder::new(&encoder.finish().unwrap()[..])
            .read_to_string(&mut back)
            .unwrap();
        assert_eq!(back, script);
        assert!(first_script("<script>x</script>").is_err());
    }
}
