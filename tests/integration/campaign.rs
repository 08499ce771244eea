//! Reading `campaign.toml`: what is right loads, what is wrong gives one error with file, key, line and remedy.

use std::f64::consts::PI;
use std::path::Path;

use lobestone::campaign::*;
use lobestone::ingest::Quantity;
use lobestone::robot::RobotSpec;
use lobestone::{Error, InputError};
use proptest::prelude::*;

/// Every key of docs/campaign.md.
const FULL: &str = include_str!("../data/campaign_full.toml");

/// A folder with the files that `FULL` names.
fn folder(toml: impl AsRef<[u8]>) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for file in ["frf/p1.uff", "frf/p2.csv", "force/cut01.txt", "force/cut02.txt"] {
        let path = dir.path().join(file);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, "x").unwrap();
    }
    std::fs::write(dir.path().join("campaign.toml"), toml).unwrap();
    dir
}

fn load(toml: impl AsRef<[u8]>) -> Result<Campaign, Error> {
    Campaign::load(folder(toml).path())
}

fn refused(toml: impl AsRef<[u8]>) -> InputError {
    match load(toml) {
        Err(Error::Input(error)) => *error,
        Err(other) => panic!("not an input error: {other}"),
        Ok(_) => panic!("accepted"),
    }
}

#[test]
fn every_key_of_the_contract_is_read() {
    let dir = folder(FULL);
    let campaign = Campaign::load(dir.path()).unwrap();
    assert_eq!(campaign.name, "cell 7, spring check");
    assert_eq!(
        campaign.robot,
        Some(RobotSection {
            model: "irb6640".into(),
            mass_tolerance: Some(0.05),
            stiffness_tolerance: 0.4,
            links: LinkTolerances {
                inertia: Some(0.5),
                centre_m: Some(0.04),
                length_m: Some(0.005),
                wall: Some(0.2),
            },
        })
    );
    assert_eq!(
        campaign.postures[1].joints_deg,
        [135.0, 20.0, 26.0, 30.0, 80.0, -150.0]
    );
    assert_eq!(
        campaign.points[1],
        Point {
            node: 12,
            body: BodyRef::Link(6),
            position_m: [0.0, 0.1, 0.0],
            axes: AxesRef::Body
        }
    );
    let frf = &campaign.frfs[1];
    assert!(frf.file.ends_with("frf/p2.csv") && frf.file.is_file());
    assert_eq!(
        (frf.posture, frf.quantity, frf.force_level_n, frf.line),
        (1, Some(Quantity::Accelerance), Some(200.0), 37)
    );
    let tool = campaign.tool.unwrap();
    assert_eq!(
        (tool.kind, tool.teeth, tool.web_thickness_mm),
        (ToolKind::Drill, 2, Some(1.425))
    );
    assert_eq!(campaign.material.as_deref(), Some("Ti-6Al-4V"));
    assert_eq!(campaign.dynamometer.tool_from_dyno[0], [0.0, -1.0, 0.0]);
    let [slot, quarter, hole] = &campaign.cuts[..] else {
        panic!()
    };
    assert_eq!(
        (slot.order, slot.steady_s, slot.outcome),
        (Some(3), Some([1.2, 2.6]), Some(CutOutcome::Chatter))
    );
    assert_eq!(
        quarter.geometry,
        CutGeometry::Milling {
            feed_per_tooth_mm: 0.05,
            axial_depth_mm: 2.0,
            immersion: Immersion {
                start_rad: 0.0,
                exit_rad: PI / 2.0
            }
        }
    );
    assert_eq!(
        hole.geometry,
        CutGeometry::Drilling {
            feed_per_rev_mm: 0.05,
            pilot_diameter_mm: 3.5,
            hole_depth_mm: Some(8.3)
        }
    );
    let lobes = campaign.lobes.unwrap();
    assert_eq!(
        (lobes.source, lobes.method),
        (LobeSource::Model, LobeMethod::SemiDiscretisation)
    );
    // A quarter of the diameter, down: the last 60°.
    let immersion = lobes.immersion.unwrap();
    assert!((immersion.start_rad - PI * 2.0 / 3.0).abs() < 1e-12 && immersion.exit_rad == PI);
    assert_eq!(lobes.redundancy.unwrap().posture, 1);
    let hole = lobes.hole.unwrap();
    assert_eq!(
        (hole.thrust_n, hole.torque_nm, hole.lateral_n),
        (Some(400.0), None, Some(30.0))
    );
    assert_eq!(
        (hole.position_tolerance_mm, hole.perpendicularity_tolerance_deg),
        (0.2, 0.5)
    );
    assert_eq!(lobes.modes[0].axis, LobeAxis::X);
}

