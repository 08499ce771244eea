//! `lobestone lobes`: what an added effect did to the limit, and test cuts against it.

use std::path::Path;

use serde_json::{Value, json};

use crate::support::{append, blind, copy_of, document, lobestone};

const LOBES: &str = "\n[lobes]\nprocess = \"milling\"\nsource = \"model\"\nmethod = \"zero-order\"\n\
                     ktc_n_per_mm2 = 1000.0\nkrc_n_per_mm2 = 500.0\nimmersion = \"slot\"\n\
                     spindle_rpm = [600.0, 3000.0, 20.0]\n[tool]\nkind = \"endmill\"\ndiameter_mm = 16.0\nteeth = 2\n";

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn numbers(values: &Value) -> Vec<f64> {
    let values = values.as_array().unwrap_or_else(|| panic!("no list: {values}"));
    values.iter().map(|v| v.as_f64().unwrap()).collect()
}

fn cut(id: &str, rpm: f64, depth_mm: f64, outcome: &str, more: &str) -> String {
    format!(
        "\n[[cut]]\nid = \"{id}\"\nfile = \"force/cut01.txt\"\nprocess = \"milling\"\nspindle_rpm = {rpm}\n\
         feed_per_tooth_mm = 0.05\naxial_depth_mm = {depth_mm}\noutcome = \"{outcome}\"\n{more}\n"
    )
}

fn with_record(campaign: &Path) {
    let record = blind("force-9400").join("force/cut01.txt");
    std::fs::create_dir_all(campaign.join("force")).unwrap();
    std::fs::copy(record, campaign.join("force/cut01.txt")).unwrap();
}

/// A flexible tool is hidden in the FRFs. Before it is added there is no "before"; afterwards "before" is the very curve
/// that the campaign gave then, and the cuts are judged by the model with the tool.
#[test]
fn lobes_after_add_show_the_limit_before_it() {
    let folder = copy_of("frf-9114");
    let dir = folder.path();
    append(dir, LOBES);
    let first = document(&["lobes", text(dir)]);
    assert_eq!(
        (&first["effects"], &first["revision"]),
        (&json!([]), &Value::Null)
    );
    assert_eq!(
        (&first["curves"][0]["before"], &first["outcomes"]),
        (&Value::Null, &Value::Null)
    );

    document(&["add", text(dir), "tool-flexibility"]);
    let second = document(&["lobes", text(dir)]);
    assert_eq!(
        (&second["effects"], &second["revision"]),
        (&json!(["tool-flexibility"]), &json!(1))
    );
    let curves = || {
        first["curves"]
            .as_array()
            .unwrap()
            .iter()
            .zip(second["curves"].as_array().unwrap())
    };
    assert_eq!(curves().count(), 4);
    for (old, new) in curves() {
        let before = &new["before"];
        assert_eq!((&before["revision"], &before["effects"]), (&json!(0), &json!([])));
        let (then, now) = (
            numbers(&old["depth_limit_mm"]),
            numbers(&before["depth_limit_mm"]),
        );
        assert_eq!(then.len(), now.len());
        for (a, b) in then.iter().zip(&now) {
            assert!((a / b - 1.0).abs() < 1e-6, "{a} {b}");
        }
        let [was, is] =
            [&before["absolute_limit_mm"], &new["absolute_limit_mm"]].map(|v| v.as_f64().unwrap());
        assert!((was / old["absolute_limit_mm"].as_f64().unwrap() - 1.0).abs() < 1e-6);
        assert!(
            is < 0.9 * was || is > 1.1 * was,
            "the tool does something: {was} {is}"
        );
    }
    let run = lobestone(&["lobes", text(dir)]);
    let sentences = run
        .stdout
        .lines()
        .filter(|l| l.contains("the added tool-flexibility"))
        .count();
    assert_eq!(sentences, 4, "{}", run.stdout);

    // Cuts placed by the model's own band at one speed of p2.
    let curve = &second["curves"][1];
    let at = 40;
    let rpm = curve["spindle_rpm"][at].as_f64().unwrap();
    let [low, mid, high] =
        ["depth_p05_mm", "depth_limit_mm", "depth_p95_mm"].map(|k| curve[k][at].as_f64().unwrap());
    assert!(low < mid && mid < high, "{low} {mid} {high}");
    let (slot, quarter) = (
        "immersion = \"slot\"\nposture = \"p2\"",
        "start_deg = 0.0\nexit_deg = 90.0",
    );
    with_record(dir);
    for (id, depth, outcome, more) in [
        ("a", 0.8 * low, "stable", slot),
        ("b", 1.2 * high, "chatter", slot),
        ("c", 0.5 * (mid + high), "stable", slot),
        ("d", 0.8 * low, "chatter", slot),
        ("e", 1.2 * high, "stable", slot),
        ("f", 0.8 * low, "stable", quarter),
    ] {
        append(dir, &cut(id, rpm, depth, outcome, more));
    }
    let outcomes = &document(&["lobes", text(dir)])["outcomes"];
    let verdicts: Vec<_> = outcomes["cuts"]
        .as_array()
        .unwrap()
        .iter()
        .map(|c| c["verdict"].clone())
        .collect();
    assert_eq!(
        verdicts,
        ["agree", "agree", "within-band", "disagree", "disagree"]
    );
    for (key, count) in [
        ("agree", 2),
        ("disagree", 2),
        ("within_band", 1),
        ("stable_below_limit", 1),
        ("stable_above_limit", 2),
        ("chatter_above_limit", 1),
        ("chatter_below_limit", 1),
    ] {
        assert_eq!(outcomes[key], count, "{key}");
    }
    assert_eq!(outcomes["not_compared"][0]["id"], "f");
    let given = outcomes["cuts"][0]["limit_mm"].as_f64().unwrap();
    assert!((given / mid - 1.0).abs() < 1e-9, "{given} {mid}");
    let said = lobestone(&["lobes", text(dir)]).stdout;
    assert!(
        said.contains("cut d (chatter") && said.contains("cut e (stable"),
        "{said}"
    );
    assert!(
        said.contains("2 agree, 2 disagree, of 1 the model cannot say"),
        "{said}"
    );
}

