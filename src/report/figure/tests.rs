//! Every figure on plausible and on odd data. `LOBESTONE_GALLERY=dir cargo test gallery` keeps the images to look at.

use std::collections::HashSet;

use num_complex::Complex64;

use super::samples::{frf_figure, gallery, jitter};
use super::*;
use crate::Error;

/// Width, height and number of distinct colours.
fn decoded(png: &[u8]) -> (u32, u32, usize) {
    assert!(png.starts_with(b"\x89PNG\r\n\x1a\n"));
    let mut decoder = png::Decoder::new(png);
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size()];
    let info = reader.next_frame(&mut pixels).unwrap();
    // Every seventh pixel tells a figure from a blank sheet.
    let colours: HashSet<&[u8]> = pixels.chunks_exact(3).step_by(7).collect();
    (info.width, info.height, colours.len())
}

#[test]
fn the_gallery_is_valid_not_blank_and_small() {
    let keep = std::env::var_os("LOBESTONE_GALLERY").map(std::path::PathBuf::from);
    for (name, png) in gallery() {
        let png = png.unwrap();
        let (width, height, colours) = decoded(&png);
        assert!(
            (1000..=1400).contains(&width) && (250..1400).contains(&height),
            "{name}: {width} × {height}"
        );
        // Edges of lines and letters have few shades each; a blank sheet has one colour.
        assert!(colours > 10, "{name}: {colours} colours");
        // Two maps side by side have the cells of two.
        let most = if name.ends_with("_pair") { 300_000 } else { 200_000 };
        assert!(png.len() < most, "{name}: {} bytes", png.len());
        if let Some(folder) = &keep {
            std::fs::create_dir_all(folder).unwrap();
            std::fs::write(folder.join(format!("{name}.png")), png).unwrap();
        }
    }
}

const LONG: &str = "a name out of a file that never ends, with µ, ζ, \u{4e2d}\u{6587}, \t tabs and <tags>, until nobody reads on ";

/// What goes wrong in files: nothing, one value, all the same, zeros, no numbers, absurd sizes.
fn odd_values() -> Vec<Vec<f64>> {
    vec![
        vec![],
        vec![3.0],
        vec![2.0; 30],
        vec![0.0; 30],
        vec![f64::NAN; 30],
        vec![f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 1.0],
        vec![1e-300, 1e300, -1e300, 5e-324, f64::MAX, f64::MIN],
        vec![-5.0, -4.0, 0.0, 1e-12, 1e12],
        vec![1e9, 1e9 + 1e-6, 1e9 + 2e-6],
        (0..150).map(|i| 10f64.powf(30.0 * jitter(i))).collect(),
    ]
}

/// A figure, or an error that says which figure it is; never a panic, never an empty image.
fn sound(name: &str, result: Result<Vec<u8>, Error>) {
    match result {
        Ok(png) => {
            let (width, height, colours) = decoded(&png);
            assert!(
                width >= 1000 && (140..4000).contains(&height) && colours > 10,
                "{name}: {width} × {height}, {colours} colours"
            );
        }
        Err(error) => assert!(error.to_string().contains("nothing to draw"), "{name}: {error}"),
    }
}

fn odd_curves(xs: &[f64], ys: &[f64]) -> Vec<Result<Vec<u8>, Error>> {
    let curve = FrfCurve {
        label: LONG.into(),
        frequency_hz: xs.to_vec(),
        value: ys
            .iter()
            .zip(ys.iter().rev())
            .map(|(a, b)| Complex64::new(*a, *b))
            .collect(),
    };
    let noise = NoiseLevel {
        frequency_hz: xs.to_vec(),
        magnitude: ys.to_vec(),
        ..Default::default()
    };
    let frf = FrfFigure {
        measured: Some(curve.clone()),
        models: vec![curve.clone(); 4],
        noise: Some(noise),
        ..Default::default()
    };
    let nyquist = NyquistFigure {
        models: vec![curve],
        ..Default::default()
    };
    let first = |v: &[f64]| v.first().copied().unwrap_or(f64::NAN);
    let some = |v: &[f64]| v.iter().copied().map(Some).collect::<Vec<_>>();
    let lobes = LobesFigure {
        panels: vec![LobePanel {
            curves: vec![LobeTrace {
                spindle_rpm: xs.to_vec(),
                depth_limit_mm: some(ys),
                before_mm: some(xs),
                band_mm: Some([some(xs), some(ys)]),
                ..Default::default()
            }],
            absolute_limit_mm: ys.last().copied(),
            markers: vec![LobeMarker {
                spindle_rpm: first(xs),
                depth_mm: first(ys),
                outcome: LobeOutcome::Stable,
                label: "cut".into(),
            }],
            ..Default::default()
        }],
        depth_cap_mm: xs.last().copied(),
        ..Default::default()
    };
    vec![frf.png(), nyquist.png(), lobes.png()]
}

