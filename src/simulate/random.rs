//! Campaigns of which everything is drawn, for trying a diagnosis on many.

use super::draw::{Draws, Purpose};
use super::files::FrfFormat;
use super::laboratory::Slip;
use super::noise::LineNoise;
use super::request::EffectRequest;
use super::scenario::{CampaignKind, FrfLayout, StructureScenario};
use crate::ingest::Quantity;

/// What random campaigns hide.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Tier {
    /// Nothing, one effect of the library, two of them, or strong foreign physics.
    Mixed,
    /// Nothing; noise white, as windows leave it, or common to the outputs of a hit.
    Control,
    /// One effect of the library that shows at χ² 100 to 400.
    Faint,
    /// Physics outside the library, χ² 0.1 to 30 % above noise.
    Foreign,
    /// A third nothing, a third one effect of the library from faint to plain, a third as `foreign`.
    Trial,
    /// One effect of the library at full size, or (one in three) none, in a laboratory where all else is a little wrong.
    Laboratory,
    /// Three effects of the library.
    Three,
}

/// The effects that are drawn from; lists by name, so that a new effect changes no seed.
const LIBRARY: [&str; 11] = [
    "link-flexibility",
    "joint-transverse-compliance",
    "base-compliance",
    "tool-flexibility",
    "load-dependent-stiffness",
    "payload",
    "local-resonator",
    "joint-damping",
    "time-delay",
    "sensor-misalignment",
    "amplitude-dependent-stiffness",
];
const FOREIGN: [&str; 4] = [
    "viscoelastic-joints",
    "base-sliding",
    "cross-axis-leak",
    "tool-axial-flexibility",
];
const DEPARTURES: [&str; 18] = [
    "encoder-offset",
    "tool-point-off",
    "sensor-high-pass",
    "gain-of-one-direction",
    "table-mode",
    "hysteretic-damping",
    "joint-loss-factors",
    "two-resonators",
    "resonator-elsewhere",
    "resonator-two-axes",
    "clamp-to-table",
    "hose-to-ground",
    "soft-servo",
    "gear-saturation",
    "bearing-radial",
    "drift-with-order",
    "floor-mode",
    "counterbalance",
];
/// What foreign physics leaves after everything else was refitted, χ² per value above noise.
const EXCESS_SHARE: [f64; 2] = [0.001, 0.3];
const ALL_SLIPS: [Slip; 8] = [
    Slip::Encoders,
    Slip::HammerGain,
    Slip::HitDirection,
    Slip::Warming,
    Slip::HighPass,
    Slip::SensorTurn,
    Slip::Lines,
    Slip::Coloured,
];

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
pub fn scenario(tier: Tier, seed: u64) -> StructureScenario {
    // A seed of its own, so that what is hidden is independent of what `of_kind` and the rest draw from `seed`.
    let mut draws = Draws::new(seed ^ 0x6c6f_6265_7374_6f6e, Purpose::Scenario);
    match tier {
        Tier::Mixed => mixed(seed, &mut draws),
        _ => of_tier(tier, seed, &mut draws),
    }
}

fn request(effect: &str) -> EffectRequest {
    EffectRequest {
        effect: effect.into(),
        ..Default::default()
    }
}

/// Kind, layout and files, nothing hidden yet.
fn bare(seed: u64, draws: &mut Draws) -> StructureScenario {
    let kind = *draws.pick(&[
        CampaignKind::Careful,
        CampaignKind::Careful,
        CampaignKind::Direct,
        CampaignKind::Dirty,
    ]);
    let mut scenario = StructureScenario::of_kind(kind, seed);
    if scenario.layout == FrfLayout::Roving && draws.chance(0.3) {
        scenario.layout = FrfLayout::Tool;
    }
    scenario.format = *draws.pick(&[FrfFormat::UffAscii, FrfFormat::UffBinary, FrfFormat::Csv]);
    scenario.quantity = *draws.pick(&[Quantity::Receptance, Quantity::Accelerance, Quantity::Mobility]);
    scenario
}

