//! What lies in a folder: every file read as `inspect` reads it.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::cut_list;
use super::found::{FoundForce, FoundFrf, Scan, stem};
use super::names::{Facts, facts_of, facts_of_header, posture_of};
use crate::campaign::campaign_file;
use crate::data::{Channel, ChannelRole, Quantity, RobotSpec, TimeRecord};
use crate::ingest::{
    NamedCut, NamedForce, PlainColumn, SIGNALS, Timeless, cuts_of, forces_of, is_called_acceleration,
    is_called_marker, is_no_measurement, plain_columns, sheet_text, survey, timeless,
    unit_of_charge_or_other,
    units::{self, Dimension},
};
use crate::progress::Progress;
use crate::stop;
use crate::{Error, InputError, Result};

/// Files looked at.
const MOST_FILES: usize = 5000;
/// Folders deep.
const DEEPEST: usize = 8;

/// Words in the name of a copy.
const COPY: [&str; 6] = ["kopie", "copy", "copie", "copia", "backup", "sicherung"];

enum Seen {
    CutList(PathBuf),
    Frf(FoundFrf),
    Force(FoundForce),
    /// Forces in volts or as charges.
    Electric(FoundForce, Vec<(NamedForce, String)>),
    /// Cuts of one file.
    Several(Vec<FoundForce>),
    /// Numbers without names, and why they were not understood.
    Nameless(FoundForce, Vec<PlainColumn>, String),
    /// Signals over time whose names say nothing of forces, and what else they may be: forces where a list of cuts lies beside them.
    Signals(FoundForce, Vec<PlainColumn>, String),
    /// Forces without times: what each is and its channel, and why the file was not understood.
    Timeless(FoundForce, Vec<NamedForce>, String),
    NotUsed(String, String),
}

/// Looks through `dir` and the folders below. Hidden files, the folder `report` and campaigns of their own are passed
/// over; links are followed to files inside the folder only. Can be asked to end between two files ([`crate::stop`]).
///
/// # Errors
/// A folder that cannot be read, or holds more files than anybody measures.
pub fn scan(dir: &Path) -> Result<Scan> {
    let root = dir.canonicalize().map_err(|e| Error::io(dir, e))?;
    let mut files = Vec::new();
    collect(dir, &root, 0, &mut files)?;
    files.sort();
    let mut scan = Scan::default();
    let mut robots = Vec::new();
    let mut measurements = Vec::new();
    for file in files {
        let name = relative(dir, &file);
        let ending = file
            .extension()
            .map(|e| e.to_string_lossy().to_lowercase())
            .unwrap_or_default();
        if ending == "toml" {
            if RobotSpec::load(&name, dir).is_ok() {
                robots.push(name);
            }
        } else if !is_no_measurement(&file) && file != campaign_file(dir) {
            measurements.push((name, file));
        }
    }
    scan.robots = robots;
    leave_out_copies(&mut measurements, &mut scan.not_used);
    let progress = Progress::new("files", measurements.len());
    // In parallel, but collected in order: the result does not depend on the threads.
    let seen: Vec<Seen> = measurements
        .into_par_iter()
        .map(|(name, file)| {
            // Also before a file: where one ends, rayon still begins with all that it has dealt out.
            stop::point();
            let seen = look(name, &file);
            progress.step();
            seen
        })
        .collect();
    let (mut nameless, mut timeless, mut signals) = (Vec::new(), Vec::new(), Vec::new());
    for one in seen {
        match one {
            Seen::CutList(path) => scan.cut_lists.push(path),
            Seen::Frf(frf) => scan.frfs.push(frf),
            Seen::Force(force) => scan.forces.push(force),
            Seen::Electric(force, channels) => {
                scan.forces.push(force);
                // One amplifier: its channels are called alike in all files.
                if scan.electric.is_empty() {
                    scan.electric = channels;
                }
            }
            Seen::Several(forces) => scan.forces.extend(forces),
            Seen::Nameless(force, columns, why) => nameless.push((force, columns, why)),
            Seen::Signals(force, columns, why) => signals.push((force, columns, why)),
            Seen::Timeless(force, channels, why) => timeless.push((force, channels, why)),
            Seen::NotUsed(path, why) => scan.not_used.push((path, why)),
        }
    }
    take_timeless(&mut scan, timeless);
    if !scan.cut_lists.is_empty() && nameless.is_empty() {
        nameless = signals;
    } else {
        scan.not_used.extend(signals.into_iter().map(left_out));
    }
    take_nameless(&mut scan, nameless);
    // Several FRF files in each of several folders: a folder is a posture.
    let mut folders: BTreeMap<String, usize> = BTreeMap::new();
    for frf in &scan.frfs {
        let folder = frf.path.rsplit_once('/').map_or("", |(folder, _)| folder);
        *folders.entry(folder.to_string()).or_default() += 1;
    }
    let in_folders = folders.len() > 1 && !folders.contains_key("");
    for frf in &mut scan.frfs {
        (frf.posture, frf.posture_guess) = posture_of(&frf.path, in_folders);
    }
    Ok(scan)
}

