//! The loop as a conversation: every command names the next step, in the text and in the document, and it depends on what
//! was found. And what the text looks like: bars, and colours on terminals only.

use serde_json::Value;

use crate::support::{blind, copy_of, document, first_postures, lobestone, program};

/// The next step, which must be the same in document and text, and name the folder.
fn next(command: &str, dir: &str, rest: &[&str]) -> String {
    let arguments = [&[command, dir], rest].concat();
    let step = document(&arguments)["next_step"].as_str().unwrap().to_string();
    let text = lobestone(&arguments).stdout;
    assert_eq!(
        text.lines().last(),
        Some(format!("Next: {step}").as_str()),
        "{text}"
    );
    step
}

/// The command between backquotes, run as it stands there.
fn follow(step: &str) -> Value {
    let command = step.split('`').nth(1).unwrap();
    let words: Vec<&str> = command.split(' ').collect();
    assert_eq!(words[0], "lobestone", "{step}");
    document(&words[1..])
}

#[test]
fn following_the_steps_leads_through_the_loop() {
    let folder = copy_of("frf-9114");
    let dir = folder.path().to_str().unwrap();
    let file = folder.path().join("frf/p1.csv");
    let file = file.to_str().unwrap();
    assert!(next("inspect", file, &[]).contains(&format!("`lobestone compare {dir}`")));
    assert!(next("modal", dir, &[]).contains(&format!("`lobestone calibrate {dir}`")));
    assert!(next("model", dir, &[]).contains(&format!("`lobestone compare {dir}`")));
    let step = next("history", dir, &[]);
    assert!(step.contains(&format!("`lobestone diagnose {dir}`")), "{step}");

    let step = next("calibrate", dir, &[]);
    let compared = follow(&step);
    let step = compared["next_step"].as_str().unwrap();
    let nrms = compared["error"]["nrms"].as_f64().unwrap();
    // "error 41 %, …, mostly at 30–40 Hz in Y …": the number of the document, and a place in the measured band.
    assert!(
        step.starts_with(&format!("error {:.0}", 100.0 * nrms)) || nrms < 0.1,
        "{step}"
    );
    let mostly = &compared["mostly"];
    let (from, to) = (
        mostly["from_hz"].as_f64().unwrap(),
        mostly["to_hz"].as_f64().unwrap(),
    );
    assert!(
        step.contains(&format!("mostly at {from:.1}–{to:.1} Hz")),
        "{step}"
    );
    assert!(step.contains(&format!("`lobestone diagnose {dir}`")), "{step}");

    let diagnosed = follow(step);
    let step = diagnosed["next_step"].as_str().unwrap();
    assert!(
        step.contains(&format!("`lobestone add {dir} tool-flexibility`")),
        "{step}"
    );
    let added = follow(step);
    let step = added["next_step"].as_str().unwrap();
    assert!(step.contains(&format!("`lobestone diagnose {dir}`")), "{step}");
    let again = follow(step);
    assert_eq!(again["verdict"], "none");
    let step = again["next_step"].as_str().unwrap();
    assert!(step.contains(&format!("`lobestone report {dir}`")), "{step}");
    assert!(next("history", dir, &[]).contains("lobestone report"));
}

#[test]
fn what_was_no_progress_is_to_be_undone() {
    let folder = copy_of("frf-9000");
    let dir = folder.path().to_str().unwrap();
    assert!(next("compare", dir, &[]).contains("hardly more than noise"));
    let added = document(&["add", dir, "payload"]);
    assert_eq!(added["progress"], false);
    let step = added["next_step"].as_str().unwrap();
    assert!(step.contains(&format!("`lobestone undo {dir}`")), "{step}");
    assert_eq!(
        next("history", dir, &[]),
        "the last step was no progress: run `lobestone undo ".to_string() + dir + "` to take it back"
    );
    let undone = follow(step);
    assert!(
        undone["next_step"]
            .as_str()
            .unwrap()
            .contains("lobestone diagnose")
    );
}

