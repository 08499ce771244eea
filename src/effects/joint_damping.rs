use super::*;
use crate::effects::background::EWINS;
use crate::parameter::{Prior, Scale};
use crate::robot::Role;

/// Damping sits in the joints (viscous, one coefficient each), not one ratio for all modes.
pub struct JointDamping;

/// Damping time c/k that a few per cent of critical damping means at a robot's first modes, s.
const DAMPING_TIME_S: f64 = 1.2e-3;

impl StructuralEffect for JointDamping {
    fn id(&self) -> &'static str {
        "joint-damping"
    }

    fn explanation(&self) -> &'static str {
        "Damping sits in the joints: a viscous damper beside each gear, instead of one damping ratio for all modes."
    }

    fn fingerprint(&self) -> &'static str {
        "Frequencies fit, peak heights do not: some modes are too sharp, others too flat, and high modes are damped far \
         more than low ones."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Compare the damping ratios of all modes that `lobestone modal` finds: structural damping keeps them about \
             equal, joint friction makes them rise with frequency. Repeat warm and cold: grease changes it.",
            typical: "Industrial robots at standstill: 1 to 5 % of critical in the lowest modes, more in those above.",
            sources: &[
                "Caughey, T. K.; O'Kelly, M. E. J. (1965): Classical normal modes in damped linear dynamic systems. \
                 ASME Journal of Applied Mechanics 32(3).",
                EWINS,
            ],
        }
    }

    fn sites(&self, _robot: &RobotSpec) -> Vec<Site> {
        vec![Site::Everywhere]
    }

    fn parameters(&self, robot: &RobotSpec, _data: &DataSummary) -> Vec<Parameter> {
        robot
            .joints
            .iter()
            .enumerate()
            .map(|(i, joint)| {
                let nominal = DAMPING_TIME_S / joint.compliance_rad_per_nm;
                Parameter {
                    name: format!("c_nms_per_rad[{i}]"),
                    unit: "N·m·s/rad",
                    scale: Scale::Logarithmic,
                    nominal,
                    prior: Some(Prior {
                        mean: nominal.ln(),
                        std: 1.5,
                    }),
                    bounds: [1e-3 * nominal, 1e3 * nominal],
                }
            })
            .collect()
    }

    fn starts(&self, robot: &RobotSpec, _data: &DataSummary, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        let at = |factor: f64| {
            let c = |j: &crate::campaign::robot_spec::JointSpec| {
                factor * DAMPING_TIME_S / j.compliance_rad_per_nm
            };
            robot.joints.iter().map(c).collect()
        };
        vec![at(0.4), at(2.5)]
    }

    fn apply(&self, _site: Site, _variant: usize, values: &[Dual], _setting: &Setting, chain: &mut Chain) {
        chain.modal_damping_ratio = Dual::constant(0.0);
        for element in &mut chain.elements {
            if let Role::Joint(i) = element.role {
                element.damping = Some(values[i - 1].clone());
            }
        }
    }
}
