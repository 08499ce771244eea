//! What is told of a mistake.

use serde::Serialize;

/// A mistake in how something was set up, wired, written down or filed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SetupFinding {
    /// As in docs/json.md: `encoder-offset`, `axes`, `channel-gain`, …
    pub kind: &'static str,
    /// The files, channels or places that it concerns, for people: `posture p3, response X`.
    #[serde(rename = "where")]
    pub place: String,
    /// Its size in `unit`; `None` where it has none (a sign, an exchange).
    pub value: Option<f64>,
    /// Standard error of `value`.
    pub std_error: Option<f64>,
    /// Unit of `value`.
    pub unit: &'static str,
    /// Probability that this is what is wrong, 0..1.
    pub confidence: f64,
    /// What to write or to check, one sentence.
    pub remedy: String,
}

/// Confidence from which on a finding is put first and keeps other verdicts from being certain.
pub const LIKELY: f64 = 0.5;

impl SetupFinding {
    /// One that has no size: an exchange, a wrong name.
    pub(super) fn without_size(kind: &'static str, place: String, confidence: f64, remedy: String) -> Self {
        SetupFinding {
            kind,
            place,
            value: None,
            std_error: None,
            unit: "",
            confidence,
            remedy,
        }
    }

    /// Whether it is put first and keeps other verdicts from being certain.
    pub fn is_likely(&self) -> bool {
        self.confidence >= LIKELY
    }

    /// `encoder-offset at joint 3: 0.23 ± 0.01 deg (confidence 97 %). Correct …`
    pub fn sentence(&self) -> String {
        let size = match (self.value, self.std_error) {
            (Some(value), Some(error)) => format!(": {} {}", with_error(value, error), self.unit),
            (Some(value), None) => format!(": {value:.4} {}", self.unit),
            (None, _) => String::new(),
        };
        format!(
            "{} ({}){} (confidence {:.0} %). {}",
            self.kind,
            self.place,
            size.trim_end_matches(" 1"),
            100.0 * self.confidence,
            self.remedy
        )
    }
}

/// `18.3 ± 0.4`: as many decimals as the error has meaning.
pub(super) fn with_error(value: f64, error: f64) -> String {
    let decimals = match error > 0.0 && error.is_finite() {
        true => (1.0 - error.log10().floor()).clamp(0.0, 7.0) as usize,
        false => 3,
    };
    format!("{value:.decimals$} ± {error:.decimals$}")
}
