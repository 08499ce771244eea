//! `lobestone lobes`: the hole itself against its tolerances, posture by posture and over the redundancy angle.

use std::path::Path;

use serde_json::{Value, json};

use crate::support::{append, blind, copy_of, document, lobestone};

/// The built-in robot at two tap-test postures, nothing measured.
const ROBOT: &str = "schema = \"lobestone/campaign/1\"\nname = \"hole\"\n[robot]\nmodel = \"irb6640\"\n\
                     [[posture]]\nid = \"p1\"\njoints_deg = [135.0, -2.0, 53.0, 83.0, 30.0, -117.0]\n\
                     [[posture]]\nid = \"p2\"\njoints_deg = [135.0, 20.0, 26.0, 30.0, 80.0, -150.0]\n";
const DRILL: &str = "[tool]\nkind = \"drill\"\ndiameter_mm = 9.5\nteeth = 2\nhalf_point_angle_deg = 67.5\n\
                     web_thickness_mm = 1.425\n";
const DRILLING: &str = "[lobes]\nprocess = \"drilling\"\nsource = \"model\"\nktc_n_per_mm2 = 1014.2\nkrc_n_per_mm2 = 619.9\n\
                        teeth = 2\nhalf_point_angle_deg = 67.5\nspindle_rpm = [200.0, 500.0, 10.0]\n";

fn campaign(parts: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("campaign.toml"), parts.concat()).unwrap();
    folder
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("no number: {value}"))
}

fn near(found: &Value, expected: f64, share: f64) {
    let found = number(found);
    assert!(
        (found - expected).abs() <= share * expected.abs(),
        "{found} {expected}"
    );
}

/// Against numbers worked out apart from this program (numpy: Jacobian of the published Denavit–Hartenberg table, C = J c Jᵀ,
/// 100 000 directions of the lateral force).
#[test]
fn displacement_and_tilt_are_those_of_the_published_joint_compliances() {
    for (lateral, expected) in [
        (
            0.0,
            [(0.388305, 0.0294408, -0.573291), (0.242296, 0.0196965, -0.545391)],
        ),
        (
            50.0,
            [(0.488165, 0.0336223, -0.601906), (0.396743, 0.0275523, -0.574478)],
        ),
    ] {
        let load = format!("[lobes.hole]\nthrust_n = 400.0\ntorque_nm = 2.0\nlateral_n = {lateral:.1}\n");
        let folder = campaign(&[ROBOT, DRILLING, &load]);
        let found = document(&["lobes", text(folder.path())]);
        let holes = found["hole"].as_array().unwrap();
        assert_eq!(holes.len(), 2);
        for ((hole, id), (position, tilt, axial)) in holes.iter().zip(["p1", "p2"]).zip(expected) {
            assert_eq!((&hole["posture"], &hole["angle_deg"]), (&json!(id), &Value::Null));
            near(&hole["position_error_mm"], position, 1e-4);
            near(&hole["tilt_deg"], tilt, 1e-4);
            // Along the axis the worst direction matters to first order.
            near(&hole["axial_displacement_mm"], axial, 1e-3);
            assert_eq!(hole["within_position_tolerance"], position < 0.25);
            assert_eq!(hole["within_perpendicularity_tolerance"], true);
            assert_eq!(
                (&hole["thrust_n"], &hole["torque_nm"], &hole["lateral_n"]),
                (&json!(400.0), &json!(2.0), &json!(lateral))
            );
            assert_eq!(
                hole["position_error_std_mm"],
                Value::Null,
                "nothing was calibrated"
            );
        }
    }
}

