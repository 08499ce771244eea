//! All effects on cutting forces: one line an effect.

use super::chatter::Chatter;
use super::chisel_edge::ChiselEdge;
use super::crosstalk::Crosstalk;
use super::dynamometer_misalignment::DynamometerMisalignment;
use super::dynamometer_resonance::DynamometerResonance;
use super::edge_force::EdgeForce;
use super::effect::{CuttingEffect, CuttingInstance};
use super::margin_friction::MarginFriction;
use super::nonlinear_drift::NonlinearDrift;
use super::runout::RunoutEffect;
use super::size_effect::SizeEffect;
use super::speed_dependence::SpeedDependence;
use super::tool_wear::ToolWear;

/// All cutting effects.
pub const CUTTING: [&dyn CuttingEffect; 12] = [
    &SizeEffect,
    &RunoutEffect,
    &ToolWear,
    &SpeedDependence,
    &Crosstalk,
    &DynamometerMisalignment,
    &DynamometerResonance,
    &NonlinearDrift,
    &Chatter,
    &ChiselEdge,
    &MarginFriction,
    &EdgeForce,
];

/// Every instance, discrete choices included.
pub fn instances() -> Vec<CuttingInstance> {
    CUTTING
        .into_iter()
        .flat_map(|effect| (0..effect.variants()).map(move |variant| CuttingInstance { effect, variant }))
        .collect()
}

/// Instances (one for each discrete choice) of an effect; empty if there is none of that name.
pub fn find(name: &str) -> Vec<CuttingInstance> {
    instances().into_iter().filter(|i| i.label() == name).collect()
}
