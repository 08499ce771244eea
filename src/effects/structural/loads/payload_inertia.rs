use nalgebra::{Matrix3, Point3, Vector3};

use crate::data::RobotSpec;
use crate::effects::background::KHALIL;
use crate::effects::structural::loads::payload::Payload;
use crate::effects::structural::{PostureSetting, Structure};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Background, Effect, Known, NEGLIGIBLE, Site, Size};
use crate::parameter::{Parameter, Prior};
use crate::robot::{Body, Chain, Dual, Place, Slot};

/// A load on the flange with a centre of mass and an inertia of its own: a [`Payload`] is a point.
pub struct PayloadInertia;

impl Effect<Structure> for PayloadInertia {
    fn id(&self) -> &'static str {
        "payload-inertia"
    }

    fn explanation(&self) -> &'static str {
        "There is a load on the flange that the model does not have, and it is large or sits off the axis: its centre of mass and its \
         inertia count, not only its mass."
    }

    fn fingerprint(&self) -> &'static str {
        "Modes that turn the wrist are too high in the model by more than those that shift it, and move in directions that the model \
         keeps apart."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Look up or weigh the load and find its balance point on an edge, along and across the flange's axis; compare \
                        with the load data (mass, centre of mass, inertia) entered in the controller.",
            typical: "Spindles 10 to 60 kg with the centre of mass 0.1 to 0.3 m out and up to 0.2 m off the axis where they are \
                      mounted sideways; radius of gyration 0.05 to 0.3 m.",
            best_measured: "FRFs at the flange and the tool point in all three directions, at postures with the wrist bent two ways, \
                            so that the load turns about each of its axes.",
            sources: &[KHALIL],
        }
    }

    fn on_promise(&self) -> bool {
        true
    }

    fn parameters(&self, _at: At, _known: &Known<Structure>) -> Vec<Parameter> {
        let offset = |name: &str, mean: f64| {
            Parameter::linear(name, "m", mean, Prior { mean, std: 0.15 }, [-1.0, 1.0])
        };
        vec![
            Parameter::logarithmic("mass_kg", "kg", 20.0, 1.5, [0.05, 1000.0]),
            offset("com_x_m", 0.0),
            offset("com_y_m", 0.0),
            offset("com_z_m", 0.1),
            Parameter::logarithmic("radius_of_gyration_m", "m", 0.12, 0.7, [0.005, 1.0]),
        ]
    }

    fn starts(&self, _at: At, _known: &Known<Structure>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        vec![
            vec![10.0, 0.15, 0.0, 0.1, 0.1],
            vec![10.0, -0.15, 0.0, 0.1, 0.1],
            vec![40.0, 0.0, 0.0, 0.2, 0.2],
        ]
    }

    fn impossible(&self, site: Site, robot: &RobotSpec, sizes: &[Size]) -> Option<String> {
        let [_, _, _, _, gyration] = sizes else {
            return None;
        };
        let mass = Payload.impossible(site, robot, sizes);
        let offset = || {
            sizes[1..4].iter().find_map(|com| {
                com.outside(
                    "a centre of mass off the flange",
                    [-0.5, 0.5],
                    (1e3, "mm"),
                    "a load that far out is longer than a metre",
                )
            })
        };
        let radius = || {
            gyration.outside(
                "a radius of gyration",
                [0.0, 0.6],
                (1e3, "mm"),
                "such a load is wider than a metre and a half",
            )
        };
        mass.or_else(offset).or_else(radius)
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[
                UsualSize::new("mass_kg", SizeRange::Log(10.0, 40.0), FollowsSize::Power(1.0)),
                UsualSize::new("com_x_m", SizeRange::Either(0.2), FollowsSize::Not),
                UsualSize::new("com_y_m", SizeRange::Either(0.2), FollowsSize::Not),
                UsualSize::new("com_z_m", SizeRange::Log(0.08, 0.3), FollowsSize::Not),
                UsualSize::new(
                    "radius_of_gyration_m",
                    SizeRange::Log(0.08, 0.3),
                    FollowsSize::Not,
                ),
            ]
        }
    }

    fn vanishing(&self, _at: At, parameters: &[Parameter]) -> Option<Vec<f64>> {
        let mut values: Vec<f64> = parameters.iter().map(|p| p.nominal).collect();
        values[0] *= NEGLIGIBLE;
        Some(values)
    }

    fn refines(&self) -> Option<&'static str> {
        Some(Payload.id())
    }

    fn order(&self) -> u8 {
        0
    }

    fn apply(&self, _at: At, values: &[Dual], setting: &PostureSetting, chain: &mut Chain) {
        let [mass, x, y, z, gyration] = values else { return };
        let n = setting.robot.joint_count();
        let flange = setting.kinematics.frames[n];
        let body = |com: Vector3<f64>, mass_kg: f64, inertia_kg_m2: Matrix3<f64>, scale: Dual| Body {
            place: Place::new(n, Slot::Body),
            com: flange * Point3::from(com),
            mass_kg,
            inertia_kg_m2,
            scale,
            inertia_follows_mass: true,
        };
        for (at, share) in shares([x, y, z]) {
            chain.bodies.push(body(at, 1.0, Matrix3::zeros(), mass * &share));
        }
        let inertia = mass * &(gyration * gyration);
        chain
            .bodies
            .push(body(Vector3::zeros(), 0.0, Matrix3::identity(), inertia));
    }
}

