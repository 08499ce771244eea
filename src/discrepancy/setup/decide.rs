//! From trials to findings: how sure.

use super::finding::SetupFinding;
use crate::discrepancy::something_else;
use crate::discrepancy::verdict::evidence_weight;
use crate::identify::rest::{Rest, RestTest};

/// A mistake fitted to all data.
#[derive(Debug, Clone)]
pub struct TriedMistake {
    pub finding: SetupFinding,
    /// With the priors.
    pub chi2: f64,
    pub parameters: usize,
    /// Mistakes of the same sort that were looked at.
    pub tried: f64,
    /// Its size stopped at the end of what is possible.
    pub at_bound: bool,
}

impl TriedMistake {
    /// Whether it changes the data as another one does, so that nothing in them can tell the two apart.
    fn does_the_same(&self, other: &TriedMistake) -> bool {
        const ROUNDING: f64 = 1e-6;
        self.parameters == other.parameters
            && (self.chi2 - other.chi2).abs() <= ROUNDING * self.chi2.min(other.chi2)
            && (self.finding.kind, &self.finding.place) != (other.finding.kind, &other.finding.place)
    }

    /// What to do about it, and what else it may be.
    fn remedy_with<'t>(&self, same: impl Iterator<Item = &'t TriedMistake>) -> String {
        let same: Vec<String> = same
            .map(|t| format!("{} ({})", t.finding.kind, t.finding.place))
            .collect();
        match same.is_empty() {
            true => self.finding.remedy.clone(),
            false => format!(
                "{} These data cannot tell it from {}.",
                self.finding.remedy,
                same.join(" or ")
            ),
        }
    }
}

pub struct SetupDecision {
    pub findings: Vec<SetupFinding>,
    pub reduced_chi2: f64,
    pub explained_share: f64,
}

/// Findings less sure than this are not told.
const LEAST_CONFIDENCE: f64 = 0.05;
/// Most that is ever believed.
const MOST: f64 = 0.98;
/// What the library holds besides: the best of so many effects.
const LIBRARY: f64 = 25.0;
/// Share of what stands above the noise from which on a mistake explains it, and below which it does not.
const EXPLAINS: [f64; 2] = [0.9, 0.4];

/// Mistakes that make one channel late.
const LATE: [&str; 2] = ["amplifier-low-pass", "late-channel"];
/// Mistakes that make all forces of a cut larger by one factor: of a straight edge nothing tells them apart.
const LARGER: [&str; 2] = ["axial-depth", "channel-gain"];

/// Of two that nothing in the data tells apart the rarer one: angles come from the controller, axes are written down by hand.
const RARE: &str = "encoder-offset";

/// The best that the library of effects can do on these data.
#[derive(Debug, Clone, Default)]
pub struct Rival {
    /// `effect@site`.
    pub label: String,
    /// Share of χ² that it takes away from the model as it stands, 0..1.
    pub gain_share: f64,
    /// Its own parameters.
    pub parameters: usize,
}

/// What else may explain the data.
#[derive(Debug, Default)]
pub struct Rivals {
    /// The best of the library of effects.
    pub library: Option<Rival>,
    /// χ² that the small errors of a careful setup take away, less what they pay for it.
    pub small_errors: Option<f64>,
}

/// What a misfit is held against.
#[derive(Debug, Clone, Copy)]
pub struct Noise {
    /// Real values.
    pub values: usize,
    /// Relative standard deviation of the noise's variance.
    pub known_to: f64,
    /// Σ r²/σ² that small errors of a setup leave.
    pub small_errors: f64,
}

/// Odds that something else is behind a mistake which leaves `chi2` of `base`, by the size of what it leaves.
fn odds_against(chi2: f64, base: f64, noise: Noise) -> f64 {
    let test =
        RestTest::against_known_noise("more than the noise", chi2, noise.values as f64, noise.known_to);
    test.filter(RestTest::is_significant).map_or(0.0, |test| {
        let rest = Rest {
            tests: vec![test],
            small_errors: noise.small_errors,
            beyond_slips: None,
        };
        something_else::odds(base - chi2, &rest)
    })
}

