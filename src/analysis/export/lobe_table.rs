//! Depth limits over spindle speed, a row a speed.

use crate::analysis::stability::lobes::LobeAnalysis;
use crate::campaign::LobeSource;
use crate::ingest::{ColumnTable, NamedColumn};

/// All curves below each other. A limit that is not there: stable at any depth.
pub(super) fn lobe_table(analysis: &LobeAnalysis) -> ColumnTable {
    let source = match analysis.source {
        LobeSource::Model => "model",
        LobeSource::Measured => "measured",
        LobeSource::Modes => "modes",
    };
    let (mut posture, mut angle, mut rpm) = (Vec::new(), Vec::new(), Vec::new());
    let (mut limit, mut lower, mut upper, mut chatter) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for case in &analysis.cases {
        let rows = case.curve.spindle_rpm.len();
        posture.extend(vec![case.posture.clone().unwrap_or_default(); rows]);
        angle.extend(vec![case.angle_deg; rows]);
        rpm.extend_from_slice(&case.curve.spindle_rpm);
        limit.extend_from_slice(&case.curve.depth_limit_mm);
        chatter.extend_from_slice(&case.curve.chatter_hz);
        match &case.band {
            Some(band) => {
                lower.extend_from_slice(&band.lower_mm);
                upper.extend_from_slice(&band.upper_mm);
            }
            None => {
                lower.extend(vec![None; rows]);
                upper.extend(vec![None; rows]);
            }
        }
    }
    let rows = rpm.len();
    ColumnTable::new(
        "lobes",
        vec![
            NamedColumn::text("source", vec![source.into(); rows]),
            NamedColumn::text("posture", posture),
            NamedColumn::known("angle", "deg", angle),
            NamedColumn::numbers("spindle", "rpm", rpm),
            NamedColumn::known("depth_limit", "mm", limit),
            NamedColumn::known("depth_p05", "mm", lower),
            NamedColumn::known("depth_p95", "mm", upper),
            NamedColumn::known("chatter", "hz", chatter),
        ],
    )
}
