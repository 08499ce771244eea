//! Stability lobes.

use super::figure::{LobeCurve, LobeMarker, LobeOutcome, LobePanel, LobesFigure};
use super::number::{decimals, percent, significant};
use super::parts::{count, figure, paragraph};
use super::structure_section::NOISE_LIKE;
use super::{Block, Column, Section, Table};
use super::{hole_section, redundancy_section};
use crate::analysis::{LobeAnalysis, LobeCase, LobeFindings, StructureFindings};
use crate::campaign::{CutOutcome, LobeMethod, LobeSource, Process};
use crate::lobes::optimum::apart_deg;
use crate::lobes::outcome::{Outcomes, Verdict};

/// Curves in one figure.
const CURVES: usize = 6;
/// Frames in one figure, where every posture has its own.
const PANELS: usize = 3;
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
        let place = case.at_posture();
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
        Process::Drilling => analysis.drilling(),
        Process::Turning => "turning",
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
        Process::Turning => "depth of cut",
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
    if let Some(text) = tool_and_blocks(analysis) {
        blocks.push(paragraph(text));
    }
    if analysis.source == LobeSource::Model
        && let Some(warning) = structure.and_then(doubt)
    {
        blocks.push(Block::Warning(warning));
    }
    match &analysis.redundancy {
        Some(found) => blocks.extend(redundancy_section::blocks(analysis, found)),
        None => {
            blocks.extend(figures(analysis, "lobes", ""));
            blocks.extend(
                analysis
                    .what_effects_did()
                    .into_iter()
                    .map(|s| paragraph(format!("{s}."))),
            );
            blocks.push(limits(findings));
        }
    }
    blocks.extend(hole_section::blocks(analysis));
    blocks.extend(analysis.outcomes.iter().flat_map(outcomes));
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

