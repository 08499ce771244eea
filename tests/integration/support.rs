//! Running the program, and the practice campaigns under `tests/data/blind`.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// What a run of the program left behind.
pub struct Run {
    pub status: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

/// Keys of the cutting coefficients in documents.
pub const COEFFICIENTS: [&str; 6] = [
    "ktc_n_per_mm2",
    "krc_n_per_mm2",
    "kac_n_per_mm2",
    "kte_n_per_mm",
    "kre_n_per_mm",
    "kae_n_per_mm",
];

/// The program, ready for arguments.
pub fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_lobestone"))
}

pub fn lobestone(arguments: &[&str]) -> Run {
    // Tests run side by side, and `diagnose` keeps what it found in the campaign's folder.
    let in_place = match arguments {
        ["diagnose", dir, ..] => Path::new(dir).starts_with(blind("")),
        _ => false,
    };
    assert!(
        !in_place,
        "{arguments:?} writes into a campaign that other tests copy: use copy_of"
    );
    let output = program().args(arguments).output().unwrap();
    Run {
        status: output.status.code(),
        stdout: String::from_utf8(output.stdout).expect("stdout is UTF-8"),
        stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
    }
}

/// The document of a command that must succeed: stdout holds it and nothing else.
pub fn document(arguments: &[&str]) -> Value {
    let run = lobestone(&[arguments, &["--json"]].concat());
    assert_eq!(run.status, Some(0), "{arguments:?}: {}", run.stderr);
    serde_json::from_str(&run.stdout).unwrap_or_else(|e| panic!("{arguments:?}: {e}: {}", run.stdout))
}

pub fn blind(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data/blind")
        .join(name)
}

/// The first postures of a campaign, each with its file.
pub fn first_postures(name: &str, count: usize) -> tempfile::TempDir {
    let few = copy_of(name);
    let file = few.path().join("campaign.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    let end = text.match_indices("[[posture]]").nth(count).unwrap().0;
    std::fs::write(&file, &text[..end]).unwrap();
    few
}

pub fn truth(name: &str) -> Value {
    let file = blind("truth").join(format!("{name}.json"));
    serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap()
}

/// A copy of a practice campaign that a test may spoil.
pub fn copy_of(name: &str) -> tempfile::TempDir {
    let copy = tempfile::tempdir().unwrap();
    copy_folder(&blind(name), copy.path());
    copy
}

pub fn copy_folder(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy_folder(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// Adds tables to a campaign's file.
pub fn append(campaign: &Path, toml: &str) {
    let file = campaign.join("campaign.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(file, text + toml).unwrap();
}
