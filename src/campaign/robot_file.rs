//! Robot files: the built-in robots, and files of the same form in a campaign's folder.

use std::path::Path;

use super::bounds::Bounds;
use super::document::{Document, Section};
use super::keys::{self, names};
use super::robot_spec::*;
use super::suggest::closest;
use super::{ROBOT_KEY, campaign_file, paths};
use crate::{InputError, Result};

/// Built-in models: name and robot file.
const BUILT_IN: [(&str, &str); 1] = [("irb6640", include_str!("../../datasets/irb6640/robot.toml"))];

impl RobotSpec {
    /// Names of the built-in robots.
    pub fn built_in() -> Vec<&'static str> {
        BUILT_IN.iter().map(|(name, _)| *name).collect()
    }

    /// The robot that `[robot] model` names: a built-in one, or a robot file inside the campaign folder.
    ///
    /// # Errors
    /// An [`InputError`] about the key `robot.model` of `campaign.toml` where there is no such robot, or about
    /// file, key and line of the robot file where that is wrong.
    pub fn load(model: &str, campaign_dir: &Path) -> Result<RobotSpec> {
        if let Some((name, text)) = BUILT_IN.iter().find(|(name, _)| *name == model) {
            return parse(&Document::from_text(Path::new(&format!("built-in {name}")), text));
        }
        let path = paths::inside(campaign_dir, model).map_err(|found| {
            let names = BUILT_IN.map(|(name, _)| name).join(", ");
            let remedy = match closest(model, BUILT_IN.map(|(name, _)| name)) {
                Some(near) => format!("did you mean {near}?"),
                None => format!(
                    "built-in robots: {names}; else {}",
                    found.remedy.unwrap_or_default()
                ),
            };
            InputError::new(format!("no built-in robot, and as a file: {}", found.problem))
                .file(campaign_file(campaign_dir))
                .key(ROBOT_KEY)
                .remedy(remedy)
        })?;
        parse(&Document::read(&path)?)
    }
}

fn parse(document: &Document) -> Result<RobotSpec> {
    document.parse(&names(&keys::ROBOT_FILE), |top| {
        let joints: Vec<JointSpec> = top
            .sections("joint", &names(&keys::JOINT))?
            .iter()
            .map(joint)
            .collect::<Result<_>>()?;
        if joints.is_empty() {
            return Err(top
                .error("joint", "missing: the robot has no joint")
                .remedy("add a [[joint]] for each axis, base first")
                .into());
        }
        let links: Vec<LinkSpec> = top
            .sections("link", &names(&keys::LINK))?
            .iter()
            .map(link)
            .collect::<Result<_>>()?;
        if links.len() != joints.len() {
            return Err(top
                .error(
                    "link",
                    format!("there are {} joints, but {} links", joints.len(), links.len()),
                )
                .remedy("write one [[link]] for each [[joint]]: link i is what joint i carries")
                .into());
        }
        if links.iter().map(|link| link.mass_kg).sum::<f64>() <= 0.0 {
            return Err(top
                .error("link", "no link has any mass, so nothing can vibrate")
                .remedy("give mass_kg from the data sheet or an estimate")
                .into());
        }
        Ok(RobotSpec {
            name: top.text("name")?.unwrap_or("robot").to_string(),
            joints,
            links,
            tool: tool(top)?,
        })
    })
}

fn joint(joint: &Section<'_>) -> Result<JointSpec> {
    let number = |key: &str, bounds, example| joint.required(key, joint.number(key, bounds)?, example);
    let limits_deg: Option<[f64; 2]> = joint.array("limits_deg", "[-170.0, 170.0]")?;
    if let Some([low, high]) = limits_deg.filter(|[low, high]| low >= high) {
        return Err(joint
            .error("limits_deg", format!("run from {low} to {high} degrees"))
            .remedy("first the lower, then the upper limit")
            .into());
    }
    Ok(JointSpec {
        d_m: number("d_m", Bounds::ANY, "0.0")?,
        a_m: number("a_m", Bounds::ANY, "0.0")?,
        alpha_rad: number("alpha_deg", Bounds::ANY, "0.0")?.to_radians(),
        offset_rad: joint
            .number("offset_deg", Bounds::ANY)?
            .unwrap_or(0.0)
            .to_radians(),
        // The stiffness 1/c has to be a number too.
        compliance_rad_per_nm: number("compliance_rad_per_nm", Bounds::closed(1e-30, 1e30), "1.0e-6")?,
        limits_rad: limits_deg.map(|limits| limits.map(f64::to_radians)),
    })
}

