use num_complex::Complex64;

use super::super::finding::{SetupFinding, with_error};
use super::super::group::FrfGroup;
use super::super::mistake::{Distortion, Estimated, Mistake, MistakeSize, Score};
use super::super::readings::distance;
use super::super::scene::predict;
use super::super::truth::Truth;
use crate::Result;
use crate::identify::StructureModel;
use crate::identify::frfs::frf_data::{FrfData, FrfDatum};

/// The files of a posture hold another frequency axis than they were measured on: another sampling rate or span was written down.
/// ln(true frequency over that of the file), and ln of what the receptance comes out too large by for it.
pub struct FrequencyAxis;

/// Derivatives of the displacement that a file holds (2: accelerance): the reader divides by (iω)^power, and so by the wrong ω.
const POWERS: [f64; 3] = [2.0, 1.0, 0.0];
/// ln of the smallest ratio that is a mistake of the axis: clocks are right to 1e-4, and what shifts modes by a few per cent is physics.
const LEAST: f64 = 0.05;
/// ln of the largest that is looked for …
const MOST: f64 = 1.0;
/// … and steps of ln, about a half-width of a mode, then a tenth of one.
const COARSE: f64 = 0.02;
const FINE: f64 = 0.002;
/// Mean distance a line (1 where nothing agrees) from which on a posture is looked at …
const APART: f64 = 0.3;
/// … and what may be left of it with another axis, for the fit to begin there.
const LEFT: f64 = 0.6;

impl Distortion for FrequencyAxis {
    fn frequency_ratio(&self, values: &[f64]) -> f64 {
        values[0].exp()
    }

    fn shown(&self, values: &[f64], _omega: f64, truth: &Truth, frf: &FrfDatum) -> Complex64 {
        truth.between(frf.response.axis, frf.reference.axis) * values[1].exp()
    }
}

impl Mistake for FrequencyAxis {
    fn sizes(&self) -> Vec<MistakeSize> {
        vec![
            MistakeSize::either_way(0.4, 1.2),
            MistakeSize::either_way(1.0, 2.5),
        ]
    }

    /// That of all postures would be another stiffness.
    fn groups(&self, data: &FrfData) -> Vec<FrfGroup> {
        FrfGroup::postures(data)
            .into_iter()
            .filter(|g| g.posture.is_some())
            .collect()
    }

    fn is_ever_small(&self) -> bool {
        false
    }

    fn far(&self, model: &StructureModel, data: &FrfData, theta: &[f64]) -> Result<Vec<Score>> {
        if data.measured_postures().len() < 2 {
            return Ok(Vec::new());
        }
        let apart = apart(model, data, theta)?;
        let wrong = data.filtered(|p| apart.iter().any(|own| own.posture == p));
        if wrong.blocks.is_empty() {
            return Ok(Vec::new());
        }
        let steps = (MOST / COARSE).round() as i32;
        let coarse = (-steps..=steps).map(|k| f64::from(k) * COARSE);
        let mut best = apart.clone();
        nearer(model, &wrong, theta, coarse, &mut best)?;
        let mut found = Vec::new();
        for (own, best) in apart.iter().zip(best) {
            if best.distance > LEFT * own.distance || best.log.abs() < LEAST {
                continue;
            }
            let files = wrong.filtered(|p| p == own.posture);
            let fine = (-10..=10).map(|k| best.log + f64::from(k) * FINE);
            let mut best = [best];
            nearer(model, &files, theta, fine, &mut best)?;
            let [best] = best;
            found.push(Score {
                group: FrfGroup {
                    posture: Some(own.posture),
                    ..FrfGroup::ALL
                },
                gain: own.distance - best.distance,
                values: vec![best.log, best.power * best.log],
            });
        }
        Ok(found)
    }

    fn finding(&self, estimated: &Estimated) -> SetupFinding {
        let ratio = estimated.values[0].exp();
        let error = ratio * estimated.errors[0];
        SetupFinding {
            kind: "frequency-axis",
            place: estimated.place(),
            value: Some(ratio),
            std_error: Some(error),
            unit: "1",
            confidence: 0.0,
            remedy: format!(
                "Multiply the frequencies of these files by {} (sampling rate, frequency span or number of lines were written down \
                 wrongly), or export them again.",
                with_error(ratio, error)
            ),
        }
    }
}

/// A posture's files on another axis.
#[derive(Clone, Copy)]
struct Tried {
    posture: usize,
    /// ln of true frequency over that of the file.
    log: f64,
    /// Of [`POWERS`].
    power: f64,
    distance: f64,
}

/// Keeps in `best` what brings each posture nearer, of the axes whose ln of the ratio is one of `logs`.
fn nearer(
    model: &StructureModel,
    data: &FrfData,
    theta: &[f64],
    logs: impl Iterator<Item = f64>,
    best: &mut [Tried],
) -> Result<()> {
    for log in logs {
        let mut stretched = data.clone();
        for block in &mut stretched.blocks {
            let block = std::sync::Arc::make_mut(block);
            block.frequency_hz.iter_mut().for_each(|f| *f *= log.exp());
        }
        let curves = predict(model, theta, &stretched, None)?;
        for best in best.iter_mut() {
            for power in POWERS {
                let size = (power * log).exp();
                let own = data
                    .frfs()
                    .zip(&curves)
                    .filter(|((_, frf), _)| frf.posture == best.posture);
                let distance = own
                    .map(|((_, frf), curve)| distance(curve.iter().map(|m| m * size), frf))
                    .sum();
                if distance < best.distance {
                    *best = Tried {
                        log,
                        power,
                        distance,
                        ..*best
                    };
                }
            }
        }
    }
    Ok(())
}

/// Postures whose FRFs the model does not meet at all.
fn apart(model: &StructureModel, data: &FrfData, theta: &[f64]) -> Result<Vec<Tried>> {
    let curves = predict(model, theta, data, None)?;
    let of_posture = |posture: usize| {
        let own = || {
            data.frfs()
                .zip(&curves)
                .filter(move |((_, frf), _)| frf.posture == posture)
        };
        let lines: usize = own().map(|(_, curve)| curve.len()).sum();
        let distance: f64 = own()
            .map(|((_, frf), curve)| distance(curve.iter().copied(), frf))
            .sum();
        (distance > APART * lines as f64).then_some(Tried {
            posture,
            log: 0.0,
            power: 0.0,
            distance,
        })
    };
    Ok(data
        .measured_postures()
        .into_iter()
        .filter_map(of_posture)
        .collect())
}
