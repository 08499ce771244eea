//! Places where the data may draw a missing part: one displacement of the structure each.

use nalgebra::{Point3, Vector3, Vector6};

use crate::data::RobotSpec;
use crate::robot::{Element, Grip, Kinematics, Place, Role, Slot};

/// One displacement of the structure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Spot {
    /// The turning of a joint (1-based): something in parallel with its stiffness.
    Joint(usize),
    /// The middle of a link (1-based) along an axis (0 to 2) of its frame, against the ground.
    LinkAxis(usize, usize),
    /// The middle of a link (1-based) along a base axis, against the ground: what hangs between arm and hall does not turn with
    /// the link.
    LinkGround(usize, usize),
    /// The tool point along a base axis, against the ground.
    ToolGround(usize),
    /// A motion of the base that the model takes for fixed: x, y, z, then rotations about them.
    Base(usize),
    /// A motion of the bearing of a joint that the model takes for stiff: along x, y, z of the frame before the joint, then
    /// tilts about x and y.
    Bearing(usize, usize),
    /// The motor's side of a joint's gear.
    Drive(usize),
}

pub(super) const AXES: [&str; 3] = ["x", "y", "z"];
const BASE: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];
const BEARING: [&str; 5] = ["tx", "ty", "tz", "rx", "ry"];

impl Spot {
    /// `joint-2`, `link-5.z`, `link-3-ground.x`, `tool-ground.z`, `base.rx`, `bearing-3.ty`, `drive-2`.
    pub fn label(self) -> String {
        match self {
            Spot::Joint(i) => format!("joint-{i}"),
            Spot::LinkAxis(i, axis) => format!("link-{i}.{}", AXES[axis]),
            Spot::LinkGround(i, axis) => format!("link-{i}-ground.{}", AXES[axis]),
            Spot::ToolGround(axis) => format!("tool-ground.{}", AXES[axis]),
            Spot::Base(k) => format!("base.{}", BASE[k]),
            Spot::Bearing(i, k) => format!("bearing-{i}.{}", BEARING[k]),
            Spot::Drive(i) => format!("drive-{i}"),
        }
    }

    /// In words.
    pub fn words(self) -> String {
        match self {
            Spot::Joint(i) => format!("in parallel with the stiffness of joint {i}"),
            Spot::LinkAxis(i, axis) => format!("on link {i} along {}", AXES[axis]),
            Spot::LinkGround(i, axis) => format!("between link {i} and ground along base {}", AXES[axis]),
            Spot::ToolGround(axis) => format!("between tool and ground along base {}", AXES[axis]),
            Spot::Base(k) => format!("under the base ({})", BASE[k]),
            Spot::Bearing(i, k) => format!("in the bearing of joint {i} ({})", BEARING[k]),
            Spot::Drive(i) => format!("behind the gear of joint {i}"),
        }
    }

    /// In words, of this and the displacement that is [alike](Self::alike): `under the base (x and y)`.
    pub fn words_of_both(self) -> String {
        match (self, self.alike()) {
            (Spot::Base(k), Some(Spot::Base(l))) => format!("under the base ({} and {})", BASE[k], BASE[l]),
            (Spot::Bearing(i, k), Some(Spot::Bearing(_, l))) => {
                format!("in the bearing of joint {i} ({} and {})", BEARING[k], BEARING[l])
            }
            _ => self.words(),
        }
    }

    /// Something of the model's own displacement is changed there.
    pub fn parallel(robot: &RobotSpec) -> Vec<Spot> {
        let joints = (1..=robot.joints.len()).map(Spot::Joint);
        let links = (1..=robot.links.len()).flat_map(|i| (0..3).map(move |axis| Spot::LinkAxis(i, axis)));
        // The last link is next to the tool.
        let grounds = (1..robot.links.len()).flat_map(|i| (0..3).map(move |axis| Spot::LinkGround(i, axis)));
        joints
            .chain(links)
            .chain(grounds)
            .chain((0..3).map(Spot::ToolGround))
            .collect()
    }

    /// Whether `other` is another displacement of the same place.
    pub fn shares_place_with(self, other: Spot) -> bool {
        self != other
            && match (self, other) {
                (Spot::LinkAxis(i, _), Spot::LinkAxis(j, _))
                | (Spot::LinkGround(i, _), Spot::LinkGround(j, _))
                | (Spot::Bearing(i, _), Spot::Bearing(j, _)) => i == j,
                (Spot::ToolGround(_), Spot::ToolGround(_)) | (Spot::Base(_), Spot::Base(_)) => true,
                _ => false,
            }
    }

