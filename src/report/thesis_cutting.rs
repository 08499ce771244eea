//! The thesis's tables of milling coefficients: cast against printed titanium over speed, and what may be read from them.

use super::figure::{RegressionFigure, RegressionMark, RegressionSeries};
use super::number::significant;
use super::parts::{figure, paragraph};
use super::{Block, ReportTable, TableColumn};
use crate::cutting::MILLING_COEFFICIENTS;
use crate::thesis::CuttingTables;
use crate::thesis::cutting_tables::{CAST, PRINTED};

pub fn blocks(tables: &CuttingTables) -> Vec<Block> {
    let mut blocks = vec![titanium_figure(tables), coefficient_table(tables)];
    blocks.extend(tables.reading.iter().map(|text| paragraph(text.clone())));
    blocks
}

/// Cutting coefficients of both kinds of titanium; one sign a series, so that grey print keeps them apart.
fn titanium_figure(tables: &CuttingTables) -> Block {
    let mut series = Vec::new();
    for (j, kind) in MILLING_COEFFICIENTS.iter().enumerate().filter(|(_, k)| !k.edge) {
        for (material, name) in [(CAST, "cast"), (PRINTED, "WAAM")] {
            series.push(RegressionSeries {
                label: format!("{} {name}", kind.label),
                points: tables
                    .of(material)
                    .map(|row| RegressionMark {
                        label: String::new(),
                        x: row.cutting_speed_m_per_min,
                        y: row.coefficients[j],
                        std_error: None,
                        excluded: false,
                    })
                    .collect(),
                line: None,
            });
        }
    }
    let drawing = RegressionFigure {
        title:
            "Cutting coefficients of titanium over cutting speed: cast and WAAM (thesis, tables 20 and 23)"
                .into(),
        x_label: "Cutting speed (m/min)".into(),
        y_label: "Cutting coefficient (N/mm²)".into(),
        series,
    };
    figure(
        "thesis-cutting-coefficients",
        &drawing.title.clone(),
        "Cutting coefficients as published, one sign a row of the table. No error bars: the tables print no standard errors. \
         Slow and fast cuts are two series of their own.",
        drawing.png(),
    )
}

fn coefficient_table(tables: &CuttingTables) -> Block {
    let mut columns = vec![
        TableColumn::text("material"),
        TableColumn::text("row"),
        TableColumn::number("m/min"),
        TableColumn::number("feeds"),
    ];
    columns.extend(
        MILLING_COEFFICIENTS
            .iter()
            .map(|c| TableColumn::number(format!("{} {}", c.label, c.unit))),
    );
    let rows = tables.rows.iter().map(|r| {
        let mut row = vec![
            r.material.clone(),
            r.graph.clone(),
            significant(r.cutting_speed_m_per_min, 3),
            r.feeds_in_words(),
        ];
        row.extend(r.coefficients.iter().map(|k| significant(*k, 3)));
        row
    });
    Block::Table(ReportTable {
        caption: "Milling coefficients of the thesis (tables 20 and 23)".into(),
        columns,
        rows: rows.collect(),
        notes: vec![
            "feeds: with data / planned (<4/4: some are missing, which is not printed). Edge coefficients below zero are no physics; see below.".into(),
        ],
    })
}
