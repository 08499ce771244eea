//! The revision log: `lobestone/revisions.json` in the campaign's folder.
//!
//! Written under another name, flushed and renamed, so that whoever reads it at whatever moment reads the old log or the new
//! one. Writers take turns by a lock of the operating system on `revisions.lock`, which a killed process cannot leave
//! behind, and refuse to write where the log is no longer the one that they started from.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::folder::{FOLDER, log_file};
use super::lock::lock;
use crate::files::write_durably;
use crate::identify::model_history::{Revision, Side};
use crate::{Error, InputError, Result};

const SCHEMA: &str = "lobestone/revisions/1";
/// Beginning of the names of files that are not yet the log.
const TEMPORARY: &str = ".revisions-";

const REMEDY: &str = "take back what was changed in it by hand, or delete the file: the model starts from the baseline \
                      then, and campaign.toml and the measurements are not touched";

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    schema: String,
    revisions: Vec<Revision>,
    /// What was taken back, oldest first.
    #[serde(default)]
    undone: Vec<Revision>,
}

impl Document {
    fn empty() -> Self {
        Document {
            schema: SCHEMA.into(),
            revisions: Vec::new(),
            undone: Vec::new(),
        }
    }
}

/// All revisions of a campaign.
#[derive(Debug, Clone)]
pub struct RevisionLog {
    campaign_dir: PathBuf,
    document: Document,
}

impl RevisionLog {
    /// The log of a campaign; empty where there is none yet.
    ///
    /// # Errors
    /// A log that cannot be read or is not what this program writes, with file and line or key.
    pub fn load(campaign_dir: &Path) -> Result<Self> {
        Ok(RevisionLog {
            campaign_dir: campaign_dir.to_path_buf(),
            document: read(&log_file(campaign_dir))?,
        })
    }

    /// The log of a campaign from the bytes of its file.
    ///
    /// # Errors
    /// As for [`load`](Self::load).
    pub fn from_bytes(campaign_dir: &Path, bytes: &[u8]) -> Result<Self> {
        Ok(RevisionLog {
            campaign_dir: campaign_dir.to_path_buf(),
            document: parse(&log_file(campaign_dir), bytes)?,
        })
    }

    /// The revisions of one side, oldest first; the baseline is the first.
    pub fn revisions(&self, side: Side) -> impl DoubleEndedIterator<Item = &Revision> {
        self.document.revisions.iter().filter(move |r| r.domain == side)
    }

    /// What was undone on one side, oldest first.
    pub fn undone(&self, side: Side) -> impl Iterator<Item = &Revision> {
        self.document.undone.iter().filter(move |r| r.domain == side)
    }

    /// The model as it stands; `None` where nothing was recorded.
    pub fn current(&self, side: Side) -> Option<&Revision> {
        self.revisions(side).next_back()
    }

    /// What stands in the log of one side, as a short mark that no other state of this log has: revision number and
    /// number of undone revisions (both together only grow).
    pub fn mark(&self, side: Side) -> String {
        let revision = self.current(side).map_or(0, |r| r.revision);
        format!("{revision}-{}", self.undone(side).count())
    }

    /// Adds a revision; its number is set here. `baseline`: what to record as revision 0 where none of this side is
    /// there yet (or only a baseline, which then is replaced: the data may have changed since).
    ///
    /// # Errors
    /// Another process changed the log since it was loaded, or the file system refuses.
    pub fn append(&mut self, baseline: Revision, mut revision: Revision) -> Result<usize> {
        let domain = revision.domain;
        self.change(|document| {
            let own = |r: &Revision| r.domain == domain;
            if document.revisions.iter().filter(|r| own(r)).count() <= 1 {
                document.revisions.retain(|r| !own(r));
                document.revisions.push(Revision {
                    revision: 0,
                    ..baseline
                });
            }
            revision.revision = document.revisions.iter().filter(|r| own(r)).count();
            let number = revision.revision;
            document.revisions.push(revision);
            Ok(number)
        })
    }

