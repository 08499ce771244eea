//! "Something else" as a rival of every effect: physics that the library does not have.
//!
//! An effect that is there leaves noise, and the small errors of every setup. A stand-in for something else takes away a
//! share of what it can follow and leaves a rest of about the same size. How large that rest is against what the effect
//! explains, in each test of structure ([`crate::identify::rest`]), is the evidence: the density of the rest found if the
//! effect is there over its density if it is a stand-in (a Bayes factor: Kass & Raftery 1995).

use std::f64::consts::TAU;

use super::setup::CARE;
use crate::identify::own_errors::OwnErrors;
use crate::identify::rest::{Rest, RestTest};
use crate::statistics::ln_normal;

/// Probability that the errors of the setup are large enough to be seen.
pub(super) const VISIBLE_ERRORS: f64 = 0.1;
/// Probability that a setup has no small errors but those that are fitted: then nothing is left of them.
const ALL_FITTED: f64 = 0.9;
/// Probability that each FRF has errors of its own besides noise that are large enough to be seen.
const OWN_ERRORS: f64 = 0.5;
/// Share of such errors that small errors of the setup take at most, for they follow none of them.
const TAKEN_OF_OWN: f64 = 0.5;
/// Probability that the law of an effect that is there is right to this part of its force only, or where it acts is: what it explains
/// a thousand times over leaves as much.
const NEARLY_RIGHT: f64 = 0.1;
const LAW_ERROR: f64 = 5e-3;
/// Share of what else there is that is not a law at one place of the structure (files, sensors, geometry, several places at
/// once), so that the test for that need not see it.
const BESIDES_PLACES: f64 = 0.5;
/// Prior odds of an effect of the library against something else.
const LIBRARY_ODDS: f64 = 2.0;
/// A pair of effects is one of many that were tried, and two effects at once are rarer than one. Where there are two, a third is
/// no great surprise.
const SECOND_ODDS: f64 = 0.1;
const FURTHER_ODDS: f64 = 0.3;

/// Odds that something else is behind an effect which takes `gain` of χ² away and leaves `rest`.
pub fn odds(gain: f64, rest: &Rest) -> f64 {
    (-log_bayes_factor(gain, rest)).exp() / LIBRARY_ODDS
}

/// The same for `count` effects together.
pub fn odds_of_set(gain: f64, rest: &Rest, count: usize) -> f64 {
    let prior = match count {
        0 | 1 => 1.0,
        _ => SECOND_ODDS * FURTHER_ODDS.powi(count as i32 - 2),
    };
    odds(gain, rest) / prior
}

/// ln of the Bayes factor of "the effect is there" against "it stands in for something else". The tests look at the same
/// rest in different ways. Where one finds more than noise, the one that finds most sees all of the rest and decides;
/// else what the most telling one says for the effect counts, and what the most telling one says against it.
fn log_bayes_factor(gain: f64, rest: &Rest) -> f64 {
    if !(gain > 0.0) {
        return 0.0;
    }
    if let Some(largest) = rest.largest() {
        // Where small errors were fitted, what they leave tells more than the size of the rest.
        return excused(gain, largest, rest)
            .unwrap_or_else(|| of_test(gain, largest, rest.small_errors, rest_of_a_stand_in));
    }
    let factors = rest
        .tests
        .iter()
        .map(|t| of_test(gain, t, rest.small_errors, part_of_a_rest));
    let (low, high) = factors.fold((0.0f64, 0.0f64), |(low, high), f| (low.min(f), high.max(f)));
    low + high
}

/// ln of the Bayes factor of "the effect is there and the small errors of the setup have their usual sizes" against "it
/// stands in for something else". Errors of usual sizes leave about their usual energy, and next to nothing after they were
/// fitted; of what something else leaves they may take any share.
fn excused(gain: f64, largest: &RestTest, rest: &Rest) -> Option<f64> {
    // Of what is no error of the setup such errors may take any share.
    let any_share = -largest.excess.ln();
    let there = log_sum(&[
        VISIBLE_ERRORS.ln() + of_usual_errors(largest, rest)?,
        of_nearly_right(gain, largest) + any_share,
    ]);
    let stand_in = (rest_of_a_stand_in(largest.excess / gain) / gain).ln() + any_share;
    Some(there - stand_in)
}

/// ln of the density of a rest because the law is nearly right.
fn of_nearly_right(gain: f64, test: &RestTest) -> f64 {
    let scale = LAW_ERROR.powi(2) * gain;
    NEARLY_RIGHT.ln() + log_density(test.excess.max(0.0), test.std, scale, |u| (-u).exp())
}

