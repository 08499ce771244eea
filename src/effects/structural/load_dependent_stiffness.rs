use nalgebra::Vector3;

use crate::data::RobotSpec;
use crate::effects::Background;
use crate::effects::background::TUTTLE;
use crate::effects::structural::{PostureSetting, Structure};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Effect, Known, Site};
use crate::parameter::{Parameter, Prior};
use crate::robot::{Chain, Dual, Role};

/// Gear stiffness rises with the static gravity torque: k (1 + beta |tau| / 1 kN·m) at every joint.
pub struct LoadDependentStiffness;

const GRAVITY_M_PER_S2: f64 = 9.81;

impl Effect<Structure> for LoadDependentStiffness {
    fn id(&self) -> &'static str {
        "load-dependent-stiffness"
    }

    fn explanation(&self) -> &'static str {
        "Gears are stiffer under load: each joint's stiffness rises with the static torque that gravity puts on it."
    }

    fn fingerprint(&self) -> &'static str {
        "One set of joint stiffnesses cannot serve all postures: where the arm reaches far out the modes lie too high for \
         the model, where it hangs straight too low."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Measure the joint's twist under a rising torque, both ways, with the brake set: the curve is flat about \
             zero and steepens. Or measure FRFs at two postures that load the joint differently and else look alike.",
            typical: "Strain-wave gears gain a factor 1.5 to 4 from small to full torque (makers give three stiffnesses K1, \
             K2, K3). Cycloidal (RV) gears of large robots are nearly straight once their lost motion is taken up.",
            best_measured: "Postures that differ in gravity's torque and in little else: arm stretched out and \
             upright, with the wrist as it is. Three loads or more show the law, two only a difference.",
            sources: &[TUTTLE],
        }
    }

    fn sites(&self, _robot: &RobotSpec) -> Vec<Site> {
        vec![Site::Everywhere]
    }

    fn obstacle(&self, Known { data, .. }: &Known<Structure>) -> Option<String> {
        (data.postures < 2).then(|| "one posture shows one load only".to_string())
    }

    fn parameters(&self, _at: At, _known: &Known<Structure>) -> Vec<Parameter> {
        vec![Parameter::linear(
            "beta",
            "1",
            0.05,
            Prior { mean: 0.0, std: 0.5 },
            [0.0, 3.0],
        )]
    }

    fn starts(&self, _at: At, _known: &Known<Structure>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        vec![vec![0.2]]
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[UsualSize::new(
                "beta",
                SizeRange::Log(0.05, 0.2),
                FollowsSize::Power(1.0),
            )]
        }
    }

    fn vanishing(&self, _at: At, _parameters: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![0.0])
    }

    fn order(&self) -> u8 {
        2
    }

    fn apply(&self, _at: At, values: &[Dual], setting: &PostureSetting, chain: &mut Chain) {
        for i in 1..=setting.robot.joint_count() {
            let axis = setting.kinematics.joint_axis(i);
            let origin = setting.kinematics.joint_origin(i);
            let mut torque = Dual::constant(0.0);
            for body in chain.bodies.iter().filter(|b| b.place.link >= i) {
                let weight = Vector3::new(0.0, 0.0, -GRAVITY_M_PER_S2 * body.mass_kg);
                let moment = (body.com - origin).cross(&weight).dot(&axis);
                torque = &torque + &body.scale.scale(moment);
            }
            let factor = &Dual::constant(1.0) + &(&values[0] * &torque.abs().scale(1e-3));
            for element in chain.elements.iter_mut().filter(|e| e.role == Role::Joint(i)) {
                element.stiffness = &element.stiffness * &factor;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::fixture::{TAP_POSTURES, irb6640};
    use crate::robot::{Baseline, RobotModel};

    /// The torque of gravity is the slope of the potential energy over the joint's angle, which knows no lever arms.
    #[test]
    fn joints_stiffen_with_the_torque_that_carries_the_arm() {
        const H_DEG: f64 = 1e-3;
        let robot = RobotModel::new(irb6640());
        let beta = 0.1;
        for posture in TAP_POSTURES.iter().take(3) {
            let chain_at = |angles: &[f64]| {
                let kinematics = robot.kinematics(angles).unwrap();
                let chain = robot.chain(&kinematics, &Baseline::nominal(&robot.spec));
                (kinematics, chain)
            };
            let energy = |angles: &[f64]| -> f64 {
                let bodies = chain_at(angles).1.bodies;
                let lifted = bodies.iter().map(|b| b.scale.value * b.mass_kg * b.com.z);
                GRAVITY_M_PER_S2 * lifted.sum::<f64>()
            };
            let (kinematics, bare) = chain_at(posture);
            let mut chain = bare.clone();
            let setting = PostureSetting::of_tests(&robot, &kinematics);
            let at = At {
                site: Site::Everywhere,
                variant: 0,
            };
            LoadDependentStiffness.apply(at, &[Dual::constant(beta)], &setting, &mut chain);
            for joint in 1..=robot.joint_count() {
                let [mut less, mut more] = [posture.to_vec(), posture.to_vec()];
                (less[joint - 1], more[joint - 1]) = (posture[joint - 1] - H_DEG, posture[joint - 1] + H_DEG);
                let torque_knm = (energy(&more) - energy(&less)) / (2.0 * H_DEG.to_radians()) * 1e-3;
                let of = |chain: &Chain| {
                    let own = chain.elements.iter().find(|e| e.role == Role::Joint(joint));
                    own.unwrap().stiffness.value
                };
                approx::assert_relative_eq!(
                    of(&chain) / of(&bare),
                    1.0 + beta * torque_knm.abs(),
                    max_relative = 1e-6
                );
            }
        }
    }
}
