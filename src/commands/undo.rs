use serde_json::json;

use super::history::document;
use super::text::percent;
use super::{CampaignArg, Domain, Outcome, structure_only};
use crate::Result;
use crate::campaign::Campaign;
use crate::revision::{self, RevisionLog, structure_fingerprint};

#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    campaign: CampaignArg,
    /// Side of the campaign to look at.
    #[arg(long, value_enum)]
    domain: Option<Domain>,
}

pub fn run(args: Args) -> Result<Outcome> {
    structure_only(args.domain)?;
    let campaign = Campaign::load(&args.campaign.dir)?;
    let mut log = RevisionLog::load(&campaign.dir)?;
    let undone = log.undo(revision::Domain::Structure)?;
    let current = log.current(revision::Domain::Structure);
    let labels = current.map(|r| r.labels()).unwrap_or_default();
    let json = json!({
        "domain": "structure",
        "undone": document(&undone, &structure_fingerprint(&campaign)?),
        "revision": current.map(|r| r.revision),
        "effects": labels,
    });
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
    Ok(Outcome { json, text })
}
