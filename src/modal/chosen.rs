//! Modes as the analyst chooses them: poles given or taken away, and everything linear in them fitted again.

use std::f64::consts::TAU;

use num_complex::Complex64;

use super::pole_fit::PoleFit;
use super::shape;
use super::stabilisation::Stability;
use crate::modal::together::findings;
use crate::modal::together::global_modes::{GlobalMode, GlobalModes, RejectedMode};
use crate::modal::together::reconstruction::Reconstruction;
use crate::signal::median;

/// What the analyst wants different from what was found.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Choice {
    /// Frequency, Hz, and damping ratio (from the diagram where `None`): these poles instead of those found.
    pub poles: Vec<(f64, Option<f64>)>,
    /// Frequencies of modes to leave out, Hz.
    pub without_hz: Vec<f64>,
    /// The strongest so many.
    pub modes: Option<usize>,
}

/// A mode or pole is the one that is meant within this part of its frequency.
const MEANT: f64 = 0.02;

impl Choice {
    /// Whether nothing different is wanted.
    pub fn is_empty(&self) -> bool {
        self.poles.is_empty() && self.without_hz.is_empty() && self.modes.is_none()
    }

    /// Makes `found` what is wanted. `dofs`: response and reference of each FRF.
    ///
    /// # Errors
    /// In words: a pole or mode that is nowhere near, fewer lines than unknowns.
    pub fn apply(
        &self,
        found: &mut GlobalModes,
        dofs: &[Option<[usize; 2]>],
    ) -> std::result::Result<(), String> {
        if self.is_empty() {
            return Ok(());
        }
        let mut modes = match self.poles.is_empty() {
            true => found.modes.clone(),
            false => self
                .poles
                .iter()
                .map(|(f, zeta)| meant(found, *f, *zeta))
                .collect::<std::result::Result<Vec<_>, _>>()?,
        };
        for f in &self.without_hz {
            let nearest = modes
                .iter()
                .enumerate()
                .map(|(k, m)| (k, (m.frequency_hz / f - 1.0).abs()))
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .filter(|n| n.1 < MEANT);
            let Some((k, _)) = nearest else {
                return Err(format!("no mode near {f} Hz to leave out"));
            };
            modes.remove(k);
        }
        if let Some(count) = self.modes {
            let strength = |m: &GlobalMode| -> f64 {
                let sum: f64 = m.constants.iter().flatten().map(|c| c.0.norm_sqr()).sum();
                sum.sqrt() / (2.0 * m.damping_ratio * TAU * m.frequency_hz)
            };
            modes.sort_by(|a, b| strength(b).total_cmp(&strength(a)));
            modes.truncate(count);
        }
        modes.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
        let poles: Vec<(f64, f64)> = modes.iter().map(|m| (m.frequency_hz, m.damping_ratio)).collect();
        let fits: Vec<Option<PoleFit>> = found
            .reconstructions
            .iter()
            .map(|r| r.as_ref().map(|r| fit(r, &poles)).transpose())
            .collect::<std::result::Result<_, _>>()?;
        for (k, mode) in modes.iter_mut().enumerate() {
            mode.constants = fits.iter().map(|f| f.as_ref().map(|f| f.constants[k])).collect();
            mode.found_in = mode
                .constants
                .iter()
                .flatten()
                .filter(|c| c.0.norm() > 3.0 * c.1)
                .count();
            mode.shape = shape_of(&mode.constants, dofs);
            mode.complexity = shape::complexity(&mode.shape.iter().map(|s| s.1).collect::<Vec<_>>());
        }
        let (mut unexplained, mut measured) = (0.0, 0.0);
        for (reconstruction, fit) in found.reconstructions.iter_mut().zip(fits) {
            if let (Some(r), Some(fit)) = (reconstruction, fit) {
                let mobility = |z: &Complex64, f: &f64| (TAU * f * z.norm()).powi(2);
                let (mut error, mut total) = (0.0, 0.0);
                for ((f, h), model) in r
                    .frequency_hz
                    .iter()
                    .zip(&r.measured_m_per_n)
                    .zip(&fit.fitted_m_per_n)
                {
                    error += mobility(&(h - model), f);
                    total += mobility(h, f);
                }
                r.error_nrms = (error / total).sqrt();
                r.fitted_m_per_n = fit.fitted_m_per_n;
                unexplained += (error - r.noise_nrms.powi(2) * total).max(0.0);
                measured += total;
            }
        }
        if measured > 0.0 {
            found.quality.unexplained_share = unexplained / measured;
        }
        let is_kept = |m: &GlobalMode| {
            modes
                .iter()
                .any(|k| (k.frequency_hz / m.frequency_hz - 1.0).abs() < MEANT)
        };
        let gone = found.modes.iter().filter(|m| !is_kept(m));
        found.rejected.extend(gone.map(|m| RejectedMode {
            frequency_hz: m.frequency_hz,
            damping_ratio: m.damping_ratio,
            reason: "left out as it was asked for".into(),
        }));
        found
            .rejected
            .sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
        found.mac = findings::mac(&modes);
        found.modes = modes;
        Ok(())
    }
}

