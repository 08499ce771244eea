//! What a campaign's model has learned so far: one revision for each effect that was added, kept in the campaign's
//! folder (`lobestone/revisions.json`).
//!
//! The log holds labels, numbers and where they come from; what an effect is and how a model gets it is the affair of
//! the floors above.

mod clock;
mod evidence;
mod fingerprint;
mod lock;
mod log;

pub use evidence::{Evidence, RecordedCandidate, keep, recall};
pub use fingerprint::{
    cutting_fingerprint, fingerprint, folder_fingerprint, structure_fingerprint, text_fingerprint,
};
pub use lock::hold;
pub use log::{RevisionLog, log_file};

use serde::{Deserialize, Serialize};

/// What the program keeps of a campaign, beside the measurements.
const FOLDER: &str = "lobestone";

/// The side of a campaign that a revision belongs to; each side has a model of its own and counts for itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Domain {
    Structure,
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
    pub name: String,
    pub value: f64,
    pub unit: String,
    /// `None` where the data do not tell.
    pub std_error: Option<f64>,
    pub initial: f64,
}

/// The model at one moment and how well it agreed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Revision {
    /// 0: the baseline without effects.
    pub revision: usize,
    pub domain: Domain,
    /// In the order in which they were added.
    pub effects: Vec<RecordedEffect>,
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

/// The time of day, RFC 3339, UTC, to the second.
pub fn now() -> String {
    clock::rfc3339(std::time::SystemTime::now())
}
