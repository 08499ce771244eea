use serde::Serialize;

use crate::Result;
use crate::campaign::Campaign;
use crate::commands::next_step::Guide;
use crate::commands::text::{Emphasis, error_bar, percent, table, warnings};
use crate::commands::{Outcome, SideArgs, side};
use crate::revision::{self, Evidence, RecordedParameter, Revision, RevisionLog, fingerprint};
use crate::text::shell_word;

pub fn run(args: SideArgs) -> Result<Outcome> {
    let campaign = Campaign::load(&args.campaign.dir)?;
    let domain = side(&campaign, args.domain);
    of(&campaign, domain)
}

/// The history of one side of a campaign.
pub fn of(campaign: &Campaign, side: revision::Side) -> Result<Outcome> {
    let log = RevisionLog::load(&campaign.dir)?;
    let revisions: Vec<&Revision> = log.revisions(side).collect();
    let undone: Vec<&Revision> = log.undone(side).collect();
    let dir = shell_word(&campaign.dir);
    let guide = Guide { campaign, side };
    let Some(current) = revisions.last() else {
        return Ok(Outcome::new(
            Document {
                domain: side,
                revisions: Vec::new(),
                noise_floor_nrms: None,
                undone: Vec::new(),
                warnings: &[],
            },
            "no effect was added to this campaign's model yet\n".into(),
            Some(guide.history(None, false)),
        ));
    };
    let fingerprint = fingerprint(campaign, side)?;
    let old: Vec<String> = revisions
        .iter()
        .filter(|r| r.data != fingerprint)
        .map(|r| r.revision.to_string())
        .collect();
    let notes = match old.is_empty() {
        true => Vec::new(),
        false => vec![format!(
            "made with other data than there is now: revision {}; those errors do not compare with new ones (undo with \
             `lobestone undo {dir}` and add again)",
            old.join(", ")
        )],
    };
    let document = Document {
        domain: side,
        revisions: revisions
            .iter()
            .map(|r| RevisionTold::of(r, &fingerprint))
            .collect(),
        noise_floor_nrms: Some(current.noise_floor_nrms),
        undone: undone.iter().map(|r| RevisionTold::of(r, &fingerprint)).collect(),
        warnings: &notes,
    };
    let mut text = describe(&revisions);
    if !undone.is_empty() {
        let titles: Vec<String> = undone.iter().map(|r| r.title()).collect();
        text += &format!("undone: {}\n", titles.join(", "));
    }
    text += &warnings(&notes);
    let next = guide.history(Some(current), current.data != fingerprint);
    Ok(Outcome::new(document, text, Some(next)))
}

/// What was added to one side of a campaign.
#[derive(Serialize)]
struct Document<'a> {
    domain: revision::Side,
    revisions: Vec<RevisionTold<'a>>,
    noise_floor_nrms: Option<f64>,
    undone: Vec<RevisionTold<'a>>,
    warnings: &'a [String],
}

/// One revision.
#[derive(Serialize)]
pub(crate) struct RevisionTold<'a> {
    revision: usize,
    effects: Vec<&'a str>,
    variants: Vec<Option<&'a str>>,
    nrms: f64,
    held_out_nrms: Option<f64>,
    noise_floor_nrms: f64,
    reduced_chi2: f64,
    progress: Option<bool>,
    parameters: &'a [RecordedParameter],
    when: &'a str,
    why: Option<&'a Evidence>,
    same_data: bool,
}

impl<'a> RevisionTold<'a> {
    /// `fingerprint`: of the data as they are now.
    pub fn of(revision: &'a Revision, fingerprint: &str) -> Self {
        RevisionTold {
            revision: revision.revision,
            effects: revision.labels(),
            variants: revision.effects.iter().map(|e| e.variant.as_deref()).collect(),
            nrms: revision.nrms,
            held_out_nrms: revision.held_out_nrms,
            noise_floor_nrms: revision.noise_floor_nrms,
            reduced_chi2: revision.reduced_chi2,
            progress: revision.progress,
            parameters: &revision.parameters,
            when: &revision.when,
            why: revision.why.as_ref(),
            same_data: revision.data == fingerprint,
        }
    }
}

fn describe(revisions: &[&Revision]) -> String {
    let largest = revisions.iter().map(|r| r.nrms).fold(0.0, f64::max);
    let rows: Vec<Vec<String>> = revisions
        .iter()
        .map(|r| {
            let mut bar = error_bar(r.nrms, r.noise_floor_nrms, largest);
            if r.progress == Some(false) {
                bar += &format!("  {}", Emphasis::Bad.on("not progress"));
            }
            let times = match r.noise_floor_nrms > 0.0 {
                true => format!("{:.2}", r.nrms / r.noise_floor_nrms),
                false => "–".into(),
            };
            vec![
                r.title(),
                percent(r.nrms),
                r.held_out_nrms.map_or("–".into(), percent),
                percent(r.noise_floor_nrms),
                times,
                bar,
            ]
        })
        .collect();
    let header = ["revision", "nrms", "held out", "noise", "× noise", ""];
    table(&header, &rows)
}
