//! Modes of the measured FRFs.

use num_complex::Complex64;

use super::figure::{
    CellFormat, FrfCurve, FrfFigure, HeatMap, NoiseLevel, StabilisationFigure, StabilisationPole,
};
use super::number::decimals;
use super::parts::{count, figure, with_error};
use super::{Block, Column, Section, Table};
use crate::analysis::ModalAnalysis;
use crate::analysis::modal::SetModes;
use crate::modal::stabilisation::Stability;
use crate::modal::tracking::Track;

/// Warnings shown; the command `modal` tells all.
const MOST_WARNINGS: usize = 6;

pub fn summary(analysis: &ModalAnalysis) -> Option<String> {
    let modes = || analysis.sets.iter().flat_map(|p| &p.global.modes);
    let lowest = modes().map(|m| m.frequency_hz).fold(f64::INFINITY, f64::min);
    let highest = modes().map(|m| m.frequency_hz).fold(0.0, f64::max);
    if !lowest.is_finite() {
        return None;
    }
    Some(format!(
        "The measured FRFs alone, without any model, show {} at {}, from {} to {} Hz.",
        count(analysis.mode_count(), "mode", "modes"),
        count(analysis.sets.len(), "posture", "postures"),
        decimals(lowest, 2),
        decimals(highest, 2),
    ))
}

