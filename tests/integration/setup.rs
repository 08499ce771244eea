//! Wrong files before missing physics: mistakes made in practice campaigns, and what the commands say of them first.

use std::path::Path;

use serde_json::Value;

use crate::support::{copy_of, document, lobestone};

/// Replaces text in a campaign's file; it must be there.
fn replace(campaign: &Path, from: &str, to: &str) {
    let file = campaign.join("campaign.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(text.contains(from), "{from}");
    std::fs::write(file, text.replace(from, to)).unwrap();
}

/// The most likely finding, if it is believed.
fn finding(document: &Value) -> Option<&Value> {
    let setup = document["setup"].as_array().expect("setup is a list");
    setup.first().filter(|f| f["confidence"].as_f64().unwrap() >= 0.5)
}

#[test]
fn a_right_campaign_has_no_finding() {
    for name in ["frf-9000", "frf-9112"] {
        let copy = copy_of(name);
        let dir = copy.path().to_str().unwrap();
        let calibrated = document(&["calibrate", dir]);
        assert_eq!(finding(&calibrated), None, "{name}");
    }
    let copy = copy_of("force-9400");
    assert_eq!(finding(&document(&["cfc", copy.path().to_str().unwrap()])), None);
}

/// Two postures' files exchanged in campaign.toml.
#[test]
fn exchanged_files_are_named_with_the_remedy() {
    let copy = copy_of("frf-9000");
    replace(copy.path(), "frf/p2.uff", "frf/other.uff");
    replace(copy.path(), "frf/p5.uff", "frf/p2.uff");
    replace(copy.path(), "frf/other.uff", "frf/p5.uff");
    let dir = copy.path().to_str().unwrap();
    let calibrated = document(&["calibrate", dir]);
    let found = finding(&calibrated).expect("a finding");
    assert_eq!(found["kind"], "posture-swap", "{found}");
    let remedy = found["remedy"].as_str().unwrap();
    assert!(remedy.contains("Swap the files of p2 and p5"), "{remedy}");
    let text = lobestone(&["calibrate", dir]).stdout;
    assert!(text.starts_with("SETUP"), "{text}");
}

/// An encoder 0.5° off at all postures: the verdict is no effect, and the offset is told with its error.
#[test]
fn an_encoder_offset_is_no_missing_physics() {
    let copy = copy_of("frf-9000");
    let file = copy.path().join("campaign.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    let turned: Vec<String> = text
        .lines()
        .map(|line| match line.strip_prefix("joints_deg = [") {
            Some(list) => {
                let angles: Vec<f64> = list
                    .trim_end_matches(']')
                    .split(',')
                    .map(|a| a.trim().parse().unwrap())
                    .collect();
                let angles: Vec<String> = angles
                    .iter()
                    .enumerate()
                    .map(|(i, a)| format!("{:?}", if i == 2 { a - 0.5 } else { *a }))
                    .collect();
                format!("joints_deg = [{}]", angles.join(", "))
            }
            None => line.to_string(),
        })
        .collect();
    std::fs::write(file, turned.join("\n")).unwrap();
    let diagnosed = document(&["diagnose", copy.path().to_str().unwrap()]);
    assert_eq!(diagnosed["verdict"], "unknown");
    let found = finding(&diagnosed).expect("a finding");
    assert_eq!(found["kind"], "encoder-offset", "{found}");
    assert!(found["where"].as_str().unwrap().starts_with("joint 3"), "{found}");
    let (value, error) = (
        found["value"].as_f64().unwrap(),
        found["std_error"].as_f64().unwrap(),
    );
    assert!((value - 0.5).abs() < 4.0 * error && error < 0.05, "{found}");
}

/// The dynamometer's axes written down wrongly, by a turn and by a reflection: the right matrix is given.
#[test]
fn a_wrong_dynamometer_matrix_is_told_with_the_right_one() {
    let right = "[[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]";
    for wrong in [
        "[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]",
        "[[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]",
        "[[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]",
        "[[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]",
    ] {
        let copy = copy_of("force-9400");
        replace(copy.path(), right, wrong);
        let dir = copy.path().to_str().unwrap();
        let coefficients = document(&["cfc", dir]);
        let found = finding(&coefficients).unwrap_or_else(|| panic!("{wrong}: {}", coefficients["setup"]));
        assert_eq!(found["kind"], "axes", "{wrong}: {found}");
        let remedy = found["remedy"].as_str().unwrap();
        assert!(remedy.contains(right), "{wrong}: {remedy}");
    }
}

/// Up milling written down as down milling, in all cuts and in one: the mean forces fit coefficients all the same.
#[test]
fn a_wrong_milling_direction_is_told_with_the_right_angles() {
    let (up, down) = (
        "start_deg = 0.0\nexit_deg = 90.0",
        "start_deg = 90.0\nexit_deg = 180.0",
    );
    for (cuts, place) in [(usize::MAX, "all cuts"), (1, "cut 01")] {
        let copy = copy_of("force-9400");
        let path = copy.path().join("campaign.toml");
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains(up));
        std::fs::write(&path, text.replacen(up, down, cuts)).unwrap();
        let coefficients = document(&["cfc", copy.path().to_str().unwrap()]);
        let found = finding(&coefficients).unwrap_or_else(|| panic!("{place}: {}", coefficients["setup"]));
        assert_eq!(found["kind"], "milling-direction", "{found}");
        assert_eq!(found["where"], place);
        let remedy = found["remedy"].as_str().unwrap();
        assert!(
            remedy.contains("01: start_deg = 0.0, exit_deg = 90.0"),
            "{remedy}"
        );
    }
}

/// One cut whose feed and one whose depth the list has wrong: `cfc` names cut and factor first, and there is no missing physics.
#[test]
fn a_cut_made_otherwise_than_the_list_says_is_told_with_what_it_was_made_with() {
    for (key, stated, kind, factor) in [
        ("feed_per_tooth_mm", "0.15", "feed-override", 0.1 / 0.15),
        ("axial_depth_mm", "1.6", "axial-depth", 2.0 / 1.6),
    ] {
        let copy = copy_of("force-9400");
        let file = copy.path().join("campaign.toml");
        let text = std::fs::read_to_string(&file).unwrap();
        let cut = text.find("id = \"05\"").unwrap();
        let line = cut + text[cut..].find(key).unwrap();
        let end = line + text[line..].find('\n').unwrap();
        std::fs::write(
            &file,
            format!("{}{key} = {stated}{}", &text[..line], &text[end..]),
        )
        .unwrap();
        let dir = copy.path().to_str().unwrap();
        for command in ["cfc", "diagnose"] {
            let said = document(&[command, dir]);
            let found = finding(&said).unwrap_or_else(|| panic!("{command}: {said}"));
            assert_eq!(found["kind"], kind, "{found}");
            assert_eq!(found["where"], "cut 05", "{found}");
            let [value, std] = ["value", "std_error"].map(|key| found[key].as_f64().unwrap());
            assert!(
                (value - factor).abs() < 4.0 * std && std < 0.01 * factor,
                "{found}"
            );
        }
    }
}

/// A smooth error of 1 % that is new in each FRF is nothing that the model lacks.
#[test]
fn errors_that_each_frf_has_of_its_own_are_no_missing_physics() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("cell");
    let dir = dir.to_str().unwrap();
    document(&[
        "simulate",
        "--out",
        dir,
        "--seed",
        "774",
        "--kind",
        "careful",
        "--laboratory",
        "coloured",
    ]);
    let said = document(&["diagnose", dir]);
    assert_eq!(said["verdict"], "none", "{}", said["baseline"]);
    let own = &said["rest"]["beyond_small_errors"]["own_errors"];
    assert!(
        own["common"].as_f64().unwrap() < 0.4 && own["of_a_place"].as_f64().unwrap() < 0.03,
        "{own}"
    );
    let text = lobestone(&["diagnose", dir]).stdout;
    assert!(text.contains("new in each"), "{text}");
}
