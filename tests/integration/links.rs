//! Link parameters that are not those of the robot file (`calibrate --free`), on a campaign of an independent program
//! (`scripts/link_campaign.py`).

use serde_json::Value;

use crate::support::{blind, copy_folder, document, lobestone};

fn parameter<'d>(document: &'d Value, name: &str) -> &'d Value {
    let all = document["parameters"].as_array().unwrap();
    all.iter()
        .find(|p| p["name"] == name)
        .unwrap_or_else(|| panic!("no {name}"))
}

fn campaign() -> (tempfile::TempDir, String) {
    let from = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/links/both");
    let dir = tempfile::tempdir().unwrap();
    copy_folder(&from, dir.path());
    let name = dir.path().to_str().unwrap().to_string();
    (dir, name)
}

/// Link 4 turns harder than its file says (31 → 60 kg·m²) and joint 4 is 20 mm longer, joint stiffnesses are off by up to 30 %.
#[test]
fn inertia_and_length_are_found() {
    let (_dir, dir) = campaign();
    let found = document(&["calibrate", &dir, "--free", "inertias,lengths"]);
    let value = |name: &str| {
        let p = parameter(&found, name);
        (p["value"].as_f64().unwrap(), p["std_error"].as_f64().unwrap())
    };
    for (axis, truth) in [("x", 60.0), ("y", 60.0)] {
        let (inertia, error) = value(&format!("link-4.inertia-{axis}"));
        assert!((inertia / truth - 1.0).abs() < 0.05, "{axis} {inertia} ± {error}");
        assert!(
            (inertia - truth).abs() < 4.0 * error,
            "{axis} {inertia} ± {error}"
        );
    }
    let (d, error) = value("joint-4.d");
    assert!(
        (d - 1.1654).abs() < 1e-3 && (d - 1.1654).abs() < 4.0 * error,
        "{d} ± {error}"
    );
    for (joint, truth) in [1.55e6, 1.785e6, 1.926e6, 5.153e5, 3.19e5, 5.415e5]
        .iter()
        .enumerate()
    {
        let (stiffness, error) = value(&format!("joint-{}.stiffness", joint + 1));
        assert!(
            (stiffness - truth).abs() < 4.0 * error.max(1e-3 * truth),
            "{joint} {stiffness} ± {error}"
        );
    }
    assert_eq!(found["freed"]["is_progress"], true);
    let departing = found["freed"]["departing"].as_array().unwrap();
    assert_eq!(departing.len(), 3, "{departing:?}");
    assert!(found["reduced_chi2"].as_f64().unwrap() < 1.1);
    let number = |key: &str| found["freed"][key].as_f64().unwrap();
    assert!(number("held_out_nrms_after") < 0.5 * number("held_out_nrms_before"));
}

/// Links that are not those of the file are no effect: `diagnose` says which numbers explain what is left, and what to run next.
#[test]
fn diagnose_says_that_the_robot_file_is_wrong() {
    let (_dir, name) = campaign();
    let found = document(&["diagnose", &name]);
    assert_eq!(found["verdict"], "unknown");
    let wrong = &found["wrong_links"];
    let departing = wrong["departing"].as_array().unwrap();
    let of = |name: &str| departing.iter().find(|p| p["name"] == name);
    for (name, truth, within) in [
        ("link-4.inertia-x", 60.0, 3.0),
        ("link-4.inertia-y", 60.0, 3.0),
        ("joint-4.d", 1.1654, 1e-3),
    ] {
        let fitted = of(name).unwrap_or_else(|| panic!("{name}: {wrong}"))["value"].as_f64();
        assert!((fitted.unwrap() - truth).abs() < within, "{name} {fitted:?}");
    }
    // Each is off by what no error of the fit brings.
    for p in departing {
        let number = |key: &str| p[key].as_f64().unwrap();
        assert!(
            (number("value") - number("initial")).abs() > 3.0 * number("std_error"),
            "{p}"
        );
    }
    assert!(wrong["explained_share"].as_f64().unwrap() > 0.99);
    let next = found["next_step"].as_str().unwrap();
    assert!(next.contains("--free links"), "{next}");
}