/// Thrust Kac f (R − r0) and torque Ktc (f/N) sin κ N (R² − r0²)/(2 sin κ), with and without a pilot hole; without what they need
/// the answer says what to give.
#[test]
fn forces_come_from_the_coefficients() {
    let cutting = "kac_n_per_mm2 = 900.0\nfeed_per_rev_mm = 0.1\n";
    let chisel = 0.5 * 1.425 / 125f64.to_radians().sin();
    for (more, inner) in [("", chisel), ("[lobes.hole]\npilot_diameter_mm = 4.0\n", 2.0)] {
        let folder = campaign(&[ROBOT, DRILL, DRILLING, cutting, more]);
        let found = document(&["lobes", text(folder.path())]);
        let hole = &found["hole"][0];
        near(&hole["thrust_n"], 900.0 * 0.1 * (4.75 - inner), 1e-9);
        let torque = 1014.2 * 0.1 * (4.75f64.powi(2) - inner.powi(2)) / 2.0 / 1000.0;
        near(&hole["torque_nm"], torque, 1e-9);
        let source = found["hole_basis"]["source"].as_str().unwrap();
        assert_eq!(source.contains("chisel"), more.is_empty(), "{source}");
    }
    for (parts, wanted) in [
        ([DRILLING, cutting], "[tool]"),
        ([DRILL, DRILLING], "feed_per_rev_mm"),
    ] {
        let folder = campaign(&[ROBOT, parts[0], parts[1]]);
        let found = document(&["lobes", text(folder.path())]);
        assert_eq!(found["hole"], json!([]));
        let reason = found["hole_basis"]["not_worked_out"].as_str().unwrap();
        assert!(
            reason.contains(wanted) && reason.contains("[lobes.hole]"),
            "{reason}"
        );
        let warnings = found["warnings"].as_array().unwrap();
        let others = warnings.iter().filter(|w| !w.as_str().unwrap().contains("whirl"));
        assert_eq!(others.count(), 1, "only that nothing is calibrated");
        append(folder.path(), "[lobes.hole]\nposition_tolerance_mm = 0.1\n");
        let warned = lobestone(&["lobes", text(folder.path())]).stdout;
        assert!(warned.contains("warning: the hole is not worked out"), "{warned}");
    }
}

/// The mean forces of the hardest milling cut of the campaign: Fx, Fy by its own coefficients, near what was recorded.
#[test]
fn milling_takes_the_mean_forces_of_the_cuts() {
    let folder = copy_of("force-9400");
    let dir = folder.path();
    append(
        dir,
        &format!(
            "\n[robot]\nmodel = \"irb6640\"\n{}\n[lobes]\nprocess = \"milling\"\nsource = \"model\"\nimmersion = \"slot\"\n\
             spindle_rpm = [200.0, 500.0, 10.0]\n",
            ROBOT.split_once("\"irb6640\"\n").unwrap().1
        ),
    );
    let found = document(&["lobes", text(dir)]);
    let source = found["hole_basis"]["source"].as_str().unwrap();
    let id = source.split_once("of cut ").unwrap().1.split(' ').next().unwrap();
    let cuts = document(&["cfc", text(&blind("force-9400"))]);
    let cut = cuts["cuts"]
        .as_array()
        .unwrap()
        .iter()
        .find(|c| c["id"] == id)
        .unwrap_or_else(|| panic!("no cut {id}"));
    let mean = |axis: &str| number(&cut["averages"][axis]["value"]);
    let lateral = mean("fx").hypot(mean("fy"));
    near(&found["hole"][0]["lateral_n"], lateral, 0.15);
    assert!(number(&found["hole"][0]["torque_nm"]) > 0.0);
}

/// A calibrated model: the tolerance is held against the 95 % bound, not against the value.
#[test]
fn a_calibrated_model_has_an_uncertain_hole() {
    let with_hole = |name: &str| {
        let folder = copy_of(name);
        append(folder.path(), DRILLING);
        append(folder.path(), "[lobes.hole]\nthrust_n = 400.0\ntorque_nm = 2.0\n");
        folder
    };
    // Value, standard deviation and bound of each error at each posture.
    let errors = |found: &Value| -> Vec<[f64; 3]> {
        let holes = found["hole"].as_array().unwrap();
        let of_hole = |hole: &Value| {
            [
                [
                    "position_error_mm",
                    "position_error_std_mm",
                    "position_error_p95_mm",
                ],
                ["tilt_deg", "tilt_std_deg", "tilt_p95_deg"],
            ]
            .map(|keys| keys.map(|key| number(&hole[key])))
        };
        holes.iter().flat_map(of_hole).collect()
    };
    let folder = with_hole("frf-9112");
    let dir = folder.path();
    let first = document(&["lobes", text(dir)]);
    let known = errors(&first);
    assert_eq!(known.len(), 8);
    for &[value, std, upper] in &known {
        assert!(std > 0.0 && std < 0.01 * value, "{value} {std} {upper}");
        // Near a normal distribution the bound is 1.64 standard deviations out.
        assert!(
            (1.0..2.3).contains(&((upper - value) / std)),
            "{value} {std} {upper}"
        );
    }
    let [value, _, upper] = known[2];
    append(
        dir,
        &format!("position_tolerance_mm = {}\n", 0.5 * (value + upper)),
    );
    let second = document(&["lobes", text(dir)]);
    assert_eq!(
        second["hole"][1]["position_error_mm"],
        first["hole"][1]["position_error_mm"]
    );
    assert_eq!(second["hole"][1]["within_position_tolerance"], false);

    // A model that lacks the tool's bending knows its joints badly, and says so of the hole.
    let lacking = with_hole("frf-9114");
    for [value, std, upper] in errors(&document(&["lobes", text(lacking.path())])) {
        assert!(
            std > 0.02 * value && upper > value + 0.5 * std,
            "{value} {std} {upper}"
        );
    }
}