    /// The second of two displacements of a support along which it is often as stiff as along this one, the first: what shifts or tilts
    /// across an axis.
    pub fn alike(self) -> Option<Spot> {
        match self {
            Spot::Base(k @ (0 | 3)) => Some(Spot::Base(k + 1)),
            Spot::Bearing(i, k @ (0 | 3)) => Some(Spot::Bearing(i, k + 1)),
            _ => None,
        }
    }

    /// A displacement that the model does not have is added there.
    pub fn series(robot: &RobotSpec) -> Vec<Spot> {
        let base = (0..6).map(Spot::Base);
        let bearings = (1..=robot.joints.len()).flat_map(|i| (0..5).map(move |k| Spot::Bearing(i, k)));
        let drives = (1..=robot.joints.len()).map(Spot::Drive);
        base.chain(bearings).chain(drives).collect()
    }

    /// Whether the displacement is an angle.
    pub fn is_angle(self) -> bool {
        match self {
            Spot::Joint(_) | Spot::Drive(_) => true,
            Spot::LinkAxis(..) | Spot::LinkGround(..) | Spot::ToolGround(_) => false,
            Spot::Base(k) | Spot::Bearing(_, k) => k >= 3,
        }
    }

    /// Whether the displacement is one that the model does not have.
    pub fn is_series(self) -> bool {
        matches!(self, Spot::Base(_) | Spot::Bearing(..) | Spot::Drive(_))
    }

    /// What holds a parallel spot; `elements`: those of the chain. `None` for a series spot.
    pub fn grip(self, kinematics: &Kinematics, elements: &[Element]) -> Option<Grip> {
        match self {
            Spot::Joint(i) => {
                let element = elements.iter().position(|e| e.role == Role::Joint(i))?;
                Some(Grip {
                    coordinates: vec![(element, 1.0)],
                    point: None,
                })
            }
            _ => Some(Grip {
                coordinates: Vec::new(),
                point: Some(self.point(kinematics)?),
            }),
        }
    }

    /// Point, place on the chain and unit vector (base axes) of a parallel spot that is no joint.
    pub fn point(self, kinematics: &Kinematics) -> Option<(Point3<f64>, Place, Vector3<f64>)> {
        let unit = |axis: usize| Vector3::from_fn(|i, _| if i == axis { 1.0 } else { 0.0 });
        let middle = |link: usize| {
            let (start, end) = kinematics.link_ends(link);
            nalgebra::center(&start, &end)
        };
        match self {
            Spot::LinkAxis(i, axis) => {
                let direction = kinematics.frames[i].rotation * unit(axis);
                Some((middle(i), Place::new(i, Slot::Body), direction))
            }
            Spot::LinkGround(i, axis) => Some((middle(i), Place::new(i, Slot::Body), unit(axis))),
            Spot::ToolGround(axis) => {
                let place = Place::new(kinematics.joint_count(), Slot::End);
                Some((kinematics.tcp(), place, unit(axis)))
            }
            _ => None,
        }
    }

    /// Place on the chain, origin and unit twist (v, ω; base axes) of a series spot.
    pub fn twist(self, kinematics: &Kinematics) -> Option<(Place, Point3<f64>, Vector6<f64>)> {
        let unit = |k: usize| Vector6::from_fn(|i, _| if i == k { 1.0 } else { 0.0 });
        match self {
            Spot::Base(k) => Some((Place::new(0, Slot::Joint), Point3::origin(), unit(k))),
            Spot::Bearing(i, k) => {
                let local = unit(k);
                let rotation = kinematics.joint_frame(i).rotation;
                let v = rotation * local.fixed_rows::<3>(0).into_owned();
                let w = rotation * local.fixed_rows::<3>(3).into_owned();
                let twist = Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z);
                Some((Place::new(i, Slot::Joint), kinematics.joint_origin(i), twist))
            }
            Spot::Drive(i) => {
                let axis = kinematics.joint_axis(i);
                let twist = Vector6::new(0.0, 0.0, 0.0, axis.x, axis.y, axis.z);
                Some((Place::new(i, Slot::Joint), kinematics.joint_origin(i), twist))
            }
            _ => None,
        }
    }
}
