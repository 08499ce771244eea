//! Stability lobes.

use crate::analysis::stability::lobes::MAY_WHIRL;
use crate::analysis::{LobeAnalysis, LobeCase, LobeFindings, StructureFindings};
use crate::campaign::{LobeSource, Process};
use crate::lobes::outcome::{Outcomes, Verdict};
use crate::report::number::{decimals, percent, significant};
use crate::report::parts::paragraph;
use crate::report::sections::lobes_figure::{figures, process, source};
use crate::report::sections::structure_section::NOISE_LIKE;
use crate::report::sections::{hole_section, redundancy_section};
use crate::report::words::count;
use crate::report::{Block, Fold, ReportSection, ReportTable, TableColumn};

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

pub fn section(findings: &LobeFindings, structure: Option<&StructureFindings>) -> ReportSection {
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
    blocks.extend(hole_section::drill(analysis));
    blocks.extend(hole_section::blocks(analysis));
    blocks.extend(hole_section::feed_stiffness(analysis));
    blocks.extend(analysis.outcomes.iter().flat_map(outcomes));
    blocks.push(best(analysis));
    match &findings.measured {
        Some(Ok(measured)) => {
            blocks.push(paragraph(
                "The same cut on the FRFs as measured, with no model in between. Measured FRFs end at their last line \
                 and carry noise; where both curves agree, the lobes do not depend on the model.",
            ));
            blocks.extend(figures(measured, "lobes-measured", "measured FRFs: "));
        }
        Some(Err(error)) => blocks.push(paragraph(format!(
            "A check on the measured FRFs alone is not possible here. {error}"
        ))),
        None => {}
    }
    let (whirls, others): (Vec<&String>, Vec<&String>) =
        analysis.warnings.iter().partition(|w| w.starts_with(MAY_WHIRL));
    blocks.extend(others.into_iter().cloned().map(Block::Warning));
    if !whirls.is_empty() {
        blocks.push(Block::Warning(format!(
            "The drill may whirl and leave a hole that is not round, {}: take another speed (table below) or a pilot hole.",
            count(whirls.len(), "case", "cases")
        )));
        blocks.extend(whirling(&analysis.cases));
    }
    ReportSection {
        id: "lobes".into(),
        title: "Stability lobes".into(),
        lead: "Below a curve the cut is stable at that speed, above it chatter grows. Depths below the absolute limit \
               are stable at every speed."
            .into(),
        blocks,
    }
}

/// The speeds at which the drill may whirl, posture by posture, folded up.
fn whirling(cases: &[LobeCase]) -> Option<Block> {
    let mut rows = Vec::new();
    for case in cases {
        for w in case.whirling.iter().filter(|w| w.may_occur == Some(true)) {
            rows.push(vec![
                case.posture.clone().unwrap_or_default(),
                decimals(w.spindle_rpm, 0),
                decimals(w.mode_hz, 1),
                (w.lobes[0] + 1).to_string(),
                format!("{} or {}", w.lobes[0], w.lobes[1]),
            ]);
        }
    }
    let table = Block::Table(ReportTable {
        caption: "Speeds at which the drill may whirl".into(),
        columns: vec![
            TableColumn::text("posture"),
            TableColumn::number("speed (rpm)"),
            TableColumn::number("mode (Hz)"),
            TableColumn::number("times the turn"),
            TableColumn::text("lobes of the hole"),
        ],
        rows: rows.clone(),
        notes: vec!["At that speed and up to a tenth above it.".into()],
    });
    (!rows.is_empty()).then(|| {
        Block::Fold(Fold {
            title: format!(
                "Speeds at which the drill may whirl ({})",
                count(rows.len(), "speed", "speeds")
            ),
            open: false,
            blocks: vec![table],
        })
    })
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
        blocks.push(Block::Table(ReportTable {
            caption: "Cuts with a noted outcome, next to the limit at their speed".into(),
            columns: vec![
                TableColumn::text("cut"),
                TableColumn::text("posture"),
                TableColumn::number("speed (rpm)"),
                TableColumn::number("depth (mm)"),
                TableColumn::text("outcome"),
                TableColumn::number("limit (mm)"),
                TableColumn::number("5 to 95 % (mm)"),
                TableColumn::text("lobes"),
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
        TableColumn::text("posture"),
        TableColumn::number("absolute limit (mm)"),
        TableColumn::number("chatter (Hz)"),
    ];
    if measured.is_some() {
        columns.push(TableColumn::number("measured FRFs: limit (mm)"));
        columns.push(TableColumn::number("chatter (Hz)"));
    }
    Block::Table(ReportTable {
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
    Block::Table(ReportTable {
        caption: format!("Deepest tips between {from} and {to} rpm"),
        columns: vec![
            TableColumn::text("posture"),
            TableColumn::number("speed (rpm)"),
            TableColumn::number("limit (mm)"),
            TableColumn::number("5 % quantile (mm)"),
            TableColumn::number("× absolute limit"),
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