/// ln of the density of a rest, and of what slips leave of it, if the small errors of the setup have their usual sizes.
fn of_usual_errors(largest: &RestTest, rest: &Rest) -> Option<f64> {
    let beyond = rest.beyond_slips.as_ref()?;
    let after = beyond.same(largest)?;
    let exponential: fn(f64) -> f64 = |u| (-u).exp();
    // The laboratory's care is a factor (log-normal), and its errors have sizes that are more or less likely together.
    let found = -0.5 * (TAU * CARE * CARE).ln() - beyond.unlikely - largest.excess.ln();
    let excess = after.excess.max(0.0);
    let mut left = vec![
        ALL_FITTED.ln() + ln_normal(excess, after.std),
        (1.0 - ALL_FITTED).ln() + log_density(excess, after.std, rest.small_errors, exponential),
    ];
    let own = beyond.own_errors;
    left.extend(own.map(|own| of_own_errors(excess, &own, rest)));
    let mut ways = vec![found + log_sum(&left)];
    // Errors of each curve alone, and hardly any others.
    ways.extend(
        own.filter(|_| excess > (1.0 - TAKEN_OF_OWN) * largest.excess)
            .map(|own| of_own_errors(largest.excess, &own, rest) - (TAKEN_OF_OWN * largest.excess).ln()),
    );
    Some(log_sum(&ways))
}

/// ln of the density of what slips leave, if each curve has errors of its own: their size is about the usual one, or some times that.
fn of_own_errors(excess: f64, own: &OwnErrors, rest: &Rest) -> f64 {
    let excess = excess.max(f64::MIN_POSITIVE);
    // Energy goes with the square of the size.
    let size = 0.5 * (excess / rest.small_errors.max(f64::MIN_POSITIVE)).ln();
    OWN_ERRORS.ln() + own.log_factor() + ln_normal(size, CARE) - (2.0 * excess).ln()
}

/// Odds that something the library does not have is behind what a model leaves, against the small errors of the setup.
/// Foreign physics may be of any size. Without end where nothing is known of such errors.
pub fn odds_against_slips(rest: &Rest) -> f64 {
    /// ln of the largest size of foreign physics over the smallest that would be seen.
    const SIZES: f64 = 10.0;
    let largest = rest.largest();
    let Some((largest, slips)) = largest.and_then(|l| Some((l, of_usual_errors(l, rest)?))) else {
        return f64::INFINITY;
    };
    let foreign = -(SIZES * largest.excess).ln() - largest.excess.ln();
    (foreign - slips - VISIBLE_ERRORS.ln()).exp() / LIBRARY_ODDS
}

/// Prior odds of something too faint to be seen beyond doubt against nothing, however much data there is.
const FAINT_ODDS: f64 = 0.2;
/// Prior odds of something that matters against nothing.
const HIDDEN_ODDS: f64 = 1.0;
/// Sizes that matter, as shares of the noise's χ²: each power of ten between them as likely.
const SIZES_THAT_MATTER: [f64; 2] = [1e-3, 0.3];
/// Standard deviations by which something has to stand out to be found among many candidates.
const FOUND_SIGMAS: f64 = 6.0;

/// Prior odds of something that so many independent values are too few to show, against nothing.
fn odds_of_too_little_data(values: f64) -> f64 {
    let [least, most] = SIZES_THAT_MATTER;
    let visible = FOUND_SIGMAS * FOUND_SIGMAS / values.max(1.0);
    let missed = (visible / least).ln() / (most / least).ln();
    FAINT_ODDS + HIDDEN_ODDS * missed.clamp(0.0, 1.0)
}

/// Bayes factor of something hidden against nothing, where noise alone would look at least as unlikely with probability
/// `p`: something hidden gives p a density ξ p^(ξ−1), steeper the more of it shows, every ξ from 0 to 1 as likely (after
/// Sellke, Bayarri and Berger 2001, who take the ξ that speaks most against noise).
pub fn evidence_of_chance(p: f64) -> f64 {
    let a = -p.clamp(f64::MIN_POSITIVE, 1.0).ln();
    // (e^a − 1 − a) / a², which is 1/2 at a = 0.
    match a < 1e-3 {
        true => 0.5 + a / 6.0,
        false => (a.exp_m1() - a) / (a * a),
    }
}

