//! A URDF as a robot: the chain from base to tool, what is held fast lumped into it.

use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Translation3, Unit, UnitQuaternion, Vector3};
use urdf_rs::{Joint, JointType, Link, Pose};

use super::body::RigidBody;
use super::guess;
use super::tree::{Tree, kind, turns};
use crate::data::{JointPlacement, JointSpec, LinkSpec, RobotSpec, ToolFrame};
use crate::robot::kinematics::dh::{rotation_of_rpy, rpy_of_rotation};
use crate::text::figures;
use crate::{InputError, Result};

/// What a URDF does not say.
#[derive(Debug, Clone, Default)]
pub struct Request {
    /// `None`: the root of the tree.
    pub base_link: Option<String>,
    /// `None`: tool0, else flange, else the link farthest out.
    pub tool_link: Option<String>,
    /// Payload that the maker rates the arm for; `None`: guessed from the mass of its links.
    pub payload_kg: Option<f64>,
}

/// A robot from a URDF.
#[derive(Debug, Clone)]
pub struct UrdfRobot {
    /// The robot as a robot file has it.
    pub spec: RobotSpec,
    /// Link of the URDF that stands on the ground.
    pub base_link: String,
    /// Link of the URDF that carries the tool.
    pub tool_link: String,
    /// What was decided, for people: frames, links taken together, joints held.
    pub notes: Vec<String>,
}

/// Elements within each other; a robot has about five.
const DEEPEST: usize = 200;
/// Attributes of one element; a robot has about four.
const MOST_ATTRIBUTES: usize = 200;
/// Lengths and parts of a tensor below this share of their size are rounding.
const ROUNDING: f64 = 1e-15;

/// Reads the text of a URDF. `file` is what errors call it.
///
/// Links that fixed joints hold, and those behind joints off the way from base to tool (a gripper's fingers), are lumped
/// into the link that carries them; every link keeps its URDF frame.
///
/// # Errors
/// Text that is no URDF (a xacro, for instance), no tree, a chain with sliding or coupled joints or without any joint,
/// impossible masses or inertias; each with file, link or joint, and remedy.
pub fn read(file: &Path, text: &str, request: &Request) -> Result<UrdfRobot> {
    can_be_parsed(file, text)?;
    let robot = urdf_rs::read_from_string(text).map_err(|error| unreadable(file, text, &error))?;
    let tree = Tree::new(file, &robot)?;
    for joint in &robot.joints {
        let numbers = joint.origin.xyz.iter().chain(&*joint.origin.rpy);
        finite(file, &joint.name, numbers.chain(&*joint.axis.xyz))?;
    }
    let base = tree.base(request.base_link.as_deref())?;
    let (tool, why) = tree.tool(request.tool_link.as_deref(), base)?;
    let way = tree.way(Some(base), tool).unwrap_or_default();
    let mut notes = vec![format!(
        "base {base}, tool {tool} ({why}); its z axis is the tool axis"
    )];
    refuse_what_does_not_turn(&tree, &way, base, tool)?;
    let mut reader = Reader {
        tree: &tree,
        way: &way,
        notes: &mut notes,
    };
    let mut spec = RobotSpec {
        name: match robot.name.trim() {
            "" => "robot".to_string(),
            name => crate::ingest::shown(name).into_owned(),
        },
        joints: Vec::new(),
        links: Vec::new(),
        tool: ToolFrame::default(),
        guesses: Vec::new(),
    };
    let mut from = base;
    loop {
        let segment = reader.segment(from, tool)?;
        if from != base {
            spec.links.push(link_of(from, &segment.body));
        } else if segment.body.mass_kg > 0.0 {
            let told = format!(
                "{} kg stand still with {base} and are left out",
                figures(segment.body.mass_kg, 4)
            );
            reader.notes.push(told);
        }
        match segment.next {
            Next::Joint(joint, carrier) => {
                spec.joints.push(reader.joint(joint, &carrier)?);
                from = &joint.child.link;
            }
            Next::Tool(pose) => {
                spec.tool = ToolFrame {
                    tcp_in_flange_m: rounded(pose.translation.vector, 1.0),
                    tilt_about_flange_y_rad: 0.0,
                    rpy_in_flange_rad: rpy_of_rotation(&pose.rotation),
                };
                break;
            }
        }
    }
    if !(spec.links.iter().map(|link| link.mass_kg).sum::<f64>() > 0.0) {
        return Err(
            InputError::new("no link that moves has any mass, so nothing can vibrate")
                .file(file)
                .key("inertial")
                .remedy("add <inertial> with mass, centre of mass and inertia to the links of the URDF")
                .into(),
        );
    }
    guess::compliances(&mut spec, request.payload_kg);
    Ok(UrdfRobot {
        spec,
        base_link: base.to_string(),
        tool_link: tool.to_string(),
        notes,
    })
}

