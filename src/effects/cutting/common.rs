//! What several effects on cutting forces share: reasons why data cannot show them.

use super::CuttingSummary;
use crate::data::Process;

pub(super) fn milling_only(data: &CuttingSummary) -> Option<String> {
    (data.process != Process::Milling)
        .then(|| "milling only: it shows in the waveform over a revolution".to_string())
}

pub(super) fn straight_edge_only(data: &CuttingSummary) -> Option<String> {
    (data.process == Process::Milling && !data.straight_edge).then(|| {
        "not worked out for an edge that is not straight (corner_radius_mm, lead_angle_deg of [tool])"
            .to_string()
    })
}

pub(super) fn drilling_only(data: &CuttingSummary) -> Option<String> {
    (data.process != Process::Drilling).then(|| "drilling only".to_string())
}

/// For effects with numbers of each tooth: of teeth that are none they would be many, and say nothing.
pub(super) fn teeth_as_listed(data: &CuttingSummary) -> Option<String> {
    data.teeth_in_doubt.then(|| {
        "the records show another number of teeth, or another speed in all cuts, than campaign.toml"
            .to_string()
    })
}

pub(super) fn one_helix_only(data: &CuttingSummary) -> Option<String> {
    (!data.one_helix)
        .then(|| "not worked out for teeth of several helix angles (tooth_helix_deg of [tool])".to_string())
}
