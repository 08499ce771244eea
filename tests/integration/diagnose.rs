//! `lobestone diagnose` on campaigns whose truth the program does not see.

use crate::support::{copy_of, document, truth};

fn verdict(name: &str) -> serde_json::Value {
    let copy = copy_of(name);
    document(&["diagnose", copy.path().to_str().unwrap()])
}

#[test]
fn nothing_is_found_where_nothing_is_hidden() {
    let found = verdict("frf-9112");
    assert_eq!(found["verdict"], "none");
    assert!(found["effect"].is_null() && found["site"].is_null());
}

#[test]
fn a_hidden_effect_is_named_with_its_parameters() {
    for (name, keys) in [
        (
            "frf-9114",
            vec![
                ("mass_kg", "mass_kg"),
                ("frequency_hz", "frequency_hz"),
                ("damping_ratio", "zeta"),
            ],
        ),
        ("frf-9115", vec![]),
    ] {
        let found = verdict(name);
        let truth = truth(name);
        assert_eq!(found["verdict"], "effect", "{name}");
        assert_eq!(found["effect"], truth["effect"], "{name}");
        assert_eq!(found["site"], truth["site"], "{name}");
        let best = &found["candidates"][0];
        assert_eq!(best["effect"], truth["effect"]);
        let held_out = best["held_out_nrms"].as_f64().unwrap();
        assert!(held_out < found["baseline"]["held_out_nrms"].as_f64().unwrap());
        for (ours, theirs) in keys {
            let value = best["parameters"][ours].as_f64().unwrap();
            let expected = truth["parameters"][theirs].as_f64().unwrap();
            assert!(
                (value / expected - 1.0).abs() < 0.03,
                "{name} {ours}: {value}, {expected}"
            );
        }
    }
}

/// A posture or two of campaigns that an independent program made: a site among three, a flexible arm (many coordinates),
/// a rocking base seen from the tool only.
#[test]
fn effects_with_and_without_a_site_are_named() {
    for (name, key) in [
        ("frf-9007", "frequency_hz"),
        ("frf-9001", "young_pa"),
        ("frf-9113", "rocking_nm_per_rad"),
    ] {
        let found = verdict(name);
        let truth = truth(name);
        assert_eq!(found["verdict"], "effect", "{name}");
        assert_eq!(found["effect"], truth["effect"], "{name}");
        assert_eq!(found["site"], truth["site"], "{name}");
        assert!(found["confidence"].as_f64().unwrap() > 0.9, "{name}");
        let best = &found["candidates"][0];
        let value = best["parameters"][key].as_f64().unwrap();
        let expected = truth["parameters"][key].as_f64().unwrap();
        assert!(
            (value / expected - 1.0).abs() < 0.02,
            "{name}: {value}, {expected}"
        );
    }
}

#[test]
fn physics_that_the_library_does_not_have_is_unknown() {
    let found = verdict("frf-9011");
    assert_eq!(found["verdict"], "unknown");
    assert!(found["effect"].is_null());
    assert!(found["confidence"].as_f64().unwrap() > 0.5);
}

/// Diagnose, add, diagnose, add, diagnose: two hidden effects are found one after the other, and then nothing.
#[test]
fn two_effects_are_found_one_after_the_other() {
    let dir = copy_of("frf-9302");
    let path = dir.path().to_str().unwrap();
    let truth = truth("frf-9302");
    let mut hidden = vec![
        truth["effect"].as_str().unwrap().to_string(),
        truth["also"][0]["effect"].as_str().unwrap().to_string(),
    ];
    let mut error = f64::INFINITY;
    for _ in 0..2 {
        let found = document(&["diagnose", path]);
        assert_eq!(found["verdict"], "effect");
        let effect = found["effect"].as_str().unwrap();
        let at = hidden.iter().position(|h| h == effect).expect(effect);
        hidden.remove(at);
        let added = document(&["add", path, effect]);
        assert_eq!(added["progress"], true);
        let nrms = added["after"]["held_out_nrms"].as_f64().unwrap();
        assert!(nrms < error && nrms < added["before"]["held_out_nrms"].as_f64().unwrap());
        error = nrms;
    }
    let last = document(&["diagnose", path]);
    assert_eq!(last["verdict"], "none");
    let history = document(&["history", path]);
    assert_eq!(history["revisions"].as_array().unwrap().len(), 3);
}

/// Force records of an independent program, under names that say nothing.
#[test]
fn cutting_campaigns_are_diagnosed_by_the_same_loop() {
    for name in ["force-9400", "force-9439"] {
        let found = verdict(name);
        let truth = truth(name);
        assert_eq!(found["domain"], "cutting");
        match truth["effect"].as_str().unwrap() {
            "none" => assert_eq!(found["verdict"], "none", "{name}"),
            hidden => {
                assert_eq!(found["verdict"], "effect", "{name}");
                assert_eq!(found["effect"], hidden, "{name}");
            }
        }
    }
}

#[test]
fn a_side_that_the_campaign_does_not_have_is_refused_plainly() {
    let copy = copy_of("frf-9112");
    let dir = copy.path().to_str().unwrap();
    let run = crate::support::lobestone(&["diagnose", dir, "--domain", "cutting"]);
    assert_eq!(run.status, Some(1));
    assert!(run.stderr.contains("no [[cut]]"), "{}", run.stderr);
}

/// A cutting effect that is not there: added, judged by cuts left out, called what it is, and taken back.
#[test]
fn a_wrong_cutting_effect_is_no_progress() {
    let dir = copy_of("force-9439");
    let path = dir.path().to_str().unwrap();
    let added = document(&["add", path, "tool-wear"]);
    assert_eq!(added["domain"], "cutting");
    assert_eq!(added["progress"], false);
    assert_eq!(added["effects"], serde_json::json!(["tool-wear"]));
    let history = document(&["history", path]);
    assert_eq!(history["revisions"].as_array().unwrap().len(), 2);
    assert_eq!(document(&["diagnose", path])["effects"], added["effects"]);
    assert_eq!(document(&["undo", path])["revision"], 0);
    assert_eq!(document(&["compare", path])["domain"], "cutting");
}
