//! Modes of the calibrated model and the measured ones.
//!
//! The model's FRFs go through the same modal analysis as the measured ones, on the same lines: what differs is the model,
//! not the definition of a mode, of damping or of a shape.

use num_complex::Complex64;
use serde::Serialize;

use super::modal::{FrfInput, ModalAnalysis, SetModes, dof_name};
use crate::Result;
use crate::identify::StructureCase;
use crate::identify::frf_data::{FrfBlock, FrfDatum};
use crate::modal::Settings;
use crate::modal::tracking::{constants_mac, pair_by};
use crate::signal::median;

/// One measured mode and the model's that comes nearest in frequency and shape.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModePair {
    /// The posture's name.
    pub posture: String,
    /// Frequency of the measured mode.
    pub measured_hz: f64,
    /// Standard error of that frequency.
    pub measured_std_hz: f64,
    /// Damping ratio of the measured mode.
    pub measured_damping: f64,
    /// Standard error of that damping ratio.
    pub measured_damping_std: f64,
    /// `None` where the model has no mode within a quarter of the frequency.
    pub model_hz: Option<f64>,
    /// Damping ratio of the model's mode.
    pub model_damping: Option<f64>,
    /// From the modal constants in all FRFs of the posture; `None` with fewer than two.
    pub mac: Option<f64>,
}

impl ModePair {
    /// Model over measured frequency, less 1.
    pub fn frequency_error(&self) -> Option<f64> {
        self.model_hz.map(|f| f / self.measured_hz - 1.0)
    }

    /// Model over measured damping ratio, less 1; `None` where nothing damps the measured mode.
    pub fn damping_error(&self) -> Option<f64> {
        let ratio = self.model_damping? / self.measured_damping - 1.0;
        ratio.is_finite().then_some(ratio)
    }
}

/// A mode that was measured at the same frequency at all postures but a few, and that the model does not have there.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FixedMode {
    /// Where it was measured, Hz.
    pub frequency_hz: f64,
    /// Highest less lowest.
    pub spread_hz: f64,
    /// Measured damping ratio.
    pub damping_ratio: f64,
    /// Where it was measured.
    pub postures: Vec<String>,
    /// How many postures have modes.
    pub of_postures: usize,
    /// At how many of them the model has a mode at this frequency.
    pub model_has: usize,
}

/// The measured modes against the model's.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ModeComparison {
    /// All measured modes, posture by posture, ascending in frequency.
    pub pairs: Vec<ModePair>,
    /// Ascending in frequency.
    pub fixed: Vec<FixedMode>,
}

/// Relative distance within which two modes are at the same frequency.
const SAME: f64 = 0.003;
/// Standard deviations of the frequency within which they are, too.
const SAME_SIGMAS: f64 = 3.0;
/// Fewest postures at which a mode must be measured to be called fixed: two coincide by chance.
const FEWEST_POSTURES: usize = 3;
/// Share of the postures that must show a fixed mode.
const NEARLY_ALL: f64 = 0.75;
/// Share of them at which the model may have a mode there, by coincidence.
const COINCIDENCES: f64 = 1.0 / 3.0;

/// The measured modes (of [`measured_modes`]) against those of `predicted`: receptances of the model in the order of
/// `case.data.frfs()`, m/N.
///
/// # Errors
/// The model's FRFs cannot be analysed.
pub fn compare_modes(
    case: &StructureCase,
    predicted: &[Vec<Complex64>],
    measured: &ModalAnalysis,
) -> Result<ModeComparison> {
    let model = modes_of(case, |k, _| predicted[k].clone())?;
    let of_model = |set: &SetModes| model.sets.iter().find(|s| s.set == set.set);
    let pairs: Vec<ModePair> = measured
        .sets
        .iter()
        .flat_map(|set| pairs(set, of_model(set)))
        .collect();
    let frequencies: Vec<(String, Vec<f64>)> = measured
        .sets
        .iter()
        .map(|set| {
            let modes = of_model(set).map_or(&[][..], |m| &m.global.modes);
            (set.set.clone(), modes.iter().map(|m| m.frequency_hz).collect())
        })
        .collect();
    Ok(ModeComparison {
        fixed: fixed_modes(&pairs, &frequencies),
        pairs,
    })
}