impl Scan {
    /// The robot file, where there is exactly one.
    pub fn robot(&self) -> Option<&str> {
        match self.robots.as_slice() {
            [robot] => Some(robot),
            _ => None,
        }
    }

    /// One list in the folder is meant; of several nobody knows which.
    pub fn cut_list(&self) -> Option<&PathBuf> {
        match self.cut_lists.as_slice() {
            [one] if !self.forces.is_empty() => Some(one),
            _ => None,
        }
    }

    /// Without some of the measurement files.
    pub fn without(&self, left_out: &[String]) -> Scan {
        let mut scan = self.clone();
        scan.frfs.retain(|f| !left_out.contains(&f.path));
        scan.forces.retain(|f| !left_out.contains(&f.path));
        scan
    }
}

/// A file that is named a copy, and holds what another one holds, counts once.
fn leave_out_copies(files: &mut Vec<(String, PathBuf)>, not_used: &mut Vec<(String, String)>) {
    let is_copy = |name: &str| COPY.iter().any(|word| name.to_lowercase().contains(word));
    let size = |path: &Path| std::fs::metadata(path).map(|m| m.len()).ok();
    let original = |name: &str, path: &Path| {
        files.iter().find(|(other, at)| {
            other != name && !is_copy(other) && size(at) == size(path) && same_content(at, path)
        })
    };
    let copies: Vec<(String, String)> = files
        .iter()
        .filter(|(name, _)| is_copy(name))
        .filter_map(|(name, path)| Some((name.clone(), original(name, path)?.0.clone())))
        .collect();
    files.retain(|(name, _)| copies.iter().all(|(copy, _)| copy != name));
    let told = copies
        .into_iter()
        .map(|(copy, of)| (copy, format!("a copy of {of}, byte for byte")));
    not_used.extend(told);
}

fn same_content(a: &Path, b: &Path) -> bool {
    const CHUNK: usize = 1 << 16;
    let (Ok(a), Ok(b)) = (std::fs::File::open(a), std::fs::File::open(b)) else {
        return false;
    };
    let mut readers = [std::io::BufReader::new(a), std::io::BufReader::new(b)];
    loop {
        let mut chunks = [Vec::new(), Vec::new()];
        for (reader, chunk) in readers.iter_mut().zip(&mut chunks) {
            if reader.take(CHUNK as u64).read_to_end(chunk).is_err() {
                return false;
            }
        }
        match &chunks {
            [a, b] if a != b => return false,
            [a, _] if a.is_empty() => return true,
            _ => (),
        }
    }
}

/// The files below a folder that may be measurements, in the order of their names.
///
/// # Errors
/// As [`scan`].
pub fn measurement_files(dir: &Path) -> Result<Vec<PathBuf>> {
    let root = dir.canonicalize().map_err(|e| Error::io(dir, e))?;
    let mut files = Vec::new();
    collect(dir, &root, 0, &mut files)?;
    files.retain(|file| !is_no_measurement(file));
    files.sort();
    Ok(files)
}

fn relative(dir: &Path, file: &Path) -> String {
    let inside = file.strip_prefix(dir).unwrap_or(file);
    let parts: Vec<String> = inside
        .components()
        .map(|c| c.as_os_str().to_string_lossy().into_owned())
        .collect();
    parts.join("/")
}

fn collect(dir: &Path, root: &Path, depth: usize, files: &mut Vec<PathBuf>) -> Result<()> {
    let entries = std::fs::read_dir(dir).map_err(|e| Error::io(dir, e))?;
    for entry in entries {
        let path = entry.map_err(|e| Error::io(dir, e))?.path();
        // What has no Unicode name cannot stand in a campaign file.
        let Some(name) = path.file_name().and_then(|n| n.to_str()) else {
            continue;
        };
        let Ok(kind) = std::fs::symlink_metadata(&path).map(|m| m.file_type()) else {
            continue;
        };
        if name.starts_with('.') || (name == "report" && kind.is_dir()) {
            continue;
        }
        if kind.is_dir() {
            if depth < DEEPEST && !campaign_file(&path).is_file() {
                collect(&path, root, depth + 1, files)?;
            }
        } else if kind.is_file()
            || (kind.is_symlink()
                && path
                    .canonicalize()
                    .is_ok_and(|real| real.starts_with(root) && real.is_file()))
        {
            files.push(path);
        }
        if files.len() > MOST_FILES {
            return Err(InputError::new(format!("holds more than {MOST_FILES} files"))
                .file(root)
                .remedy("give the folder of one campaign, not the drive that all lie on")
                .into());
        }
    }
    Ok(())
}

