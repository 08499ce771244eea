//! The source thesis put right: published, measured and ours, side by side, and what remains open.

use crate::lobes::Peak;
use crate::report::figure::{BarSeries, SideBySide};
use crate::report::number::{decimals, format_si, percent, significant};
use crate::report::parts::{figure, made, paragraph};
use crate::report::sections::{real_case_section, thesis_cutting};
use crate::report::words::parameter_of;
use crate::report::{Block, Page, ReportSection, ReportTable, TableColumn};
use crate::text::listed;
use crate::thesis::findings::Range;
use crate::thesis::{CaseStudy, ComparedRow, FITTED_CONFIGURATIONS, LobeTips, ThesisFindings};

/// The case study as a page of its own.
pub fn page(findings: &ThesisFindings) -> Page {
    Page {
        title: "The source thesis put right".into(),
        subtitle: "ABB IRB 6640: published model, measurement and this model side by side".into(),
        origin: made(),
        sections: vec![section(findings)],
        ..Page::default()
    }
}

pub fn section(findings: &ThesisFindings) -> ReportSection {
    let study = &findings.study;
    let mut blocks = vec![paragraph(format!(
        "Measured are the static stiffness of two postures (tables 5 and 6), the strongest mode of four configurations \
         (tables 9 and 15) and the stability lobes that a commercial program drew from the measured FRFs (table 30). \
         \"Published\" is the thesis's own model as printed. \"Ours, before\" is this program's model with the joint \
         compliances that the thesis publishes and nothing tuned; \"ours, after\" is the same model with joint \
         stiffnesses and damping tuned to the modal tables of configurations {}. The raw FRFs are not public.",
        listed(&FITTED_CONFIGURATIONS.map(String::from)),
    ))];
    blocks.push(static_figure(findings));
    blocks.push(static_table(findings));
    blocks.push(paragraph(static_text(findings)));
    blocks.push(value_figure(
        "thesis-frequencies",
        "Strongest mode: published, measured, ours",
        "Frequency (Hz)",
        &study.frequencies,
        1.0,
        "Frequency of the strongest mode in each direction.",
        true,
    ));
    blocks.push(row_table(
        "Frequency of the strongest mode (tables 9 and 15)",
        &study.frequencies,
        |v| decimals(v, 2),
    ));
    blocks.push(paragraph(frequency_text(findings)));
    blocks.push(row_table(
        "Largest real part of the receptance at that mode (µm/N)",
        &study.receptances,
        |v| decimals(v * 1e6, 2),
    ));
    blocks.push(paragraph(receptance_text(findings)));
    blocks.push(paragraph(unexplained_text(findings)));
    blocks.push(parameter_table(findings));
    blocks.extend(real_case_section::blocks(&study.real_case));
    blocks.push(lobe_table(findings));
    blocks.push(paragraph(lobe_text(findings)));
    blocks.push(assumption_table(&findings.study));
    blocks.extend(findings.study.lobe_reading.iter().cloned().map(paragraph));
    blocks.extend(thesis_cutting::blocks(&study.cutting));
    ReportSection {
        id: "thesis".into(),
        title: "The source thesis put right (ABB IRB 6640)".into(),
        lead: "Published model, measurement and this program side by side, with what remains unexplained."
            .into(),
        blocks,
    }
}

/// `1.06 to 1.18`, or one number where both are the same.
fn range([low, high]: Range) -> String {
    let text = |v: f64| {
        if v < 10.0 {
            decimals(v, 2)
        } else {
            significant(v, 3)
        }
    };
    let (low, high) = (text(low), text(high));
    if low == high {
        low
    } else {
        format!("{low} to {high}")
    }
}

fn maybe(value: Option<Range>) -> String {
    value.map_or("–".into(), range)
}

fn static_text(findings: &ThesisFindings) -> String {
    let mut text = format!(
        "{} Static stiffness, model over measurement: as published {}, ours before calibration {}, ours after {}.",
        findings.study.static_place(),
        maybe(findings.static_published),
        maybe(findings.static_before),
        maybe(findings.static_after),
    );
    if findings.static_got_worse() {
        text += " So calibrating on the modal tables pulls the static stiffness, which the fit did not see, away from \
                 its measurement.";
        if findings.static_after.is_some_and(|[low, _]| low > 1.0) {
            text += " The fit buys its frequencies with joints stiffer than the static measurement shows.";
        }
        text += " In this model one set of joint stiffnesses does not meet both measurements: something is missing or \
                 wrong in the model, in its masses, or in one of the two measurements.";
    } else {
        text += " Calibrating on the modal tables brought the static stiffness, which it did not see, no further from \
                 its measurement.";
    }
    text
}

