//! Φ from the measured FRFs of a posture, with the noise taken out where the modes explain them.
//!
//! The lowest of many lobes follows every wiggle of the lines: between resonances, where the limit is high, a noisy FRF turns it into a
//! staircase, and the deepest tips are chance. Where the modes that were fitted to the FRF leave no more than noise, their curve is
//! nearer to the truth than each line.

use num_complex::Complex64;

use crate::analysis::modes::modal::ModalAnalysis;
use crate::campaign::{BodyRef, Campaign, FrfSet, MeasuredFrf};
use crate::ingest::Axis;
use crate::lobes::SampledFrf;
use crate::lobes::dynamics::frf::Receptance;
use crate::modal::pole_fit::PoleFit;
use crate::signal::frf_noise;
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

/// The lines of one posture's tool point.
struct ToolPoint<'a> {
    frequency_hz: &'a [f64],
    /// Frequency, Hz, and damping ratio of the posture's modes.
    poles: Vec<(f64, f64)>,
}

/// An FRF as it goes into Φ, along positive directions.
struct Lines {
    receptance_m_per_n: Vec<Complex64>,
    /// How many are on the modes' curve.
    on_curve: usize,
}

impl ToolPoint<'_> {
    fn lines(&self, frf: &MeasuredFrf) -> Lines {
        let mut lines = Lines {
            receptance_m_per_n: frf.receptance_m_per_n.clone(),
            on_curve: 0,
        };
        let noise = frf_noise::estimate(self.frequency_hz, &[&frf.receptance_m_per_n]).remove(0);
        if let (Some(noise), false) = (noise, self.poles.is_empty()) {
            self.take_noise_out(&mut lines, &noise.std);
        }
        if frf.response.negative != frf.reference.negative {
            lines.receptance_m_per_n.iter_mut().for_each(|h| *h = -*h);
        }
        lines
    }

    /// `noise_std`: of each line, m/N.
    fn take_noise_out(&self, lines: &mut Lines, noise_std: &[f64]) {
        let weights: Vec<f64> = noise_std.iter().map(|std| 1.0 / std).collect();
        // Too few lines for these modes: as measured.
        let Ok(fit) = PoleFit::of(
            self.frequency_hz,
            &lines.receptance_m_per_n,
            &weights,
            &self.poles,
        ) else {
            return;
        };
        let left: Vec<f64> = (0..weights.len())
            .map(|k| ((lines.receptance_m_per_n[k] - fit.fitted_m_per_n[k]) * weights[k]).norm_sqr())
            .collect();
        for (k, fitted) in fit.fitted_m_per_n.iter().enumerate() {
            let near = &left[k.saturating_sub(AROUND)..(k + AROUND + 1).min(left.len())];
            if near.iter().sum::<f64>() <= NO_WORSE * near.len() as f64 {
                lines.receptance_m_per_n[k] = *fitted;
                lines.on_curve += 1;
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
        let tool_point = ToolPoint {
            frequency_hz: &xx.frequency_hz,
            poles: modes
                .iter()
                .flat_map(|set| &set.global.modes)
                .map(|mode| (mode.frequency_hz, mode.damping_ratio))
                .collect(),
        };
        let values = |frf: &MeasuredFrf| tool_point.lines(frf).receptance_m_per_n;
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
        let (xx_lines, yy_lines) = (tool_point.lines(xx), tool_point.lines(yy));
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

    fn mode(f0: f64, f: f64) -> Complex64 {
        1e-6 / Complex64::new(1.0 - (f / f0).powi(2), 0.06 * f / f0)
    }

    /// Lines of modes at the given frequencies with noise of alternating sign, where only the mode at 14 Hz is known, and what became
    /// of them; the truth besides.
    fn smoothed(modes_hz: &[f64]) -> (Vec<Complex64>, Lines, Vec<Complex64>) {
        let frequency_hz: Vec<f64> = (0..200).map(|k| 5.0 + 0.2 * f64::from(k)).collect();
        let at = |f: &f64| modes_hz.iter().map(|f0| mode(*f0, *f)).sum();
        let truth: Vec<Complex64> = frequency_hz.iter().map(at).collect();
        let sign = |k: usize| if k.is_multiple_of(2) { NOISE } else { -NOISE };
        let measured: Vec<Complex64> = truth.iter().enumerate().map(|(k, h)| h + sign(k)).collect();
        let mut lines = Lines {
            receptance_m_per_n: measured.clone(),
            on_curve: 0,
        };
        let tool_point = ToolPoint {
            frequency_hz: &frequency_hz,
            poles: vec![(14.0, 0.03)],
        };
        tool_point.take_noise_out(&mut lines, &[NOISE; 200]);
        (measured, lines, truth)
    }

    #[test]
    fn noise_goes_where_the_modes_explain_the_lines() {
        let (_, lines, truth) = smoothed(&[14.0]);
        assert_eq!(lines.on_curve, 200);
        for (k, (line, truth)) in lines.receptance_m_per_n.iter().zip(&truth).enumerate() {
            assert!((line - truth).norm() < 0.3 * NOISE, "line {k}");
        }
    }

    #[test]
    fn lines_that_the_modes_do_not_explain_stay_as_measured() {
        let (measured, lines, _) = smoothed(&[14.0, 30.0]);
        // The mode at 30 Hz stands on lines 100 to 150, and is not among those that are known.
        assert_eq!(lines.receptance_m_per_n[110..140], measured[110..140]);
        assert!(lines.on_curve < 100, "{}", lines.on_curve);
    }
}
