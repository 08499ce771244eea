//! Modes of the measured FRFs.

use super::number::decimals;
use super::parts::{count, with_error};
use super::{Block, Column, Section, Table};
use crate::analysis::ModalAnalysis;

/// Warnings shown; the command `modal` tells all.
const MOST_WARNINGS: usize = 6;

pub fn summary(analysis: &ModalAnalysis) -> Option<String> {
    let modes = || analysis.postures.iter().flat_map(|p| &p.modes);
    let lowest = modes().map(|m| m.frequency_hz).fold(f64::INFINITY, f64::min);
    let highest = modes().map(|m| m.frequency_hz).fold(0.0, f64::max);
    if !lowest.is_finite() {
        return None;
    }
    Some(format!(
        "The measured FRFs alone, without any model, show {} at {}, from {} to {} Hz.",
        count(analysis.mode_count(), "mode", "modes"),
        count(analysis.postures.len(), "posture", "postures"),
        decimals(lowest, 2),
        decimals(highest, 2),
    ))
}

pub fn section(analysis: &ModalAnalysis) -> Section {
    let mut rows = Vec::new();
    for posture in &analysis.postures {
        if posture.modes.is_empty() {
            rows.push(vec![posture.posture.clone(), "no mode found".into()]);
        }
        for mode in &posture.modes {
            rows.push(vec![
                posture.posture.clone(),
                with_error(mode.frequency_hz, mode.frequency_std_hz),
                with_error(100.0 * mode.damping_ratio, 100.0 * mode.damping_std),
                format!("{} of {}", mode.found_in, posture.frfs),
            ]);
        }
    }
    let mut blocks = vec![Block::Table(Table {
        caption: "Modes, all FRFs of a posture together".into(),
        columns: vec![
            Column::text("posture"),
            Column::number("frequency (Hz)"),
            Column::number("damping ratio (%)"),
            Column::number("seen in FRFs"),
        ],
        rows,
        notes: vec!["± is one standard deviation.".into()],
    })];
    blocks.extend(
        analysis
            .warnings
            .iter()
            .take(MOST_WARNINGS)
            .cloned()
            .map(Block::Warning),
    );
    if analysis.warnings.len() > MOST_WARNINGS {
        let rest = analysis.warnings.len() - MOST_WARNINGS;
        blocks.push(Block::Paragraph(format!(
            "{} more: see the command modal.",
            count(rest, "warning", "warnings")
        )));
    }
    Section {
        id: "modes".into(),
        title: "Modes of the measured FRFs".into(),
        lead: "Frequencies and damping that the measurement shows by itself; no robot model is used.".into(),
        blocks,
    }
}
