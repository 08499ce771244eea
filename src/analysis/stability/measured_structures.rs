//! Φ from the measured FRFs of a posture.

use num_complex::Complex64;

use crate::campaign::{BodyRef, Campaign, FrfSet, MeasuredFrf};
use crate::ingest::Axis;
use crate::lobes::SampledFrf;
use crate::lobes::dynamics::frf::Receptance;
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
    /// What had to be assumed.
    pub notes: Vec<String>,
}

/// One structure a posture whose tool point was measured in X and Y.
///
/// # Errors
/// No posture has direct FRFs at the tool point in both axes.
pub fn measured_structures(campaign: &Campaign, set: &FrfSet) -> Result<Vec<MeasuredStructure>> {
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
        let values = |frf: &MeasuredFrf| -> Vec<Complex64> {
            let sign = if frf.response.negative == frf.reference.negative {
                1.0
            } else {
                -1.0
            };
            frf.receptance_m_per_n.iter().map(|h| h * sign).collect()
        };
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
        let (xx_values, yy_values) = (values(xx), values(yy));
        let receptance: Vec<Receptance> = (0..lines)
            .map(|k| [[xx_values[k], xy[k]], [yx[k], yy_values[k]]])
            .collect();
        let only = |zz: &Complex64| [[*zz, Complex64::ZERO], [Complex64::ZERO; 2]];
        let axial = on_these_lines(find(Axis::Z, Axis::Z))
            .map(|zz| SampledFrf::new(xx.frequency_hz.clone(), zz.iter().map(only).collect()))
            .transpose()?;
        structures.push(MeasuredStructure {
            posture,
            axial,
            position_m: campaign.points[point].position_m,
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