/// Odds that something is hidden, the library's or not, against nothing. Bayes factors of what the tests of the rest and
/// what the candidates have seen; what is hidden shows to either, both or neither, with even odds. `values`: independent ones.
pub fn odds_of_something_faint(of_tests: f64, of_candidates: f64, values: f64) -> f64 {
    odds_of_too_little_data(values) * 0.5 * (1.0 + of_tests) * 0.5 * (1.0 + of_candidates)
}

/// `stand_in`: density of rest / gain if the effect stands in for something else.
fn of_test(gain: f64, test: &RestTest, small_errors: f64, stand_in: fn(f64) -> f64) -> f64 {
    // Less than noise is no better than noise.
    let excess = test.excess.max(0.0);
    let noise = ln_normal(excess, test.std);
    let there = [
        (1.0 - VISIBLE_ERRORS - NEARLY_RIGHT).ln() + noise,
        VISIBLE_ERRORS.ln() + log_density(excess, test.std, small_errors, |u| (-u).exp()),
        of_nearly_right(gain, test),
    ];
    let blind = match test.is_of_a_place() {
        true => BESIDES_PLACES,
        false => 0.0,
    };
    let seen = log_density(excess, test.std, gain, stand_in);
    log_sum(&there) - log_sum(&[(1.0 - blind).ln() + seen, blind.ln() + noise])
}

/// Density of x = rest / gain for a stand-in: the share 1/(1 + x) that it explains is anything from none to all.
fn rest_of_a_stand_in(x: f64) -> f64 {
    (1.0 + x).powi(-2)
}

/// Density of u = κ x where a test sees a part κ of the rest that is anything from none to all.
fn part_of_a_rest(u: f64) -> f64 {
    (1.0 / u).ln_1p() - 1.0 / (1.0 + u)
}

/// ln of the density of finding `excess` ± `std` where the true excess over `scale` has the density `of`.
fn log_density(excess: f64, std: f64, scale: f64, of: fn(f64) -> f64) -> f64 {
    /// Standard deviations from which on the scatter is too narrow to matter.
    const NARROW: f64 = 8.0;
    const STEPS: usize = 1000;
    // What has no size leaves noise alone.
    if scale <= 0.0 {
        return ln_normal(excess, std);
    }
    if excess > NARROW * std {
        return of(excess / scale).ln() - scale.ln();
    }
    // On a logarithmic grid: densities may be steep at zero, and either width may be the smaller one.
    let (low, high) = (1e-6 * std.min(scale), 2.0 * NARROW * std);
    let step = (high / low).ln() / STEPS as f64;
    let terms: Vec<f64> = (0..=STEPS)
        .map(|i| low * (i as f64 * step).exp())
        .map(|e| ln_normal(excess - e, std) + (of(e / scale) * e / scale * step).ln())
        .collect();
    log_sum(&terms)
}

fn log_sum(logs: &[f64]) -> f64 {
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if most == f64::NEG_INFINITY {
        return most;
    }
    most + logs.iter().map(|l| (l - most).exp()).sum::<f64>().ln()
}

