//! Wrong files and other mistakes of the setup, of both sides of a campaign.

use super::{CuttingAnalysis, StructureAnalysis};
use crate::Result;
use crate::campaign::Campaign;
use crate::discrepancy::setup::SetupCheck;
use crate::identify::Options;

/// What looks wrong with the files and the setup of `campaign`, side by side.
///
/// # Errors
/// In place of a side that cannot be worked out.
pub fn setup_checks(campaign: &Campaign) -> Vec<Result<SetupCheck>> {
    let structure = (!campaign.frfs.is_empty() && campaign.robot.is_some())
        .then(|| StructureAnalysis::run(campaign, Options::default()).and_then(|a| a.setup_check()));
    let cutting =
        (!campaign.cuts.is_empty()).then(|| CuttingAnalysis::run(campaign).and_then(|a| a.setup_check()));
    [structure, cutting].into_iter().flatten().collect()
}
