//! The robot model against measured FRFs: FRFs, error map, parameters.

use crate::analysis::{PostureFindings, StructureFindings};
use crate::identify::FrfData;
use crate::report::figure::{
    self, FrfCurve, FrfFigure, NoiseLevel, ParameterFigure, ParameterRow, RobotFigure,
};
use crate::report::interactive::Explorer;
use crate::report::number::{decimals, percent, plus_minus, significant};
use crate::report::parts::{figure, paragraph};
use crate::report::sections::history_section::Stage;
use crate::report::sections::{error_map_section, history_section};
use crate::report::words::{count, frf_name, parameter_of};
use crate::report::{Block, OnScreen, ReportSection, ReportTable, TableColumn};
use crate::text::listed;

/// FRFs shown as figures: the worst and the best.
const WORST_SHOWN: usize = 3;
/// FRFs listed.
const LISTED: usize = 12;
/// Up to this many times the noise an error is called noise.
pub const NOISE_LIKE: f64 = 1.1;

/// What a reader must know of the fit, in plain words.
pub fn summary(findings: &StructureFindings) -> String {
    let data = &findings.analysis.case.data;
    let (before, after) = (&findings.analysis.before.totals, &findings.analysis.after.totals);
    let mut text = format!(
        "{} at {} were compared with the model of the {}. With the values of the robot file the error (nrms) was {}; ",
        count(data.frfs().count(), "measured FRF", "measured FRFs"),
        count(data.measured_postures().len(), "posture", "postures"),
        findings.analysis.case.model.robot.spec.name,
        percent(before.nrms),
    );
    let added = findings.analysis.case.model.effects();
    let names: Vec<String> = added.iter().map(|a| a.instance.title()).collect();
    // To each its own: what calibration did, and what the effects did.
    text += &match (names.as_slice(), findings.earlier.first()) {
        ([], _) => format!("after calibration it is {}.", percent(after.nrms)),
        (some, Some(first)) => format!(
            "after calibration alone it was {}; with what was added to the model, {}, it is {}.",
            percent(first.comparison.totals.nrms),
            listed(some),
            percent(after.nrms)
        ),
        (some, None) => format!(
            "calibrated with what was added to the model, {}, it is {}.",
            listed(some),
            percent(after.nrms)
        ),
    };
    text += &format!(
        " The noise of the measurement itself amounts to {}.",
        percent(after.noise_floor_nrms)
    );
    if let Some(held_out) = findings.held_out_nrms {
        text += &format!(
            " Postures that were left out of the fit are predicted with an error of {}.",
            percent(held_out)
        );
    }
    text + " " + &verdict(findings)
}

/// Is what is left noise?
fn verdict(findings: &StructureFindings) -> String {
    let after = &findings.analysis.after;
    let times = |nrms: f64, floor: f64| if floor > 0.0 { nrms / floor } else { f64::INFINITY };
    let total = times(after.totals.nrms, after.totals.noise_floor_nrms);
    let worst_band = after
        .by_band
        .iter()
        .max_by(|a, b| times(a.nrms, a.noise_floor_nrms).total_cmp(&times(b.nrms, b.noise_floor_nrms)));
    let band_text = worst_band.map(|b| {
        let (from, to) = (significant(b.from_hz, 3), significant(b.to_hz, 3));
        let times = significant(times(b.nrms, b.noise_floor_nrms), 2);
        (format!("{from}–{to} Hz"), times, b)
    });
    if total <= NOISE_LIKE {
        let mut text = String::from(
            "What is left is as large as the noise: by its size alone it shows nothing that the model lacks.",
        );
        if let Some((band, ratio, b)) = band_text
            && times(b.nrms, b.noise_floor_nrms) > 1.5
        {
            text += &format!(" Only the band {band} stands out with {ratio} times its noise.");
        }
        return text;
    }
    let mut text = format!(
        "What is left is {} times the noise, so it is not noise: either the model lacks something that these FRFs \
         show, or the measurement has a systematic error.",
        significant(total, 2)
    );
    if let Some((band, ratio, _)) = band_text {
        text += &format!(" It stands out most at {band} ({ratio} times the noise there).");
    }
    text + " Parameters of a model that does not fit are not the robot's: they bend to make up for what is missing."
}

