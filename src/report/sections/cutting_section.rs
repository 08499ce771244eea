//! Cutting forces: records, averages, regression, coefficients.

use crate::analysis::forces::force_records::cutting_trials;
use crate::analysis::forces::regression_line::{FeedLine, feed_lines};
use crate::campaign::Campaign;
use crate::cutting::kienzle;
use crate::cutting::{CfcResult, Coefficient, CutAnalysis, ForceAxis, ForceGroup, KnownValue, speed_text};
use crate::report::figure::{
    ForceRecord, ForceTrace, HeatMap, RegressionFigure, RegressionMark, RegressionSeries,
};
use crate::report::interactive::Plot;
use crate::report::number::{decimals, percent, significant, with_error};
use crate::report::parts::figure;
use crate::report::words::{count, setting};
use crate::report::{Block, ReportSection, ReportTable, TableColumn};
use crate::text::listed;

pub fn summary(result: &CfcResult) -> String {
    let mut text = String::new();
    for pooled in &result.pooled {
        let coefficients: Vec<String> = pooled
            .coefficients
            .iter()
            .filter(|c| !c.edge)
            .map(|c| format!("{} {} {}", c.label, value_text(c), c.unit))
            .collect();
        text += &format!(
            "{} of {} gave {}. ",
            count(pooled.cuts.len(), "record", "records"),
            series_name(result, pooled),
            coefficients.join(", ")
        );
        text += &over_speeds(result, pooled).unwrap_or_default();
        if let Some(worst) = worst(pooled) {
            text += &format!(
                "The average force that the force model misses most is {} of cut {}, by {} of the largest {} average \
                 ({} times its own standard error). ",
                worst.axis.label(),
                worst.cut,
                percent(worst.share.abs()),
                worst.axis.label(),
                significant(worst.sigmas.abs(), 2),
            );
        }
    }
    text.trim_end().to_string()
}

/// How far the leading coefficient differs between cutting speeds.
fn over_speeds(result: &CfcResult, pooled: &ForceGroup) -> Option<String> {
    let label = pooled.coefficients.iter().find(|c| !c.edge)?.label;
    let of_speed = |g: &ForceGroup| Some((g.coefficient(label)?.value?, speed_text(g)));
    let groups = result.groups.iter().filter(|g| g.is_beside(pooled));
    let mut values: Vec<(f64, String)> = groups.filter_map(of_speed).collect();
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    match values.as_slice() {
        [least, .., largest] => Some(format!(
            "Speed by speed, {label} lies between {} (at {} m/min) and {} N/mm² (at {} m/min). ",
            significant(least.0, 4),
            least.1,
            significant(largest.0, 4),
            largest.1
        )),
        _ => None,
    }
}

/// Process, and the material where several were cut.
fn series_name(result: &CfcResult, pooled: &ForceGroup) -> String {
    let name = pooled.process.name();
    let several = result
        .pooled
        .iter()
        .filter(|g| g.process == pooled.process)
        .count()
        > 1;
    match (&pooled.material, several) {
        (Some(material), true) => format!("{name} of {material}"),
        _ => name.to_string(),
    }
}

/// The same as part of a file name.
fn slug(result: &CfcResult, pooled: &ForceGroup) -> String {
    let lower = series_name(result, pooled).to_lowercase();
    lower.replace(|c: char| !c.is_ascii_alphanumeric(), "-")
}

/// The misfit of one average.
struct Misfit {
    cut: String,
    axis: ForceAxis,
    /// Of the largest average of that axis.
    share: f64,
    /// In standard errors of the average.
    sigmas: f64,
}

fn misfits(group: &ForceGroup) -> Vec<Misfit> {
    let largest = |axis: ForceAxis| {
        let of_axis = group.points.iter().filter(|p| p.axis == axis);
        of_axis.map(|p| p.measured.abs()).fold(0.0, f64::max)
    };
    group
        .points
        .iter()
        .map(|p| Misfit {
            cut: p.cut.clone(),
            axis: p.axis,
            share: (p.measured - p.fitted) / largest(p.axis),
            sigmas: (p.measured - p.fitted) / p.std_error,
        })
        .filter(|m| m.share.is_finite() && m.sigmas.is_finite())
        .collect()
}

/// Standard errors from which on an average force that the model misses is no chance: about one of a million is that far off.
const NO_CHANCE_SIGMAS: f64 = 5.0;

/// Whether the coefficients leave more of the average forces than noise.
pub fn misses_more_than_noise(result: &CfcResult) -> bool {
    let mut all = result.pooled.iter().flat_map(misfits);
    all.any(|m| m.sigmas.abs() > NO_CHANCE_SIGMAS)
}

