//! A robot as the text of a robot file; what [`RobotSpec::load`] reads back.

use std::fmt::Write;

use crate::data::{BeamSection, JointSpec, LinkSpec, RobotSpec, SectionShape};
use crate::text::{quoted, to_degrees};

fn list(values: &[f64]) -> String {
    let all: Vec<String> = values.iter().map(|v| format!("{:?}", v + 0.0)).collect();
    format!("[{}]", all.join(", "))
}

/// What stands in a robot file for people only.
#[derive(Debug, Clone, Default)]
pub struct RobotComments {
    /// At the head of the file.
    pub head: Vec<String>,
    /// Above the numbers of each joint; joints beyond have none.
    pub joints: Vec<Vec<String>>,
    /// Likewise of each link.
    pub links: Vec<Vec<String>>,
    /// Behind each joint's compliance; `None`: that it is a guess, where it is one.
    pub compliance: Option<String>,
}

fn comments<'a>(lines: impl IntoIterator<Item = &'a String>, text: &mut String) {
    for line in lines {
        let _ = writeln!(text, "# {}", line.replace(['\n', '\r'], " "));
    }
}

impl RobotSpec {
    /// The robot file of this robot; guesses stand under `guesses` and next to the values.
    pub fn to_toml(&self, about: &RobotComments) -> String {
        let mut text = String::new();
        comments(&about.head, &mut text);
        let _ = writeln!(text, "name = {}", quoted(&self.name));
        if !self.guesses.is_empty() {
            let all: Vec<String> = self
                .guesses
                .iter()
                .map(|g| format!("  {},\n", quoted(g)))
                .collect();
            let _ = write!(
                text,
                "# Told wherever these values are used; take a sentence out when its values are known.\nguesses = [\n{}]\n",
                all.concat()
            );
        }
        for (i, joint) in self.joints.iter().enumerate() {
            text += "\n[[joint]]\n";
            comments(about.joints.get(i).into_iter().flatten(), &mut text);
            self.joint(joint, about.compliance.as_deref(), &mut text);
        }
        let tool = &self.tool;
        let _ = write!(
            text,
            "\n[tool]\ntcp_in_flange_m = {}\n",
            list(&tool.tcp_in_flange_m)
        );
        if tool.rpy_in_flange_rad != [0.0; 3] {
            let rpy = tool.rpy_in_flange_rad.map(to_degrees);
            let _ = writeln!(text, "rpy_in_flange_deg = {}", list(&rpy));
        } else if tool.tilt_about_flange_y_rad != 0.0 {
            let tilt = to_degrees(tool.tilt_about_flange_y_rad);
            let _ = writeln!(text, "tilt_about_flange_y_deg = {tilt:?}");
        }
        for (i, link) in self.links.iter().enumerate() {
            text += "\n[[link]]\n";
            comments(about.links.get(i).into_iter().flatten(), &mut text);
            write_link(link, &mut text);
        }
        text
    }

    fn joint(&self, joint: &JointSpec, compliance_from: Option<&str>, text: &mut String) {
        if let Some(name) = &joint.name {
            let _ = writeln!(text, "name = {}", quoted(name));
        }
        match &joint.placement {
            Some(placement) => {
                let _ = write!(
                    text,
                    "origin_m = {}\norigin_rpy_deg = {}\naxis = {}\n",
                    list(&placement.origin_m),
                    list(&placement.rpy_rad.map(to_degrees)),
                    list(&placement.axis)
                );
            }
            None => {
                let _ = write!(
                    text,
                    "d_m = {:?}\na_m = {:?}\nalpha_deg = {:?}\noffset_deg = {:?}\n",
                    joint.d_m,
                    joint.a_m,
                    to_degrees(joint.alpha_rad),
                    to_degrees(joint.offset_rad)
                );
            }
        }
        let mark = match compliance_from {
            Some(from) => format!("  # {from}"),
            None if self.compliances_are_guessed() => "  # a guess, see above".into(),
            None => String::new(),
        };
        let _ = writeln!(
            text,
            "compliance_rad_per_nm = {:?}{mark}",
            joint.compliance_rad_per_nm
        );
        if let Some(limits) = joint.limits_rad {
            let _ = writeln!(text, "limits_deg = {}", list(&limits.map(to_degrees)));
        }
    }
}

fn write_link(link: &LinkSpec, text: &mut String) {
    if let Some(name) = &link.name {
        let _ = writeln!(text, "name = {}", quoted(name));
    }
    let _ = write!(
        text,
        "mass_kg = {:?}\ninertia_kg_m2 = {}\n",
        link.mass_kg,
        list(&link.inertia_kg_m2)
    );
    if link.products_kg_m2 != [0.0; 3] {
        let _ = writeln!(text, "products_kg_m2 = {}", list(&link.products_kg_m2));
    }
    if let Some(com_m) = link.com_m {
        let _ = writeln!(text, "com_m = {}", list(&com_m));
    }
    if let Some(section) = &link.section {
        *text += &section_text(section);
    }
}

/// The keys of a `[[link]]` that say which beam it is.
pub(crate) fn section_text(section: &BeamSection) -> String {
    let mut text = match &section.shape {
        SectionShape::Tube {
            outer_diameter_m,
            wall_m,
        } => format!("section_outer_diameter_m = {outer_diameter_m:?}\nsection_wall_m = {wall_m:?}\n"),
        SectionShape::Box {
            width_m,
            height_m,
            wall_m,
            ..
        } => format!(
            "section_width_m = {width_m:?}\nsection_height_m = {height_m:?}\nsection_wall_m = {wall_m:?}\n"
        ),
        SectionShape::General {
            area_m2,
            second_moment_y_m4,
            second_moment_z_m4,
            torsion_constant_m4,
            ..
        } => format!(
            "section_area_m2 = {area_m2:?}\nsection_second_moment_y_m4 = {second_moment_y_m4:?}\n\
             section_second_moment_z_m4 = {second_moment_z_m4:?}\nsection_torsion_constant_m4 = {torsion_constant_m4:?}\n"
        ),
    };
    if let Some(axis) = section.shape.height_axis() {
        let _ = writeln!(text, "section_height_axis = {}", list(&axis));
    }
    for (key, modulus) in [("young_pa", section.young_pa), ("shear_pa", section.shear_pa)] {
        if let Some(pa) = modulus {
            let _ = writeln!(text, "{key} = {pa:?}");
        }
    }
    text
}
