use serde_json::{Value, json};

use crate::Result;
use crate::campaign::Campaign;
use crate::commands::next_step::Guide;
use crate::commands::text::{Emphasis, error_bar, percent, table, warnings};
use crate::commands::{Outcome, SideArgs, side};
use crate::revision::{self, Revision, RevisionLog, fingerprint};
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
            json!({ "domain": side, "revisions": [], "noise_floor_nrms": null, "undone": [], "warnings": [] }),
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
    let json = json!({
        "domain": side,
        "revisions": revisions.iter().map(|r| document(r, &fingerprint)).collect::<Vec<_>>(),
        "noise_floor_nrms": current.noise_floor_nrms,
        "undone": undone.iter().map(|r| document(r, &fingerprint)).collect::<Vec<_>>(),
        "warnings": notes,
    });
    let mut text = describe(&revisions);
    if !undone.is_empty() {
        let titles: Vec<String> = undone.iter().map(|r| r.title()).collect();
        text += &format!("undone: {}\n", titles.join(", "));
    }
    text += &warnings(&notes);
    let next = guide.history(Some(current), current.data != fingerprint);
    Ok(Outcome::new(json, text, Some(next)))
}

/// One revision for other programs.
pub fn document(revision: &Revision, fingerprint: &str) -> Value {
    json!({
        "revision": revision.revision,
        "effects": revision.labels(),
        "variants": revision.effects.iter().map(|e| &e.variant).collect::<Vec<_>>(),
        "nrms": revision.nrms,
        "held_out_nrms": revision.held_out_nrms,
        "noise_floor_nrms": revision.noise_floor_nrms,
        "reduced_chi2": revision.reduced_chi2,
        "progress": revision.progress,
        "parameters": revision.parameters,
        "when": revision.when,
        "why": revision.why,
        "same_data": revision.data == fingerprint,
    })
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
