//! The links of a URDF as a tree, and the way through it from base to tool.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use urdf_rs::{Joint, JointType, Robot};

use crate::{InputError, Result};

/// Names that tool frames usually have, most wanted first.
const TOOL_NAMES: [&str; 2] = ["tool0", "flange"];

/// The links of a file and what is attached to what.
pub struct Tree<'a> {
    pub file: &'a Path,
    pub robot: &'a Robot,
    /// Link → joint that carries it.
    above: HashMap<&'a str, &'a Joint>,
    /// Link → joints that it carries, in the order of the file.
    below: HashMap<&'a str, Vec<&'a Joint>>,
}

/// Whether a joint turns.
pub fn turns(joint: &Joint) -> bool {
    matches!(joint.joint_type, JointType::Revolute | JointType::Continuous)
}

/// Whether a joint may lie between base and tool.
pub fn can_be_modelled(joint: &Joint) -> bool {
    joint.mimic.is_none() && (turns(joint) || joint.joint_type == JointType::Fixed)
}

/// For people.
pub fn kind(joint: &Joint) -> &'static str {
    match joint.joint_type {
        JointType::Revolute => "revolute",
        JointType::Continuous => "continuous",
        JointType::Prismatic => "prismatic",
        JointType::Fixed => "fixed",
        JointType::Floating => "floating",
        JointType::Planar => "planar",
        JointType::Spherical => "spherical",
    }
}

impl<'a> Tree<'a> {
    /// # Errors
    /// Links or joints of the same name, joints to links that are not there, a link that two joints carry, a loop.
    pub fn new(file: &'a Path, robot: &'a Robot) -> Result<Self> {
        let wrong = |key: &str, problem: String, remedy: &str| {
            Err(InputError::new(problem).file(file).key(key).remedy(remedy).into())
        };
        let mut names = HashSet::new();
        for link in &robot.links {
            if !names.insert(link.name.as_str()) {
                return wrong(
                    &link.name,
                    "two links have this name".into(),
                    "give each link a name of its own",
                );
            }
        }
        if names.is_empty() {
            return wrong(
                "link",
                "the file has no link".into(),
                "give the URDF of a robot arm",
            );
        }
        let mut joints = HashSet::new();
        let mut tree = Tree {
            file,
            robot,
            above: HashMap::new(),
            below: HashMap::new(),
        };
        for joint in &robot.joints {
            if !joints.insert(joint.name.as_str()) {
                let problem = "two joints have this name".to_string();
                return wrong(&joint.name, problem, "give each joint a name of its own");
            }
            for end in [&joint.parent.link, &joint.child.link] {
                if !names.contains(end.as_str()) {
                    let problem = format!("the joint refers to link {end:?}, which is not in the file");
                    return wrong(
                        &joint.name,
                        problem,
                        "add the link, or correct parent and child of the joint",
                    );
                }
            }
            if let Some(other) = tree.above.insert(&joint.child.link, joint) {
                let problem = format!("two joints carry this link: {} and {}", other.name, joint.name);
                return wrong(
                    &joint.child.link,
                    problem,
                    "a URDF is a tree: closed loops cannot be read",
                );
            }
            tree.below.entry(&joint.parent.link).or_default().push(joint);
        }
        for link in &robot.links {
            if tree.way(None, &link.name).is_none() {
                let problem = "the link is its own ancestor".to_string();
                return wrong(
                    &link.name,
                    problem,
                    "a URDF is a tree: closed loops cannot be read",
                );
            }
        }
        Ok(tree)
    }

    /// Joints that a link carries.
    pub fn below(&self, link: &str) -> &[&'a Joint] {
        self.below.get(link).map_or(&[], Vec::as_slice)
    }

    /// Joints from `base` (from the root, where `None`) to `link`, base first; `None` where `link` is not attached to `base`.
    pub fn way(&self, base: Option<&str>, link: &str) -> Option<Vec<&'a Joint>> {
        let mut way = Vec::new();
        let mut at = link;
        while base != Some(at) {
            match self.above.get(at) {
                // More joints on the way than there are: a loop.
                Some(_) if way.len() > self.robot.joints.len() => return None,
                Some(joint) => {
                    way.push(*joint);
                    at = &joint.parent.link;
                }
                None if base.is_none() => break,
                None => return None,
            }
        }
        way.reverse();
        Some(way)
    }

    fn known(&self, name: &str, option: &str) -> Result<&'a str> {
        let links = self.robot.links.iter().map(|link| link.name.as_str());
        links.clone().find(|link| *link == name).ok_or_else(|| {
            InputError::new(format!("there is no link {name:?}"))
                .file(self.file)
                .key(option)
                .remedy(format!("the file has {}", some_of(links)))
                .into()
        })
    }

    /// The base link: as asked for, else the root.
    ///
    /// # Errors
    /// No link of that name; several roots and nothing asked for.
    pub fn base(&self, asked: Option<&str>) -> Result<&'a str> {
        if let Some(name) = asked {
            return self.known(name, "--base-link");
        }
        let links = self.robot.links.iter().map(|link| link.name.as_str());
        let roots: Vec<&str> = links.filter(|link| !self.above.contains_key(link)).collect();
        match roots.as_slice() {
            [root] => Ok(root),
            roots => Err(InputError::new(format!(
                "no joint carries any of {} links: {}",
                roots.len(),
                some_of(roots.iter().copied())
            ))
            .file(self.file)
            .key("--base-link")
            .remedy("name the one that the robot stands on with --base-link")
            .into()),
        }
    }

    /// The tool link and why it: as asked for, else one called tool0 or flange, else the one behind most turning joints
    /// (of several one behind no other kind of joint, then the one behind most links).
    ///
    /// # Errors
    /// No link of that name, or one that is not attached to the base.
    pub fn tool(&self, asked: Option<&str>, base: &str) -> Result<(&'a str, String)> {
        if let Some(name) = asked {
            let link = self.known(name, "--tool-link")?;
            if self.way(Some(base), link).is_none() {
                return Err(InputError::new(format!("{link} is not attached to {base}"))
                    .file(self.file)
                    .key("--tool-link")
                    .remedy("choose base and tool so that the way from one to the other leads outwards")
                    .into());
            }
            return Ok((link, "asked for".into()));
        }
        let links = self.robot.links.iter().map(|link| link.name.as_str());
        let behind = links.filter_map(|link| Some((link, self.way(Some(base), link)?)));
        let behind: Vec<(&str, Vec<&Joint>)> = behind.collect();
        for name in TOOL_NAMES {
            let mut named = behind.iter().filter(|(link, _)| *link == name);
            if let Some((link, _)) = named.next() {
                return Ok((link, "by its name".into()));
            }
        }
        // Behind as many turning joints a gripper's body before its sliding fingers.
        let depth = |way: &[&Joint]| {
            let turning = way.iter().filter(|j| turns(j)).count();
            (turning, way.iter().all(|j| can_be_modelled(j)), way.len())
        };
        // The first of equals: `max_by_key` would take the last.
        let deepest = behind.iter().rev().max_by_key(|(_, way)| depth(way));
        Ok(deepest.map_or(
            (self.robot.links[0].name.as_str(), String::new()),
            |(link, way)| {
                let why = format!("the farthest out, behind {} turning joints", depth(way).0);
                (*link, why)
            },
        ))
    }
}

/// Names in a message before it is cut short.
const SHOWN: usize = 12;

fn some_of<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<&str> = names.collect();
    match names.len() > SHOWN {
        true => format!("{}, … ({} in all)", names[..SHOWN].join(", "), names.len()),
        false => names.join(", "),
    }
}