fn worst(group: &ForceGroup) -> Option<Misfit> {
    misfits(group)
        .into_iter()
        .max_by(|a, b| a.share.abs().total_cmp(&b.share.abs()))
}

pub fn sections(campaign: &Campaign, result: &CfcResult) -> Vec<ReportSection> {
    let mut sections = vec![records(result)];
    for pooled in &result.pooled {
        sections.push(regression(campaign, result, pooled));
    }
    sections
}

/// Records that a screen lets choose between; each takes some 50 kB of the page.
const CUTS_TO_CHOOSE: usize = 30;

/// The first record, and that of the cut which fits worst.
fn records(result: &CfcResult) -> ReportSection {
    let mut shown: Vec<(&CutAnalysis, &str)> = Vec::new();
    if let Some(first) = result.cuts.first() {
        shown.push((first, "The first cut"));
    }
    for pooled in &result.pooled {
        let id = worst(pooled).map(|w| w.cut);
        let cut = result.cuts.iter().find(|c| Some(&c.id) == id.as_ref());
        if let Some(cut) = cut.filter(|c| shown.iter().all(|(s, _)| s.id != c.id)) {
            shown.push((cut, "The cut whose averages the force model misses most"));
        }
    }
    let mut blocks: Vec<Block> = shown
        .into_iter()
        .map(|(cut, why)| record_figure(cut, why))
        .collect();
    // On a screen any cut takes the place of the first.
    let choices = result.cuts.iter().take(CUTS_TO_CHOOSE);
    let choices = choices.map(|cut| (cut.id.clone(), record_drawing(cut).plot()));
    if let Some(first) = blocks.first_mut() {
        *first = first.clone().with_plot(Plot::one_of("Cut", choices.collect()));
    }
    blocks.push(cut_table(result));
    ReportSection {
        id: "records".into(),
        title: "Force records".into(),
        lead: "What the dynamometer recorded, in its own axes. The drift line goes through the air before and after \
               the cut; forces are averaged over the steady window, over whole turns of the tool."
            .into(),
        blocks,
    }
}

fn record_drawing(cut: &CutAnalysis) -> ForceRecord {
    let channels = cut.channels.iter().map(|channel| {
        let trace = &channel.trace;
        // Two points a stretch: its least and its largest value.
        let stretch_s = match trace.time_s.as_slice() {
            [first, .., last] => (last - first) / (trace.time_s.len() - 1) as f64,
            _ => 0.0,
        };
        let middle_s = 0.5 * (cut.steady_s[0] + cut.steady_s[1]);
        ForceTrace {
            label: channel.axis.label().into(),
            unit: channel.axis.unit().into(),
            start_s: trace.time_s.first().map_or(0.0, |t| t - 0.25 * stretch_s),
            sample_interval_s: 0.5 * stretch_s,
            samples: trace
                .min
                .iter()
                .zip(&trace.max)
                .flat_map(|(a, b)| [*a, *b])
                .collect(),
            drift: cut.record_s.iter().map(|t| (*t, channel.drift.at(*t))).collect(),
            steady_level: Some(channel.mean.average.value + channel.drift.at(middle_s)),
        }
    });
    ForceRecord {
        title: format!("Cut {}: record, drift and steady window", cut.id),
        channels: channels.collect(),
        air_s: [cut.air_before_s, cut.air_after_s]
            .into_iter()
            .flatten()
            .map(|[a, b]| (a, b))
            .collect(),
        steady_s: Some((cut.steady_s[0], cut.steady_s[1])),
    }
}

fn record_figure(cut: &CutAnalysis, why: &str) -> Block {
    let drawing = record_drawing(cut);
    let caption = format!(
        "{why}: cut {}, {} rpm, feed {} mm. Steady window {}–{} s ({} turns, {}).",
        cut.id,
        setting(cut.spindle_rpm),
        setting(cut.feed_mm),
        decimals(cut.steady_s[0], 2),
        decimals(cut.steady_s[1], 2),
        decimals(cut.revolutions, 0),
        if cut.steady_given {
            "given in the campaign"
        } else {
            "found by the program"
        },
    );
    figure(
        format!("record-{}", cut.id),
        &drawing.title.clone(),
        caption,
        drawing.png(),
    )
    .with_plot(drawing.plot())
}

