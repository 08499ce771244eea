//! Φ from the measured FRFs of a posture, with the noise taken out where the modes explain them.
//!
//! The lowest of many lobes follows every wiggle of the lines: between resonances, where the limit is high, a noisy FRF turns it into a
//! staircase, and the deepest tips are chance. Where the modes that were fitted to the FRF leave no more than noise, their curve is
//! nearer to the truth than each line.

use num_complex::Complex64;

use crate::analysis::modes::modal::ModalAnalysis;
use crate::analysis::modes::mode_set::SetModes;
use crate::campaign::{BodyRef, Campaign, FrfSet, MeasuredFrf};
use crate::ingest::Axis;
use crate::lobes::SampledFrf;
use crate::lobes::dynamics::frf::Receptance;
use crate::modal::Reconstruction;
use crate::{InputError, Result};

/// The 2×2 receptance of the tool point as measured at one posture.
pub struct MeasuredStructure {
    /// Index into [`Campaign::postures`].
    pub posture: usize,
    pub frf: SampledFrf,
    /// Entry 00 is along Z; `None` where ZZ was not measured on these lines.
    pub axial: Option<SampledFrf>,
    /// Where the point sits in the tool's frame, m (origin: the tool centre point).
    pub position_m: [f64; 3],
    /// Share of the lines of XX and YY that are on the modes' curve, 0 to 1.
    pub smoothed_share: f64,
    /// What had to be assumed.
    pub notes: Vec<String>,
}

/// Lines to either side over which what the modes leave is held against the noise.
const AROUND: usize = 8;
/// Times the noise's variance up to which the modes are nearer to the truth than a line: what they leave is the noise and their own
/// error, of which the second is then the smaller one.
const NO_WORSE: f64 = 2.0;

/// An FRF as it goes into Φ, along positive directions.
struct Lines {
    receptance_m_per_n: Vec<Complex64>,
    /// How many are on the modes' curve.
    on_curve: usize,
}

impl Lines {
    /// `modes`: those of the FRF's posture.
    fn of(frf: &MeasuredFrf, modes: Option<&SetModes>) -> Self {
        let fit = modes.and_then(|modes| {
            let k = modes.frfs.iter().position(|f| f.input.name == frf.name)?;
            modes.global.reconstructions[k].as_ref()
        });
        let mut lines = Lines {
            receptance_m_per_n: frf.receptance_m_per_n.clone(),
            on_curve: 0,
        };
        if let Some(fit) = fit {
            lines.take_noise_out(&frf.frequency_hz, fit);
        }
        if frf.response.negative != frf.reference.negative {
            lines.receptance_m_per_n.iter_mut().for_each(|h| *h = -*h);
        }
        lines
    }

    fn take_noise_out(&mut self, frequency_hz: &[f64], fit: &Reconstruction) {
        let left: Vec<f64> = (0..fit.frequency_hz.len())
            .map(|k| {
                (fit.measured_m_per_n[k] - fit.fitted_m_per_n[k]).norm_sqr()
                    / fit.noise_std_m_per_n[k].powi(2)
            })
            .collect();
        for (k, f) in fit.frequency_hz.iter().enumerate() {
            let near = &left[k.saturating_sub(AROUND)..(k + AROUND + 1).min(left.len())];
            if near.iter().sum::<f64>() > NO_WORSE * near.len() as f64 {
                continue;
            }
            // Fine lines were averaged for the fit, and an FRF may have been conjugated: only what is the same line is replaced.
            let line = frequency_hz.partition_point(|other| other < f);
            if frequency_hz.get(line) == Some(f) && self.receptance_m_per_n[line] == fit.measured_m_per_n[k] {
                self.receptance_m_per_n[line] = fit.fitted_m_per_n[k];
                self.on_curve += 1;
            }
        }
    }
}