fn frequency_text(findings: &ThesisFindings) -> String {
    let study = &findings.study;
    let mut predicted: Vec<String> = Vec::new();
    for row in study.frequencies.iter().filter(|r| !r.fitted) {
        if !predicted.contains(&row.posture) {
            predicted.push(row.posture.clone());
        }
    }
    format!(
        "Frequencies, model over measurement: as published {}, ours before {}. After the fit the error (rms) is {} on \
         the configurations that were fitted and {} on configuration {}, which was predicted: there the model gives {} \
         times the measured frequency, against {} before the fit.{}",
        maybe(findings.frequency_published),
        maybe(findings.frequency_before),
        percent(study.fitted_frequency_error),
        percent(study.predicted_frequency_error),
        listed(&predicted),
        maybe(findings.predicted_after),
        maybe(findings.predicted_before),
        if study.converged {
            ""
        } else {
            " The fit did NOT converge."
        },
    )
}

fn receptance_text(findings: &ThesisFindings) -> String {
    format!(
        "How much the strongest mode moves is met far less well: after the fit the model gives {} times the measured \
         real part on the fitted configurations and {} times on the predicted one. Frequencies alone do not make an FRF.",
        maybe(findings.receptance_after),
        maybe(findings.predicted_receptance_after),
    )
}

fn unexplained_text(findings: &ThesisFindings) -> String {
    let bands: Vec<String> = findings
        .study
        .unexplained
        .iter()
        .filter(|band| !(band.from_hz..=band.to_hz).contains(&band.nearest_model_hz))
        .map(|band| {
            format!(
                "{} minima of the real part at {}–{} Hz (configurations {}), while the model's nearest mode is at {} Hz",
                band.minima,
                band.from_hz,
                band.to_hz,
                listed(&band.configurations),
                decimals(band.nearest_model_hz, 1),
            )
        })
        .collect();
    if bands.is_empty() {
        return "The calibrated model has a mode in each band where the thesis measured resonances again and again.".into();
    }
    format!(
        "Not explained: the thesis measured {}. Rigid links on joint springs, calibrated on the strongest modes, \
         have no mode there. What may move there, as far as the public tables tell, is worked out below.",
        bands.join(", and "),
    )
}

fn row_name(row: &ComparedRow) -> String {
    format!("{} {}", row.posture, row.quantity)
}

/// Bars of the rows that were measured.
fn value_figure(
    file: &str,
    title: &str,
    y_label: &str,
    rows: &[ComparedRow],
    scale: f64,
    caption: &str,
    log: bool,
) -> Block {
    let rows: Vec<&ComparedRow> = rows.iter().filter(|r| r.measured.is_some()).collect();
    let series = |label: &str, value: &dyn Fn(&ComparedRow) -> Option<f64>| BarSeries {
        label: label.into(),
        values: rows.iter().map(|r| value(r).map(|v| v * scale)).collect(),
    };
    let drawing = SideBySide {
        level: None,
        title: title.into(),
        y_label: y_label.into(),
        groups: rows.iter().map(|r| row_name(r)).collect(),
        series: vec![
            series("published model", &|r| r.published_model),
            series("measured", &|r| r.measured),
            series("ours, before", &|r| Some(r.before)),
            series("ours, after", &|r| Some(r.after)),
        ],
        log,
    };
    let caption = if log {
        format!("{caption} The scale is logarithmic.")
    } else {
        caption.to_string()
    };
    figure(file, title, caption, drawing.png())
}

fn static_figure(findings: &ThesisFindings) -> Block {
    value_figure(
        "thesis-static-stiffness",
        "Static stiffness at the flange: published, measured, ours",
        "Stiffness (N/µm)",
        &findings.study.static_stiffness,
        1e-6,
        "Static stiffness at the flange where it was measured (postures A and B).",
        true,
    )
}

fn ratio(value: Option<f64>, measured: Option<f64>) -> String {
    value
        .zip(measured)
        .map_or("–".into(), |(v, m)| decimals(v / m, 2))
}

fn row_table(caption: &str, rows: &[ComparedRow], text: impl Fn(f64) -> String) -> Block {
    let optional = |v: Option<f64>| v.map_or("–".into(), &text);
    let cells = rows.iter().map(|row| {
        vec![
            row_name(row),
            optional(row.published_model),
            optional(row.measured),
            text(row.before),
            text(row.after),
            ratio(row.published_model, row.measured),
            ratio(Some(row.before), row.measured),
            ratio(Some(row.after), row.measured),
            match (row.measured, row.fitted) {
                (None, _) => "",
                (_, true) => "fitted",
                (_, false) => "predicted",
            }
            .to_string(),
        ]
    });
    Block::Table(ReportTable {
        caption: caption.into(),
        columns: vec![
            TableColumn::text(""),
            TableColumn::number("published"),
            TableColumn::number("measured"),
            TableColumn::number("ours, before"),
            TableColumn::number("ours, after"),
            TableColumn::number("published / measured"),
            TableColumn::number("before / measured"),
            TableColumn::number("after / measured"),
            TableColumn::text(""),
        ],
        rows: cells.collect(),
        notes: vec![],
    })
}