/// Angles whose hole is out of tolerance are named and not recommended; where none is good enough the depth limit decides as it
/// would alone.
#[test]
fn the_recommended_angle_keeps_the_hole_in_tolerance() {
    let sweep = "[lobes.redundancy]\nposture = \"p1\"\nstep_deg = 20.0\n[lobes.hole]\nthrust_n = 400.0\ntorque_nm = 2.0\n\
                 lateral_n = 50.0\nposition_tolerance_mm = ";
    let run = |tolerance_mm: f64| {
        let folder = campaign(&[ROBOT, DRILLING, sweep, &format!("{tolerance_mm:?}\n")]);
        let found = document(&["lobes", text(folder.path())]);
        (found, lobestone(&["lobes", text(folder.path())]).stdout)
    };
    let (loose, said) = run(5.0);
    let holes = loose["hole"].as_array().unwrap();
    assert!(holes.len() > 9);
    assert_eq!(loose["redundancy"]["hole"]["out_of_tolerance_deg"], json!([]));
    assert_eq!(loose["redundancy"]["hole"]["by_depth_alone"], Value::Null);
    assert!(said.contains("the depth limit decides"), "{said}");
    let alone = number(&loose["redundancy"]["recommended"]["angle_deg"]);

    // Just below the error at the place that the depth alone recommends.
    let there = number(&loose["redundancy"]["hole"]["recommended"]["position_error_mm"]);
    let tolerance = 0.98 * there;
    let (tight, said) = run(tolerance);
    let expected: Vec<&Value> = holes
        .iter()
        .filter(|h| number(&h["position_error_mm"]) > tolerance)
        .map(|h| &h["angle_deg"])
        .collect();
    let weighed = &tight["redundancy"]["hole"];
    assert!(!expected.is_empty() && expected.len() < holes.len());
    assert_eq!(weighed["out_of_tolerance_deg"], json!(expected));
    assert_eq!(weighed["no_angle_within_tolerance"], false);
    assert_eq!(weighed["recommended"]["within_position_tolerance"], true);
    let place = &tight["redundancy"]["recommended"];
    assert_eq!(weighed["recommended"]["angle_deg"], place["angle_deg"]);
    assert!((number(&place["angle_deg"]) - alone).abs() > 0.1);
    let depth_alone = number(&loose["redundancy"]["recommended"]["depth_mm"]);
    assert!(
        number(&place["depth_mm"]) <= depth_alone * 1.001,
        "the hole costs depth"
    );
    near(
        &weighed["by_depth_alone"]["depth_mm"],
        number(&loose["redundancy"]["enumeration"]["depth_mm"]),
        1e-9,
    );
    assert!(
        said.contains("Weighed together") && said.contains("not recommended ("),
        "{said}"
    );

    let (hopeless, said) = run(1e-3);
    assert_eq!(hopeless["redundancy"]["hole"]["no_angle_within_tolerance"], true);
    assert_eq!(
        hopeless["redundancy"]["recommended"],
        loose["redundancy"]["recommended"]
    );
    assert!(said.contains("out of tolerance at every usable angle"), "{said}");
}