    /// Takes the last revision of one side back (it stays in the file, among the undone) and returns it.
    ///
    /// # Errors
    /// There is no added effect to undo; another process changed the log since it was loaded; the file system refuses.
    pub fn undo(&mut self, side: Side) -> Result<Revision> {
        if self.current(side).is_none_or(|r| r.revision == 0) {
            return Err(
                InputError::new("nothing to undo: no effect was added to this campaign's model")
                    .file(log_file(&self.campaign_dir))
                    .remedy("see `lobestone history DIR`; add one with `lobestone add DIR EFFECT[@SITE]`")
                    .into(),
            );
        }
        self.change(|document| {
            let last = document.revisions.iter().rposition(|r| r.domain == side);
            let undone = match last {
                Some(last) => document.revisions.remove(last),
                None => return Err(Error::computation("the log lost its last revision")),
            };
            document.undone.push(undone.clone());
            Ok(undone)
        })
    }

    /// Changes the file, alone and only if it still is the one that was loaded.
    fn change<T>(&mut self, change: impl FnOnce(&mut Document) -> Result<T>) -> Result<T> {
        let path = log_file(&self.campaign_dir);
        let folder = self.campaign_dir.join(FOLDER);
        std::fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, e))?;
        let _lock = lock(&folder)?;
        if read(&path)? != self.document {
            return Err(InputError::new(
                "another lobestone changed this log in the meantime; nothing was written",
            )
            .file(&path)
            .remedy("see `lobestone history DIR`, then run the command again")
            .into());
        }
        let mut document = self.document.clone();
        let result = change(&mut document)?;
        // What killed processes left behind: nobody else writes while the lock is held.
        let left = std::fs::read_dir(&folder).into_iter().flatten().flatten();
        for entry in left.filter(|e| e.file_name().to_string_lossy().starts_with(TEMPORARY)) {
            let _ = std::fs::remove_file(entry.path());
        }
        let mut text = serde_json::to_string_pretty(&document)
            .map_err(|e| Error::computation(format!("the revision cannot be written: {e}")))?;
        text.push('\n');
        write_durably(&path, text.as_bytes(), TEMPORARY)?;
        self.document = document;
        Ok(result)
    }
}

fn read(path: &Path) -> Result<Document> {
    match std::fs::read(path) {
        Ok(bytes) => parse(path, &bytes),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(Document::empty()),
        Err(e) => Err(Error::io(path, e)),
    }
}

/// What the file `path` holds.
fn parse(path: &Path, bytes: &[u8]) -> Result<Document> {
    let wrong = |problem: String| InputError::new(problem).file(path).remedy(REMEDY);
    // The schema first: of a later version nothing else may be known.
    #[derive(Deserialize)]
    struct Head {
        schema: Option<String>,
    }
    let syntax = |e: serde_json::Error| {
        let line = Some(e.line()).filter(|l| *l > 0);
        wrong(format!("no revision log: {e}")).line(line)
    };
    let head: Head = serde_json::from_slice(bytes).map_err(syntax)?;
    if head.schema.as_deref() != Some(SCHEMA) {
        let found = head.schema.unwrap_or_else(|| "none".into());
        return Err(
            wrong(format!("the schema is {found}, this version reads {SCHEMA}"))
                .key("schema")
                .into(),
        );
    }
    let document: Document = serde_json::from_slice(bytes).map_err(syntax)?;
    check(&document).map_err(|(key, problem)| wrong(problem).key(key))?;
    Ok(document)
}