#[test]
fn windows_files_and_byte_order_marks_are_read_alike() {
    let plain = load(FULL).unwrap();
    let windows = load(format!("\u{feff}{}", FULL.replace('\n', "\r\n"))).unwrap();
    assert_eq!(windows.cuts.len(), plain.cuts.len());
    assert_eq!(windows.cuts[2].line, plain.cuts[2].line);
    assert_eq!(windows.postures, plain.postures);
}

#[test]
fn what_may_be_left_out_has_its_default() {
    let dir = folder("schema = \"lobestone/campaign/1\"\n[robot]\nmodel = \"irb6640\"\n");
    let campaign = Campaign::load(dir.path()).unwrap();
    assert_eq!(campaign.name, dir.path().file_name().unwrap().to_str().unwrap());
    let robot = campaign.robot.unwrap();
    assert_eq!((robot.mass_tolerance, robot.stiffness_tolerance), (None, 0.3));
    assert_eq!(
        campaign.dynamometer.tool_from_dyno,
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    );
}

/// One slip each: what to replace in `FULL`, by what, the key that the error must name, and words of the message.
/// The line must be the one where the replacement stands (its first line that differs), unless given.
#[rustfmt::skip]
const SLIPS: &[(&str, &str, &str, &str)] = &[
    // Names.
    ("name = \"cell", "nmae = \"cell", "nmae", "did you mean name?"),
    ("[material]", "[materials]", "materials", "did you mean material?"),
    ("helix_deg", "helix", "tool.helix", "did you mean helix_deg?"),
    ("axial_depth_mm = 2.0\nimm", "axial_dept_mm = 2.0\nimm", "cut[0].axial_dept_mm", "did you mean axial_depth_mm?"),
    ("step_deg", "steps_deg", "lobes.redundancy.steps_deg", "did you mean step_deg?"),
    ("axis = \"x\"", "axes = \"x\"", "lobes.mode[0].axes", "did you mean axis?"),
    ("id = \"02\"", "id = \"02\"\nid = \"02\"", "cut[1].id", "duplicate key"),
    ("[material]", "[tool]", "tool", "duplicate key"),
    // Schema.
    ("lobestone/campaign/1", "lobestone/campaign/2", "schema", "is not a form this program reads"),
    ("\"lobestone/campaign/1\"", "1", "schema", "must be text in quotes, not a whole number"),
    // Syntax.
    ("teeth = 2\nhelix", "teeth = two\nhelix", "tool.teeth", "not valid TOML"),
    ("diameter_mm = 9.5", "diameter_mm = 9,5", "tool.diameter_mm", "not valid TOML"),
    ("id = \"p2\"", "id = \"p2", "posture[1].id", "not valid TOML"),
    ("[dynamometer]", "[dynamometer", "dynamometer", "not valid TOML"),
    // Types.
    ("diameter_mm = 9.5", "diameter_mm = \"9.5\"", "tool.diameter_mm", "take the quotes off"),
    ("teeth = 2\nhelix", "teeth = 2.0\nhelix", "tool.teeth", "must be a whole number"),
    ("[material]\nname = \"Ti-6Al-4V\"", "material = \"steel\"", "tool.material", "unknown key"),
    ("[tool]", "[[tool]]", "tool", "may stand only once"),
    ("id = \"01\"", "id = 1", "cut[0].id", "must be text in quotes"),
    ("id = \"01\"", "id = \" \"", "cut[0].id", "is empty"),
    ("order = 3", "order = true", "cut[0].order", "must be a whole number, not true or false"),
    ("kind = \"drill\"", "kind = \"dril\"", "tool.kind", "did you mean \"drill\"?"),
    // Robot.
    ("irb6640", "irb664", "robot.model", "no built-in robot"),
    ("irb6640", "../robot.toml", "robot.model", "leaves the campaign folder"),
    ("mass_tolerance = 0.05", "mass_tolerance = -0.05", "robot.mass_tolerance", "at least 0 and at most 1"),
    ("inertia_tolerance = 0.5", "inertia_tolerance = 5.0", "robot.inertia_tolerance", "at least 0 and at most 2"),
    ("com_tolerance_mm = 40.0", "com_tolerance_m = 0.04", "robot.com_tolerance_m", "did you mean com_tolerance_mm?"),
    ("length_tolerance_mm = 5.0", "length_tolerance_mm = -5.0", "robot.length_tolerance_mm", "at least 0 and at most 500"),
    ("stiffness_tolerance = 0.4", "stiffness_tolerance = 0", "robot.stiffness_tolerance", "above 0"),
    // Postures and points.
    ("id = \"p2\"", "id = \"p1\"", "posture[1].id", "p1 is taken by posture[0]"),
    ("[135, 20, 26, 30, 80, -150]", "[135, 20, 26, 30, 80]", "posture[1].joints_deg", "has 5 angles, but the robot has 6"),
    ("[135, 20,", "[135, nan,", "posture[1].joints_deg[1]", "is nan, not a finite number"),
    ("[135, 20,", "[135, \"20\",", "posture[1].joints_deg[1]", "take the quotes off"),
    ("joints_deg = [135, 20, 26, 30, 80, -150]\n", "", "posture[1].joints_deg", "missing@17"),
    ("node = 12", "node = 1", "point[1].node", "1 is taken by point[0]"),
    ("\"link6\"", "\"link7\"", "point[1].body", "the robot has no body \"link7\""),
    ("\"link6\"", "\"link06\"", "point[1].body", "\"link1\" to \"link6\""),
    ("[0.0, 0.1, 0.0]", "[0.0, 0.1]", "point[1].position_m", "has 2 numbers, must have 3"),
    ("axes = \"body\"", "axes = \"world\"", "point[1].axes", "\"base\", \"body\", \"tool\""),
    // Files.
    ("frf/p2.csv", "frf/p2.uff", "frf[1].file", "did you mean frf/p2.csv?"),
    ("frf/p2.csv", "/etc/passwd", "frf[1].file", "is an absolute path"),
    ("frf/p2.csv", "../p2.csv", "frf[1].file", "leaves the campaign folder"),
    ("frf/p2.csv", "frf", "frf[1].file", "is not a file"),
    ("force/cut02.txt", "force/nothing/here.txt", "cut[1].file", "does not exist"),
    ("posture = \"p2\"\nquan", "posture = \"p3\"\nquan", "frf[1].posture", "name one that is there (p1, p2)"),
    ("\"accelerance\"", "\"inertance\"", "frf[1].quantity", "\"receptance\", \"mobility\""),
    ("force_level_n = 200.0", "force_level_n = 0.0", "frf[1].force_level_n", "above 0"),
    // Tool and dynamometer.
    ("teeth = 2\nhelix", "teeth = 0\nhelix", "tool.teeth", "from 1 to 1000"),
    ("diameter_mm = 9.5", "diameter_mm = -9.5", "tool.diameter_mm", "is -9.5, out of range"),
    ("diameter_mm = 9.5\n", "", "tool.diameter_mm", "missing@43"),
    ("kind = \"drill\"", "kind = \"endmill\"", "tool.half_point_angle_deg", "belongs to a drill@48"),
    ("half_point_angle_deg = 67.5\nweb", "half_point_angle_deg = 118.0\nweb", "tool.half_point_angle_deg", "at most 90"),
    ("web_thickness_mm = 1.425", "web_thickness_mm = 9.5", "tool.web_thickness_mm", "below 9.5"),
    ("[0.0, 0.0, 1.0]]", "[0.0, 0.0, 2.0]]", "dynamometer.tool_from_dyno", "would stretch the forces"),
    ("[[0.0, -1.0, 0.0], ", "[[0.0, -1.0], ", "dynamometer.tool_from_dyno[0]", "has 2 numbers, must have 3"),
    (", [0.0, 0.0, 1.0]]", "]", "dynamometer.tool_from_dyno", "has 2 rows, must have 3"),
    ("[[0.0, -1.0, 0.0], ", "[[0.0, -1.0, inf], ", "dynamometer.tool_from_dyno[0][2]", "not a finite number"),
    // Cuts.
    ("id = \"02\"", "id = \"01\"", "cut[1].id", "01 is taken by cut[0]"),
    ("spindle_rpm = 1200.0", "spindle_rpm = 0", "cut[0].spindle_rpm", "above 0"),
    ("spindle_rpm = 1200.0\n", "", "cut[0].spindle_rpm", "missing@57"),
    ("feed_per_tooth_mm = 0.05\naxial_depth_mm = 2.0\nimm", "feed_per_tooth_mm = -0.05\naxial_depth_mm = 2.0\nimm", "cut[0].feed_per_tooth_mm", "above 0"),
    ("axial_depth_mm = 2.0\nimm", "axial_depth_mm = inf\nimm", "cut[0].axial_depth_mm", "not a finite number"),
    ("immersion = \"slot\"\n", "", "cut[0].immersion", "missing@57"),
    ("immersion = \"slot\"", "immersion = \"half\"", "cut[0].immersion", "it must be \"slot\""),
    ("start_deg = 0.0", "start_deg = 90.0", "cut[1].exit_deg", "starts at 90 and ends at 90@78"),
    ("exit_deg = 90.0", "exit_deg = 270.0", "cut[1].exit_deg", "at most 180"),
    ("exit_deg = 90.0\n", "", "cut[1].exit_deg", "missing@70"),
    ("start_deg = 0.0", "immersion = \"slot\"", "cut[1].exit_deg", "said twice, by immersion and by@78"),
    ("[1.2, 2.6]", "[2.6, 1.2]", "cut[0].steady_s", "starts at 2.6 s and ends at 1.2 s"),
    ("posture = \"p2\"\n\n[[cut]]", "posture = \"tap\"\n\n[[cut]]", "cut[0].posture", "name one that is there (p1, p2)"),
    ("outcome = \"chatter\"", "outcome = \"loud\"", "cut[0].outcome", "\"stable\", \"chatter\""),
    ("process = \"drilling\"", "process = \"milling\"", "cut[2].feed_per_rev_mm", "belongs to drilling@85"),
    ("process = \"drilling\"\n", "", "cut[2].process", "missing@80"),
    ("feed_per_rev_mm = 0.05", "feed_per_rev_mm = 0", "cut[2].feed_per_rev_mm", "above 0"),
    ("pilot_diameter_mm = 3.5", "pilot_diameter_mm = 9.5", "cut[2].pilot_diameter_mm", "the tool's diameter is 9.5"),
    ("hole_depth_mm = 8.3", "hole_depth_mm = -8.3", "cut[2].hole_depth_mm", "above 0"),
    // Lobes.
    ("source = \"model\"", "source = \"modell\"", "lobes.source", "did you mean \"model\"?"),
    ("\"semi-discretisation\"", "\"frequency-domain\"", "lobes.method", "\"zero-order\""),
    ("ktc_n_per_mm2 = 1014.2", "ktc_n_per_mm2 = -1014.2", "lobes.ktc_n_per_mm2", "above 0"),
    ("radial_ratio = 0.25", "radial_ratio = 1.5", "lobes.radial_ratio", "at most 1"),
    ("cut = \"down\"\n", "", "lobes.cut", "missing@89"),
    ("radial_ratio = 0.25\n", "", "lobes.cut", "needs radial_ratio"),
    ("cut = \"down\"", "cut = \"climb\"", "lobes.cut", "\"up\", \"down\""),
    ("[100.0, 1500.0, 1.0]", "[0.0, 1500.0, 1.0]", "lobes.spindle_rpm", "starts at 0 rpm"),
    ("[100.0, 1500.0, 1.0]", "[1500.0, 100.0, 1.0]", "lobes.spindle_rpm", "runs backwards"),
    ("[100.0, 1500.0, 1.0]", "[100.0, 1500.0, 0.0]", "lobes.spindle_rpm", "has the step 0"),
    ("[100.0, 1500.0, 1.0]", "[100.0, 1500.0, 1e-9]", "lobes.spindle_rpm", "more than a million speeds"),
    ("damping_ratio = 0.039", "damping_ratio = 1.0", "lobes.mode[0].damping_ratio", "above 0 and below 1"),
    ("axis = \"x\"", "axis = \"theta\"", "lobes.mode[0].axis", "\"x\", \"y\""),
    ("posture = \"p2\"\nstep", "posture = \"tap\"\nstep", "lobes.redundancy.posture", "name one that is there (p1, p2)"),
    ("[[200.0, 240.0]]", "[[240.0, 200.0]]", "lobes.redundancy.forbidden_deg[0]", "from the smaller to the larger"),
    ("lateral_n = 30.0", "lateral_n = -30.0", "lobes.hole.lateral_n", "at least 0"),
    ("lateral_n = 30.0", "laterals_n = 30.0", "lobes.hole.laterals_n", "did you mean lateral_n?"),
    ("position_tolerance_mm = 0.2", "position_tolerance_mm = 0.0", "lobes.hole.position_tolerance_mm", "above 0"),
    ("[[200.0, 240.0]]", "[200.0, 240.0]", "lobes.redundancy.forbidden_deg[0]", "must be a list of numbers"),
];

