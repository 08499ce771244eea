//! Campaigns of which everything is drawn, for trying a diagnosis on many.

use super::FrfFormat;
use super::draw::{Draws, Purpose};
use super::foreign::FOREIGN;
use super::request::EffectRequest;
use super::scenario::{Kind, Layout, StructureScenario};
use crate::effects::STRUCTURAL;
use crate::ingest::Quantity;

/// Standard deviations at which the effects of random campaigns show: from just visible to plain.
const VISIBILITY_SIGMAS: [f64; 2] = [5.0, 1000.0];
/// Probabilities of what is hidden; the rest is one effect of the library.
const NONE: f64 = 0.2;
const UNKNOWN: f64 = 0.12;
const TWO: f64 = 0.1;
/// Needs two hammer levels.
const AMPLITUDE: &str = "amplitude-dependent-stiffness";
/// Hardly moves what a campaign of direct X and Y FRFs sees.
const AXIAL: &str = "tool-axial-flexibility";
const FORCE_LEVELS_N: [f64; 2] = [200.0, 50.0];

/// The scenario of a seed.
pub fn scenario(seed: u64) -> StructureScenario {
    // A seed of its own, so that what is hidden is independent of what `of_kind` and the rest draw from `seed`.
    let mut draws = Draws::new(seed ^ 0x6c6f_6265_7374_6f6e, Purpose::Scenario);
    let kind = *draws.pick(&[Kind::Careful, Kind::Careful, Kind::Direct, Kind::Dirty]);
    let mut scenario = StructureScenario::of_kind(kind, seed);
    if scenario.layout == Layout::Roving && draws.chance(0.3) {
        scenario.layout = Layout::Tool;
    }
    scenario.format = *draws.pick(&[FrfFormat::UffAscii, FrfFormat::UffBinary, FrfFormat::Csv]);
    scenario.quantity = *draws.pick(&[Quantity::Receptance, Quantity::Accelerance, Quantity::Mobility]);
    let request = |effect: &str| EffectRequest {
        effect: effect.into(),
        ..Default::default()
    };
    let what = draws.uniform(0.0, 1.0);
    // Drawn in any case, so that probabilities may change without changing all that follows.
    let first = *draws.pick(&STRUCTURAL);
    let mut second = *draws.pick(&STRUCTURAL);
    while second.id() == first.id() {
        second = *draws.pick(&STRUCTURAL);
    }
    let mut foreign = *draws.pick(&FOREIGN);
    while kind == Kind::Direct && foreign.id() == AXIAL {
        foreign = *draws.pick(&FOREIGN);
    }
    scenario.visibility_sigmas = Some(draws.log_uniform(VISIBILITY_SIGMAS[0], VISIBILITY_SIGMAS[1]));
    scenario.largest_size = 1.5;
    scenario.effects = if what < NONE {
        Vec::new()
    } else if what < NONE + UNKNOWN {
        // At full size: a faint one looks like any faint effect of the library.
        scenario.visibility_sigmas = None;
        vec![request(foreign.id())]
    } else if what < NONE + UNKNOWN + TWO {
        vec![request(first.id()), request(second.id())]
    } else {
        vec![request(first.id())]
    };
    // Two levels now and then elsewhere too: else the levels would tell what is hidden.
    let two_levels = draws.chance(0.15);
    if two_levels || scenario.effects.iter().any(|e| e.effect == AMPLITUDE) {
        scenario.force_levels_n = FORCE_LEVELS_N.to_vec();
    }
    scenario
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_cover_kinds_and_effects() {
        let all: Vec<StructureScenario> = (0..300).map(scenario).collect();
        let count = |test: &dyn Fn(&StructureScenario) -> bool| all.iter().filter(|s| test(s)).count();
        assert!((40..=80).contains(&count(&|s| s.effects.is_empty())));
        assert!((15..=55).contains(&count(&|s| s.effects.len() == 2)));
        for effect in STRUCTURAL.into_iter().chain(FOREIGN) {
            assert!(
                count(&|s| s.effects.iter().any(|e| e.effect == effect.id())) > 0,
                "{}",
                effect.id()
            );
        }
        for kind in [Kind::Careful, Kind::Direct, Kind::Dirty] {
            assert!(count(&|s| s.kind == kind) > 40);
        }
        assert_eq!(scenario(5), scenario(5));
        assert_ne!(scenario(5), scenario(6));
    }
}
