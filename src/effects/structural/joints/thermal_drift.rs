use crate::data::RobotSpec;
use crate::effects::structural::{PostureSetting, Structure};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Effect, Known, Site};
use crate::effects::{Background, Size};
use crate::parameter::{Parameter, Prior};
use crate::robot::{Chain, Dual, Role};

/// Joint stiffness and damping change steadily from the first posture of the campaign to the last, the same share at every
/// joint: the robot warms up while it is measured.
pub struct ThermalDrift;

impl Effect<Structure> for ThermalDrift {
    fn id(&self) -> &'static str {
        "thermal-drift"
    }

    fn explanation(&self) -> &'static str {
        "The robot changes while it is measured (it warms up): joint stiffness and damping go steadily from the first posture \
         of the campaign to the last."
    }

    fn fingerprint(&self) -> &'static str {
        "Modes lie too low in the model at one end of the campaign and too high at the other, in the order of measurement, \
         whatever the posture."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Repeat the first posture at the end: if its FRFs have changed, the robot has. Warm the axes up with an hour \
                        of motion before measuring, and log the temperature of gears and motors.",
            typical: "Between cold and warm: friction and damping change by up to half, stiffness by 2 to 10 %.",
            best_measured: "The first posture again at the end, and postures in an order that does not go steadily from folded to \
                            stretched; `[[postures]]` in the order in which they were measured.",
            sources: &[
                "Bittencourt, A. C.; Gunnarsson, S. (2012): Static friction in a robot joint: modeling and identification of \
                 load and temperature effects. ASME Journal of Dynamic Systems, Measurement, and Control 134(5).",
            ],
        }
    }

    fn obstacle(&self, Known { data, .. }: &Known<Structure>) -> Option<String> {
        (data.postures < 3).then(|| "a drift over the campaign takes three postures or more".to_string())
    }

    fn on_promise(&self) -> bool {
        true
    }

    fn parameters(&self, _at: At, _known: &Known<Structure>) -> Vec<Parameter> {
        let change = |name: &str, nominal: f64, std: f64, bounds| {
            Parameter::linear(name, "1", nominal, Prior { mean: 0.0, std }, bounds)
        };
        vec![
            change("stiffness_change", -0.08, 0.2, [-0.7, 2.0]),
            change("damping_change", 0.2, 0.5, [-0.95, 4.0]),
        ]
    }

    fn starts(&self, _at: At, _known: &Known<Structure>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        vec![vec![0.08, 0.0]]
    }

    fn impossible(&self, _site: Site, _robot: &RobotSpec, sizes: &[Size]) -> Option<String> {
        sizes.first()?.outside(
            "a change of stiffness",
            [-0.4, 0.4],
            (100.0, "%"),
            "warming changes a gear's stiffness by a few per cent",
        )
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[
                UsualSize::new(
                    "stiffness_change",
                    SizeRange::Times(0.7, 2.0),
                    FollowsSize::Power(1.0),
                ),
                UsualSize::new(
                    "damping_change",
                    SizeRange::Times(0.5, 2.0),
                    FollowsSize::Power(1.0),
                ),
            ]
        }
    }

    fn vanishing(&self, _at: At, _parameters: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![0.0, 0.0])
    }

    fn order(&self) -> u8 {
        2
    }

    fn apply(&self, _at: At, values: &[Dual], setting: &PostureSetting, chain: &mut Chain) {
        let [stiffness, damping] = values else { return };
        let along = setting.conditions.order_fraction;
        let factor = |change: &Dual| &Dual::constant(1.0) + &change.scale(along);
        let stiffness = factor(stiffness);
        for element in &mut chain.elements {
            if let Role::Joint(_) = element.role {
                element.stiffness = &element.stiffness * &stiffness;
            }
        }
        chain.modal_damping_ratio = &chain.modal_damping_ratio * &factor(damping);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::structural::Conditions;
    use crate::robot::fixture::{TAP_POSTURES, irb6640};
    use crate::robot::frf::natural_frequencies_hz;
    use crate::robot::{Baseline, RobotModel};

    /// With all joints softer by one share every natural frequency falls by its root.
    #[test]
    fn frequencies_follow_the_root_of_the_stiffness() {
        let model = RobotModel::new(irb6640());
        let kinematics = model.kinematics(&TAP_POSTURES[0]).unwrap();
        let at_order = |order_fraction: f64| {
            let mut chain = model.chain(&kinematics, &Baseline::nominal(&model.spec));
            let setting = PostureSetting {
                robot: &model,
                kinematics: &kinematics,
                conditions: Conditions {
                    order_fraction,
                    ..Default::default()
                },
            };
            let values = [-0.2, 0.5].map(Dual::constant);
            ThermalDrift.apply(At::EVERYWHERE, &values, &setting, &mut chain);
            let system = chain.system(0);
            let frequencies = natural_frequencies_hz(&system).unwrap();
            (frequencies, chain.modal_damping_ratio.value)
        };
        let (first, first_ratio) = at_order(0.0);
        let (half, half_ratio) = at_order(0.5);
        for (a, b) in first.iter().zip(&half) {
            assert!((b / a - 0.9f64.sqrt()).abs() < 1e-9, "{a} {b}");
        }
        assert!((half_ratio / first_ratio - 1.25).abs() < 1e-12);
    }
}
