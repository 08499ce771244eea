//! The beginning of the page of `serve`: a folder on this computer, or files that are dropped on the page, and the campaign
//! file that `init` would draft for them, to be completed on the page.

use std::collections::HashSet;
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard};

use serde_json::{Map, Value, json};

use crate::analysis::modes::stick_shapes;
use crate::campaign::campaign_file;
use crate::campaign::draft::{self, Answers, Draft, Form, Scan};
use crate::commands::begin::workbench::CampaignBench;
use crate::files::write_new;
use crate::progress::{Gauge, shown_on};
use crate::report::figure::posture_svg;
use crate::robot::{RobotModel, RobotSpec};
use crate::serve::{Entrance, EntranceRequest, Parcel, Reply, Wish, locked};
use crate::stop::{Stop, stoppable};
use crate::{Error, InputError, Result};

/// Names shown of a folder.
const MOST_NAMES: usize = 2000;
/// What may be dropped into one folder.
const MOST_FILES: u64 = 5000;
const MOST_BYTES: u64 = 2 << 30;
const LONGEST_NAME: usize = 200;
/// Folders deep, as far as [`draft::scan`] looks.
const DEEPEST: usize = 8;

/// Makes campaigns of folders.
#[derive(Default)]
pub struct Drafting(Mutex<State>);

#[derive(Default)]
struct State {
    /// The folder that is drafted for, and what lies in it.
    scanned: Option<(PathBuf, Arc<Scan>)>,
    /// Folders made here.
    made: HashSet<PathBuf>,
    /// Received since the beginning: files and bytes.
    received: (u64, u64),
    /// Folders whose files are being read.
    readings: Vec<FolderReading>,
}

/// A folder whose files are being read: how far that is, and how it is ended.
struct FolderReading {
    dir: PathBuf,
    gauge: Arc<Gauge>,
    stop: Stop,
}

fn wrong(path: &Path, problem: &str, remedy: &str) -> Error {
    InputError::new(problem).file(path).remedy(remedy).into()
}

/// Without symbolic links in it.
fn real_folder(path: &Path) -> Result<PathBuf> {
    match path.canonicalize() {
        Ok(real) if real.is_dir() => Ok(real),
        Ok(_) => Err(wrong(
            path,
            "is a file, not a folder",
            "give the folder that it lies in",
        )),
        Err(_) => Err(wrong(
            path,
            "there is no such folder",
            "choose one from the list, or correct what was typed",
        )),
    }
}

fn home() -> Option<PathBuf> {
    std::env::home_dir().filter(|home| home.is_dir())
}

/// `~` is the home folder, as in a terminal.
fn expanded(typed: &str) -> PathBuf {
    let rest = typed
        .trim()
        .strip_prefix('~')
        .map(|rest| rest.trim_start_matches(['/', '\\']));
    match (rest, home()) {
        (Some(rest), Some(home)) => home.join(rest),
        _ => PathBuf::from(typed.trim()),
    }
}

fn look(folder: Option<&str>) -> Result<Value> {
    let asked = match folder.filter(|f| !f.trim().is_empty()) {
        Some(typed) => expanded(typed),
        None => std::env::current_dir().map_err(|e| Error::io(".", e))?,
    };
    let dir = real_folder(&asked)?;
    let (mut folders, mut files) = (Vec::new(), Vec::new());
    for entry in std::fs::read_dir(&dir)
        .map_err(|e| Error::io(&dir, e))?
        .take(4 * MOST_NAMES)
    {
        let entry = entry.map_err(|e| Error::io(&dir, e))?;
        // What has no Unicode name cannot stand in a campaign file.
        let Ok(name) = entry.file_name().into_string() else {
            continue;
        };
        if name.starts_with('.') {
            continue;
        }
        match entry.path().is_dir() {
            true => folders.push(name),
            false => files.push(name),
        }
    }
    folders.sort_by_key(|name| name.to_lowercase());
    files.sort_by_key(|name| name.to_lowercase());
    let cut_short = folders.len().max(files.len()) > MOST_NAMES;
    folders.truncate(MOST_NAMES);
    files.truncate(MOST_NAMES);
    let folders: Vec<Value> = folders
        .into_iter()
        .map(|name| json!({ "name": name, "path": dir.join(&name), "campaign": campaign_file(&dir.join(&name)).is_file() }))
        .collect();
    Ok(json!({
        "folder": dir,
        "parent": dir.parent(),
        "home": home(),
        "campaign": campaign_file(&dir).is_file(),
        "folders": folders,
        "files": files,
        "cut_short": cut_short,
    }))
}