#[test]
fn each_slip_is_one_error_with_file_key_line_and_remedy() {
    for (from, to, key, words) in SLIPS {
        assert_eq!(
            FULL.matches(from).count().min(1),
            1,
            "{from:?} is not in the text"
        );
        let broken = FULL.replacen(from, to, 1);
        let error = refused(&broken);
        println!("{error}\n");
        assert!(error.file.as_ref().unwrap().ends_with("campaign.toml"), "{error}");
        assert_eq!(error.key.as_deref(), Some(*key), "{error}");
        let (words, line) = match words.split_once('@') {
            Some((words, line)) => (words, Some(line.parse().unwrap())),
            None => (*words, None),
        };
        let first_difference = broken
            .lines()
            .zip(FULL.lines())
            .position(|(a, b)| a != b)
            .unwrap();
        // A doubled key differs from the original one line later than where it was put.
        let line = line.unwrap_or(first_difference + 1);
        assert_eq!(error.line, Some(line), "{error}");
        let message = error.to_string();
        assert!(
            words.split('|').any(|w| message.contains(w)),
            "{words:?} is not in:\n{message}"
        );
        assert!(error.remedy.is_some_and(|r| !r.trim().is_empty()), "{message}");
        assert!(message.len() < 600, "{message}");
    }
}

