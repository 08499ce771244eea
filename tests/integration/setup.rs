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

/// Writes a force record anew: `change(share of the record, values)` of each line's forces.
fn rewrite(record: &Path, change: impl Fn(f64, &mut [f64])) {
    let text = std::fs::read_to_string(record).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let is_data = |line: &str| line.starts_with(|c: char| c.is_ascii_digit());
    let count = lines.len() as f64;
    let changed = lines.iter().enumerate().map(|(i, line)| {
        if !is_data(line) {
            return (*line).to_string();
        }
        let (time, forces) = line.split_once(';').unwrap();
        let mut forces: Vec<f64> = forces
            .split(';')
            .map(|v| v.replace(',', ".").parse().unwrap())
            .collect();
        change(i as f64 / count, &mut forces);
        let forces: Vec<String> = forces
            .iter()
            .map(|f| format!("{f:.6}").replace('.', ","))
            .collect();
        format!("{time};{}", forces.join(";"))
    });
    let changed: Vec<String> = changed.collect();
    std::fs::write(record, changed.join("\n")).unwrap();
}

/// Two files in kN among those in N, a range switched between two cuts, and a cable without contact.
#[test]
fn force_records_with_another_gain_are_named_with_it() {
    let every = |forces: &mut [f64], gain: f64| forces.iter_mut().for_each(|f| *f *= gain);
    type Change<'a> = &'a dyn Fn(&mut [f64]);
    let cases: [(&[u32], Change, &str, &str, f64); 3] = [
        (
            &[5, 16],
            &|f| every(f, 1e-3),
            "channel-gain",
            "cut 05 and 16, all channels",
            1e-3,
        ),
        (
            &[9, 13, 16],
            &|f| every(f, 0.5),
            "channel-gain",
            "cut 09, 13 and 16, all channels",
            0.5,
        ),
        (&[9], &|f| f[1] = 0.001 * f[2], "dead-channel", "cut 09, Fy", 0.0),
    ];
    for (cuts, change, kind, place, gain) in cases {
        let copy = copy_of("force-9400");
        for cut in cuts {
            rewrite(
                &copy.path().join(format!("force/cut{cut:02}.txt")),
                |_, forces| change(forces),
            );
        }
        let said = document(&["diagnose", copy.path().to_str().unwrap()]);
        let found = finding(&said).unwrap_or_else(|| panic!("{place}: {}", said["setup"]));
        assert_eq!(
            (found["kind"].as_str(), found["where"].as_str()),
            (Some(kind), Some(place)),
            "{found}"
        );
        let value = found["value"].as_f64().unwrap();
        assert!((value - gain).abs() <= 0.01 * gain, "{found}");
    }
}

/// Slips in campaign.toml that concern the tool, all cuts, or two of them.
#[test]
fn a_wrong_helix_width_or_pair_of_files_is_told_with_the_right_one() {
    let to_degrees = |factor: f64| (factor * 30f64.to_radians().tan()).atan().to_degrees();
    type Truth<'a> = &'a dyn Fn(f64) -> (f64, f64);
    let cases: [(&str, &str, &str, &str, Truth); 2] = [
        (
            "helix_deg = 42.0",
            "helix_deg = 30.0",
            "helix",
            "tool",
            &|factor| (to_degrees(factor), 42.0),
        ),
        (
            "exit_deg = 90.0",
            "exit_deg = 75.0",
            "radial-width",
            "all cuts",
            &|factor| (factor * 0.5 * (1.0 - 75f64.to_radians().cos()), 0.5),
        ),
    ];
    for (right, wrong, kind, place, truth) in cases {
        let copy = copy_of("force-9400");
        replace(copy.path(), right, wrong);
        let said = document(&["cfc", copy.path().to_str().unwrap()]);
        let found = finding(&said).unwrap_or_else(|| panic!("{wrong}: {}", said["setup"]));
        assert_eq!(
            (found["kind"].as_str(), found["where"].as_str()),
            (Some(kind), Some(place)),
            "{found}"
        );
        let (value, truth) = truth(found["value"].as_f64().unwrap());
        assert!((value / truth - 1.0).abs() < 0.02, "{value} for {truth}: {found}");
        let remedy = found["remedy"].as_str().unwrap();
        assert!(
            remedy.contains("helix_deg = 42.")
                || remedy.contains("helix_deg = 41.9")
                || remedy.contains("exit_deg = 90."),
            "{remedy}"
        );
    }
    // At the same speed the forces tell, at different ones the speeds.
    for (a, b) in [("01", "13"), ("05", "16")] {
        let copy = copy_of("force-9400");
        let file = |cut: &str| format!("force/cut{cut}.txt");
        replace(copy.path(), &file(a), "force/other.txt");
        replace(copy.path(), &file(b), &file(a));
        replace(copy.path(), "force/other.txt", &file(b));
        let said = document(&["cfc", copy.path().to_str().unwrap()]);
        let found = finding(&said).unwrap_or_else(|| panic!("{a}, {b}: {}", said["setup"]));
        assert_eq!(
            (found["kind"].as_str(), found["where"].as_str()),
            (Some("cut-swap"), Some(format!("cut {a} and {b}").as_str())),
            "{found}"
        );
    }
}

/// One record under two names: the cut that it is not of is left out and told.
#[test]
fn a_force_record_filed_twice_is_told_and_counts_once() {
    let copy = copy_of("force-9400");
    let record = |cut: &str| copy.path().join(format!("force/cut{cut}.txt"));
    std::fs::copy(record("16"), record("05")).unwrap();
    let dir = copy.path().to_str().unwrap();
    for command in ["cfc", "diagnose"] {
        let said = document(&[command, dir]);
        let found = finding(&said).unwrap_or_else(|| panic!("{command}: {}", said["setup"]));
        assert_eq!(
            (found["kind"].as_str(), found["where"].as_str()),
            (Some("duplicates"), Some("cut 05 and 16")),
            "{found}"
        );
        let warnings = said["warnings"].to_string();
        assert!(
            warnings.contains("cut 05 is left out") && !warnings.contains("cut 16 is left out"),
            "{warnings}"
        );
    }
}

/// An amplifier reset in the middle of a cut: the zero is put right on either side.
#[test]
fn a_zero_that_jumps_within_a_cut_is_put_right() {
    let copy = copy_of("force-9400");
    rewrite(&copy.path().join("force/cut05.txt"), |part, forces| {
        forces[0] -= if part > 0.55 { 180.0 } else { 0.0 };
    });
    let dir = copy.path().to_str().unwrap();
    let said = document(&["diagnose", dir]);
    assert_eq!(said["verdict"], "none", "{}", said["setup"]);
    let warnings = said["warnings"].to_string();
    assert!(
        warnings.contains("cut 05 (Fx by -18") && warnings.contains("jumped within the cut"),
        "{warnings}"
    );
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
