//! `lobestone demo`: the whole story, once.

use std::path::Path;

use lobestone::report::number::{decimals, percent};

use crate::book::assert_documented;
use crate::report::{assert_png, assert_self_contained, json_of, run};

#[test]
fn the_demo_tells_the_whole_story() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("demo");
    let path = dir.to_str().unwrap();
    let started = std::time::Instant::now();
    let json = json_of(&["demo", path, "--json"]);
    // What a reader waits for; steps of the two cells run side by side.
    let seconds = started.elapsed().as_secs_f64();
    assert_documented("demo", &json);

    let steps = json["steps"].as_array().unwrap();
    let names: Vec<&str> = steps.iter().map(|s| s["name"].as_str().unwrap()).collect();
    for name in [
        "inspect",
        "model",
        "calibrate",
        "compare",
        "diagnose",
        "add",
        "history",
        "modal",
        "cfc",
        "lobes",
        "report",
    ] {
        assert!(names.contains(&name), "{name} not in {names:?}");
    }
    for step in steps {
        assert!(!step["summary"].as_str().unwrap().is_empty());
        assert!(step["command"].as_str().unwrap().starts_with("lobestone "));
        assert!(step["seconds"].as_f64().unwrap() >= 0.0);
    }
    assert!(seconds < 60.0, "{seconds} s");

    let html = std::fs::read_to_string(json["html"].as_str().unwrap()).unwrap();
    assert_self_contained(&html);
    assert!(html.len() < 3_000_000, "{}", html.len());
    let images = json["images"].as_array().unwrap();
    assert!(images.len() >= 15);
    for image in images {
        assert_png(Path::new(image.as_str().unwrap()));
    }

    // The hidden effect first; of the rest the titles.
    let card = html
        .find("<article class=\"card missing\" id=\"verdict\"")
        .unwrap();
    assert!(html[card..].contains("Missing: tool flexibility"));
    assert!(card < html.find("<section").unwrap());
    for section in [
        "second-frfs",
        "second-error-map",
        "second-missing-physics",
        "second-history",
    ] {
        assert!(html.contains(&format!("<section id=\"{section}\">")), "{section}");
    }

    // The campaigns work with every command as they lie there; the second one with the effect that the story added.
    let second = dir.join("second-cell");
    let history = json_of(&["history", second.to_str().unwrap(), "--json"]);
    let revisions = history["revisions"].as_array().unwrap();
    let floor = history["noise_floor_nrms"].as_f64().unwrap();
    let nrms = |i: usize| revisions[i]["nrms"].as_f64().unwrap();
    assert_eq!(revisions.len(), 2);
    // What was put in: datasets/README.md.
    assert_eq!(revisions[1]["effects"], serde_json::json!(["tool-flexibility"]));
    assert!(
        nrms(0) > 5.0 * floor,
        "the second cell holds what the model cannot explain"
    );
    assert!(nrms(1) < 1.1 * floor, "until it is added");
    let cfc = json_of(&["cfc", dir.join("first-cell").to_str().unwrap(), "--json"]);
    // What was put in: datasets/README.md.
    let ktc = cfc["pooled"][0]["ktc_n_per_mm2"]["value"].as_f64().unwrap();
    assert!((ktc / 929.9 - 1.0).abs() < 0.02, "{ktc}");
    let calibrated = json_of(&["calibrate", dir.join("first-cell").to_str().unwrap(), "--json"]);
    let truth = [1174246.8, 2350684.8, 1782791.1, 596346.0, 266120.7, 633808.8];
    for (parameter, truth) in calibrated["parameters"].as_array().unwrap().iter().zip(truth) {
        let value = parameter["value"].as_f64().unwrap();
        let std_error = parameter["std_error"].as_f64().unwrap();
        assert!((value / truth - 1.0).abs() < 0.01, "{parameter} against {truth}");
        assert!(
            (value - truth).abs() < 4.0 * std_error,
            "{parameter} against {truth}"
        );
    }

    // A second run over the first.
    assert!(run(&["demo", path]).status.success());
}

/// Every number of the thesis tables stands in the page.
#[test]
fn the_thesis_in_the_page_is_that_of_the_command() {
    let folder = tempfile::tempdir().unwrap();
    let shown = json_of(&["thesis", "--out", folder.path().to_str().unwrap(), "--json"]);
    let html = std::fs::read_to_string(shown["html"].as_str().unwrap()).unwrap();
    // The template engine writes a slash as an entity.
    let section = html[html.find("<section id=\"thesis\">").unwrap()..].replace("&#x2f;", "/");
    let study = json_of(&["thesis", "--json"]);
    assert_documented("thesis", &study);
    let cell = |text: &str| {
        assert!(
            section.contains(&format!(">{text}<")),
            "{text} is not in the page"
        )
    };
    for row in study["frequencies"].as_array().unwrap() {
        for key in ["published_model", "measured", "before", "after"] {
            cell(&decimals(row[key].as_f64().unwrap(), 2));
        }
    }
    for row in study["static_stiffness"].as_array().unwrap() {
        let ratio = |key: &str| Some(row[key].as_f64()? / row["measured"].as_f64()?);
        for key in ["published_model", "before", "after"] {
            if let Some(ratio) = ratio(key) {
                cell(&decimals(ratio, 2));
            }
        }
    }
    for row in study["lobes"].as_array().unwrap() {
        for tips in ["from_measurements", "from_model_before", "from_model_after"] {
            for region in ["second_region", "first_region"] {
                let tip = &row[tips][region];
                let (rpm, mm) = (
                    tip["spindle_rpm"].as_f64().unwrap(),
                    tip["depth_mm"].as_f64().unwrap(),
                );
                cell(&format!("{} / {}", decimals(rpm, 0), decimals(mm, 3)));
            }
        }
    }
    for key in ["fitted_frequency_error", "predicted_frequency_error"] {
        assert!(section.contains(&percent(study[key].as_f64().unwrap())), "{key}");
    }
}

#[test]
fn a_folder_of_somebody_elses_is_not_touched() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("README.txt"), "my notes").unwrap();
    let output = run(&["demo", folder.path().to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("not a demo"));
    let entries: Vec<_> = std::fs::read_dir(folder.path()).unwrap().collect();
    assert_eq!(entries.len(), 1);
    assert_eq!(
        std::fs::read_to_string(folder.path().join("README.txt")).unwrap(),
        "my notes"
    );

    // A file in the way.
    let file = folder.path().join("README.txt");
    assert_eq!(run(&["demo", file.to_str().unwrap()]).status.code(), Some(1));
}
