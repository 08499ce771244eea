use crate::data::RobotSpec;
use crate::effects::Background;
use crate::effects::background::EWINS;
use crate::effects::structural::{PostureSetting, Structure};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Effect, Known, NEGLIGIBLE, Site};
use crate::parameter::{Parameter, Prior};
use crate::robot::{Chain, Dual, Role};

/// Damping sits in the joints (viscous, one coefficient each), on top of what is left of the one ratio for all modes.
///
/// The common ratio is multiplied by `common_share`: 0 where all damping sits in the joints, 1 in the model without the
/// effect, so that the one model is a special case of the other. A share a little below zero is an estimate of zero with
/// its error; kept at zero it would be no estimate and would bias the dampers.
pub struct JointDamping;

/// Damping time c/k that a few per cent of critical damping means at a robot's first modes, s.
const DAMPING_TIME_S: f64 = 1.2e-3;

impl Effect<Structure> for JointDamping {
    fn id(&self) -> &'static str {
        "joint-damping"
    }

    fn explanation(&self) -> &'static str {
        "Damping sits in the joints: a viscous damper in parallel with each gear, instead of one damping ratio for all modes."
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
            best_measured: "Many spectral lines within each resonance (lines of a tenth of the peak's width), no \
             window or one whose decay is stated, and postures that let each joint take part in another mode.",
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

    fn parameters(&self, _at: At, Known { object: robot, .. }: &Known<Structure>) -> Vec<Parameter> {
        let dampers = robot.joints.iter().enumerate().map(|(i, joint)| {
            let nominal = DAMPING_TIME_S / joint.compliance_rad_per_nm;
            Parameter::logarithmic(
                format!("c_nms_per_rad[{i}]"),
                "N·m·s/rad",
                nominal,
                1.5,
                [1e-3 * nominal, 1e3 * nominal],
            )
        });
        let share = Parameter::linear(
            "common_share",
            "1",
            0.0,
            Prior { mean: 0.0, std: 1.0 },
            [-0.5, 1.5],
        );
        dampers.chain([share]).collect()
    }

    fn starts(
        &self,
        _at: At,
        Known { object: robot, .. }: &Known<Structure>,
        _peaks_hz: &[f64],
    ) -> Vec<Vec<f64>> {
        let at = |factor: f64| {
            let c = move |j: &crate::data::JointSpec| factor * DAMPING_TIME_S / j.compliance_rad_per_nm;
            robot.joints.iter().map(c)
        };
        let with = |factor: f64, share: f64| at(factor).chain([share]).collect();
        vec![with(0.4, 0.0), with(2.5, 0.0), with(0.05, 1.0)]
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[
                UsualSize::new("c_nms_per_rad", SizeRange::Times(0.25, 3.3), FollowsSize::Not),
                // All damping sits in the joints.
                UsualSize::new("common_share", SizeRange::Either(1e-9), FollowsSize::Not),
            ]
        }
    }

    fn vanishing(&self, _at: At, parameters: &[Parameter]) -> Option<Vec<f64>> {
        let (_, dampers) = parameters.split_last()?;
        let still = dampers.iter().map(|p| NEGLIGIBLE * p.nominal);
        Some(still.chain([1.0]).collect())
    }

    fn apply(&self, _at: At, values: &[Dual], _setting: &PostureSetting, chain: &mut Chain) {
        let Some((share, dampers)) = values.split_last() else {
            return;
        };
        chain.modal_damping_ratio = &chain.modal_damping_ratio * share;
        for element in &mut chain.elements {
            if let Role::Joint(i) = element.role {
                element.damping = dampers.get(i - 1).cloned();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::structural::DataSummary;
    use crate::robot::fixture::irb6640;

    /// Spring and damper of every joint have one time constant, and a fit may go a thousand times to either side.
    #[test]
    fn dampers_start_at_one_time_constant_of_their_springs() {
        let robot = irb6640();
        let at = At {
            site: Site::Everywhere,
            variant: 0,
        };
        let known = Known {
            object: &robot,
            data: DataSummary {
                force_levels: 1,
                postures: 1,
                lowest_hz: 5.0,
                highest_hz: 50.0,
            },
        };
        let parameters = JointDamping.parameters(at, &known);
        assert_eq!(parameters.len(), robot.joints.len() + 1);
        for (parameter, joint) in parameters.iter().zip(&robot.joints) {
            let stiffness = 1.0 / joint.compliance_rad_per_nm;
            approx::assert_relative_eq!(
                parameter.nominal / stiffness,
                DAMPING_TIME_S,
                max_relative = 1e-12
            );
            approx::assert_relative_eq!(parameter.bounds[0] * 1e3, parameter.nominal, max_relative = 1e-12);
            approx::assert_relative_eq!(parameter.bounds[1], parameter.nominal * 1e3, max_relative = 1e-12);
        }
    }
}
