//! Tunable parameters: how they are scaled inside the solver, what is known of them beforehand, how far they may go.

use serde::Serialize;

/// How a parameter enters the solver. Positive quantities that may be off by a factor are fitted as logarithms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Scale {
    Logarithmic,
    Linear,
}

/// Normal prior on the solver's scale (log-normal on the value for logarithmic parameters).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    pub mean: f64,
    pub std: f64,
}

impl Prior {
    /// What it adds to half a sum of squares at `theta` (solver's scale): value, first and second derivative.
    pub fn half_square(&self, theta: f64) -> [f64; 3] {
        let residual = (theta - self.mean) / self.std;
        [
            0.5 * residual * residual,
            residual / self.std,
            1.0 / (self.std * self.std),
        ]
    }
}

/// One tunable quantity.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// `joint-2.stiffness`, `damping-ratio`, `link-3.mass`.
    pub name: String,
    pub unit: &'static str,
    pub scale: Scale,
    /// Starting value in natural units.
    pub nominal: f64,
    pub prior: Option<Prior>,
    /// Smallest and largest value in natural units.
    pub bounds: [f64; 2],
}

impl Parameter {
    /// Natural value → solver scale.
    pub fn internal(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Logarithmic => value.ln(),
            Scale::Linear => value,
        }
    }

    /// Solver scale → natural value.
    pub fn natural(&self, theta: f64) -> f64 {
        match self.scale {
            Scale::Logarithmic => theta.exp(),
            Scale::Linear => theta,
        }
    }

    /// Bounds on the solver's scale.
    pub fn internal_bounds(&self) -> [f64; 2] {
        self.bounds.map(|b| self.internal(b))
    }

    /// Standard error in natural units of a value whose standard error on the solver's scale is `std`.
    pub fn natural_std(&self, theta: f64, std: f64) -> f64 {
        match self.scale {
            Scale::Logarithmic => self.natural(theta) * std,
            Scale::Linear => std,
        }
    }
}