/// Share of what stands above the noise that an effect with this gain of χ² explains, and its standard deviation. `rest`:
/// after it.
pub fn share_explained(gain: f64, rest: &Rest) -> [f64; 2] {
    let left = rest.largest().map_or(0.0, |t| t.excess);
    let all = (gain + left).max(f64::MIN_POSITIVE);
    // Gains scatter by twice their root (a noncentral χ²); of the tests the sharpest one bounds what is not found.
    let sharpest = rest.tests.iter().map(|t| t.std).fold(f64::INFINITY, f64::min);
    let std = (4.0 * gain.max(0.0))
        .sqrt()
        .hypot(if sharpest.is_finite() { sharpest } else { 0.0 });
    let std = match left > 0.0 {
        true => std / all,
        // An effect that leaves nothing explains all of it, less what could not be seen.
        false => sharpest.min(all) / all,
    };
    [(gain / all).clamp(0.0, 1.0), std.min(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::rest::{BeyondSlips, LIKE_A_PLACE};

    fn rest(excess: f64, std: f64) -> Rest {
        Rest {
            tests: vec![RestTest::new("structure", 1000.0 + excess, 1000.0, std, 1000.0).unwrap()],
            small_errors: 500.0,
            beyond_slips: None,
        }
    }

    #[test]
    fn densities_are_densities() {
        let exponential: fn(f64) -> f64 = |u| (-u).exp();
        for of in [rest_of_a_stand_in, part_of_a_rest, exponential] {
            // Over what may be found, from far below zero on, for scatter narrow and wide against the density.
            for (std, tail) in [(0.3, 0.06), (5.0, 0.1)] {
                let step = 0.05 * std;
                let sum: f64 = (-160..160)
                    .map(|i| log_density(f64::from(i) * step, std, 1.0, of).exp() * step)
                    .sum();
                let beyond: f64 = (0..20000)
                    .map(|i| 8.0 * std + (f64::from(i) + 0.5) * 0.05)
                    .map(|x| of(x) * 0.05)
                    .sum();
                assert!((sum + beyond - 1.0).abs() < tail, "{std}: {sum} {beyond}");
            }
        }
        // The narrow limit is the general case's.
        let [below, above] = [7.99, 8.01].map(|z| log_density(z, 1.0, 50.0, part_of_a_rest));
        assert!((below - above).abs() < 0.02, "{below} {above}");
    }

    #[test]
    fn an_effect_that_leaves_nothing_beats_something_else_the_more_it_explains() {
        let clean = |gain| odds(gain, &rest(0.0, 30.0));
        assert!(clean(1e5) < 0.01, "{}", clean(1e5));
        assert!(clean(1e3) < 0.15 && clean(1e3) > clean(1e4), "{}", clean(1e3));
        // What the test cannot see says nothing: the prior odds stand.
        assert!((odds(1.0, &rest(0.0, 1e4)) * LIBRARY_ODDS - 1.0).abs() < 0.1);
    }

    /// Of a campaign that small errors leave nothing of (no signal is known): a probability all the same.
    #[test]
    fn odds_are_numbers_where_small_errors_have_no_size() {
        for excess in [0.0, 20.0, 3000.0] {
            let mut rest = rest(excess, 30.0);
            rest.small_errors = 0.0;
            assert!(odds(1e4, &rest) > 0.0, "{excess}: {}", odds(1e4, &rest));
        }
    }

    #[test]
    fn a_rest_as_large_as_what_is_explained_is_something_else() {
        assert!(odds(5000.0, &rest(3000.0, 100.0)) > 3.0);
        // Without end where no error of a setup is as large; a probability all the same.
        let beyond = odds(2e5, &rest(1e7, 10.0));
        assert!(beyond > 1e100 && 1.0 / (1.0 + 1.0 / beyond) == 1.0, "{beyond}");
        // However sharply it is seen, and however small it is against what the effect explains.
        assert!(odds(2e5, &rest(1.5e5, 16.0)) > 1e3);
        // One that a good setup leaves anyway is not, if the effect is far larger.
        assert!(odds(2e5, &rest(400.0, 50.0)) < 0.2);
        let of = |count| odds_of_set(5e3, &rest(0.0, 50.0), count);
        assert!(of(1) == odds(5e3, &rest(0.0, 50.0)) && of(2) > 5.0 * of(1) && of(3) > 3.0 * of(2));
    }

    #[test]
    fn what_noise_hardly_leaves_is_something() {
        // On average over what noise does, Bayes factors against noise are one.
        let steps = 200_000;
        let sum: f64 = (0..steps)
            .map(|i| evidence_of_chance((f64::from(i) + 0.5) / f64::from(steps)))
            .sum();
        let mean = sum / f64::from(steps);
        assert!((0.85..=1.0).contains(&mean), "{mean}");
        assert!(evidence_of_chance(0.0).is_finite() && evidence_of_chance(0.0) > 1e100);
        // Nothing seen, a hint in one of both, hints in both, no doubt.
        let odds = |p, evidence| odds_of_something_faint(evidence_of_chance(p), evidence, 1e5);
        assert!(odds(1.0, 0.0) < 0.1);
        assert!((0.1..0.5).contains(&odds(0.01, 0.01)));
        assert!(odds(0.01, 10.0) > 2.0);
        assert!(odds(1e-5, 0.0) > 20.0 && odds(1.0, 1e6) > 20.0);
        // Of 3,600 values six standard deviations are a hundredth: 40 % of the sizes that matter stay below it.
        let few = odds_of_something_faint(evidence_of_chance(1.0), 0.0, 3600.0);
        assert!((few / odds(1.0, 0.0) - (0.2 + 10.0_f64.ln() / 300.0_f64.ln()) / 0.2).abs() < 1e-9);
        assert_eq!(
            odds_of_something_faint(1.0, 1.0, 36e3),
            odds_of_something_faint(1.0, 1.0, 1e9)
        );
    }

    /// What the sharp test for one place does not see is no proof: half of all else is not at one place.
    #[test]
    fn a_test_that_may_be_blind_proves_little() {
        let mut blind = rest(0.0, 5.0);
        blind.tests[0].looks_like = LIKE_A_PLACE;
        assert!(odds(1e5, &blind) > 0.5 / LIBRARY_ODDS && odds(1e5, &rest(0.0, 5.0)) < 0.01);
        // What it finds counts in full.
        blind.tests[0] = RestTest {
            excess: 4e4,
            p_value: 0.0,
            ..blind.tests[0]
        };
        assert!(odds(5e4, &blind) > 1.0);
    }

    /// A law that explains 254 times the noise leaves half a per cent of the noise: found by an independent simulator of a tool on a spring.
    #[test]
    fn what_a_law_leaves_that_is_nearly_right_is_not_something_else() {
        let mut left = with_slips(628.0, 599.0, 5.3);
        for rest in [&rest(628.0, 106.0), &left] {
            assert!(odds(3.8e7, rest) < 0.01, "{}", odds(3.8e7, rest));
            // A thousandth of what is explained is more than an inexact law.
            assert!(odds(6e5, rest) > 100.0 * odds(3.8e7, rest), "{}", odds(6e5, rest));
        }
        left.beyond_slips = None;
        assert!(odds(3.8e7, &left) < 0.01);
    }

    fn with_slips(excess: f64, after: f64, unlikely: f64) -> Rest {
        let mut rest = rest(excess, 30.0);
        let left = RestTest::new("structure", 1000.0 + after, 1000.0, 30.0, 1000.0);
        rest.beyond_slips = Some(BeyondSlips {
            tests: vec![left.unwrap()],
            unlikely,
            evidence: 0.5 * (excess - after),
            known_to: 0.0,
            own_errors: None,
        });
        rest
    }

    #[test]
    fn what_no_two_frfs_have_in_common_is_no_physics() {
        let with_own = |common: f64, excess: f64| {
            let mut rest = with_slips(excess, 0.95 * excess, 1.0);
            rest.small_errors = 2e4;
            let beyond = rest.beyond_slips.as_mut().unwrap();
            beyond.own_errors = Some(OwnErrors {
                common,
                common_std: 0.05,
                of_a_place: 0.01,
                of_a_place_std: 0.003,
            });
            rest
        };
        assert!(odds_against_slips(&with_own(0.0, 2e4)) < 0.3);
        assert!(odds_against_slips(&with_own(0.5, 2e4)) > 1.0);
        // Of many times the usual size they are something else.
        assert!(odds_against_slips(&with_own(0.0, 2e7)) > 1.0);
        // Beside an effect they are excused.
        assert!(odds(1e5, &with_own(0.0, 2e4)) < 0.3 * odds(1e5, &with_own(0.5, 2e4)));
    }

    #[test]
    fn a_rest_that_small_errors_of_usual_sizes_explain_is_no_evidence_against_an_effect() {
        // As large as they usually leave, and taken by them.
        let usual = odds(1e5, &with_slips(2e4, 0.0, 0.5));
        assert!(usual < 0.3, "{usual}");
        // Of sizes that no laboratory has together, or not taken by them.
        for other in [with_slips(2e4, 0.0, 10.0), with_slips(2e4, 1e4, 0.5)] {
            let odds = odds(1e5, &other);
            assert!(odds > 1.0 && odds > 10.0 * usual, "{odds}");
        }
        // The more an effect explains besides, the surer.
        assert!(odds(1e6, &with_slips(2e4, 0.0, 0.5)) < usual);
    }

    #[test]
    fn small_errors_alone_are_believed_where_they_leave_nothing_and_have_their_usual_sizes() {
        assert!(odds_against_slips(&with_slips(2e4, 0.0, 0.5)) < 0.3);
        assert!(odds_against_slips(&with_slips(2e4, 0.0, 10.0)) > 1.0);
        assert!(odds_against_slips(&with_slips(2e4, 1e4, 0.5)) > 1.0);
        // Not tried: no excuse.
        assert_eq!(odds_against_slips(&rest(2e4, 30.0)), f64::INFINITY);
        assert_eq!(odds_against_slips(&Rest::default()), f64::INFINITY);
    }

    #[test]
    fn the_share_is_of_what_was_explained_and_what_is_left() {
        let [share, std] = share_explained(1000.0, &rest(3000.0, 100.0));
        assert!((share - 0.25).abs() < 1e-9 && std > 0.0 && std < 0.1);
        assert_eq!(share_explained(1000.0, &rest(50.0, 100.0))[0], 1.0);
    }
}