#[test]
fn sections_of_the_wrong_kind_are_shown_the_right_brackets() {
    for (text, key, words) in [
        ("cut = 3", "cut", "[[cut]] with double brackets"),
        (
            "cut = [1, 2]",
            "cut",
            "must be a list of sections, but holds a whole number",
        ),
        ("[cut]\nid = '1'", "cut", "[[cut]] with double brackets"),
        (
            "material = 'steel'",
            "material",
            "write [material] on a line of its own",
        ),
        (
            "[[robot]]\nmodel = 'irb6640'",
            "robot",
            "write [robot] with single brackets",
        ),
    ] {
        let error = refused(format!("schema = 'lobestone/campaign/1'\n{text}\n"));
        assert_eq!(
            (error.key.as_deref(), error.line),
            (Some(key), Some(2)),
            "{error}"
        );
        assert!(error.to_string().contains(words), "{error}");
    }
}

#[test]
fn sections_that_need_another_say_so() {
    let without = |section: &str| {
        let start = FULL.find(section).unwrap();
        let end = FULL[start + 1..]
            .find("\n[")
            .map_or(FULL.len(), |i| start + 2 + i);
        format!("{}{}", &FULL[..start], &FULL[end..])
    };
    let error = refused(without("[tool]"));
    assert!(
        error
            .to_string()
            .contains("tool: missing: there are cuts, but no tool"),
        "{error}"
    );
    let error = refused(without("[robot]"));
    assert_eq!(error.key.as_deref(), Some("lobes.source"), "{error}");
    let error = refused(without("[[lobes.mode]]").replace("source = \"model\"", "source = \"modes\""));
    assert_eq!(error.key.as_deref(), Some("lobes.source"), "{error}");
    // Without a robot the postures have to agree among themselves.
    let error = refused(without("[robot]").replace("[135, 20, 26, 30, 80, -150]", "[1, 2]"));
    assert!(
        error.to_string().contains("has 2 angles, but posture[0] has 6"),
        "{error}"
    );
}

