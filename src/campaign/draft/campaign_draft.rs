//! The file in the making: its tables, what is missing, what was guessed, and how it is written.

use std::path::{Path, PathBuf};

use super::answers::Answers;
use super::entry::{DraftTable, Entry};
use super::found::Scan;
use super::tables;
use crate::campaign::form::paths::campaign_file;
use crate::campaign::schema::Campaign;
use crate::files::{write_atomically, write_new};
use crate::text::quoted;
use crate::text::shown_briefly as shown;
use crate::{Error, InputError, Result};

/// A campaign file in the making.
#[derive(Debug, Clone)]
pub struct Draft {
    /// Name of the campaign.
    pub name: String,
    /// Sections, in the order of the file.
    pub tables: Vec<DraftTable>,
}

/// Something that nobody has said yet.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Missing {
    /// `cut`, `posture`, …
    pub table: &'static str,
    /// Key of `campaign.toml`.
    pub key: &'static str,
    /// What it is, with its unit.
    pub what: &'static str,
    /// A value as it may be typed.
    pub example: &'static str,
    /// Of which of the tables; empty where there is one.
    pub of: Vec<String>,
}

/// Something that was concluded from a name, or taken for usual.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Guess {
    /// Kind and name of the table: `cut 01`; the kind alone where there is one.
    pub table: String,
    /// Key of `campaign.toml`.
    pub key: String,
    /// The value that was taken, as TOML.
    pub value: String,
    /// What it was concluded from.
    pub why: String,
}

/// Times a question is put again after an answer that cannot be used.
const PATIENCE: usize = 3;

impl Draft {
    /// # Errors
    /// An answer that is not of its key's form, or about something that is not there.
    pub fn new(name: &str, scan: &Scan, answers: &Answers) -> Result<Draft> {
        let draft = Draft::as_far_as_it_applies(name, scan, answers)?;
        let tables = &draft.tables;
        for kind in ["posture", "point", "cut"] {
            let there: Vec<&str> = tables
                .iter()
                .filter(|t| t.kind == kind)
                .map(|t| t.name.as_str())
                .collect();
            if let Some(stranger) = answers.names(kind).into_iter().find(|n| !there.contains(n)) {
                let remedy = match there.as_slice() {
                    [] => format!("no file in the folder has a {kind}"),
                    there => format!("the files have: {}", shown(&there.join(", "))),
                };
                return Err(
                    InputError::new(format!("the files have no {kind} {:?}", shown(stranger)))
                        .key(kind)
                        .remedy(remedy)
                        .into(),
                );
            }
        }
        Ok(draft)
    }

    /// As [`new`](Self::new); answers about what is not there are passed over.
    ///
    /// # Errors
    /// An answer that is not of its key's form.
    pub fn as_far_as_it_applies(name: &str, scan: &Scan, answers: &Answers) -> Result<Draft> {
        Ok(Draft {
            name: name.to_string(),
            tables: tables::of(scan, answers)?,
        })
    }

    /// What is missing, alike things together, in the order of the file.
    pub fn missing(&self) -> Vec<Missing> {
        let mut missing: Vec<Missing> = Vec::new();
        for table in &self.tables {
            for entry in table.entries.iter().filter(|e| e.is_missing()) {
                let same = |m: &&mut Missing| m.table == table.kind && m.key == entry.key;
                match missing.iter_mut().find(same) {
                    Some(m) => m.of.push(table.name.clone()),
                    None => missing.push(Missing {
                        table: table.kind,
                        key: entry.key,
                        what: entry.what,
                        example: entry.example,
                        of: vec![table.name.clone()],
                    }),
                }
            }
        }
        missing
    }

    /// Every value that nobody gave, in the order of the file.
    pub fn guesses(&self) -> Vec<Guess> {
        let of_table = |table: &DraftTable| -> Vec<Guess> {
            let guessed = table.entries.iter().filter_map(|e| {
                Some(Guess {
                    table: [table.kind, &table.name].join(" ").trim_end().to_string(),
                    key: e.key.to_string(),
                    value: e.value_text()?,
                    why: e.guessed.clone()?,
                })
            });
            guessed.collect()
        };
        self.tables.iter().flat_map(of_table).collect()
    }

    /// Puts what is missing as questions; an empty answer leaves it open. `ask` gets a question and an example.
    ///
    /// # Errors
    /// Those of `ask`.
    pub fn ask(&mut self, ask: &mut dyn FnMut(&str, &str) -> Result<String>) -> Result<()> {
        for missing in self.missing() {
            if missing.of.len() > 1 {
                let question = format!(
                    "all {} {}s: {} (empty: one by one)",
                    missing.of.len(),
                    missing.table,
                    missing.what
                );
                // Postures and points differ from each other; cuts, files and channels often do not.
                let alike = ["cut", "frf", "channel"].contains(&missing.table);
                if alike && self.put(&missing, &missing.of, &question, ask)? {
                    continue;
                }
            }
            for name in &missing.of {
                let question = match name.is_empty() {
                    true => missing.what.to_string(),
                    false => format!("{} {name}: {}", missing.table, missing.what),
                };
                self.put(&missing, std::slice::from_ref(name), &question, ask)?;
            }
        }
        Ok(())
    }

