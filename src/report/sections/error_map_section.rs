//! Where a model's error sits: by posture, direction and band, as maps.

use crate::analysis::StructureFindings;
use crate::discrepancy::FrfComparison;
use crate::discrepancy::comparison::compare::{ErrorMap, FrfError};
use crate::report::figure::{CellFormat, HeatMap};
use crate::report::interactive::stages;
use crate::report::number::{percent, significant};
use crate::report::parts::figure;
use crate::report::{Block, ReportSection, ReportTable, TableColumn};

fn band_names(map: &ErrorMap) -> Vec<String> {
    map.band_edges_hz
        .windows(2)
        .map(|w| format!("{}–{}", significant(w[0], 2), significant(w[1], 2)))
        .collect()
}

/// Posture and direction over band in multiples of the noise, several maps of the same data side by side on one
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
        .fold(LEAST_TOP, f64::max);
    HeatMap {
        title: title.into(),
        row_label: "Posture, direction (response, force)".into(),
        column_label: "Band (Hz)".into(),
        rows: rows.collect(),
        columns: band_names(first),
        values: values(first),
        value_label: TIMES_NOISE.into(),
        shades: Vec::new(),
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

/// What the colours of all maps of an FRF's error mean.
pub const TIMES_NOISE: &str = "error / noise (1 = noise alone)";

/// The scale ends there at least, in multiples of the noise: over the few lines of a cell noise alone is up to half as large
/// again as it is on average, and must not look like an error.
pub const LEAST_TOP: f64 = 5.0;

/// One of the maps of the error.
struct Kind {
    file: &'static str,
    alt: &'static str,
    caption: &'static str,
    /// Of a model called so.
    map: fn(&str, &FrfComparison) -> HeatMap,
    /// Number of the FRF behind a cell.
    frf: fn(&FrfComparison, usize, usize) -> Option<usize>,
    /// Whether columns are bands.
    bands: bool,
}

const KINDS: [Kind; 5] = [
    Kind {
        file: "error-map",
        alt: "Error of the calibrated model in multiples of the noise, by posture, direction and frequency band",
        caption: "Error of the model in multiples of the measurement's noise, by posture and direction (rows) and \
                  frequency band (columns): 1 is noise alone. What stands out is where to look first.",
        map: |model, c| {
            times_noise_map(
                &format!("{model}: error in multiples of the noise, everywhere"),
                &[("", &c.map)],
            )
        },
        frf: |c, row, band| {
            let directions = c.map.directions.len().max(1);
            worst(c, Some(row / directions), Some(row % directions), Some(band))
        },
        bands: true,
    },
    Kind {
        file: "error-posture-direction",
        alt: "Error of the calibrated model by posture and direction",
        caption: "Error of the model by posture and direction, all frequencies together. Numbers are the error, colours \
                  its ratio to the noise: where the robot hardly moves, a large error may be noise alone.",
        map: |model, c| {
            let (numbers, shades) = (&c.map.posture_direction, &c.map.posture_direction_times_noise);
            let map = &c.map;
            heat(
                model,
                "posture and direction",
                ["Posture", DIRECTION],
                [&map.postures, &map.directions],
                numbers,
                shades,
            )
        },
        frf: |c, row, column| worst(c, Some(row), Some(column), None),
        bands: false,
    },
    Kind {
        file: "error-times-noise",
        alt: "Error of the calibrated model in multiples of the noise, by posture and direction",
        caption: "The same in multiples of the measurement's noise: 1 is noise alone.",
        map: |model, c| {
            let numbers = &c.map.posture_direction_times_noise;
            let names = [&c.map.postures, &c.map.directions];
            HeatMap {
                title: format!("{model}: error in multiples of the noise"),
                format: CellFormat::Significant(2),
                ..heat(model, "", ["Posture", DIRECTION], names, numbers, numbers)
            }
        },
        frf: |c, row, column| worst(c, Some(row), Some(column), None),
        bands: false,
    },
    Kind {
        file: "error-posture-band",
        alt: "Error of the calibrated model by posture and frequency band",
        caption: "Error of the model by posture and frequency band; colours are its ratio to the noise.",
        map: |model, c| {
            let (numbers, shades) = (&c.map.posture_band, &c.map.posture_band_times_noise);
            let names = [&c.map.postures, &band_names(&c.map)];
            heat(
                model,
                "posture and frequency band",
                ["Posture", "Band (Hz)"],
                names,
                numbers,
                shades,
            )
        },
        frf: |c, row, band| worst(c, Some(row), None, Some(band)),
        bands: true,
    },
    Kind {
        file: "error-direction-band",
        alt: "Error of the calibrated model by direction and frequency band",
        caption: "Error of the model by direction and frequency band; colours are its ratio to the noise.",
        map: |model, c| {
            let (numbers, shades) = (&c.map.direction_band, &c.map.direction_band_times_noise);
            let names = [&c.map.directions, &band_names(&c.map)];
            heat(
                model,
                "direction and frequency band",
                ["Direction", "Band (Hz)"],
                names,
                numbers,
                shades,
            )
        },
        frf: |c, row, band| worst(c, None, Some(row), Some(band)),
        bands: true,
    },
];

const DIRECTION: &str = "Direction (response, force)";

/// A table of errors coloured by their ratio to the noise.
fn heat(
    model: &str,
    by: &str,
    [row, column]: [&str; 2],
    [rows, columns]: [&Vec<String>; 2],
    values: &[Vec<Option<f64>>],
    times_noise: &[Vec<Option<f64>>],
) -> HeatMap {
    HeatMap {
        title: format!("{model}: error by {by}"),
        row_label: row.into(),
        column_label: column.into(),
        rows: rows.clone(),
        columns: columns.clone(),
        values: values.to_vec(),
        shades: times_noise.to_vec(),
        value_label: TIMES_NOISE.into(),
        range: Some((1.0, largest(times_noise).max(LEAST_TOP))),
        log: true,
        ..Default::default()
    }
}

/// The FRF with most error against its noise at a posture, in a direction, in a band; of all where they are not given.
fn worst(
    comparison: &FrfComparison,
    posture: Option<usize>,
    direction: Option<usize>,
    band: Option<usize>,
) -> Option<usize> {
    let (postures, directions) = (&comparison.map.postures, &comparison.map.directions);
    let errors = comparison.frf_errors.iter().enumerate().filter(|(_, e)| {
        posture.is_none_or(|p| postures.get(p) == Some(&e.posture))
            && direction.is_none_or(|d| directions.get(d) == Some(&e.direction))
    });
    let times = |e: &FrfError| match band {
        Some(band) => *e.band_times_noise.get(band)?,
        None => Some(e.times_noise()),
    };
    errors
        .filter_map(|(i, e)| Some((i, times(e)?)))
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(i, _)| i)
}