fn cut_table(result: &CfcResult) -> Block {
    let axes = || {
        ForceAxis::ALL.into_iter().filter(|a| {
            let used = |p: &ForceGroup| ForceAxis::of(p.process).contains(a);
            result.pooled.iter().any(used)
        })
    };
    let mut columns = vec![
        TableColumn::text("cut"),
        TableColumn::number("rpm"),
        TableColumn::number("feed mm"),
        TableColumn::number("turns"),
        TableColumn::text("air"),
    ];
    for axis in axes() {
        columns.push(TableColumn::number(format!("{} {}", axis.label(), axis.unit())));
        columns.push(TableColumn::number("off"));
    }
    let rows = result.cuts.iter().map(|cut| {
        let mut row = vec![
            cut.id.clone(),
            setting(cut.spindle_rpm),
            setting(cut.feed_mm),
            decimals(cut.revolutions, 0),
            match (cut.air_before_s, cut.air_after_s) {
                (Some(_), Some(_)) => "both ends",
                (Some(_), None) => "before",
                (None, Some(_)) => "after",
                (None, None) => "none",
            }
            .to_string(),
        ];
        for axis in axes() {
            let point = result
                .pooled
                .iter()
                .flat_map(|g| &g.points)
                .find(|p| p.cut == cut.id && p.axis == axis);
            row.push(cut.averages[axis.index()].map_or("–".into(), |a| with_error(a.value, a.std_error)));
            row.push(point.filter(|p| p.fitted != 0.0).map_or("–".into(), |p| {
                let off = 100.0 * (p.measured - p.fitted) / p.fitted.abs();
                format!("{} %", decimals(off, 1))
            }));
        }
        row
    });
    Block::Table(ReportTable {
        caption: "Average forces in tool axes ± standard error".into(),
        columns,
        rows: rows.collect(),
        notes: vec!["off: measured against the force model fitted to all cuts together.".into()],
    })
}

fn regression(campaign: &Campaign, result: &CfcResult, pooled: &ForceGroup) -> ReportSection {
    let mut blocks = Vec::new();
    let axes = ForceAxis::of(pooled.process);
    for unit in ["N", "N·m"] {
        let of_unit: Vec<ForceAxis> = axes.iter().copied().filter(|a| a.unit() == unit).collect();
        if !of_unit.is_empty() {
            blocks.push(line_figure(campaign, result, pooled, &of_unit, unit));
        }
    }
    blocks.push(coefficient_table(result, pooled));
    blocks.extend(kienzle_table(campaign, result, pooled));
    blocks.extend(misfit_map(result, pooled));
    ReportSection {
        id: format!("regression-{}", slug(result, pooled)),
        title: format!("Force coefficients, {}", series_name(result, pooled)),
        lead: "Average forces against feed: the slope is the cutting part, what is left at zero feed the edge part. R² \
               near 1 says that a line holds, not that it is the right line."
            .into(),
        blocks,
    }
}

fn line_figure(
    campaign: &Campaign,
    result: &CfcResult,
    pooled: &ForceGroup,
    axes: &[ForceAxis],
    unit: &str,
) -> Block {
    let mut series = Vec::new();
    for &axis in axes {
        let r2 = pooled.r2[axis.index()].map_or(String::new(), |r| format!(", R² = {}", decimals(r, 4)));
        let lines = feed_lines(campaign, pooled, axis);
        let several = lines.len() > 1;
        series.extend(lines.into_iter().map(|FeedLine { what, points, line }| {
            RegressionSeries {
                label: if several {
                    format!("{}, {what}", axis.label())
                } else {
                    format!("{}{r2}", axis.label())
                },
                points: points
                    .iter()
                    .map(|p| RegressionMark {
                        label: p.cut.clone(),
                        x: p.feed_mm,
                        y: p.measured,
                        std_error: Some(p.std_error),
                        excluded: false,
                    })
                    .collect(),
                line,
            }
        }));
    }
    let feed = format!("Feed per {} (mm)", pooled.process.feed_per());
    let quantity = if unit == "N" { "force" } else { "torque" };
    let drawing = RegressionFigure {
        title: format!(
            "Average {quantity} against feed, all cuts of {} together",
            series_name(result, pooled)
        ),
        x_label: feed,
        y_label: format!("Average {quantity} ({unit})"),
        series,
    };
    let r2: Vec<String> = axes
        .iter()
        .filter_map(|a| {
            Some(format!(
                "R² of {} {}",
                a.label(),
                decimals(pooled.r2[a.index()]?, 4)
            ))
        })
        .collect();
    let caption = format!(
        "Average {quantity} in tool axes against feed: signs are the cuts with their standard errors (most are smaller \
         than the sign), lines the fitted force model.{}",
        match r2.is_empty() {
            true => String::new(),
            false => format!(" {}.", listed(&r2)),
        }
    );
    figure(
        format!("regression-{}-{quantity}", slug(result, pooled)),
        &drawing.title.clone(),
        caption,
        drawing.png(),
    )
    .with_plot(drawing.plot())
}

