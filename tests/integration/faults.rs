//! A disk that is full or broken, calls that are interrupted, folders that may not be written, a clock that goes backwards: the campaign
//! is as it was or as it shall be, never between; the exit status and the message say which.
//!
//! Calls are made to fail by `strace`, which does so for the program as it is, one call after the other; full and read-only file
//! systems are made in a user name space of their own. Where the machine has none of it the tests say so and pass; `src/files.rs` and
//! `src/revision/log.rs` test the same from inside on every machine.
#![cfg(target_os = "linux")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

use crate::support::{blind, copy_folder, copy_of, document};

/// Kinds of calls as strace names them.
const WRITES: &str = "write,writev,pwrite64";
const SYNCS: &str = "fsync,fdatasync";
const RENAMES: &str = "rename,renameat,renameat2,link,linkat";

const BINARY: &str = env!("CARGO_BIN_EXE_lobestone");

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Every file below a folder with what it holds.
fn content(dir: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![dir.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if !path.ends_with("revisions.lock") {
                let name = path.strip_prefix(dir).unwrap().to_path_buf();
                found.insert(name, std::fs::read(&path).unwrap());
            }
        }
    }
    found
}

fn traced(arguments: &[&str], trace: &[&str]) -> Output {
    Command::new("strace")
        .args(["-f", "-qq", "--seccomp-bpf"])
        .args(trace)
        .arg(BINARY)
        .args(arguments)
        .env("RAYON_NUM_THREADS", "2")
        .output()
        .unwrap()
}

/// Whether calls can be made to fail here.
fn can_trace() -> bool {
    let tried = Command::new("strace")
        .args([
            "-f",
            "-qq",
            "--seccomp-bpf",
            "-o",
            "/dev/null",
            "-e",
            "trace=write",
        ])
        .args(["-e", "inject=write:error=ENOSPC:when=1", BINARY, "explain"])
        .output();
    let works = tried.is_ok_and(|output| output.status.code() == Some(1));
    if !works {
        eprintln!("skipped: no strace that may trace here");
    }
    works
}

/// Lets each call of a command that writes or renames fail in turn. `arguments` gets the folder that `prepare` filled;
/// `is_answer_enough` where what the command keeps besides its answer is a help and nothing more.
fn every_call_may_fail(
    prepare: impl Fn(&Path),
    arguments: impl Fn(&Path) -> Vec<String>,
    is_new: impl Fn(&Path) -> bool,
    errors: &[&str],
    is_answer_enough: bool,
) {
    let mut failures = 0;
    for kind in [WRITES, SYNCS, RENAMES] {
        for error in errors {
            for call in 1.. {
                let folder = tempfile::tempdir().unwrap();
                let dir = folder.path();
                prepare(dir);
                let old = content(dir);
                let arguments = arguments(dir);
                let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
                let mark = tempfile::NamedTempFile::new().unwrap();
                let run = traced(
                    &arguments,
                    &[
                        "-o",
                        text(mark.path()),
                        "-e",
                        &format!("trace={kind}"),
                        "-e",
                        &format!("inject={kind}:error={error}:when={call}"),
                    ],
                );
                let said = String::from_utf8_lossy(&run.stderr).into_owned();
                let was_hit = std::fs::read_to_string(mark.path()).unwrap().contains("INJECTED");
                let what = format!("{arguments:?}: {error} in call {call} of {kind}: {said}");
                let now = content(dir);
                assert!(now == old || is_new(dir), "{what}: {:?}", now.keys());
                assert!(
                    !now.keys()
                        .any(|name| text(name).contains("/.") || text(name).starts_with('.')),
                    "{what}: {:?}",
                    now.keys()
                );
                match run.status.code() {
                    Some(0) => assert!(is_new(dir) || is_answer_enough, "{what}"),
                    Some(1) => {
                        assert!(*error != "EINTR" && was_hit, "{what}");
                        assert!(said.contains(text(dir)) || said.contains("stdout"), "{what}");
                        failures += 1;
                    }
                    other => panic!("{other:?}: {what}"),
                }
                if !was_hit {
                    break;
                }
            }
        }
    }
    assert!(failures > 0, "no call failed");
}

fn owned(arguments: &[&str]) -> Vec<String> {
    arguments.iter().map(|a| a.to_string()).collect()
}

