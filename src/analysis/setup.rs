//! Wrong files and other mistakes of the setup, of both sides of a campaign.

use super::{CuttingAnalysis, StructureAnalysis};
use crate::campaign::Campaign;
use crate::discrepancy::setup::SetupFinding;
use crate::identify::Options;

/// What is likely wrong with the files and the setup of `campaign`. A side that cannot be worked out finds nothing: the
/// command for it says why.
pub fn likely_mistakes(campaign: &Campaign) -> Vec<SetupFinding> {
    let structure = (!campaign.frfs.is_empty() && campaign.robot.is_some())
        .then(|| StructureAnalysis::run(campaign, Options::default()).and_then(|a| a.setup_check()));
    let cutting =
        (!campaign.cuts.is_empty()).then(|| CuttingAnalysis::run(campaign).and_then(|a| a.setup_check()));
    let checks = [structure, cutting].into_iter().flatten().filter_map(Result::ok);
    checks
        .flat_map(|check| check.findings)
        .filter(SetupFinding::is_likely)
        .collect()
}