/// The mode found at a frequency, else the pole of the diagram.
fn meant(found: &GlobalModes, f: f64, zeta: Option<f64>) -> std::result::Result<GlobalMode, String> {
    let near = |x: f64| (x / f - 1.0).abs();
    let mode = found
        .modes
        .iter()
        .min_by(|a, b| near(a.frequency_hz).total_cmp(&near(b.frequency_hz)))
        .filter(|m| {
            (m.frequency_hz - f).abs() < (m.damping_ratio * m.frequency_hz).max(3.0 * m.frequency_std_hz)
        });
    if let Some(mode) = mode {
        let mut mode = mode.clone();
        if let Some(zeta) = zeta {
            // Given to the digit: what the analyst says holds.
            (mode.frequency_hz, mode.damping_ratio) = (f, zeta);
        }
        return Ok(mode);
    }
    let column: Vec<_> = found
        .stabilisation
        .poles
        .iter()
        .filter(|p| near(p.frequency_hz) < MEANT && p.stability >= Stability::Frequency)
        .collect();
    let closest = column
        .iter()
        .min_by(|a, b| near(a.frequency_hz).total_cmp(&near(b.frequency_hz)));
    let pole = match (zeta, closest) {
        (Some(zeta), _) => (f, zeta),
        (None, Some(p)) => (p.frequency_hz, p.damping_ratio),
        (None, None) => {
            return Err(format!(
                "no pole of any order near {f} Hz: give its damping ratio, as in {f}:0.01"
            ));
        }
    };
    // What the pole does from order to order is all that is known of its error.
    let own: Vec<_> = column
        .iter()
        .filter(|p| (p.frequency_hz - pole.0).abs() < pole.1.max(0.002) * pole.0)
        .collect();
    let spread = |values: Vec<f64>, centre: f64, least: f64| {
        let apart: Vec<f64> = values.iter().map(|v| (v - centre).abs()).collect();
        (1.4826 * median(&apart)).max(least)
    };
    Ok(GlobalMode {
        frequency_hz: pole.0,
        damping_ratio: pole.1,
        frequency_std_hz: spread(
            own.iter().map(|p| p.frequency_hz).collect(),
            pole.0,
            0.1 * pole.1 * pole.0,
        ),
        damping_std: spread(
            own.iter().map(|p| p.damping_ratio).collect(),
            pole.1,
            0.1 * pole.1,
        ),
        found_in: 0,
        lines_in_half_power_band: 0.0,
        complexity: None,
        shape: Vec::new(),
        constants: Vec::new(),
    })
}

/// Constants and curve of one FRF, fitted as mobility: in receptance a robot's lowest mode alone would count.
fn fit(of: &Reconstruction, poles: &[(f64, f64)]) -> std::result::Result<PoleFit, String> {
    let weights: Vec<f64> = of.frequency_hz.iter().map(|f| TAU * f).collect();
    PoleFit::of(&of.frequency_hz, &of.measured_m_per_n, &weights, poles)
}

