//! `add`, `history` and `undo`, and what the other commands make of them.

use std::path::Path;
use std::time::Duration;

use serde_json::Value;

use crate::support::{append, blind, copy_of, document, lobestone, program, truth};

/// Four postures, X and Y at the tool; a flexible tool is hidden.
const FLEXIBLE_TOOL: &str = "frf-9114";
/// The same kind, nothing hidden.
const CONTROL: &str = "frf-9112";

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("no number: {value}"))
}

fn log(campaign: &Path) -> std::path::PathBuf {
    campaign.join("lobestone/revisions.json")
}

fn revision_count(campaign: &Path) -> usize {
    let history = document(&["history", text(campaign)]);
    history["revisions"].as_array().unwrap().len()
}

#[test]
fn the_right_effect_brings_the_error_to_the_noise_and_every_command_uses_it() {
    let folder = copy_of(FLEXIBLE_TOOL);
    let dir = folder.path();
    let before = document(&["model", text(dir)]);
    assert!(before["revision"].is_null());

    let added = document(&["add", text(dir), "tool-flexibility"]);
    assert_eq!(added["revision"], 1);
    assert_eq!(added["progress"], true);
    assert_eq!(added["converged"], true);
    assert_eq!(added["effects"], serde_json::json!(["tool-flexibility"]));
    let floor = number(&added["error"]["noise_floor_nrms"]);
    let error = number(&added["error"]["nrms"]);
    assert!(error <= 1.1 * floor, "{error} {floor}");
    assert_eq!(added["after"]["nrms"], added["error"]["nrms"]);
    assert!(number(&added["before"]["nrms"]) > 0.5);
    assert!(number(&added["before"]["held_out_nrms"]) > 10.0 * number(&added["after"]["held_out_nrms"]));
    let truth = truth(FLEXIBLE_TOOL);
    for (name, expected) in [
        ("tool-flexibility.mass_kg", &truth["parameters"]["mass_kg"]),
        (
            "tool-flexibility.frequency_hz",
            &truth["parameters"]["frequency_hz"],
        ),
        ("joint-1.stiffness", &truth["joint_stiffness"][0]),
    ] {
        let parameters = added["parameters"].as_array().unwrap();
        let found = parameters.iter().find(|p| p["name"] == name).unwrap();
        let off = (number(&found["value"]) - number(expected)).abs();
        assert!(
            off < 4.0 * number(&found["std_error"]),
            "{name}: {found} {expected}"
        );
        assert!(found["unit"].is_string() && found["initial"].is_number());
    }

    for (command, error_key) in [("calibrate", "nrms"), ("compare", "nrms")] {
        let found = document(&[command, text(dir)]);
        assert_eq!(found["revision"], 1, "{command}");
        assert_eq!(found["effects"][0], "tool-flexibility", "{command}");
        let again = number(&found["error"][error_key]);
        assert!((again / error - 1.0).abs() < 1e-3, "{command}: {again} {error}");
    }
    // The tool is softer than the flange that carries it, and brings a mode of its own.
    let model = document(&["model", text(dir)]);
    let posture = &model["calibrated_postures"][0];
    let frequencies = posture["natural_frequencies_hz"].as_array().unwrap();
    assert_eq!(
        model["postures"], before["postures"],
        "the robot file has no effects"
    );
    let nominal = &model["postures"][0]["natural_frequencies_hz"];
    assert!(frequencies.len() >= nominal.as_array().unwrap().len() + 2);
    let stiffness = |of: &Value, at: &str| number(&of[at]["x"]);
    assert!(
        stiffness(posture, "tcp_stiffness_n_per_m") < 0.3 * stiffness(posture, "flange_stiffness_n_per_m")
    );

    // The lobes' model has the tool's mode, too.
    append(
        dir,
        "\n[lobes]\nprocess = \"milling\"\nsource = \"model\"\nmethod = \"zero-order\"\nktc_n_per_mm2 = 1000.0\n\
         krc_n_per_mm2 = 500.0\nteeth = 2\nimmersion = \"slot\"\nspindle_rpm = [600.0, 3000.0, 100.0]\n",
    );
    let with = number(&document(&["lobes", text(dir)])["absolute_limit_mm"]);

    let report = document(&["report", text(dir)]);
    let images = report["images"].as_array().unwrap();
    assert!(
        images
            .iter()
            .any(|i| i.as_str().unwrap().ends_with("history.png"))
    );
    let html = std::fs::read_to_string(report["html"].as_str().unwrap()).unwrap();
    assert!(html.contains("The error, revision by revision"));
    assert!(html.contains("1 + tool-flexibility"));

    let undone = document(&["undo", text(dir)]);
    assert_eq!(undone["undone"]["revision"], 1);
    assert_eq!(undone["effects"], serde_json::json!([]));
    let without = number(&document(&["lobes", text(dir)])["absolute_limit_mm"]);
    assert!(with < 0.9 * without || with > 1.1 * without, "{with} {without}");
    let back = number(&document(&["compare", text(dir)])["error"]["nrms"]);
    assert!((back / number(&added["before"]["nrms"]) - 1.0).abs() < 1e-3);
}