#[test]
fn an_unknown_rest_asks_for_a_measurement() {
    let copy = copy_of("frf-9011");
    let dir = copy.path().to_str().unwrap();
    let diagnosed = document(&["diagnose", dir]);
    assert_eq!(diagnosed["verdict"], "unknown");
    let step = diagnosed["next_step"].as_str().unwrap();
    let advice = diagnosed["next_measurement"]["what"].as_str().unwrap();
    assert!(
        step.starts_with("measure ") && step.contains(&advice[..30]),
        "{step}"
    );
    assert!(step.contains(&format!("`lobestone diagnose {dir}`")), "{step}");
}

#[test]
fn forces_have_their_own_steps() {
    let dir = blind("force-9400");
    let dir = dir.to_str().unwrap();
    assert!(
        next("inspect", &format!("{dir}/force/cut01.txt"), &[]).contains(&format!("`lobestone cfc {dir}`"))
    );
    assert!(next("cfc", dir, &[]).contains(&format!("`lobestone compare {dir}`")));
    let step = next("compare", dir, &[]);
    assert!(step.contains("hardly more than noise"), "{step}");
}

#[test]
fn a_campaign_with_both_sides_names_the_side() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("two words");
    let cell = lobestone::builtin::FIRST_CELL.write(&dir).unwrap();
    let cell = cell.to_str().unwrap();
    let both = document(&["compare", cell]);
    let step = both["structure"]["next_step"].as_str().unwrap();
    assert_eq!(both["next_step"], step);
    assert!(step.contains(&format!("`lobestone lobes '{cell}'`")), "{step}");
    let diagnose = document(&["history", cell, "--domain", "cutting"]);
    let step = diagnose["next_step"].as_str().unwrap();
    assert!(
        step.contains(&format!("`lobestone diagnose '{cell}' --domain cutting`")),
        "{step}"
    );
}

#[test]
fn colours_are_for_terminals() {
    let few = first_postures("frf-9114", 2);
    let dir = few.path();
    let run = |environment: &[(&str, &str)], extra: &[&str]| {
        let output = program()
            .args(["compare", dir.to_str().unwrap()])
            .args(extra)
            .env_remove("NO_COLOR")
            .env_remove("CLICOLOR_FORCE")
            .envs(environment.iter().copied())
            .output()
            .unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    let plain = run(&[], &[]);
    assert!(!plain.contains('\u{1b}'), "a pipe is no terminal");
    let forced = run(&[("CLICOLOR_FORCE", "1")], &[]);
    assert!(forced.contains("\u{1b}[1mNext:\u{1b}[0m"), "{forced}");
    assert_eq!(anstream::adapter::strip_str(&forced).to_string(), plain);
    assert_eq!(run(&[("CLICOLOR_FORCE", "1"), ("NO_COLOR", "1")], &[]), plain);
    let json = run(&[("CLICOLOR_FORCE", "1")], &["--json"]);
    assert!(!json.contains('\u{1b}') && !json.contains("\\u001b"));
}

#[test]
fn bars_are_as_long_as_the_errors() {
    let few = first_postures("frf-9114", 2);
    let dir = few.path().to_str().unwrap();
    let text = lobestone(&["compare", dir]).stdout;
    let compared = document(&["compare", dir]);
    let table = text.split("  posture ").nth(1).unwrap();
    let rows: Vec<(&str, usize)> = table
        .lines()
        .skip(1)
        .take_while(|l| !l.is_empty())
        .map(|l| {
            let posture = l.split_whitespace().next().unwrap();
            (
                posture,
                l.chars().filter(|c| ('▏'..='█').contains(c) || *c == '█').count(),
            )
        })
        .collect();
    let error = |p: &str| compared["by_posture"][p].as_f64().unwrap();
    let largest = rows.iter().map(|(p, _)| error(p)).fold(0.0, f64::max);
    assert!(rows.len() > 1);
    for (posture, bar) in rows {
        let wanted = 20.0 * error(posture) / largest;
        assert!(
            (bar as f64 - wanted).abs() <= 1.0,
            "{posture}: {bar} for {wanted}"
        );
    }
}
