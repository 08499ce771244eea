use nalgebra::{DMatrix, Point3, Vector6};

use crate::data::RobotSpec;
use crate::effects::Background;
use crate::effects::background::EWINS;
use crate::effects::structural::{PostureSetting, Structure};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Effect, Known, NEGLIGIBLE, Site};
use crate::parameter::Parameter;
use crate::robot::{Chain, Dual, Element, Place, Role, Slot};

/// The pedestal rocks about the base x and y axes.
pub struct BaseCompliance;

impl Effect<Structure> for BaseCompliance {
    fn id(&self) -> &'static str {
        "base-compliance"
    }

    fn explanation(&self) -> &'static str {
        "The pedestal, its bolts or the floor give way: the whole robot rocks about the horizontal axes of its base."
    }

    fn fingerprint(&self) -> &'static str {
        "Low modes are too stiff in the model at every posture and in both horizontal directions; even points on the first \
         link move."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Put accelerometers on the pedestal's foot plate and on the floor next to it, hit the arm: a pedestal that \
             rocks moves against the floor. Dial gauges at two edges of the foot under a pull at the arm do as well. \
             Check the torque of the anchor bolts first.",
            typical: "A foot plate bolted to a good foundation: above 50 MN·m/rad. Steel frames, pallets and pedestals on shims: \
             2 to 20 MN·m/rad.",
            best_measured: "Accelerometers low down: on the first link and on the base, both horizontal \
             directions, hit at the tool in the same directions. The tool alone cannot tell the base from the \
             first two joints.",
            sources: &[EWINS],
        }
    }

    fn sites(&self, _robot: &RobotSpec) -> Vec<Site> {
        vec![Site::Everywhere]
    }

    fn parameters(&self, _at: At, _known: &Known<Structure>) -> Vec<Parameter> {
        vec![Parameter::logarithmic(
            "rocking_nm_per_rad",
            "N·m/rad",
            1e7,
            2.0,
            [1e5, 5e9],
        )]
    }

    fn starts(&self, _at: At, _known: &Known<Structure>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        vec![vec![3e6], vec![5e7]]
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[UsualSize::new(
                "rocking_nm_per_rad",
                SizeRange::Log(4e6, 1.2e7),
                FollowsSize::Power(-1.0),
            )]
        }
    }

    fn vanishing(&self, _at: At, parameters: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![NEGLIGIBLE.recip() * parameters[0].nominal])
    }

    fn apply(&self, _at: At, values: &[Dual], _setting: &PostureSetting, chain: &mut Chain) {
        chain.elements.push(Element {
            role: Role::Base,
            place: Place::new(0, Slot::Joint),
            at: Point3::origin(),
            directions: vec![
                Vector6::new(0.0, 0.0, 0.0, 1.0, 0.0, 0.0),
                Vector6::new(0.0, 0.0, 0.0, 0.0, 1.0, 0.0),
            ],
            shape: DMatrix::identity(2, 2),
            stiffness: values[0].clone(),
            damping: None,
        });
    }
}