/// One structure a posture whose tool point was measured in X and Y. `modes`: of the same FRFs, a set a posture; `None` takes the lines
/// as they are.
///
/// # Errors
/// No posture has direct FRFs at the tool point in both axes.
pub fn measured_structures(
    campaign: &Campaign,
    set: &FrfSet,
    modes: Option<&ModalAnalysis>,
) -> Result<Vec<MeasuredStructure>> {
    let mut structures = Vec::new();
    for posture in 0..campaign.postures.len() {
        // Direct FRFs of one point: the first point on the tool that was both hit and measured.
        let at_tool = |frf: &&MeasuredFrf| {
            frf.posture == posture
                && frf.response.point == frf.reference.point
                && campaign.points[frf.response.point].body == BodyRef::Tool
        };
        let candidates: Vec<&MeasuredFrf> = set.frfs.iter().filter(at_tool).collect();
        let Some(point) = candidates.first().map(|f| f.response.point) else {
            continue;
        };
        let find = |out: Axis, input: Axis| {
            candidates
                .iter()
                .copied()
                .find(|f| f.response.point == point && f.response.axis == out && f.reference.axis == input)
        };
        let (Some(xx), Some(yy)) = (find(Axis::X, Axis::X), find(Axis::Y, Axis::Y)) else {
            continue;
        };
        if xx.frequency_hz != yy.frequency_hz {
            continue;
        }
        let mut notes = Vec::new();
        let id = &campaign.postures[posture].id;
        let modes = modes.and_then(|m| m.sets.iter().find(|set| set.set == *id));
        let values = |frf: &MeasuredFrf| Lines::of(frf, modes).receptance_m_per_n;
        let on_these_lines =
            |frf: Option<&MeasuredFrf>| frf.filter(|f| f.frequency_hz == xx.frequency_hz).map(values);
        let cross = (
            on_these_lines(find(Axis::X, Axis::Y)),
            on_these_lines(find(Axis::Y, Axis::X)),
        );
        let lines = xx.frequency_hz.len();
        let (xy, yx) = match cross {
            (Some(xy), Some(yx)) => (xy, yx),
            (Some(one), None) | (None, Some(one)) => {
                notes.push("one cross FRF was measured; the other is taken from reciprocity".to_string());
                (one.clone(), one)
            }
            (None, None) => {
                notes.push("cross FRFs XY and YX were not measured and are taken as zero".to_string());
                (vec![Complex64::ZERO; lines], vec![Complex64::ZERO; lines])
            }
        };
        let (xx_lines, yy_lines) = (Lines::of(xx, modes), Lines::of(yy, modes));
        let receptance: Vec<Receptance> = (0..lines)
            .map(|k| {
                let direct = |of: &Lines| of.receptance_m_per_n[k];
                [[direct(&xx_lines), xy[k]], [yx[k], direct(&yy_lines)]]
            })
            .collect();
        let only = |zz: &Complex64| [[*zz, Complex64::ZERO], [Complex64::ZERO; 2]];
        let axial = on_these_lines(find(Axis::Z, Axis::Z))
            .map(|zz| SampledFrf::new(xx.frequency_hz.clone(), zz.iter().map(only).collect()))
            .transpose()?;
        structures.push(MeasuredStructure {
            posture,
            axial,
            position_m: campaign.points[point].position_m,
            smoothed_share: (xx_lines.on_curve + yy_lines.on_curve) as f64 / (2 * lines) as f64,
            frf: SampledFrf::new(xx.frequency_hz.clone(), receptance)?,
            notes,
        });
    }
    if structures.is_empty() {
        return Err(InputError::new(
            "no posture has direct FRFs XX and YY at a point on the tool, on the same lines",
        )
        .file(campaign.dir.join("campaign.toml"))
        .key("lobes.source")
        .remedy("measure the tool point in X and Y, or use source = \"model\"")
        .into());
    }
    Ok(structures)
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOISE: f64 = 1e-8;

    /// Lines of a mode with noise of alternating sign, and a fit that is the truth but for lines 60 to 79, where it lacks something.
    fn noisy() -> (Vec<f64>, Vec<Complex64>, Reconstruction) {
        let frequency_hz: Vec<f64> = (0..100).map(|k| 5.0 + 0.2 * f64::from(k)).collect();
        let truth: Vec<Complex64> = frequency_hz
            .iter()
            .map(|f| 1e-6 / Complex64::new(1.0 - (f / 14.0).powi(2), 0.06 * f / 14.0))
            .collect();
        let sign = |k: usize| if k.is_multiple_of(2) { NOISE } else { -NOISE };
        let measured: Vec<Complex64> = truth.iter().enumerate().map(|(k, h)| h + sign(k)).collect();
        let lacking = |k: usize| if (60..80).contains(&k) { 10.0 * NOISE } else { 0.0 };
        let fitted = truth.iter().enumerate().map(|(k, h)| h + lacking(k)).collect();
        let fit = Reconstruction {
            error_nrms: 0.0,
            noise_nrms: 0.0,
            frequency_hz: frequency_hz.clone(),
            measured_m_per_n: measured.clone(),
            fitted_m_per_n: fitted,
            noise_std_m_per_n: vec![NOISE; 100],
        };
        (frequency_hz, measured, fit)
    }

    fn smoothed(frequency_hz: &[f64], measured: &[Complex64], fit: &Reconstruction) -> Lines {
        let mut lines = Lines {
            receptance_m_per_n: measured.to_vec(),
            on_curve: 0,
        };
        lines.take_noise_out(frequency_hz, fit);
        lines
    }

    #[test]
    fn lines_go_to_the_curve_only_where_it_explains_them() {
        let (frequency_hz, measured, fit) = noisy();
        let lines = smoothed(&frequency_hz, &measured, &fit);
        for k in 0..100 {
            let expected = match k {
                0..52 | 88..100 => fit.fitted_m_per_n[k],
                55..85 => measured[k],
                // At the ends of the stretch it depends on how many of its lines are near.
                _ => continue,
            };
            assert_eq!(lines.receptance_m_per_n[k], expected, "line {k}");
        }
        assert!((64..=70).contains(&lines.on_curve), "{}", lines.on_curve);
    }

    #[test]
    fn averaged_and_conjugated_lines_stay_as_they_were_measured() {
        let (frequency_hz, measured, fit) = noisy();
        let between: Vec<f64> = frequency_hz.iter().map(|f| f + 0.01).collect();
        assert_eq!(smoothed(&between, &measured, &fit).on_curve, 0);
        let turned: Vec<Complex64> = measured.iter().map(Complex64::conj).collect();
        assert_eq!(smoothed(&frequency_hz, &turned, &fit).on_curve, 0);
    }
}
