//! The campaign folder that a command works on, and which side of it.

use std::path::PathBuf;

use clap::ValueEnum;

use super::outcome::Outcome;
use crate::Result;
use crate::campaign::Campaign;

/// Which side of a campaign a command looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SideChoice {
    Structure,
    Cutting,
}

/// A command on the side of the campaign that was asked for; without that on what the campaign holds, both sides as two
/// documents under `structure` and `cutting`.
pub(crate) fn by_domain(
    campaign: &Campaign,
    domain: Option<SideChoice>,
    structure: impl Fn(&Campaign) -> Result<Outcome>,
    cutting: impl Fn(&Campaign) -> Result<Outcome>,
) -> Result<Outcome> {
    match domain {
        Some(SideChoice::Structure) => structure(campaign),
        Some(SideChoice::Cutting) => cutting(campaign),
        None if campaign.cuts.is_empty() => structure(campaign),
        None if campaign.frfs.is_empty() => cutting(campaign),
        None => {
            let (structure, cutting) = (structure(campaign)?, cutting(campaign)?);
            let next_step = &structure.json["next_step"];
            Ok(Outcome {
                json: serde_json::json!({
                    "next_step": next_step,
                    "structure": structure.json,
                    "cutting": cutting.json,
                }),
                text: format!("{}\n{}", structure.text, cutting.text),
                failed: None,
            })
        }
    }
}

/// The side whose revisions are meant: the one asked for, else that which the campaign holds (both: the structure).
pub(crate) fn side(campaign: &Campaign, domain: Option<SideChoice>) -> crate::revision::Side {
    match domain {
        Some(SideChoice::Cutting) => crate::revision::Side::Cutting,
        None if campaign.frfs.is_empty() && !campaign.cuts.is_empty() => crate::revision::Side::Cutting,
        _ => crate::revision::Side::Structure,
    }
}

/// A campaign folder.
#[derive(clap::Args)]
pub(crate) struct CampaignArg {
    /// The campaign folder (with campaign.toml in it).
    pub(crate) dir: PathBuf,
}

/// A campaign folder, and which side of it.
#[derive(clap::Args)]
pub(crate) struct SideArgs {
    #[command(flatten)]
    pub(crate) campaign: CampaignArg,
    /// Side of the campaign to look at.
    #[arg(long, value_enum)]
    pub(crate) domain: Option<SideChoice>,
}