fn odd_points(xs: &[f64], ys: &[f64]) -> Vec<Result<Vec<u8>, Error>> {
    let pairs = || xs.iter().copied().zip(ys.iter().copied()).take(30);
    let first = |v: &[f64]| v.first().copied().unwrap_or(f64::NAN);
    let points = pairs().map(|(x, y)| RegressionMark {
        label: String::new(),
        x,
        y,
        std_error: Some(x),
        excluded: false,
    });
    let series = RegressionSeries {
        points: points.collect(),
        line: Some((first(ys), first(xs))),
        ..Default::default()
    };
    let regression = RegressionFigure {
        series: vec![series],
        ..Default::default()
    };
    let revisions = pairs().map(|(x, y)| HistoryMark {
        label: LONG.into(),
        fit_nrms: x,
        held_out_nrms: Some(y),
    });
    let history = HistoryFigure {
        title: LONG.into(),
        revisions: revisions.collect(),
        noise_floor_nrms: ys.last().copied(),
    };
    let rows = pairs().map(|(x, y)| ParameterRow {
        name: LONG.into(),
        unit: "N".into(),
        nominal: x,
        before: Some(DrawnEstimate {
            value: y,
            std_error: Some(x),
        }),
        after: None,
    });
    let parameters = ParameterFigure {
        rows: rows.collect(),
        ..Default::default()
    };
    let point = |(x, y): (f64, f64)| ControlPoint {
        value: x,
        std_error: Some(y),
        outside: x > y,
    };
    let panel = |limits| ControlPanel {
        label: LONG.into(),
        points: pairs()
            .map(|p| Some(p).filter(|(x, _)| *x != 2.0).map(point))
            .collect(),
        limits,
    };
    let control = ControlChartFigure {
        title: LONG.into(),
        names: vec![LONG.into(); pairs().count()],
        panels: vec![panel(None), panel(Some([first(xs), first(ys), 1.0]))],
    };
    vec![regression.png(), history.png(), parameters.png(), control.png()]
}

#[test]
fn odd_numbers_never_panic() {
    let all = odd_values();
    for (i, xs) in all.iter().enumerate() {
        // Each kind against itself, its third neighbour and plain numbers: all pairs would take a minute.
        for j in HashSet::from([i, (i + 3) % all.len(), 2]) {
            let ys = &all[j];
            for (k, result) in odd_curves(xs, ys)
                .into_iter()
                .chain(odd_points(xs, ys))
                .enumerate()
            {
                sound(&format!("x {i}, y {j}, figure {k}"), result);
            }
        }
    }
}

#[test]
fn odd_records_never_panic() {
    for (i, values) in odd_values().into_iter().enumerate() {
        for interval in [1e-4, 0.0, -1.0, f64::NAN, 1e250, 1e-250] {
            let channel = ForceTrace {
                label: LONG.into(),
                sample_interval_s: interval,
                samples: values.clone(),
                drift: values.iter().map(|v| (*v, *v)).collect(),
                steady_level: values.last().copied(),
                ..Default::default()
            };
            let record = ForceRecord {
                title: LONG.into(),
                channels: vec![channel; 2],
                air_s: vec![(f64::NAN, 1.0), (5.0, -5.0)],
                steady_s: Some((values.first().copied().unwrap_or(0.0), 0.0)),
            };
            sound(&format!("values {i}, interval {interval}"), record.png());
        }
    }
}