/// Modes that stay where they are while the robot moves. `model`: posture, and the frequencies of the model's modes there.
fn fixed_modes(pairs: &[ModePair], model: &[(String, Vec<f64>)]) -> Vec<FixedMode> {
    let with_modes: Vec<&(String, Vec<f64>)> = model
        .iter()
        .filter(|(posture, _)| pairs.iter().any(|p| p.posture == *posture))
        .collect();
    let near =
        |a: f64, b: f64, std: f64| (a - b).abs() <= (SAME * b).max(SAME_SIGMAS * std).min(2.0 * SAME * b);
    let mut found: Vec<FixedMode> = Vec::new();
    for centre in pairs {
        let f = centre.measured_hz;
        // At each posture the nearest, if it is near.
        let members: Vec<&ModePair> = with_modes
            .iter()
            .filter_map(|(posture, _)| {
                let there = pairs.iter().filter(|p| p.posture == *posture);
                let nearest =
                    there.min_by(|a, b| (a.measured_hz - f).abs().total_cmp(&(b.measured_hz - f).abs()))?;
                near(
                    nearest.measured_hz,
                    f,
                    nearest.measured_std_hz.hypot(centre.measured_std_hz),
                )
                .then_some(nearest)
            })
            .collect();
        let model_has = with_modes
            .iter()
            .filter(|(_, modes)| modes.iter().any(|m| near(*m, f, centre.measured_std_hz)))
            .count();
        let enough = members.len() >= FEWEST_POSTURES
            && members.len() as f64 >= NEARLY_ALL * with_modes.len() as f64
            && model_has as f64 <= COINCIDENCES * with_modes.len() as f64;
        if !enough {
            continue;
        }
        let all: Vec<f64> = members.iter().map(|m| m.measured_hz).collect();
        let (low, high) = all
            .iter()
            .fold((f64::INFINITY, 0.0), |(l, h), f| (l.min(*f), f64::max(h, *f)));
        let damping: Vec<f64> = members.iter().map(|m| m.measured_damping).collect();
        let mode = FixedMode {
            frequency_hz: median(&all),
            spread_hz: high - low,
            damping_ratio: median(&damping),
            postures: members.iter().map(|m| m.posture.clone()).collect(),
            of_postures: with_modes.len(),
            model_has,
        };
        // Each member finds the same group; the tightest stands for it.
        match found
            .iter_mut()
            .find(|m| near(m.frequency_hz, mode.frequency_hz, 0.0))
        {
            Some(known) if known.postures.len() < mode.postures.len() => *known = mode,
            Some(known)
                if known.postures.len() == mode.postures.len() && mode.spread_hz < known.spread_hz =>
            {
                *known = mode;
            }
            Some(_) => (),
            None => found.push(mode),
        }
    }
    found.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    found
}

/// The modes of a case's measured FRFs, one set a posture.
///
/// # Errors
/// The FRFs cannot be analysed.
pub fn measured_modes(case: &StructureCase) -> Result<ModalAnalysis> {
    modes_of(case, |_, datum| datum.receptance.clone())
}

fn modes_of(
    case: &StructureCase,
    receptance: impl Fn(usize, &FrfDatum) -> Vec<Complex64>,
) -> Result<ModalAnalysis> {
    let points = &case.model.points;
    let data = &case.data;
    let input = |(k, (block, datum)): (usize, (&FrfBlock, &FrfDatum))| FrfInput {
        name: datum.name.clone(),
        set: data.posture_ids[datum.posture].clone(),
        dofs: Some([
            dof_name(points, &datum.response),
            dof_name(points, &datum.reference),
        ]),
        frequency_hz: block.frequency_hz.clone(),
        receptance_m_per_n: receptance(k, datum),
        coherence: None,
        added_decay_per_s: 0.0,
    };
    let inputs = data.frfs().enumerate().map(input).collect();
    ModalAnalysis::of(inputs, Vec::new(), &Settings::default())
}

