//! What a fitted model leaves of its data, and what tests of structure found in it.

use num_complex::Complex64;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::own_errors::OwnErrors;

/// The rest of one measured curve.
#[derive(Debug, Clone)]
pub struct RestCurve {
    /// Posture: what parameters of a fold of its own may follow.
    pub fold: usize,
    /// Curves of one source were measured with the same hits: they share noise.
    pub source: usize,
    /// (model − measured)/σ by line; noise has E|r|² = 1.
    pub rest: Vec<Complex64>,
    /// Derivatives of the model by each of its parameters over σ, by line.
    pub slopes: Vec<Vec<Complex64>>,
    /// Further patterns that an error of this curve alone may have, by line, over σ.
    pub own: Vec<Vec<Complex64>>,
}

/// What tests find in a rest.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Rest {
    /// Empty where there is too little data to tell.
    pub tests: Vec<RestTest>,
    /// Σ r²/σ² that errors of a setup as small as [`SMALL_ERROR`] of the signal leave.
    pub small_errors: f64,
    /// `None` where that was not tried.
    pub beyond_slips: Option<BeyondSlips>,
}

/// What the small errors of a careful setup cannot take of a rest.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BeyondSlips {
    /// The same tests; what the errors pay for their sizes is part of the excess.
    pub tests: Vec<RestTest>,
    /// −ln of how likely errors of such sizes are in one laboratory, over how likely they are where they only imitate something else.
    pub unlikely: f64,
    /// ln of the evidence for such errors against none.
    pub evidence: f64,
    /// Σ r²/σ² to which their effect on the FRFs was worked out.
    pub known_to: f64,
    /// Whether what is left is each curve's own; `None` where that cannot be told.
    pub own_errors: Option<OwnErrors>,
}

impl BeyondSlips {
    /// The test that looks for the same as `test` does.
    pub fn same(&self, test: &RestTest) -> Option<&RestTest> {
        self.tests.iter().find(|t| t.looks_like == test.looks_like)
    }

    /// As [`Rest::noise_factor`], of what they leave.
    pub fn noise_factor(&self) -> f64 {
        noise_factor(&self.tests)
    }

    /// χ² that the errors take, less what they pay for it.
    pub fn gain(&self) -> f64 {
        2.0 * self.evidence
    }
}

/// What small errors of the setup leave of a rest.
#[derive(Debug, Clone)]
pub struct AfterSlips {
    /// As [`RestCurve::rest`], curve by curve.
    pub rest: Vec<Vec<Complex64>>,
    /// What they pay for their sizes: Σ (size / standard deviation)².
    pub price: f64,
    /// As in [`BeyondSlips`].
    pub unlikely: f64,
    /// ln of the evidence for such errors against none.
    pub evidence: f64,
    /// Σ r²/σ² to which their effect on the FRFs was worked out.
    pub known_to: f64,
}

/// Share of the signal that a good setup is still wrong by (gain, direction of the hit, angles of the joints).
pub const SMALL_ERROR: f64 = 0.01;
/// Chance at which noise passes for structure. Of hundreds of campaigns with four tests each none should; what is as
/// improbable as this is physics without a name far more often than noise.
const SIGNIFICANT_P: f64 = 1e-5;
/// What these are, for people.
const SMALL_ERRORS: &str =
    "angles of joints, sensors and hits, gain of the hammer, stiffness from posture to posture, warming up";
/// What the patterns of one place look like.
pub const LIKE_A_PLACE: &str = "one law at one place of the structure, the same at all postures";
/// What the patterns of a resonance of one place look like.
pub const LIKE_A_RESONANCE: &str = "a resonance at one place, the same at all postures";
/// What the patterns of folds with parameters of their own look like.
pub(crate) const LIKE_FOLDS: &str = "parameters that differ from posture to posture";

impl Rest {
    /// Whether more than noise is left.
    pub fn is_significant(&self) -> bool {
        self.tests.iter().any(RestTest::is_significant)
    }

    /// The test that finds most, of those that find more than chance.
    pub fn largest(&self) -> Option<&RestTest> {
        largest(&self.tests)
    }

    /// What an excess is as a share of the signal.
    pub fn share_of_signal(&self, excess: f64) -> f64 {
        SMALL_ERROR * (excess.max(0.0) / self.small_errors.max(f64::MIN_POSITIVE)).sqrt()
    }

    /// What is left in words, where the small errors of a setup explain nearly all of it.
    pub fn excuse_in_words(&self) -> Option<String> {
        let largest = self.largest()?;
        if !self.is_mostly_slips() {
            return self.own_errors_in_words(largest);
        }
        let share = self.share_of_slips()?;
        Some(format!(
            "{:.1} % of the signal, {:.0} % of it as small errors of every setup leave it ({SMALL_ERRORS})",
            100.0 * self.share_of_signal(largest.excess),
            100.0 * share,
        ))
    }

