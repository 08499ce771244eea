//! A model with its measurements, ready to be fitted.

use crate::identify::model::{Model, Modelled};
use crate::identify::model_history::Revision;

/// Model, data and what was noticed while reading them.
#[derive(Debug, Clone)]
pub struct Case<D: Modelled> {
    /// The campaign's current model: the baseline with the effects that were added, starting from where the last
    /// revision stood.
    pub model: Model<D>,
    /// The model without effects.
    pub baseline: Model<D>,
    /// The measurements with their noise.
    pub data: D::Data,
    /// What was added so far, oldest first; the first is the baseline. Empty where nothing was.
    pub revisions: Vec<Revision>,
    /// Whether the model starts from a solution that was found on these very data.
    pub(crate) settled: bool,
    /// What was noticed while reading and arranging, for people.
    pub warnings: Vec<String>,
}

impl<D: Modelled> Case<D> {
    /// A model without effects, the measurements that it is to be fitted to, and what was noticed while reading those.
    pub fn without_history(baseline: Model<D>, data: D::Data, warnings: Vec<String>) -> Self {
        Case {
            model: baseline.clone(),
            baseline,
            data,
            revisions: Vec::new(),
            settled: false,
            warnings,
        }
    }

    /// The same case, whose fits start from `theta` (solver's scale), found by calibrating it: nothing is searched again.
    pub fn settled_at(self, theta: &[f64]) -> Self {
        Case {
            model: self.model.with_start(theta.to_vec()),
            settled: true,
            ..self
        }
    }

    /// The same case, whose fits start from `theta` (solver's scale) and search from there.
    pub fn starting_from(self, theta: Vec<f64>) -> Self {
        Case {
            model: self.model.with_start(theta),
            settled: false,
            ..self
        }
    }

    /// Makes fits start from the nominal values, not from where the last revision stood.
    pub fn forget_start(&mut self) {
        self.model = self.model.without_start();
        self.settled = false;
    }

    /// Number of the current revision; `None` where nothing was ever added.
    pub fn revision(&self) -> Option<usize> {
        self.revisions.last().map(|r| r.revision)
    }

    /// `effect@site` of what is in the model beyond the baseline.
    pub fn effects(&self) -> Vec<String> {
        self.model.effect_labels()
    }

    /// What the model is, for people: `baseline + payload + local-resonator@link-3 (direction y), revision 2`.
    pub fn model_description(&self) -> String {
        let mut text = "baseline".to_string();
        for added in self.model.effects() {
            text += &format!(" + {}", added.instance.title());
        }
        match self.revision().filter(|r| *r > 0) {
            Some(revision) => format!("{text}, revision {revision}"),
            None => format!("{text}, no effect added"),
        }
    }
}