fn link(link: &Section<'_>) -> Result<LinkSpec> {
    let mass_kg = link.required("mass_kg", link.number("mass_kg", Bounds::NOT_NEGATIVE)?, "10.0")?;
    let example = "[0.1, 0.1, 0.1]";
    let inertia_kg_m2 = link.required("inertia_kg_m2", link.array("inertia_kg_m2", example)?, example)?;
    if inertia_kg_m2.iter().any(|moment| *moment < 0.0) {
        return Err(link
            .error("inertia_kg_m2", "a moment of inertia is negative")
            .remedy("give the three principal moments about the centre of mass")
            .into());
    }
    Ok(LinkSpec {
        mass_kg,
        inertia_kg_m2,
        com_m: link.array("com_m", "[0.0, 0.0, 0.0]")?,
        section: section(link)?,
    })
}

fn section(link: &Section<'_>) -> Result<Option<BeamSection>> {
    let (outer, wall) = ("section_outer_diameter_m", "section_wall_m");
    if !link.has(outer) && !link.has(wall) {
        return Ok(None);
    }
    let outer_diameter_m = link.required(outer, link.number(outer, Bounds::POSITIVE)?, "0.3")?;
    let thickest = Bounds::above_up_to(0.0, outer_diameter_m / 2.0);
    let wall_m = link.required(wall, link.number(wall, thickest)?, "0.02")?;
    Ok(Some(BeamSection {
        outer_diameter_m,
        wall_m,
    }))
}

fn tool(top: &Section<'_>) -> Result<ToolFrame> {
    let keys = names(&keys::TOOL_FRAME);
    let Some(tool) = top.section("tool", &keys)? else {
        return Ok(ToolFrame::default());
    };
    Ok(ToolFrame {
        tcp_in_flange_m: tool.array(keys[0], "[0.0, 0.0, 0.0]")?.unwrap_or_default(),
        tilt_about_flange_y_rad: tool.number(keys[1], Bounds::ANY)?.unwrap_or(0.0).to_radians(),
    })
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use approx::assert_relative_eq;

    use super::*;

    fn read(text: &str) -> Result<RobotSpec> {
        parse(&Document::from_text(Path::new("robot.toml"), text))
    }

    #[test]
    fn the_built_in_robot_is_the_thesis_robot() {
        let robot = RobotSpec::load("irb6640", Path::new("nowhere")).unwrap();
        assert_eq!((robot.joints.len(), robot.links.len()), (6, 6));
        assert_relative_eq!(robot.joints[1].offset_rad, -FRAC_PI_2);
        assert_eq!(robot.joints[4].compliance_rad_per_nm, 0.42e-5);
        assert_eq!(robot.tool.tcp_in_flange_m, [0.1989, 0.0, 0.5599]);
        let mass: f64 = robot.links.iter().map(|l| l.mass_kg).sum();
        assert_relative_eq!(mass, 1119.37979083, epsilon = 1e-8);
        // Sections as physics.md §2 estimates them: link 5 has no length and stays rigid.
        let sections: Vec<_> = robot
            .links
            .iter()
            .map(|l| l.section.map(|s| (s.outer_diameter_m, s.wall_m)))
            .collect();
        assert_eq!(sections[0], Some((0.45, 0.03)));
        assert_eq!(sections[3], Some((0.24, 0.018)));
        assert_eq!(sections[4], None);
        assert!(robot.joints.iter().all(|j| j.limits_rad.is_some()));
    }

    #[test]
    fn what_a_robot_file_lacks_is_named() {
        let joint = "[[joint]]\nd_m = 1\na_m = 0\nalpha_deg = 0\ncompliance_rad_per_nm = 1e-6\n";
        let link = "[[link]]\nmass_kg = 2\ninertia_kg_m2 = [1, 1, 1]\n";
        assert!(read(&format!("{joint}{link}")).is_ok());
        for (text, words) in [
            (joint.to_string(), "there are 1 joints, but 0 links"),
            (link.to_string(), "no joint"),
            (
                format!("{joint}limits_deg = [3, -3]\n{link}"),
                "robot.toml:6: joint[0].limits_deg",
            ),
            (
                format!("{joint}{link}section_wall_m = 0.1\n"),
                "link[0].section_outer_diameter_m: missing",
            ),
            (
                format!("{joint}{link}section_outer_diameter_m = 0.1\nsection_wall_m = 0.06\n"),
                "link[0].section_wall_m: is 0.06",
            ),
            (
                joint.replace("1e-6", "0.0") + link,
                "joint[0].compliance_rad_per_nm: is 0.0",
            ),
            (joint.replace("1e-6", "-inf") + link, "not a finite number"),
            (
                format!("{joint}{}", link.replace("= 2", "= -2")),
                "robot.toml:7: link[0].mass_kg: is -2",
            ),
            (
                format!("{joint}{}", link.replace("= 2", "= 0")),
                "no link has any mass",
            ),
            (format!("{joint}{}", link.replace("[1,", "[-1,")), "negative"),
            (
                format!("{joint}ofset_deg = 1\n{link}"),
                "did you mean offset_deg?",
            ),
        ] {
            let message = read(&text).unwrap_err().to_string();
            assert!(message.contains(words), "{message}");
        }
    }
}