#[test]
fn odd_tables_and_bars_never_panic() {
    for (i, values) in odd_values().into_iter().enumerate() {
        let cells: Vec<Option<f64>> = values.iter().map(|v| Some(*v)).take(100).collect();
        for format in [
            CellFormat::Percent,
            CellFormat::Significant(0),
            CellFormat::Significant(99),
            CellFormat::Decimals(2),
            CellFormat::Decimals(99),
        ] {
            let map = HeatMap {
                title: LONG.repeat(50),
                rows: vec![LONG.into(); 3],
                columns: vec![LONG.into(); cells.len()],
                // One row too few, one value too few: what is missing stays empty.
                values: vec![cells.clone(), cells.iter().copied().skip(1).collect()],
                format,
                range: Some((values.first().copied().unwrap_or(1.0), 1.0)),
                log: true,
                beside: vec![vec![cells.clone()], vec![]],
                table_titles: vec![LONG.into(); 2],
                ..Default::default()
            };
            sound(&format!("map {i} {format:?}"), map.png());
        }
        for log in [true, false] {
            let bars = SideBySide {
                level: Some((LONG.into(), values.first().copied().unwrap_or(1.0))),
                title: LONG.repeat(50),
                y_label: LONG.into(),
                groups: vec![LONG.into(); cells.len().min(60)],
                series: vec![
                    BarSeries {
                        label: LONG.into(),
                        values: cells.clone()
                    };
                    4
                ],
                log,
            };
            sound(&format!("bars {i} {log}"), bars.png());
        }
    }
}

#[test]
fn mode_shapes_and_coherence_draw_whatever_they_are_given() {
    let chain = vec![[0.0; 3], [0.0, 0.0, 1.0], [1.2, 0.4, 1.1]];
    for moved in [[0.0; 3], [1.0, -0.3, 0.2]] {
        let picture = StickPicture {
            title: "7.08 Hz, 3.7 %".into(),
            chain: chain.clone(),
            chain_moved: vec![[0.0; 3], [0.0; 3], moved],
            points: vec![(chain[2], moved)],
        };
        let figure = ModeShapesFigure {
            title: "Measured mode shapes, p1".into(),
            pictures: vec![picture; 4],
        };
        sound("mode shapes", figure.png());
    }
    let coherence = CoherenceFigure {
        title: "Coherence".into(),
        curves: vec![CoherenceCurve {
            label: "1X/1X".into(),
            frequency_hz: vec![1.0, 2.0, 3.0],
            coherence: vec![0.4, 1.0, f64::NAN],
        }],
    };
    sound("coherence", coherence.png());
}

#[test]
fn an_empty_figure_is_an_error_that_names_it() {
    let title = || "cut 07".to_owned();
    let results = [
        FrfFigure {
            title: title(),
            ..Default::default()
        }
        .png(),
        NyquistFigure {
            title: title(),
            ..Default::default()
        }
        .png(),
        HeatMap {
            title: title(),
            ..Default::default()
        }
        .png(),
        ParameterFigure {
            title: title(),
            ..Default::default()
        }
        .png(),
        ForceRecord {
            title: title(),
            ..Default::default()
        }
        .png(),
        RegressionFigure {
            title: title(),
            ..Default::default()
        }
        .png(),
        LobesFigure {
            title: title(),
            ..Default::default()
        }
        .png(),
        HoleFigure {
            title: title(),
            ..Default::default()
        }
        .png(),
        SideBySide {
            title: title(),
            ..Default::default()
        }
        .png(),
        HistoryFigure {
            title: title(),
            ..Default::default()
        }
        .png(),
        CoherenceFigure {
            title: title(),
            ..Default::default()
        }
        .png(),
        ModeShapesFigure {
            title: title(),
            ..Default::default()
        }
        .png(),
    ];
    for result in results {
        let message = result.unwrap_err().to_string();
        assert!(message.contains("\"cut 07\" has nothing to draw"), "{message}");
    }
}

