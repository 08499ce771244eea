//! The user's own robot: URDFs in and out, and arms whose wrist is not spherical.

use std::path::{Path, PathBuf};

use lobestone::analysis::{Sweep, SweepRequest};
use lobestone::campaign::Campaign;
use lobestone::lobes::workspace::PlaceStatus;
use serde_json::Value;

use crate::support::{document, lobestone};

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn urdf(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/data/urdf/{name}.urdf"))
}

/// What pinocchio 4.1 makes of the robots (`scripts/check_robots.py --table`).
struct Reference {
    robot: &'static str,
    joints_deg: &'static [f64],
    moving_mass_kg: f64,
    tcp_m: &'static [f64],
    tool_axis: &'static [f64],
    centre_of_mass_m: &'static [f64],
    gravity_torques_nm: &'static [f64],
    natural_frequencies_hz: &'static [f64],
}

include!("robots_reference.in");

const WITH_SPINDLE: &str = " with spindle";

/// A campaign on a robot: one made of a URDF, or one of `datasets/robots`, with a spindle where the name ends so.
fn campaign_on(robot: &str, postures: &[&[f64]]) -> tempfile::TempDir {
    let spindle = robot.ends_with(WITH_SPINDLE);
    let robot = robot.trim_end_matches(WITH_SPINDLE);
    let folder = tempfile::tempdir().unwrap();
    let file = format!("{robot}.toml");
    let known = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("datasets/robots")
        .join(&file);
    if known.is_file() {
        // A spindle askew on the flange: only then do joints move as the tool turns about its axis.
        let robot_file = std::fs::read_to_string(known).unwrap().replace(
            "tcp_in_flange_m = [0.0, 0.0, 0.0]",
            match spindle {
                true => "tcp_in_flange_m = [0.12, 0.0, 0.15]\ntilt_about_flange_y_deg = 45.0",
                false => "tcp_in_flange_m = [0.0, 0.0, 0.0]",
            },
        );
        std::fs::write(folder.path().join(&file), robot_file).unwrap();
    } else {
        let base = if robot == "askew" { "foot" } else { "base" };
        document(&[
            "init",
            text(folder.path()),
            "--robot",
            text(&urdf(robot)),
            "--base-link",
            base,
            "--no-questions",
        ]);
    }
    let mut campaign =
        format!("schema = \"lobestone/campaign/1\"\nname = \"check\"\n[robot]\nmodel = \"{file}\"\n");
    for (i, q) in postures.iter().enumerate() {
        campaign += &format!("[[posture]]\nid = \"p{}\"\njoints_deg = {q:?}\n", i + 1);
    }
    std::fs::write(folder.path().join("campaign.toml"), campaign).unwrap();
    folder
}

fn numbers(value: &Value) -> Vec<f64> {
    let of = |v: &Value| v.as_f64().unwrap_or_else(|| panic!("no number: {v}"));
    value
        .as_array()
        .map_or_else(|| vec![of(value)], |all| all.iter().map(of).collect())
}

fn agrees(what: &str, found: &Value, expected: &[f64]) {
    let found = numbers(found);
    let size = expected.iter().map(|v| v * v).sum::<f64>().sqrt().max(1e-3);
    assert_eq!(found.len(), expected.len(), "{what}");
    for (f, e) in found.iter().zip(expected) {
        assert!((f - e).abs() < 1e-9 * size, "{what}: {found:?} {expected:?}");
    }
}

fn agrees_with(reference: &Reference, said: &Value) {
    let name = reference.robot;
    agrees(name, &said["moving_mass_kg"], &[reference.moving_mass_kg]);
    let posture = &said["postures"][0];
    for (key, expected) in [
        ("tcp_m", reference.tcp_m),
        ("tool_axis", reference.tool_axis),
        ("centre_of_mass_m", reference.centre_of_mass_m),
        ("gravity_torques_nm", reference.gravity_torques_nm),
        ("natural_frequencies_hz", reference.natural_frequencies_hz),
    ] {
        agrees(&format!("{name} {key}"), &posture[key], expected);
    }
}