const ALL: [&str; 3] = ["ENOSPC", "EIO", "EINTR"];

fn revisions(dir: &Path) -> usize {
    let file = dir.join("lobestone/revisions.json");
    let log: Value = serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap();
    log["revisions"].as_array().unwrap().len()
}

#[test]
fn the_log_of_revisions_survives_every_failing_call() {
    if !can_trace() {
        return;
    }
    let whole = copy_of("frf-9112");
    document(&["add", text(whole.path()), "payload"]);
    every_call_may_fail(
        |dir| copy_folder(whole.path(), dir),
        |dir| owned(&["undo", text(dir)]),
        |dir| revisions(dir) == 1,
        &ALL,
        false,
    );
    every_call_may_fail(
        |dir| copy_folder(whole.path(), dir),
        |dir| owned(&["add", text(dir), "time-delay"]),
        |dir| revisions(dir) == 3,
        &["ENOSPC"],
        false,
    );
}

#[test]
fn what_a_diagnosis_keeps_survives_every_failing_call() {
    if !can_trace() {
        return;
    }
    every_call_may_fail(
        |dir| copy_folder(&blind("force-9439"), dir),
        |dir| owned(&["diagnose", text(dir)]),
        |dir| {
            let kept = std::fs::read(dir.join("lobestone/diagnoses.json"));
            kept.is_ok_and(|kept| serde_json::from_slice::<Value>(&kept).is_ok())
        },
        &ALL,
        true,
    );
}

#[test]
fn a_campaign_is_begun_or_not() {
    if !can_trace() {
        return;
    }
    every_call_may_fail(
        |dir| {
            copy_folder(&blind("frf-9115"), dir);
            std::fs::remove_file(dir.join("campaign.toml")).unwrap();
        },
        |dir| owned(&["init", text(dir)]),
        |dir| {
            let begun = std::fs::read_to_string(dir.join("campaign.toml"));
            begun.is_ok_and(|text| text.ends_with('\n') && text.parse::<toml::Table>().is_ok())
        },
        &ALL,
        false,
    );
}

/// Two files that belong together.
#[test]
fn a_robot_is_exported_whole_or_not_at_all() {
    if !can_trace() {
        return;
    }
    every_call_may_fail(
        |dir| copy_folder(&blind("frf-9115"), dir),
        |dir| owned(&["model", text(dir), "--urdf", text(&dir.join("arm.urdf"))]),
        |dir| {
            let urdf = std::fs::read_to_string(dir.join("arm.urdf")).unwrap_or_default();
            let beside = std::fs::read_to_string(dir.join("arm.compliances.toml"));
            urdf.trim_end().ends_with("</robot>") && beside.is_ok_and(|t| t.parse::<toml::Table>().is_ok())
        },
        &["ENOSPC", "EINTR"],
        false,
    );
}

/// A folder of many files, and the truth next to it.
#[test]
fn a_simulated_campaign_is_there_with_its_truth_or_not_at_all() {
    if !can_trace() {
        return;
    }
    let count = std::cell::Cell::new(None);
    every_call_may_fail(
        |_| {},
        |dir| {
            let out = dir.join("cell");
            owned(&["simulate", "--out", text(&out), "--effect", "payload:mass_kg=25"])
        },
        |dir| {
            let files = content(dir);
            let whole = files.contains_key(Path::new("cell.truth.json"))
                && files.contains_key(Path::new("cell/campaign.toml"))
                && files.len() == count.get().unwrap_or(files.len());
            if whole {
                count.set(Some(files.len()));
            }
            whole
        },
        &["ENOSPC"],
        false,
    );
}

/// Runs a script in name spaces of its own, where it may mount; `None` where the machine does not allow that.
fn in_own_space(script: &str) -> Option<Output> {
    let unshare = |script: &str| {
        Command::new("unshare")
            .args(["--user", "--map-root-user", "--mount", "sh", "-c", script])
            .output()
    };
    let can = unshare("mount -t tmpfs -o size=64k tmpfs /mnt").is_ok_and(|o| o.status.success());
    if !can {
        eprintln!("skipped: nothing can be mounted here");
        return None;
    }
    Some(unshare(script).unwrap())
}