fn mixed(seed: u64, draws: &mut Draws) -> StructureScenario {
    let mut scenario = bare(seed, draws);
    let kind = scenario.kind;
    let what = draws.uniform(0.0, 1.0);
    // Drawn in any case, so that probabilities may change without changing all that follows.
    let first = *draws.pick(&LIBRARY);
    let mut second = *draws.pick(&LIBRARY);
    while second == first {
        second = *draws.pick(&LIBRARY);
    }
    let mut foreign = *draws.pick(&FOREIGN);
    while kind == CampaignKind::Direct && foreign == AXIAL {
        foreign = *draws.pick(&FOREIGN);
    }
    scenario.visibility_sigmas = Some(draws.log_uniform(VISIBILITY_SIGMAS[0], VISIBILITY_SIGMAS[1]));
    scenario.largest_size = 1.5;
    scenario.effects = if what < NONE {
        Vec::new()
    } else if what < NONE + UNKNOWN {
        // At full size: a faint one looks like any faint effect of the library.
        scenario.visibility_sigmas = None;
        vec![request(foreign)]
    } else if what < NONE + UNKNOWN + TWO {
        vec![request(first), request(second)]
    } else {
        vec![request(first)]
    };
    // Two levels now and then elsewhere too: else the levels would tell what is hidden.
    let two_levels = draws.chance(0.15);
    if two_levels || scenario.effects.iter().any(|e| e.effect == AMPLITUDE) {
        scenario.force_levels_n = FORCE_LEVELS_N.to_vec();
    }
    scenario
}