/// The parts of a name that stays below the folder it counts from.
///
/// # Errors
/// It does not, or no file can be called that on every system.
fn parts(name: &str) -> Result<Vec<&str>> {
    let refuse = || {
        Err(wrong(
            Path::new(name),
            "is no name of a file below the folder",
            "rename it",
        ))
    };
    let parts: Vec<&str> = name.split('/').collect();
    let usual = |part: &str| {
        let plain =
            !part.is_empty() && part.len() <= LONGEST_NAME && !part.starts_with('.') && !part.ends_with(' ');
        let free = !part.contains(|c: char| c.is_control() || "\\:*?\"<>|".contains(c));
        let alone = matches!(
            Path::new(part).components().collect::<Vec<_>>().as_slice(),
            [Component::Normal(_)]
        );
        plain && free && alone
    };
    match parts.iter().all(|part| usual(part)) && parts.len() <= DEEPEST {
        true => Ok(parts),
        false => refuse(),
    }
}

impl Drafting {
    fn state(&self) -> MutexGuard<'_, State> {
        locked(&self.0)
    }

    fn make_folder(&self, parent: &Path, name: &str) -> Result<Value> {
        let parent = real_folder(parent)?;
        let [name] = parts(name.trim())?[..] else {
            return Err(wrong(
                Path::new(name),
                "is not the name of one folder",
                "leave the / out",
            ));
        };
        let dir = parent.join(name);
        std::fs::create_dir(&dir).map_err(|e| match e.kind() {
            std::io::ErrorKind::AlreadyExists => wrong(
                &dir,
                "is there already; nothing was changed",
                "choose another name, or open that folder",
            ),
            _ => Error::io(&dir, e),
        })?;
        let dir = dir.canonicalize().map_err(|e| Error::io(&dir, e))?;
        self.state().made.insert(dir.clone());
        Ok(json!({ "folder": dir }))
    }

    /// What lies in a folder; read once, unless it is to be read `again`.
    fn scan(&self, dir: &Path, again: bool) -> Result<Arc<Scan>> {
        if let (Some((of, scan)), false) = (&self.state().scanned, again)
            && of == dir
        {
            return Ok(scan.clone());
        }
        let (gauge, stop) = (Arc::new(Gauge::default()), Stop::default());
        self.state().readings.push(FolderReading {
            dir: dir.to_path_buf(),
            gauge: gauge.clone(),
            stop: stop.clone(),
        });
        let read = stoppable(&stop, || shown_on(&gauge, || draft::scan(dir)));
        let mut state = self.state();
        state
            .readings
            .retain(|reading| !Arc::ptr_eq(&reading.gauge, &gauge));
        let scan = read?.unwrap_or_else(|| {
            let stopped = "cancelled while the files of the folder were read; nothing was written";
            Err(Error::computation(stopped))
        })?;
        let scan = Arc::new(scan);
        state.scanned = Some((dir.to_path_buf(), scan.clone()));
        Ok(scan)
    }

    /// Of the files of a folder; null where they are not being read.
    fn how_far(&self, dir: &Path) -> Value {
        let state = self.state();
        let reading = state.readings.iter().rev().find(|reading| reading.dir == dir);
        reading.map_or(Value::Null, |reading| json!(reading.gauge.reading()))
    }

    /// Ends reading the files of a folder; how often they were being read.
    fn stop_reading(&self, dir: &Path) -> usize {
        let state = self.state();
        let of_it = state.readings.iter().filter(|reading| reading.dir == dir);
        of_it.map(|reading| reading.stop.ask()).count()
    }

    fn draft(&self, wish: &Wish) -> Result<Drafted> {
        let dir = real_folder(&wish.dir)?;
        let all = self.scan(&dir, wish.again)?;
        let scan = all.without(&wish.left_out);
        let list = match &wish.cut_list {
            None => scan.cut_list().cloned(),
            Some(none) if none.is_empty() => None,
            // Only what the scan found: no path from outside is ever read.
            Some(named) => Some(
                scan.cut_lists
                    .iter()
                    .find(|l| l.ends_with(named))
                    .cloned()
                    .ok_or_else(|| {
                        wrong(
                            Path::new(named),
                            "is no list of cuts in the folder",
                            "choose one of those found",
                        )
                    })?,
            ),
        };
        let mut answers = Answers::default();
        let passed_over = match &list {
            Some(list) => draft::read_cut_list(list, &scan, &mut answers)?,
            None => Vec::new(),
        };
        for (table, key, value) in &wish.answers {
            if !value.trim().is_empty() {
                answers.set(table, key, value.trim());
            }
        }
        let name = wish.name.as_deref().map(str::trim).filter(|n| !n.is_empty());
        let name = name.map_or_else(|| draft::folder_name(&dir), str::to_string);
        let draft = Draft::as_far_as_it_applies(&name, &scan, &answers)?;
        Ok(Drafted {
            dir,
            all,
            list,
            passed_over,
            draft,
        })
    }
}

