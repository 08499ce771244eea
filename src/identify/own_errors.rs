//! Errors that each measured curve has of its own, against something that several curves have in common: the evidence.

use statrs::distribution::{ContinuousCDF, Normal};

use crate::statistics::ln_normal;

/// What two curves may have in common although their errors are their own, over what chance puts there.
pub(super) const UNSURE: f64 = 0.1;
/// What something else gives curves in common over chance, at most.
const COMMON: f64 = 2.5;
/// Share of errors of each curve that a law at one place takes, for the places are many and it has a few unknowns in each band.
const OF_A_PLACE: f64 = 0.01;
/// Share of something else that is no law at one place, so that it takes next to nothing of it, and the share that is such a law takes
/// of what it is held for.
const BESIDES_PLACES: f64 = 0.15;
const PLACE_TAKES: [f64; 2] = [0.04, 1.2];

/// What speaks for errors that each curve has of its own.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct OwnErrors {
    /// What the curves of a fold have in common over what chance puts there, less 1.
    pub common: f64,
    /// Standard deviation of that for curves that have nothing in common.
    pub common_std: f64,
    /// Share of what is left that the best law at one place takes.
    pub of_a_place: f64,
    /// Standard deviation of that for noise.
    pub of_a_place_std: f64,
}

impl OwnErrors {
    /// ln of the Bayes factor of "each curve has errors of its own" against "something that several curves have in common".
    pub fn log_factor(&self) -> f64 {
        let common = ln_normal(self.common, self.common_std.hypot(UNSURE))
            - density_of_common(self.common, self.common_std).ln();
        let std = self.of_a_place_std.hypot(OF_A_PLACE);
        let share = self.of_a_place.max(0.0);
        let [least, most] = PLACE_TAKES;
        let place = (1.0 - BESIDES_PLACES) * at_least(share, least, std)
            / ((most / least).ln() * share.max(least))
            + BESIDES_PLACES * ln_normal(share - OF_A_PLACE, std).exp().min(1.0 / least);
        common + ln_normal(share - OF_A_PLACE, std) - place.ln()
    }
}

/// Density of what is found in common, where it is anything from nothing to all.
fn density_of_common(value: f64, std: f64) -> f64 {
    at_least(value, 0.0, std.hypot(UNSURE)) / COMMON
}

/// Probability that a value found as `value` ± `std` is `least` or more.
fn at_least(value: f64, least: f64, std: f64) -> f64 {
    Normal::standard().cdf((value - least) / std)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_curves_that_share_nothing_and_no_place_speak_for_errors_of_their_own() {
        let of = |common: f64, of_a_place: f64| {
            OwnErrors {
                common,
                common_std: 0.05,
                of_a_place,
                of_a_place_std: 0.003,
            }
            .log_factor()
        };
        assert!(of(0.0, 0.01) > 4.0, "{}", of(0.0, 0.01));
        assert!(of(0.5, 0.01) < -4.0, "{}", of(0.5, 0.01));
        assert!(of(1.0, 0.01) < -20.0, "{}", of(1.0, 0.01));
        assert!(of(0.0, 0.3) < -10.0, "{}", of(0.0, 0.3));
        assert!(of(0.1, 0.03) < of(0.0, 0.01));
    }

    #[test]
    fn few_data_tell_nothing() {
        let vague = OwnErrors {
            common: 0.2,
            common_std: 1.5,
            of_a_place: 0.1,
            of_a_place_std: 0.5,
        };
        assert!(vague.log_factor().abs() < 1.5, "{}", vague.log_factor());
    }
}
