//! How strong a departure must be to leave what is asked for.

use crate::Result;
use crate::campaign::Posture;
use crate::identify::{FrfData, StructureModel};
use crate::simulate::departure::Departed;
use crate::simulate::sizes::visibility::{self, Visibility};
use crate::simulate::world::World;

/// What a departure is seen against.
pub struct Sight<'a> {
    /// The model with everything else that is hidden, and its true parameters (solver's scale).
    pub model: &'a StructureModel,
    pub theta: &'a [f64],
    pub postures: &'a [Posture],
    pub noise: &'a dyn Fn(f64) -> f64,
    /// Every how many lines a refit uses.
    pub stride: usize,
}

impl Sight<'_> {
    /// Fills `data` with what the lab shows (noise-free) and says how plainly it departs from the model.
    pub fn fill(&self, departed: &[Departed], data: &mut FrfData) -> Result<Visibility> {
        let world = World {
            model: self.model,
            theta: self.theta,
            departed,
            postures: self.postures,
        };
        visibility::set(data, world.receptances(data)?, self.noise);
        visibility::without(self.model, self.theta, data, self.stride)
    }
}

const STRENGTHS: [f64; 2] = [1e-6, 1.0];
const ATTEMPTS: usize = 12;
/// Relative deviation from the share asked for that is good enough.
const CLOSE: f64 = 0.05;

/// Sets the strength of the last of `departed` so that after a refit of the model it leaves `excess` = Σ|ΔH|²/σ² per
/// complex value, as far as full strength does that. `data` is scratch.
pub fn settle(departed: &mut [Departed], excess: f64, sight: &Sight, data: &mut FrfData) -> Result<()> {
    // The excess grows with the square of a small strength: Newton's method on logarithms, the slope as found.
    let [low, high] = STRENGTHS.map(f64::ln);
    let mut at = high;
    let mut earlier: Option<(f64, f64)> = None;
    for _ in 0..ATTEMPTS {
        if let Some(last) = departed.last_mut() {
            last.strength = at.exp();
        }
        let found = sight.fill(departed, data)?.excess_chi2_per_value;
        let off = (found.max(1e-12) / excess).ln();
        if off.abs() < CLOSE || (at >= high && off < 0.0) || (at <= low && off > 0.0) {
            break;
        }
        let slope = earlier
            .map(|(x, y): (f64, f64)| (off - y) / (at - x))
            .filter(|s| s.is_finite())
            .map_or(2.0, |s| s.clamp(0.5, 4.0));
        earlier = Some((at, off));
        at = (at - (off / slope).clamp(-4.0, 4.0)).clamp(low, high);
    }
    Ok(())
}