/// The commanded pose makes up for thrust and torque; the lateral force turns, so it cannot be allowed for. Checked with the
/// `model` command alone: at the commanded joints the free tool point stands opposite to where the load pushes it.
#[test]
fn the_pose_to_command_makes_up_for_the_deflection() {
    let load =
        "[lobes.hole]\nthrust_n = 400.0\ntorque_nm = 2.0\nlateral_n = 50.0\ndiameter_tolerance = \"H11\"\n";
    let folder = campaign(&[ROBOT, DRILL, DRILLING, load]);
    let found = document(&["lobes", text(folder.path())]);
    let still = campaign(&[ROBOT, DRILL, DRILLING, &load.replace("50.0", "0.0")]);
    let steady = document(&["lobes", text(still.path())]);
    let free = document(&["model", text(folder.path())]);
    for (i, hole) in found["hole"].as_array().unwrap().iter().enumerate() {
        let pose = &hole["compensation"];
        assert!(number(&pose["residual_um"]) < 1.0, "{pose}");
        let commanded = ROBOT.split("[[posture]]").next().unwrap().to_string()
            + &format!("[[posture]]\nid = \"c\"\njoints_deg = {}\n", pose["joints_deg"]);
        let there = campaign(&[&commanded, DRILL, DRILLING, &load.replace("50.0", "0.0")]);
        let deflected = &document(&["lobes", text(there.path())])["hole"][0]["displacement_mm"];
        let tcp = &document(&["model", text(there.path())])["postures"][0]["tcp_m"];
        for axis in 0..3 {
            // Where the tool then stands, mm, against the target; a micrometre.
            let stands = 1e3 * number(&tcp[axis]) + number(&deflected[axis]);
            let target = 1e3 * number(&free["postures"][i]["tcp_m"][axis]);
            assert!((stands - target).abs() < 1e-3, "{stands} {target}");
            let pushed = number(&steady["hole"][i]["displacement_mm"][axis]);
            assert!((number(&pose["offset_mm"][axis]) + pushed).abs() < 0.05 * pushed.abs() + 2e-3);
        }
        // H11 of 9.5 mm is 0.09 mm; what the lateral force adds is twice what it moves at most.
        assert_eq!(found["hole_basis"]["diameter_tolerance_mm"], 0.09);
        let oversize = number(&hole["diameter_oversize_mm"]);
        assert_eq!(hole["within_diameter_tolerance"], oversize <= 0.09);
        let worst = number(&hole["position_error_mm"]);
        let balanced = number(&steady["hole"][i]["position_error_mm"]);
        assert!(
            oversize > 2.0 * (worst - balanced) * 0.999 && oversize > 0.0,
            "{oversize} {worst}"
        );
        assert_eq!(number(&steady["hole"][i]["diameter_oversize_mm"]), 0.0);
    }
    let said = lobestone(&["lobes", text(folder.path())]).stdout;
    assert!(
        said.contains("To command instead") && said.contains("Diameter, H11"),
        "{said}"
    );
    assert!(said.contains("Static stiffness of the tool point"), "{said}");
    let feed = &found["feed_stiffness"][0];
    let index = number(&feed["index"]);
    assert!(index > 0.0 && index <= 1.0);
    assert_eq!(feed["along_feed_n_per_m"], feed["along_axis_n_per_m"]);
}

