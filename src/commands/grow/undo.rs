use serde::Serialize;

use crate::Result;
use crate::campaign::Campaign;
use crate::commands::grow::history::RevisionTold;
use crate::commands::next_step::Guide;
use crate::commands::text::percent;
use crate::commands::{Outcome, SideArgs, side};
use crate::revision::{self, RevisionLog, fingerprint};

pub fn run(args: SideArgs) -> Result<Outcome> {
    let campaign = Campaign::load(&args.campaign.dir)?;
    let domain = side(&campaign, args.domain);
    let log = RevisionLog::load(&campaign.dir)?;
    after(log, &campaign, domain)
}

/// Takes the last revision of `log` back, if the campaign's log still is that.
pub fn after(mut log: RevisionLog, campaign: &Campaign, side: revision::Side) -> Result<Outcome> {
    let undone = log.undo(side)?;
    let current = log.current(side);
    let labels = current.map(|r| r.labels()).unwrap_or_default();
    let document = Document {
        domain: side,
        undone: RevisionTold::of(&undone, &fingerprint(campaign, side)?),
        revision: current.map(|r| r.revision),
        effects: &labels,
    };
    let model = std::iter::once("baseline").chain(labels.iter().copied());
    let mut text = format!(
        "undone: revision {}\nmodel: {}\n",
        undone.title(),
        model.collect::<Vec<_>>().join(" + ")
    );
    if let Some(current) = current {
        text += &format!(
            "error (nrms) {} -> {}\n",
            percent(undone.nrms),
            percent(current.nrms)
        );
    }
    let guide = Guide { campaign, side };
    Ok(Outcome::new(document, text, Some(guide.undone())))
}

/// What `undo` took back, and what is left.
#[derive(Serialize)]
struct Document<'a> {
    domain: revision::Side,
    undone: RevisionTold<'a>,
    revision: Option<usize>,
    effects: &'a [&'a str],
}