/// The tool as a beam, and which blocks of a drill count; `None` where there is nothing to say.
fn tool_and_blocks(analysis: &LobeAnalysis) -> Option<String> {
    let mut said = Vec::new();
    if let Some(first) = analysis.tool.clamped_hz[0].first() {
        said.push(format!(
            "The tool is a beam of {} mm, coupled to the structure at the holder face; clamped there it would bend at {} Hz \
             first.",
            decimals(1e3 * analysis.tool.beam.length_m(), 1),
            decimals(*first, 0)
        ));
    }
    match &analysis.axial_torsional {
        None => {}
        Some(Ok(())) => said.push(
            "The limit is that of the lateral or of the axial-torsional block, whichever chatters first."
                .into(),
        ),
        Some(Err(reason)) => said.push(format!("The axial-torsional block is left out: {reason}.")),
    }
    if let Some(hole) = analysis.drilled {
        said.push(format!(
            "This hole has a width of cut of {} mm.",
            significant(hole.width_mm, 3)
        ));
    }
    (!said.is_empty()).then(|| said.join(" "))
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

/// Where curves come with a band or with their state before effects were added, every posture gets its own frame.
fn figures(analysis: &LobeAnalysis, file: &str, prefix: &str) -> Vec<Block> {
    let detailed = analysis
        .cases
        .iter()
        .any(|c| c.band.is_some() || c.before.is_some());
    let before = analysis.cases.iter().any(|c| c.before.is_some());
    let each = if detailed { PANELS } else { CURVES };
    let parts = analysis.cases.chunks(each).count();
    let chunks = analysis.cases.chunks(each).enumerate();
    chunks
        .map(|(part, cases)| {
            let panels = match detailed {
                true => cases.iter().map(|case| panel(analysis, std::slice::from_ref(case), detailed)).collect(),
                false => vec![panel(analysis, cases, detailed)],
            };
            let number = if parts > 1 { format!(", part {}", part + 1) } else { String::new() };
            let drawing = LobesFigure {
                title: format!("Stability lobes, {prefix}{}{number}", process(analysis)),
                panels,
                depth_cap_mm: None,
            };
            let name = if parts > 1 { format!("{file}-{}", part + 1) } else { file.to_string() };
            let mut caption = format!("Depth limit over spindle speed, {}; ", source(analysis));
            caption += match detailed {
                true => "one frame a posture. The dotted line is the least limit of that posture",
                false => "one curve a posture. The dotted line is the least limit of all postures",
            };
            if before {
                caption += &format!(
                    "; the grey dashes are the limit before {} {} added, with everything fitted anew",
                    analysis.effects.join(", "),
                    if analysis.effects.len() == 1 { "was" } else { "were" }
                );
            }
            if detailed && cases.iter().any(|c| c.band.is_some()) {
                caption += "; the shade holds 90 % of what the uncertainty of the model's parameters allows";
            }
            caption += "; diamonds mark the deepest tips.";
            if analysis.outcomes.as_ref().is_some_and(|o| !o.cuts.is_empty()) {
                caption += " Discs are cuts that were stable, crosses cuts that chattered; those that do not agree with \
                            the limit have their names.";
            }
            figure(name, &drawing.title.clone(), caption, drawing.png()).with_plot(drawing.plot())
        })
        .collect()
}

/// With the surface over the redundancy angle: the lobes of the posture as it stands, where test cuts were made, and those
/// of the step nearest to the recommended angle.
pub(super) fn as_it_stands_and_recommended(analysis: &LobeAnalysis, recommended_deg: f64) -> Option<Block> {
    let away = |case: &&LobeCase| apart_deg(case.angle_deg.unwrap_or(0.0), recommended_deg);
    let nearest = analysis.cases.iter().min_by(|a, b| away(a).total_cmp(&away(b)))?;
    let standing = analysis
        .cases
        .iter()
        .find(|c| c.angle_deg == Some(0.0) && c.angle_deg != nearest.angle_deg);
    let panels = standing
        .into_iter()
        .chain([nearest])
        .map(|case| panel(analysis, std::slice::from_ref(case), true));
    let drawing = LobesFigure {
        title: format!("Stability lobes at the recommended angle, {}", process(analysis)),
        panels: panels.collect(),
        depth_cap_mm: None,
    };
    let mut caption = "Depth limit over spindle speed at the step of the sweep nearest to the recommended angle, and with the \
                       robot as it stands (0°). The dotted line is the least limit there"
        .to_string();
    if nearest.before.is_some() {
        caption += &format!(
            "; the grey dashes are the limit before {} {} added, with everything fitted anew",
            analysis.effects.join(", "),
            if analysis.effects.len() == 1 {
                "was"
            } else {
                "were"
            }
        );
    }
    caption += "; diamonds mark the deepest tips. Discs are test cuts that were stable, crosses cuts that chattered.";
    let (title, png) = (drawing.title.clone(), drawing.png());
    Some(figure("lobes-recommended".to_string(), &title, caption, png))
}

fn panel(analysis: &LobeAnalysis, cases: &[LobeCase], detailed: bool) -> LobePanel {
    let name = |case: &LobeCase| {
        let posture = case.posture.clone().unwrap_or_else(|| "modes".into());
        case.angle_deg.map_or(posture.clone(), |a| {
            format!("{posture} turned by {}°", decimals(a, 1))
        })
    };
    let curves = cases.iter().map(|case| LobeCurve {
        label: if detailed { String::new() } else { name(case) },
        spindle_rpm: case.curve.spindle_rpm.clone(),
        depth_limit_mm: case.curve.depth_limit_mm.clone(),
        before_mm: case
            .before
            .as_ref()
            .map(|b| b.curve.depth_limit_mm.clone())
            .unwrap_or_default(),
        band_mm: case
            .band
            .as_ref()
            .map(|b| [b.lower_mm.clone(), b.upper_mm.clone()]),
    });
    let best = analysis.best();
    let tips = best
        .iter()
        .filter(|(case, _)| {
            cases
                .iter()
                .any(|c| c.posture == case.posture && c.angle_deg == case.angle_deg)
        })
        .filter_map(|(_, peak)| {
            Some(LobeMarker {
                spindle_rpm: peak.spindle_rpm,
                depth_mm: peak.depth_mm?,
                outcome: LobeOutcome::Tip,
                label: String::new(),
            })
        })
        .take(MARKED);
    let cuts = analysis.outcomes.iter().flat_map(|o| &o.cuts);
    let cuts = cuts
        .filter(|cut| {
            // Test cuts were made with the robot as it stands.
            let mut here = cases.iter().filter(|c| c.angle_deg.unwrap_or(0.0) == 0.0);
            here.any(|c| cut.posture.is_none() || c.posture.is_none() || c.posture == cut.posture)
        })
        .map(|cut| LobeMarker {
            spindle_rpm: cut.spindle_rpm,
            depth_mm: cut.depth_mm,
            outcome: match cut.outcome {
                CutOutcome::Stable => LobeOutcome::Stable,
                CutOutcome::Chatter => LobeOutcome::Chatter,
            },
            label: match cut.verdict {
                Verdict::Agree => String::new(),
                Verdict::Disagree | Verdict::WithinBand => format!("cut {}", cut.id),
            },
        });
    LobePanel {
        name: cases.first().map(name).unwrap_or_default(),
        markers: tips.chain(cuts).collect(),
        absolute_limit_mm: match (detailed, cases) {
            (true, [case]) => case.absolute.map(|a| a.depth_mm),
            _ => analysis.absolute().map(|a| a.depth_mm),
        },
        curves: curves.collect(),
    }
}

/// The cuts of which somebody noted how they went.
fn outcomes(outcomes: &Outcomes) -> Vec<Block> {
    let o = outcomes;
    let mut blocks = vec![paragraph(format!(
        "Test cuts: {} of {} lie below the limit, {} of {} above it. Against the 5 to 95 % band {}, {}, and of {} the model \
         cannot say.",
        o.stable_below_limit,
        count(
            o.stable_below_limit + o.stable_above_limit,
            "stable cut",
            "stable cuts"
        ),
        o.chatter_above_limit,
        count(
            o.chatter_above_limit + o.chatter_below_limit,
            "cut with chatter",
            "cuts with chatter"
        ),
        count(o.agree, "cut agrees", "cuts agree"),
        count(o.disagree, "disagrees", "disagree"),
        count(o.within_band, "cut", "cuts"),
    ))];
    let mm = |v: Option<f64>| v.map_or("no limit".into(), |v| significant(v, 3));
    let rows = o.cuts.iter().map(|cut| {
        let verdict = match cut.verdict {
            Verdict::Agree => "agrees",
            Verdict::Disagree => "DISAGREES",
            Verdict::WithinBand => "cannot say",
        };
        vec![
            cut.id.clone(),
            cut.posture.clone().unwrap_or_else(|| "–".into()),
            decimals(cut.spindle_rpm, 0),
            significant(cut.depth_mm, 3),
            cut.outcome.label().into(),
            mm(cut.limit_mm),
            format!("{} – {}", mm(cut.lower_mm), mm(cut.upper_mm)),
            verdict.into(),
        ]
    });
    let rows: Vec<Vec<String>> = rows.collect();
    if !rows.is_empty() {
        blocks.push(Block::Table(Table {
            caption: "Cuts with a noted outcome, beside the limit at their speed".into(),
            columns: vec![
                Column::text("cut"),
                Column::text("posture"),
                Column::number("speed (rpm)"),
                Column::number("depth (mm)"),
                Column::text("outcome"),
                Column::number("limit (mm)"),
                Column::number("5 to 95 % (mm)"),
                Column::text("lobes"),
            ],
            rows,
            notes: o
                .cuts
                .iter()
                .filter_map(|c| Some(format!("Cut {}: {}.", c.id, c.meaning.as_ref()?)))
                .collect(),
        }));
    }
    let left_out = o.not_compared.iter();
    blocks.extend(left_out.map(|c| paragraph(format!("Cut {} is not compared: {}.", c.id, c.reason))));
    blocks
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
