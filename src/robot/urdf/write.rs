//! A robot as a URDF, and in a file next to it what a URDF has no place for.

use std::collections::HashSet;
use std::fmt::Write;

use nalgebra::Isometry3;

use crate::data::{JointSpec, RobotSpec};
use crate::robot::kinematics::dh::{joint_transform, rpy_of_rotation};
use crate::robot::{Kinematics, RobotModel};
use crate::text::{quoted, to_degrees, xml_escaped};

/// The values that go into the files, and where they are from.
#[derive(Debug, Clone)]
pub struct Sources {
    /// For people: `calibrated on …`, `the robot file, not calibrated`.
    pub source: String,
    /// Factor on each link's mass and inertia.
    pub mass_scale: Vec<f64>,
    /// One a joint.
    pub compliance_rad_per_nm: Vec<f64>,
    /// One damping ratio for all modes.
    pub damping_ratio: f64,
    /// Young's modulus of the links where they bend.
    pub young_pa: Option<f64>,
    /// What the model has that neither file holds.
    pub left_out: Vec<String>,
}

/// The frame of link i of the robot file in that of the URDF, which sits at the joint's axis, as a URDF demands.
fn behind_axis(joint: &JointSpec) -> Isometry3<f64> {
    match joint.placement {
        Some(_) => Isometry3::identity(),
        None => joint_transform(joint, 0.0),
    }
}

/// Names with what XML would misread replaced, each only once.
struct Names(HashSet<String>);

impl Names {
    fn new_one(&mut self, wanted: &str) -> String {
        let mut name = xml_escaped(wanted);
        while !self.0.insert(name.clone()) {
            name.push('_');
        }
        name
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

/// The robot as the text of a URDF: links at their joints' axes, with mass, centre of mass and inertia times
/// `sources.mass_scale`; the tool frame is the link `tool0`.
pub fn urdf(robot: &RobotModel, sources: &Sources) -> String {
    let spec = &robot.spec;
    let zero = Kinematics::new(spec, &vec![0.0; spec.joints.len()]);
    let mut links = Names(HashSet::new());
    let mut joints = Names(HashSet::new());
    let base = links.new_one("base_link");
    let mut text = format!(
        "<?xml version=\"1.0\"?>\n<!-- Written by lobestone. Masses and inertias: {}.\n     Limits of effort and velocity are not \
         known here and stand as 0. -->\n<robot name=\"{}\">\n  <link name=\"{base}\"/>\n",
        xml_escaped(&sources.source).replace("--", "- -"),
        xml_escaped(&spec.name)
    );
    let mut parent = base;
    let mut behind = Isometry3::identity();
    for (i, (joint, link)) in spec.joints.iter().zip(&spec.links).enumerate() {
        let child = links.new_one(link.name.as_deref().unwrap_or(&format!("link_{}", i + 1)));
        let name = joints.new_one(joint.name.as_deref().unwrap_or(&format!("joint_{}", i + 1)));
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
        let scale = sources.mass_scale[i];
        let j = turn * link.inertia_tensor() * turn.transpose() * scale;
        let _ = write!(
            text,
            "  </joint>\n  <link name=\"{child}\">\n    <inertial>\n      <origin xyz=\"{}\" rpy=\"0 0 0\"/>\n      <mass \
             value=\"{:?}\"/>\n      <inertia ixx=\"{:?}\" ixy=\"{:?}\" ixz=\"{:?}\" iyy=\"{:?}\" iyz=\"{:?}\" \
             izz=\"{:?}\"/>\n    </inertial>\n  </link>\n",
            numbers(com.coords.iter()),
            link.mass_kg * scale,
            j[(0, 0)],
            j[(0, 1)],
            j[(0, 2)],
            j[(1, 1)],
            j[(1, 2)],
            j[(2, 2)]
        );
        parent = child;
    }
    let tool = links.new_one("tool0");
    let _ = write!(
        text,
        "  <joint name=\"{}\" type=\"fixed\">\n    {}\n    <parent link=\"{parent}\"/>\n    <child link=\"{tool}\"/>\n  \
         </joint>\n  <link name=\"{tool}\"/>\n</robot>\n",
        joints.new_one("tool0_joint"),
        origin(&(behind * spec.tool.in_flange()))
    );
    text
}

/// What a URDF cannot hold, as TOML: compliance of each joint, damping ratio, Young's modulus.
pub fn compliances(spec: &RobotSpec, sources: &Sources) -> String {
    let mut text = format!(
        "# What the URDF next to this file has no place for. Written by lobestone.\nrobot = {}\nsource = {}\n",
        quoted(&spec.name),
        quoted(&sources.source)
    );
    for (key, sentences) in [("guesses", &spec.guesses), ("left_out", &sources.left_out)] {
        if !sentences.is_empty() {
            let all: Vec<String> = sentences.iter().map(|s| quoted(s)).collect();
            let _ = writeln!(text, "{key} = [{}]", all.join(", "));
        }
    }
    let _ = writeln!(text, "damping_ratio = {:?}", sources.damping_ratio);
    if let Some(young_pa) = sources.young_pa {
        let _ = writeln!(text, "young_pa = {young_pa:?}");
    }
    for (i, (joint, compliance)) in spec.joints.iter().zip(&sources.compliance_rad_per_nm).enumerate() {
        let name = joint.name.clone().unwrap_or(format!("joint_{}", i + 1));
        let _ = write!(
            text,
            "\n[[joint]]\nname = {}\ncompliance_rad_per_nm = {compliance:?}\n",
            quoted(&name)
        );
        if let Some(limits) = joint.limits_rad {
            let [low, high] = limits.map(to_degrees);
            let _ = writeln!(text, "limits_deg = [{low:?}, {high:?}]");
        }
    }
    text
}