fn static_table(findings: &ThesisFindings) -> Block {
    row_table(
        "Static stiffness at the flange (tables 5 and 6), N/µm",
        &findings.study.static_stiffness,
        |v| significant(v * 1e-6, 4),
    )
}

fn parameter_table(findings: &ThesisFindings) -> Block {
    let rows = findings.study.parameters.iter().map(|p| {
        vec![
            parameter_of(&p.name),
            format_si(p.initial, p.unit, 4),
            crate::report::number::plus_minus(p.value, p.std_error, p.unit),
        ]
    });
    Block::Table(ReportTable {
        caption: "What the fit to the modal tables made of the published compliances".into(),
        columns: vec![
            TableColumn::text("parameter"),
            TableColumn::number("published"),
            TableColumn::number("fitted ± standard error"),
        ],
        rows: rows.collect(),
        notes: vec![],
    })
}

fn peak(peak: Option<Peak>) -> String {
    let depth = |depth: Option<f64>| depth.map_or("no limit".into(), |d| decimals(d, 3));
    peak.map_or("–".into(), |p| {
        format!("{} / {}", decimals(p.spindle_rpm, 0), depth(p.depth_mm))
    })
}

fn lobe_table(findings: &ThesisFindings) -> Block {
    let mut rows = Vec::new();
    for row in &findings.study.lobes {
        let c = row.configuration;
        let theirs = |name: &str, peaks: &[Peak]| {
            vec![
                format!("{c}: {name}"),
                peak(peaks.first().copied()),
                peak(peaks.get(1).copied()),
                "–".to_string(),
            ]
        };
        let ours = |name: &str, tips: &LobeTips| {
            vec![
                format!("{c}: {name}"),
                peak(tips.second_region),
                peak(tips.first_region),
                tips.absolute_limit
                    .map_or("–".into(), |a| decimals(a.depth_mm, 4)),
            ]
        };
        rows.push(theirs("the thesis's own program", &row.published_program));
        rows.push(theirs("commercial program, measured FRFs", &row.commercial));
        rows.push(ours(
            "ours, FRFs rebuilt from the measured minima",
            &row.from_measurements,
        ));
        rows.push(ours("ours, model before", &row.from_model_before));
        rows.push(ours("ours, model after", &row.from_model_after));
    }
    Block::Table(ReportTable {
        caption: "Drilling lobes (table 30): tips of the envelope as rpm / mm, and the absolute limit".into(),
        columns: vec![
            TableColumn::text("configuration"),
            TableColumn::number("second region"),
            TableColumn::number("first region"),
            TableColumn::number("absolute limit (mm)"),
        ],
        rows,
        notes: vec![],
    })
}

fn assumption_table(study: &CaseStudy) -> Block {
    let ratio = |r: Option<f64>| r.map_or("–".into(), |r| decimals(r, 2));
    let rows = study.lobe_assumptions.iter().map(|a| {
        let ratios = a.speed_ratio.into_iter().chain(a.depth_ratio).map(ratio);
        let found = format!("{}, {}", a.found[0], a.found[1]);
        std::iter::once(a.assumption.to_string())
            .chain(ratios)
            .chain([found])
            .collect()
    });
    Block::Table(ReportTable {
        caption: "Table 30 with one assumption switched at a time: the commercial program's tips over ours".into(),
        columns: vec![
            TableColumn::text("assumption"),
            TableColumn::number("speed, second region"),
            TableColumn::number("speed, first region"),
            TableColumn::number("depth, second region"),
            TableColumn::number("depth, first region"),
            TableColumn::text("tips found"),
        ],
        rows: rows.collect(),
        notes: vec![
            "Geometric mean over the configurations that have a tip within 10 % of 60 f/(N w), f the strongest mode, w = 2 \
             and 1 whole waves between two teeth (1½ and ½ where the delayed term has the wrong sign)."
                .into(),
        ],
    })
}

fn lobe_text(findings: &ThesisFindings) -> String {
    format!(
        "Depths: the thesis's own program gave {} times the commercial program's depths; ours, from FRFs rebuilt out of \
         the measured minima, are of the commercial program's order (theirs are {} times ours). Speeds do not agree: the \
         commercial program's tips lie at {} times our speeds in the second region and at {} times in the first. Tips \
         of a single mode must lie near 60 f/(N k), with N = {} teeth and k waves between two teeth, which is where ours \
         are. The table below switches one assumption at a time to see which could be the reason; neither column should be \
         taken for the truth before a cut has been made.",
        maybe(findings.published_depth),
        maybe(findings.depth),
        maybe(findings.speed_second_region),
        maybe(findings.speed_first_region),
        findings.teeth,
    )
}