/// A foot takes its share of the thrust: the robot is pushed back less, is stiffer along the tool by the foot's stiffness,
/// and where it takes more than its preload the answer says that it lifts off. A foot of no stiffness changes no number.
#[test]
fn a_pressure_foot_holds_the_tool() {
    let load =
        "kac_n_per_mm2 = 900.0\nfeed_per_rev_mm = 0.1\n[lobes.hole]\nthrust_n = 400.0\ntorque_nm = 2.0\n";
    let foot = |stiffness: f64| {
        format!(
            "[[contact]]\nname = \"foot\"\ndirection = \"axial\"\nstiffness_n_per_m = {stiffness:?}\npreload_n = 150.0\n"
        )
    };
    let run = |more: &str| {
        document(&[
            "lobes",
            text(campaign(&[ROBOT, DRILL, DRILLING, load, more]).path()),
        ])
    };
    let (free, none, held) = (run(""), run(&foot(0.0)), run(&foot(4e6)));
    let axial = |found: &Value, i: usize| number(&found["hole"][i]["axial_displacement_mm"]);
    for i in 0..2 {
        near(&none["hole"][i]["axial_displacement_mm"], axial(&free, i), 1e-9);
        near(
            &none["curves"][i]["absolute_limit_mm"],
            number(&free["curves"][i]["absolute_limit_mm"]),
            1e-5,
        );
        let stiffness = |found: &Value| number(&found["feed_stiffness"][i]["along_axis_n_per_m"]);
        assert!((stiffness(&held) - stiffness(&free) - 4e6).abs() < 1.0);
        assert!(axial(&held, i).abs() < 0.3 * axial(&free, i).abs());
        let contact = &held["hole"][i]["contacts"][0];
        let taken = -4e3 * axial(&held, i);
        near(&contact["force_n"], taken, 1e-6);
        assert_eq!(contact["gives_way"], taken > 150.0);
        assert!(number(&held["hole"][i]["skating_mm"]) > 0.0);
        // The axial–torsional block is held; it chatters later.
        let along = |found: &Value| number(&found["curves"][i]["axial_torsional"]["absolute_limit_mm"]);
        assert!(along(&held) > along(&free), "{} {}", along(&held), along(&free));
    }
    let folder = campaign(&[ROBOT, DRILL, DRILLING, load, &foot(4e6)]);
    let said = lobestone(&["lobes", text(folder.path())]).stdout;
    assert!(
        said.contains("held by foot") && said.contains("it lifts off"),
        "{said}"
    );
    let model = document(&["model", text(folder.path())]);
    let posture = &model["postures"][0];
    assert!(
        number(&posture["held"]["tcp_stiffness_n_per_m"]["z"])
            > 3.0 * number(&posture["tcp_stiffness_n_per_m"]["z"])
    );
    let told = lobestone(&["model", text(folder.path())]).stdout;
    assert!(told.contains("held by [[contact]]"), "{told}");
}

const TITANIUM: &str = "[orthogonal]\nshear_stress_mpa = 613.0\nfriction_angle_deg = 22.58\nchip_ratio = 0.7\nrake_deg = 12.0\n\
                        friction_angle_law = [19.1, 0.29, 0.0, 0.0]\nchip_ratio_law = [1.755, -0.028, 0.331, -0.0082]\n\
                        edge_force_tangential_n_per_mm = 24.0\nedge_force_normal_n_per_mm = 43.0\n";
const TWISTED: &str = "[tool]\nkind = \"drill\"\ndiameter_mm = 9.5\nteeth = 2\nhelix_deg = 30.0\nhalf_point_angle_deg = 59.0\n\
                       web_thickness_mm = 1.425\n";
const PREDICTED: &str = "[lobes]\nprocess = \"drilling\"\nsource = \"model\"\ncoefficients = \"orthogonal\"\nfeed_per_rev_mm = 0.1\n\
                         spindle_rpm = [200.0, 500.0, 10.0]\n";

