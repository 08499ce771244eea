//! All effects: one line an effect.

use std::fmt;

use super::cutting::Cutting;
use super::cutting::chatter::Chatter;
use super::cutting::chisel_edge::ChiselEdge;
use super::cutting::crosstalk::Crosstalk;
use super::cutting::dynamometer_misalignment::DynamometerMisalignment;
use super::cutting::dynamometer_resonance::DynamometerResonance;
use super::cutting::edge_force::EdgeForce;
use super::cutting::margin_friction::MarginFriction;
use super::cutting::nonlinear_drift::NonlinearDrift;
use super::cutting::push_off::PushOff;
use super::cutting::size_effect::SizeEffect;
use super::cutting::speed_dependence::SpeedDependence;
use super::cutting::teeth::runout::RunoutEffect;
use super::cutting::teeth::tooth_radii::ToothRadii;
use super::cutting::teeth::uneven_pitch::UnevenPitch;
use super::cutting::tool_wear::ToolWear;
use super::drawn::{DrawnBranch, Series};
use super::effect::{Domain, Effect, Instance};
use super::site::{Site, WrittenEffect};
use super::structural::Structure;
use super::structural::amplitude_dependent_stiffness::AmplitudeDependentStiffness;
use super::structural::base_compliance::BaseCompliance;
use super::structural::base_mounting::BaseMounting;
use super::structural::contact::ToolContact;
use super::structural::joint_damping::JointDamping;
use super::structural::joint_transverse_compliance::JointTransverseCompliance;
use super::structural::joints::bearing_compliance::BearingCompliance;
use super::structural::joints::counterbalance::Counterbalance;
use super::structural::joints::drive_dynamics::DriveDynamics;
use super::structural::joints::hysteretic_damping::HystereticDamping;
use super::structural::joints::thermal_drift::ThermalDrift;
use super::structural::link_flexibility::LinkFlexibility;
use super::structural::load_dependent_stiffness::LoadDependentStiffness;
use super::structural::loads::payload::Payload;
use super::structural::loads::payload_inertia::PayloadInertia;
use super::structural::local_resonator::LocalResonator;
use super::structural::sensor_misalignment::SensorMisalignment;
use super::structural::time_delay::TimeDelay;
use super::structural::tool_flexibility::ToolFlexibility;

/// All effects on the structure, in the order in which they are tried.
pub const STRUCTURAL: [&dyn Effect<Structure>; 19] = [
    &LinkFlexibility,
    &JointTransverseCompliance,
    &BaseCompliance,
    &ToolFlexibility,
    &LoadDependentStiffness,
    &Payload,
    &LocalResonator,
    &JointDamping,
    &TimeDelay,
    &SensorMisalignment,
    &AmplitudeDependentStiffness,
    &HystereticDamping,
    &DriveDynamics,
    &ToolContact,
    &ThermalDrift,
    &BearingCompliance,
    &BaseMounting,
    &Counterbalance,
    &PayloadInertia,
];

/// Effects on the structure whose form the data drew: added on request, not tried by `diagnose`.
pub const DRAWN: [&dyn Effect<Structure>; 2] = [&DrawnBranch, &Series];

/// All effects on cutting forces, in the order in which they are tried.
pub const CUTTING: [&dyn Effect<Cutting>; 15] = [
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
    &ToothRadii,
    &UnevenPitch,
    &PushOff,
];

impl Registry<Structure> {
    /// Effects on the structure.
    pub fn structure() -> Self {
        Registry::new(&STRUCTURAL).and_on_request(&DRAWN)
    }
}

impl Registry<Cutting> {
    /// Effects on cutting forces.
    pub fn cutting() -> Self {
        Registry::new(&CUTTING)
    }
}

/// Effects of a domain: what a diagnosis tries, in this order, and what is added on request only.
pub struct Registry<D: Domain> {
    tried: Vec<&'static dyn Effect<D>>,
    on_request: Vec<&'static dyn Effect<D>>,
}

impl<D: Domain> Clone for Registry<D> {
    fn clone(&self) -> Self {
        Registry {
            tried: self.tried.clone(),
            on_request: self.on_request.clone(),
        }
    }
}

impl<D: Domain> fmt::Debug for Registry<D> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.effects().map(Effect::id)).finish()
    }
}

impl<D: Domain> Registry<D> {
    /// The effects that a diagnosis tries.
    pub fn new(tried: &[&'static dyn Effect<D>]) -> Self {
        Registry {
            tried: tried.to_vec(),
            on_request: Vec::new(),
        }
    }

    /// The same registry with effects that can be added by name and that no diagnosis tries.
    pub fn and_on_request(self, effects: &[&'static dyn Effect<D>]) -> Self {
        Registry {
            on_request: effects.to_vec(),
            ..self
        }
    }

    /// The same registry with one more effect that a diagnosis tries: your own.
    pub fn with(mut self, effect: &'static dyn Effect<D>) -> Self {
        self.tried.push(effect);
        self
    }

    /// All effects: those that a diagnosis tries, then those on request.
    pub fn effects(&self) -> impl Iterator<Item = &'static dyn Effect<D>> + '_ {
        self.tried.iter().chain(&self.on_request).copied()
    }

    /// The effects that a diagnosis tries.
    pub fn tried(&self) -> &[&'static dyn Effect<D>] {
        &self.tried
    }

    /// The effect of this id.
    pub fn effect(&self, id: &str) -> Option<&'static dyn Effect<D>> {
        self.effects().find(|e| e.id() == id)
    }

    /// The effect that `EFFECT[@SITE][:choice=value]` begins with.
    pub fn effect_of(&self, request: &str) -> Option<&'static dyn Effect<D>> {
        self.effect(WrittenEffect::of(request).id)
    }

    /// Every instance that a diagnosis tries on this object, discrete choices included.
    pub fn instances(&self, object: &D::Object) -> Vec<Instance<D>> {
        let of = |effect: &&'static dyn Effect<D>| instances_of(*effect, object);
        self.tried.iter().flat_map(of).collect()
    }

    /// Instances (one for each discrete choice) that `EFFECT[@SITE]` means; empty if it means none.
    pub fn find(&self, object: &D::Object, label: &str) -> Vec<Instance<D>> {
        let all = self.effects().flat_map(|effect| instances_of(effect, object));
        all.filter(|instance| instance.label() == label).collect()
    }
}

fn instances_of<D: Domain>(effect: &'static dyn Effect<D>, object: &D::Object) -> Vec<Instance<D>> {
    let at = |site: Site| {
        effect.variants(site).into_iter().map(move |variant| Instance {
            effect,
            site,
            variant,
        })
    };
    effect.sites(object).into_iter().flat_map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::Background;

    /// What `explain` tells must be there for every effect, and a source must name a year.
    #[test]
    fn every_effect_says_how_to_check_it() {
        let structural = STRUCTURAL.map(|e| (e.id(), e.background()));
        let cutting = CUTTING.map(|e| (e.id(), e.background()));
        for (id, background) in structural.into_iter().chain(cutting) {
            let Background {
                lab_check,
                best_measured,
                typical,
                ..
            } = background;
            let long_enough = lab_check.len() > 60 && best_measured.len() > 60 && typical.len() > 40;
            assert!(long_enough, "{id}");
            for source in background.sources {
                let year = source.split(|c: char| !c.is_ascii_digit()).any(|n| n.len() == 4);
                assert!(year && source.ends_with('.'), "{id}: {source}");
            }
        }
    }
}