fn of_tier(tier: Tier, seed: u64, draws: &mut Draws) -> StructureScenario {
    let mut scenario = bare(seed, draws);
    scenario.largest_size = 1.5;
    scenario.possible_only = true;
    let noise = *draws.pick(&[LineNoise::White, LineNoise::Hann, LineNoise::ZeroPadded]);
    let (common, third) = (draws.chance(0.3), draws.uniform(0.0, 3.0));
    let two_levels = draws.chance(0.15);
    let mut effects = LIBRARY.to_vec();
    let first = effects.remove(draws.pick_index(effects.len()));
    // `direct` sees one point only: three effects there are more than its FRFs can tell.
    let second = effects.remove(draws.pick_index(effects.len()));
    let third_effect = effects.remove(draws.pick_index(effects.len()));
    let mut foreign = vec![""; FOREIGN.len() + DEPARTURES.len()];
    foreign[..FOREIGN.len()].copy_from_slice(&FOREIGN);
    foreign[FOREIGN.len()..].copy_from_slice(&DEPARTURES);
    foreign.retain(|id| scenario.kind != CampaignKind::Direct || *id != AXIAL);
    let foreign = *draws.pick(&foreign);
    let share = draws.log_uniform(EXCESS_SHARE[0], EXCESS_SHARE[1]);
    let sigmas = draws.log_uniform(VISIBILITY_SIGMAS[0], VISIBILITY_SIGMAS[1]);
    let faint_sigmas = draws.log_uniform(10.0, 20.0);
    let hide_foreign = |scenario: &mut StructureScenario| {
        scenario.excess_share = Some(share);
        match FOREIGN.contains(&foreign) {
            true => scenario.effects = vec![request(foreign)],
            false => scenario.departures = vec![foreign.into()],
        }
    };
    match tier {
        Tier::Mixed | Tier::Control => {
            scenario.line_noise = noise;
            scenario.common_noise = if common { 0.6 } else { 0.0 };
        }
        Tier::Faint => {
            scenario.visibility_sigmas = Some(faint_sigmas);
            scenario.effects = vec![request(first)];
        }
        Tier::Foreign => hide_foreign(&mut scenario),
        Tier::Trial if third < 1.0 => {}
        Tier::Trial if third < 2.0 => {
            scenario.visibility_sigmas = Some(sigmas);
            scenario.effects = vec![request(first)];
        }
        Tier::Trial => hide_foreign(&mut scenario),
        Tier::Laboratory => {
            scenario.slips = ALL_SLIPS.to_vec();
            if third < 2.0 {
                scenario.effects = vec![request(first)];
            }
        }
        Tier::Three => {
            scenario.layout = FrfLayout::Roving;
            scenario.postures.count = scenario.postures.count.max(6);
            scenario.visibility_sigmas = Some(sigmas.max(100.0));
            scenario.effects = [first, second, third_effect].map(request).to_vec();
        }
    }
    if two_levels || scenario.effects.iter().any(|e| e.effect == AMPLITUDE) {
        scenario.force_levels_n = FORCE_LEVELS_N.to_vec();
    }
    scenario
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{departure, foreign};

    #[test]
    fn seeds_cover_kinds_and_effects() {
        let all: Vec<StructureScenario> = (0..300).map(|seed| scenario(Tier::Mixed, seed)).collect();
        let count = |test: &dyn Fn(&StructureScenario) -> bool| all.iter().filter(|s| test(s)).count();
        assert!((40..=80).contains(&count(&|s| s.effects.is_empty())));
        assert!((15..=55).contains(&count(&|s| s.effects.len() == 2)));
        for effect in LIBRARY.into_iter().chain(FOREIGN) {
            let hidden = count(&|s| s.effects.iter().any(|e| e.effect == effect));
            assert!(hidden > 0, "{effect}");
        }
        for kind in [CampaignKind::Careful, CampaignKind::Direct, CampaignKind::Dirty] {
            assert!(count(&|s| s.kind == kind) > 40);
        }
        assert_eq!(scenario(Tier::Mixed, 5), scenario(Tier::Mixed, 5));
        assert_ne!(scenario(Tier::Mixed, 5), scenario(Tier::Mixed, 6));
    }

    #[test]
    fn lists_by_name_know_every_kind() {
        let library: Vec<&str> = crate::effects::STRUCTURAL.iter().map(|e| e.id()).collect();
        assert!(LIBRARY.iter().all(|id| library.contains(id)));
        assert!(FOREIGN.iter().all(|id| foreign::find(id).is_some()));
        let departures: Vec<&str> = departure::ids().collect();
        assert!(DEPARTURES.iter().all(|id| departures.contains(id)));
    }

    #[test]
    fn tiers_hide_what_they_say() {
        let all = |tier| (0..120).map(move |seed| scenario(tier, seed)).collect::<Vec<_>>();
        assert!(
            all(Tier::Control)
                .iter()
                .all(|s| s.effects.is_empty() && s.departures.is_empty())
        );
        let kinds = |noise| {
            all(Tier::Control)
                .iter()
                .filter(|s| s.line_noise == noise)
                .count()
        };
        assert!(
            [LineNoise::White, LineNoise::Hann, LineNoise::ZeroPadded]
                .map(kinds)
                .iter()
                .all(|n| *n > 20)
        );
        assert!(
            all(Tier::Foreign)
                .iter()
                .all(|s| s.effects.len() + s.departures.len() == 1)
        );
        assert!(
            all(Tier::Foreign)
                .iter()
                .all(|s| (0.001..0.3).contains(&s.excess_share.unwrap()))
        );
        let thirds = all(Tier::Trial);
        let foreign = thirds.iter().filter(|s| s.excess_share.is_some()).count();
        let none = thirds
            .iter()
            .filter(|s| s.effects.is_empty() && s.departures.is_empty())
            .count();
        assert!(
            (25..=55).contains(&foreign) && (25..=55).contains(&none),
            "{foreign} {none}"
        );
        assert!(all(Tier::Laboratory).iter().all(|s| s.slips.len() == 8));
        for s in all(Tier::Three) {
            let mut ids: Vec<&str> = s.effects.iter().map(|e| e.effect.as_str()).collect();
            ids.sort_unstable();
            ids.dedup();
            assert_eq!(ids.len(), 3);
        }
    }
}