    /// Whether there was an answer.
    fn put(
        &mut self,
        missing: &Missing,
        names: &[String],
        question: &str,
        ask: &mut dyn FnMut(&str, &str) -> Result<String>,
    ) -> Result<bool> {
        let mut problem = String::new();
        for _ in 0..PATIENCE {
            let answer = ask(&format!("{problem}{question}"), missing.example)?;
            if answer.trim().is_empty() {
                return Ok(false);
            }
            let entries = self
                .tables
                .iter_mut()
                .filter(|t| t.kind == missing.table && names.contains(&t.name))
                .flat_map(|t| &mut t.entries)
                .filter(|e| e.key == missing.key);
            let mut given = Ok(());
            for entry in entries {
                given = given.and(entry.give(&answer));
            }
            match given {
                Ok(()) => return Ok(true),
                Err(what) => problem = format!("{what}; "),
            }
        }
        Ok(false)
    }

    /// The text of `campaign.toml`: what is missing is a comment that begins with `fill in`.
    pub fn toml(&self) -> String {
        let mut text = format!(
            "schema = \"lobestone/campaign/1\"\nname = {}\n",
            quoted(&self.name)
        );
        for table in &self.tables {
            // A section without a line of its own would only be in the way.
            let header = match table.repeated {
                true => format!("[[{}]]", table.kind),
                false => format!("[{}]", table.kind),
            };
            match table.entries.iter().any(Entry::is_given) || table.entries.iter().any(Entry::is_missing) {
                true => text += &format!("\n{header}\n"),
                false => text += &format!("\n# {header}\n"),
            }
            for entry in &table.entries {
                text += &entry.lines();
            }
        }
        text
    }

    /// Whether the file to be is a valid campaign file; nothing is written.
    ///
    /// # Errors
    /// What is wrong with it. (Where something is missing nobody can tell yet.)
    pub fn check(&self, dir: &Path) -> Result<()> {
        match self.missing().is_empty() {
            true => Campaign::from_text(dir, &self.toml())
                .map(|_| ())
                .map_err(as_given),
            false => Ok(()),
        }
    }

    /// Writes the file and gives its path.
    ///
    /// # Errors
    /// Those of [`check`](Self::check); there is one already, and it is not to be replaced; what the file system refuses.
    pub fn write(&self, dir: &Path, replace: bool) -> Result<PathBuf> {
        self.check(dir)?;
        let (file, text) = (campaign_file(dir), self.toml());
        if replace {
            write_atomically(&file, text.as_bytes())?;
        } else if !write_new(&file, text.as_bytes())? {
            return Err(InputError::new("is there already; nothing was changed")
                .file(&file)
                .into());
        }
        Ok(file)
    }
}

/// What is wrong with a file that was not written.
fn as_given(error: Error) -> Error {
    match error {
        Error::Input(e) => {
            let mut told = InputError::new(format!("{} (nothing was written)", e.problem));
            told.key = e.key;
            told.remedy = e.remedy;
            told.into()
        }
        other => other,
    }
}

