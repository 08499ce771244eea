use nalgebra::Vector3;

use crate::data::RobotSpec;
use crate::effects::structural::{PostureSetting, Structure};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Background, Effect, Known, NEGLIGIBLE, Site, Size};
use crate::parameter::{Parameter, Prior};
use crate::robot::{Chain, Dual, Role};

/// A spring, or a gas or oil cylinder, that carries the arm's weight beside the second joint's gear. With the rod's foot at distance
/// a from the joint, its head at L, its length s (s0 unstressed) and θ the angle between the two, Klimchik et al. (2014) have
/// k = K a L (cos θ (1 − s0/s) + (s0/s) (a L / s²) sin² θ). Its two terms are the choices, for a rod that is long against L.
pub struct Counterbalance;

/// By number of the choice: its force hardly changes (cos θ), or its stiffness does the work (sin² θ, its lever arm squared).
const LAWS: [&str; 2] = ["force", "stiffness"];

/// The joint it is built at.
const JOINT: usize = 2;
const NOMINAL_NM_PER_RAD: f64 = 5e4;

impl Effect<Structure> for Counterbalance {
    fn id(&self) -> &'static str {
        "counterbalance"
    }

    fn explanation(&self) -> &'static str {
        "A counterbalance (a spring, a gas or oil cylinder) works beside the second joint's gear: the joint is stiffer at some angles \
         of the arm than at others."
    }

    fn fingerprint(&self) -> &'static str {
        "Modes that turn joint 2 lie too high or too low by how far the second link leans, whatever the other joints and the load do."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Look for a cylinder between the turret and the lower arm. Read its pressure (a gas one that has lost some is \
                        common), and measure the same tool point with joint 2 leaning forward, upright and back.",
            typical: "Peak torques of 2 to 20 kN·m, which is as many kN·m/rad: a hundredth of the gear's stiffness at most, which hardly \
                      shows. Stiff springs, and oil cylinders whose valves are shut, 100 kN·m/rad and more. Robots for 100 kg and more \
                      mostly have one.",
            best_measured: "Postures in which joint 2 goes through most of its range and joint 3 makes up for it, so that gravity's \
                            torque stays alike.",
            sources: &[
                "Klimchik, A.; Caro, S.; Wu, Y.; Chablat, D.; Furet, B.; Pashkevich, A. (2014): Stiffness modeling of robotic \
                 manipulator with gravity compensator. Computational Kinematics, Springer.",
            ],
        }
    }

    fn sites(&self, robot: &RobotSpec) -> Vec<Site> {
        (robot.joints.len() >= JOINT)
            .then_some(Site::Joint(JOINT))
            .into_iter()
            .collect()
    }

    fn variants(&self, _site: Site) -> Vec<usize> {
        (0..LAWS.len()).collect()
    }

    fn variant_label(&self, variant: usize) -> Option<(&'static str, &'static str)> {
        LAWS.get(variant).map(|name| ("law", *name))
    }

    fn obstacle(&self, Known { data, .. }: &Known<Structure>) -> Option<String> {
        (data.postures < 3)
            .then(|| "a stiffness that follows the arm's angle takes three postures or more".to_string())
    }

    fn parameters(&self, At { variant, .. }: At, _known: &Known<Structure>) -> Vec<Parameter> {
        let turn = repeats_after_deg(variant);
        let prior = Prior {
            mean: 0.0,
            std: turn / 2.0,
        };
        vec![
            Parameter::logarithmic(
                "stiffness_nm_per_rad",
                "N·m/rad",
                NOMINAL_NM_PER_RAD,
                1.5,
                [1e2, 1e8],
            ),
            // Wide enough that no start comes to an end: every turn is the same law again.
            Parameter::linear("stiffest_at_deg", "°", 0.0, prior, [-3.0 * turn, 3.0 * turn]),
        ]
    }

    fn starts(&self, At { variant, .. }: At, _known: &Known<Structure>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        let third = repeats_after_deg(variant) / 3.0;
        [third, -third]
            .map(|angle| vec![NOMINAL_NM_PER_RAD, angle])
            .to_vec()
    }

    fn impossible(&self, _site: Site, robot: &RobotSpec, sizes: &[Size]) -> Option<String> {
        let gear = robot.joints.get(JOINT - 1)?.compliance_rad_per_nm.recip();
        sizes.first()?.outside(
            "a counterbalance's stiffness",
            [0.0, 2.0 * gear],
            (1e-3, "kN·m/rad"),
            "more than twice the gear's, which it only relieves",
        )
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[
                UsualSize::new(
                    "stiffness_nm_per_rad",
                    SizeRange::Log(1e5, 5e5),
                    FollowsSize::Power(1.0),
                ),
                UsualSize::new("stiffest_at_deg", SizeRange::Either(60.0), FollowsSize::Not),
            ]
        }
    }

    fn vanishing(&self, _at: At, parameters: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![NEGLIGIBLE * parameters[0].nominal, parameters[1].nominal])
    }

    fn order(&self) -> u8 {
        // What makes the gear itself stiffer or softer comes before: this stands beside it.
        3
    }

    fn apply(&self, At { site, variant }: At, values: &[Dual], setting: &PostureSetting, chain: &mut Chain) {
        let (Site::Joint(joint), [stiffness, stiffest_at]) = (site, values) else {
            return;
        };
        let (start, end) = setting.kinematics.link_ends(joint);
        let lean = lean_rad(&(end - start), &setting.kinematics.joint_axis(joint));
        let theta = &Dual::constant(lean) - &stiffest_at.scale(1f64.to_radians());
        let cos = theta.chain(theta.value.cos(), -theta.value.sin());
        let law = if variant == 0 { cos } else { &cos * &cos };
        let own = stiffness * &law;
        for element in chain.elements.iter_mut().filter(|e| e.role == Role::Joint(joint)) {
            element.stiffness = &element.stiffness + &own;
        }
    }
}