pub fn sections(findings: &StructureFindings) -> Vec<ReportSection> {
    let mut sections = vec![frf_section(findings), error_map_section::map_section(findings)];
    let now = &findings.analysis;
    let earlier = findings.earlier.iter();
    let stages: Vec<Stage> = earlier
        .map(|stage| Stage {
            predicted: &stage.predicted,
            comparison: &stage.comparison,
        })
        .chain([Stage {
            predicted: &now.calibrated,
            comparison: &now.after,
        }])
        .collect();
    let steps: Vec<(&FrfData, [Stage; 2])> = stages
        .windows(2)
        .map(|w| (&now.case.data, [w[0], w[1]]))
        .collect();
    sections.extend(history_section::section(&now.case.revisions, &steps));
    sections.push(parameter_section(findings));
    sections
}

/// Model against measurement as curves.
pub fn frf_section(findings: &StructureFindings) -> ReportSection {
    let errors = &findings.analysis.after.frf_errors;
    let order = findings.analysis.after.worst_first();
    let best = order
        .iter()
        .copied()
        .min_by(|&a, &b| errors[a].nrms.total_cmp(&errors[b].nrms));
    let worst: Vec<usize> = order
        .iter()
        .copied()
        .take(WORST_SHOWN)
        .filter(|i| Some(*i) != best)
        .collect();
    let mut blocks = vec![Block::Explorer(Box::new(Explorer::new(findings)))];
    if let Some(best) = best {
        blocks.push(frf_figure(
            findings,
            best,
            "frf-best",
            "The FRF that the calibrated model meets best",
        ));
    }
    for (rank, &index) in worst.iter().enumerate() {
        let place = [
            "The FRF with most error against its noise",
            "Second most error against noise",
            "Third most error against noise",
        ]
        .get(rank)
        .copied()
        .unwrap_or("Much error against noise");
        blocks.push(frf_figure(
            findings,
            index,
            &format!("frf-worst-{}", rank + 1),
            place,
        ));
    }
    blocks.push(frf_table(findings, &order));
    ReportSection {
        id: "frfs".into(),
        title: "Model against measured FRFs".into(),
        lead: "Receptance: how far the robot moves for each newton, over frequency. Points are measured, lines are the model."
            .into(),
        blocks,
    }
}

fn frf_figure(findings: &StructureFindings, index: usize, file: &str, place: &str) -> Block {
    let analysis = &findings.analysis;
    let (Some((block, frf)), Some(before), Some(after)) = (
        analysis.case.data.frfs().nth(index),
        analysis.before.frf_errors.get(index),
        analysis.after.frf_errors.get(index),
    ) else {
        return paragraph("");
    };
    let curve = |label: String, value: &[num_complex::Complex64]| FrfCurve {
        label,
        frequency_hz: block.frequency_hz.clone(),
        value: value.to_vec(),
    };
    let name = frf_name(&after.posture, &after.name);
    let added = !analysis.case.model.effects().is_empty();
    let first = findings.earlier.first().filter(|_| added);
    let without =
        first.and_then(|stage| Some((&stage.predicted, stage.comparison.frf_errors.get(index)?.nrms)));
    let mut models = vec![("robot file", &analysis.nominal, before.nrms)];
    models.extend(without.map(|(predicted, nrms)| ("calibrated, nothing added", predicted, nrms)));
    let now = if added {
        "with what was added"
    } else {
        "calibrated"
    };
    models.push((now, &analysis.calibrated, after.nrms));
    let drawing = FrfFigure {
        title: format!("{name}: model against measurement"),
        quantity: "Receptance".into(),
        unit: "m/N".into(),
        measured: Some(curve("measured".into(), &frf.receptance)),
        models: models
            .into_iter()
            .filter_map(|(label, predicted, nrms)| {
                let label = format!("model, {label} (error {})", percent(nrms));
                Some(curve(label, predicted.get(index)?))
            })
            .collect(),
        noise: Some(NoiseLevel {
            label: "noise level".into(),
            frequency_hz: block.frequency_hz.clone(),
            magnitude: frf.noise_std.clone(),
        }),
    };
    let steps = match without {
        Some((_, nrms)) => format!(
            "Error {} before calibration, {} after it, {} with what was added",
            percent(before.nrms),
            percent(nrms),
            percent(after.nrms)
        ),
        None => format!(
            "Error {} before and {} after calibration",
            percent(before.nrms),
            percent(after.nrms)
        ),
    };
    let caption = format!(
        "{place}: {name}. {steps}; its noise is {}.",
        percent(after.noise_floor_nrms)
    );
    // The explorer shows it on a screen.
    figure(file, &drawing.title.clone(), caption, drawing.png()).on_screen(OnScreen::Elsewhere)
}

