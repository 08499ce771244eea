//! Tunable parameters: how they are scaled inside the solver, what is known of them beforehand, how far they may go.

use serde::Serialize;

/// How a parameter enters the solver. Positive quantities that may be off by a factor are fitted as logarithms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Scale {
    /// θ = ln of the value.
    Logarithmic,
    /// θ is the value.
    Linear,
}

/// What is known of a parameter beforehand, on the solver's scale: bell-shaped about `mean` within about two `std`, with
/// the heavy tails of Student's t beyond. A robot file that is wrong by a factor then pulls at the data with next to
/// nothing, where a normal law would insist.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Where it is centred.
    pub mean: f64,
    /// How wide it is.
    pub std: f64,
}

impl Prior {
    /// What it adds to half a sum of squares at `theta` (solver's scale): value, first and second derivative.
    pub fn half_square(&self, theta: f64) -> [f64; 3] {
        let residual = (theta - self.mean) / self.std;
        // −ln of Student's density up to a constant, scaled to the normal's curvature in the middle; the curvature is that
        // of the parabola that touches it from above (iteratively reweighted squares), so that it never turns negative.
        let square = residual * residual / TAIL;
        let weight = 1.0 / (1.0 + square);
        [
            0.5 * TAIL * square.ln_1p(),
            weight * residual / self.std,
            weight / (self.std * self.std),
        ]
    }
}

/// Squared deviations from the mean at which the prior's pull begins to fall.
const TAIL: f64 = 4.0;

/// One tunable quantity.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// `joint-2.stiffness`, `damping-ratio`, `link-3.mass`.
    pub name: String,
    /// Of the natural value.
    pub unit: &'static str,
    /// How it enters the solver.
    pub scale: Scale,
    /// Starting value in natural units.
    pub nominal: f64,
    /// `None`: nothing is known beforehand.
    pub prior: Option<Prior>,
    /// Smallest and largest value in natural units.
    pub bounds: [f64; 2],
}

impl Parameter {
    /// What may be off by a factor, as likely up as down from `nominal`; `std`: of its logarithm.
    pub fn logarithmic(
        name: impl Into<String>,
        unit: &'static str,
        nominal: f64,
        std: f64,
        bounds: [f64; 2],
    ) -> Self {
        Parameter {
            name: name.into(),
            unit,
            scale: Scale::Logarithmic,
            nominal,
            prior: Some(Prior {
                mean: nominal.ln(),
                std,
            }),
            bounds,
        }
    }

    /// What may be off by an amount, and of either sign; `prior` in its unit.
    pub fn linear(
        name: impl Into<String>,
        unit: &'static str,
        nominal: f64,
        prior: Prior,
        bounds: [f64; 2],
    ) -> Self {
        Parameter {
            name: name.into(),
            unit,
            scale: Scale::Linear,
            nominal,
            prior: Some(prior),
            bounds,
        }
    }

    /// Natural value → solver scale.
    pub fn internal(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Logarithmic => value.ln(),
            Scale::Linear => value,
        }
    }

    /// Natural value → solver scale, moved to the nearest end where it lies outside the range.
    pub fn internal_within(&self, value: f64) -> f64 {
        self.internal(value.clamp(self.bounds[0], self.bounds[1]))
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

    /// Whether a value on the solver's scale stands at or beyond an end of the range.
    pub fn at_end(&self, theta: f64) -> bool {
        let [low, high] = self.internal_bounds();
        theta <= low || theta >= high
    }

    /// Standard error in natural units of a value whose standard error on the solver's scale is `std`.
    pub fn natural_std(&self, theta: f64, std: f64) -> f64 {
        match self.scale {
            Scale::Logarithmic => self.natural(theta) * std,
            Scale::Linear => std,
        }
    }
}

/// Whether `theta` (solver's scale) holds the values at which an effect vanishes (`limit`, solver's scale) and these lie
/// outside the range in which the effect is worth a name: a fit then holds them.
pub fn is_vanished(parameters: &[Parameter], limit: &[f64], theta: &[f64]) -> bool {
    let same = |t: &f64, l: &f64| (t - l).abs() <= 1e-9 * (1.0 + l.abs());
    let beyond = |(p, l): (&Parameter, &f64)| {
        let [low, high] = p.internal_bounds();
        *l < low || *l > high
    };
    theta.len() == limit.len()
        && theta.iter().zip(limit).all(|(t, l)| same(t, l))
        && parameters.iter().zip(limit).any(beyond)
}