/// Where the error sits.
pub fn map_section(findings: &StructureFindings) -> ReportSection {
    let after = &findings.analysis.after;
    let stages = stages(findings);
    let bands: Vec<[f64; 2]> = after.map.band_edges_hz.windows(2).map(|w| [w[0], w[1]]).collect();
    let mut blocks = Vec::new();
    for kind in &KINDS {
        let map = (kind.map)("Calibrated model", after);
        let mut of_stages: Vec<HeatMap> = stages
            .iter()
            .map(|stage| (kind.map)(&stage.named(), stage.comparison))
            .collect();
        // One scale for all, so that a map turns lighter as its error falls.
        let top = of_stages
            .iter()
            .filter_map(|m| m.range)
            .map(|r| r.1)
            .fold(LEAST_TOP, f64::max);
        for map in &mut of_stages {
            map.range = Some((1.0, top));
        }
        let frf = |row, column| (kind.frf)(after, row, column);
        let frfs: Vec<Vec<Option<usize>>> = (0..map.rows.len())
            .map(|r| (0..map.columns.len()).map(|c| frf(r, c)).collect())
            .collect();
        let plot = of_stages.last().unwrap_or(&map).plot();
        let plot = plot
            .leading_to(&frfs, if kind.bands { &bands } else { &[] })
            .at_stages(&of_stages);
        blocks.push(figure(kind.file, kind.alt, kind.caption, map.png()).with_plot(plot));
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
    blocks.push(Block::Table(ReportTable {
        caption: "Error by frequency band, all FRFs together".into(),
        columns: vec![
            TableColumn::text("band"),
            TableColumn::number("error"),
            TableColumn::number("noise"),
            TableColumn::number("× noise"),
        ],
        rows: rows.collect(),
        notes: vec![],
    }));
    ReportSection {
        id: "error-map".into(),
        title: "Where the error is".into(),
        lead: "The more a cell stands out from the page, the more model and measurement differ there for the noise; where only noise \
               is left, cells fade. On a screen a click on a cell (keyboard: arrow keys, Enter) shows the FRF behind it (of several \
               the one with most error), and the buttons above a map show it for other states of the model."
            .into(),
        blocks,
    }
}

fn largest(values: &[Vec<Option<f64>>]) -> f64 {
    values.iter().flatten().flatten().copied().fold(0.0, f64::max)
}
