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
