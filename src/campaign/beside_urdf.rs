//! The file next to a URDF that holds what a URDF has no place for (`lobestone model --urdf` writes it): joint compliances and the
//! sections of links.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::Result;
use crate::campaign::form::bounds::Bounds;
use crate::campaign::form::document::Document;
use crate::campaign::form::keys;
use crate::campaign::form::section::Section;
use crate::campaign::robot_file::section;
use crate::data::{BeamSection, RobotSpec};
use crate::text::listed;

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

    /// Gives the robot of the URDF its compliances and sections, by the names of joints and links. `urdf` is what errors call that.
    ///
    /// # Errors
    /// A broken file, and one that knows a joint of the robot not at all or twice; with file, line, key and remedy.
    pub fn apply(&self, urdf: &Path, spec: &mut RobotSpec) -> Result<SaidBeside> {
        let name_of = |path: &Path| {
            path.file_name()
                .map(|n| n.to_string_lossy().into_owned())
                .unwrap_or_default()
        };
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
