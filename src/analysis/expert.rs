//! What an experienced eye would see in the comparison of a model with its FRFs, in plain sentences: modes that the model
//! does not have, modes that are off, FRFs of another form, and the place on the robot that would explain the misfit.

use num_complex::Complex64;
use serde::Serialize;

use super::mode_comparison::{FixedMode, ModeComparison, ModePair, compare_modes, measured_modes};
use crate::Result;
use crate::discrepancy::compare::frac;
use crate::discrepancy::locate::{Location, locate, place_words};
use crate::identify::frf_data::FrfDatum;
use crate::identify::{StructureCase, StructureModel};
use crate::signal::median;

/// An expert's reading of a comparison.
#[derive(Debug, Clone, Default, Serialize)]
pub struct ExpertView {
    /// Measured at the same frequency nearly everywhere, and not in the model.
    pub fixed_modes: Vec<FixedMode>,
    /// How many modes were measured.
    pub measured_modes: usize,
    /// Of the measured modes, how many have none in the model nearby.
    pub modes_without_partner: usize,
    /// Middle of the model's relative errors over the modes that have a partner; `None` without one.
    pub frequency_error: Option<f64>,
    /// The same of the damping ratios.
    pub damping_error: Option<f64>,
    /// Middle of the MAC.
    pub mac: Option<f64>,
    /// The worst pair by shape, where its MAC says that it is another shape.
    pub worst_shape: Option<ModePair>,
    /// Median FRAC of the FRFs that stand clear of the noise.
    pub frac: Option<f64>,
    /// Name and FRAC of the FRF that has the least.
    pub least_frac: Option<(String, f64)>,
    /// Joints and bodies by the share of the misfit that something unknown there would take away, best first; empty where
    /// only noise is left.
    pub located: Vec<Location>,
}

/// Below this a MAC says that two shapes are not the same.
const OTHER_SHAPE: f64 = 0.7;
/// Below this an FRF of the model has another form than the measured one.
const OTHER_FORM: f64 = 0.8;
/// A frequency error (share) and damping error from which on they are spoken of.
const FREQUENCY_OFF: f64 = 0.01;
const DAMPING_OFF: f64 = 0.25;
/// Shares of the misfit nearer than this are as good as equal, unless one place leaves so many times what the other does.
const TIED: f64 = 0.05;
const LEAVES_MORE: f64 = 1.5;
/// So many places that explain it alike point nowhere.
const MANY: usize = 3;
/// Noise of an FRF, as a share of its rms, up to which its form can be judged.
const CLEAR: f64 = 0.2;
/// A place that explains less than this points nowhere.
const LEAST_SHARE: f64 = 0.3;

impl ExpertView {
    /// The model at `theta` (solver's scale) that predicts `predicted` (m/N, in the order of `case.data.frfs()`).
    ///
    /// # Errors
    /// A model that has no response. FRFs that show no modes are no error: nothing is said of modes then.
    pub fn new(
        case: &StructureCase,
        (model, theta): (&StructureModel, &[f64]),
        predicted: &[Vec<Complex64>],
    ) -> Result<Self> {
        let modes = measured_modes(case).and_then(|m| compare_modes(case, predicted, &m));
        Self::of_modes(case, (model, theta), predicted, &modes.unwrap_or_default())
    }

