//! A robot as a URDF.

use std::collections::HashSet;
use std::fmt::Write;

use nalgebra::Isometry3;

use crate::data::{JointSpec, RobotSpec};
use crate::robot::kinematics::dh::{joint_transform, rpy_of_rotation};
use crate::robot::{Kinematics, RobotModel};
use crate::text::xml_escaped;

/// The values that go into a URDF and the file next to it, and where they are from.
#[derive(Debug, Clone)]
pub struct Sources {
    /// For people: `calibrated on …`, `the robot file, not calibrated`.
    pub source: String,
    /// One damping ratio for all modes.
    pub damping_ratio: f64,
    /// Common Young's modulus of the links where they bend.
    pub young_pa: Option<f64>,
    /// What the model has that neither file holds.
    pub left_out: Vec<String>,
}

/// The frame of link i of the robot file in that of the URDF, which sits at the joint's axis, as a URDF demands.
pub(crate) fn behind_axis(joint: &JointSpec) -> Isometry3<f64> {
    match joint.placement {
        Some(_) => Isometry3::identity(),
        None => joint_transform(joint, 0.0),
    }
}

/// What links and joints are called, in a URDF and the file next to it: each name only once.
pub(crate) struct Names {
    base: String,
    pub links: Vec<String>,
    tool: String,
    pub joints: Vec<String>,
    tool_joint: String,
}

impl Names {
    pub fn new(spec: &RobotSpec) -> Self {
        fn new_one(taken: &mut HashSet<String>, wanted: &str) -> String {
            let mut name = wanted.to_string();
            while !taken.insert(name.clone()) {
                name.push('_');
            }
            name
        }
        let (mut links, mut joints) = (HashSet::new(), HashSet::new());
        let base = new_one(&mut links, "base_link");
        let own = |name: &Option<String>, kind: &str, i: usize| {
            name.clone().unwrap_or_else(|| format!("{kind}_{}", i + 1))
        };
        let link_names = spec.links.iter().enumerate();
        let link_names = link_names.map(|(i, link)| new_one(&mut links, &own(&link.name, "link", i)));
        let link_names = link_names.collect();
        let joint_names = spec.joints.iter().enumerate();
        let joint_names = joint_names.map(|(i, joint)| new_one(&mut joints, &own(&joint.name, "joint", i)));
        Names {
            base,
            links: link_names,
            tool: new_one(&mut links, "tool0"),
            joints: joint_names.collect(),
            tool_joint: new_one(&mut joints, "tool0_joint"),
        }
    }
}

fn numbers<'a>(values: impl IntoIterator<Item = &'a f64>) -> String {
    let all: Vec<String> = values.into_iter().map(|v| format!("{:?}", v + 0.0)).collect();
    all.join(" ")
}

fn origin(pose: &Isometry3<f64>) -> String {
    format!(
        "<origin xyz=\"{}\" rpy=\"{}\"/>",
        numbers(pose.translation.vector.iter()),
        numbers(&rpy_of_rotation(&pose.rotation))
    )
}

/// The robot as the text of a URDF: links at their joints' axes, with mass, centre of mass and inertia; the tool frame is the link
/// `tool0`.
pub fn urdf(robot: &RobotModel, sources: &Sources) -> String {
    let spec = &robot.spec;
    let zero = Kinematics::new(spec, &vec![0.0; spec.joints.len()]);
    let names = Names::new(spec);
    let base = xml_escaped(&names.base);
    let mut text = format!(
        "<?xml version=\"1.0\"?>\n<!-- Written by lobestone. Lengths, masses and inertias: {}.\n     Limits of effort and velocity are not \
         known here and stand as 0. -->\n<robot name=\"{}\">\n  <link name=\"{base}\"/>\n",
        xml_escaped(&sources.source).replace("--", "- -"),
        xml_escaped(&spec.name)
    );
    let mut parent = base;
    let mut behind = Isometry3::identity();
    for (i, (joint, link)) in spec.joints.iter().zip(&spec.links).enumerate() {
        let child = xml_escaped(&names.links[i]);
        let name = xml_escaped(&names.joints[i]);
        let (own, axis) = match &joint.placement {
            Some(placement) => (placement.frame(), placement.axis),
            None => (Isometry3::identity(), [0.0, 0.0, 1.0]),
        };
        let place = origin(&(behind * own));
        behind = behind_axis(joint);
        let kind = if joint.limits_rad.is_some() {
            "revolute"
        } else {
            "continuous"
        };
        let _ = write!(
            text,
            "  <joint name=\"{name}\" type=\"{kind}\">\n    {place}\n    <parent link=\"{parent}\"/>\n    <child \
             link=\"{child}\"/>\n    <axis xyz=\"{}\"/>\n",
            numbers(&axis)
        );
        if let Some([low, high]) = joint.limits_rad {
            let _ = writeln!(
                text,
                "    <limit lower=\"{low:?}\" upper=\"{high:?}\" effort=\"0\" velocity=\"0\"/>"
            );
        }
        let com = behind * zero.frames[i + 1].inverse_transform_point(&robot.link_com(&zero, i + 1));
        let turn = behind.rotation.to_rotation_matrix().into_inner();
        let j = turn * link.inertia_tensor() * turn.transpose();
        let _ = write!(
            text,
            "  </joint>\n  <link name=\"{child}\">\n    <inertial>\n      <origin xyz=\"{}\" rpy=\"0 0 0\"/>\n      <mass \
             value=\"{:?}\"/>\n      <inertia ixx=\"{:?}\" ixy=\"{:?}\" ixz=\"{:?}\" iyy=\"{:?}\" iyz=\"{:?}\" \
             izz=\"{:?}\"/>\n    </inertial>\n  </link>\n",
            numbers(com.coords.iter()),
            link.mass_kg,
            j[(0, 0)],
            j[(0, 1)],
            j[(0, 2)],
            j[(1, 1)],
            j[(1, 2)],
            j[(2, 2)]
        );
        parent = child;
    }
    let tool = xml_escaped(&names.tool);
    let _ = write!(
        text,
        "  <joint name=\"{}\" type=\"fixed\">\n    {}\n    <parent link=\"{parent}\"/>\n    <child link=\"{tool}\"/>\n  \
         </joint>\n  <link name=\"{tool}\"/>\n</robot>\n",
        xml_escaped(&names.tool_joint),
        origin(&(behind * spec.tool.in_flange()))
    );
    text
}
