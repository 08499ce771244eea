//! The file next to a URDF that holds what a URDF has no place for (`lobestone model --urdf` writes it): joint compliances and the
//! sections of links.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;

use crate::Result;
use crate::campaign::form::bounds::Bounds;
use crate::campaign::form::document::Document;
use crate::campaign::form::keys;
use crate::campaign::form::section::Section;
use crate::campaign::robot_file::section;
use crate::campaign::robot_text::section_text;
use crate::data::{BeamSection, RobotSpec};
use crate::robot::urdf::{Names, Sources, behind_axis};
use crate::text::{listed, quoted, to_degrees};

/// Where the file next to a URDF is: `robot.urdf`, `robot.compliances.toml`.
pub fn beside(urdf: &Path) -> PathBuf {
    urdf.with_extension("compliances.toml")
}

/// A file next to a URDF, read.
#[derive(Debug)]
pub struct BesideUrdf {
    document: Document,
}

/// What a file next to a URDF said.
#[derive(Debug, Clone)]
pub struct SaidBeside {
    /// Its name, without folder.
    pub file_name: String,
    /// Where its values are from, for people.
    pub source: Option<String>,
    /// What it holds that a robot file has no place for, for people.
    pub notes: Vec<String>,
}

const TOP: [&str; 8] = [
    "robot",
    "source",
    "guesses",
    "left_out",
    "damping_ratio",
    "young_pa",
    "joint",
    "link",
];
const JOINT: [&str; 3] = ["name", "compliance_rad_per_nm", "limits_deg"];
const NOT_OF_A_SECTION: [&str; 4] = ["mass_kg", "inertia_kg_m2", "products_kg_m2", "com_m"];

const REMEDY: &str = "write both files again (`lobestone model DIR --urdf FILE`), correct this one, or move it away: compliances are \
     guessed then";

impl BesideUrdf {
    /// The file next to `urdf`; `None` where there is none.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn find(urdf: &Path) -> Result<Option<Self>> {
        let file = beside(urdf);
        match file.symlink_metadata() {
            Ok(_) => Ok(Some(BesideUrdf {
                document: Document::read(&file)?,
            })),
            Err(_) => Ok(None),
        }
    }

    /// Gives the robot that was read of the URDF its compliances and sections, by the names of joints and links. `urdf` is what errors call that.
    ///
    /// # Errors
    /// A broken file, and one that knows a joint of the robot not at all or twice; with file, line, key and remedy.
    pub fn apply(&self, urdf: &Path, spec: &mut RobotSpec) -> Result<SaidBeside> {
        let name_of = |path: &Path| {
            path.file_name()
                .map(|n| n.to_string_lossy().into_owned())
                .unwrap_or_default()
        };
        spec.forget_guessed_compliances();
        self.document.parse(&TOP, |top| {
            let joints = by_name(top, "joint", &JOINT)?;
            for joint in &mut spec.joints {
                let name = joint.name.as_deref().unwrap_or_default();
                let Some(said) = joints.get(name) else {
                    let known: Vec<String> = joints.keys().map(|k| format!("{k:?}")).collect();
                    return Err(top
                        .error("joint", format!("says nothing of joint {name:?}, which {} has", name_of(urdf)))
                        .remedy(format!("it knows {}; {REMEDY}", listed(&known)))
                        .into());
                };
                let key = JOINT[1];
                let compliance = said.number(key, Bounds::closed(1e-30, 1e30))?;
                joint.compliance_rad_per_nm =
                    compliance.ok_or_else(|| said.error(key, "missing").remedy(REMEDY))?;
            }
            let of_section = keys::names(&keys::LINK);
            let of_section: Vec<&str> = of_section.into_iter().filter(|k| !NOT_OF_A_SECTION.contains(k)).collect();
            let links = by_name(top, "link", &of_section)?;
            for link in &mut spec.links {
                let said = links.get(link.name.as_deref().unwrap_or_default());
                let said: Option<BeamSection> = said.map(section).transpose()?.flatten();
                link.section = said;
            }
            spec.guesses.extend(top.texts("guesses")?.unwrap_or_default());
            let mut notes = Vec::new();
            if let Some(ratio) = top.number("damping_ratio", Bounds::POSITIVE)? {
                notes.push(format!("damping ratio {:.2} %", 100.0 * ratio));
            }
            if let Some(young) = top.number("young_pa", Bounds::POSITIVE)? {
                notes.push(format!(
                    "Young's modulus of the links {:.1} GPa (`model --young-pa`, or the effect link-flexibility)",
                    1e-9 * young
                ));
            }
            notes.extend(top.texts("left_out")?.unwrap_or_default().into_iter().map(|e| format!("the effect {e}")));
            Ok(SaidBeside {
                file_name: name_of(self.document.file()),
                source: top.text("source")?.map(str::to_string),
                notes,
            })
        })
    }
}

/// The tables `[[key]]` by their `name`.
fn by_name<'d>(top: &Section<'d>, key: &str, keys: &[&str]) -> Result<BTreeMap<String, Section<'d>>> {
    let mut all = BTreeMap::new();
    for table in top.sections(key, keys)? {
        let name = table.text("name")?;
        let name = name
            .ok_or_else(|| table.error("name", "missing").remedy(REMEDY))?
            .to_string();
        if all.contains_key(&name) {
            let problem = format!("{name:?} is there twice");
            return Err(table.error("name", problem).remedy(REMEDY).into());
        }
        all.insert(name, table);
    }
    Ok(all)
}

