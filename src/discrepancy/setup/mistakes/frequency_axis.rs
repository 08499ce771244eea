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
/// ln(true frequency over that of the file).
pub struct FrequencyAxis {
    /// Derivatives of the displacement that the file holds: 2 where it is accelerance. The reader divides by (iω)^power.
    pub power: i32,
}

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
        truth.between(frf.response.axis, frf.reference.axis) * (f64::from(self.power) * values[0]).exp()
    }
}

impl Mistake for FrequencyAxis {
    fn sizes(&self) -> Vec<MistakeSize> {
        vec![MistakeSize::either_way(0.4, 1.2)]
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
        let wrong = data.filtered(|p| apart.iter().any(|(posture, _)| *posture == p));
        if wrong.blocks.is_empty() {
            return Ok(Vec::new());
        }
        let steps = (MOST / COARSE).round() as i32;
        let coarse = (-steps..=steps).map(|k| f64::from(k) * COARSE);
        let mut best: Vec<(f64, f64)> = apart.iter().map(|(_, now)| (0.0, *now)).collect();
        self.nearer(model, &wrong, theta, coarse, &apart, &mut best)?;
        let mut found = Vec::new();
        for ((posture, now), mut best) in apart.iter().copied().zip(best) {
            if best.1 > LEFT * now || best.0.abs() < LEAST {
                continue;
            }
            let own = wrong.filtered(|p| p == posture);
            let fine = (-10..=10)
                .map(|k| best.0 + f64::from(k) * FINE)
                .collect::<Vec<_>>();
            let mut bests = [best];
            self.nearer(
                model,
                &own,
                theta,
                fine.into_iter(),
                &[(posture, now)],
                &mut bests,
            )?;
            best = bests[0];
            found.push(Score {
                group: FrfGroup {
                    posture: Some(posture),
                    ..FrfGroup::ALL
                },
                gain: now - best.1,
                values: vec![best.0],
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

impl FrequencyAxis {
    /// Keeps in `best` (ln of the ratio, distance) what brings each posture of `apart` nearer.
    fn nearer(
        &self,
        model: &StructureModel,
        data: &FrfData,
        theta: &[f64],
        logs: impl Iterator<Item = f64>,
        apart: &[(usize, f64)],
        best: &mut [(f64, f64)],
    ) -> Result<()> {
        for log in logs {
            let mut stretched = data.clone();
            for block in &mut stretched.blocks {
                let block = std::sync::Arc::make_mut(block);
                block.frequency_hz.iter_mut().for_each(|f| *f *= log.exp());
            }
            let size = (f64::from(self.power) * log).exp();
            let mut distances = vec![0.0; apart.len()];
            for ((_, frf), curve) in data.frfs().zip(predict(model, theta, &stretched, None)?) {
                if let Some(i) = apart.iter().position(|(p, _)| *p == frf.posture) {
                    distances[i] += distance(curve.into_iter().map(|m| m * size), frf);
                }
            }
            for (best, distance) in best.iter_mut().zip(distances) {
                if distance < best.1 {
                    *best = (log, distance);
                }
            }
        }
        Ok(())
    }
}

/// Postures whose FRFs the model does not meet at all, with the distance.
fn apart(model: &StructureModel, data: &FrfData, theta: &[f64]) -> Result<Vec<(usize, f64)>> {
    let curves = predict(model, theta, data, None)?;
    let mut all: Vec<(usize, f64, usize)> = data
        .measured_postures()
        .into_iter()
        .map(|p| (p, 0.0, 0))
        .collect();
    for ((_, frf), curve) in data.frfs().zip(&curves) {
        if let Some((_, sum, lines)) = all.iter_mut().find(|(p, _, _)| *p == frf.posture) {
            *sum += distance(curve.iter().copied(), frf);
            *lines += curve.len();
        }
    }
    all.retain(|(_, sum, lines)| *sum > APART * *lines as f64);
    Ok(all.into_iter().map(|(p, sum, _)| (p, sum)).collect())
}