#[test]
fn the_same_numbers_give_the_same_bytes() {
    assert_eq!(frf_figure().png().unwrap(), frf_figure().png().unwrap());
}

/// Share of the image that has exactly this colour.
fn share_of(png: &[u8], wanted: super::sheet::canvas::Color) -> f64 {
    let mut decoder = png::Decoder::new(png);
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size()];
    reader.next_frame(&mut pixels).unwrap();
    let same = pixels
        .chunks_exact(3)
        .filter(|p| *p == [wanted.0, wanted.1, wanted.2])
        .count();
    same as f64 / (pixels.len() / 3) as f64
}

#[test]
fn a_cell_has_the_colour_of_its_value() {
    let map = |value| {
        let map = HeatMap {
            rows: vec!["r".into()],
            columns: vec!["c".into()],
            values: vec![vec![Some(value)]],
            range: Some((0.0, 1.0)),
            ..Default::default()
        };
        map.png().unwrap()
    };
    let (low, high) = (super::sheet::style::ramp(0.0), super::sheet::style::ramp(1.0));
    assert!(share_of(&map(0.0), low) > 0.3 && share_of(&map(0.0), high) < 0.01);
    assert!(share_of(&map(1.0), high) > 0.3 && share_of(&map(1.0), low) < 0.01);
}

/// The gallery as a report, to look at in a browser (kept with `LOBESTONE_GALLERY`).
#[test]
fn the_gallery_makes_a_report_of_bearable_size() {
    use crate::report::{Block, Figure, Page, ReportSection, ReportTable, TableColumn};
    let figures = gallery().into_iter().map(|(name, png)| {
        Block::Figure(Figure {
            file_name: name.into(),
            alt: format!("Sample figure {name}"),
            caption:
                "What is to be seen, said in one sentence: the calibrated model follows the first two modes."
                    .into(),
            png: png.unwrap(),
            ..Figure::default()
        })
    });
    let table = ReportTable {
        caption: "Joint stiffness".into(),
        columns: vec![
            TableColumn::text("Parameter"),
            TableColumn::number("Nominal"),
            TableColumn::number("Calibrated"),
            TableColumn::text("Remark"),
        ],
        rows: (1..=6)
            .map(|i| {
                let value = 2.5e6 / f64::from(i);
                let calibrated = crate::report::number::plus_minus(0.9 * value, 0.002 * value, "N·m/rad");
                let nominal = crate::report::number::format_si(value, "N·m/rad", 4);
                vec![format!("joint {i}"), nominal, calibrated, "prior ± 30 %".into()]
            })
            .collect(),
        notes: vec!["Errors are one standard deviation.".into()],
    };
    let summary = ReportSection {
        title: "Summary".into(),
        lead: "The calibrated model explains the measurement down to 11 %; the noise alone is 2 %.".into(),
        blocks: vec![
            Block::KeyValues(vec![
                ("Robot".into(), "irb6640".into()),
                ("Postures".into(), "p1, p2, p3, p4".into()),
                ("Error before → after".into(), "92 % → 11 %".into()),
            ]),
            Block::Paragraph(
                "Modes at 32–37 Hz and 47–49 Hz are not explained by joint compliance alone. ".repeat(3),
            ),
            Block::Warning("Cut 12 has no air segment: its drift was not taken off <b>.".into()),
            Block::Table(table),
            Block::Pre("$ lobestone calibrate cell7\nnrms 92.1 % → 11.3 %".into()),
        ],
        ..Default::default()
    };
    let all = ReportSection {
        title: "All figures".into(),
        blocks: figures.collect(),
        ..Default::default()
    };
    let page = Page {
        title: "Cell 7, spring check".into(),
        subtitle: "Campaign report, 4 postures, 36 FRFs, 16 cuts".into(),
        sections: vec![summary, all],
        ..Page::default()
    };
    assert!(page.html().unwrap().len() < 2_000_000);
    if let Some(folder) = std::env::var_os("LOBESTONE_GALLERY") {
        page.write(std::path::Path::new(&folder)).unwrap();
    }
}