/// A draft, and what it was made of.
struct Drafted {
    dir: PathBuf,
    /// With the files that are left out.
    all: Arc<Scan>,
    list: Option<PathBuf>,
    passed_over: Vec<String>,
    draft: Draft,
}

impl Drafted {
    fn document(&self) -> Value {
        let forms = self.draft.forms();
        let missing = self.draft.missing();
        let (pictures, robot_problem) = self.pictures(&forms);
        let within = |path: &PathBuf| path.strip_prefix(&self.dir).unwrap_or(path).to_path_buf();
        let scan = &self.all;
        json!({
            "dir": self.dir,
            "name": self.draft.name,
            "campaign": campaign_file(&self.dir).is_file(),
            "frfs": scan.frfs.iter().map(|f| json!({ "file": f.path, "quantity": f.quantity, "nodes": f.nodes })).collect::<Vec<_>>(),
            "forces": scan.forces.iter().map(|f| &f.path).collect::<Vec<_>>(),
            "not_used": scan.not_used.iter().map(|(file, why)| json!({ "file": file, "why": why })).collect::<Vec<_>>(),
            "cut_lists": scan.cut_lists.iter().map(within).collect::<Vec<_>>(),
            "cut_list": self.list.as_ref().map(within),
            "passed_over": self.passed_over,
            "robots": RobotSpec::built_in().into_iter().map(String::from).chain(scan.robots.iter().cloned()).collect::<Vec<_>>(),
            "tables": forms,
            "missing": missing,
            "guessed": self.draft.guesses(),
            "pictures": pictures,
            "robot_problem": robot_problem,
            "complete": missing.is_empty(),
            "problem": self.draft.check(&self.dir).err().map(|e| e.to_string()),
            "toml": self.draft.toml(),
        })
    }

    /// Of every posture whose angles and robot are known; and what is wrong with the robot.
    fn pictures(&self, forms: &[Form]) -> (Value, Option<String>) {
        let value = |form: &Form, key: &str| {
            form.fields
                .iter()
                .find(|f| f.key == key)
                .and_then(|f| f.value.clone())
        };
        let robot = forms
            .iter()
            .find(|f| f.kind == "robot")
            .and_then(|form| value(form, "model"));
        let Some(robot) = robot else {
            return (json!({}), None);
        };
        let robot = match RobotSpec::load(&robot, &self.dir) {
            Ok(spec) => RobotModel::new(spec),
            Err(error) => return (json!({}), Some(error.to_string())),
        };
        let mut pictures = Map::new();
        for form in forms.iter().filter(|f| f.kind == "posture") {
            let typed = value(form, "joints_deg").unwrap_or_default();
            let angles: Option<Vec<f64>> = typed.split(',').map(|a| a.trim().parse().ok()).collect();
            let Some(kinematics) = angles.and_then(|angles| robot.kinematics(&angles).ok()) else {
                continue;
            };
            let chain: Vec<[f64; 3]> = stick_shapes::chain(&kinematics)
                .iter()
                .map(|p| p.coords.into())
                .collect();
            pictures.insert(form.name.clone(), posture_svg(&form.name, &chain).into());
        }
        (Value::Object(pictures), None)
    }
}