/// What a URDF cannot hold, as TOML: compliance of each joint, section of each link, damping ratio, Young's modulus. Links are in the
/// frames of the URDF.
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
    let names = Names::new(spec);
    for (joint, name) in spec.joints.iter().zip(&names.joints) {
        let _ = write!(
            text,
            "\n[[joint]]\nname = {}\ncompliance_rad_per_nm = {:?}\n",
            quoted(name),
            joint.compliance_rad_per_nm
        );
        if let Some(limits) = joint.limits_rad {
            let [low, high] = limits.map(to_degrees);
            let _ = writeln!(text, "limits_deg = [{low:?}, {high:?}]");
        }
    }
    for ((link, joint), name) in spec.links.iter().zip(&spec.joints).zip(&names.links) {
        let Some(section) = &link.section else { continue };
        let axis = section.shape.height_axis().unwrap_or_default();
        let turned = BeamSection {
            shape: section
                .shape
                .with_height_axis((behind_axis(joint).rotation * Vector3::from(axis)).into()),
            ..*section
        };
        let _ = write!(
            text,
            "\n[[link]]\nname = {}\n{}",
            quoted(name),
            section_text(&turned)
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::SectionShape;
    use crate::robot::fixture::{TAP_POSTURES, irb6640};
    use crate::robot::frf::natural_frequencies_hz;
    use crate::robot::urdf::{Request, read, urdf};
    use crate::robot::{Baseline, Dual, RobotModel};

    fn sources() -> Sources {
        Sources {
            source: "calibrated on a test".into(),
            damping_ratio: 0.02,
            young_pa: Some(70e9),
            left_out: Vec::new(),
        }
    }

    /// The IRB 6640 with sections of every kind, one turned askew.
    fn with_sections() -> RobotModel {
        let mut spec = irb6640();
        let height_axis = [0.2, 0.9, 0.4];
        let mut section = BeamSection::tube(0.3, 0.02);
        section.shape = SectionShape::Box {
            width_m: 0.2,
            height_m: 0.3,
            wall_m: 0.01,
            height_axis,
        };
        spec.links[1].section = Some(section);
        spec.links[3].section = Some(BeamSection {
            shape: SectionShape::General {
                area_m2: 4e-3,
                second_moment_y_m4: 3e-5,
                second_moment_z_m4: 1e-5,
                torsion_constant_m4: 2e-5,
                height_axis,
            },
            young_pa: Some(180e9),
            shear_pa: Some(60e9),
        });
        RobotModel::new(spec)
    }

    /// Written and read back with the file next to it, a robot has the same frequencies, with links that bend any way, and nothing in it
    /// is a guess.
    #[test]
    fn both_files_together_are_the_robot() {
        let robot = with_sections();
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("out.urdf");
        let text = urdf(&robot, &sources());
        std::fs::write(beside(&file), compliances(&robot.spec, &sources())).unwrap();
        let mut found = read(&file, &text, &Request::default()).unwrap();
        let said = BesideUrdf::find(&file).unwrap().unwrap();
        let said = said.apply(&file, &mut found.spec).unwrap();
        assert_eq!(found.spec.guesses, Vec::<String>::new());
        assert_eq!(said.file_name, "out.compliances.toml");
        assert_eq!(said.source.as_deref(), Some("calibrated on a test"));
        let back = RobotModel::new(found.spec);
        for posture in &TAP_POSTURES {
            let frequencies = |robot: &RobotModel| {
                let mut baseline = Baseline::nominal(&robot.spec);
                baseline.young_pa = Some(Dual::constant(70e9));
                let kinematics = robot.kinematics(posture).unwrap();
                natural_frequencies_hz(&robot.chain(&kinematics, &baseline).system(0)).unwrap()
            };
            for (a, b) in frequencies(&robot).iter().zip(&frequencies(&back)).take(12) {
                approx::assert_relative_eq!(a, b, max_relative = 1e-9);
            }
        }
    }

    #[test]
    fn a_file_of_another_robot_is_refused() {
        let robot = RobotModel::new(irb6640());
        let text = urdf(&robot, &sources());
        let whole = compliances(&robot.spec, &sources());
        for (beside_text, words) in [
            (
                whole.replace("\"joint_2\"", "\"elbow\""),
                "says nothing of joint \"joint_2\", which out.urdf has",
            ),
            (
                whole.replace("\"joint_2\"", "\"joint_1\""),
                "joint[1].name: \"joint_1\" is there twice",
            ),
            (
                whole.replacen("compliance_rad_per_nm = ", "compliance_rad_per_nm = -", 1),
                "joint[0].compliance_rad_per_nm: is -",
            ),
            (whole.replace("[[joint]]", "[[joint"), "not valid TOML"),
            (whole.replace("section_wall_m", "wall_m"), "unknown key"),
        ] {
            let folder = tempfile::tempdir().unwrap();
            let file = folder.path().join("out.urdf");
            std::fs::write(beside(&file), beside_text).unwrap();
            let mut found = read(&file, &text, &Request::default()).unwrap();
            let applied =
                BesideUrdf::find(&file).and_then(|beside| beside.unwrap().apply(&file, &mut found.spec));
            let message = applied.unwrap_err().to_string();
            assert!(
                message.contains(words)
                    && message.contains("out.compliances.toml:")
                    && message.contains("remedy"),
                "{message}"
            );
        }
    }
}
