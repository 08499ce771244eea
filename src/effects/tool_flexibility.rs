use super::*;
use crate::robot::{Branch, Place, Slot};
use nalgebra::Vector3;

/// Tool and holder: a lumped mass at the tool point on a spring in the two directions normal to the tool axis.
pub struct ToolFlexibility;

const MASS_KG: f64 = 4.0;

impl StructuralEffect for ToolFlexibility {
    fn id(&self) -> &'static str {
        "tool-flexibility"
    }

    fn explanation(&self) -> &'static str {
        "Tool and holder (or spindle) bend against the flange: a mass at the tool point on a spring normal to the tool \
         axis."
    }

    fn fingerprint(&self) -> &'static str {
        "One extra resonance at about the same frequency at every posture, strong at the tool point, normal to the tool \
         axis, weak elsewhere."
    }

    fn sites(&self, _robot: &RobotSpec) -> Vec<Site> {
        vec![Site::Everywhere]
    }

    fn parameters(&self, _robot: &RobotSpec, data: &DataSummary) -> Vec<Parameter> {
        branch::parameters(data, MASS_KG, 50.0)
    }

    fn starts(&self, _robot: &RobotSpec, data: &DataSummary, peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        branch::starts(data, peaks_hz, MASS_KG)
    }

    fn apply(&self, _site: Site, _variant: usize, values: &[Dual], setting: &Setting, chain: &mut Chain) {
        let (stiffness, damping) = branch::spring_and_damper(values);
        let rotation = setting.kinematics.tool.rotation;
        chain.branches.push(Branch {
            place: Place::new(setting.robot.joint_count(), Slot::End),
            at: setting.kinematics.tcp(),
            directions: vec![rotation * Vector3::x(), rotation * Vector3::y()],
            mass_kg: values[0].clone(),
            stiffness_n_per_m: stiffness,
            damping_ns_per_m: damping,
            carries_tool_point: true,
        });
    }
}