/// Distance of the fixed points from one another, m. Any will do.
const APART_M: f64 = 0.2;

/// A unit mass at (x, y, z), as masses at ten fixed points: kinetic energy and weight are polynomials of second degree in where a mass
/// sits, which ten points carry exactly. So the matrices stay linear in what is tuned, and their derivatives exact.
fn shares([x, y, z]: [&Dual; 3]) -> Vec<(Vector3<f64>, Dual)> {
    let steps = [x, y, z].map(|v| v.scale(1.0 / APART_M));
    let squares = [0, 1, 2].map(|i| &steps[i] * &steps[i]);
    let unit = |i: usize| {
        let mut v = Vector3::zeros();
        v[i] = APART_M;
        v
    };
    let mut middle = Dual::constant(1.0);
    let mut points = Vec::with_capacity(10);
    let mut along = [0, 1, 2].map(|i| (&squares[i] + &steps[i]).scale(0.5));
    for i in 0..3 {
        middle = &middle - &squares[i];
        points.push((-unit(i), (&squares[i] - &steps[i]).scale(0.5)));
        for j in i + 1..3 {
            let product = &steps[i] * &steps[j];
            middle = &middle + &product;
            along[i] = &along[i] - &product;
            along[j] = &along[j] - &product;
            points.push((unit(i) + unit(j), product));
        }
    }
    points.push((Vector3::zeros(), middle));
    points.extend(along.into_iter().enumerate().map(|(i, share)| (unit(i), share)));
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::fixture::{TAP_POSTURES, irb6640};
    use crate::robot::{Baseline, RobotModel};

    fn mass_matrix(change: impl Fn(&PostureSetting, &mut Chain)) -> nalgebra::DMatrix<f64> {
        let model = RobotModel::new(irb6640());
        let kinematics = model.kinematics(&TAP_POSTURES[1]).unwrap();
        let mut chain = model.chain(&kinematics, &Baseline::nominal(&model.spec));
        change(&PostureSetting::of_tests(&model, &kinematics), &mut chain);
        chain.system(0).mass
    }

    /// The mass matrix of one rigid body where the load says it is.
    #[test]
    fn ten_points_move_as_one_body() {
        let values = [23.0, 0.13, -0.21, 0.34, 0.17];
        let one_body = mass_matrix(|setting, chain| {
            let n = setting.robot.joint_count();
            chain.bodies.push(Body {
                place: Place::new(n, Slot::Body),
                com: setting.kinematics.frames[n] * Point3::new(values[1], values[2], values[3]),
                mass_kg: values[0],
                inertia_kg_m2: Matrix3::identity() * values[0] * values[4] * values[4],
                scale: Dual::constant(1.0),
                inertia_follows_mass: true,
            });
        });
        let load = mass_matrix(|setting, chain| {
            PayloadInertia.apply(At::EVERYWHERE, &values.map(Dual::constant), setting, chain);
        });
        assert!((&load - &one_body).norm() < 1e-12 * one_body.norm());
    }

    #[test]
    fn a_small_load_on_the_axis_is_a_payload() {
        let point = mass_matrix(|setting, chain| {
            Payload.apply(At::EVERYWHERE, &[Dual::constant(12.0)], setting, chain);
        });
        let load = mass_matrix(|setting, chain| {
            let values = [12.0, 0.0, 0.0, 0.05, 0.0].map(Dual::constant);
            PayloadInertia.apply(At::EVERYWHERE, &values, setting, chain);
        });
        assert!((&load - &point).norm() < 1e-12 * point.norm());
    }
}
