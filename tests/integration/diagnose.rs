//! `lobestone diagnose` on campaigns whose truth the program does not see.

use crate::support::{blind, document, truth};

fn verdict(name: &str) -> serde_json::Value {
    let dir = blind(name);
    document(&["diagnose", dir.to_str().unwrap()])
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

#[test]
fn the_cutting_side_is_refused_plainly() {
    let dir = blind("frf-9112");
    let run = crate::support::lobestone(&["diagnose", dir.to_str().unwrap(), "--domain", "cutting"]);
    assert_eq!(run.status, Some(1));
    assert!(run.stderr.contains("--domain"), "{}", run.stderr);
}