#[test]
fn history_shows_what_was_done_and_undo_takes_it_back() {
    let folder = copy_of(CONTROL);
    let dir = folder.path();
    let empty = document(&["history", text(dir)]);
    assert_eq!(empty["revisions"], serde_json::json!([]));
    let shown = lobestone(&["history", text(dir)]);
    assert!(shown.stdout.contains("lobestone diagnose"), "{}", shown.stdout);
    let nothing = lobestone(&["undo", text(dir)]);
    assert_eq!(nothing.status, Some(1));
    assert!(nothing.stderr.contains("nothing to undo"), "{}", nothing.stderr);
    assert!(!log(dir).exists());

    // Nothing is missing here: whatever is added is no progress, is recorded, and the user is told.
    let added = document(&["add", text(dir), "payload"]);
    assert_eq!(added["progress"], false);
    assert_eq!(added["revision"], 1);
    let second = lobestone(&["add", text(dir), "time-delay"]);
    assert_eq!(second.status, Some(0), "{}", second.stderr);
    assert!(second.stdout.contains("NOT PROGRESS"), "{}", second.stdout);
    assert!(second.stdout.contains("lobestone undo"), "{}", second.stdout);

    let history = document(&["history", text(dir)]);
    let revisions = history["revisions"].as_array().unwrap();
    assert_eq!(revisions.len(), 3);
    for (i, revision) in revisions.iter().enumerate() {
        assert_eq!(revision["revision"], i);
        assert_eq!(revision["effects"].as_array().unwrap().len(), i);
        assert!(number(&revision["nrms"]) > 0.0 && number(&revision["held_out_nrms"]) > 0.0);
        assert_eq!(revision["parameters"].as_array().unwrap().len(), 7 + i);
        assert_eq!(revision["same_data"], true);
    }
    assert_eq!(
        revisions[2]["effects"],
        serde_json::json!(["payload", "time-delay"])
    );
    let shown = lobestone(&["history", text(dir)]).stdout;
    assert!(
        shown.contains("2 + time-delay") && shown.contains("██"),
        "{shown}"
    );

    let undone = lobestone(&["undo", text(dir)]);
    assert!(undone.stdout.contains("2 + time-delay"), "{}", undone.stdout);
    let history = document(&["history", text(dir)]);
    assert_eq!(history["revisions"].as_array().unwrap().len(), 2);
    assert_eq!(history["undone"][0]["effects"][1], "time-delay");
}

#[test]
fn what_cannot_be_added_is_refused_and_nothing_is_recorded() {
    let dir = blind(CONTROL);
    for (effect, expected) in [
        ("payloud", "did you mean payload?"),
        ("local-resonator", "local-resonator@link-4"),
        ("local-resonator@link-9", "local-resonator@link-4"),
        ("payload@link-2", "write payload"),
        ("amplitude-dependent-stiffness@joint-1", "two hammer levels"),
    ] {
        let run = lobestone(&["add", text(&dir), effect]);
        assert_eq!(run.status, Some(1), "{effect}");
        assert!(run.stdout.is_empty());
        assert!(
            run.stderr.contains(expected) && run.stderr.contains("remedy"),
            "{effect}: {}",
            run.stderr
        );
    }
    assert!(!log(&dir).exists());
}

