//! `lobestone lobes`: the tool as a beam, and the blocks of a drill.

use serde::Serialize;

use crate::analysis::LobeAnalysis;
use crate::lobes::BlockLobes;

/// The tool as a beam, clamped at the holder face.
#[derive(Serialize)]
pub(super) struct ToolTold<'a> {
    segments: usize,
    length_mm: f64,
    clamped_bending_hz: &'a [f64],
    clamped_axial_torsional_hz: &'a [f64],
}

impl<'a> ToolTold<'a> {
    /// `None` where there is none.
    pub fn of(analysis: &'a LobeAnalysis) -> Option<Self> {
        let beam = &analysis.tool.beam;
        let [bending, axial] = &analysis.tool.clamped_hz;
        (!beam.segments.is_empty()).then(|| ToolTold {
            segments: beam.segments.len(),
            length_mm: 1e3 * beam.length_m(),
            clamped_bending_hz: bending,
            clamped_axial_torsional_hz: axial,
        })
    }
}

/// What the tool and the blocks of a drill are; empty in milling without a tool.
pub fn text(analysis: &LobeAnalysis) -> String {
    let mut out = String::new();
    let [bending, axial] = &analysis.tool.clamped_hz;
    if let Some(first) = bending.first() {
        let twist = axial
            .first()
            .map_or(String::new(), |f| format!(", in twist or tension at {f:.0} Hz"));
        out += &format!(
            "Tool as a beam, {:.1} mm: clamped at the holder face it would bend at {first:.0} Hz first{twist}\n",
            1e3 * analysis.tool.beam.length_m()
        );
    }
    match &analysis.axial_torsional {
        None => {}
        Some(Err(reason)) => out += &format!("Axial-torsional block left out: {reason}\n"),
        Some(Ok(())) => {
            for case in &analysis.cases {
                let Some([lateral, axial]) = &case.by_block else {
                    continue;
                };
                if case.angle_deg.is_some_and(|a| a > 0.0) {
                    continue;
                }
                let least = |b: &BlockLobes| {
                    b.absolute.map_or("no limit".to_string(), |a| {
                        format!("{:.4} mm ({:.2} Hz)", a.depth_mm, a.chatter_hz)
                    })
                };
                let posture = case.at_posture();
                out += &format!(
                    "Least limit{posture}: lateral {}, axial-torsional {}\n",
                    least(lateral),
                    least(axial)
                );
            }
        }
    }
    if let Some(hole) = analysis.drilled {
        for case in analysis
            .cases
            .iter()
            .filter(|c| c.angle_deg.unwrap_or(0.0) == 0.0)
        {
            let depths = &case.curve.depth_limit_mm;
            let stable = depths
                .iter()
                .filter(|d| d.is_none_or(|d| d > hole.width_mm))
                .count();
            let posture = case.at_posture();
            out += &format!(
                "This hole has a width of cut of {:.3} mm: stable at {stable} of {} speeds{posture}\n",
                hole.width_mm,
                depths.len()
            );
        }
    }
    out
}
