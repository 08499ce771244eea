use super::{CampaignArg, Outcome};
use crate::{Error, Result};

#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    campaign: CampaignArg,
}

pub fn run(args: Args) -> Result<Outcome> {
    let _ = args.campaign.dir;
    Err(Error::computation("report is not built yet"))
}
