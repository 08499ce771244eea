//! The cuts of a campaign of which somebody noted whether they chattered.

use crate::campaign::{Campaign, CutGeometry, LobesSection};
use crate::lobes::outcome::{NotCompared, NotedCut};

/// The cuts with an outcome, and those of them that are no points of the diagram that the campaign asks for.
pub fn noted_cuts(campaign: &Campaign, section: &LobesSection) -> (Vec<NotedCut>, Vec<NotCompared>) {
    let (mut noted, mut left_out) = (Vec::new(), Vec::new());
    for cut in &campaign.cuts {
        let Some(outcome) = cut.outcome else { continue };
        let tool = campaign.tool.as_ref();
        // Half a thousandth of a degree: angles are written in degrees.
        let same_angle = |a: f64, b: f64| (a - b).abs() < 1e-5;
        let reason = if cut.geometry.process() != section.process {
            Some("it is of another process than the lobes")
        } else if section
            .teeth
            .is_some_and(|teeth| tool.is_some_and(|t| t.teeth != teeth))
        {
            Some("it was made with [tool], whose number of teeth is not that of the lobes")
        } else if section.ktc_n_per_mm2.is_none()
            && campaign.material.is_some()
            && cut.material != campaign.material
        {
            Some("it is of another material than the lobes")
        } else {
            match (cut.geometry, section.immersion) {
                (CutGeometry::Milling { immersion: cut, .. }, Some(lobes))
                    if !(same_angle(cut.start_rad, lobes.start_rad)
                        && same_angle(cut.exit_rad, lobes.exit_rad)) =>
                {
                    Some("its immersion is not that of the lobes")
                }
                _ => None,
            }
        };
        let depth_mm = match cut.geometry {
            CutGeometry::Milling { axial_depth_mm, .. } => Some(axial_depth_mm),
            CutGeometry::Drilling {
                pilot_diameter_mm, ..
            } => tool.map(|t| 0.5 * (t.diameter_mm - pilot_diameter_mm)),
            CutGeometry::Turning { depth_of_cut_mm, .. } => Some(depth_of_cut_mm),
        };
        match (reason, depth_mm) {
            (None, Some(depth_mm)) => noted.push(NotedCut {
                id: cut.id.clone(),
                posture: cut
                    .posture
                    .and_then(|p| campaign.postures.get(p))
                    .map(|p| p.id.clone()),
                spindle_rpm: cut.spindle_rpm,
                depth_mm,
                outcome,
            }),
            (reason, _) => left_out.push(NotCompared {
                id: cut.id.clone(),
                reason: reason.unwrap_or("its depth is not known").into(),
            }),
        }
    }
    (noted, left_out)
}