fn pairs(measured: &SetModes, model: Option<&SetModes>) -> Vec<ModePair> {
    let of_model = model.map_or(&[][..], |m| &m.global.modes);
    let paired = pair_by(&measured.global.modes, of_model, constants_mac);
    let modes = measured.global.modes.iter().enumerate();
    modes
        .map(|(k, mode)| {
            let pair = paired.iter().find(|p| p.first == k);
            let partner = pair.map(|p| &of_model[p.second]);
            ModePair {
                posture: measured.set.clone(),
                measured_hz: mode.frequency_hz,
                measured_std_hz: mode.frequency_std_hz,
                measured_damping: mode.damping_ratio,
                measured_damping_std: mode.damping_std,
                model_hz: partner.map(|m| m.frequency_hz),
                model_damping: partner.map(|m| m.damping_ratio),
                mac: pair.and_then(|p| p.mac),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(posture: usize, measured_hz: f64) -> ModePair {
        ModePair {
            posture: format!("p{posture}"),
            measured_hz,
            measured_std_hz: 0.01,
            measured_damping: 0.02,
            measured_damping_std: 0.001,
            model_hz: None,
            model_damping: None,
            mac: None,
        }
    }

    /// Four postures: modes of the arm that move, one at 30 Hz that does not.
    fn measured() -> Vec<ModePair> {
        let moving = [[12.0, 21.0], [13.1, 19.0], [11.2, 24.0], [14.5, 30.05]];
        let mut all = Vec::new();
        for (p, own) in moving.iter().enumerate() {
            all.extend(own.iter().map(|f| pair(p, *f)));
            if p < 3 {
                all.push(pair(p, 30.0 + 0.02 * p as f64));
            }
        }
        all
    }

    fn model(extra: Option<f64>) -> Vec<(String, Vec<f64>)> {
        let own = [[12.1, 21.2], [13.0, 19.1], [11.3, 24.1], [14.4, 33.0]];
        let of = |(p, f): (usize, &[f64; 2])| (format!("p{p}"), f.iter().copied().chain(extra).collect());
        own.iter().enumerate().map(of).collect()
    }

    #[test]
    fn a_mode_that_stays_while_the_robot_moves_is_found_unless_the_model_has_it() {
        let found = fixed_modes(&measured(), &model(None));
        assert_eq!(found.len(), 1);
        assert!((found[0].frequency_hz - 30.03).abs() < 0.02, "{found:?}");
        assert_eq!(
            (found[0].postures.len(), found[0].of_postures, found[0].model_has),
            (4, 4, 0)
        );
        assert!((found[0].spread_hz - 0.05).abs() < 1e-9);
        assert!(fixed_modes(&measured(), &model(Some(30.02))).is_empty());
        // Two postures are a coincidence.
        let two: Vec<ModePair> = measured()
            .into_iter()
            .filter(|p| p.posture.as_str() < "p2")
            .collect();
        assert!(fixed_modes(&two, &model(None)).is_empty());
    }

    #[test]
    fn errors_are_relative_to_what_was_measured() {
        let mut mode = pair(0, 20.0);
        (mode.model_hz, mode.model_damping) = (Some(21.0), Some(0.03));
        assert!((mode.frequency_error().unwrap() - 0.05).abs() < 1e-12);
        assert!((mode.damping_error().unwrap() - 0.5).abs() < 1e-12);
        mode.measured_damping = 0.0;
        assert_eq!(mode.damping_error(), None);
    }
}
