//! Frequency response functions.

use num_complex::Complex64;
use serde::Serialize;

use super::dof::Dof;

/// What an FRF's response is: displacement, velocity or acceleration per newton.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, serde::Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Quantity {
    /// Displacement per force, m/N.
    #[default]
    Receptance,
    /// Velocity per force, (m/s)/N.
    Mobility,
    /// Acceleration per force, (m/s²)/N. (`acceleration` in campaign files.)
    #[serde(rename = "acceleration", alias = "accelerance")]
    Accelerance,
}

impl Quantity {
    /// How often the displacement is differentiated in time: each time is a factor iω.
    pub fn derivatives(self) -> u8 {
        match self {
            Quantity::Receptance => 0,
            Quantity::Mobility => 1,
            Quantity::Accelerance => 2,
        }
    }
}

/// One frequency response function, in SI per newton, in the quantity of the file.
#[derive(Debug, Clone)]
pub struct FrfRecord {
    /// What the file calls it, e.g. `1X/1X`.
    pub name: String,
    /// Where and along what the motion was measured; `None` where the file does not say.
    pub response: Option<Dof>,
    /// Where and along what the force acted; `None` where the file does not say.
    pub reference: Option<Dof>,
    /// `None` where the file does not say (the campaign file must).
    pub quantity: Option<Quantity>,
    /// Ascending, Hz.
    pub frequency_hz: Vec<f64>,
    /// Same length as `frequency_hz`; SI units of `quantity`.
    pub value: Vec<Complex64>,
    /// Ordinary coherence 0..1 on the same lines, where the file holds it.
    pub coherence: Option<Vec<f64>>,
}