/// Kinematics, lumped masses and inertias against another program; and once more after the robot went out as a URDF and
/// came in again.
#[test]
fn robots_are_those_of_pinocchio() {
    for reference in REFERENCES {
        let folder = campaign_on(reference.robot, &[reference.joints_deg]);
        let out = folder.path().join("out.urdf");
        let said = document(&["model", text(folder.path()), "--urdf", text(&out)]);
        agrees_with(reference, &said);
        let told = said["warnings"].to_string();
        assert!(
            told.contains("guessed in the robot file: joint compliances"),
            "{told}"
        );
        let beside = std::fs::read_to_string(folder.path().join("out.compliances.toml")).unwrap();
        assert_eq!(
            beside.matches("compliance_rad_per_nm").count(),
            reference.joints_deg.len()
        );
        assert!(
            beside.contains("the robot file, not calibrated") && beside.contains("guesses = "),
            "{beside}"
        );
        let again = tempfile::tempdir().unwrap();
        let posture: Vec<String> = reference.joints_deg.iter().map(f64::to_string).collect();
        let made = document(&[
            "init",
            text(again.path()),
            "--robot",
            text(&out),
            "--posture",
            &format!("p1={}", posture.join(",")),
        ]);
        assert_eq!(made["complete"], true);
        let back = document(&["model", text(again.path())]);
        // Compliances have come through the file next to the URDF, masses and geometry through the URDF.
        agrees_with(reference, &back);
    }
}

/// A file next to the URDF gives the compliances; what a joint cannot take is told.
#[test]
fn compliances_are_those_of_the_file_next_to_the_urdf() {
    let folder = tempfile::tempdir().unwrap();
    let (out, dir) = (folder.path().join("out.urdf"), folder.path().join("cell"));
    let from = campaign_on(REFERENCES[0].robot, &[REFERENCES[0].joints_deg]);
    document(&["model", text(from.path()), "--urdf", text(&out)]);
    let beside = folder.path().join("out.compliances.toml");
    let told = std::fs::read_to_string(&beside).unwrap();
    let at = told.find("compliance_rad_per_nm = ").unwrap();
    let line = told[at..].lines().next().unwrap();
    let changed = told.replacen(line, "compliance_rad_per_nm = 1.25e-5", 1);
    std::fs::write(&beside, &changed).unwrap();
    std::fs::create_dir(&dir).unwrap();
    let far = vec!["720"; REFERENCES[0].joints_deg.len()].join(",");
    let arguments = [
        "init",
        text(&dir),
        "--robot",
        text(&out),
        "--posture",
        &format!("p1={far}"),
    ];
    let made = document(&arguments);
    assert_eq!(made["robot"]["compliances_from"], text(&beside));
    let warnings = made["warnings"].to_string();
    assert!(
        warnings.contains("posture p1 is beyond the joint limits") && warnings.contains("at 720°"),
        "{warnings}"
    );
    let modelled = document(&["model", text(&dir)]);
    let warnings = modelled["warnings"].to_string();
    assert!(
        warnings.contains("posture p1 is beyond the joint limits"),
        "{warnings}"
    );
    let file = std::fs::read_to_string(dir.join("out.toml")).unwrap();
    assert!(
        file.contains("compliance_rad_per_nm = 1.25e-5  # from out.compliances.toml"),
        "{file}"
    );
    std::fs::write(
        &beside,
        changed.replace(
            "compliance_rad_per_nm = 1.25e-5",
            "compliance_rad_per_nm = \"soft\"",
        ),
    )
    .unwrap();
    let run = lobestone(&[&arguments[..], &["--force"]].concat());
    assert_eq!(run.status, Some(1));
    assert!(
        run.stderr.contains("joint[0].compliance_rad_per_nm") && run.stderr.contains("out.compliances.toml:"),
        "{}",
        run.stderr
    );
}

