//! Stability lobes.

use super::figure::{LobeCurve, LobeMarker, LobeOutcome, LobesFigure};
use super::number::{decimals, percent, significant};
use super::parts::{figure, paragraph};
use super::redundancy_section;
use super::structure_section::NOISE_LIKE;
use super::{Block, Column, Section, Table};
use crate::analysis::{LobeAnalysis, LobeFindings, StructureFindings};
use crate::campaign::{LobeMethod, LobeSource, Process};

/// Curves in one figure.
const CURVES: usize = 6;
/// Tips marked in the figure.
const MARKED: usize = 3;

pub fn summary(findings: &LobeFindings) -> String {
    let analysis = &findings.asked;
    let mut text = match analysis.absolute() {
        Some(limit) => format!(
            "Stability lobes ({}, {}): below {} mm no spindle speed chatters; at that depth it would begin at {} Hz.",
            process(analysis),
            source(analysis),
            significant(limit.depth_mm, 3),
            decimals(limit.chatter_hz, 2),
        ),
        None => format!(
            "Stability lobes ({}, {}): no depth is limited.",
            process(analysis),
            source(analysis)
        ),
    };
    if let Some((case, peak)) = analysis.best().first() {
        let place = case
            .posture
            .as_ref()
            .map(|p| format!(" at {p}"))
            .unwrap_or_default();
        let depth = peak.depth_mm.map_or("without limit".to_string(), |d| {
            format!("with a limit of {} mm", significant(d, 3))
        });
        text += &format!(
            " The deepest place between {} and {} rpm is at {} rpm{place}, {depth}{}.",
            analysis.spindle_rpm[0],
            analysis.spindle_rpm[1],
            decimals(peak.spindle_rpm, 0),
            if peak.at_range_end {
                " (the end of the range; it may be deeper beyond)"
            } else {
                ""
            }
        );
    }
    text
}

fn process(analysis: &LobeAnalysis) -> &'static str {
    match analysis.process {
        Process::Milling => match analysis.method {
            LobeMethod::MultiFrequency => "milling, multi-frequency",
            LobeMethod::SemiDiscretisation => "milling, semi-discretisation",
            LobeMethod::ZeroOrder | LobeMethod::FrequencyDomain => "milling, zero-order",
        },
        Process::Drilling => "drilling, lateral",
    }
}

fn source(analysis: &LobeAnalysis) -> &'static str {
    match analysis.source {
        LobeSource::Model => "from the model",
        LobeSource::Measured => "from the measured FRFs",
        LobeSource::Modes => "from the modes of the campaign file",
    }
}

pub fn section(findings: &LobeFindings, structure: Option<&StructureFindings>) -> Section {
    let analysis = &findings.asked;
    let depth = match analysis.process {
        Process::Milling => "axial depth of cut",
        Process::Drilling => "radial width of cut, (diameter − pilot diameter)/2",
    };
    let mut blocks = vec![Block::KeyValues(vec![
        ("Depth is".into(), depth.into()),
        (
            "Cutting coefficients".into(),
            format!(
                "Ktc {} and Krc {} N/mm²",
                significant(analysis.coefficients.ktc_n_per_mm2, 4),
                significant(analysis.coefficients.krc_n_per_mm2, 4)
            ),
        ),
        ("Teeth".into(), analysis.teeth.to_string()),
        ("Structure".into(), source(analysis).into()),
    ])];
    if analysis.source == LobeSource::Model
        && let Some(warning) = structure.and_then(doubt)
    {
        blocks.push(Block::Warning(warning));
    }
    match &analysis.redundancy {
        Some(found) => blocks.extend(redundancy_section::blocks(analysis, found)),
        None => {
            blocks.extend(figures(analysis, "lobes", ""));
            blocks.push(limits(findings));
        }
    }
    blocks.push(best(analysis));
    match &findings.measured {
        Some(Ok(measured)) => {
            blocks.push(paragraph(
                "The same cut on the FRFs as measured, with no model in between. Measured FRFs end at their last line \
                 and carry noise; where both curves agree, the lobes do not hang on the model.",
            ));
            blocks.extend(figures(measured, "lobes-measured", "measured FRFs: "));
        }
        Some(Err(error)) => blocks.push(paragraph(format!(
            "A check on the measured FRFs alone is not possible here. {error}"
        ))),
        None => {}
    }
    blocks.extend(analysis.warnings.iter().cloned().map(Block::Warning));
    Section {
        id: "lobes".into(),
        title: "Stability lobes".into(),
        lead: "Below a curve the cut is stable at that speed, above it chatter grows. Depths below the absolute limit \
               are stable at every speed."
            .into(),
        blocks,
    }
}

