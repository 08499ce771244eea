//! Which physics the model lacks: verdict, candidates, and what the missing effect takes away.

use num_complex::Complex64;

use crate::analysis::DiagnosisFindings;
use crate::analysis::diagnosis::Leading;
use crate::campaign::Campaign;
use crate::discrepancy::comparison::explained::Part;
use crate::discrepancy::joint_trends::JointTrend;
use crate::discrepancy::{Diagnosis, DiagnosisVerdict, EffectCandidate, NextMeasurement};
use crate::effects::Structure;
use crate::identify::Modelled;
use crate::report::figure::{
    BarSeries, DrawnCurveFigure, FrfCurve, FrfFigure, NoiseLevel, SideBySide, TrendFigure,
};
use crate::report::number::{decimals, percent, plus_minus, significant};
use crate::report::parts::{figure, paragraph};
use crate::report::sections::error_map_section::times_noise_map;
use crate::report::words::{at_place, frf_name};
use crate::report::{Block, ReportSection, ReportTable, TableColumn, words};
use crate::text::{capitalised, chance, listed, shell_word};

pub const ID: &str = "missing-physics";
pub const TITLE: &str = "Which physics is missing";

/// Candidates shown.
const LISTED: usize = 8;
/// FRFs drawn.
const FRFS_DRAWN: usize = 3;

type StructureCandidate = EffectCandidate<Structure>;

/// The verdict in plain words.
pub fn summary(findings: &DiagnosisFindings) -> String {
    verdict_text(&findings.diagnosis, "FRFs")
}

/// The verdict in plain words; `data` says what was measured.
pub(crate) fn verdict_text<D: Modelled>(d: &Diagnosis<D>, data: &str) -> String {
    let sure = format!("confidence {:.0} %", 100.0 * d.confidence);
    let mut text = match (d.verdict, d.winner()) {
        (DiagnosisVerdict::Effect, Some(winner)) => {
            let title = winner.instance.title();
            let explanation = winner.instance.effect.explanation();
            format!("The model lacks {title} ({sure}). {explanation}")
        }
        (DiagnosisVerdict::None, _) => match d.baseline.rest.small_errors_in_words() {
            Some(why) => format!(
                "The model lacks nothing that is larger than the small errors of the setup ({sure}): {why}."
            ),
            None => {
                format!(
                    "The model lacks nothing that these {data} show: what is left looks like noise ({sure})."
                )
            }
        },
        _ if d.too_little_data.is_some() => {
            format!(
                "No verdict: {}.",
                d.too_little_data.as_deref().unwrap_or_default()
            )
        }
        _ => match d.apart_from_files() {
            Some(why) => format!("Unknown to the library ({sure}): {why}."),
            None => format!(
                "The model lacks something that no effect of the library explains ({sure}): what is left is real, but of a kind \
                 that this program does not know."
            ),
        },
    };
    for words in d
        .best_guess_in_words()
        .into_iter()
        .chain(d.unexplained_in_words())
        .chain(d.chosen_anew_in_words())
    {
        text += &format!(" {words}");
    }
    if let Some(besides) = d.besides_in_words() {
        text += &format!(" {besides}.");
    }
    text
}

