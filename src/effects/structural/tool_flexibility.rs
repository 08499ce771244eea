use nalgebra::Vector3;

use crate::data::RobotSpec;
use crate::effects::Background;
use crate::effects::background::ALTINTAS;
use crate::effects::structural::branch;
use crate::effects::structural::{PostureSetting, Structure};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Effect, Known, NEGLIGIBLE, Site};
use crate::parameter::Parameter;
use crate::robot::{Branch, Chain, Dual, Place, Slot};

/// Tool and holder: a lumped mass at the tool point on a spring in the two directions normal to the tool axis.
pub struct ToolFlexibility;

const MASS_KG: f64 = 4.0;

impl Effect<Structure> for ToolFlexibility {
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

    fn background(&self) -> Background {
        Background {
            lab_check: "Tap test at the tool point and at the spindle's nose, same direction: the resonance is at the tip and not \
             at the nose. A shorter tool, or another holder, moves it.",
            typical: "Slender tools and light spindles on robots: 30 to 2000 Hz, damping 1 to 5 % of critical; short stiff tools \
             lie above what a robot's test covers.",
            best_measured: "Tool point and spindle nose or flange, both directions normal to the tool, hit at the \
             tool point, in a band that reaches beyond the tool's own resonance.",
            sources: &[
                "Schmitz, T. L.; Donaldson, R. R. (2000): Predicting high-speed machining dynamics by substructure \
                 analysis. CIRP Annals 49(1).",
                ALTINTAS,
            ],
        }
    }

    fn sites(&self, _robot: &RobotSpec) -> Vec<Site> {
        vec![Site::Everywhere]
    }

    fn parameters(&self, _at: At, Known { data, .. }: &Known<Structure>) -> Vec<Parameter> {
        branch::parameters(data, MASS_KG, 50.0)
    }

    fn starts(&self, _at: At, Known { data, .. }: &Known<Structure>, peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        branch::starts(data, peaks_hz, MASS_KG)
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[
                UsualSize::new("mass_kg", SizeRange::Log(2.0, 8.0), FollowsSize::Not),
                // Its compliance is 1/(m ω²).
                UsualSize::new(
                    "frequency_hz",
                    SizeRange::Log(35.0, 80.0),
                    FollowsSize::Power(-0.5),
                ),
                UsualSize::new("damping_ratio", SizeRange::Log(0.015, 0.04), FollowsSize::Not),
            ]
        }
    }

    fn vanishing(&self, _at: At, parameters: &[Parameter]) -> Option<Vec<f64>> {
        // A light tip on a hard spring: k = m ω² has to grow while the mass goes.
        Some(vec![
            NEGLIGIBLE * parameters[0].nominal,
            parameters[1].nominal / NEGLIGIBLE,
            parameters[2].nominal,
        ])
    }

    fn apply(&self, _at: At, values: &[Dual], setting: &PostureSetting, chain: &mut Chain) {
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
