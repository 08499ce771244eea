//! How a model grew: the effects that were added to it, with the numbers that each step left. Plain values; the file that
//! they are kept in is the affair of [`revision`](crate::revision).

use serde::{Deserialize, Serialize};

use crate::effects::{self, Instance};
use crate::identify::model::{Model, Modelled};

/// The side of a campaign that a revision belongs to; each side has a model of its own and counts for itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Robot model against FRFs.
    Structure,
    /// Force model against force records.
    Cutting,
}

/// An effect in the model.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordedEffect {
    /// `effect@site`, or the bare id.
    pub effect: String,
    /// The discrete choice at that site, such as a direction; `None` where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub variant: Option<String>,
}

/// A fitted parameter, natural units.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordedParameter {
    /// `joint-2.stiffness`; for an effect `effect@site.name`.
    pub name: String,
    /// As fitted.
    pub value: f64,
    /// Of `value`, `std_error` and `initial`.
    pub unit: String,
    /// `None` where the data do not tell.
    pub std_error: Option<f64>,
    /// Nominal value.
    pub initial: f64,
}

/// The model at one moment and how well it agreed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Revision {
    /// 0: the baseline without effects.
    pub revision: usize,
    /// The side that it belongs to.
    pub domain: Side,
    /// In the order in which they were added.
    pub effects: Vec<RecordedEffect>,
    /// As fitted.
    pub parameters: Vec<RecordedParameter>,
    /// On the data that was fitted.
    pub nrms: f64,
    /// On postures (or cuts) left out of the fit; `None` where there was only one.
    pub held_out_nrms: Option<f64>,
    /// nrms of a perfect model.
    pub noise_floor_nrms: f64,
    /// Weighted misfit per degree of freedom: 1 is noise alone.
    pub reduced_chi2: f64,
    /// Whether the held-out error fell by more than chance; `None` where that cannot be told (and for the baseline).
    pub progress: Option<bool>,
    /// When it was made, RFC 3339, UTC.
    pub when: String,
    /// Fingerprint of the data it was fitted to.
    pub data: String,
    /// What the diagnosis of the model before said; `None` where there was none (and for the baseline).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<Evidence>,
}

impl Revision {
    /// `effect@site` of every effect.
    pub fn labels(&self) -> Vec<&str> {
        self.effects.iter().map(|e| e.effect.as_str()).collect()
    }

    /// The effect that this revision added; `None` for the baseline.
    pub fn added(&self) -> Option<&RecordedEffect> {
        self.effects.last()
    }

    /// `0 baseline`, `2 + time-delay`.
    pub fn title(&self) -> String {
        match self.added() {
            Some(added) => format!("{} + {}", self.revision, added.effect),
            None => format!("{} baseline", self.revision),
        }
    }
}

/// Why an effect was added: what the diagnosis of the model before said.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Evidence {
    /// `effect`, `none` or `unknown`.
    pub verdict: String,
    /// `effect@site` that it named.
    pub effect: Option<String>,
    /// Probability that the verdict is right.
    pub confidence: f64,
    /// Best first.
    pub candidates: Vec<RecordedCandidate>,
    /// When it was made, RFC 3339, UTC.
    pub when: String,
}

/// An effect that was tried.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordedCandidate {
    /// `effect@site`.
    pub effect: String,
    /// The discrete choice at that site; `None` where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub variant: Option<String>,
    /// Error with it; the numbers are `None` where they are none.
    pub nrms: Option<f64>,
    /// Error on folds left out of the fit.
    pub held_out_nrms: Option<f64>,
    /// BIC with it less BIC without.
    pub delta_bic: Option<f64>,
    /// Likelihood-ratio test, corrected for the number of candidates.
    pub p_value: Option<f64>,
    /// Weighted misfit per degree of freedom that is left with it.
    pub reduced_chi2: Option<f64>,
    /// What speaks against it; empty as a rule.
    pub remark: String,
}

/// How an instance stands in the log.
pub fn recorded_effect<D: effects::Domain>(instance: &Instance<D>) -> RecordedEffect {
    let variant = instance.variant_label();
    RecordedEffect {
        effect: instance.label(),
        variant: variant.map(|(_, value)| value.to_string()),
    }
}

/// How the effects of a model stand in the log.
pub fn recorded_effects<D: Modelled>(model: &Model<D>) -> Vec<RecordedEffect> {
    let effects = model.effects().iter();
    effects.map(|added| recorded_effect(&added.instance)).collect()
}
