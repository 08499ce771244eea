//! `explain`, `completions` and `man`.

use crate::support::{document, lobestone};

#[test]
fn every_effect_is_listed_and_explained() {
    let list = document(&["explain"]);
    let effects = list["effects"].as_array().unwrap();
    assert_eq!(effects.len(), 23);
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
