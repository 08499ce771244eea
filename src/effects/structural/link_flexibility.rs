use crate::data::RobotSpec;
use crate::effects::background::ABELE;
use crate::effects::structural::{PostureSetting, Structure};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Effect, Known, NEGLIGIBLE, Site};
use crate::effects::{Background, Size};
use crate::parameter::{Parameter, Prior, Scale};
use crate::robot::model::NOTHING_BENDS_PA;
use crate::robot::{Chain, Dual};

/// How the effect is called.
pub const LINK_FLEXIBILITY: &str = "link-flexibility";

/// Links bend: every link a beam of its section, one common Young's modulus where the robot file gives it none of its own.
pub struct LinkFlexibility;

impl Effect<Structure> for LinkFlexibility {
    fn id(&self) -> &'static str {
        LINK_FLEXIBILITY
    }

    fn explanation(&self) -> &'static str {
        "The links are not rigid: each bends, twists and stretches as a beam of its section, all with one Young's modulus, but for \
         those that the robot file gives one of their own."
    }

    fn fingerprint(&self) -> &'static str {
        "All modes shift down a little at every posture, the highest most, and the tool gets softer even where the joints \
         are stiff."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Lock the brakes, push the tool with a known force (some 500 N) and read dial gauges at both ends of each \
             long link, against the floor: a link bends if its far end moves more than its near end's shift and tilt \
             carry it. Or hit along the arm: a bending mode is curved between the joints, a rigid one straight.",
            typical: "Cast steel or aluminium arms behave as 70 to 210 GPa with the section of the drawing. On a large six-axis \
             robot the links give about a tenth to a quarter of the softness at the tool; the joints give the rest.",
            best_measured: "A point at each end of a long link and a band up to the first bending mode; arm \
             stretched out and folded, so that links and joints share the load differently.",
            sources: &[
                ABELE,
                "Book, W. J. (1984): Recursive Lagrangian dynamics of flexible manipulator arms. The International \
                 Journal of Robotics Research 3(3).",
            ],
        }
    }

    fn sites(&self, _robot: &RobotSpec) -> Vec<Site> {
        vec![Site::Everywhere]
    }

    fn obstacle(&self, Known { object: robot, .. }: &Known<Structure>) -> Option<String> {
        robot
            .links
            .iter()
            .all(|l| l.section.is_none())
            .then(|| "the robot file gives no link a section".to_string())
    }

    fn parameters(&self, _at: At, _known: &Known<Structure>) -> Vec<Parameter> {
        vec![Parameter {
            name: "young_pa".into(),
            unit: "Pa",
            scale: Scale::Logarithmic,
            nominal: 200e9,
            prior: Some(Prior {
                mean: 150e9f64.ln(),
                std: 2.0,
            }),
            bounds: [2e9, NOTHING_BENDS_PA],
        }]
    }

    fn impossible(&self, _site: Site, _robot: &RobotSpec, sizes: &[Size]) -> Option<String> {
        sizes.first()?.outside(
            "Young's modulus",
            [40e9, 230e9],
            (1e-9, "GPa"),
            "magnesium has 45, steel 210",
        )
    }

    fn starts(&self, _at: At, _known: &Known<Structure>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        vec![vec![70e9], vec![500e9]]
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[UsualSize::new(
                "young_pa",
                SizeRange::Log(60e9, 200e9),
                FollowsSize::Power(-1.0),
            )]
        }
    }

    fn vanishing(&self, _at: At, parameters: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![NEGLIGIBLE.recip() * parameters[0].nominal])
    }

    fn apply(&self, _at: At, values: &[Dual], setting: &PostureSetting, chain: &mut Chain) {
        for i in 1..=setting.robot.joint_count() {
            chain
                .elements
                .extend(setting.robot.link_halves(setting.kinematics, i, &values[0]));
        }
    }
}