fn look(name: String, file: &Path) -> Seen {
    let read = match survey(file) {
        Ok(survey) => survey.file,
        Err(Error::Input(_)) if cut_list::looks_like_one(&start_of(file)) => {
            return Seen::CutList(file.to_path_buf());
        }
        Err(Error::Input(error)) => {
            let why = match error.remedy {
                Some(remedy) => format!("{} ({remedy})", error.problem),
                None => error.problem.clone(),
            };
            return match timeless(file).unwrap_or_default() {
                Timeless { cuts, .. } if cuts.len() > 1 => several(&force_of(name, file), cuts),
                Timeless { forces, .. } if !forces.is_empty() => {
                    Seen::Timeless(force_of(name, file), forces, why)
                }
                _ => match plain_columns(file) {
                    Ok(Some(columns)) if may_be_forces(&columns) => {
                        Seen::Nameless(force_of(name, file), columns, why)
                    }
                    _ => Seen::NotUsed(name, why),
                },
            };
        }
        Err(error) => return Seen::NotUsed(name, error.to_string()),
    };
    let contents = read.contents;
    if !contents.frfs.is_empty() {
        let placed = contents
            .frfs
            .iter()
            .all(|f| f.response.is_some() && f.reference.is_some());
        if !placed {
            let why = "does not say at which node and in which direction it was measured (name the columns \
                       re(1X/1X),im(1X/1X): response / excitation)";
            return Seen::NotUsed(name, why.into());
        }
        let quantities: Vec<Option<Quantity>> = contents.frfs.iter().map(|f| f.quantity).collect();
        let all_say = quantities.iter().all(Option::is_some);
        let dofs = contents.frfs.iter().flat_map(|f| [f.response, f.reference]);
        return Seen::Frf(FoundFrf {
            posture: String::new(),
            posture_guess: None,
            quantity: quantities[0].filter(|_| all_say),
            nodes: dofs.flatten().map(|d| d.node).collect(),
            facts: facts_of(stem(&name)),
            path: name,
        });
    }
    let force = || FoundForce {
        says_times: true,
        ..force_of(name.clone(), file)
    };
    let mut channels = contents.times.iter().flat_map(|t| &t.channels);
    if channels.any(|c| c.role != ChannelRole::Other) {
        return match electric(&contents.times) {
            forces if forces.is_empty() => Seen::Force(force()),
            forces => Seen::Electric(force(), forces),
        };
    }
    let cuts = cuts_of(&contents.times);
    if cuts.len() > 1 {
        return several(&force(), cuts);
    }
    match contents.times.as_slice() {
        [] => Seen::NotUsed(name, format!("holds {}", contents.describe())),
        [record] => {
            let columns: Vec<PlainColumn> = record.channels.iter().map(PlainColumn::of_channel).collect();
            let why = without_forces(&contents.times);
            match may_be_forces(&columns) {
                true => Seen::Signals(force(), columns, why),
                false => Seen::NotUsed(name, why),
            }
        }
        times => Seen::NotUsed(name, without_forces(times)),
    }
}

/// The forces whose values are volts or charges, with their unit.
fn electric(times: &[TimeRecord]) -> Vec<(NamedForce, String)> {
    let is_electric = |c: &Channel| {
        unit_of_charge_or_other(&c.file_unit).is_some_and(|u| u.dimension == Dimension::VOLTAGE)
    };
    let with_unit = |(what, name): NamedForce| {
        let channel = times.iter().flat_map(|t| &t.channels).find(|c| c.name == name)?;
        is_electric(channel).then(|| ((what, name), channel.file_unit.clone()))
    };
    forces_of(times).into_iter().filter_map(with_unit).collect()
}

/// A time record whose channels are called otherwise than forces: what it may be, and what to do then.
fn without_forces(times: &[TimeRecord]) -> String {
    let is_current =
        |c: &&Channel| units::parse(&c.file_unit).is_some_and(|u| u.dimension == Dimension::CURRENT);
    let mut channels = times.iter().flat_map(|t| &t.channels);
    match channels.find(is_current) {
        Some(current) => format!(
            "a time record of motor currents, no forces; where you know what force an ampere stands for, write in campaign.toml such as \
             [[channel]] name = \"fz\", in_file = {:?}, gain = \"350 N/A\"",
            current.name
        ),
        None => "a time record without cutting forces (a tap test? `lobestone modal` makes FRFs of it; forces under other names? say \
                 which in a [[channel]] of campaign.toml)"
            .into(),
    }
}

