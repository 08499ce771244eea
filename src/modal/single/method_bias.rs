//! What neighbours and residual do to half-power and circle fit at a mode.
//!
//! Both methods take the curve around a peak for that of one mode (the circle fit allows a constant beside it). The local fit
//! holds the neighbours and a residual as well, so its fitted curve is one whose true pole is known: either method on that
//! curve, free of noise, is off by its bias here. Taken with the poles alone, without the residual, the same tells which of
//! the two is to blame.

use num_complex::Complex64;

use crate::modal::single::curve::{Curve, detuning};
use crate::modal::single::frf_modes::{Disturbance, Method};
use crate::modal::single::local_fit::{LocalSolution, Pole};
use crate::modal::single::{circle_fit, half_power};

/// By how much a method is off on the curve that the local fit has found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct MethodBias {
    pub frequency_hz: f64,
    pub damping_ratio: f64,
    /// What most of it comes from.
    pub cause: Disturbance,
}

/// The local fit around a peak as curves of known poles.
pub(crate) struct FittedCurves {
    /// Poles and residual.
    all: Curve,
    /// Poles alone.
    poles: Curve,
    pole: Pole,
    /// Of the peak among their lines.
    peak: usize,
}

impl FittedCurves {
    /// `first_line`: of the solution's lines on the curve; `peak_index`: of the peak on the curve. `None` where the peak is not
    /// among them.
    pub fn new(
        curve: &Curve,
        solution: &LocalSolution,
        pole: usize,
        first_line: usize,
        peak_index: usize,
    ) -> Option<Self> {
        let lines = first_line..first_line + solution.residual.len();
        if !lines.contains(&peak_index) {
            return None;
        }
        let frequency_hz = curve.frequency_hz.get(lines.clone())?;
        let of = |mobility: Vec<Complex64>| Curve {
            frequency_hz: frequency_hz.to_vec(),
            mobility,
            dropped: 0,
        };
        let measured = curve.mobility.get(lines)?;
        let fitted = measured.iter().zip(&solution.residual).map(|(y, r)| y - r);
        let poles = frequency_hz.iter().map(|f| {
            let each = solution.poles.iter().zip(&solution.residues);
            each.map(|(p, r)| r / Complex64::new(p.damping_ratio, detuning(*f, p.frequency_hz)))
                .sum()
        });
        Some(FittedCurves {
            all: of(fitted.collect()),
            poles: of(poles.collect()),
            pole: solution.poles[pole],
            peak: peak_index - first_line,
        })
    }

    fn on(&self, curve: &Curve, method: Method) -> Option<(f64, f64)> {
        let Pole {
            frequency_hz,
            damping_ratio,
        } = self.pole;
        let (f, zeta) = match method {
            Method::HalfPower => {
                let found = half_power::fit(curve, self.peak, 0.0)?;
                (found.frequency_hz, found.damping_ratio)
            }
            Method::CircleFit => {
                let found = circle_fit::fit(curve, frequency_hz, damping_ratio)?;
                (found.frequency_hz, found.damping_ratio)
            }
            Method::LocalFit => return Some((0.0, 0.0)),
        };
        Some((f - frequency_hz, zeta - damping_ratio))
    }

    /// `None` where the method has no answer on the fitted curve.
    pub fn bias(&self, method: Method) -> Option<MethodBias> {
        let (frequency_hz, damping_ratio) = self.on(&self.all, method)?;
        // Without the residual the neighbours alone are left to be blamed.
        let cause = match self.on(&self.poles, method) {
            Some((_, by_poles)) if by_poles.abs() < 0.5 * damping_ratio.abs() => Disturbance::Residual,
            _ => Disturbance::Overlap,
        };
        Some(MethodBias {
            frequency_hz,
            damping_ratio,
            cause,
        })
    }
}