/// Lobes of a model that leaves more than noise deserve a word.
fn doubt(structure: &StructureFindings) -> Option<String> {
    let totals = &structure.analysis.after.totals;
    (totals.nrms > NOISE_LIKE * totals.noise_floor_nrms).then(|| {
        format!(
            "These lobes rest on a model that misses {} of the measured FRFs (noise {}). Lobes depend on exactly those \
             FRFs.",
            percent(totals.nrms),
            percent(totals.noise_floor_nrms)
        )
    })
}

fn figures(analysis: &LobeAnalysis, file: &str, prefix: &str) -> Vec<Block> {
    let best = analysis.best();
    let parts = analysis.cases.chunks(CURVES).count();
    let chunks = analysis.cases.chunks(CURVES).enumerate();
    chunks
        .map(|(part, cases)| {
            let curves = cases.iter().map(|case| LobeCurve {
                label: case.posture.clone().unwrap_or_else(|| "modes".into()),
                spindle_rpm: case.curve.spindle_rpm.clone(),
                depth_limit_mm: case.curve.depth_limit_mm.clone(),
            });
            let markers = best
                .iter()
                .filter(|(case, _)| cases.iter().any(|c| c.posture == case.posture))
                .filter_map(|(_, peak)| {
                    Some(LobeMarker {
                        spindle_rpm: peak.spindle_rpm,
                        depth_mm: peak.depth_mm?,
                        outcome: LobeOutcome::Tip,
                    })
                })
                .take(MARKED);
            let number = if parts > 1 { format!(", part {}", part + 1) } else { String::new() };
            let drawing = LobesFigure {
                title: format!("Stability lobes, {prefix}{}{number}", process(analysis)),
                curves: curves.collect(),
                absolute_limit_mm: analysis.absolute().map(|a| a.depth_mm),
                markers: markers.collect(),
                depth_cap_mm: None,
            };
            let name = if parts > 1 { format!("{file}-{}", part + 1) } else { file.to_string() };
            let caption = format!(
                "Depth limit over spindle speed, {}; one curve a posture. The dotted line is the least limit of all \
                 postures; diamonds mark the deepest tips.",
                source(analysis)
            );
            figure(name, &drawing.title.clone(), caption, drawing.png())
        })
        .collect()
}

fn limits(findings: &LobeFindings) -> Block {
    let measured = findings.measured.as_ref().and_then(|m| m.as_ref().ok());
    let of = |limit: Option<crate::lobes::AbsoluteLimit>| match limit {
        Some(l) => [significant(l.depth_mm, 3), decimals(l.chatter_hz, 2)],
        None => ["no limit".into(), "–".into()],
    };
    let rows = findings.asked.cases.iter().map(|case| {
        let mut row = vec![case.posture.clone().unwrap_or_else(|| "modes".into())];
        row.extend(of(case.absolute));
        if let Some(measured) = measured {
            match measured.cases.iter().find(|c| c.posture == case.posture) {
                Some(case) => row.extend(of(case.absolute)),
                None => row.extend(["–".to_string(), "–".to_string()]),
            }
        }
        row
    });
    let mut columns = vec![
        Column::text("posture"),
        Column::number("absolute limit (mm)"),
        Column::number("chatter (Hz)"),
    ];
    if measured.is_some() {
        columns.push(Column::number("measured FRFs: limit (mm)"));
        columns.push(Column::number("chatter (Hz)"));
    }
    Block::Table(Table {
        caption: "Depth below which no speed chatters".into(),
        columns,
        rows: rows.collect(),
        notes: vec![],
    })
}

fn best(analysis: &LobeAnalysis) -> Block {
    let absolute = analysis.absolute();
    let rows = analysis.best().into_iter().map(|(case, peak)| {
        let gain = peak.depth_mm.zip(absolute).map(|(d, a)| d / a.depth_mm);
        vec![
            case.posture.clone().unwrap_or_else(|| "modes".into()),
            decimals(peak.spindle_rpm, 1),
            peak.depth_mm.map_or("no limit".into(), |d| significant(d, 3)),
            peak.lower_quantile_mm.map_or("–".into(), |d| significant(d, 3)),
            gain.map_or("–".into(), |g| decimals(g, 1)),
        ]
    });
    let rows: Vec<Vec<String>> = rows.collect();
    let [from, to, _] = analysis.spindle_rpm;
    Block::Table(Table {
        caption: format!("Deepest tips between {from} and {to} rpm"),
        columns: vec![
            Column::text("posture"),
            Column::number("speed (rpm)"),
            Column::number("limit (mm)"),
            Column::number("5 % quantile (mm)"),
            Column::number("× absolute limit"),
        ],
        rows,
        notes: vec![
            "An end of the range is listed where it is deeper than every tip: the curve may rise further beyond it.".into(),
            "Many tips are narrow: with a speed or a frequency a few per cent off the limit may be far lower. Stay well \
             below it and try the speed."
                .into(),
        ],
    })
}
