//! Force model against the recorded waveforms, and which physics it lacks.

use crate::analysis::{CuttingFindings, CuttingView};
use crate::campaign::{Campaign, Process};
use crate::discrepancy::CutError;
use crate::identify::forces::cutting_waves::courses;
use crate::report::figure::{
    BarSeries, CellFormat, HeatMap, SideBySide, TrendFigure, WaveformFigure, WaveformPanel,
};
use crate::report::number::{percent, with_error};
use crate::report::parts::{figure, paragraph};
use crate::report::sections::diagnosis_section::{
    advice, candidate_chart, candidate_table, how_it_shows, not_tried, verdict_text,
};
use crate::report::sections::error_map_section::{LEAST_TOP, TIMES_NOISE};
use crate::report::words::{parameter_of, setting};
use crate::report::{Block, ReportSection, ReportTable, TableColumn};
use crate::text::listed;
use crate::text::{capitalised, chance};

pub const ID: &str = "missing-physics-cutting";
pub const TITLE: &str = "Which physics the force model lacks";

/// Cuts drawn.
const CUTS_DRAWN: usize = 3;
/// Orders of rotation shown.
const ORDERS: usize = 12;

/// The verdict in plain words.
pub fn summary(findings: &CuttingFindings) -> String {
    let text = verdict_text(&findings.diagnosis, "force records");
    let text = text.replacen("The model", "The force model", 1);
    let added = findings.case.effects();
    if added.is_empty() {
        return text;
    }
    format!(
        "The force model has what was added to it: {}. The coefficients of the average forces, and what is said about \
         them, are without it. {text}",
        listed(&added)
    )
}

pub fn sections(campaign: &Campaign, findings: &CuttingFindings) -> Vec<ReportSection> {
    vec![comparison(findings), missing(campaign, findings)]
}

/// What the leading candidate is called, and the model with it.
fn with(findings: &CuttingFindings) -> Option<(String, &CuttingView)> {
    let leading = findings.leading.as_ref()?;
    let (number, view) = (leading.candidate, &leading.view);
    let candidate = findings.diagnosis.candidates.get(number)?;
    Some((format!("with {}", candidate.label()), view))
}

fn comparison(findings: &CuttingFindings) -> ReportSection {
    let now = &findings.now.comparison;
    let held_out = &findings.diagnosis.baseline.held_out;
    let mut text = format!(
        "Error of the fitted force model over the steady cut, averaged over revolutions: {}; the noise of the records is {}.",
        percent(now.totals.nrms),
        percent(now.totals.noise_floor_nrms)
    );
    if let Some(held_out) = held_out {
        text += &format!(" On cuts left out of the fit it is {}.", percent(held_out.nrms()));
    }
    let mut blocks = vec![paragraph(text), parameters(findings)];
    blocks.push(misfit_map(findings));
    blocks.extend(orders(findings));
    blocks.extend(trend(findings));
    let mut worst: Vec<usize> = (0..now.cuts.len()).collect();
    worst.sort_by(|a, b| {
        now.cuts[*b]
            .chi2_per_value
            .total_cmp(&now.cuts[*a].chi2_per_value)
    });
    for (rank, cut) in worst.into_iter().take(CUTS_DRAWN).enumerate() {
        blocks.push(waveform(findings, rank, cut));
    }
    ReportSection {
        id: "waveforms".into(),
        title: "Force model against the records".into(),
        lead: "Beyond average forces: the force over a revolution of the tool (milling), over the hole (drilling) or over the cut (turning)."
            .into(),
        blocks,
    }
}

/// The force model as it stands, with what was added to it.
fn parameters(findings: &CuttingFindings) -> Block {
    let rows = findings
        .diagnosis
        .baseline
        .calibration
        .parameters
        .iter()
        .map(|p| {
            let unit = if p.unit == "1" { "" } else { p.unit };
            let note = if p.at_bound { "at the end of its range" } else { "" };
            vec![
                parameter_of(&p.name),
                with_error(p.value, p.std_error),
                unit.to_string(),
                note.to_string(),
            ]
        });
    Block::Table(ReportTable {
        caption: "Parameters of the force model, fitted to the waveforms, ± standard error".into(),
        columns: vec![
            TableColumn::text("parameter"),
            TableColumn::number("value"),
            TableColumn::text("unit"),
            TableColumn::text(""),
        ],
        rows: rows.collect(),
        notes: vec![],
    })
}

