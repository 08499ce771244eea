//! The error, revision by revision, and what was added.

use super::figure::{self, HistoryFigure};
use super::number::{percent, significant};
use super::parts::{figure, listed, paragraph};
use super::{Block, Column, Section, Table};
use crate::identify::{CuttingCase, StructureCase};
use crate::revision::Revision;

/// `None` where no effect was ever added.
pub fn section(case: &StructureCase) -> Option<Section> {
    let added = case.model.effects().iter().map(|added| {
        let effect = added.instance.effect;
        (added.instance.title(), effect.explanation(), effect.fingerprint())
    });
    of_revisions("history", &case.revisions, "postures", added)
}

/// The same of the cutting model.
pub fn cutting_section(case: &CuttingCase) -> Option<Section> {
    let added = case.model.effects().iter().map(|added| {
        let effect = added.instance.effect;
        (added.instance.label(), effect.explanation(), effect.fingerprint())
    });
    of_revisions("history-cutting", &case.revisions, "cuts", added)
}

/// `folds`: what is left out in turn; `added`: name, explanation and fingerprint of each effect in the model.
fn of_revisions(
    id: &str,
    revisions: &[Revision],
    folds: &str,
    added: impl Iterator<Item = (String, &'static str, &'static str)>,
) -> Option<Section> {
    let current = revisions.last()?;
    let drawing = HistoryFigure {
        title: "Error of the model, revision by revision".into(),
        revisions: revisions
            .iter()
            .map(|r| figure::Revision {
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
    blocks.extend(added.map(|(title, explanation, fingerprint)| {
        paragraph(format!("{title}: {explanation} How it shows: {fingerprint}"))
    }));
    Some(Section {
        id: id.into(),
        title: match folds {
            "cuts" => "The error of the force model, revision by revision".into(),
            _ => "The error, revision by revision".into(),
        },
        lead: format!(
            "Each revision adds one physical effect to the model and fits everything anew. An effect that is really there \
             lowers the error on {folds} that the fit has not seen."
        ),
        blocks,
    })
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
    Block::Table(Table {
        caption: "Revisions of the model".into(),
        columns: vec![
            Column::text("revision"),
            Column::number("error"),
            Column::number("held-out error"),
            Column::number("noise"),
            Column::number("× noise"),
            Column::text("progress"),
        ],
        rows: rows.collect(),
        notes: vec![
            "Errors as they were when the revision was made.".into(),
            "Progress: whether the held-out error fell by more than chance would let it.".into(),
        ],
    })
}
