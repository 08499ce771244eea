//! What is simulated on the structure side, and which settings make no campaign.

use serde::Serialize;

use super::draw::{Draws, Purpose};
use super::files::FrfFormat;
use super::laboratory::Slip;
use super::noise::LineNoise;
use super::postures::PostureScheme;
use super::request::EffectRequest;
use crate::ingest::Quantity;
use crate::{InputError, Result};

/// Noise that does not depend on the response, m/N (complex standard deviation).
pub const NOISE_FLOOR_M_PER_N: f64 = 2e-8;
/// Complex values that a campaign may have.
const MOST_VALUES: usize = 20_000_000;

/// How well a campaign is measured: ready-made settings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum CampaignKind {
    /// 6 postures, 3×3 FRFs at the tool point and roving points on the links, 1.5–3 % noise.
    Careful,
    /// 4 postures, only the direct X and Y FRFs at the tool point, 3–5 % noise.
    Direct,
    /// 6 postures, points as careful, 5–10 % noise, link masses up to 5 % off.
    Dirty,
}

/// Which FRFs are measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum FrfLayout {
    /// X/X and Y/Y at the tool point.
    Direct,
    /// All nine at the tool point.
    Tool,
    /// All nine at the tool point, and X, Y, Z of points on three links, excited at the tool point.
    Roving,
}

/// What is simulated. Everything not said here is drawn from the seed.
#[derive(Debug, Clone, PartialEq)]
pub struct StructureScenario {
    /// What everything else is drawn from.
    pub seed: u64,
    /// How well the campaign is measured.
    pub kind: CampaignKind,
    /// How postures are drawn.
    pub postures: PostureScheme,
    /// Which FRFs are measured.
    pub layout: FrfLayout,
    /// First and last line, Hz.
    pub band_hz: [f64; 2],
    /// Spacing of the lines, Hz.
    pub step_hz: f64,
    /// Complex standard deviation of the noise as a share of |H|.
    pub noise_relative: f64,
    /// Noise that is always there, m/N.
    pub noise_floor_m_per_n: f64,
    /// Relative standard deviation of the link masses; zero: masses are exact and not tunable.
    pub mass_error: f64,
    /// Standard deviation of the logarithm of the joint stiffnesses about the robot file.
    pub stiffness_error: f64,
    /// Hammer levels, N; empty: one level that nobody wrote down.
    pub force_levels_n: Vec<f64>,
    /// Format of the FRF files.
    pub format: FrfFormat,
    /// Motion that the FRF files hold, per force.
    pub quantity: Quantity,
    /// Effects that are hidden.
    pub effects: Vec<EffectRequest>,
    /// Kinds of [`super::departure`] in the lab.
    pub departures: Vec<String>,
    /// Of physics outside the library: Σ|ΔH|²/σ² per complex value that it leaves after everything else was refitted
    /// (0.03: 3 % of χ² above noise). Goes before the visibility.
    pub excess_share: Option<f64>,
    /// Small errors of setup.
    pub slips: Vec<Slip>,
    /// How the noise of neighbouring lines belongs together.
    pub line_noise: LineNoise,
    /// Share of the noise's variance that all outputs of one hit have in common (noise of the force channel).
    pub common_noise: f64,
    /// Size of the effects against what is drawn.
    pub strength: f64,
    /// Instead: the size at which each effect shows at so many standard deviations (see [`super::Visibility::sigmas`]).
    pub visibility_sigmas: Option<f64>,
    /// Effects do not become larger than this times what is drawn to reach that visibility.
    pub largest_size: f64,
    /// Effects keep to sizes that are possible, however faint they are asked to be.
    pub possible_only: bool,
}