#[test]
fn no_campaign_and_no_text_are_said() {
    let dir = tempfile::tempdir().unwrap();
    let message = |path: &Path| Campaign::load(path).unwrap_err().to_string();
    assert!(message(dir.path()).contains("campaign.toml: there is no such file\n  remedy: "));
    assert!(message(&dir.path().join("nowhere")).contains("nowhere: there is no such folder"));
    let file = dir.path().join("campaign.toml");
    std::fs::write(&file, FULL.replace("spring", "spr\u{ed}ng")).unwrap();
    assert!(message(&file).contains("is a file, not a campaign folder"));
    let latin1: Vec<u8> = FULL.bytes().map(|b| if b == b',' { 0xed } else { b }).collect();
    assert!(
        refused(latin1)
            .to_string()
            .contains("campaign.toml:2: the text is not UTF-8")
    );
    assert!(refused("").to_string().contains("schema: missing"));
    std::fs::remove_file(&file).unwrap();
    std::fs::create_dir(&file).unwrap();
    assert!(message(dir.path()).contains("there is no such file"));
}

#[test]
fn a_robot_file_of_the_campaign_is_read_and_its_faults_are_its_own() {
    let cobot = include_str!("../data/cobot7.toml");
    let toml = "schema = \"lobestone/campaign/1\"\n[robot]\nmodel = \"robots/cobot.toml\"\n[[posture]]\nid = \"p\"\njoints_deg = [0, 30, 0, -60, 0, 45, 0]\n[[point]]\nnode = 1\nbody = \"link7\"\nposition_m = [0, 0, 0]\naxes = \"tool\"\n";
    let dir = folder(toml);
    let file = dir.path().join("robots/cobot.toml");
    std::fs::create_dir(dir.path().join("robots")).unwrap();
    std::fs::write(&file, cobot).unwrap();
    let campaign = Campaign::load(dir.path()).unwrap();
    assert_eq!(campaign.points[0].body, BodyRef::Link(7));

    let robot = RobotSpec::load("robots/cobot.toml", dir.path()).unwrap();
    assert_eq!((robot.joints.len(), robot.links.len()), (7, 7));
    assert_eq!(robot.links[1].com_m, Some([0.0, 0.06, 0.04]));
    assert!(robot.links[2].section.is_some() && robot.links[0].section.is_none());
    // Upright: shoulder, elbow and wrist above one another.
    assert_eq!(robot.joints.iter().map(|j| j.d_m).sum::<f64>(), 1.306);
    assert_eq!(robot.joints.iter().map(|j| j.alpha_rad).sum::<f64>(), 0.0);

    std::fs::write(&file, cobot.replacen("mass_kg = 4.0", "mass_kg = nan", 1)).unwrap();
    let message = Campaign::load(dir.path()).unwrap_err().to_string();
    assert!(
        message.contains("robots/cobot.toml:56: link[1].mass_kg: is nan"),
        "{message}"
    );

    std::fs::remove_file(&file).unwrap();
    let message = Campaign::load(dir.path()).unwrap_err().to_string();
    assert!(
        message.contains("campaign.toml:3: robot.model: no built-in robot"),
        "{message}"
    );
    assert!(message.contains("built-in robots: irb6640"), "{message}");
}