fn can_be_parsed(file: &Path, text: &str) -> Result<()> {
    let refuse = |problem: &str, remedy: &str| Err(InputError::new(problem).file(file).remedy(remedy).into());
    if text.contains("<xacro:") {
        return refuse(
            "is a xacro: a text that a URDF is made of",
            "make the URDF of it first: xacro FILE.xacro > FILE.urdf",
        );
    }
    if text.contains("quat_xyzw") {
        return refuse(
            "gives rotations as quat_xyzw, which is not read",
            "write them as rpy (roll, pitch, yaw in rad)",
        );
    }
    // A parser goes as deep as the text does; a robot description does not go deep.
    let (mut depth, mut deepest) = (0usize, 0usize);
    for piece in text.split('<').skip(1) {
        if piece.starts_with('/') {
            depth = depth.saturating_sub(1);
        } else if !piece.starts_with(['!', '?'])
            && !piece.split('>').next().is_some_and(|tag| tag.ends_with('/'))
        {
            depth += 1;
            deepest = deepest.max(depth);
        }
    }
    if deepest > DEEPEST {
        return refuse(
            "has elements nested more than 200 deep, as no robot has",
            "give the URDF of a robot arm",
        );
    }
    // quick-xml looks at each attribute of an element for every other one (RUSTSEC-2026-0194).
    let elements = text
        .split('<')
        .skip(1)
        .filter(|piece| !piece.starts_with(['!', '?']));
    match elements.map(|piece| piece.matches('=').count()).max() {
        Some(most) if most > MOST_ATTRIBUTES => refuse(
            &format!("has an element with {most} attributes, as no robot has"),
            "give the URDF of a robot arm",
        ),
        _ => Ok(()),
    }
}

/// The parser says what it misses, not where: links and joints are read one by one until it is found.
fn unreadable(file: &Path, text: &str, error: &urdf_rs::UrdfError) -> InputError {
    const REMEDY: &str = "check it with check_urdf, or load it in the program that it comes from";
    let refused = |error: &urdf_rs::UrdfError| {
        let said = error.to_string();
        let said = said.strip_prefix("custom: ").unwrap_or(&said);
        InputError::new(format!("is no URDF that can be read: {said}")).file(file)
    };
    let mut starts: Vec<(usize, &str)> = ["link", "joint"]
        .into_iter()
        .flat_map(|kind| {
            let is_tag = move |at: &usize| text[at + 1 + kind.len()..].starts_with(char::is_whitespace);
            let found = text.match_indices('<').map(|(at, _)| at);
            found
                .filter(move |at| text[at + 1..].starts_with(kind) && is_tag(at))
                .map(move |at| (at, kind))
        })
        .collect();
    starts.sort_unstable();
    for (at, kind) in starts {
        let own = &text[at..];
        let head = own.find('>').map_or(own.len(), |end| end + 1);
        let end = match own[..head].ends_with("/>") {
            true => Some(head),
            false => own.find(&format!("</{kind}>")).map(|end| end + kind.len() + 3),
        };
        let Some(element) = end.map(|end| &own[..end]) else {
            continue;
        };
        let Err(error) = urdf_rs::read_from_string(&format!("<robot name=\"one\">{element}</robot>")) else {
            continue;
        };
        let name = own[..head].split("name=").nth(1).and_then(|rest| {
            let quote = rest.chars().next().filter(|c| "\"'".contains(*c))?;
            rest[1..].split(quote).next()
        });
        let key = name.map_or_else(|| kind.to_owned(), |name| format!("{kind} {name}"));
        return refused(&error)
            .line(text[..at].matches('\n').count() + 1)
            .key(key)
            .remedy(format!(
                "correct this {kind}: numbers with a decimal point, and all that URDF asks for; then {REMEDY}"
            ));
    }
    refused(error).remedy(REMEDY)
}

fn finite<'a>(file: &Path, key: &str, numbers: impl Iterator<Item = &'a f64>) -> Result<()> {
    match numbers.into_iter().find(|n| !(n.abs() < 1e9)) {
        Some(number) => Err(InputError::new(format!("holds {number}, which no robot has"))
            .file(file)
            .key(key)
            .remedy("correct the number in the URDF (m, kg, rad)")
            .into()),
        None => Ok(()),
    }
}