/// The verdict and what it rests on.
pub fn section(campaign: &Campaign, findings: &DiagnosisFindings) -> ReportSection {
    let d = &findings.diagnosis;
    let mut blocks = vec![paragraph(summary(findings))];
    blocks.extend(how_it_shows(d));
    blocks.extend(what_the_data_draw(findings));
    blocks.extend(joint_by_joint(findings));
    if let (Some(leading), Some(candidate)) = (&findings.leading, findings.leader()) {
        let who = match d.verdict {
            DiagnosisVerdict::Unknown => format!("The best candidate, {},", candidate.instance.title()),
            _ => "It".into(),
        };
        blocks.push(paragraph(leading.explained.sentence(&who)));
    }
    blocks.extend(advice(campaign, d, "data", &findings.next_measurement));
    if !d.candidates.is_empty() {
        blocks.push(candidate_chart(
            d,
            findings.now.comparison.totals.noise_floor_nrms,
            "missing-candidates",
            "postures",
        ));
        blocks.push(candidate_table(d));
    }
    if let (Some(leading), Some(candidate)) = (&findings.leading, findings.leader()) {
        blocks.push(maps(findings, leading, candidate));
        blocks.push(parts_table(leading, candidate));
        for (rank, index) in findings
            .now
            .comparison
            .worst_first()
            .into_iter()
            .take(FRFS_DRAWN)
            .enumerate()
        {
            blocks.extend(frf(findings, leading, candidate, rank, index));
        }
    }
    blocks.extend(not_tried(d));
    ReportSection {
        id: ID.into(),
        title: TITLE.into(),
        lead: "Each effect of the library is added to the model in turn and fitted together with everything else. One that is \
               really missing brings the error down to the noise, also at postures that the fit has not seen."
            .into(),
        blocks,
    }
}

/// Where no effect of the library explains what is left, or the one that is missing leaves something.
fn what_the_data_draw(findings: &DiagnosisFindings) -> Option<Block> {
    let lead = findings.lead.as_ref()?;
    let place = lead.place.as_ref()?.places.first()?;
    let drawing = DrawnCurveFigure::of(place);
    let begin = lead.beside.as_ref().map_or_else(
        || "What".to_string(),
        |beside| format!("With {beside} in the model, what"),
    );
    let caption = format!(
        "{begin} a part of its own that acts {} would have to be, line by line, for the model to agree with the FRFs, and the simple \
         form that comes nearest. A spring is level in the real part, a damper rises in the imaginary part, a mass falls in the real \
         part, a resonator has a peak. It leaves {:.2} times the variance of the noise.",
        place.spot.words(),
        place.left
    );
    Some(figure("drawn-stiffness", &drawing.title.clone(), caption, drawing.png()).with_plot(drawing.plot()))
}

/// Joints drawn of those that follow something.
const JOINTS_DRAWN: usize = 3;

/// What the joints follow from posture to posture, the surest first.
fn joint_by_joint(findings: &DiagnosisFindings) -> Vec<Block> {
    let Some(joints) = findings.lead.as_ref().map(|lead| &lead.joints) else {
        return Vec::new();
    };
    let Some(first) = joints.trends.first() else {
        return Vec::new();
    };
    let followed = joints.followed();
    let mut told = "Stiffness and damping of the joints were fitted again to each posture by itself, each tied to its value for all \
                    postures, and held against the order of measurement, the hammer's level, the joint's angle and gravity's torque"
        .to_string();
    told += &match followed.is_empty() {
        true => format!(
            ": none is followed by more than chance ({} tests, the least {}).",
            first.tests,
            chance(first.p_value)
        ),
        false => format!(" ({} tests).", first.tests),
    };
    let drawn = followed.iter().take(JOINTS_DRAWN).enumerate();
    std::iter::once(paragraph(told))
        .chain(drawn.map(|(rank, trend)| joint_figure(rank, trend)))
        .collect()
}

fn joint_figure(rank: usize, trend: &JointTrend) -> Block {
    let against = trend.against.words();
    let drawing = TrendFigure {
        title: capitalised(&format!(
            "{} against {against}",
            words::parameter_of(&trend.parameter)
        )),
        x_label: match trend.x_unit {
            "" => "Place of the posture in the campaign".to_string(),
            unit => format!("{} ({unit})", capitalised(against.trim_start_matches("the "))),
        },
        y_label: "Change (%)".into(),
        of: ["fitted to one posture", "fitted to all"],
        points: trend
            .points
            .iter()
            .map(|p| [p.x, 100.0 * p.rest.exp_m1(), 100.0 * p.std * p.rest.exp()])
            .collect(),
    };
    let caption = format!("{}.", capitalised(&words::joint_trend(trend)));
    figure(
        format!("joint-by-joint-{}", rank + 1),
        &drawing.title.clone(),
        caption,
        drawing.png(),
    )
}

