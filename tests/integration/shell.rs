//! `explain`, `completions` and `man`.

use crate::support::{document, lobestone, program};

#[test]
fn every_effect_is_listed_and_explained() {
    let list = document(&["explain"]);
    let effects = list["effects"].as_array().unwrap();
    assert_eq!(effects.len(), 19 + 15);
    let text = lobestone(&["explain"]).stdout;
    for effect in effects {
        let id = effect["effect"].as_str().unwrap();
        assert!(text.contains(&format!("  {id}\n")), "{id}");
        let one = document(&["explain", id]);
        assert_eq!(one["effect"], id);
        assert_eq!(one["lab_check"], effect["lab_check"]);
        let page = lobestone(&["explain", id]).stdout;
        for part in [
            "What it is",
            "How it shows",
            "How to check it in the lab",
            "Usual sizes",
            "Sources",
        ] {
            assert!(page.contains(part), "{id}: {part}");
        }
    }
    let sited = document(&["explain", "joint-transverse-compliance@joint-3"]);
    assert_eq!(sited["effect"], "joint-transverse-compliance");
    assert!(sited["sites"].as_array().unwrap().contains(&"joint-3".into()));
}

#[test]
fn an_unknown_effect_gets_its_nearest() {
    let run = lobestone(&["explain", "runnout"]);
    assert_eq!(run.status, Some(1));
    assert!(run.stderr.contains("did you mean runout?"), "{}", run.stderr);
    assert_eq!(run.stdout, "");
}

#[test]
fn completions_know_the_commands() {
    for shell in ["bash", "zsh", "fish", "powershell"] {
        let run = lobestone(&["completions", shell]);
        assert_eq!(run.status, Some(0), "{}", run.stderr);
        for word in ["diagnose", "init", "cut-list", "no-questions"] {
            assert!(run.stdout.contains(word), "{shell}: {word}");
        }
    }
    assert_eq!(lobestone(&["completions", "ksh"]).status, Some(2));
}

#[test]
fn manual_pages_are_written() {
    let page = lobestone(&["man"]).stdout;
    assert!(page.contains(".TH lobestone 1"), "{}", &page[..200]);
    assert!(page.contains("diagnose"));
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("man1");
    let written = document(&["man", "--out", dir.to_str().unwrap()]);
    for file in written["files"].as_array().unwrap() {
        let text = std::fs::read_to_string(file.as_str().unwrap()).unwrap();
        assert!(text.contains(".SH NAME"), "{file}");
    }
    let init = std::fs::read_to_string(dir.join("lobestone-init.1")).unwrap();
    assert!(init.contains("cut\\-list"), "{init}");
}

/// Every command stands in a group of the help, with an example that begins with its name.
#[test]
fn the_help_has_every_command_in_a_group() {
    let help = program().arg("--help").output().unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    let groups = [
        "Begin",
        "Find what the model lacks",
        "Grow the model",
        "Measure and cut",
        "Write and try out",
    ];
    assert!(groups.iter().all(|g| help.lines().any(|l| l == *g)), "{help}");
    let man = program().args(["man", "--json"]).output().unwrap();
    let man: serde_json::Value = serde_json::from_slice(&man.stdout).unwrap();
    let page = man["page"].as_str().unwrap().replace("\\-", "-");
    let commands: Vec<&str> = page
        .lines()
        .filter_map(|l| l.strip_prefix("lobestone-")?.strip_suffix("(1)"))
        .filter(|c| *c != "help")
        .collect();
    assert!(commands.len() > 20, "{commands:?}");
    for command in commands {
        let line = help
            .lines()
            .find(|l| l.trim_start().starts_with(&format!("{command} ")));
        let line = line.unwrap_or_else(|| panic!("{command} is in no group"));
        assert!(line.contains(&format!("lobestone {command}")), "{line}");
    }
    assert!(help.lines().all(|l| l.chars().count() <= 100), "{help}");
}

#[test]
fn colours_quiet_and_jobs_are_as_asked_for() {
    let run = |arguments: &[&str]| {
        let output = program().args(arguments).output().unwrap();
        assert!(output.status.success(), "{arguments:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let plain = run(&["explain", "payload"]);
    assert!(!plain.contains('\u{1b}'), "no terminal here");
    let coloured = run(&["explain", "payload", "--color", "always"]);
    assert!(coloured.contains("\u{1b}[1mpayload\u{1b}[0m"), "{coloured:?}");
    assert_eq!(anstream::adapter::strip_str(&coloured).to_string(), plain);
    assert_eq!(run(&["--color", "never", "explain", "payload"]), plain);
    assert!(run(&["explain"]).contains("Next:"));
    assert!(!run(&["explain", "-q"]).contains("Next:"));
    assert_eq!(run(&["explain", "payload", "--jobs", "1"]), plain);
    let wrong = program().args(["explain", "--jobs", "0"]).output().unwrap();
    assert_eq!(wrong.status.code(), Some(2));
}

/// A full disk is told; a reader who has seen enough is not.
#[test]
#[cfg(target_os = "linux")]
fn what_cannot_be_printed_is_a_failure_unless_nobody_reads() {
    for more in [&[][..], &["--json"]] {
        let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
        let output = program().arg("explain").args(more).stdout(full).output().unwrap();
        assert_eq!(output.status.code(), Some(1));
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(told.contains("stdout: cannot be written"), "{told}");

        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let output = program()
            .arg("explain")
            .args(more)
            .stdout(writer)
            .output()
            .unwrap();
        assert!(output.status.success());
        assert_eq!(String::from_utf8_lossy(&output.stderr), "");
    }
}
