//! The JSON that other programs rely on: every key, its type and shape, a number wherever one is promised.
//!
//! A document is held against a pattern of the same form: `"number"` (finite, never null), `"number?"` (null where
//! the value does not exist), `"string"`, `"string?"`, `"integer"`, `"bool"`; `[pattern]` is a list of at least one;
//! `{"*": pattern}` is an object with any names, at least one. More keys than the pattern has are allowed.

use std::path::Path;

use serde_json::{Value, json};

use super::support::*;

fn check(value: &Value, pattern: &Value, path: &str) -> Result<(), String> {
    let wrong = || Err(format!("{path} should be {pattern}, is {value}"));
    match pattern {
        Value::String(kind) => {
            let right = match kind.as_str() {
                "number" => value.as_f64().is_some_and(f64::is_finite),
                "number?" => value.is_null() || value.as_f64().is_some_and(f64::is_finite),
                "string" => value.is_string(),
                "string?" => value.is_null() || value.is_string(),
                "integer" => value.is_u64() || value.is_i64(),
                "bool" => value.is_boolean(),
                "list" => value.is_array(),
                literal => value == literal,
            };
            if right { Ok(()) } else { wrong() }
        }
        Value::Array(item) => match value.as_array() {
            Some(values) if !values.is_empty() => values
                .iter()
                .enumerate()
                .try_for_each(|(i, v)| check(v, &item[0], &format!("{path}[{i}]"))),
            _ => wrong(),
        },
        Value::Object(keys) => {
            let Some(object) = value.as_object().filter(|o| !o.is_empty()) else {
                return wrong();
            };
            for (key, pattern) in keys {
                if key == "*" {
                    for (name, v) in object {
                        check(v, pattern, &format!("{path}.{name}"))?;
                    }
                } else {
                    let v = object.get(key).ok_or(format!("{path}.{key} is missing"))?;
                    check(v, pattern, &format!("{path}.{key}"))?;
                }
            }
            Ok(())
        }
        _ => panic!("no pattern: {pattern}"),
    }
}

fn holds(document: &Value, pattern: Value) {
    if let Err(error) = check(document, &pattern, "$") {
        panic!("{error}");
    }
}

fn path(folder: &Path) -> &str {
    folder.to_str().unwrap()
}

#[test]
fn the_checker_can_fail() {
    let pattern = json!({ "a": ["number"], "b": { "*": "number" } });
    let judge = |value: Value| check(&value, &pattern, "$");
    assert_eq!(
        judge(json!({ "a": [1, 2.5], "b": { "p1": 0.1 }, "c": null })),
        Ok(())
    );
    for wrong in [
        json!({ "a": [1, null], "b": { "p1": 0.1 } }),
        json!({ "a": [], "b": { "p1": 0.1 } }),
        json!({ "a": [1], "b": {} }),
        json!({ "a": [1], "b": { "p1": "x" } }),
        json!({ "a": [1] }),
        json!([]),
    ] {
        assert!(judge(wrong.clone()).is_err(), "{wrong}");
    }
}

#[test]
fn inspect() {
    let frf = blind("frf-9112/frf/p1.uff");
    let force = blind("force-9439/force/cut14.txt");
    let document = document(&["inspect", path(&frf), path(&force)]);
    let file = json!({ "path": "string", "format": "string", "kind": "string", "channels": [{}], "warnings": "list" });
    holds(&document, json!({ "files": [file] }));
    assert_eq!(
        [&document["files"][0]["kind"], &document["files"][1]["kind"]],
        ["frf", "force"]
    );
}

fn coefficient() -> Value {
    json!({ "value": "number", "std_error": "number" })
}

#[test]
fn cfc_of_milling() {
    let document = document(&["cfc", path(&blind("force-9400"))]);
    let mut group = json!({ "process": "milling", "cutting_speed_m_per_min": "number", "cuts": ["string"] });
    for axis in ["t", "r", "a"] {
        group[format!("k{axis}c_n_per_mm2")] = coefficient();
        group[format!("k{axis}e_n_per_mm")] = coefficient();
    }
    let r2 = json!({ "x": "number", "y": "number", "z": "number" });
    holds(
        &document,
        json!({ "groups": [group], "r2": r2, "warnings": "list" }),
    );
}

#[test]
fn cfc_of_drilling() {
    let document = document(&["cfc", path(&blind("force-9439"))]);
    let mut group = json!({ "process": "drilling", "cutting_speed_m_per_min": "number", "cuts": ["string"] });
    for key in ["ktc_n_per_mm2", "kte_n_per_mm", "kfc_n_per_mm2", "kfe_n_per_mm"] {
        group[key] = coefficient();
    }
    holds(
        &document,
        json!({ "groups": [group], "r2": { "z": "number" }, "warnings": "list" }),
    );
}

