//! `lobestone compare` for an expert's eye: modes that stay where they are, FRAC, and the joint that the misfit points at.

use super::book::assert_documented;
use super::support::*;
use serde_json::Value;

fn compared(options: &[&str]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("cell");
    let dir = dir.to_str().unwrap();
    document(&[&["simulate", "--out", dir, "--lines-hz", "0.4"], options].concat());
    document(&["compare", dir])
}

fn places(document: &Value) -> Vec<String> {
    let all = document["located"].as_array().unwrap();
    all.iter()
        .map(|l| l["place"].as_str().unwrap().to_string())
        .collect()
}

#[test]
fn the_misfit_points_at_the_joint_that_gives_way() {
    for (seed, site) in [
        ("41", "joint-4"),
        ("42", "joint-4"),
        ("43", "joint-4"),
        ("44", "joint-2"),
    ] {
        let effect = format!("joint-transverse-compliance@{site}");
        let found = compared(&["--effect", &effect, "--seed", seed]);
        assert_documented("compare", &found);
        assert_eq!(places(&found)[0], site, "seed {seed}: {}", found["located"]);
        let share = found["located"][0]["share"].as_f64().unwrap();
        assert!((0.7..1.1).contains(&share), "seed {seed}: {share}");
        let said = found["stands_out"].to_string();
        assert!(
            said.contains(&format!("points at {}", site.replace('-', " "))),
            "{said}"
        );
    }
}

#[test]
fn where_only_noise_is_left_nothing_is_pointed_at() {
    for seed in ["51", "52"] {
        let found = compared(&["--seed", seed]);
        assert!(places(&found).is_empty(), "{}", found["located"]);
        assert_eq!(found["fixed_modes"], serde_json::json!([]));
        for frf in found["frfs"].as_array().unwrap() {
            // Null where a point does not move at all in the model.
            assert!(frf["frac"].as_f64().is_none_or(|f| (0.0..=1.0).contains(&f)));
        }
    }
}