/// The fingerprint of the effect that is missing.
pub(crate) fn how_it_shows<D: Modelled>(d: &Diagnosis<D>) -> Option<Block> {
    let effect = d.winner()?.instance.effect;
    Some(paragraph(format!("How it shows: {}", effect.fingerprint())))
}

/// Rivals, what to measure next, and how to add what is missing; `data` says what was measured.
pub(crate) fn advice<D: Modelled>(
    campaign: &Campaign,
    d: &Diagnosis<D>,
    data: &str,
    next_measurement: &NextMeasurement,
) -> Vec<Block> {
    let mut blocks = Vec::new();
    if !d.indistinguishable.is_empty() {
        blocks.push(Block::Warning(format!(
            "These {data} cannot tell it from {}.",
            listed(&d.indistinguishable)
        )));
    }
    blocks.push(paragraph(format!("Next measurement: {next_measurement}.")));
    if let Some(winner) = d.winner() {
        blocks.push(paragraph(format!(
            "To add it to the model and fit everything anew: `lobestone add {} {}`.",
            shell_word(&campaign.dir),
            winner.label()
        )));
    }
    blocks
}

/// Effects that the data cannot show, with the reasons.
pub(crate) fn not_tried<D: Modelled>(d: &Diagnosis<D>) -> Option<Block> {
    let reasons = by_reason(&d.not_tried);
    (!reasons.is_empty()).then(|| paragraph(format!("Not tried: {}.", reasons.join("; "))))
}

/// `a at joint 1 and joint 2, b (why)`: what shares a reason, which sites of one effect often do, stands together.
fn by_reason(not_tried: &[(String, String)]) -> Vec<String> {
    let mut reasons: Groups<Grouped<String>> = Vec::new();
    for (label, why) in not_tried {
        let (effect, site) = match label.split_once('@') {
            Some((effect, site)) => (effect, Some(at_place(site))),
            None => (label.as_str(), None),
        };
        let of_reason = group(&mut reasons, why);
        group(of_reason, effect).extend(site);
    }
    let one = |(effect, sites): &Grouped<String>| match sites.is_empty() {
        true => at_place(effect),
        false => format!("{} at {}", at_place(effect), listed(sites)),
    };
    let said = reasons.iter().map(|(why, effects)| {
        let effects: Vec<String> = effects.iter().map(one).collect();
        format!("{} ({why})", effects.join(", "))
    });
    said.collect()
}

/// What stands under one name.
type Grouped<'k, T> = (&'k str, Vec<T>);
type Groups<'k, T> = Vec<Grouped<'k, T>>;