/// The keys of `[robot]` do what `--free` does.
#[test]
fn tolerances_in_the_campaign_free_for_good() {
    let (dir, name) = campaign();
    let file = dir.path().join("campaign.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    let keys = "model = \"irb6640\"\ninertia_tolerance = 0.4\nlength_tolerance_mm = 10.0";
    std::fs::write(&file, text.replace("model = \"irb6640\"", keys)).unwrap();
    let found = document(&["calibrate", &name]);
    let d = parameter(&found, "joint-4.d")["value"].as_f64().unwrap();
    assert!((d - 1.1654).abs() < 1e-3, "{d}");
    assert!(found["freed"].is_null());
    let run = lobestone(&["diagnose", &name]);
    assert!(run.stdout.contains("NOTHING is missing"), "{}", run.stdout);

    // What goes out as a URDF is the robot as calibrated, and it comes in again.
    let out = dir.path().join("out.urdf");
    let said = document(&["model", &name, "--urdf", out.to_str().unwrap()]);
    let again = tempfile::tempdir().unwrap();
    let cell = again.path().to_str().unwrap();
    let posture = "p1=135,-2,53,83,30,-117";
    let made = document(&[
        "init",
        cell,
        "--robot",
        out.to_str().unwrap(),
        "--posture",
        posture,
    ]);
    assert_eq!(made["complete"], true, "{made}");
    let back = document(&["model", cell]);
    let (fitted, back) = (&said["calibrated_postures"][0], &back["postures"][0]);
    let list = |values: &Value| -> Vec<f64> {
        let all = values.as_array().unwrap().iter();
        all.map(|v| v.as_f64().unwrap()).collect()
    };
    for key in [
        "natural_frequencies_hz",
        "tcp_m",
        "centre_of_mass_m",
        "gravity_torques_nm",
    ] {
        let [expected, found] = [fitted, back].map(|posture| list(&posture[key]));
        assert_eq!(expected.len(), found.len());
        for (e, f) in expected.iter().zip(&found) {
            assert!((e - f).abs() < 1e-9 * e.abs().max(1.0), "{key} {e} {f}");
        }
    }
}

/// What `--free` found is kept in a robot file, with which the campaign calibrates to the same error.
#[test]
fn what_was_found_is_kept() {
    let (dir, name) = campaign();
    let file = dir.path().join("fitted.toml");
    let arguments = [
        "calibrate",
        &name,
        "--free",
        "inertias,lengths",
        "--write-robot",
        file.to_str().unwrap(),
    ];
    let found = document(&arguments);
    assert_eq!(found["freed"]["robot_file"], file.to_str().unwrap());
    assert_eq!(found["freed"]["is_believable"], true);
    let text = std::fs::read_to_string(&file).unwrap();
    for words in [
        "# inertia-x fitted: ",
        "in irb6640",
        "# d fitted: ",
        "Made by lobestone of irb6640",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let run = lobestone(&arguments);
    assert!(
        run.status == Some(1) && run.stderr.contains("is there already"),
        "{}",
        run.stderr
    );
    let elsewhere = [
        "calibrate",
        &name,
        "--free",
        "lengths",
        "--write-robot",
        "fitted.toml",
    ];
    let run = lobestone(&elsewhere);
    assert!(
        run.status == Some(1) && run.stderr.contains("not in the campaign's folder"),
        "{}",
        run.stderr
    );
    let told = dir.path().join("campaign.toml");
    let campaign = std::fs::read_to_string(&told).unwrap();
    std::fs::write(
        &told,
        campaign.replace("model = \"irb6640\"", "model = \"fitted.toml\""),
    )
    .unwrap();
    let kept = document(&["calibrate", &name]);
    let error = |document: &Value| document["error"]["nrms"].as_f64().unwrap();
    assert!(
        (error(&kept) / error(&found) - 1.0).abs() < 1e-4,
        "{} {}",
        error(&kept),
        error(&found)
    );
    let left = document(&["calibrate", &name, "--free", "inertias,lengths"]);
    assert_eq!(
        left["freed"]["departing"].as_array().unwrap().len(),
        0,
        "{}",
        left["freed"]
    );
}

/// Where the links are those of the file, freeing all of them changes nothing, and the program says so.
#[test]
fn nothing_is_freed_that_should_not_be() {
    let dir = blind("frf-9112");
    let dir = dir.to_str().unwrap();
    let found = document(&["calibrate", dir, "--free", "links"]);
    let freed = &found["freed"];
    assert_eq!(freed["departing"].as_array().unwrap().len(), 0, "{freed}");
    assert!(freed["parameters_freed"].as_u64().unwrap() > 40);
    assert_eq!(freed["is_progress"], false);
    let number = |key: &str| freed[key].as_f64().unwrap();
    assert!(number("held_out_nrms_after") < 1.001 * number("held_out_nrms_before"));
    let unsaid = found["undetermined"]["by_itself"].as_array().unwrap();
    assert!(!unsaid.is_empty());
    let run = lobestone(&["calibrate", dir, "--free", "inertias"]);
    assert!(run.stdout.contains("agree with the robot file"), "{}", run.stdout);
}

/// Numbers that predict left-out postures no better may be what the file says, and are not offered to be kept.
#[test]
fn what_predicts_nothing_better_is_not_called_wrong() {
    let dir = blind("frf-9216");
    let run = lobestone(&["calibrate", dir.to_str().unwrap(), "--free", "links"]);
    for words in [
        "fit better with other values than the robot file's",
        "leave them as they are",
    ] {
        assert!(run.stdout.contains(words), "{words}: {}", run.stdout);
    }
    for words in ["cannot be what", "--write-robot"] {
        assert!(!run.stdout.contains(words), "{words}: {}", run.stdout);
    }
}

#[test]
fn walls_of_rigid_links_are_refused() {
    let dir = blind("frf-9112");
    let run = lobestone(&["calibrate", dir.to_str().unwrap(), "--free", "walls"]);
    assert_eq!(run.status, Some(1));
    assert!(
        run.stderr.contains("rigid") && run.stderr.contains("add "),
        "{}",
        run.stderr
    );
}