#[test]
fn a_truncated_campaign_never_panics() {
    let dir = folder(FULL);
    for i in 0..=20 {
        let cut = FULL.len() * i / 20;
        std::fs::write(dir.path().join("campaign.toml"), &FULL.as_bytes()[..cut]).unwrap();
        // Some cuts fall between two sections and leave a smaller campaign that is right.
        if let Err(error) = Campaign::load(dir.path()) {
            let Error::Input(error) = error else {
                panic!("{error}")
            };
            assert!(error.line.is_some() && error.remedy.is_some(), "{error}");
        }
    }
}

/// Bytes that mean something in TOML, and some that mean nothing anywhere.
fn spice() -> impl Strategy<Value = Vec<u8>> {
    let words = [
        "[",
        "]",
        "[[",
        "]]",
        "=",
        "\"",
        "'",
        "\"\"\"",
        ".",
        ",",
        "\n",
        "\r",
        "#",
        "{",
        "}",
        "nan",
        "-inf",
        "1e999",
        "-",
        "0",
        "9223372036854775808",
        "1979-05-27",
        "true",
        "\\u0000",
        "\u{feff}",
        "é",
        "cut",
        "lobes",
        "..",
    ];
    prop_oneof![
        proptest::sample::select(words.to_vec()).prop_map(|w| w.as_bytes().to_vec()),
        proptest::collection::vec(any::<u8>(), 0..4),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// However the text is mutilated: a campaign of finite numbers, or an error with a line; never a panic.
    #[test]
    fn a_mutilated_campaign_never_panics(
        edits in proptest::collection::vec((any::<prop::sample::Index>(), 0usize..40, spice()), 1..6)
    ) {
        let mut text = FULL.as_bytes().to_vec();
        for (at, gone, put) in edits {
            let at = at.index(text.len() + 1);
            let end = (at + gone).min(text.len());
            text.splice(at..end, put);
        }
        match load(&text) {
            Ok(campaign) => {
                let finite = campaign.postures.iter().flat_map(|p| &p.joints_deg).all(|x| x.is_finite());
                prop_assert!(finite && campaign.cuts.iter().all(|c| c.spindle_rpm > 0.0));
                prop_assert!(campaign.frfs.iter().all(|f| f.posture < campaign.postures.len()));
            }
            Err(Error::Input(error)) => prop_assert!(error.line.is_some() && error.remedy.is_some(), "{}", error),
            Err(other) => prop_assert!(false, "{}", other),
        }
    }

    /// Lines taken out or said twice.
    #[test]
    fn a_shuffled_campaign_never_panics(picks in proptest::collection::vec(any::<prop::sample::Index>(), 1..160)) {
        let lines: Vec<&str> = FULL.lines().collect();
        let text: Vec<&str> = picks.iter().map(|i| lines[i.index(lines.len())]).collect();
        let _ = load(text.join("\n"));
    }
}