#[test]
fn an_effect_is_added_once_and_changed_data_are_noticed() {
    let folder = copy_of(CONTROL);
    let dir = folder.path();
    document(&["add", text(dir), "payload"]);
    let again = lobestone(&["add", text(dir), "payload"]);
    assert_eq!(again.status, Some(1));
    assert!(again.stderr.contains("in the model already"), "{}", again.stderr);

    // A name changes nothing, a posture does.
    let file = dir.join("campaign.toml");
    let toml = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, toml.replace("name = \"frf-9112\"", "name = \"cell\"")).unwrap();
    let warnings = |command: &str| document(&[command, text(dir)])["warnings"].to_string();
    assert!(!warnings("compare").contains("other data"));
    let moved = toml.replacen("joints_deg = [1", "joints_deg = [2", 1);
    assert_ne!(moved, toml);
    std::fs::write(&file, moved).unwrap();
    for command in ["compare", "history"] {
        assert!(warnings(command).contains("other data"), "{command}");
    }

    std::fs::write(&file, toml).unwrap();
    let good = std::fs::read_to_string(log(dir)).unwrap();
    std::fs::write(log(dir), good.replace("\"payload\"", "\"ballast\"")).unwrap();
    let run = lobestone(&["compare", text(dir)]);
    assert_eq!(run.status, Some(1));
    assert!(
        run.stderr.contains("revisions.json") && run.stderr.contains("no effect ballast"),
        "{}",
        run.stderr
    );
    std::fs::write(log(dir), &good[..good.len() / 3]).unwrap();
    for command in ["history", "undo", "calibrate"] {
        let run = lobestone(&[command, text(dir)]);
        assert_eq!(run.status, Some(1), "{command}");
        assert!(
            run.stderr.contains("revisions.json:"),
            "{command}: {}",
            run.stderr
        );
    }
}

#[test]
fn one_posture_leaves_nothing_to_check_on() {
    let folder = copy_of(FLEXIBLE_TOOL);
    let dir = folder.path();
    let file = dir.join("campaign.toml");
    let toml = std::fs::read_to_string(&file).unwrap();
    let second = toml.match_indices("[[posture]]").nth(1).unwrap().0;
    std::fs::write(&file, &toml[..second]).unwrap();
    let added = document(&["add", text(dir), "tool-flexibility"]);
    assert!(added["after"]["held_out_nrms"].is_null());
    assert!(added["progress"].is_null());
    assert!(added["warnings"].to_string().contains("one posture only"));
    assert!(number(&added["after"]["nrms"]) < number(&added["before"]["nrms"]));
}

#[test]
fn a_kill_at_any_moment_leaves_the_campaign_readable() {
    let folder = copy_of(CONTROL);
    let dir = folder.path();
    document(&["add", text(dir), "payload"]);
    for milliseconds in [20, 120, 250, 400] {
        let mut child = program()
            .args(["add", text(dir), "time-delay"])
            .stdout(std::process::Stdio::null())
            .stderr(std::process::Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(milliseconds));
        let _ = child.kill();
        child.wait().unwrap();
        let count = revision_count(dir);
        assert!(count == 2 || count == 3, "{count}");
        if count == 3 {
            document(&["undo", text(dir)]);
        }
    }
    // And nothing stands in the way of the next one.
    assert_eq!(document(&["add", text(dir), "time-delay"])["revision"], 2);
}

#[test]
fn two_at_a_time_lose_no_revision() {
    let folder = copy_of(CONTROL);
    let dir = folder.path();
    let children: Vec<_> = ["payload", "time-delay"]
        .map(|effect| {
            program()
                .args(["add", text(dir), effect, "--json"])
                .stdout(std::process::Stdio::null())
                .stderr(std::process::Stdio::piped())
                .spawn()
                .unwrap()
        })
        .into_iter()
        .collect();
    let mut done = 0;
    for child in children {
        let output = child.wait_with_output().unwrap();
        if output.status.success() {
            done += 1;
        } else {
            let message = String::from_utf8_lossy(&output.stderr).into_owned();
            assert!(message.contains("in the meantime"), "{message}");
        }
    }
    assert!(done >= 1);
    assert_eq!(revision_count(dir), done + 1);
}

/// Both of a pair of effects at once, refitted together, and a discrete choice that survives the log.
#[test]
fn a_resonator_keeps_its_direction() {
    let folder = copy_of(FLEXIBLE_TOOL);
    let dir = folder.path();
    document(&["add", text(dir), "tool-flexibility"]);
    let added = document(&["add", text(dir), "local-resonator@link-3"]);
    assert_eq!(added["progress"], false);
    let direction = added["variant"]["direction"].as_str().unwrap().to_string();
    assert_eq!(added["parameters"].as_array().unwrap().len(), 13);
    let shown = lobestone(&["calibrate", text(dir)]).stdout;
    let expected = format!("tool-flexibility + local-resonator@link-3 (direction {direction}), revision 2");
    assert!(shown.contains(&expected), "{expected}: {shown}");
}