/// Without a model there is no band: a cut lies above the limit or below it. A slot of 600 N/mm² on one mode in x and y.
#[test]
fn cuts_against_lobes_of_modes() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    let modes = "schema = \"lobestone/campaign/1\"\nname = \"modes\"\n[tool]\nkind = \"endmill\"\ndiameter_mm = 20.0\nteeth = 3\n\
                 [lobes]\nprocess = \"milling\"\nsource = \"modes\"\nmethod = \"zero-order\"\nktc_n_per_mm2 = 600.0\n\
                 krc_n_per_mm2 = 42.0\nimmersion = \"slot\"\nspindle_rpm = [4000.0, 12000.0, 500.0]\n\
                 [[lobes.mode]]\naxis = \"x\"\nfrequency_hz = 603.0\ndamping_ratio = 0.039\nstiffness_n_per_m = 5.59e6\n\
                 [[lobes.mode]]\naxis = \"y\"\nfrequency_hz = 666.0\ndamping_ratio = 0.035\nstiffness_n_per_m = 5.715e6\n";
    with_record(dir);
    // Altintas & Budak (1995): stable everywhere below 0.777 mm.
    let cuts = cut("safe", 5000.0, 0.77, "stable", "immersion = \"slot\"")
        + &cut("deep", 5000.0, 5.0, "chatter", "immersion = \"slot\"")
        + &cut("odd", 5000.0, 0.5, "chatter", "immersion = \"slot\"");
    std::fs::write(dir.join("campaign.toml"), format!("{modes}{cuts}")).unwrap();
    let found = document(&["lobes", text(dir)]);
    let outcomes = &found["outcomes"];
    assert_eq!(
        (
            &outcomes["agree"],
            &outcomes["disagree"],
            &outcomes["within_band"]
        ),
        (&json!(2), &json!(1), &json!(0))
    );
    let odd = &outcomes["cuts"][2];
    assert_eq!((&odd["id"], &odd["verdict"]), (&json!("odd"), &json!("disagree")));
    assert!(
        odd["meaning"]
            .as_str()
            .unwrap()
            .contains("chattered where the model promises stability")
    );
    assert_eq!(found["curves"][0]["before"], Value::Null);
}

const DRILL: &str = "schema = \"lobestone/campaign/1\"\nname = \"drill\"\n[tool]\nkind = \"drill\"\ndiameter_mm = 10.0\nteeth = 2\n\
                     half_point_angle_deg = 67.5\nweb_thickness_mm = 1.5\n[lobes]\nprocess = \"drilling\"\nsource = \"modes\"\n\
                     ktc_n_per_mm2 = 1014.2\nkrc_n_per_mm2 = 619.9\nkac_n_per_mm2 = 572.0\nspindle_rpm = [300.0, 3000.0, 10.0]\n";

fn mode(axis: &str, hz: f64, damping: f64, stiffness: f64, more: &str) -> String {
    format!(
        "[[lobes.mode]]\naxis = \"{axis}\"\nfrequency_hz = {hz}\ndamping_ratio = {damping}\nstiffness_n_per_m = {stiffness}\n{more}\n"
    )
}

const BAR: &str = "[[lobes.tool.segment]]\nlength_mm = 100.0\ndiameter_mm = 10.0\nyoung_gpa = 600.0\ndensity_kg_per_m3 = 14500.0\n";