fn refuse_what_does_not_turn(tree: &Tree<'_>, way: &[&Joint], base: &str, tool: &str) -> Result<()> {
    let refuse = |key: &str, problem: String, remedy: &str| {
        Err(InputError::new(problem)
            .file(tree.file)
            .key(key)
            .remedy(remedy)
            .into())
    };
    for joint in way {
        if let Some(mimic) = &joint.mimic {
            return refuse(
                &joint.name,
                format!(
                    "the joint follows {} (mimic), and lies between base and tool: joints that move together are not modelled",
                    mimic.joint
                ),
                "end the chain before it with --tool-link, or give the arm without its coupled joint",
            );
        }
        if !turns(joint) && joint.joint_type != JointType::Fixed {
            return refuse(
                &joint.name,
                format!(
                    "the joint is {}, and lies between base and tool: only joints that turn are modelled",
                    kind(joint)
                ),
                "begin behind it with --base-link or end before it with --tool-link; where it is locked, write it as \
                 type=\"fixed\" at the place it is locked at",
            );
        }
    }
    if !way.iter().any(|joint| turns(joint)) {
        return refuse(
            "--tool-link",
            format!("no joint turns between {base} and {tool}"),
            "name other links with --base-link and --tool-link",
        );
    }
    Ok(())
}

/// What is fixed to a link of the chain.
struct Segment<'a> {
    /// In the frame of its first link.
    body: RigidBody,
    next: Next<'a>,
}

enum Next<'a> {
    /// The joint that ends the segment, and where the link that carries it stands.
    Joint(&'a Joint, Isometry3<f64>),
    Tool(Isometry3<f64>),
}

struct Reader<'a, 'n> {
    tree: &'a Tree<'a>,
    way: &'a [&'a Joint],
    notes: &'n mut Vec<String>,
}