fn frf_table(findings: &StructureFindings, order: &[usize]) -> Block {
    let (before, after) = (&findings.analysis.before, &findings.analysis.after);
    let row = |&index: &usize| {
        let (b, a) = (before.frf_errors.get(index)?, after.frf_errors.get(index)?);
        let times = if a.noise_floor_nrms > 0.0 {
            a.nrms / a.noise_floor_nrms
        } else {
            f64::NAN
        };
        Some(vec![
            frf_name(&a.posture, &a.name),
            percent(b.nrms),
            percent(a.nrms),
            percent(a.noise_floor_nrms),
            significant(times, 2),
        ])
    };
    let mut notes = vec![
        "Error: root of the summed squared differences over the summed squared measurement (nrms)."
            .to_string(),
        "× noise: 1 where only noise is left.".to_string(),
    ];
    if order.len() > LISTED {
        notes.push(format!("The first {LISTED} of {}.", order.len()));
    }
    Block::Table(ReportTable {
        caption: "FRFs by error against noise, worst first".into(),
        columns: vec![
            TableColumn::text("FRF (response/force)"),
            TableColumn::number("robot file"),
            TableColumn::number("calibrated"),
            TableColumn::number("noise"),
            TableColumn::number("× noise"),
        ],
        rows: order.iter().take(LISTED).filter_map(row).collect(),
        notes,
    })
}

/// What was tuned.
pub fn parameter_section(findings: &StructureFindings) -> ReportSection {
    let calibration = &findings.analysis.calibration;
    // Of an effect the robot file says nothing: its parameters deviate from nothing.
    let of_robot = findings.analysis.case.model.baseline_parameter_count();
    let rows = calibration
        .parameters
        .iter()
        .take(of_robot)
        .map(|p| ParameterRow {
            name: parameter_of(&p.name),
            unit: unit(p.unit).to_string(),
            nominal: p.initial,
            before: None,
            after: Some(figure::DrawnEstimate {
                value: p.value,
                std_error: Some(p.std_error).filter(|s| s.is_finite()),
            }),
        });
    let drawing = ParameterFigure {
        title: "Calibrated parameters against the robot file, with standard errors".into(),
        before_label: "robot file".into(),
        after_label: "calibrated".into(),
        rows: rows.collect(),
    };
    let table = calibration.parameters.iter().enumerate().map(|(i, p)| {
        let (initial, change) = match i < of_robot {
            true => (
                crate::report::number::format_si(p.initial, unit(p.unit), 4),
                format!("{} %", decimals(100.0 * (p.value / p.initial - 1.0), 1)),
            ),
            false => ("–".into(), "–".into()),
        };
        vec![
            parameter_of(&p.name),
            initial,
            plus_minus(p.value, p.std_error, unit(p.unit)),
            change,
            if p.at_bound { "at the end of its range" } else { "" }.to_string(),
        ]
    });
    let fit = format!(
        "The fit {} after {} from {}. Weighted misfit per residual (reduced χ²): {}; 1 would be noise alone. Standard \
         errors include that misfit and what was assumed beforehand of each parameter, not what the model lacks.",
        if calibration.converged() {
            "converged"
        } else {
            "did NOT converge"
        },
        count(calibration.iterations, "iteration", "iterations"),
        match calibration.starts {
            1 => "one starting point".to_string(),
            n => format!(
                "{n} starting points ({} of them led here)",
                calibration.starts_agreeing
            ),
        },
        significant(calibration.reduced_chi2, 3),
    );
    ReportSection {
        id: "parameters".into(),
        title: "Parameters".into(),
        lead: "What calibration made of the robot file's values.".into(),
        blocks: vec![
            figure(
                "parameters",
                "Deviation of each parameter from the robot file, with standard error",
                "Deviation of each parameter from the robot file. The thin line at the end of a bar spans one standard \
                 error to either side; it may be too short to see.",
                drawing.png(),
            ),
            Block::Table(ReportTable {
                caption: "Parameters".into(),
                columns: vec![
                    TableColumn::text("parameter"),
                    TableColumn::number("robot file"),
                    TableColumn::number("calibrated ± standard error"),
                    TableColumn::number("change"),
                    TableColumn::text(""),
                ],
                rows: table.collect(),
                notes: vec![],
            }),
            paragraph(fit),
        ],
    }
}