/// The name of a folder: what its campaign is called where nobody says otherwise.
pub fn folder_name(dir: &Path) -> String {
    let full = dir.canonicalize().unwrap_or_else(|_| dir.to_path_buf());
    full.file_name()
        .map_or_else(|| "campaign".into(), |n| n.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::super::found::{FoundForce, FoundFrf};
    use super::super::names;
    use super::*;
    use crate::data::Quantity;

    fn scan_of(frfs: &[(&str, &[i64])], forces: &[&str]) -> Scan {
        Scan {
            frfs: frfs
                .iter()
                .map(|(posture, nodes)| FoundFrf {
                    path: format!("frf/{posture}.uff"),
                    posture: posture.to_string(),
                    posture_guess: None,
                    quantity: Some(Quantity::Accelerance),
                    nodes: nodes.iter().copied().collect(),
                    facts: Default::default(),
                })
                .collect(),
            forces: forces
                .iter()
                .map(|name| FoundForce {
                    path: format!("force/{name}.txt"),
                    from_name: names::facts_of(name),
                    from_header: Default::default(),
                    part: None,
                    says_times: true,
                })
                .collect(),
            ..Scan::default()
        }
    }

    fn keys(missing: &[Missing]) -> Vec<(&str, &str, usize)> {
        missing.iter().map(|m| (m.table, m.key, m.of.len())).collect()
    }

    #[test]
    fn what_the_files_do_not_say_is_missing_once_for_all() {
        let scan = scan_of(
            &[("p1", &[1, 2]), ("p2", &[1, 2])],
            &["cut01_n1200", "cut02_n900"],
        );
        let mut answers = Answers::default();
        answers.set("robot", "model", "irb6640");
        answers.set("cut", "process", "milling");
        let draft = Draft::new("cell", &scan, &answers).unwrap();
        assert_eq!(
            keys(&draft.missing()),
            [
                ("point", "body", 2),
                ("posture", "joints_deg", 2),
                ("tool", "diameter_mm", 1),
                ("tool", "teeth", 1),
                ("tool", "helix_deg", 1),
                ("cut", "feed_per_tooth_mm", 2),
                ("cut", "axial_depth_mm", 2),
                ("cut", "immersion", 2),
            ]
        );
        let text = draft.toml();
        assert!(
            text.contains("spindle_rpm = 1200.0  # guessed: from the file name"),
            "{text}"
        );
        assert!(text.contains("# fill in: joints_deg = …"), "{text}");
    }

    #[test]
    fn the_cuts_of_one_file_are_written_with_their_channels() {
        use crate::ingest::{MatArray, mat5_bytes};
        let folder = tempfile::tempdir().unwrap();
        let values: Vec<f64> = (0..600).map(|i| f64::from(i % 7)).collect();
        let names = ["Fx_R_1", "Fy_R_1", "Fx_R_2", "Fy_R_2"];
        let arrays: Vec<MatArray> = names.iter().map(|n| MatArray::column(n, &values)).collect();
        std::fs::write(folder.path().join("all.mat"), mat5_bytes(&arrays)).unwrap();
        let scan = super::super::scan::scan(folder.path()).unwrap();
        assert!(scan.not_used.is_empty(), "{:?}", scan.not_used);
        let mut answers = Answers::default();
        answers.set("cut", "process", "milling");
        answers.set("channel", "rate_hz", "5000");
        let draft = Draft::new("cell", &scan, &answers).unwrap();
        let text = draft.toml();
        for id in ["R_1", "R_2"] {
            let cut = format!("[[cut]]\nid = \"{id}\"\nfile = \"all.mat\"");
            assert!(text.contains(&cut), "{text}");
            let channel = format!("name = \"fy\"\nin_file = \"Fy_{id}\"\ncut = \"{id}\"\nrate_hz = 5000");
            assert!(text.contains(&channel), "{text}");
        }
        assert!(draft.missing().iter().all(|m| m.table != "channel"));
    }

    #[test]
    fn a_turned_diameter_that_was_given_is_no_guess() {
        let scan = scan_of(&[], &["cut01"]);
        let mut answers = Answers::default();
        answers.set("cut", "process", "turning");
        answers.set("tool", "diameter_mm", "60");
        let draft = Draft::new("lathe", &scan, &answers).unwrap();
        assert!(draft.toml().contains("diameter_mm = 60"), "{}", draft.toml());
        assert!(draft.guesses().iter().all(|g| g.key != "diameter_mm"));
    }

    #[test]
    fn questions_are_put_until_all_is_said() {
        let scan = scan_of(&[("p1", &[1])], &["cut01", "cut02"]);
        let mut draft = Draft::new("cell", &scan, &Answers::default()).unwrap();
        let mut asked = Vec::new();
        draft
            .ask(&mut |question, _| {
                asked.push(question.to_string());
                let answer = match question {
                    q if q.starts_with("robot model") => "irb6640",
                    q if q.contains("joint angles") => "135 -2 53; 83, 30 -117",
                    q if q.contains("process") => "milling",
                    q if q.contains("endmill, ballend, drill") => "endmill",
                    q if q.contains("number of teeth") && asked.len() < 6 => "many",
                    q if q.contains("teeth") => "6",
                    q if q.contains("immersion") => "0 90",
                    q if q.starts_with("all 2 cuts: spindle speed") => "",
                    q if q.starts_with("cut 02: spindle speed") => "900,5",
                    _ => "2",
                };
                Ok(answer.to_string())
            })
            .unwrap();
        assert_eq!(draft.missing(), []);
        let text = draft.toml();
        for part in [
            "joints_deg = [135.0, -2.0, 53.0, 83.0, 30.0, -117.0]",
            "start_deg = 0.0\nexit_deg = 90.0",
            "spindle_rpm = 2.0\n",
            "spindle_rpm = 900.5\n",
            "teeth = 6\n",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert!(asked.iter().any(|q| q.starts_with("cut 01: spindle speed")));
        let twice = asked.iter().filter(|q| q.contains("number of teeth"));
        assert_eq!(twice.count(), 2, "asked again after \"many\"");
    }

    #[test]
    fn an_answer_that_is_none_is_an_error_and_so_is_one_about_a_stranger() {
        let scan = scan_of(&[("p1", &[1])], &[]);
        let mut answers = Answers::default();
        answers.set("posture p1", "joints_deg", "up");
        let error = Draft::new("cell", &scan, &answers).unwrap_err().to_string();
        assert!(error.contains("joints_deg") && error.contains("up"), "{error}");
        let mut answers = Answers::default();
        answers.set("posture p9", "joints_deg", "1 2 3");
        let error = Draft::new("cell", &scan, &answers).unwrap_err().to_string();
        assert!(
            error.contains("no posture \"p9\"") && error.contains("p1"),
            "{error}"
        );
    }
}