/// What stands under `key`, begun where there is nothing yet.
fn group<'a, 'k, T>(groups: &'a mut Groups<'k, T>, key: &'k str) -> &'a mut Vec<T> {
    let known = groups.iter().position(|(own, _)| *own == key);
    let at = known.unwrap_or_else(|| {
        groups.push((key, Vec::new()));
        groups.len() - 1
    });
    &mut groups[at].1
}

/// Error with each candidate; `folds`: what was left out in turn.
pub(crate) fn candidate_chart<D: Modelled>(
    d: &Diagnosis<D>,
    noise_floor_nrms: f64,
    file_name: &str,
    folds: &str,
) -> Block {
    let shown: Vec<&EffectCandidate<D>> = d.candidates.iter().take(LISTED).collect();
    let percents = |first: Option<f64>, rest: Vec<Option<f64>>| {
        let all = std::iter::once(first).chain(rest);
        all.map(|v| v.map(|v| 100.0 * v)).collect::<Vec<_>>()
    };
    let held_out = |h: &Option<crate::identify::study::HeldOut>| h.as_ref().map(|h| h.nrms());
    let drawing = SideBySide {
        title: "Error of the model with each effect added".into(),
        y_label: "Error nrms (%)".into(),
        groups: std::iter::once("model now".to_string())
            // Spaces, so that long names break into lines.
            .chain(shown.iter().map(|c| {
                let site = c.name.site.as_ref().map_or(String::new(), |s| format!(" {s}"));
                c.name.effect.replace('-', " ") + &site
            }))
            .collect(),
        series: vec![
            BarSeries {
                label: format!("fitted {folds}"),
                values: percents(
                    Some(d.baseline.residual.nrms),
                    shown.iter().map(|c| Some(c.nrms)).collect(),
                ),
            },
            BarSeries {
                label: format!("{folds} left out of the fit"),
                values: percents(
                    held_out(&d.baseline.held_out),
                    shown.iter().map(|c| held_out(&c.held_out)).collect(),
                ),
            },
        ],
        log: true,
        level: Some(("noise floor".into(), 100.0 * noise_floor_nrms)),
    };
    figure(
        file_name,
        "Error of the model now and with each candidate effect, against the noise floor",
        format!(
            "Error of the model as it is and with each candidate added, on {folds} that were fitted and on {folds} left out of \
             the fit. A missing effect is one that reaches the noise floor (dotted)."
        ),
        drawing.png(),
    )
}

pub(crate) fn candidate_table<D: Modelled>(d: &Diagnosis<D>) -> Block {
    let all = &d.candidates;
    let row = |c: &EffectCandidate<D>| {
        let parameters: Vec<String> = c
            .parameters
            .iter()
            .map(|p| {
                format!(
                    "{} {}",
                    words::parameter(&p.name),
                    plus_minus(p.value, p.std_error, p.unit)
                )
            })
            .collect();
        vec![
            c.instance.title(),
            percent(c.nrms),
            c.held_out.as_ref().map_or("–".into(), |h| percent(h.nrms())),
            significant(c.delta_bic, 3),
            if c.p_value < 1e-12 {
                "< 10⁻¹²".into()
            } else {
                significant(c.p_value, 2)
            },
            significant(c.reduced_chi2, 3),
            parameters.join(", "),
            c.remark().into(),
        ]
    };
    let mut notes = vec![
        "ΔBIC: below zero the effect pays for its parameters. p: chance of such an improvement where the effect is not there, \
         corrected for the number of candidates. χ²/dof: squared error over squared noise; 1 is noise alone."
            .into(),
    ];
    if all.len() > LISTED {
        notes.push(format!("The first {LISTED} of {}.", all.len()));
    }
    Block::Table(ReportTable {
        caption: "Candidates, best first".into(),
        columns: vec![
            TableColumn::text("effect"),
            TableColumn::number("error"),
            TableColumn::number("held-out error"),
            TableColumn::number("ΔBIC"),
            TableColumn::number("p"),
            TableColumn::number("χ²/dof"),
            TableColumn::text("parameters"),
            TableColumn::text(""),
        ],
        rows: all.iter().take(LISTED).map(row).collect(),
        notes,
    })
}

fn maps(findings: &DiagnosisFindings, leading: &Leading<Structure>, candidate: &StructureCandidate) -> Block {
    let with = format!("with {}", candidate.label());
    let drawing = times_noise_map(
        "Error in multiples of the noise, before and after",
        &[
            ("model now", &findings.now.comparison.map),
            (&with, &leading.view.comparison.map),
        ],
    );
    figure(
        "missing-map",
        "Error map before and after the effect is added",
        format!(
            "Error in multiples of the noise by posture, direction and frequency band: the model as it is (left) and with \
             {} (right), on one colour scale. 1 is noise alone.",
            candidate.instance.title()
        ),
        drawing.png(),
    )
    .with_plot(drawing.plot())
}

fn parts_table(leading: &Leading<Structure>, candidate: &StructureCandidate) -> Block {
    let explained = &leading.explained;
    let times = |v: Option<f64>| v.map_or("–".into(), |v| significant(v, 2));
    let row = |name: String, part: &Part| {
        vec![
            name,
            format!("{} → {}", percent(part.nrms_before), percent(part.nrms_after)),
            format!(
                "{} → {}",
                times(part.times_noise_before),
                times(part.times_noise_after)
            ),
            part.share
                .map_or("–".into(), |s| format!("{} %", decimals(100.0 * s, 1))),
            format!("{} %", decimals(100.0 * part.of_all, 1)),
        ]
    };
    let mut rows = vec![row("everything".into(), &explained.total)];
    for (kind, parts) in [
        ("posture", &explained.by_posture),
        ("direction", &explained.by_direction),
        ("node", &explained.by_point),
    ] {
        rows.extend(parts.iter().map(|p| row(format!("{kind} {}", p.name), &p.part)));
    }
    rows.extend(explained.by_band.iter().map(|b| {
        let name = format!("{}–{} Hz", significant(b.from_hz, 3), significant(b.to_hz, 3));
        row(name, &b.part)
    }));
    Block::Table(ReportTable {
        caption: format!("What {} takes away, and where", candidate.instance.title()),
        columns: vec![
            TableColumn::text("where"),
            TableColumn::number("error"),
            TableColumn::number("× noise"),
            TableColumn::number("taken away there"),
            TableColumn::number("of all it takes away"),
        ],
        rows,
        notes: vec![
            "Taken away there: share of the squared error above noise (each difference divided by its noise) that is gone; – \
             where there was only noise."
                .into(),
        ],
    })
}

fn frf(
    findings: &DiagnosisFindings,
    leading: &Leading<Structure>,
    candidate: &StructureCandidate,
    rank: usize,
    index: usize,
) -> Option<Block> {
    let (block, frf) = findings.case.data.frfs().nth(index)?;
    let (now, with) = (
        findings.now.comparison.frf_errors.get(index)?,
        leading.view.comparison.frf_errors.get(index)?,
    );
    let curve = |label: String, value: &[Complex64]| FrfCurve {
        label,
        frequency_hz: block.frequency_hz.clone(),
        value: value.to_vec(),
    };
    let name = frf_name(&now.posture, &now.name);
    let drawing = FrfFigure {
        title: format!("{name}: what {} changes", candidate.label()),
        quantity: "Receptance".into(),
        unit: "m/N".into(),
        measured: Some(curve("measured".into(), &frf.receptance)),
        models: vec![
            curve(
                format!("model now (error {})", percent(now.nrms)),
                findings.now.predicted.get(index)?,
            ),
            curve(
                format!("with {} (error {})", candidate.label(), percent(with.nrms)),
                leading.view.predicted.get(index)?,
            ),
        ],
        noise: Some(NoiseLevel {
            label: "noise level".into(),
            frequency_hz: block.frequency_hz.clone(),
            magnitude: frf.noise_std.clone(),
        }),
    };
    let place = [
        "The FRF with most error against its noise",
        "Second most",
        "Third most",
    ]
    .get(rank)
    .copied()
    .unwrap_or("Much error against noise");
    let caption = format!(
        "{place}: {name}. Error {} now, {} with {}; its noise is {}.",
        percent(now.nrms),
        percent(with.nrms),
        candidate.instance.title(),
        percent(now.noise_floor_nrms)
    );
    let file = format!("missing-frf-{}", rank + 1);
    Some(figure(file, &drawing.title.clone(), caption, drawing.png()).with_plot(drawing.plot()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_is_said_once() {
        let pair = |effect: &str, why: &str| (effect.to_string(), why.to_string());
        let tried = [
            pair("damping@joint-1", "one force level"),
            pair("payload", "no tool"),
            pair("damping@joint-2", "one force level"),
        ];
        assert_eq!(
            by_reason(&tried),
            [
                "damping at joint 1 and joint 2 (one force level)",
                "payload (no tool)"
            ]
        );
    }
}
