use nalgebra::{Matrix3, Point3};

use crate::data::RobotSpec;
use crate::effects::background::KHALIL;
use crate::effects::structural::{PostureSetting, Structure};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Effect, Known, NEGLIGIBLE, Site};
use crate::effects::{Background, Size};
use crate::parameter::{Parameter, Prior, Scale};
use crate::robot::{Body, Chain, Dual, Place, Slot};

/// Mass on the flange that the model does not have.
pub struct Payload;

/// Where the mass sits: outside the flange along its z, m.
const OUTSIDE_FLANGE_M: f64 = 0.05;

impl Effect<Structure> for Payload {
    fn id(&self) -> &'static str {
        "payload"
    }

    fn explanation(&self) -> &'static str {
        "There is mass on the flange that the model does not have: a dress pack, a spindle, a tool changer."
    }

    fn fingerprint(&self) -> &'static str {
        "All modes that move the flange are too high in the model, at every posture, while the static stiffness is right."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Weigh what hangs on the flange: spindle, holder, adapter plates, hoses. Or drive the wrist slowly with and \
             without it and compare motor currents: most controllers have a routine that identifies the load.",
            typical: "Milling spindles 10 to 60 kg, tool changers 2 to 15 kg, dress packs 3 to 10 kg.",
            best_measured: "FRFs at the flange or tool point in all three directions, at postures with the wrist \
             bent and straight: a mass at the flange and a softer wrist then differ. A weighed mass added on \
             purpose settles it.",
            sources: &[
                KHALIL,
                "Swevers, J.; Ganseman, C.; Tükel, D. B.; De Schutter, J.; Van Brussel, H. (1997): Optimal robot \
                 excitation and identification. IEEE Transactions on Robotics and Automation 13(5).",
            ],
        }
    }

    fn sites(&self, _robot: &RobotSpec) -> Vec<Site> {
        vec![Site::Everywhere]
    }

    fn parameters(&self, _at: At, _known: &Known<Structure>) -> Vec<Parameter> {
        vec![Parameter {
            name: "mass_kg".into(),
            unit: "kg",
            scale: Scale::Logarithmic,
            nominal: 20.0,
            prior: Some(Prior {
                mean: 15f64.ln(),
                std: 1.5,
            }),
            bounds: [0.05, 1000.0],
        }]
    }

    fn impossible(&self, _site: Site, robot: &RobotSpec, sizes: &[Size]) -> Option<String> {
        let moving: f64 = robot.links.iter().map(|l| l.mass_kg).sum();
        sizes.first()?.outside(
            "a mass",
            [1e-4 * moving, 0.5 * moving],
            (1.0, "kg"),
            "less than a ten-thousandth of the arm is a cable tie, more than half of it the robot could not carry",
        )
    }

    fn starts(&self, _at: At, _known: &Known<Structure>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        vec![vec![5.0], vec![60.0]]
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[UsualSize::new(
                "mass_kg",
                SizeRange::Log(10.0, 40.0),
                FollowsSize::Power(1.0),
            )]
        }
    }

    fn vanishing(&self, _at: At, parameters: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![NEGLIGIBLE * parameters[0].nominal])
    }

    fn order(&self) -> u8 {
        0
    }

    fn apply(&self, _at: At, values: &[Dual], setting: &PostureSetting, chain: &mut Chain) {
        let n = setting.robot.joint_count();
        chain.bodies.push(Body {
            place: Place::new(n, Slot::Body),
            com: setting.kinematics.frames[n] * Point3::new(0.0, 0.0, OUTSIDE_FLANGE_M),
            mass_kg: 1.0,
            inertia_kg_m2: Matrix3::zeros(),
            scale: values[0].clone(),
            inertia_follows_mass: true,
        });
    }
}
