//! All effects on the structure: one line an effect.

use super::drawn::{self, DrawnBranch, Series};
use super::effect::{Instance, StructuralEffect};
use crate::data::RobotSpec;
use crate::effects::structural::amplitude_dependent_stiffness::AmplitudeDependentStiffness;
use crate::effects::structural::base_compliance::BaseCompliance;
use crate::effects::structural::joint_damping::JointDamping;
use crate::effects::structural::joint_transverse_compliance::JointTransverseCompliance;
use crate::effects::structural::link_flexibility::LinkFlexibility;
use crate::effects::structural::load_dependent_stiffness::LoadDependentStiffness;
use crate::effects::structural::local_resonator::LocalResonator;
use crate::effects::structural::payload::Payload;
use crate::effects::structural::sensor_misalignment::SensorMisalignment;
use crate::effects::structural::time_delay::TimeDelay;
use crate::effects::structural::tool_flexibility::ToolFlexibility;

/// All structural effects.
pub const STRUCTURAL: [&dyn StructuralEffect; 11] = [
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
];

/// Effects whose form the data drew: added on request, not tried by `diagnose`.
pub const DRAWN: [&dyn StructuralEffect; 2] = [&DrawnBranch, &Series];

/// Every instance that this robot can have, discrete choices included.
pub fn instances(robot: &RobotSpec) -> Vec<Instance> {
    let mut all = Vec::new();
    for effect in STRUCTURAL {
        for site in effect.sites(robot) {
            for variant in 0..effect.variants() {
                all.push(Instance {
                    effect,
                    site,
                    variant,
                });
            }
        }
    }
    all
}

/// Instances (one for each discrete choice) that `EFFECT[@SITE]` means; empty if it means none.
pub fn find(robot: &RobotSpec, name: &str) -> Vec<Instance> {
    instances(robot)
        .into_iter()
        .chain(drawn::instances(robot))
        .filter(|i| i.label() == name)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::cutting;

    /// What `explain` tells must be there for every effect, and a source must name a year.
    #[test]
    fn every_effect_says_how_to_check_it() {
        let structural = STRUCTURAL.map(|e| (e.id(), e.background()));
        let cutting = cutting::CUTTING.map(|e| (e.id(), e.background()));
        for (id, background) in structural.into_iter().chain(cutting) {
            assert!(
                background.lab_check.len() > 60 && background.typical.len() > 40,
                "{id}"
            );
            for source in background.sources {
                let year = source.split(|c: char| !c.is_ascii_digit()).any(|n| n.len() == 4);
                assert!(year && source.ends_with('.'), "{id}: {source}");
            }
        }
    }
}