/// A file system of so many bytes, nearly full: what does not fit is told, and what was there is as it was.
#[test]
fn a_full_disk_leaves_the_campaign_as_it_was() {
    let whole = copy_of("frf-9112");
    document(&["add", text(whole.path()), "payload"]);
    let script = format!(
        "set -e; mount -t tmpfs -o size=1m tmpfs /mnt; cp -r {}/. /mnt; head -c 2000000 /dev/zero > /mnt/fill 2> /dev/null || true; \
         before=$(md5sum < /mnt/lobestone/revisions.json); set +e; {BINARY} add /mnt time-delay; status=$?; \
         after=$(md5sum < /mnt/lobestone/revisions.json); ls -A /mnt /mnt/lobestone; \
         [ \"$before\" = \"$after\" ] && echo the same; rm /mnt/fill; {BINARY} undo /mnt > /dev/null && echo usable; exit $status",
        text(whole.path())
    );
    let Some(run) = in_own_space(&script) else { return };
    let (out, told) = (
        String::from_utf8_lossy(&run.stdout),
        String::from_utf8_lossy(&run.stderr),
    );
    assert_eq!(run.status.code(), Some(1), "{out}{told}");
    assert!(
        told.contains("revisions.json: ") && told.contains("No space"),
        "{told}"
    );
    assert!(out.contains("the same") && out.contains("usable"), "{out}{told}");
    assert!(!out.contains(".revisions-"), "{out}");
}

/// Looking changes nothing, and what would change something says what it may not write.
#[test]
fn a_campaign_that_may_not_be_written_can_be_read() {
    let whole = copy_of("force-9439");
    let script = |command: &str| {
        let dir = text(whole.path());
        format!("mount --bind {dir} /mnt && mount -o remount,bind,ro /mnt && exec {BINARY} {command}")
    };
    for command in ["cfc /mnt", "compare /mnt", "history /mnt"] {
        let Some(run) = in_own_space(&script(command)) else {
            return;
        };
        assert!(
            run.status.success(),
            "{command}: {}",
            String::from_utf8_lossy(&run.stderr)
        );
    }
    for (command, file) in [
        ("add /mnt size-effect", "/mnt"),
        ("report /mnt", "/mnt/report"),
        ("init /mnt --force", "/mnt/campaign.toml"),
    ] {
        let Some(run) = in_own_space(&script(command)) else {
            return;
        };
        let told = String::from_utf8_lossy(&run.stderr);
        assert_eq!(run.status.code(), Some(1), "{command}: {told}");
        assert!(
            told.contains(file) && told.contains("Read-only"),
            "{command}: {told}"
        );
    }
    // A diagnosis is worth its answer, whether or not it can be kept.
    let Some(run) = in_own_space(&script("diagnose /mnt --json")) else {
        return;
    };
    let told = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(0), "{told}");
    assert!(serde_json::from_slice::<Value>(&run.stdout).is_ok());
    assert!(!whole.path().join("lobestone").exists());
}

/// Revisions of a day to come: the next one follows them all the same, and is the one that is taken back.
#[test]
fn a_clock_that_goes_backwards_changes_no_order() {
    let folder = copy_of("frf-9112");
    let dir = folder.path();
    document(&["add", text(dir), "payload"]);
    let file = dir.join("lobestone/revisions.json");
    let mut log: Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    for revision in log["revisions"].as_array_mut().unwrap() {
        assert!(revision["when"].is_string(), "{revision}");
        revision["when"] = "2999-12-31T23:59:59Z".into();
    }
    std::fs::write(&file, log.to_string()).unwrap();
    assert_eq!(document(&["add", text(dir), "time-delay"])["revision"], 2);
    let history = document(&["history", text(dir)]);
    let effects = |i: usize| history["revisions"][i]["effects"].clone();
    assert_eq!(effects(1), serde_json::json!(["payload"]));
    assert_eq!(effects(2), serde_json::json!(["payload", "time-delay"]));
    assert_eq!(document(&["undo", text(dir)])["undone"]["revision"], 2);
    // Files from the future, too.
    let later = std::time::SystemTime::now() + std::time::Duration::from_secs(400 * 24 * 3600);
    for name in ["campaign.toml", "lobestone/revisions.json"] {
        let file = std::fs::File::options()
            .append(true)
            .open(dir.join(name))
            .unwrap();
        file.set_modified(later).unwrap();
    }
    assert_eq!(document(&["compare", text(dir)])["revision"], 1);
}