fn misfit_map(findings: &CuttingFindings) -> Block {
    let cuts = &findings.now.comparison.cuts;
    let mut columns: Vec<String> = Vec::new();
    for (axis, _) in cuts.iter().flat_map(|c| &c.times_noise) {
        if !columns.contains(axis) {
            columns.push(axis.clone());
        }
    }
    let value = |cut: &CutError, axis: &String| {
        let found = cut.times_noise.iter().find(|(name, _)| name == axis);
        found.and_then(|(_, times)| *times)
    };
    let all = cuts
        .iter()
        .flat_map(|c| c.times_noise.iter().filter_map(|(_, times)| *times));
    let top = all.fold(LEAST_TOP, f64::max);
    let drawing = HeatMap {
        title: "Force model: error in multiples of the noise".into(),
        row_label: "Cut".into(),
        column_label: "Axis".into(),
        rows: cuts.iter().map(|c| c.cut.clone()).collect(),
        values: cuts
            .iter()
            .map(|c| columns.iter().map(|axis| value(c, axis)).collect())
            .collect(),
        columns,
        value_label: TIMES_NOISE.into(),
        format: CellFormat::Significant(2),
        range: Some((1.0, top)),
        log: true,
        ..Default::default()
    };
    figure(
        "waveform-map",
        "Error of the force model by cut and axis, in multiples of the noise",
        "Error of the waveform by cut and axis in multiples of the noise; about 1 is noise alone.",
        drawing.png(),
    )
    .with_plot(drawing.plot())
}

/// Orders of rotation with most error, for milling.
fn orders(findings: &CuttingFindings) -> Option<Block> {
    let now = &findings.now.comparison.by_harmonic;
    let mut shown: Vec<usize> = (0..now.len()).collect();
    shown.sort_by(|a, b| now[*b].nrms.total_cmp(&now[*a].nrms));
    shown.truncate(ORDERS);
    shown.sort_unstable();
    if shown.is_empty() {
        return None;
    }
    let percents = |view: &CuttingView| {
        let of = |i: &usize| view.comparison.by_harmonic.get(*i).map(|h| 100.0 * h.nrms);
        shown.iter().map(of).collect()
    };
    let mut series = vec![BarSeries {
        label: "model now".into(),
        values: percents(&findings.now),
    }];
    if let Some((label, view)) = with(findings) {
        series.push(BarSeries {
            label,
            values: percents(view),
        });
    }
    series.push(BarSeries {
        label: "noise".into(),
        values: shown
            .iter()
            .map(|i| Some(100.0 * now[*i].noise_floor_nrms))
            .collect(),
    });
    let drawing = SideBySide {
        title: "Error of the force model by order of rotation".into(),
        y_label: "Share of the whole signal (%)".into(),
        groups: shown.iter().map(|i| now[*i].order.to_string()).collect(),
        series,
        log: true,
        ..Default::default()
    };
    Some(figure(
        "waveform-orders",
        "Error of the force model by order of rotation",
        "Error by order of the tool's rotation (0: the mean; the number of teeth and its multiples: tooth passing; the others: \
         teeth that do not cut alike), the orders with most error.",
        drawing.png(),
    ))
}