    /// Why nothing is called missing although not all that is left is noise; `None` where it is.
    pub fn small_errors_in_words(&self) -> Option<String> {
        // Too faint for a single test, they were sought because all of them together said that something is there.
        let faint = || {
            (self.beyond_slips.is_some() && !self.is_significant()).then(|| {
                format!(
                    "no line by itself stands above the noise, and what all of them together show is explained better by small errors of \
                     every setup than by any effect ({SMALL_ERRORS})"
                )
            })
        };
        let plain = self.excuse_in_words();
        plain
            .map(|left| format!("what stands above the noise is {left}"))
            .or_else(faint)
    }

    /// The same where each curve has errors of its own.
    fn own_errors_in_words(&self, largest: &RestTest) -> Option<String> {
        /// ln of a Bayes factor from which on it is said.
        const SAID: f64 = 2.0;
        let own = self.beyond_slips.as_ref()?.own_errors?;
        (own.log_factor() > SAID).then(|| {
            format!(
                "{:.1} % of the signal, smooth over the lines and new in each FRF: the FRFs of one posture have nothing of it in common, \
                 as errors of the measurement leave it (windows, leakage, few averages), and nothing in the structure, a channel or a hammer",
                100.0 * self.share_of_signal(largest.excess),
            )
        })
    }

    /// Whether small errors of the setup explain nearly all of what tests of structure find.
    pub fn is_mostly_slips(&self) -> bool {
        const NEARLY: f64 = 0.9;
        self.share_of_slips().is_some_and(|share| share > NEARLY)
    }

    /// Share of what tests of structure find that small errors of the setup explain; `None` where that was not tried.
    pub fn share_of_slips(&self) -> Option<f64> {
        let before = self.largest()?;
        let after = self.beyond_slips.as_ref()?.same(before)?;
        Some((1.0 - after.excess / before.excess).clamp(0.0, 1.0))
    }

    /// How much larger than those of white noise of the known level the squares of estimates are: noise that neighbouring
    /// lines, or the outputs of one hit, have in common. 1 where that was not tested.
    pub fn noise_factor(&self) -> f64 {
        noise_factor(&self.tests)
    }
}

fn noise_factor(tests: &[RestTest]) -> f64 {
    let folds = tests.iter().filter(|t| t.looks_like == LIKE_FOLDS);
    folds.map(|t| t.noise_factor).fold(1.0, f64::max)
}

/// The test that finds most, of those that find more than chance.
pub fn largest(tests: &[RestTest]) -> Option<&RestTest> {
    let found = tests.iter().filter(|t| t.is_significant());
    found.max_by(|a, b| a.excess.total_cmp(&b.excess))
}

/// What one kind of patterns finds in a rest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RestTest {
    /// What the patterns are.
    pub looks_like: &'static str,
    /// Σ r²/σ² in them above what noise leaves there.
    pub excess: f64,
    /// Standard deviation of that for noise alone.
    pub std: f64,
    /// Chance that noise alone leaves as much.
    pub p_value: f64,
    /// Energy expected of the noise over that of white noise of the known level.
    pub noise_factor: f64,
    /// Where the patterns that find it have a resonance, Hz; `None` for patterns that have none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frequency_hz: Option<f64>,
}

impl RestTest {
    /// Whether noise alone leaves as much too rarely to be believed.
    pub fn is_significant(&self) -> bool {
        self.p_value < SIGNIFICANT_P
    }

    /// `found`: energy in `values` real values where noise leaves `expected` ± `std`; its distribution taken for that of a scaled χ² with the same
    /// mean and variance (Satterthwaite 1946). `None` where nothing is expected.
    pub(crate) fn new(
        looks_like: &'static str,
        found: f64,
        expected: f64,
        std: f64,
        values: f64,
    ) -> Option<Self> {
        let freedom = 2.0 * (expected / std).powi(2);
        let p_value = ChiSquared::new(freedom)
            .ok()?
            .sf((found * freedom / expected).max(0.0));
        (expected > 0.0 && found.is_finite()).then_some(RestTest {
            looks_like,
            excess: found - expected,
            std,
            p_value,
            noise_factor: expected / values,
            frequency_hz: None,
        })
    }

    /// Energy `found` in `freedom` values whose noise variance is known but for a relative standard deviation
    /// `noise_known_to`.
    pub fn against_known_noise(
        looks_like: &'static str,
        found: f64,
        freedom: f64,
        noise_known_to: f64,
    ) -> Option<Self> {
        let std = (2.0 * freedom).sqrt().hypot(noise_known_to * freedom);
        (freedom > 0.0).then(|| Self::new(looks_like, found, freedom, std, freedom))?
    }

    /// Whether the patterns are of one place: few unknowns for all FRFs together.
    pub fn is_of_a_place(&self) -> bool {
        [LIKE_A_PLACE, LIKE_A_RESONANCE].contains(&self.looks_like)
    }

    /// What the patterns are, and where they have a resonance.
    pub fn in_words(&self) -> String {
        match self.frequency_hz {
            Some(hz) => format!("{} ({hz:.1} Hz)", self.looks_like),
            None => self.looks_like.into(),
        }
    }

    /// Excess in standard deviations of what noise leaves.
    pub fn sigmas(&self) -> f64 {
        self.excess / self.std.max(f64::MIN_POSITIVE)
    }
}