/// `base`: χ² of the model as it stands.
pub fn decide(
    tried: &[TriedMistake],
    base: f64,
    noise: Noise,
    rivals: impl FnOnce() -> Rivals,
) -> Option<SetupDecision> {
    let n = noise.values as f64;
    let least = tried.iter().map(|t| t.chi2).fold(f64::INFINITY, f64::min);
    if !least.is_finite() || least >= base {
        return None;
    }
    // What even the best explanation leaves over scales what counts as evidence.
    let scale = (least / n).max(1.0);
    let bic = |chi2: f64, parameters: usize, looked: f64| {
        (chi2 - base) / scale + parameters as f64 * n.ln() + 2.0 * looked.ln()
    };
    let bics: Vec<f64> = tried.iter().map(|t| bic(t.chi2, t.parameters, t.tried)).collect();
    let lowest = bics.iter().copied().fold(f64::INFINITY, f64::min);
    if lowest > -10.0 {
        return None;
    }
    let excess = base - n;
    let share = |chi2: f64| match excess > base - chi2 {
        true => (base - chi2) / excess,
        false => 1.0,
    };
    if share(least) < EXPLAINS[1] {
        return None;
    }
    let Rivals {
        library,
        small_errors,
    } = rivals();
    let physics = library.map(|r| bic(base * (1.0 - r.gain_share), r.parameters, LIBRARY));
    // Small errors everywhere have paid for themselves already.
    let small_errors = small_errors.map(|gain| bic(base - gain, 0, 1.0));
    let weights: Vec<f64> = bics.iter().map(|b| evidence_weight(b - lowest)).collect();
    // Two forms of one mistake (the order of a filter, or the delay that it is) are no rivals, nor are two that do the same to the data
    // (axes exchanged, or the first joint a quarter turn on): the better one speaks for both.
    let alike = |a: &TriedMistake, b: &TriedMistake| {
        let both = |kinds: &[&str]| [a, b].iter().all(|t| kinds.contains(&t.finding.kind));
        let of_one_sort = a.finding.kind == b.finding.kind || both(&LATE) || both(&LARGER);
        (a.finding.place == b.finding.place && of_one_sort) || a.does_the_same(b)
    };
    let first_of_its_kind = |i: usize| {
        let speaks_for_it = |j: usize| {
            let is_rare = |k: usize| tried[i].does_the_same(&tried[j]) && tried[k].finding.kind == RARE;
            (is_rare(j), bics[j], j) < (is_rare(i), bics[i], i)
        };
        !(0..tried.len()).any(|j| j != i && alike(&tried[i], &tried[j]) && speaks_for_it(j))
    };
    let weights: Vec<f64> = (0..tried.len())
        .map(|i| if first_of_its_kind(i) { weights[i] } else { 0.0 })
        .collect();
    let others = [Some(0.0), physics, small_errors]
        .into_iter()
        .flatten()
        .map(|b| evidence_weight(b - lowest))
        .sum::<f64>();
    let sum: f64 = weights.iter().sum::<f64>() + others;
    let mut findings: Vec<SetupFinding> = tried
        .iter()
        .zip(&weights)
        .map(|(t, weight)| {
            let [enough, too_little] = EXPLAINS;
            let explains = ((share(t.chi2) - too_little) / (enough - too_little)).clamp(0.0, 1.0);
            let possible = if t.at_bound { 0.3 } else { 1.0 };
            let alone = 1.0 / (1.0 + odds_against(t.chi2, base, noise));
            SetupFinding {
                confidence: MOST * weight / sum * explains * possible * alone,
                remedy: t.remedy_with(tried.iter().filter(|other| t.does_the_same(other))),
                ..t.finding.clone()
            }
        })
        .filter(|f| f.confidence >= LEAST_CONFIDENCE)
        .collect();
    findings.sort_by(|a, b| b.confidence.total_cmp(&a.confidence));
    let best = tried.iter().zip(&bics).min_by(|a, b| a.1.total_cmp(b.1))?.0;
    Some(SetupDecision {
        findings,
        reduced_chi2: best.chi2 / n,
        explained_share: share(best.chi2).clamp(0.0, 1.0),
    })
}