/// Key and problem of the first thing that this program would not have written.
fn check(document: &Document) -> std::result::Result<(), (String, String)> {
    let mut last: [Option<&Revision>; 2] = [None, None];
    for (i, revision) in document.revisions.iter().enumerate() {
        let wrong = |key: &str, problem: String| Err((format!("revisions[{i}].{key}"), problem));
        let side = match revision.domain {
            Side::Structure => 0,
            Side::Cutting => 1,
        };
        let before = last[side].replace(revision);
        let expected = before.map_or(0, |b| b.revision + 1);
        if revision.revision != expected {
            return wrong(
                "revision",
                format!("{} where {expected} comes next", revision.revision),
            );
        }
        let kept = before.map_or(&[][..], |b| &b.effects);
        // Beside a new one they may choose otherwise.
        let mut pairs = revision.effects.iter().zip(kept);
        if revision.effects.len() != expected || pairs.any(|(is, was)| is.effect != was.effect) {
            return wrong(
                "effects",
                "a revision has the effects of the one before it and one more".into(),
            );
        }
        for (key, value) in [
            ("nrms", Some(revision.nrms)),
            ("held_out_nrms", revision.held_out_nrms),
            ("noise_floor_nrms", Some(revision.noise_floor_nrms)),
            ("reduced_chi2", Some(revision.reduced_chi2)),
        ] {
            if value.is_some_and(|v| !(v >= 0.0 && v.is_finite())) {
                return wrong(key, "no number that can be".into());
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::faults::every_fault;
    use crate::revision::{RecordedEffect, RecordedParameter};

    fn revision(labels: &[&str], nrms: f64) -> Revision {
        Revision {
            revision: 0,
            domain: Side::Structure,
            effects: labels
                .iter()
                .map(|l| RecordedEffect {
                    effect: l.to_string(),
                    variant: l.starts_with("local").then(|| "y".to_string()),
                })
                .collect(),
            parameters: vec![RecordedParameter {
                name: "joint-1.stiffness".into(),
                value: 0.1 + 0.2,
                unit: "N·m/rad".into(),
                std_error: None,
                initial: 1.5e6,
            }],
            nrms,
            held_out_nrms: Some(1.1 * nrms),
            noise_floor_nrms: 0.03,
            reduced_chi2: 1.0,
            progress: Some(true),
            when: "2025-01-01T00:00:00Z".into(),
            data: "0123456789abcdef".into(),
            why: None,
        }
    }

    /// Adds one effect to what is there.
    fn add(log: &mut RevisionLog, label: &str) -> Result<usize> {
        let before: Vec<String> = log
            .current(Side::Structure)
            .map(|r| r.labels().iter().map(|l| l.to_string()).collect())
            .unwrap_or_default();
        let labels: Vec<&str> = before.iter().map(String::as_str).chain([label]).collect();
        log.append(revision(&[], 0.5), revision(&labels, 0.1))
    }

    fn numbers(dir: &Path) -> Vec<usize> {
        let log = RevisionLog::load(dir).unwrap();
        log.revisions(Side::Structure).map(|r| r.revision).collect()
    }

    #[test]
    fn what_was_appended_is_read_and_what_was_undone_is_kept() {
        let dir = tempfile::tempdir().unwrap();
        let mut log = RevisionLog::load(dir.path()).unwrap();
        assert!(log.current(Side::Structure).is_none());
        assert_eq!(add(&mut log, "payload").unwrap(), 1);
        assert_eq!(add(&mut log, "local-resonator@link-3").unwrap(), 2);
        let read = RevisionLog::load(dir.path()).unwrap();
        assert_eq!(read.document, log.document);
        assert_eq!(numbers(dir.path()), [0, 1, 2]);
        assert!(read.current(Side::Cutting).is_none());

        let undone = log.undo(Side::Structure).unwrap();
        assert_eq!(undone.labels(), ["payload", "local-resonator@link-3"]);
        assert_eq!(add(&mut log, "time-delay").unwrap(), 2);
        log.undo(Side::Structure).unwrap();
        log.undo(Side::Structure).unwrap();
        let error = log.undo(Side::Structure).unwrap_err().to_string();
        assert!(error.contains("nothing to undo"), "{error}");
        let read = RevisionLog::load(dir.path()).unwrap();
        assert_eq!(numbers(dir.path()), [0]);
        assert_eq!(read.undone(Side::Structure).count(), 3);
    }

    #[test]
    fn every_state_of_a_log_has_its_own_mark() {
        let dir = tempfile::tempdir().unwrap();
        let mut log = RevisionLog::load(dir.path()).unwrap();
        let mut marks = vec![log.mark(Side::Structure)];
        for label in ["payload", "time-delay", "", "payload", "", "", "payload"] {
            match label {
                "" => drop(log.undo(Side::Structure).unwrap()),
                _ => drop(add(&mut log, label).unwrap()),
            }
            let mark = log.mark(Side::Structure);
            assert!(!marks.contains(&mark), "{mark} {marks:?}");
            marks.push(mark);
        }
        assert_eq!(log.mark(Side::Cutting), "0-0");
    }

    #[test]
    fn a_baseline_alone_gives_way_to_a_new_one() {
        let dir = tempfile::tempdir().unwrap();
        let mut log = RevisionLog::load(dir.path()).unwrap();
        add(&mut log, "payload").unwrap();
        log.undo(Side::Structure).unwrap();
        log.append(revision(&[], 0.7), revision(&["time-delay"], 0.1))
            .unwrap();
        let first = log.revisions(Side::Structure).next().unwrap();
        assert_eq!((first.revision, first.nrms), (0, 0.7));
        assert_eq!(numbers(dir.path()), [0, 1]);
    }

    /// Killed before the rename: a part of the new log lies next to the old one.
    #[test]
    fn a_killed_writer_leaves_the_old_log() {
        let dir = tempfile::tempdir().unwrap();
        let mut log = RevisionLog::load(dir.path()).unwrap();
        add(&mut log, "payload").unwrap();
        let file = log_file(dir.path());
        let whole = std::fs::read(&file).unwrap();
        let left = file.with_file_name(".revisions-Ab12Cd");
        std::fs::write(&left, &whole[..whole.len() / 2]).unwrap();
        assert_eq!(numbers(dir.path()), [0, 1]);
        add(&mut log, "time-delay").unwrap();
        assert_eq!(numbers(dir.path()), [0, 1, 2]);
        assert!(!left.exists());
        let mut names: Vec<_> = std::fs::read_dir(file.parent().unwrap())
            .unwrap()
            .map(|e| e.unwrap().file_name())
            .collect();
        names.sort();
        assert_eq!(names, ["revisions.json", "revisions.lock"]);
    }

    #[test]
    fn a_reader_never_sees_half_a_log() {
        let dir = tempfile::tempdir().unwrap();
        let mut log = RevisionLog::load(dir.path()).unwrap();
        let done = std::sync::atomic::AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                for _ in 0..20 {
                    add(&mut log, "payload").unwrap();
                    log.undo(Side::Structure).unwrap();
                }
                done.store(true, std::sync::atomic::Ordering::Relaxed);
            });
            while !done.load(std::sync::atomic::Ordering::Relaxed) {
                assert!(numbers(dir.path()).len() <= 2);
            }
        });
    }

    /// Every writer that was told "done" finds its revision in the log; the others were told that they were late.
    #[test]
    fn writers_at_the_same_time_lose_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let results: Vec<bool> = std::thread::scope(|scope| {
            let tasks: Vec<_> = (0..8)
                .map(|i| {
                    let dir = dir.path();
                    scope.spawn(move || {
                        let mut done = 0;
                        let mut late = 0;
                        while done < 3 {
                            let mut log = RevisionLog::load(dir).unwrap();
                            std::thread::yield_now();
                            match add(&mut log, &format!("payload@joint-{i}")) {
                                Ok(_) => done += 1,
                                Err(e) => {
                                    assert!(e.to_string().contains("in the meantime"), "{e}");
                                    late += 1;
                                }
                            }
                        }
                        late > 0
                    })
                })
                .collect();
            tasks.into_iter().map(|t| t.join().unwrap()).collect()
        });
        assert_eq!(results.len(), 8);
        assert_eq!(numbers(dir.path()), (0..=24).collect::<Vec<_>>());
        let log = RevisionLog::load(dir.path()).unwrap();
        let last = log.current(Side::Structure).unwrap();
        for i in 0..8 {
            let own = format!("payload@joint-{i}");
            assert_eq!(last.labels().iter().filter(|l| **l == own).count(), 3);
        }
    }

    /// A disk that is full, broken or interrupted at any call: the old log or the new one, and the next writer goes on from it.
    #[test]
    fn a_fault_at_any_call_leaves_the_old_log_or_the_new_one() {
        let prepare = |dir: &Path| {
            add(&mut RevisionLog::load(dir).unwrap(), "payload").unwrap();
        };
        let adds = |dir: &Path| add(&mut RevisionLog::load(dir).unwrap(), "time-delay");
        let state = |dir: &Path| (numbers(dir), std::fs::read_dir(dir.join(FOLDER)).unwrap().count());
        // The log and its lock, nothing else.
        every_fault(
            prepare,
            adds,
            |dir| state(dir) == (vec![0, 1], 2),
            |dir| state(dir) == (vec![0, 1, 2], 2),
            "revisions.json: ",
        );
        // What failed is no hindrance; what was recorded all the same is seen.
        let undoes = |dir: &Path| {
            let mut log = RevisionLog::load(dir).unwrap();
            let before = log.revisions(Side::Structure).count();
            let undone = log.undo(Side::Structure);
            let kept = log.revisions(Side::Structure).count();
            assert_eq!(kept, before - usize::from(undone.is_ok()));
            undone
        };
        every_fault(
            prepare,
            undoes,
            |dir| state(dir) == (vec![0, 1], 2),
            |dir| state(dir) == (vec![0], 2),
            "revisions.json: ",
        );
    }

    /// A clock that goes backwards changes no order: revisions are numbered.
    #[test]
    fn revisions_from_the_future_stay_where_they_are() {
        let dir = tempfile::tempdir().unwrap();
        let mut log = RevisionLog::load(dir.path()).unwrap();
        let later = Revision {
            when: "2999-12-31T23:59:59Z".into(),
            ..revision(&["payload"], 0.1)
        };
        log.append(revision(&[], 0.5), later).unwrap();
        add(&mut log, "time-delay").unwrap();
        assert_eq!(numbers(dir.path()), [0, 1, 2]);
        let last = RevisionLog::load(dir.path()).unwrap();
        let last = last.current(Side::Structure).unwrap();
        assert_eq!(last.labels(), ["payload", "time-delay"]);
        assert_eq!(
            log.undo(Side::Structure).unwrap().labels(),
            ["payload", "time-delay"]
        );
    }

    /// A lock file that a killed process left is only a file.
    #[test]
    fn a_lock_file_left_behind_blocks_nobody() {
        let dir = tempfile::tempdir().unwrap();
        let mut log = RevisionLog::load(dir.path()).unwrap();
        let folder = dir.path().join(FOLDER);
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(folder.join("revisions.lock"), "4711").unwrap();
        assert_eq!(add(&mut log, "payload").unwrap(), 1);
    }

    #[test]
    fn a_spoilt_log_is_one_clear_error() {
        let dir = tempfile::tempdir().unwrap();
        let mut log = RevisionLog::load(dir.path()).unwrap();
        add(&mut log, "payload").unwrap();
        let file = log_file(dir.path());
        let good = std::fs::read_to_string(&file).unwrap();
        let spoilt = |from: &str, to: &str| {
            assert!(good.contains(from), "{from}");
            good.replacen(from, to, 1)
        };
        for (text, expected) in [
            (good[..good.len() / 2].to_string(), "revisions.json:"),
            (String::new(), "no revision log"),
            ("[]".into(), "no revision log"),
            (spoilt("revisions/1", "revisions/9"), "schema"),
            (spoilt("\"nrms\"", "\"nmrs\""), "nmrs"),
            (
                spoilt("\"revision\": 1", "\"revision\": 4"),
                "revisions[1].revision",
            ),
            (spoilt("0.5", "-0.5"), "revisions[0].nrms"),
            (spoilt("0.5", "1e999"), "no revision log"),
            (
                spoilt("\"effects\": []", "\"effects\": [{\"effect\": \"x\"}]"),
                "revisions[0].effects",
            ),
        ] {
            std::fs::write(&file, &text).unwrap();
            let error = RevisionLog::load(dir.path()).unwrap_err().to_string();
            assert!(error.contains("revisions.json"), "{error}");
            assert!(error.contains(expected), "{expected}: {error}");
            assert!(error.contains("remedy"), "{error}");
        }
        // And nothing is written over it.
        assert!(add(&mut log, "time-delay").is_err());
    }
}
