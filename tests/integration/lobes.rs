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
            assert!((a / b - 1.0).abs() < 5e-3, "{a} {b}");
        }
        let [was, is] =
            [&before["absolute_limit_mm"], &new["absolute_limit_mm"]].map(|v| v.as_f64().unwrap());
        assert!((was / old["absolute_limit_mm"].as_f64().unwrap() - 1.0).abs() < 5e-3);
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