/// Constants of the reference that shows the mode best, by response; by FRF where the places are not known.
fn shape_of(constants: &[Option<(Complex64, f64)>], dofs: &[Option<[usize; 2]>]) -> Vec<(usize, Complex64)> {
    let known: Option<Vec<[usize; 2]>> = dofs.iter().copied().collect();
    let all = || {
        constants
            .iter()
            .enumerate()
            .filter_map(|(k, c)| Some((k, c.as_ref()?.0)))
    };
    let picked: Vec<(usize, Complex64)> = match known.filter(|d| d.len() == constants.len()) {
        None => all().collect(),
        Some(dofs) => {
            // The side with fewer different places is the reference.
            let different = |side: usize| {
                let mut places: Vec<usize> = dofs.iter().map(|d| d[side]).collect();
                places.sort_unstable();
                places.dedup();
                places
            };
            let (responses, references) = (different(0), different(1));
            let (own, other, others) = match references.len() <= responses.len() {
                true => (0, 1, references),
                false => (1, 0, responses),
            };
            let power = |at: &usize| -> f64 {
                all()
                    .filter(|(k, _)| dofs[*k][other] == *at)
                    .map(|(_, z)| z.norm_sqr())
                    .sum()
            };
            let best = others.iter().max_by(|a, b| power(a).total_cmp(&power(b)));
            let of_best = all().filter(|(k, _)| Some(&dofs[*k][other]) == best);
            of_best.map(|(k, z)| (dofs[k][own], z)).collect()
        }
    };
    let values = shape::normalised(&picked.iter().map(|p| p.1).collect::<Vec<_>>());
    picked.iter().map(|p| p.0).zip(values).collect()
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::{Synthetic, SyntheticMode};
    use super::super::{FrfModes, SetMember, Settings, analyse_frf};
    use super::*;
    use crate::modal::global;

    fn found() -> GlobalModes {
        let f_zeta = [(8.0, 0.02), (14.0, 0.015), (23.0, 0.02)];
        let constants = [[1.0, 0.5, 0.8], [0.4, -1.0, 0.3], [-0.7, 0.6, 1.0]];
        let frfs: Vec<_> = constants
            .iter()
            .enumerate()
            .map(|(k, row)| {
                let modes = SyntheticMode::row(&f_zeta, row);
                Synthetic::new(3.0, 40.0, 0.1, &modes)
                    .with_noise(0.0, 0.01, k as u64)
                    .frf()
            })
            .collect();
        let single: Vec<FrfModes> = frfs
            .iter()
            .map(|(f, h)| analyse_frf(f, h, &Settings::default()).unwrap())
            .collect();
        let members: Vec<SetMember> = frfs
            .iter()
            .zip(&single)
            .map(|((f, h), modes)| SetMember {
                frequency_hz: f,
                receptance_m_per_n: h,
                modes,
                dofs: None,
            })
            .collect();
        global(&members, &Settings::default()).unwrap()
    }

    fn frequencies(modes: &GlobalModes) -> Vec<f64> {
        modes
            .modes
            .iter()
            .map(|m| (10.0 * m.frequency_hz).round() / 10.0)
            .collect()
    }

    #[test]
    fn poles_are_taken_away_given_and_counted() {
        let all = found();
        assert_eq!(frequencies(&all), [8.0, 14.0, 23.0]);
        let apply = |choice: Choice| {
            let mut modes = all.clone();
            choice.apply(&mut modes, &[None; 3]).map(|()| modes)
        };
        let without = apply(Choice {
            without_hz: vec![14.1],
            ..Choice::default()
        })
        .unwrap();
        assert_eq!(frequencies(&without), [8.0, 23.0]);
        let (full, less) = (&all.reconstructions, &without.reconstructions);
        assert!(less[1].as_ref().unwrap().error_nrms > 5.0 * full[1].as_ref().unwrap().error_nrms);
        // The same poles given again: the constants of the structure.
        let given = apply(Choice {
            poles: vec![(23.0, None), (8.0, None), (14.0, Some(0.015))],
            ..Choice::default()
        })
        .unwrap();
        assert_eq!(frequencies(&given), [8.0, 14.0, 23.0]);
        for (mode, expected) in given
            .modes
            .iter()
            .zip([[1.0, 0.4, -0.7], [0.5, -1.0, 0.6], [0.8, 0.3, 1.0]])
        {
            for (constant, expected) in mode.constants.iter().zip(expected) {
                let (value, std) = constant.unwrap();
                assert!(
                    (value - expected).norm() < 0.02 + 5.0 * std,
                    "{value} for {expected}"
                );
            }
        }
        let strongest = apply(Choice {
            modes: Some(1),
            ..Choice::default()
        })
        .unwrap();
        assert_eq!(frequencies(&strongest), [8.0]);
        assert!(
            apply(Choice {
                without_hz: vec![31.0],
                ..Choice::default()
            })
            .unwrap_err()
            .contains("31")
        );
    }
}