impl Entrance for Drafting {
    fn answer(&self, request: EntranceRequest) -> Result<Reply> {
        Ok(match request {
            EntranceRequest::Look { folder } => Reply::Told(look(folder.as_deref())?),
            EntranceRequest::Folder { parent, name } => Reply::Told(self.make_folder(&parent, &name)?),
            EntranceRequest::Reading { dir } => {
                Reply::Told(json!({ "files": self.how_far(&real_folder(&dir)?) }))
            }
            EntranceRequest::Stop { dir } => {
                Reply::Told(json!({ "stopped": self.stop_reading(&real_folder(&dir)?) }))
            }
            EntranceRequest::Draft { wish } => Reply::Told(self.draft(&wish)?.document()),
            EntranceRequest::Write { wish } => {
                let Drafted { dir, draft, .. } = self.draft(&wish)?;
                if let Some(first) = draft.missing().first() {
                    return Err(InputError::new(format!("is missing: {}", first.what))
                        .key(format!("{}.{}", first.table, first.key))
                        .remedy("fill in the fields that are marked; nothing was written")
                        .into());
                }
                draft.write(&dir, false)?;
                Reply::Opened(Arc::new(CampaignBench::open(&dir)?))
            }
            EntranceRequest::Open { dir } => {
                Reply::Opened(Arc::new(CampaignBench::open(&real_folder(&dir)?)?))
            }
            EntranceRequest::Leave {} => Reply::Left,
        })
    }

    fn receive(&self, parcel: &Parcel, content: &[u8]) -> Result<()> {
        let root = real_folder(&parcel.folder)?;
        {
            let mut state = self.state();
            let known =
                state.made.contains(&root) || state.scanned.as_ref().is_some_and(|(of, _)| *of == root);
            if !known {
                let remedy = "make a new folder on the page first, or open this one there";
                return Err(wrong(&root, "takes no files from the page", remedy));
            }
            let (files, bytes) = (state.received.0 + 1, state.received.1 + content.len() as u64);
            if files > MOST_FILES || bytes > MOST_BYTES {
                let limit = format!(
                    "more than {MOST_FILES} files or {} GB were dropped",
                    MOST_BYTES >> 30
                );
                return Err(wrong(&root, &limit, "copy the rest into the folder yourself"));
            }
            state.received = (files, bytes);
        }
        let parts = parts(&parcel.name)?;
        let (file, folders) = parts.split_last().unwrap_or((&"", &[]));
        let mut folder = root.clone();
        for part in folders {
            folder.push(part);
            match std::fs::create_dir(&folder) {
                Err(e) if e.kind() != std::io::ErrorKind::AlreadyExists => return Err(Error::io(&folder, e)),
                _ => (),
            }
            // A link that was there already leads wherever it likes.
            folder = real_folder(&folder)?;
            if !folder.starts_with(&root) {
                return Err(wrong(
                    &folder,
                    "leads out of the folder (symbolic link)",
                    "take the link away",
                ));
            }
        }
        let path = folder.join(file);
        match write_new(&path, content)? {
            true => Ok(()),
            false => Err(wrong(
                &path,
                "is there already; nothing was changed",
                "rename the file that is dropped",
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_below_their_folder() {
        for good in ["p1.uff", "frf/Pos A (neu).csv", "Kräfte/tag2/Versuch_1.txt"] {
            assert!(parts(good).is_ok(), "{good}");
        }
        for bad in [
            "",
            "/etc/passwd",
            "../x",
            "a/../../x",
            "a//b",
            "./x",
            ".hidden",
            "a/.ssh/x",
            "C:\\x",
            "c:x",
            "a\\b",
            "a\0b",
            "a\nb",
            "1/2/3/4/5/6/7/8/9",
            "x ",
        ] {
            assert!(parts(bad).is_err(), "{bad:?}");
        }
        assert!(parts(&"x".repeat(300)).is_err());
    }

    #[test]
    fn files_are_received_in_new_folders_only_and_never_replaced() {
        let dir = tempfile::tempdir().unwrap();
        let drafting = Drafting::default();
        let send = |folder: &Path, name: &str| {
            let parcel = Parcel {
                folder: folder.to_path_buf(),
                name: name.into(),
            };
            drafting.receive(&parcel, b"1").map_err(|e| e.to_string())
        };
        assert!(send(dir.path(), "a.txt").unwrap_err().contains("takes no files"));
        let made = drafting.make_folder(dir.path(), "cell 9").unwrap();
        let made = PathBuf::from(made["folder"].as_str().unwrap());
        assert!(drafting.make_folder(dir.path(), "cell 9").is_err());
        assert!(drafting.make_folder(dir.path(), "../x").is_err());
        assert!(drafting.make_folder(dir.path(), "a/b").is_err());
        assert_eq!(send(&made, "frf/a.txt"), Ok(()));
        assert!(send(&made, "frf/a.txt").unwrap_err().contains("is there already"));
        assert!(send(&made, "../a.txt").is_err());
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(dir.path(), made.join("out")).unwrap();
            assert!(send(&made, "out/a.txt").unwrap_err().contains("leads out"));
            assert!(!dir.path().join("a.txt").exists());
        }
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
    }
}
