//! The same FRF measured twice, and not the same.

use super::super::finding::SetupFinding;
use super::names::{dofs, first_of};
use crate::data::Point;
use crate::identify::frfs::frf_data::{FrfBlock, FrfData, FrfDatum};

/// Standard deviations of the mean weighted difference from which on noise does not explain it.
const CHANCE: f64 = 8.0;
/// Relative difference below which repeats are alike for every purpose.
const SMALL: f64 = 0.05;

/// Pairs of FRFs of the same posture, force level and degrees of freedom that contradict each other, one finding for each
/// posture. `value` is the rms of the difference over the rms of the larger one.
pub fn contradictions(data: &FrfData, points: &[Point]) -> Vec<SetupFinding> {
    let all: Vec<(&FrfBlock, &FrfDatum)> = data.frfs().collect();
    let mut findings: Vec<(usize, f64, Vec<String>)> = Vec::new();
    for (i, (block, a)) in all.iter().enumerate() {
        for (other, b) in &all[i + 1..] {
            let same = a.posture == b.posture
                && a.response == b.response
                && a.reference == b.reference
                && block.force_level_n == other.force_level_n
                && block.frequency_hz == other.frequency_hz;
            let Some(difference) = same.then(|| contradiction(a, b)).flatten() else {
                continue;
            };
            let name = dofs(a, points);
            match findings.iter_mut().find(|f| f.0 == a.posture) {
                Some(found) => {
                    found.1 = found.1.max(difference);
                    if !found.2.contains(&name) {
                        found.2.push(name);
                    }
                }
                None => findings.push((a.posture, difference, vec![name])),
            }
        }
    }
    findings
        .into_iter()
        .map(|(posture, difference, names)| {
            let id = data.posture_ids.get(posture).map_or("?", |id| id);
            SetupFinding {
                kind: "duplicates",
                place: format!("posture {id}: {}", first_of(&names)),
                value: Some(difference),
                std_error: None,
                unit: "1",
                confidence: 0.95,
                remedy: format!(
                    "The files give these FRFs of posture {id} more than once and differently: are some of another posture \
                     or node? Give each file its own [[posture]], or take the wrong one out."
                ),
            }
        })
        .collect()
}

/// Relative difference of two FRFs where it is far more than their noise.
fn contradiction(a: &FrfDatum, b: &FrfDatum) -> Option<f64> {
    let lines = a.receptance.len();
    let (mut weighted, mut square, mut first, mut second) = (0.0, 0.0, 0.0, 0.0);
    for k in 0..lines {
        let difference = (a.receptance[k] - b.receptance[k]).norm_sqr();
        weighted += difference / (a.noise_std[k].powi(2) + b.noise_std[k].powi(2));
        square += difference;
        first += a.receptance[k].norm_sqr();
        second += b.receptance[k].norm_sqr();
    }
    let relative = (square / f64::max(first, second).max(f64::MIN_POSITIVE)).sqrt();
    // Each line's |difference|²/variance has mean and variance 1 where only noise differs.
    let chance = (weighted / lines.max(1) as f64 - 1.0) * (lines as f64).sqrt();
    (chance > CHANCE && weighted > 2.0 * lines as f64 && relative > SMALL).then_some(relative)
}