pub fn section(analysis: &ModalAnalysis) -> Section {
    let mut blocks = vec![modes(analysis)];
    if analysis.sets.len() > 1 {
        blocks.extend(tracked(analysis));
    }
    // One posture shows how it was done; all of them would be a picture book.
    if let Some(set) = analysis.sets.iter().max_by_key(|s| s.global.modes.len()) {
        blocks.push(stabilisation(set));
        blocks.extend(reconstruction(set));
        blocks.extend(mac(set));
    }
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

fn modes(analysis: &ModalAnalysis) -> Block {
    let mut rows = Vec::new();
    for set in &analysis.sets {
        if set.global.modes.is_empty() {
            rows.push(vec![set.set.clone(), "no mode found".into()]);
        }
        for mode in &set.global.modes {
            rows.push(vec![
                set.set.clone(),
                with_error(mode.frequency_hz, mode.frequency_std_hz),
                with_error(100.0 * mode.damping_ratio, 100.0 * mode.damping_std),
                format!("{} of {}", mode.found_in, set.frfs.len()),
                mode.complexity.map_or("–".into(), |c| decimals(c.mpc, 3)),
            ]);
        }
    }
    Block::Table(Table {
        caption: "Modes, all FRFs of a posture together".into(),
        columns: vec![
            Column::text("posture"),
            Column::number("frequency (Hz)"),
            Column::number("damping ratio (%)"),
            Column::number("seen in FRFs"),
            Column::number("phase collinearity"),
        ],
        rows,
        notes: vec![
            "± is one standard deviation. Phase collinearity: 1 where all points move in phase or against it.".into(),
        ],
    })
}

/// The same mode from posture to posture, one row a mode.
fn tracked(analysis: &ModalAnalysis) -> Option<Block> {
    let tracks = analysis.tracks();
    if tracks.is_empty() {
        return None;
    }
    let mut columns = vec![Column::text("mode")];
    columns.extend(
        analysis
            .sets
            .iter()
            .map(|s| Column::number(format!("{} (Hz, %)", s.set))),
    );
    let cell = |track: &Track, set: usize| {
        track.mode_of_set[set].map_or("–".to_string(), |m| {
            let mode = &analysis.sets[set].global.modes[m];
            format!(
                "{}, {}",
                with_error(mode.frequency_hz, mode.frequency_std_hz),
                with_error(100.0 * mode.damping_ratio, 100.0 * mode.damping_std)
            )
        })
    };
    Some(Block::Table(Table {
        caption: "The modes from posture to posture: frequency and damping ratio".into(),
        columns,
        rows: tracks
            .iter()
            .enumerate()
            .map(|(k, track)| {
                let mut row = vec![(k + 1).to_string()];
                row.extend((0..analysis.sets.len()).map(|set| cell(track, set)));
                row
            })
            .collect(),
        notes: vec![
            "Paired by frequency and shape; the order of close modes may change between postures.".into(),
        ],
    }))
}

fn stabilisation(set: &SetModes) -> Block {
    let diagram = &set.global.stabilisation;
    let mut measured: Vec<(f64, f64)> = Vec::new();
    for fit in set.global.reconstructions.iter().flatten() {
        if measured.is_empty() {
            measured = fit.frequency_hz.iter().map(|f| (*f, 0.0)).collect();
        }
        if measured.len() == fit.frequency_hz.len() {
            for (sum, h) in measured.iter_mut().zip(&fit.measured_m_per_n) {
                sum.1 += h.norm();
            }
        }
    }
    let picture = StabilisationFigure {
        title: format!("Stabilisation diagram, {}", set.set),
        poles: diagram
            .poles
            .iter()
            .map(|p| StabilisationPole {
                frequency_hz: p.frequency_hz,
                order: p.order,
                stable: p.stability == Stability::Full,
            })
            .collect(),
        chosen_hz: set.global.modes.iter().map(|m| m.frequency_hz).collect(),
        measured,
    };
    figure(
        "modal-stabilisation",
        "Poles over the model order; those that stay form columns",
        "Poles that stay from order to order are modes; the others follow noise.",
        picture.png(),
    )
}

/// The FRF that the modes describe best is the least interesting one: the median one is shown.
fn reconstruction(set: &SetModes) -> Option<Block> {
    let mut fits: Vec<(usize, f64)> = set
        .global
        .reconstructions
        .iter()
        .enumerate()
        .filter_map(|(k, r)| Some((k, r.as_ref()?.error_nrms)))
        .collect();
    fits.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (k, error) = *fits.get(fits.len() / 2)?;
    let fit = set.global.reconstructions[k].as_ref()?;
    let curve = |label: &str, value: &[Complex64]| FrfCurve {
        label: label.into(),
        frequency_hz: fit.frequency_hz.clone(),
        value: value.to_vec(),
    };
    let left: Vec<f64> = fit
        .measured_m_per_n
        .iter()
        .zip(&fit.fitted_m_per_n)
        .map(|(a, b)| (a - b).norm())
        .collect();
    let picture = FrfFigure {
        title: format!("{} {}", set.set, set.frfs[k].input.name),
        quantity: "Receptance".into(),
        unit: "m/N".into(),
        measured: Some(curve("measured", &fit.measured_m_per_n)),
        models: vec![curve("from the modes", &fit.fitted_m_per_n)],
        noise: Some(NoiseLevel {
            label: "left over".into(),
            frequency_hz: fit.frequency_hz.clone(),
            magnitude: left,
        }),
    };
    Some(figure(
        "modal-reconstruction",
        "A measured FRF and what the modes make of it",
        format!(
            "An FRF put together from the modes: {} % is left over, its noise is {} % (the median of the set).",
            decimals(100.0 * error, 1),
            decimals(100.0 * fit.noise_nrms, 1)
        ),
        picture.png(),
    ))
}

fn mac(set: &SetModes) -> Option<Block> {
    let names: Vec<String> = set
        .global
        .modes
        .iter()
        .map(|m| format!("{} Hz", decimals(m.frequency_hz, 1)))
        .collect();
    if names.len() < 2 {
        return None;
    }
    let picture = HeatMap {
        title: format!("MAC between the modes, {}", set.set),
        row_label: "Mode".into(),
        column_label: "Mode".into(),
        rows: names.clone(),
        columns: names,
        values: set
            .global
            .mac
            .iter()
            .map(|row| row.iter().map(|m| Some(*m)).collect())
            .collect(),
        value_label: "MAC".into(),
        format: CellFormat::Significant(2),
        range: Some((0.0, 1.0)),
        log: false,
        beside: Vec::new(),
        table_titles: Vec::new(),
    };
    Some(figure(
        "modal-mac",
        "Modal assurance criterion of every two modes",
        "Modes of one structure should be unlike each other; a high value off the diagonal is one mode found twice, or \
         too few points to tell.",
        picture.png(),
    ))
}
