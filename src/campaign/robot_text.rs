//! A robot as the text of a robot file; what [`RobotSpec::load`] reads back.

use std::fmt::Write;

use crate::data::{JointSpec, LinkSpec, RobotSpec};
use crate::text::{quoted, to_degrees};

fn list(values: &[f64]) -> String {
    let all: Vec<String> = values.iter().map(|v| format!("{:?}", v + 0.0)).collect();
    format!("[{}]", all.join(", "))
}

impl RobotSpec {
    /// The robot file of this robot; `notes` stand as comments at its head, guesses under `guesses` and next to the values.
    pub fn to_toml(&self, notes: &[String]) -> String {
        let mut text = String::new();
        for note in notes {
            let _ = writeln!(text, "# {}", note.replace(['\n', '\r'], " "));
        }
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
        for joint in &self.joints {
            self.joint(joint, &mut text);
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
        for link in &self.links {
            write_link(link, &mut text);
        }
        text
    }

    fn joint(&self, joint: &JointSpec, text: &mut String) {
        *text += "\n[[joint]]\n";
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
        let mark = match self.guesses.iter().any(|guess| guess.contains("compliance")) {
            true => "  # a guess, see above",
            false => "",
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
    *text += "\n[[link]]\n";
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
    if let Some(section) = link.section {
        let _ = write!(
            text,
            "section_outer_diameter_m = {:?}\nsection_wall_m = {:?}\n",
            section.outer_diameter_m, section.wall_m
        );
    }
}