/// What was decided and guessed is told, stands in the file, and the file is the robot's.
#[test]
fn init_tells_what_it_made_of_a_urdf() {
    let folder = tempfile::tempdir().unwrap();
    let dir = text(folder.path());
    let source = urdf("seven");
    let arguments = ["init", dir, "--robot", text(&source), "--payload-kg", "3"];
    let run = lobestone(&arguments);
    assert_eq!(run.status, Some(0), "{}", run.stderr);
    for words in [
        "7 joints, 20.6 kg of moving links",
        "base base, tool grip (the farthest out, behind 7 turning joints)",
        "with a7 as one body: hand, left, right",
        "joint finger_a (prismatic) is not between base and tool: held at 0",
        "joint finger_b (prismatic, follows finger_a)",
        "guessed: joint compliances: an order of magnitude",
        "a payload of 3 kg",
    ] {
        assert!(run.stdout.contains(words), "{words}: {}", run.stdout);
    }
    let file = std::fs::read_to_string(folder.path().join("seven.toml")).unwrap();
    assert!(
        file.contains("compliance_rad_per_nm = 5e-5  # a guess, see above"),
        "{file}"
    );
    assert!(file.contains("guesses = ["), "{file}");
    let again = lobestone(&arguments);
    assert_eq!(again.status, Some(1));
    assert!(again.stderr.contains("is there already"), "{}", again.stderr);
    let forced = [&arguments[..], &["--force", "--tool-link", "hand"]].concat();
    let made = document(&forced);
    assert_eq!(made["robot"]["tool_link"], "hand");
    assert_eq!(made["robot"]["joints"].as_array().unwrap().len(), 7);
    let notes = made["robot"]["notes"].to_string();
    assert!(notes.contains("tool hand (asked for)"), "{notes}");
}

/// What cannot be modelled is refused with the joint's name and a way out, and nothing is left behind.
#[test]
fn what_is_no_arm_is_refused_in_words() {
    let seven = std::fs::read_to_string(urdf("seven")).unwrap();
    let slides = seven.replacen(
        "name=\"j3\" type=\"revolute\"",
        "name=\"j3\" type=\"prismatic\"",
        1,
    );
    let follows = seven.replacen(
        "<axis xyz=\"0 0 1\"/>",
        "<axis xyz=\"0 0 1\"/><mimic joint=\"j2\"/>",
        1,
    );
    // Each attribute is looked at for every other one by the parser, and each name space is kept: 2 MB would take minutes.
    let many = format!(
        "<robot name=\"x\" {}/>",
        (0..200_000)
            .map(|i| format!("xmlns:a{i}=\"\" "))
            .collect::<String>()
    );
    let cases: [(&str, String, &[&str], &[&str]); 14] = [
        ("many.urdf", many, &[], &["an element with 200001 attributes"]),
        (
            "slides.urdf",
            slides,
            &[],
            &["j3", "prismatic", "only joints that turn", "--base-link"],
        ),
        ("follows.urdf", follows, &[], &["j1", "follows j2", "--tool-link"]),
        (
            "x.xacro",
            "<robot xmlns:xacro=\"x\"><xacro:arm/></robot>".into(),
            &[],
            &["is a xacro", "xacro FILE"],
        ),
        ("none.urdf", "<robot name=\"x\"/>".into(), &[], &["no link"]),
        (
            "broken.urdf",
            seven[..900].to_string(),
            &[],
            &["no URDF that can be read"],
        ),
        (
            "deep.urdf",
            "<a>".repeat(300),
            &[],
            &["nested more than 200 deep"],
        ),
        (
            "seven.urdf",
            seven.clone(),
            &["--tool-link", "hnd"],
            &["no link \"hnd\"", "a1"],
        ),
        (
            "seven.urdf",
            seven.clone(),
            &["--base-link", "a5", "--tool-link", "a2"],
            &["a2 is not attached to a5"],
        ),
        (
            "seven.urdf",
            seven.clone(),
            &["--base-link", "a7"],
            &["no joint turns between a7 and"],
        ),
        (
            "seven.urdf",
            seven.replace("mass value=\"3.4\"", "mass value=\"-3.4\""),
            &[],
            &["a4", "negative"],
        ),
        (
            "seven.urdf",
            seven.replace("xyz=\"0.083 0 0\"", "xyz=\"nan 0 0\""),
            &[],
            &["j4", "NaN"],
        ),
        (
            "seven.urdf",
            seven.replace("child link=\"a3\"", "child link=\"a1\""),
            &[],
            &["a1", "two joints carry"],
        ),
        (
            "seven.urdf",
            seven.replacen("mass value=\"3.4\"", "mass weight=\"3.4\"", 1),
            &[],
            &[
                "no URDF that can be read",
                "seven.urdf:",
                ": link a4: ",
                "correct this link",
            ],
        ),
    ];
    for (name, content, flags, words) in cases {
        let folder = tempfile::tempdir().unwrap();
        let source = folder.path().join("in").join(name);
        std::fs::create_dir(source.parent().unwrap()).unwrap();
        std::fs::write(&source, content).unwrap();
        let dir = folder.path().join("cell");
        std::fs::create_dir(&dir).unwrap();
        let run = lobestone(&[&["init", text(&dir), "--robot", text(&source)], flags].concat());
        assert_eq!(run.status, Some(1), "{name} {flags:?}: {}", run.stdout);
        for word in words {
            assert!(
                run.stderr.contains(word),
                "{name} {flags:?}: {word}: {}",
                run.stderr
            );
        }
        assert_eq!(std::fs::read_dir(&dir).unwrap().count(), 0, "{name} {flags:?}");
    }
    // A campaign that names the URDF itself is told how to make a robot file of it.
    let folder = tempfile::tempdir().unwrap();
    let campaign = "schema = \"lobestone/campaign/1\"\nname = \"x\"\n[robot]\nmodel = \"arm.urdf\"\n";
    std::fs::write(folder.path().join("campaign.toml"), campaign).unwrap();
    let run = lobestone(&["model", text(folder.path())]);
    assert!(
        run.stderr.contains("lobestone init DIR --robot arm.urdf"),
        "{}",
        run.stderr
    );
}