impl<'a> Reader<'a, '_> {
    fn is_on_the_way(&self, joint: &Joint) -> bool {
        self.way.iter().any(|other| other.name == joint.name)
    }

    /// Everything held fast to `root`, up to the next turning joint of the chain.
    fn segment(&mut self, root: &'a str, tool: &str) -> Result<Segment<'a>> {
        let mut body = RigidBody::none();
        let mut next = None;
        let mut lumped = Vec::new();
        let mut stack = vec![(root, Isometry3::identity())];
        while let Some((name, pose)) = stack.pop() {
            if let Some(link) = self.tree.robot.links.iter().find(|link| link.name == name) {
                let own = self.body(link)?;
                if name != root && own.mass_kg > 0.0 {
                    lumped.push(name);
                }
                body = body.with(&own.seen_from(&pose));
            }
            if name == tool {
                next = Some(Next::Tool(pose));
            }
            for joint in self.tree.below(name).iter().rev() {
                if self.is_on_the_way(joint) && turns(joint) {
                    next = Some(Next::Joint(joint, pose));
                    continue;
                }
                let at = pose * isometry(&joint.origin) * self.held(joint, root)?;
                stack.push((&joint.child.link, at));
            }
        }
        if !lumped.is_empty() {
            self.notes
                .push(format!("with {root} as one body: {}", lumped.join(", ")));
        }
        Ok(Segment {
            body,
            // The way was followed from base to tool, so that one of the two was met.
            next: next.unwrap_or(Next::Tool(Isometry3::identity())),
        })
    }

    /// How far a joint off the way stands: at zero, or as near as its limits allow; told.
    fn held(&mut self, joint: &Joint, root: &str) -> Result<Isometry3<f64>> {
        if joint.joint_type == JointType::Fixed {
            return Ok(Isometry3::identity());
        }
        let has_limits = joint.limit.lower < joint.limit.upper && joint.joint_type != JointType::Continuous;
        let at = match &joint.mimic {
            Some(mimic) => mimic.offset.unwrap_or(0.0),
            None if has_limits => 0f64.clamp(joint.limit.lower, joint.limit.upper),
            None => 0.0,
        };
        finite(self.tree.file, &joint.name, [at].iter())?;
        let follows = match &joint.mimic {
            Some(mimic) => format!(", follows {}", mimic.joint),
            None => String::new(),
        };
        self.notes.push(format!(
            "joint {} ({}{follows}) is not between base and tool: held at {at}, its links counted with {root}",
            joint.name,
            kind(joint)
        ));
        Ok(match joint.joint_type {
            JointType::Prismatic => Isometry3::from(Translation3::from(self.axis(joint)?.into_inner() * at)),
            _ if turns(joint) => {
                let turn = UnitQuaternion::from_axis_angle(&self.axis(joint)?, at);
                Isometry3::from_parts(Translation3::identity(), turn)
            }
            _ => Isometry3::identity(),
        })
    }

    fn axis(&self, joint: &Joint) -> Result<Unit<Vector3<f64>>> {
        Unit::try_new(Vector3::from(*joint.axis.xyz), 1e-6).ok_or_else(|| {
            InputError::new("the joint's axis has no length")
                .file(self.tree.file)
                .key(&joint.name)
                .remedy("give the direction that the joint turns about: <axis xyz=\"0 0 1\"/>")
                .into()
        })
    }

    fn joint(&mut self, joint: &Joint, carrier: &Isometry3<f64>) -> Result<JointSpec> {
        let frame = carrier * isometry(&joint.origin);
        // As written where nothing was taken together: nothing is rounded then.
        let rpy_rad = match *carrier == Isometry3::identity() {
            true => *joint.origin.rpy,
            false => rpy_of_rotation(&frame.rotation),
        };
        let [low, high] = [joint.limit.lower, joint.limit.upper];
        let limits_rad = match joint.joint_type {
            JointType::Continuous => {
                self.notes
                    .push(format!("joint {} turns without end: no limits_deg", joint.name));
                None
            }
            _ if low < high && low.is_finite() && high.is_finite() => Some([low, high]),
            _ => {
                self.notes.push(format!(
                    "joint {} has no limits in the URDF: no limits_deg",
                    joint.name
                ));
                None
            }
        };
        Ok(JointSpec {
            name: Some(crate::ingest::shown(&joint.name).into_owned()),
            limits_rad,
            placement: Some(JointPlacement {
                origin_m: rounded(frame.translation.vector, 1.0),
                rpy_rad,
                axis: rounded(self.axis(joint)?.into_inner(), 1.0),
            }),
            ..JointSpec::default()
        })
    }

    /// A link's own body in its frame.
    fn body(&mut self, link: &Link) -> Result<RigidBody> {
        let i = &link.inertial;
        let tensor = Matrix3::new(
            i.inertia.ixx,
            i.inertia.ixy,
            i.inertia.ixz, //
            i.inertia.ixy,
            i.inertia.iyy,
            i.inertia.iyz, //
            i.inertia.ixz,
            i.inertia.iyz,
            i.inertia.izz,
        );
        let numbers = i.origin.xyz.iter().chain(&*i.origin.rpy);
        finite(
            self.tree.file,
            &link.name,
            numbers.chain(tensor.iter()).chain([&i.mass.value]),
        )?;
        let moments = tensor.symmetric_eigenvalues();
        let rounding = 1e-9 * tensor.norm();
        if i.mass.value < 0.0 || moments.min() < -rounding {
            return Err(
                InputError::new("the link's mass or a moment of inertia is negative")
                    .file(self.tree.file)
                    .key(&link.name)
                    .remedy("correct <inertial> of the link: nothing real has that")
                    .into(),
            );
        }
        if 2.0 * moments.max() > moments.sum() + rounding.max(1e-6 * moments.sum()) {
            self.notes.push(format!(
                "link {}: one moment of inertia is larger than the two others together, as of no real body; taken as written",
                link.name
            ));
        }
        let own = RigidBody {
            mass_kg: i.mass.value,
            com_m: nalgebra::Point3::origin(),
            inertia_kg_m2: tensor,
        };
        Ok(own.seen_from(&isometry(&i.origin)))
    }
}

fn isometry(pose: &Pose) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(Vector3::from(*pose.xyz)),
        rotation_of_rpy(*pose.rpy),
    )
}

/// Without what is rounding compared with `size`.
fn rounded(vector: Vector3<f64>, size: f64) -> [f64; 3] {
    let kept = vector.map(|v| if v.abs() < ROUNDING * size { 0.0 } else { v });
    kept.into()
}

fn link_of(name: &str, body: &RigidBody) -> LinkSpec {
    let j = &body.inertia_kg_m2;
    let size = j.norm();
    LinkSpec {
        name: Some(crate::ingest::shown(name).into_owned()),
        mass_kg: body.mass_kg,
        inertia_kg_m2: rounded(j.diagonal(), size).map(|moment| moment.max(0.0)),
        products_kg_m2: rounded(Vector3::new(j[(0, 1)], j[(0, 2)], j[(1, 2)]), size),
        com_m: Some(rounded(body.com_m.coords, 1.0)),
        section: None,
    }
}
