//! `lobestone plan`: a campaign that is not measured yet.

use std::path::Path;

use super::book::assert_documented;
use super::support::*;
use serde_json::Value;

const HEAD: &str = "schema = \"lobestone/campaign/1\"\nname = \"plan\"\n[robot]\nmodel = \"irb6640\"\n";
const TOOL: &str = "[[point]]\nnode = 1\nbody = \"tool\"\nposition_m = [0.0, 0.0, 0.0]\naxes = \"base\"\n";
const POSTURES: [&str; 3] = [
    "[135.0, -2.0, 53.0, 83.0, 30.0, -117.0]",
    "[112.0, 5.0, 26.0, 56.0, 63.0, -84.0]",
    "[150.0, 20.0, 10.0, 40.0, 50.0, 0.0]",
];

fn campaign(dir: &Path, postures: usize, rest: &str) {
    let mut text = format!("{HEAD}{TOOL}");
    for (i, joints) in POSTURES[..postures].iter().enumerate() {
        text += &format!("[[posture]]\nid = \"p{}\"\njoints_deg = {joints}\n", i + 1);
    }
    std::fs::write(dir.join("campaign.toml"), text + rest).unwrap();
}

fn sigmas(plan: &Value, effect: &str) -> f64 {
    let all = plan["effects"].as_array().unwrap();
    let found = all.iter().find(|e| e["effect"] == effect);
    found.unwrap_or_else(|| panic!("no {effect} in {all:?}"))["sigmas"]
        .as_f64()
        .unwrap()
}

/// Files that do not exist are planned; twice the noise halves what is seen, and nine FRFs show no less than two.
#[test]
fn a_plan_is_made_of_files_that_do_not_exist() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    let few = "[[frf]]\nfile = \"frf/p1.uff\"\nposture = \"p1\"\n[plan]\nresponses = \"1X, 1Y\"\nhits = \"1X\"\nlines_hz = 0.5\n";
    campaign(dir, 1, few);
    let path = dir.to_str().unwrap();
    let plan = document(&["plan", path]);
    assert_documented("plan", &plan);
    assert_eq!(
        (plan["planned_frfs"].as_u64(), plan["measured_frfs"].as_u64()),
        (Some(2), Some(0))
    );
    assert_eq!(plan["postures"], serde_json::json!(["p1"]));
    let noisy = document(&["plan", path, "--noise", "0.06", "--noise-floor", "4e-8"]);
    for effect in ["base-compliance", "tool-flexibility"] {
        let ratio = sigmas(&plan, effect) / sigmas(&noisy, effect);
        // The priors on the stiffnesses do not grow with the noise, so that it is not quite two.
        assert!((1.5..=2.05).contains(&ratio), "{effect}: {ratio}");
    }
    let full = document(&["plan", path, "--responses", "1X,1Y,1Z", "--hits", "1X,1Y,1Z"]);
    assert_eq!(full["planned_frfs"], 9);
    for name in ["payload", "time-delay", "sensor-misalignment", "local-resonator"] {
        // More FRFs never show less (a little play for where the fits stop).
        assert!(sigmas(&full, name) > 0.95 * sigmas(&plan, name), "{name}");
    }
    // One posture cannot tell where a stiffness comes from: more is offered, dearer things later.
    let additions = plan["additions"].as_array().unwrap();
    assert!(!additions.is_empty());
    let costs: Vec<f64> = additions.iter().map(|a| a["cost"].as_f64().unwrap()).collect();
    assert!(costs.is_sorted(), "{costs:?}");
    for addition in additions {
        assert!(addition["sigmas"].as_f64().unwrap() >= 5.0);
        assert!(!addition["mends"].as_array().unwrap().is_empty());
    }
    // Every other command still asks for the files.
    let run = lobestone(&["calibrate", path]);
    assert_eq!(run.status, Some(1));
    assert!(
        run.stderr.contains("does not exist in the campaign folder"),
        "{}",
        run.stderr
    );
}

#[test]
fn without_files_every_posture_is_planned_and_mistakes_are_said() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    campaign(dir, 3, "[plan]\nlines_hz = 1.0\n");
    let path = dir.to_str().unwrap();
    let plan = document(&["plan", path]);
    assert_eq!(
        (plan["planned_frfs"].as_u64(), &plan["postures"]),
        (Some(27), &serde_json::json!(["p1", "p2", "p3"]))
    );
    let fails = |rest: &str, arguments: &[&str], words: &str| {
        campaign(dir, 3, rest);
        let run = lobestone(&[&["plan", path], arguments].concat());
        assert_eq!(run.status, Some(1), "{rest} {arguments:?}");
        assert!(run.stderr.contains(words), "{}", run.stderr);
    };
    fails(
        "[plan]\nresponses = \"1X, north\"\n",
        &[],
        "north is no node and direction",
    );
    fails(
        "[plan]\nhits = \"7X\"\n",
        &[],
        "there is no [[point]] with node = 7",
    );
    fails("[plan]\nband_hz = [90.0, 3.0]\n", &[], "is no band");
    fails("", &["--noise", "0", "--noise-floor", "0"], "without noise");
    fails("", &["--lines-hz", "50"], "fewer than ten lines");
    fails(
        "[[frf]]\nfile = \"../p1.uff\"\nposture = \"p1\"\n",
        &[],
        "leaves the campaign folder",
    );
}