/// A drill that gets longer as it unwinds, in lateral modes that are far too stiff to matter: the limit is Bayly's,
/// b = 1/(2K max Re G) below the natural frequency, K = N p (Ktc R_t - Kac p), max Re G = 1/(4k z (1 - z)).
#[test]
fn a_drill_has_both_its_blocks() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    let stiff = mode("x", 900.0, 0.03, 1e10, "") + &mode("y", 900.0, 0.03, 1e10, "");
    let (hz, damping, stiffness, longer) = (400.0, 0.03, 300.0, 6e-4);
    let twist = mode("theta", hz, damping, stiffness, "extension_mm_per_rad = 0.6");
    std::fs::write(dir.join("campaign.toml"), format!("{DRILL}{stiff}{twist}")).unwrap();
    let found = document(&["lobes", text(dir)]);
    assert_eq!(found["axial_torsional"]["included"], true);
    let inner = 0.75 / 125f64.to_radians().sin();
    assert!((found["hole_width_mm"].as_f64().unwrap() - (5.0 - inner)).abs() < 1e-9);
    let gain = 2.0 * longer * 1e6 * (1014.2 * 0.5e-3 * (5.0 + inner) - 572.0 * longer);
    let expected = 1e3 * 2.0 * stiffness * damping * (1.0 - damping) / gain;
    let curve = &found["curves"][0];
    for limit in [
        &found["absolute_limit_mm"],
        &curve["axial_torsional"]["absolute_limit_mm"],
    ] {
        assert!(
            (limit.as_f64().unwrap() / expected - 1.0).abs() < 1e-6,
            "{limit} {expected}"
        );
    }
    let chatter = found["absolute_limit_hz"].as_f64().unwrap();
    assert!(
        (chatter / (hz * (1.0 - 2.0 * damping).sqrt()) - 1.0).abs() < 1e-4,
        "{chatter}"
    );
    let least = |key: &str| numbers_or_none(&curve[key]["depth_limit_mm"]);
    for ((a, b), both) in least("lateral")
        .iter()
        .zip(least("axial_torsional"))
        .zip(numbers_or_none(&curve["depth_limit_mm"]))
    {
        assert_eq!(both, a.min(b));
    }
    let said = lobestone(&["lobes", text(dir)]).stdout;
    assert!(said.contains("drilling, lateral and axial-torsional"), "{said}");
    assert!(said.contains("This hole has a width of cut"), "{said}");

    // Without the thrust coefficient the block is left out, and it is said why.
    let without = DRILL.replace("kac_n_per_mm2 = 572.0\n", "");
    std::fs::write(dir.join("campaign.toml"), format!("{without}{stiff}{twist}")).unwrap();
    let found = document(&["lobes", text(dir)]);
    assert_eq!(found["axial_torsional"]["included"], false);
    let reason = found["axial_torsional"]["left_out_because"].as_str().unwrap();
    assert!(reason.contains("lobes.kac_n_per_mm2"), "{reason}");
    assert_eq!(found["curves"][0]["axial_torsional"], Value::Null);
}

fn numbers_or_none(values: &Value) -> Vec<f64> {
    let values = values.as_array().unwrap_or_else(|| panic!("no list: {values}"));
    values
        .iter()
        .map(|v| v.as_f64().unwrap_or(f64::INFINITY))
        .collect()
}

/// A bar on the robot chatters at its own frequency at high speed; clamped it has the textbook's first frequency
/// (1.875^2/(2 pi L^2)) sqrt(EI/rho A) within what shear takes off, and a quarter wave in twist.
#[test]
fn the_tool_as_a_beam_brings_its_own_modes() {
    let folder = copy_of("frf-9114");
    let dir = folder.path();
    append(dir, LOBES);
    let bare = document(&["lobes", text(dir)]);
    assert_eq!(bare["tool"], Value::Null);
    append(dir, BAR);
    let found = document(&["lobes", text(dir)]);
    let tool = &found["tool"];
    assert_eq!(
        (&tool["segments"], &tool["length_mm"]),
        (&json!(1), &json!(100.0))
    );
    let bending = tool["clamped_bending_hz"][0].as_f64().unwrap();
    let euler = 1.875104f64.powi(2) / (std::f64::consts::TAU * 0.01) * (600e9f64 / 14500.0).sqrt() * 0.0025;
    assert!(bending < euler && bending > 0.985 * euler, "{bending} {euler}");
    let twist = tool["clamped_axial_torsional_hz"][0].as_f64().unwrap();
    let quarter = (600e9f64 / 2.6 / 14500.0).sqrt() / 0.4;
    assert!((twist / quarter - 1.0).abs() < 1e-6, "{twist} {quarter}");
    let curves = |document: &Value| document["curves"].as_array().unwrap().clone();
    for (was, is) in curves(&bare).iter().zip(&curves(&found)) {
        assert!(
            is["frf"]
                .as_str()
                .unwrap()
                .contains("tool of 1 segment, 100.0 mm"),
            "{is}"
        );
        assert!(is["band_hz"][1].as_f64().unwrap() > 1.2 * bending);
        // The robot still sets the limit that holds at every speed.
        let [was, is] = [was, is].map(|c| c["absolute_limit_mm"].as_f64().unwrap());
        assert!(is < 1.3 * was, "{was} {is}");
    }
    let measured = std::fs::read_to_string(dir.join("campaign.toml")).unwrap();
    std::fs::write(
        dir.join("campaign.toml"),
        measured.replace("source = \"model\"", "source = \"measured\""),
    )
    .unwrap();
    let found = document(&["lobes", text(dir)]);
    assert!(
        found["warnings"].as_array().unwrap().iter().any(|w| {
            let text = w.as_str().unwrap();
            text.contains("coupled to the measured FRFs") && text.contains("robot model's")
        }),
        "{}",
        found["warnings"]
    );
}