impl StructureScenario {
    /// The settings of a kind, noise drawn from its range.
    pub fn of_kind(kind: CampaignKind, seed: u64) -> Self {
        let mut draws = Draws::new(seed, Purpose::Scenario);
        let scheme = |count, exact| PostureScheme {
            count,
            exact,
            spread_deg: 25.0,
        };
        let (postures, layout, noise, mass_error) = match kind {
            CampaignKind::Careful => (scheme(6, 2), FrfLayout::Roving, [0.015, 0.03], 0.0),
            CampaignKind::Direct => (scheme(4, 4), FrfLayout::Direct, [0.03, 0.05], 0.0),
            CampaignKind::Dirty => (scheme(6, 2), FrfLayout::Roving, [0.05, 0.1], 0.05),
        };
        StructureScenario {
            seed,
            kind,
            postures,
            layout,
            band_hz: [3.0, 90.0],
            step_hz: 0.2,
            noise_relative: draws.uniform(noise[0], noise[1]),
            noise_floor_m_per_n: NOISE_FLOOR_M_PER_N,
            mass_error,
            stiffness_error: 0.2,
            force_levels_n: Vec::new(),
            format: FrfFormat::UffAscii,
            quantity: Quantity::Receptance,
            effects: Vec::new(),
            departures: Vec::new(),
            excess_share: None,
            slips: Vec::new(),
            line_noise: LineNoise::White,
            common_noise: 0.0,
            strength: 1.0,
            visibility_sigmas: None,
            largest_size: 4.0,
            possible_only: false,
        }
    }

    /// Spectral lines, Hz.
    pub fn lines_hz(&self) -> Vec<f64> {
        let count = ((self.band_hz[1] - self.band_hz[0]) / self.step_hz + 1e-6).floor() as usize + 1;
        // Nine decimals: a line is 3.2 Hz, not 3.2000000000000002.
        let clean = |f: f64| (f * 1e9).round() / 1e9;
        (0..count)
            .map(|i| clean(self.band_hz[0] + i as f64 * self.step_hz))
            .collect()
    }

    /// Refuses settings that make no campaign.
    pub(super) fn check(&self) -> Result<()> {
        let fail = |key: &str, problem: String, remedy: &str| {
            Err(InputError::new(problem).key(key).remedy(remedy).into())
        };
        let [from, to] = self.band_hz;
        let step = self.step_hz;
        if !(from > 0.0 && to > from && to <= 1e5) {
            return fail(
                "--band",
                format!("{from},{to} Hz is no band"),
                "give first and last line, such as 3,90",
            );
        }
        if !(step >= 1e-4 && (to - from) / step >= 9.0) {
            return fail(
                "--lines-hz",
                format!("{step} Hz from {from} to {to} Hz gives fewer than ten lines, or far too many"),
                "give a spacing such as 0.2",
            );
        }
        let bounded = [
            ("--noise", self.noise_relative, 0.0, 1.0),
            ("--noise-floor", self.noise_floor_m_per_n, 0.0, 1e-3),
            ("--mass-error", self.mass_error, 0.0, 0.25),
            ("--stiffness-error", self.stiffness_error, 0.0, 1.0),
            ("--strength", self.strength, 0.0, 100.0),
            ("--share", self.excess_share.unwrap_or(1.0), 1e-6, 1e4),
            ("--common-noise", self.common_noise, 0.0, 1.0),
            ("--visibility", self.visibility_sigmas.unwrap_or(1.0), 0.1, 1e5),
            ("--spread-deg", self.postures.spread_deg, 0.0, 90.0),
            ("--postures", self.postures.count as f64, 1.0, 200.0),
        ];
        if let Some((key, value, low, high)) = bounded.into_iter().find(|(_, v, l, h)| !(l..=h).contains(&v))
        {
            return fail(
                key,
                format!("is {value}, out of range"),
                &format!("give a number from {low} to {high}"),
            );
        }
        if self.strength == 0.0 && !self.effects.is_empty() {
            return fail(
                "--strength",
                "an effect of strength 0 is none".into(),
                "leave the effect out",
            );
        }
        let levels = &self.force_levels_n;
        let mut sorted = levels.clone();
        sorted.sort_by(f64::total_cmp);
        sorted.dedup();
        if sorted.len() != levels.len() || levels.iter().any(|l| !(*l >= 1e-3 && *l <= 1e6)) {
            return fail(
                "--force-levels",
                "levels must be different and above zero".into(),
                "give newtons, such as 200,50",
            );
        }
        let per_line = match self.layout {
            FrfLayout::Direct => 2,
            FrfLayout::Tool => 9,
            FrfLayout::Roving => 36,
        };
        let lines = ((to - from) / step) as usize + 1;
        let values = per_line * self.postures.count * levels.len().max(1) * lines;
        if values > MOST_VALUES {
            return fail(
                "--lines-hz",
                format!("{values} values would be measured; {MOST_VALUES} are allowed"),
                "ask for fewer lines or postures",
            );
        }
        Ok(())
    }
}