/// Angle after which a law is the same again: cos² after half a turn.
fn repeats_after_deg(variant: usize) -> f64 {
    if variant == 0 { 360.0 } else { 180.0 }
}

/// How far a link leans out of the vertical, turned about `axis` as the joint turns it, rad.
fn lean_rad(link: &Vector3<f64>, axis: &Vector3<f64>) -> f64 {
    let up = Vector3::z() - axis * axis.z;
    axis.dot(&up.cross(link)).atan2(up.dot(link))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::fixture::{TAP_POSTURES, irb6640};
    use crate::robot::{Baseline, RobotModel};

    fn joint_2_gains(variant: usize, joints_deg: &[f64], stiffest_at_deg: f64) -> f64 {
        let model = RobotModel::new(irb6640());
        let kinematics = model.kinematics(joints_deg).unwrap();
        let mut chain = model.chain(&kinematics, &Baseline::nominal(&model.spec));
        let of = |chain: &Chain| {
            let mut own = chain.elements.iter().filter(|e| e.role == Role::Joint(2));
            own.next().unwrap().stiffness.value
        };
        let before = of(&chain);
        let setting = PostureSetting::of_tests(&model, &kinematics);
        let at = At {
            site: Site::Joint(2),
            variant,
        };
        let values = [1e5, stiffest_at_deg].map(Dual::constant);
        Counterbalance.apply(at, &values, &setting, &mut chain);
        of(&chain) - before
    }

    /// The work of a spring between two points, its rod long against the lever, differentiated twice by the joint's angle.
    #[test]
    fn each_law_is_the_second_derivative_of_a_rods_energy() {
        let (rod_m, lever_m) = (50.0, 0.2);
        let length = |theta: f64| {
            f64::sqrt(rod_m * rod_m + lever_m * lever_m - 2.0 * rod_m * lever_m * f64::cos(theta))
        };
        // A constant force has energy F s, a spring at its length K (s − s0)²/2 with the force at s0 left out.
        let force = |theta: f64, _: f64| 1e5 / lever_m * length(theta);
        let spring =
            |theta: f64, at: f64| 0.5 * 1e5 / (lever_m * lever_m) * (length(theta) - length(at)).powi(2);
        let bend = |energy: &dyn Fn(f64, f64) -> f64, theta: f64| {
            const H: f64 = 1e-3;
            (energy(theta + H, theta) - 2.0 * energy(theta, theta) + energy(theta - H, theta)) / (H * H)
        };
        for lean_deg in [-50.0f64, 0.0, 20.0, 75.0] {
            let mut posture = TAP_POSTURES[0].to_vec();
            // Joint 2 turns the link out of the vertical.
            let upright = {
                let gains = |q2: f64| joint_2_gains(0, &[0.0, q2, 0.0, 0.0, 0.0, 0.0], 0.0);
                (-180..180)
                    .map(f64::from)
                    .max_by(|a, b| gains(*a).total_cmp(&gains(*b)))
                    .unwrap()
            };
            posture[1] = upright + lean_deg;
            let theta = lean_deg.to_radians();
            approx::assert_relative_eq!(
                joint_2_gains(0, &posture, 0.0),
                bend(&force, theta),
                max_relative = 2e-2
            );
            // The lever arm of the spring is greatest a quarter turn from where the force law is stiffest.
            approx::assert_relative_eq!(
                joint_2_gains(1, &posture, 90.0),
                bend(&spring, theta),
                max_relative = 2e-2,
                epsilon = 50.0
            );
        }
    }

    #[test]
    fn the_lean_follows_the_joints_angle_whatever_the_other_joints_do() {
        let model = RobotModel::new(irb6640());
        let lean = |q: [f64; 6]| {
            let kinematics = model.kinematics(&q).unwrap();
            let (start, end) = kinematics.link_ends(2);
            lean_rad(&(end - start), &kinematics.joint_axis(2)).to_degrees()
        };
        let first = lean([0.0, 10.0, 0.0, 0.0, 0.0, 0.0]);
        assert!((lean([70.0, 33.0, -20.0, 15.0, 5.0, 9.0]) - first - 23.0).abs() < 1e-9);
    }
}