/// Roukema's drill: thrust, torque and coefficients from the orthogonal database and the drill's geometry go into lobes and hole.
/// The numbers were worked out independently of this program (Python, the same formulas written anew): lips 398 N, 2.20 N·m, chisel edge
/// 684 N and 18 N of pressing in, 0.199 N·m.
#[test]
fn a_drill_from_the_orthogonal_database() {
    let folder = campaign(&[ROBOT, TWISTED, TITANIUM, PREDICTED]);
    let found = document(&["lobes", text(folder.path())]);
    let drill = &found["drill"];
    near(&drill["lips"]["thrust_n"], 398.0, 3e-3);
    near(&drill["lips"]["torque_nm"], 2.20, 3e-3);
    let chisel = &drill["chisel"];
    let pressed = number(&chisel["indentation_thrust_n"]);
    near(&chisel["thrust_n"], 684.0 + pressed, 3e-3);
    assert!(pressed > 5.0 && pressed < 40.0, "{pressed}");
    let hole = &found["hole"][0];
    near(&hole["thrust_n"], number(&drill["thrust_n"]), 1e-12);
    near(&hole["torque_nm"], number(&drill["torque_nm"]), 1e-12);
    assert_eq!(found["ktc_n_per_mm2"], drill["lips"]["ktc_n_per_mm2"]);
    let lips_kac = number(&drill["lips"]["kac_n_per_mm2"]);
    assert!(
        number(&found["kac_n_per_mm2"]) > lips_kac,
        "the chisel edge is in"
    );
    assert_eq!(found["axial_torsional"]["included"], true);
    let elements = drill["elements"].as_array().unwrap();
    assert!(number(&elements[0]["rake_deg"]) < -15.0);
    assert!(number(&elements[elements.len() - 1]["rake_deg"]) > 25.0);
    let said = lobestone(&["lobes", text(folder.path())]).stdout;
    assert!(
        said.contains("The drill from the orthogonal database") && said.contains("chisel edge: thrust"),
        "{said}"
    );

    let warned = |document: &Value| {
        document["warnings"]
            .to_string()
            .contains("friction_angle_law and chip_ratio_law")
    };
    assert!(!warned(&found), "{}", found["warnings"]);
    let one_rake: String = TITANIUM
        .lines()
        .filter(|l| !l.contains("_law"))
        .map(|l| l.to_string() + "\n")
        .collect();
    let one_rake = campaign(&[ROBOT, TWISTED, &one_rake, PREDICTED]);
    let one_rake = document(&["lobes", text(one_rake.path())]);
    assert!(warned(&one_rake), "{}", one_rake["warnings"]);

    let piloted = campaign(&[
        ROBOT,
        TWISTED,
        TITANIUM,
        PREDICTED,
        "[lobes.hole]\npilot_diameter_mm = 4.0\n",
    ]);
    let piloted = document(&["lobes", text(piloted.path())]);
    assert_eq!(piloted["drill"]["chisel"], Value::Null);
    assert!(number(&piloted["hole"][0]["thrust_n"]) < 0.5 * number(&hole["thrust_n"]));
    for (parts, key) in [
        ([ROBOT, TWISTED, PREDICTED], "orthogonal"),
        ([ROBOT, TITANIUM, PREDICTED], "tool"),
    ] {
        let folder = campaign(&parts);
        let error = lobestone(&["lobes", text(folder.path())]).stderr;
        assert!(error.contains(key) && error.contains("remedy"), "{error}");
    }
}

/// Process damping and margins are off unless asked for; both raise the lateral limit, the flanks' damping most where the drill
/// turns slowly. Speeds at which the drill may whirl are told with the number of lobes.
#[test]
fn damped_flanks_margins_and_whirling() {
    let run = |more: &str| {
        let folder = campaign(&[ROBOT, DRILL, DRILLING, more]);
        document(&["lobes", text(folder.path())])
    };
    let plain = run("");
    let none = run("process_damping_n_per_m = 0.0\nmargin_stiffness_n_per_m = 0.0\n");
    assert_eq!(plain["curves"], none["curves"]);
    let damped = run("indentation_n_per_mm3 = 40000.0\nwear_land_mm = 0.08\n");
    let same = run("process_damping_n_per_m = 128000.0\n");
    assert_eq!(
        damped["curves"][0]["depth_limit_mm"],
        same["curves"][0]["depth_limit_mm"]
    );
    let held = run("margin_stiffness_n_per_m = 1.0e6\n");
    for i in 0..2 {
        let limits = |found: &Value| -> Vec<f64> {
            let limits = found["curves"][i]["depth_limit_mm"].as_array().unwrap();
            limits
                .iter()
                .map(|d| d.as_f64().unwrap_or(f64::INFINITY))
                .collect()
        };
        let (free, damped) = (limits(&plain), limits(&damped));
        let gains: Vec<f64> = damped.iter().zip(&free).map(|(d, f)| d / f).collect();
        assert!(gains.iter().all(|g| *g > 1.0), "{gains:?}");
        let least = |found: &Value| number(&found["curves"][i]["absolute_limit_mm"]);
        assert!(
            least(&held) > 1.5 * least(&plain),
            "{} {}",
            least(&held),
            least(&plain)
        );
    }
    let whirling = plain["curves"][0]["whirling"].as_array().unwrap();
    assert!(!whirling.is_empty());
    for speed in whirling {
        let order = number(&speed["order"]);
        near(
            &speed["spindle_rpm"],
            60.0 * number(&speed["mode_hz"]) / (2.0 * order),
            1e-9,
        );
        assert_eq!(
            speed["lobes"],
            json!([2.0 * order - 1.0, 2.0 * order + 1.0].map(|l| l as u32))
        );
    }
    let warnings = plain["warnings"].as_array().unwrap();
    assert!(
        warnings
            .iter()
            .any(|w| w.as_str().unwrap().contains("may whirl at p1")),
        "{warnings:?}"
    );
}