#[test]
fn modal_of_a_campaign_and_of_files() {
    let pattern = json!({
        "frfs": [{ "name": "string", "modes": [{ "frequency_hz": "number", "damping_ratio": "number", "method": "string" }] }],
        "global": [{
            "frequency_hz": "number", "damping_ratio": "number",
            "frequency_std_hz": "number", "damping_std": "number"
        }],
        "tracked": [{ "modes": [{ "frequency_hz": "number?", "damping_std": "number?" }] }],
    });
    holds(&document(&["modal", path(&blind("frf-9112"))]), pattern.clone());
    let files = ["p1", "p2"].map(|p| blind(&format!("frf-9112/frf/{p}.uff")));
    let mut pattern = pattern;
    pattern["rejected"] = json!("list");
    pattern["quality"] =
        json!({ "verdict": "string", "unexplained_share": "number", "coloured_share": "number" });
    holds(
        &document(&["modal", path(&files[0]), path(&files[1])]),
        pattern.clone(),
    );
    // One set of all files, whatever postures they come from.
    let together = document(&["modal", "--together", path(&files[0]), path(&files[1])]);
    holds(&together, pattern);
    assert_eq!(together["sets"].as_array().unwrap().len(), 1);
}

fn posture_pattern() -> Value {
    let axes = json!({ "x": "number", "y": "number", "z": "number" });
    json!({
        "id": "string", "natural_frequencies_hz": ["number"], "tcp_m": ["number"], "tool_axis": ["number"],
        "tcp_stiffness_n_per_m": axes, "flange_stiffness_n_per_m": axes,
    })
}

#[test]
fn model() {
    let document = document(&["model", path(&blind("frf-9112"))]);
    holds(
        &document,
        json!({ "postures": [posture_pattern()], "calibrated_postures": [posture_pattern()] }),
    );
    let first = &document["postures"][0];
    assert_eq!(first["tcp_m"].as_array().unwrap().len(), 3);
    assert_eq!(first["tool_axis"].as_array().unwrap().len(), 3);
    assert_eq!(first["natural_frequencies_hz"].as_array().unwrap().len(), 6);
    assert!(first.get("k_c").is_none());
}

#[test]
fn model_matrices_are_36_by_36_and_symmetric() {
    let document = document(&["model", "--matrices", path(&blind("frf-9112"))]);
    let mut pattern = posture_pattern();
    pattern["k_c"] = json!([["number"]]);
    pattern["m_c"] = json!([["number"]]);
    holds(&document, json!({ "postures": [pattern] }));
    for key in ["k_c", "m_c"] {
        let rows = document["postures"][0][key].as_array().unwrap();
        assert_eq!(rows.len(), 36);
        let entry = |i: usize, j: usize| rows[i][j].as_f64().unwrap();
        let largest = (0..36).map(|i| entry(i, i)).fold(0.0, f64::max);
        for i in 0..36 {
            assert_eq!(rows[i].as_array().unwrap().len(), 36);
            for j in 0..i {
                assert!(
                    (entry(i, j) - entry(j, i)).abs() <= 1e-9 * largest,
                    "{key} {i} {j}"
                );
            }
        }
    }
}

fn error_pattern() -> Value {
    json!({ "nrms": "number", "mean_abs_db": "number", "noise_floor_nrms": "number" })
}

#[test]
fn calibrate() {
    let document = document(&["calibrate", path(&blind("frf-9112"))]);
    let parameter = json!({
        "name": "string", "value": "number", "unit": "string", "std_error": "number", "initial": "number"
    });
    holds(
        &document,
        json!({
            "parameters": [parameter], "error": error_pattern(), "iterations": "integer", "converged": "bool"
        }),
    );
}

#[test]
fn compare() {
    let document = document(&["compare", path(&blind("frf-9112"))]);
    let nrms = json!({ "*": "number" });
    holds(
        &document,
        json!({
            "domain": "structure", "error": error_pattern(),
            "by_posture": nrms, "by_direction": nrms, "by_point": nrms,
            "by_band": [{ "from_hz": "number", "to_hz": "number", "nrms": "number" }],
            "modes": [{
                "posture": "string", "measured_hz": "number", "measured_std_hz": "number",
                "measured_damping": "number", "measured_damping_std": "number",
            }],
        }),
    );
    // The campaign lacks nothing: where a mode of the model is paired it is the measured one.
    for mode in document["modes"].as_array().unwrap() {
        let number = |key: &str| mode[key].as_f64().unwrap();
        assert!(
            (number("model_hz") / number("measured_hz") - 1.0).abs() < 0.02,
            "{mode}"
        );
        assert!(
            (number("model_damping") / number("measured_damping") - 1.0).abs() < 0.3,
            "{mode}"
        );
        assert!(number("mac") > 0.8, "{mode}");
    }
    assert!(document["error"]["held_out_nrms"].is_number());
    let keys = |key: &str| {
        document[key]
            .as_object()
            .unwrap()
            .keys()
            .cloned()
            .collect::<Vec<_>>()
    };
    assert_eq!(keys("by_posture"), ["p1", "p2", "p3", "p4"]);
    assert_eq!(keys("by_direction"), ["XX", "YY"]);
    assert_eq!(keys("by_point"), ["1"]);
}

