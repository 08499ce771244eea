//! The error, revision by revision, and what was added.

use num_complex::Complex64;

use crate::discrepancy::FrfComparison;
use crate::effects::Registry;
use crate::identify::FrfData;
use crate::report::figure::{self, FrfCurve, FrfFigure, HistoryFigure, NoiseLevel};
use crate::report::number::{percent, plus_minus, significant};
use crate::report::parts::{figure, paragraph};
use crate::report::sections::error_map_section::times_noise_map;
use crate::report::words::frf_name;
use crate::report::{Block, Fold, ReportSection, ReportTable, TableColumn, words};
use crate::revision::{Evidence, Revision};
use crate::text::listed;

/// Candidates of a diagnosis shown.
const LISTED: usize = 8;

/// The model at one revision against the FRFs.
#[derive(Clone, Copy)]
pub struct Stage<'a> {
    /// In the order of the data's FRFs, m/N.
    pub predicted: &'a [Vec<Complex64>],
    pub comparison: &'a FrfComparison,
}

/// What is told of an effect: explanation, fingerprint, how to check it in the lab.
type Told = [&'static str; 3];

/// `steps`: the FRFs, and the model before and after each revision from the first on, where that is known. `None` where no
/// effect was ever added.
pub fn section(revisions: &[Revision], steps: &[(&FrfData, [Stage; 2])]) -> Option<ReportSection> {
    of_revisions("history", revisions, "postures", steps, |id| {
        let effect = Registry::structure().effect(id)?;
        Some([
            effect.explanation(),
            effect.fingerprint(),
            effect.background().lab_check,
        ])
    })
}

/// The same of the cutting model.
pub fn cutting_section(revisions: &[Revision]) -> Option<ReportSection> {
    of_revisions("history-cutting", revisions, "cuts", &[], |id| {
        let effect = Registry::cutting().effect(id)?;
        Some([
            effect.explanation(),
            effect.fingerprint(),
            effect.background().lab_check,
        ])
    })
}

/// `folds`: what is left out in turn.
fn of_revisions(
    id: &str,
    revisions: &[Revision],
    folds: &str,
    steps: &[(&FrfData, [Stage; 2])],
    told: impl Fn(&str) -> Option<Told>,
) -> Option<ReportSection> {
    let current = revisions.last()?;
    let drawing = HistoryFigure {
        title: "Error of the model, revision by revision".into(),
        revisions: revisions
            .iter()
            .map(|r| figure::HistoryMark {
                label: r.title(),
                fit_nrms: r.nrms,
                held_out_nrms: r.held_out_nrms,
            })
            .collect(),
        noise_floor_nrms: Some(current.noise_floor_nrms),
    };
    let mut blocks = vec![
        figure(
            id,
            "Error of the model after each added effect, on fitted and on held-out data",
            format!(
                "Error (nrms) of the model after each added effect, on the data that was fitted and on {folds} left out of \
                 the fit. The noise floor is estimated from the measurement: a model that lacks nothing comes down to about \
                 there."
            ),
            drawing.png(),
        ),
        table(revisions),
    ];
    let suspicious: Vec<String> = revisions
        .iter()
        .filter(|r| r.progress == Some(false))
        .map(Revision::title)
        .collect();
    if !suspicious.is_empty() {
        blocks.push(Block::Warning(format!(
            "Not progress: {}. The error on {folds} left out of the fit did not fall by more than chance would let it.",
            listed(&suspicious)
        )));
    }
    for (i, pair) in revisions.windows(2).enumerate() {
        let known = pair[1].added().and_then(|added| {
            let id = added.effect.split('@').next()?;
            told(id)
        });
        blocks.push(step(id, [&pair[0], &pair[1]], folds, known, steps.get(i)));
    }
    Some(ReportSection {
        id: id.into(),
        title: match folds {
            "cuts" => "The error of the force model, revision by revision".into(),
            _ => "The error, revision by revision".into(),
        },
        lead: format!(
            "Each revision adds one physical effect to the model and fits everything anew. An effect that is really there \
             lowers the error on {folds} that the fit has not seen. Open a revision to see why it was made."
        ),
        blocks,
    })
}

/// Why a revision was made and what it did, behind one line.
fn step(
    section: &str,
    [before, after]: [&Revision; 2],
    folds: &str,
    told: Option<Told>,
    stages: Option<&(&FrfData, [Stage; 2])>,
) -> Block {
    let mut blocks = Vec::new();
    let mut check = None;
    if let Some([explanation, fingerprint, lab_check]) = told {
        blocks.push(paragraph(format!("{explanation} How it shows: {fingerprint}")));
        check = Some(paragraph(format!("Check in the laboratory: {lab_check}")));
    }
    if let (Some(was), Some(is)) = (before.held_out_nrms, after.held_out_nrms) {
        let chance = match after.progress {
            Some(true) => ", more than chance would let it",
            Some(false) => ": no more than chance would let it",
            None => "",
        };
        blocks.push(paragraph(format!(
            "Held-out test: on {folds} left out of the fit the error went from {} to {}{chance}.",
            percent(was),
            percent(is)
        )));
    }
    blocks.extend(sizes(after));
    match &after.why {
        Some(why) => blocks.extend(evidence(why)),
        None => blocks.push(paragraph(
            "What else could explain the data was not asked before (`lobestone diagnose`).",
        )),
    }
    if let Some((data, [was, is])) = stages {
        let number = after.revision;
        blocks.push(maps(&format!("{section}-{number}-map"), [was, is]));
        blocks.extend(worst_frf(&format!("{section}-{number}-frf"), data, [was, is]));
    }
    blocks.extend(check);
    Block::Fold(Fold {
        title: format!(
            "Revision {}: error {} → {}, noise {}",
            after.title(),
            percent(before.nrms),
            percent(after.nrms),
            percent(after.noise_floor_nrms)
        ),
        blocks,
        open: false,
    })
}

/// Parameters of the effect that a revision added.
fn sizes(revision: &Revision) -> Option<Block> {
    let label = &revision.added()?.effect;
    let own = revision.parameters.iter().filter(|p| {
        p.name
            .strip_prefix(label.as_str())
            .is_some_and(|rest| rest.starts_with('.'))
    });
    let pairs: Vec<(String, String)> = own
        .map(|p| {
            let value = plus_minus(p.value, p.std_error.unwrap_or(f64::NAN), &p.unit);
            (words::parameter(&p.name), value)
        })
        .collect();
    (!pairs.is_empty()).then_some(Block::KeyValues(pairs))
}

/// What the diagnosis before said.
fn evidence(why: &Evidence) -> Vec<Block> {
    let said = match (&why.effect, why.verdict.as_str()) {
        (Some(effect), _) => format!("{effect} is missing"),
        (None, "none") => "nothing is missing".into(),
        (None, _) => "something is missing that has no name here".into(),
    };
    let percent_of = |v: Option<f64>| v.map_or("–".into(), percent);
    let number = |v: Option<f64>| v.map_or("–".into(), |v| significant(v, 3));
    let row = |c: &crate::revision::RecordedCandidate| {
        let variant = c.variant.as_ref().map_or(String::new(), |v| format!(" ({v})"));
        vec![
            format!("{}{variant}", c.effect),
            percent_of(c.nrms),
            percent_of(c.held_out_nrms),
            number(c.delta_bic),
            number(c.reduced_chi2),
            c.remark.clone(),
        ]
    };
    let mut notes =
        vec!["ΔBIC: below zero the effect pays for its parameters. χ²/dof: 1 is noise alone.".to_string()];
    if why.candidates.len() > LISTED {
        notes.push(format!("The first {LISTED} of {}.", why.candidates.len()));
    }
    vec![
        paragraph(format!(
            "The diagnosis before ({}): {said}; {}.",
            why.when.replace('T', " ").replace('Z', " UTC"),
            words::confidence(why.confidence)
        )),
        Block::Table(ReportTable {
            caption: "Candidates then, best first".into(),
            columns: vec![
                TableColumn::text("effect"),
                TableColumn::number("error"),
                TableColumn::number("held-out error"),
                TableColumn::number("ΔBIC"),
                TableColumn::number("χ²/dof"),
                TableColumn::text(""),
            ],
            rows: why.candidates.iter().take(LISTED).map(row).collect(),
            notes,
        }),
    ]
}

fn maps(file: &str, [was, is]: [&Stage; 2]) -> Block {
    let drawing = times_noise_map(
        "Error in multiples of the noise, before and after the revision",
        &[("before", &was.comparison.map), ("after", &is.comparison.map)],
    );
    figure(
        file,
        "Error map before and after the revision",
        "Error in multiples of the noise by posture, direction and frequency band, before the revision (left) and after it \
         (right), on one colour scale. 1 is noise alone.",
        drawing.png(),
    )
    .with_plot(drawing.plot())
}

/// The FRF that stood out most before, before and after.
fn worst_frf(file: &str, data: &FrfData, [was, is]: [&Stage; 2]) -> Option<Block> {
    let index = was.comparison.worst_first().into_iter().next()?;
    let (block, frf) = data.frfs().nth(index)?;
    let errors = [
        was.comparison.frf_errors.get(index)?,
        is.comparison.frf_errors.get(index)?,
    ];
    let curve = |label: String, value: &[Complex64]| FrfCurve {
        label,
        frequency_hz: block.frequency_hz.clone(),
        value: value.to_vec(),
    };
    let name = frf_name(&errors[0].posture, &errors[0].name);
    let drawing = FrfFigure {
        title: format!("{name}: before and after the revision"),
        quantity: "Receptance".into(),
        unit: "m/N".into(),
        measured: Some(curve("measured".into(), &frf.receptance)),
        models: vec![
            curve(
                format!("before (error {})", percent(errors[0].nrms)),
                was.predicted.get(index)?,
            ),
            curve(
                format!("after (error {})", percent(errors[1].nrms)),
                is.predicted.get(index)?,
            ),
        ],
        noise: Some(NoiseLevel {
            label: "noise level".into(),
            frequency_hz: block.frequency_hz.clone(),
            magnitude: frf.noise_std.clone(),
        }),
    };
    let caption = format!(
        "The FRF that stood out most before the revision: {name}. Error {} → {}; its noise is {}.",
        percent(errors[0].nrms),
        percent(errors[1].nrms),
        percent(errors[1].noise_floor_nrms)
    );
    Some(figure(file, &drawing.title.clone(), caption, drawing.png()).with_plot(drawing.plot()))
}

fn table(revisions: &[Revision]) -> Block {
    let rows = revisions.iter().map(|r| {
        let times = match r.noise_floor_nrms > 0.0 {
            true => significant(r.nrms / r.noise_floor_nrms, 3),
            false => "–".into(),
        };
        let progress = match r.progress {
            Some(true) => "yes",
            Some(false) => "no",
            None => "–",
        };
        vec![
            r.title(),
            percent(r.nrms),
            r.held_out_nrms.map_or("–".into(), percent),
            percent(r.noise_floor_nrms),
            times,
            progress.into(),
        ]
    });
    Block::Table(ReportTable {
        caption: "Revisions of the model".into(),
        columns: vec![
            TableColumn::text("revision"),
            TableColumn::number("error"),
            TableColumn::number("held-out error"),
            TableColumn::number("noise"),
            TableColumn::number("× noise"),
            TableColumn::text("progress"),
        ],
        rows: rows.collect(),
        notes: vec![
            "Errors as they were when the revision was made.".into(),
            "Progress: whether the held-out error fell by more than chance would let it.".into(),
        ],
    })
}
