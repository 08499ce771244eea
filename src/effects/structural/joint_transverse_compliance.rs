use nalgebra::{DMatrix, Vector6};

use crate::data::RobotSpec;
use crate::effects::Background;
use crate::effects::background::{ABELE, MOBERG};
use crate::effects::structural::{PostureSetting, Structure};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Effect, Known, NEGLIGIBLE, Site};
use crate::parameter::Parameter;
use crate::robot::{Chain, Dual, Element, Place, Role, Slot};

/// A joint's bearing tilts about both axes normal to the joint's own.
pub struct JointTransverseCompliance;

impl Effect<Structure> for JointTransverseCompliance {
    fn id(&self) -> &'static str {
        "joint-transverse-compliance"
    }

    fn explanation(&self) -> &'static str {
        "The bearing of this joint tilts: besides turning about its own axis the joint gives way about both axes normal to \
         it."
    }

    fn fingerprint(&self) -> &'static str {
        "Soft in directions that no gear can move; the error follows the bearing when the arm changes posture and is seen \
         at every point behind the joint."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Clamp the arm so that the joint's gear carries no load, load it sideways to the joint's axis and watch \
             with two dial gauges on either side of the bearing: the flange tilts. Modes that move where no gear can \
             turn show it, too.",
            typical: "Cross roller and gear bearings of large robots: 1 to 20 MN·m/rad, of the size of the gear's own stiffness \
             or a few times above it.",
            best_measured: "Points on both sides of this joint, in the directions that its gear cannot move, at \
             postures that turn the next joints by 90°.",
            sources: &[MOBERG, ABELE],
        }
    }

    /// At joint 1 this is the rocking of the base by another name; a wrist's last joint carries little behind it.
    fn sites(&self, robot: &RobotSpec) -> Vec<Site> {
        (2..robot.joints.len()).map(Site::Joint).collect()
    }

    fn parameters(&self, _at: At, _known: &Known<Structure>) -> Vec<Parameter> {
        vec![Parameter::logarithmic(
            "transverse_nm_per_rad",
            "N·m/rad",
            3e6,
            2.0,
            [2e4, 1e9],
        )]
    }

    fn starts(&self, _at: At, _known: &Known<Structure>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        vec![vec![7e5], vec![1.5e7]]
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[UsualSize::new(
                "transverse_nm_per_rad",
                SizeRange::Log(1e6, 4e6),
                FollowsSize::Power(-1.0),
            )]
        }
    }

    fn vanishing(&self, _at: At, parameters: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![NEGLIGIBLE.recip() * parameters[0].nominal])
    }

    fn apply(&self, At { site, .. }: At, values: &[Dual], setting: &PostureSetting, chain: &mut Chain) {
        let Site::Joint(i) = site else { return };
        let frame = setting.kinematics.joint_frame(i);
        let tilt = |axis: nalgebra::Vector3<f64>| {
            let a = frame.rotation * axis;
            Vector6::new(0.0, 0.0, 0.0, a.x, a.y, a.z)
        };
        chain.elements.push(Element {
            role: Role::Bearing,
            place: Place::new(i, Slot::Joint),
            at: setting.kinematics.joint_origin(i),
            directions: vec![tilt(nalgebra::Vector3::x()), tilt(nalgebra::Vector3::y())],
            shape: DMatrix::identity(2, 2),
            stiffness: values[0].clone(),
            damping: None,
        });
    }
}