const CUT: &str = "[lobes]\nprocess = \"drilling\"\nsource = \"model\"\nktc_n_per_mm2 = 1014.2\nkrc_n_per_mm2 = 619.9\n\
                   teeth = 2\nhalf_point_angle_deg = 67.5\nspindle_rpm = [500.0, 3000.0, 20.0]\n\
                   [lobes.hole]\nthrust_n = 60.0\ntorque_nm = 0.4\nlateral_n = 5.0\n\
                   position_tolerance_mm = 50.0\nperpendicularity_tolerance_deg = 20.0\n";

/// The commands on two arms of today: six joints without a spherical wrist, and seven joints.
#[test]
fn lobes_hole_and_sweep_run_on_both_arms() {
    for (robot, posture) in [
        (
            "ur10e with spindle",
            &[-20.0, -80.0, -100.0, -90.0, 90.0, 20.0][..],
        ),
        ("iiwa14", &[10.0, 40.0, 15.0, -80.0, 20.0, 60.0, 30.0][..]),
    ] {
        let folder = campaign_on(robot, &[posture]);
        let file = folder.path().join("campaign.toml");
        let begin = std::fs::read_to_string(&file).unwrap() + CUT;
        let mut turned = begin.clone() + "[lobes.redundancy]\nposture = \"p1\"\nstep_deg = 45.0\n";
        if robot == "iiwa14" {
            turned += "elbow_step_deg = 180.0\n";
        }
        std::fs::write(&file, &begin).unwrap();
        let plain = document(&["lobes", text(folder.path())]);
        assert!(plain["absolute_limit_mm"].as_f64().unwrap() > 0.0);
        assert_eq!(plain["hole"].as_array().unwrap().len(), 1);
        let told = plain["warnings"].to_string();
        assert!(told.contains("guessed in the robot file"), "{told}");

        std::fs::write(&file, &turned).unwrap();
        let found = document(&["lobes", text(folder.path())]);
        let redundancy = &found["redundancy"];
        let angles = redundancy["angles"].as_array().unwrap();
        assert_eq!(angles.len(), 8);
        let usable: Vec<&Value> = angles.iter().filter(|a| a["status"] == "reachable").collect();
        assert!(usable.len() >= 3, "{robot}: {}", usable.len());
        let joints = posture.len();
        assert_eq!(
            redundancy["recommended"]["joints_deg"].as_array().unwrap().len(),
            joints
        );
        // The tool stays where it is, whatever the angle.
        let turned_postures: Vec<Vec<f64>> = usable.iter().map(|a| numbers(&a["joints_deg"])).collect();
        let slices: Vec<&[f64]> = turned_postures.iter().map(Vec::as_slice).collect();
        let said = document(&["model", text(campaign_on(robot, &slices).path())]);
        let home = document(&["model", text(campaign_on(robot, &[posture]).path())]);
        for there in said["postures"].as_array().unwrap() {
            for key in ["tcp_m", "tool_axis"] {
                let pairs = numbers(&there[key])
                    .into_iter()
                    .zip(numbers(&home["postures"][0][key]));
                assert!(
                    pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-8),
                    "{robot} {key}: {there}"
                );
            }
        }
        let elbows = redundancy["elbows"].as_array().unwrap();
        match robot {
            "iiwa14" => {
                assert_eq!(elbows.len(), 2);
                let chosen: Vec<&Value> = elbows.iter().filter(|e| e["chosen"] == true).collect();
                assert_eq!(chosen.len(), 1);
                let deepest = elbows.iter().filter_map(|e| e["point"]["depth_mm"].as_f64());
                assert_eq!(
                    chosen[0]["point"]["depth_mm"].as_f64(),
                    deepest.reduce(f64::max),
                    "{elbows:?}"
                );
                assert!(usable[0]["elbow_deg"].is_number());
            }
            _ => assert!(elbows.is_empty() && usable[0].get("elbow_deg").is_none()),
        }

        let campaign = Campaign::load(folder.path()).unwrap();
        let tcp = numbers(&home["postures"][0]["tcp_m"]);
        let around = |i: usize| format!("{}:{}:0.1", tcp[i] - 0.05, tcp[i] + 0.05);
        let request = SweepRequest {
            spans_m: [0, 1, 2].map(|i| around(i).parse().ok()),
            angle_step_deg: Some(180.0),
            ..SweepRequest::default()
        };
        let map = Sweep::new(&campaign, &request).unwrap();
        let rows = map.rows(0..map.grid.place_count()).unwrap();
        assert_eq!(rows.len(), 16);
        let reached: Vec<_> = rows
            .iter()
            .filter(|r| r.status == PlaceStatus::Reachable)
            .collect();
        assert!(reached.len() >= 8, "{robot}: {}", reached.len());
        for row in reached {
            let there = row.findings.as_ref().unwrap();
            assert_eq!(there.joints_deg.len(), joints);
            assert!(there.limit_margin_deg.unwrap() >= 0.0 && there.singularity_margin > 0.0);
        }
    }
}

/// An elbow is turned where there is one.
#[test]
fn six_joints_have_no_elbow_to_turn() {
    let folder = campaign_on("ur10e", &[&[-20.0, -80.0, -100.0, -90.0, 90.0, 20.0]]);
    let file = folder.path().join("campaign.toml");
    let more = "[lobes.redundancy]\nposture = \"p1\"\nstep_deg = 45.0\nelbow_step_deg = 30.0\n";
    std::fs::write(&file, std::fs::read_to_string(&file).unwrap() + CUT + more).unwrap();
    let run = lobestone(&["lobes", text(folder.path())]);
    assert_eq!(run.status, Some(1));
    assert!(
        run.stderr.contains("lobes.redundancy.elbow_step_deg") && run.stderr.contains("take the key out"),
        "{}",
        run.stderr
    );
}