/// `[lobes]` for drilling from the source that is asked for.
fn drilling_lobes(source: &str) -> String {
    format!(
        "\n[lobes]\nprocess = \"drilling\"\nsource = \"{source}\"\nktc_n_per_mm2 = 1014.2\nkrc_n_per_mm2 = 619.9\n\
         teeth = 2\nhalf_point_angle_deg = 67.5\nspindle_rpm = [150.0, 500.0, 5.0]\n"
    )
}

fn lobes_pattern() -> Value {
    json!({
        "curves": [{
            "posture": "string?", "angle_deg": "number?", "spindle_rpm": ["number"],
            "depth_limit_mm": ["number"], "chatter_hz": ["number"],
        }],
        "absolute_limit_mm": "number", "absolute_limit_hz": "number",
        "best": [{ "posture": "string?", "angle_deg": "number?", "spindle_rpm": "number", "depth_mm": "number" }],
    })
}

fn lobes(toml: &str) -> Value {
    let campaign = copy_of("frf-9112");
    append(campaign.path(), toml);
    let document = document(&["lobes", path(campaign.path())]);
    holds(&document, lobes_pattern());
    for curve in document["curves"].as_array().unwrap() {
        let length = |key: &str| curve[key].as_array().unwrap().len();
        assert_eq!(length("spindle_rpm"), length("depth_limit_mm"));
        assert_eq!(length("spindle_rpm"), length("chatter_hz"));
    }
    document
}

#[test]
fn lobes_from_model_measurement_and_modes() {
    for source in ["model", "measured"] {
        let document = lobes(&drilling_lobes(source));
        let curves = document["curves"].as_array().unwrap();
        let postures: Vec<&Value> = curves.iter().map(|c| &c["posture"]).collect();
        assert_eq!(postures, ["p1", "p2", "p3", "p4"], "{source}");
        assert_eq!(curves[0]["spindle_rpm"].as_array().unwrap().len(), 71);
    }
    let modes = "[[lobes.mode]]\naxis = \"x\"\nfrequency_hz = 12.3\ndamping_ratio = 0.028\nstiffness_n_per_m = 5e5\n\
                 [[lobes.mode]]\naxis = \"y\"\nfrequency_hz = 12.2\ndamping_ratio = 0.025\nstiffness_n_per_m = 3e5\n";
    let document = lobes(&(drilling_lobes("modes") + modes));
    assert!(document["curves"][0]["posture"].is_null());
}

#[test]
fn milling_lobes() {
    lobes(
        "\n[lobes]\nprocess = \"milling\"\nsource = \"model\"\nmethod = \"zero-order\"\nktc_n_per_mm2 = 900.0\n\
         krc_n_per_mm2 = 300.0\nteeth = 2\nimmersion = \"slot\"\nspindle_rpm = [300.0, 800.0, 10.0]\n",
    );
}

#[test]
fn report() {
    let campaign = copy_of("frf-9112");
    let document = document(&["report", path(campaign.path())]);
    holds(&document, json!({ "html": "string", "images": ["string"] }));
    assert!(Path::new(document["html"].as_str().unwrap()).is_file());
}

#[test]
fn demo() {
    let folder = tempfile::tempdir().unwrap();
    let document = document(&["demo", path(folder.path())]);
    holds(&document, json!({ "html": "string", "steps": [{}] }));
    assert!(Path::new(document["html"].as_str().unwrap()).is_file());
}

#[test]
fn status_one_has_a_message_and_no_document() {
    let nowhere = tempfile::tempdir().unwrap();
    let dir = path(nowhere.path());
    for command in ["cfc", "modal", "model", "calibrate", "compare", "lobes"] {
        let run = lobestone(&[command, dir, "--json"]);
        assert_eq!(run.status, Some(1), "{command}");
        assert!(run.stdout.is_empty(), "{command}: {}", run.stdout);
        assert!(
            run.stderr.starts_with("error: ") && run.stderr.contains("campaign.toml"),
            "{command}: {}",
            run.stderr
        );
    }
}

#[test]
fn wrong_usage_is_status_two() {
    for arguments in [
        &["calibrate"][..],
        &["model", "--no-such-flag", "x"],
        &["inspect"],
        &["calibrate", "x", "--starts", "many"],
        &[],
    ] {
        let run = lobestone(arguments);
        assert_eq!(run.status, Some(2), "{arguments:?}");
        assert!(
            run.stdout.is_empty() && run.stderr.contains("--help"),
            "{arguments:?}: {}",
            run.stderr
        );
    }
}
