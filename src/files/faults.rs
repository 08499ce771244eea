//! Calls that fail one after the other, and what that leaves behind.

use std::cell::RefCell;
use std::collections::VecDeque;

use super::*;

/// What the next calls of this thread come to; those behind them succeed.
struct Plan {
    fate: VecDeque<Option<io::Error>>,
    made: Vec<Call>,
}

thread_local! {
    static PLAN: RefCell<Option<Plan>> = const { RefCell::new(None) };
}

pub(super) fn fails(which: Call) -> io::Result<()> {
    PLAN.with_borrow_mut(|plan| {
        let Some(plan) = plan else { return Ok(()) };
        plan.made.push(which);
        plan.fate.pop_front().flatten().map_or(Ok(()), Err)
    })
}

/// Numbers of errors on Linux: disk full, disk broken, quota, interrupted by a signal.
const ENOSPC: i32 = 28;
const EIO: i32 = 5;
const EDQUOT: i32 = 122;
const EINTR: i32 = 4;

/// Does `work` with the call behind the first `before` of them failing as `errno` says; what it came to, and the calls made.
fn with_fault<T>(before: usize, errno: i32, work: impl FnOnce() -> T) -> (T, Vec<Call>) {
    let fate = (0..before)
        .map(|_| None)
        .chain([Some(io::Error::from_raw_os_error(errno))]);
    let plan = Plan {
        fate: fate.collect(),
        made: Vec::new(),
    };
    PLAN.set(Some(plan));
    let done = work();
    (done, PLAN.take().map_or_else(Vec::new, |plan| plan.made))
}

/// Lets every call of `work` fail in turn, in every way. `work` gets a folder that `prepare` made; `is_old` and `is_new` say
/// what it holds.
pub(crate) fn every_fault<T>(
    prepare: impl Fn(&Path),
    work: impl Fn(&Path) -> Result<T>,
    is_old: impl Fn(&Path) -> bool,
    is_new: impl Fn(&Path) -> bool,
    named: &str,
) {
    let mut calls = 0;
    for errno in [ENOSPC, EIO, EDQUOT, EINTR] {
        for at in 0.. {
            let folder = tempfile::tempdir().unwrap();
            let dir = folder.path();
            prepare(dir);
            let (done, made) = with_fault(at, errno, || work(dir));
            calls = calls.max(made.len());
            if at >= made.len() {
                // The fault lies behind the last call.
                assert!(done.is_ok() && is_new(dir));
                break;
            }
            let failed = made[at];
            match done {
                Ok(_) => assert!(errno == EINTR && is_new(dir), "{failed:?} {errno}"),
                Err(error) => {
                    let said = error.to_string();
                    assert!(errno != EINTR, "{failed:?}: {said}");
                    assert!(said.contains(named), "{said}");
                    assert_eq!(
                        is_new(dir),
                        failed == Call::SyncFolder,
                        "{failed:?} {errno}: {said}"
                    );
                    assert_eq!(
                        is_old(dir),
                        failed != Call::SyncFolder,
                        "{failed:?} {errno}: {said}"
                    );
                    assert_eq!(
                        said.contains("the file is written"),
                        failed == Call::SyncFolder,
                        "{said}"
                    );
                }
            }
        }
    }
    assert!((3..100).contains(&calls), "{calls} calls");
}

fn names(dir: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(dir).unwrap();
    entries
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect()
}

/// Three pieces.
fn new() -> Vec<u8> {
    vec![b'n'; 2 * PIECE + 5]
}

fn holds(dir: &Path, content: &[u8]) -> bool {
    names(dir) == ["f"] && std::fs::read(dir.join("f")).unwrap() == content
}

#[test]
fn a_fault_leaves_the_old_file_or_the_new_one_and_nothing_beside_it() {
    let old = |dir: &Path| std::fs::write(dir.join("f"), "old").unwrap();
    let (is_old, is_new) = (|dir: &Path| holds(dir, b"old"), |dir: &Path| holds(dir, &new()));
    every_fault(
        old,
        |dir| write_atomically(&dir.join("f"), &new()),
        is_old,
        is_new,
        "f: ",
    );
    every_fault(
        old,
        |dir| write_durably(&dir.join("f"), &new(), ".x-"),
        is_old,
        is_new,
        "f: ",
    );
}

/// Also where the error was put in other words on its way, and where the writer went on regardless.
#[test]
fn a_fault_in_a_stream_leaves_the_old_file_or_the_new_one() {
    let old = |dir: &Path| std::fs::write(dir.join("f"), "old").unwrap();
    let (is_old, is_new) = (|dir: &Path| holds(dir, b"old"), |dir: &Path| holds(dir, &new()));
    let halves = |out: &mut dyn Write| {
        let new = new();
        let (first, second) = new.split_at(PIECE + 7);
        (out.write_all(first), out.write_all(second))
    };
    let reworded = |dir: &Path| {
        write_streamed(&dir.join("f"), |out| match halves(out) {
            (Ok(()), Ok(())) => Ok(()),
            _ => Err(Error::computation("other words")),
        })
    };
    every_fault(old, reworded, is_old, is_new, "f: ");
    let regardless = |dir: &Path| {
        write_streamed(&dir.join("f"), |out| {
            let _ = halves(out);
            Ok(())
        })
    };
    every_fault(old, regardless, is_old, is_new, "f: ");
    // What the writer itself finds wrong.
    let dir = tempfile::tempdir().unwrap();
    old(dir.path());
    let refused = write_streamed(&dir.path().join("f"), |out| {
        out.write_all(b"new").unwrap();
        Err::<(), _>(Error::computation("other words"))
    });
    assert!(refused.unwrap_err().to_string().contains("other words"));
    assert!(is_old(dir.path()));
}

#[test]
fn a_fault_leaves_no_file_where_there_was_none() {
    let none = |dir: &Path| names(dir).is_empty();
    let is_new = |dir: &Path| holds(dir, &new());
    every_fault(
        |_| {},
        |dir| write_new(&dir.join("f"), &new()),
        none,
        is_new,
        "f: ",
    );
}

#[test]
fn a_file_that_is_there_already_stays() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("f");
    assert!(write_new(&file, b"one").unwrap());
    assert!(!write_new(&file, b"two").unwrap());
    assert!(holds(dir.path(), b"one"));
}

#[test]
fn a_write_asks_for_what_it_promises() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("f");
    let made = |write: &dyn Fn() -> Result<()>| {
        let (done, made) = with_fault(99, EIO, write);
        done.unwrap();
        made
    };
    use Call::*;
    assert_eq!(made(&|| write_atomically(&file, b"x")), [Create, Write, Rename]);
    assert_eq!(
        made(&|| write_durably(&file, b"x", ".x-")),
        [Create, Write, Sync, Rename, SyncFolder]
    );
}