/// A bare number bears no unit in print.
fn unit(unit: &str) -> &str {
    if unit == "1" { "" } else { unit }
}

/// Natural frequencies and static stiffness at the campaign's postures.
pub fn posture_section(postures: &[PostureFindings]) -> ReportSection {
    let mega = |v: f64| significant(v / 1e6, 4);
    let mut rows = Vec::new();
    for posture in postures {
        let states = [
            ("robot file", Some(&posture.nominal)),
            ("calibrated", posture.calibrated.as_ref()),
        ];
        for (state, report) in states.into_iter().filter_map(|(s, r)| Some((s, r?))) {
            let mut row = vec![posture.id.clone(), state.to_string()];
            row.extend(report.tcp_stiffness_n_per_m.map(mega));
            row.extend(report.flange_stiffness_n_per_m.map(mega));
            let frequencies: Vec<String> = report
                .natural_frequencies_hz
                .iter()
                .take(6)
                .map(|f| decimals(*f, 1))
                .collect();
            row.push(frequencies.join("  "));
            rows.push(row);
        }
    }
    let mut columns = vec![TableColumn::text("posture"), TableColumn::text("state")];
    let numbers = [
        "tool Kx",
        "tool Ky",
        "tool Kz",
        "flange Kx",
        "flange Ky",
        "flange Kz",
    ];
    columns.extend(numbers.map(TableColumn::number));
    columns.push(TableColumn::text("first natural frequencies (Hz)"));
    let ids: Vec<String> = postures.iter().map(|p| p.id.clone()).collect();
    let lead = match ids.len() {
        0..=8 => format!("What the model says of {}.", listed(&ids)),
        n => format!("What the model says of the {n} postures."),
    };
    ReportSection {
        id: "postures".into(),
        title: "The robot at the postures".into(),
        lead,
        blocks: vec![robot(postures), Block::Table(ReportTable {
            caption: "Static stiffness (MN/m) and natural frequencies".into(),
            columns,
            rows,
            notes: vec![
                "Stiffness in base axes, force and displacement at the same point and in the same direction; the \
                 other directions are free to move."
                    .into(),
            ],
        })],
    }
}

fn robot(postures: &[PostureFindings]) -> Block {
    let drawing = RobotFigure {
        title: "The robot as a stick figure".into(),
        postures: postures
            .iter()
            .map(|p| (p.id.clone(), p.chain_m.clone()))
            .collect(),
    };
    figure(
        "robot-postures",
        "The robot as a stick figure at each posture",
        "Base, joints, flange and tool centre point at each posture. On a screen the mouse turns the robot, and the list \
         chooses the posture.",
        drawing.png(),
    )
    .with_plot(drawing.plot())
}
