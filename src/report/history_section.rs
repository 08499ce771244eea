//! The error, revision by revision, and what was added.

use super::figure::{self, HistoryFigure};
use super::number::{percent, significant};
use super::parts::{figure, listed, paragraph};
use super::{Block, Column, Section, Table};
use crate::identify::StructureCase;
use crate::revision::Revision;

/// `None` where no effect was ever added.
pub fn section(case: &StructureCase) -> Option<Section> {
    let revisions = &case.revisions;
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
            "history",
            "Error of the model after each added effect, on fitted and on held-out data",
            "Error (nrms) of the model after each added effect, on the data that was fitted and on postures left out of \
             the fit. No model can get below the noise floor.",
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
            "Not progress: {}. The error on postures left out of the fit did not fall by more than chance would let it.",
            listed(&suspicious)
        )));
    }
    for added in case.model.effects() {
        let effect = added.instance.effect;
        blocks.push(paragraph(format!(
            "{}: {} How it shows: {}",
            added.instance.title(),
            effect.explanation(),
            effect.fingerprint()
        )));
    }
    Some(Section {
        id: "history".into(),
        title: "The error, revision by revision".into(),
        lead: "Each revision adds one physical effect to the model and fits everything anew. An effect that is really there \
               lowers the error on postures that the fit has not seen."
            .into(),
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