    /// As [`new`](Self::new), with the modes compared already.
    ///
    /// # Errors
    /// A model that has no response.
    pub fn of_modes(
        case: &StructureCase,
        (model, theta): (&StructureModel, &[f64]),
        predicted: &[Vec<Complex64>],
        modes: &ModeComparison,
    ) -> Result<Self> {
        let pairs = &modes.pairs;
        let middle = |values: Vec<f64>| (!values.is_empty()).then(|| median(&values));
        let worst = pairs
            .iter()
            .filter(|p| p.mac.is_some_and(|m| m < OTHER_SHAPE))
            .min_by(|a, b| a.mac.unwrap_or(1.0).total_cmp(&b.mac.unwrap_or(1.0)));
        // The form of an FRF that drowns in noise is that of the noise.
        let clear = |frf: &FrfDatum| {
            let noise: f64 = frf.noise_std.iter().map(|s| s * s).sum();
            noise <= CLEAR * CLEAR * frf.receptance.iter().map(|h| h.norm_sqr()).sum::<f64>()
        };
        let fracs: Vec<(String, f64)> = case
            .data
            .frfs()
            .zip(predicted)
            .filter(|((_, frf), _)| clear(frf))
            .filter_map(|((_, frf), model)| Some((frf.name.clone(), frac(model, &frf.receptance)?)))
            .collect();
        Ok(ExpertView {
            fixed_modes: modes.fixed.clone(),
            measured_modes: pairs.len(),
            modes_without_partner: pairs.iter().filter(|p| p.model_hz.is_none()).count(),
            frequency_error: middle(pairs.iter().filter_map(ModePair::frequency_error).collect()),
            damping_error: middle(pairs.iter().filter_map(ModePair::damping_error).collect()),
            mac: middle(pairs.iter().filter_map(|p| p.mac).collect()),
            worst_shape: worst.cloned(),
            frac: middle(fracs.iter().map(|(_, f)| *f).collect()),
            least_frac: fracs.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)),
            located: locate(model, theta, &case.data)?,
        })
    }

    /// What stands out, most telling first; empty where nothing does.
    pub fn sentences(&self) -> Vec<String> {
        let mut all: Vec<String> = self.fixed_modes.iter().map(fixed_sentence).collect();
        if self.located.is_empty() {
            return all;
        }
        all.extend(self.place_sentence());
        all.extend(self.mode_sentence());
        if let Some((name, frac)) = self.least_frac.as_ref().filter(|(_, f)| *f < OTHER_FORM) {
            all.push(format!(
                "the least like the model in form is {name}: FRAC {frac:.2} (middle of all FRFs {:.2})",
                self.frac.unwrap_or(1.0)
            ));
        }
        all
    }

    fn place_sentence(&self) -> Option<String> {
        let best = self.located.first().filter(|l| l.share >= LEAST_SHARE)?;
        let as_good = |l: &&Location| best.share - l.share < TIED && l.left < LEAVES_MORE * best.left;
        let tied: Vec<String> = self
            .located
            .iter()
            .skip(1)
            .filter(as_good)
            .map(|l| place_words(&l.place))
            .collect();
        let percent = |share: f64| 100.0 * share.min(1.0);
        if tied.len() >= MANY {
            return Some(format!(
                "the misfit points at no single place: something unknown at {} would take {:.0} % of it away, at {} hardly less",
                place_words(&best.place),
                percent(best.share),
                tied.join(", ")
            ));
        }
        let what = match best.place.starts_with("joint") {
            true => "it gives way otherwise than modelled, turning or tilting",
            false => "a force acts on it that the model does not have: something hung on it, or touching it",
        };
        let next = self.located.iter().find(|l| !as_good(l));
        Some(format!(
            "the misfit points at {}: an unknown stiffness, damping or force there would take {:.0} % of it away ({what}){}{}",
            place_words(&best.place),
            percent(best.share),
            match tied.as_slice() {
                [] => String::new(),
                some => format!("; as good as it: {}", some.join(", ")),
            },
            next.map_or(String::new(), |l| format!(
                "; next: {} with {:.0} %",
                place_words(&l.place),
                percent(l.share.max(0.0))
            ))
        ))
    }

    fn mode_sentence(&self) -> Option<String> {
        let mut parts = Vec::new();
        if let Some(off) = self.frequency_error.filter(|e| e.abs() > FREQUENCY_OFF) {
            let way = if off > 0.0 { "high" } else { "low" };
            parts.push(format!(
                "modes lie {:.1} % too {way} in the model",
                100.0 * off.abs()
            ));
        }
        if let Some(off) = self.damping_error.filter(|e| e.abs() > DAMPING_OFF) {
            let way = if off > 0.0 { "more" } else { "less" };
            parts.push(format!(
                "modes are damped {:.0} % {way} in the model",
                100.0 * off.abs()
            ));
        }
        if let Some(worst) = &self.worst_shape {
            parts.push(format!(
                "the shape at {:.1} Hz of {} is another one (MAC {:.2})",
                worst.measured_hz,
                worst.posture,
                worst.mac.unwrap_or(0.0)
            ));
        }
        if self.modes_without_partner > 0 {
            parts.push(format!(
                "{} of {} measured modes have none in the model nearby",
                self.modes_without_partner, self.measured_modes
            ));
        }
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}

fn fixed_sentence(mode: &FixedMode) -> String {
    let at = match mode.postures.len() == mode.of_postures {
        true => "at every posture".to_string(),
        false => format!("at {} of {} postures", mode.postures.len(), mode.of_postures),
    };
    let model = match mode.model_has {
        0 => "at none".to_string(),
        n => format!("at {n}"),
    };
    format!(
        "{:.1} Hz {at} (within {:.2} Hz, ζ {:.1} %), in the model {model}: not the arm, whose modes move with its posture, but what \
         stays as it is: the table or floor under it, the tool, the measuring chain",
        mode.frequency_hz,
        mode.spread_hz,
        100.0 * mode.damping_ratio
    )
}