/// What the rest follows most surely, where it follows anything.
fn trend(findings: &CuttingFindings) -> Option<Block> {
    let first = findings.lead.as_ref()?.trends.first()?;
    let words = first.against.words();
    let (unit, factor) = match first.unit {
        "1" => ("%", 100.0),
        unit => (unit, 1.0),
    };
    let name = words.trim_start_matches("the ");
    let x_label = match first.x_unit {
        "" => capitalised(name),
        unit => format!("{} ({unit})", capitalised(name)),
    };
    let of = first.axis.map_or("Rest of the force".to_string(), |a| {
        format!("Rest of {}", a.label())
    });
    let drawing = TrendFigure {
        title: format!("What the force model leaves, against {words}"),
        x_label,
        y_label: format!("{of} ({unit})"),
        of: ["record less model", "no difference"],
        points: first
            .points
            .iter()
            .map(|p| [p.x, factor * p.rest, factor * p.std])
            .collect(),
    };
    let caption = match first.is_significant() {
        true => format!(
            "Of {} quantities tested the rest follows this one most surely ({} after {} tests): {}. Usually {}.",
            first.tests,
            chance(first.p_value),
            first.tests,
            first.course(),
            first.usual_cause
        ),
        false => format!(
            "Of {} quantities tested the rest follows none by more than chance; this one comes closest ({}).",
            first.tests,
            chance(first.p_value)
        ),
    };
    let alt = format!("Record less model against {words}");
    Some(figure("waveform-trend", alt.as_str(), &caption, drawing.png()))
}

fn waveform(findings: &CuttingFindings, rank: usize, cut: usize) -> Block {
    let data = &findings.case.data;
    let own = &data.cuts[cut];
    let candidate = with(findings);
    let now = courses(data, own, &findings.now.fits[cut]);
    let then = candidate
        .as_ref()
        .map(|(_, view)| courses(data, own, &view.fits[cut]));
    let panels = now
        .into_iter()
        .map(|course| {
            // The candidate's fit has a zero line and a phase of its own: only its difference from the record counts.
            let with = then.iter().flatten().find(|c| c.axis == course.axis).map(|c| {
                let rests = c.model.iter().zip(&c.measured).map(|(m, r)| m - r);
                rests.zip(&course.measured).map(|(rest, r)| r + rest).collect()
            });
            WaveformPanel {
                label: format!("{} ({})", course.axis.label(), course.axis.unit()),
                x: course.x,
                measured: course.measured,
                models: std::iter::once(course.model).chain(with).collect(),
            }
        })
        .collect();
    let error = |view: &CuttingView| percent(view.comparison.cuts[cut].nrms);
    let models: Vec<String> = std::iter::once(format!("model now (error {})", error(&findings.now)))
        .chain(
            candidate
                .iter()
                .map(|(name, view)| format!("{name} (error {})", error(view))),
        )
        .collect();
    let (x_label, over) = match data.process {
        Process::Milling => ("Rotation of the tool (°)", "the mean revolution"),
        Process::Drilling => ("Time (s)", "the hole"),
        Process::Turning => ("Time (s)", "the cut"),
    };
    let title = format!("Cut {}: force over {over}", own.id);
    let place = ["most", "second most", "third most"][rank.min(2)];
    let caption = format!(
        "The cut with {place} misfit for its noise: {}, {} rpm, feed {} mm; its noise is {}.",
        own.id,
        setting(own.spindle_rpm),
        setting(own.feed_mm),
        percent(findings.now.comparison.cuts[cut].noise_floor_nrms)
    );
    let drawing = WaveformFigure {
        title: title.clone(),
        x_label: x_label.into(),
        models,
        panels,
    };
    figure(format!("waveform-{}", rank + 1), &title, caption, drawing.png()).with_plot(drawing.plot())
}

fn missing(campaign: &Campaign, findings: &CuttingFindings) -> ReportSection {
    let d = &findings.diagnosis;
    let mut blocks = vec![paragraph(summary(findings))];
    blocks.extend(how_it_shows(d));
    blocks.extend(advice(campaign, d, "records", &findings.next_measurement));
    if !d.candidates.is_empty() {
        let floor = findings.now.comparison.totals.noise_floor_nrms;
        blocks.push(candidate_chart(d, floor, "missing-candidates-cutting", "cuts"));
        blocks.push(candidate_table(d));
    }
    blocks.extend(not_tried(d));
    ReportSection {
        id: ID.into(),
        title: TITLE.into(),
        lead: "Each effect of the library is added to the force model in turn and fitted together with the coefficients. One \
               that is really missing brings the error down to the noise, also on cuts that the fit has not seen."
            .into(),
        blocks,
    }
}