fn coefficient_table(result: &CfcResult, pooled: &ForceGroup) -> Block {
    let mut columns = vec![
        TableColumn::text("cutting speed"),
        TableColumn::number("cuts / feeds"),
    ];
    columns.extend(
        pooled
            .coefficients
            .iter()
            .map(|c| TableColumn::number(format!("{} {}", c.label, c.unit))),
    );
    let axes = ForceAxis::of(pooled.process);
    columns.extend(
        axes.iter()
            .map(|a| TableColumn::number(format!("R² {}", a.label()))),
    );
    let groups = result.groups.iter().filter(|g| g.is_beside(pooled));
    let row = |group: &ForceGroup, name: String| {
        let mut row = vec![name, format!("{} / {}", group.cuts.len(), group.feeds)];
        row.extend(group.coefficients.iter().map(value_text));
        row.extend(
            axes.iter()
                .map(|a| group.r2[a.index()].map_or("–".into(), |r| decimals(r, 3))),
        );
        row
    };
    let mut rows: Vec<Vec<String>> = groups
        .filter(|g| g.cuts != pooled.cuts)
        .map(|g| row(g, format!("{} m/min", speed_text(g))))
        .collect();
    rows.push(row(pooled, "all together".into()));
    Block::Table(ReportTable {
        caption: "Coefficients ± standard error".into(),
        columns,
        rows,
        notes: vec![
            "K.c: cutting coefficients (their force grows with the chip); K.e: edge coefficients (rubbing, the same at \
             any feed). Tangential t, radial r, axial a; drilling: f along the feed; turning: r normal to the edge, a along it."
                .into(),
        ],
    })
}

fn kienzle_table(campaign: &Campaign, result: &CfcResult, pooled: &ForceGroup) -> Option<Block> {
    let law = kienzle(
        &cutting_trials(campaign).ok()?,
        result,
        std::slice::from_ref(pooled),
    )
    .pop()??;
    let text = |known: Option<KnownValue>| {
        known
            .and_then(|k| Some(with_error(k.value, k.std_error?)))
            .unwrap_or_else(|| "not determined".into())
    };
    let rows = law.components.iter();
    let rows = rows.map(|c| vec![c.name.to_string(), text(c.k1_1), text(c.m)]);
    Some(Block::Table(ReportTable {
        caption: "Kienzle's law of the same averages, all together: force = k1.1 · width · thickness^(1−m), ± standard error".into(),
        columns: vec![
            TableColumn::text("force"),
            TableColumn::number("k1.1 N/mm²"),
            TableColumn::number("m"),
        ],
        rows: rows.collect(),
        notes: vec![format!("Which law: {}.", law.reading())],
    }))
}

fn misfit_map(result: &CfcResult, pooled: &ForceGroup) -> Option<Block> {
    let misfits = misfits(pooled);
    if pooled.cuts.len() < 2 {
        return None;
    }
    let axes = ForceAxis::of(pooled.process);
    let table = |of: fn(&Misfit) -> f64| -> Vec<Vec<Option<f64>>> {
        let cell = |cut: &String, axis: &ForceAxis| {
            let found = misfits.iter().find(|m| m.cut == *cut && m.axis == *axis);
            found.map(|m| of(m).abs())
        };
        let row = |cut| axes.iter().map(|axis| cell(cut, axis)).collect();
        pooled.cuts.iter().map(row).collect()
    };
    let shades = table(|m| m.sigmas);
    let top = shades.iter().flatten().flatten().copied().fold(10.0, f64::max);
    let drawing = HeatMap {
        title: "Misfit of each cut's average force".into(),
        row_label: "Cut".into(),
        column_label: "Axis".into(),
        rows: pooled.cuts.clone(),
        columns: axes.iter().map(|a| a.label().to_string()).collect(),
        values: table(|m| m.share),
        shades,
        value_label: "misfit / its standard error".into(),
        range: Some((1.0, top)),
        log: true,
        ..Default::default()
    };
    Some(
        figure(
            format!("misfit-{}", slug(result, pooled)),
            "Misfit of each cut's average force",
            "How far each cut's average lies from the fitted force model, as a share of the largest average of that axis. \
             Colours are multiples of the average's own standard error: what is light (up to about 2) is noise.",
            drawing.png(),
        )
        .with_plot(drawing.plot()),
    )
}

fn value_text(coefficient: &Coefficient) -> String {
    match (coefficient.value, coefficient.std_error) {
        _ if coefficient.constraint_active => "0 (held)".into(),
        (Some(value), Some(error)) => with_error(value, error),
        (Some(value), None) => significant(value, 4),
        (None, _) => "not determined".into(),
    }
}