/// The cuts of a file that holds more than one.
fn several(of_file: &FoundForce, cuts: Vec<NamedCut>) -> Seen {
    let each = cuts.into_iter().map(|cut| FoundForce {
        part: Some(cut),
        ..of_file.clone()
    });
    Seen::Several(each.collect())
}

fn force_of(name: String, file: &Path) -> FoundForce {
    FoundForce {
        // The whole path: folders are named by what was cut, too.
        from_name: facts_of(name.rsplit_once('.').map_or(name.as_str(), |(stem, _)| stem)),
        from_header: header(file),
        path: name,
        part: None,
        says_times: false,
    }
}

/// Slowest sampling of a force record, s.
const SLOWEST_STEP: f64 = 0.02;

/// Rows from which on many columns are a record and no list of results.
const ROWS_OF_A_RECORD: usize = 500;
/// Signals of one record: forces, and what else was recorded with them.
const MOST_SIGNALS: usize = 12;

/// Two signals or more, or one beside its times; with a time column before them, one that counts the rows, or none. What rises
/// without being a clock is something else, and so is what is called otherwise than a force.
fn may_be_forces(columns: &[PlainColumn]) -> bool {
    let is_time = |c: &PlainColumn| c.counts() || c.step.is_some_and(|step| step <= SLOWEST_STEP);
    let (has_time, signals) = match columns {
        [time, signals @ ..] if is_time(time) => (true, signals),
        all => (false, all),
    };
    let signals: Vec<&PlainColumn> = signals.iter().filter(|c| !c.is_state).collect();
    let is_long = signals.iter().all(|c| c.rows >= ROWS_OF_A_RECORD);
    let is_named = signals.iter().any(|c| c.name.is_some());
    let least = if has_time && is_long { 1 } else { 2 };
    let is_record = is_long || signals.len() <= SIGNALS.len() && !is_named;
    let is_other = |c: &PlainColumn| {
        let is_called_so = |name: &str| is_called_acceleration(name) || is_called_marker(name);
        c.name.as_deref().is_some_and(is_called_so)
    };
    (least..=MOST_SIGNALS).contains(&signals.len())
        && is_record
        && signals.iter().all(|c| !c.rises && !is_other(c))
}

/// A file, what its channels are and how they are called, and why it was not understood.
type TimelessForce = (FoundForce, Vec<NamedForce>, String);

/// Files whose forces have names and no times are the folder's force records where no other says its times and all have the
/// same channels: the sampling rate is asked once.
fn take_timeless(scan: &mut Scan, timeless: Vec<TimelessForce>) {
    let alike = timeless.iter().all(|(_, channels, _)| *channels == timeless[0].1);
    for (force, channels, why) in timeless {
        if alike && (scan.forces.is_empty() || !scan.timeless.is_empty()) {
            scan.forces.push(force);
            scan.timeless = channels;
        } else {
            scan.not_used.push((force.path, why));
        }
    }
}

/// A file, its columns, and why it was not understood.
type NamelessForce = (FoundForce, Vec<PlainColumn>, String);

fn left_out((force, _, why): NamelessForce) -> (String, String) {
    (force.path, why)
}

/// Tables without names are the folder's force records where no file has names and all have the same columns: what these are
/// is asked once.
fn take_nameless(scan: &mut Scan, nameless: Vec<NamelessForce>) {
    let layout = |columns: &[PlainColumn]| {
        let names: Vec<Option<String>> = columns.iter().map(|c| c.name.clone()).collect();
        (names, columns.first().is_some_and(|c| c.step.is_some()))
    };
    let alike = nameless
        .iter()
        .all(|(_, columns, _)| layout(columns) == layout(&nameless[0].1));
    if !scan.forces.is_empty() || !alike {
        scan.not_used.extend(nameless.into_iter().map(left_out));
        return;
    }
    for (force, columns, _) in nameless {
        scan.forces.push(force);
        if scan.columns.is_empty() {
            scan.columns = columns;
        }
    }
}

fn header(file: &Path) -> Facts {
    facts_of_header(&start_of(file))
}

/// Its first 4 kB; empty where it cannot be read.
fn start_of(file: &Path) -> Vec<u8> {
    const LONG: usize = 4096;
    if file.extension().is_some_and(|e| e.eq_ignore_ascii_case("xlsx")) {
        let text = std::fs::read(file).ok().and_then(|bytes| sheet_text(&bytes));
        return text.map_or_else(Vec::new, |t| t.into_bytes().into_iter().take(LONG).collect());
    }
    let mut start = Vec::new();
    let read = std::fs::File::open(file).and_then(|f| f.take(LONG as u64).read_to_end(&mut start));
    read.map_or_else(|_| Vec::new(), |_| start)
}
