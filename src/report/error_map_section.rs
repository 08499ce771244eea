//! Where a model's error sits: by posture, direction and band, as maps.

use super::figure::{CellFormat, HeatMap};
use super::number::{percent, significant};
use super::parts::figure;
use super::{Block, Column, Section, Table};
use crate::analysis::StructureFindings;
use crate::discrepancy::compare::ErrorMap;

fn band_names(map: &ErrorMap) -> Vec<String> {
    map.band_edges_hz
        .windows(2)
        .map(|w| format!("{}–{}", significant(w[0], 2), significant(w[1], 2)))
        .collect()
}

/// Posture and direction over band in multiples of the noise, several maps of the same data beside each other on one
/// colour scale.
pub fn times_noise_map(title: &str, maps: &[(&str, &ErrorMap)]) -> HeatMap {
    let Some((_, first)) = maps.first() else {
        return HeatMap::default();
    };
    let directions = &first.directions;
    let rows = first
        .postures
        .iter()
        .flat_map(|p| directions.iter().map(move |d| format!("{p} {d}")));
    let values = |map: &ErrorMap| map.times_noise.iter().flatten().cloned().collect::<Vec<_>>();
    let top = maps
        .iter()
        .map(|(_, map)| largest(&values(map)))
        .fold(2.0, f64::max);
    HeatMap {
        title: title.into(),
        row_label: "Posture, direction (response, force)".into(),
        column_label: "Band (Hz)".into(),
        rows: rows.collect(),
        columns: band_names(first),
        values: values(first),
        value_label: "error / noise".into(),
        format: CellFormat::Significant(2),
        range: Some((1.0, top)),
        log: true,
        beside: maps.iter().skip(1).map(|(_, map)| values(map)).collect(),
        table_titles: match maps.len() {
            1 => Vec::new(),
            _ => maps.iter().map(|(title, _)| title.to_string()).collect(),
        },
    }
}

/// Where the error sits.
pub fn map_section(findings: &StructureFindings) -> Section {
    let after = &findings.analysis.after;
    let map = &after.map;
    let bands = band_names(map);
    let heat = |title: &str, row: &str, column: &str, rows: &[String], columns: &[String], values| HeatMap {
        title: title.into(),
        row_label: row.into(),
        column_label: column.into(),
        rows: rows.to_vec(),
        columns: columns.to_vec(),
        values,
        value_label: "error (nrms)".into(),
        ..Default::default()
    };
    let by_direction = heat(
        "Calibrated model: error by posture and direction",
        "Posture",
        "Direction (response, force)",
        &map.postures,
        &map.directions,
        map.posture_direction.clone(),
    );
    let whole = times_noise_map(
        "Calibrated model: error in multiples of the noise, everywhere",
        &[("", map)],
    );
    let mut blocks = vec![figure(
        "error-map",
        "Error of the calibrated model in multiples of the noise, by posture, direction and frequency band",
        "Error of the calibrated model in multiples of the measurement's noise, by posture and direction (rows) and \
         frequency band (columns): 1 is noise alone. What is dark is where to look first.",
        whole.png(),
    )];
    blocks.push(figure(
        "error-posture-direction",
        "Error of the calibrated model by posture and direction",
        "Error of the calibrated model by posture and direction, all frequencies together.",
        by_direction.png(),
    ));
    let against_noise = HeatMap {
        value_label: "error / noise".into(),
        format: CellFormat::Significant(2),
        range: Some((1.0, largest(&map.posture_direction_times_noise).max(2.0))),
        ..heat(
            "Calibrated model: error in multiples of the noise",
            "Posture",
            "Direction (response, force)",
            &map.postures,
            &map.directions,
            map.posture_direction_times_noise.clone(),
        )
    };
    blocks.push(figure(
        "error-times-noise",
        "Error of the calibrated model in multiples of the noise, by posture and direction",
        "The same in multiples of the measurement's noise: 1 is noise alone.",
        against_noise.png(),
    ));
    for (file, title, row_label, rows, values) in [
        (
            "error-posture-band",
            "posture",
            "Posture",
            &map.postures,
            &map.posture_band,
        ),
        (
            "error-direction-band",
            "direction",
            "Direction",
            &map.directions,
            &map.direction_band,
        ),
    ] {
        let drawing = heat(
            &format!("Calibrated model: error by {title} and frequency band"),
            row_label,
            "Band (Hz)",
            rows,
            &bands,
            values.clone(),
        );
        blocks.push(figure(
            file,
            &drawing.title.clone(),
            format!("Error of the calibrated model by {title} and frequency band."),
            drawing.png(),
        ));
    }
    let rows = after.by_band.iter().map(|b| {
        let times = if b.noise_floor_nrms > 0.0 {
            b.nrms / b.noise_floor_nrms
        } else {
            f64::NAN
        };
        vec![
            format!("{}–{} Hz", significant(b.from_hz, 3), significant(b.to_hz, 3)),
            percent(b.nrms),
            percent(b.noise_floor_nrms),
            significant(times, 2),
        ]
    });
    blocks.push(Block::Table(Table {
        caption: "Error by frequency band, all FRFs together".into(),
        columns: vec![
            Column::text("band"),
            Column::number("error"),
            Column::number("noise"),
            Column::number("× noise"),
        ],
        rows: rows.collect(),
        notes: vec![],
    }));
    Section {
        id: "error-map".into(),
        title: "Where the error is".into(),
        lead: "Dark cells are where the calibrated model and the measurement differ most for their size. Where the robot \
               hardly moves that may be noise alone: the maps in multiples of the noise say."
            .into(),
        blocks,
    }
}

fn largest(values: &[Vec<Option<f64>>]) -> f64 {
    values.iter().flatten().flatten().copied().fold(0.0, f64::max)
}