/// A tool that cannot be is refused with file, line, key and remedy.
#[test]
fn a_wrong_tool_is_named() {
    for (wrong, said) in [
        (BAR.replace("length_mm", "lenght_mm"), "lenght_mm"),
        (BAR.replace("diameter_mm = 10.0\n", ""), "diameter_mm"),
        (format!("{BAR}bore_mm = 10.0\n"), "bore_mm"),
        (format!("{BAR}shear_gpa = 500.0\n"), "shear_gpa"),
        ("[lobes.tool]\n".to_string(), "segment"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let dir = folder.path();
        let modes = mode("x", 60.0, 0.03, 1e6, "") + &mode("y", 70.0, 0.03, 1e6, "");
        std::fs::write(dir.join("campaign.toml"), format!("{DRILL}{modes}{wrong}")).unwrap();
        let run = lobestone(&["lobes", text(dir)]);
        assert_eq!(run.status, Some(1), "{said}");
        assert!(
            run.stderr.contains("campaign.toml") && run.stderr.contains(said),
            "{said}: {}",
            run.stderr
        );
    }
}

/// Over the redundancy angle both searches agree, and a cut made at the posture as it stands is scored there.
#[test]
fn over_the_angle_the_searches_agree_and_cuts_count() {
    let folder = copy_of("frf-9114");
    let dir = folder.path();
    append(dir, LOBES);
    with_record(dir);
    let standing = document(&["lobes", text(dir)]);
    let curve = &standing["curves"][1];
    let (rpm, depth) = (
        curve["spindle_rpm"][40].as_f64().unwrap(),
        0.5 * curve["depth_limit_mm"][40].as_f64().unwrap(),
    );
    append(
        dir,
        &cut(
            "a",
            rpm,
            depth,
            "stable",
            "immersion = \"slot\"\nposture = \"p2\"",
        ),
    );
    let at_posture = document(&["lobes", text(dir)])["outcomes"].clone();
    for step in ["15.0", "40.0"] {
        let campaign = std::fs::read_to_string(dir.join("campaign.toml")).unwrap();
        append(
            dir,
            &format!("\n[lobes.redundancy]\nposture = \"p1\"\nstep_deg = {step}\n"),
        );
        let turned = document(&["lobes", text(dir)]);
        std::fs::write(dir.join("campaign.toml"), campaign).unwrap();
        let found = &turned["redundancy"];
        assert_eq!(found["agree"], true, "{found}");
        assert!(found["difference"].as_f64().unwrap() <= 0.01, "{found}");
        assert_eq!(turned["outcomes"], at_posture);
        assert_eq!(turned["outcomes"]["agree"], 1);
    }
}

/// The same robot with noise and without: where modes explain the FRFs, noise makes no staircase of the limit.
#[test]
fn noise_of_measured_frfs_hardly_moves_the_limit() {
    let folder = tempfile::tempdir().unwrap();
    let limits = |noise: &str| -> Vec<f64> {
        let dir = folder.path().join(noise);
        document(&[
            "simulate",
            "--out",
            text(&dir),
            "--kind",
            "direct",
            "--seed",
            "13",
            "--noise",
            noise,
        ]);
        append(&dir, &LOBES.replace("\"model\"", "\"measured\""));
        let lobes = document(&["lobes", text(&dir)]);
        let curves = lobes["curves"].as_array().unwrap().iter();
        curves
            .flat_map(|curve| numbers(&curve["depth_limit_mm"]))
            .collect()
    };
    let (clean, noisy) = (limits("0"), limits("0.05"));
    assert_eq!(clean.len(), noisy.len());
    let apart = clean.iter().zip(&noisy).map(|(a, b)| (a / b).ln().abs());
    let mean = apart.sum::<f64>() / clean.len() as f64;
    // The FRFs as they are measured bring 2.3 %.
    assert!(mean < 0.012, "{mean}");
}
