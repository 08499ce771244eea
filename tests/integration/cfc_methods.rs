//! `lobestone cfc` on practice campaigns that a test spoils: robust regression, bootstrap, leverage, materials, trends.

use std::path::Path;

use serde_json::Value;

use crate::support::{append, copy_of, document, lobestone, truth};

const MILLING: [(&str, &str); 6] = [
    ("Ktc", "ktc_n_per_mm2"),
    ("Krc", "krc_n_per_mm2"),
    ("Kac", "kac_n_per_mm2"),
    ("Kte", "kte_n_per_mm"),
    ("Kre", "kre_n_per_mm"),
    ("Kae", "kae_n_per_mm"),
];

fn cfc(dir: &Path, more: &[&str]) -> Value {
    document(&[&["cfc", dir.to_str().unwrap()], more].concat())
}

/// Rewrites the lines of one `[[cut]]`.
fn edit_cut(dir: &Path, id: &str, edit: impl Fn(&str) -> String) {
    let file = dir.join("campaign.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    let parts: Vec<String> = text
        .split("[[cut]]")
        .map(|part| {
            if part.contains(&format!("id = \"{id}\"")) {
                edit(part)
            } else {
                part.to_string()
            }
        })
        .collect();
    std::fs::write(file, parts.join("[[cut]]")).unwrap();
}

fn warnings(document: &Value) -> String {
    let list = document["warnings"].as_array().unwrap().iter();
    list.map(|w| w.as_str().unwrap()).collect::<Vec<_>>().join("\n")
}

fn error(group: &Value, key: &str, truth: f64) -> f64 {
    (group[key]["value"].as_f64().unwrap() / truth - 1.0).abs()
}

/// One cut listed with a depth it was not made at: its forces are 30 % off what the others say.
#[test]
fn a_spoilt_cut_is_named_and_robust_regression_withstands_it() {
    let copy = copy_of("force-9400");
    edit_cut(copy.path(), "09", |cut| {
        cut.replace("axial_depth_mm = 2.0", "axial_depth_mm = 1.54")
    });
    let true_values = &truth("force-9400")["true_coefficients"];
    let ordinary = cfc(copy.path(), &[]);
    let pooled = &ordinary["pooled"][0];
    assert_eq!(pooled["method"], "least-squares");
    let ktc = true_values["Ktc"].as_f64().unwrap();
    assert!(error(pooled, "ktc_n_per_mm2", ktc) > 0.03, "{pooled}");
    let told = warnings(&ordinary);
    assert!(told.contains("cut 09 does not fit"), "{told}");
    let least = pooled["influence"].as_array().unwrap();
    let of = |cut: &str, key: &str| {
        let one = least.iter().find(|i| i["cut"] == cut).unwrap();
        one[key].as_f64().unwrap()
    };
    assert!(of("09", "studentized_residual").abs() > 20.0, "{least:?}");
    assert!(of("16", "studentized_residual").abs() < 3.0, "{least:?}");
    // Six unknowns over three axes of six cuts: the leverages of an axis sum to two.
    let sum: f64 = pooled["points"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| p["leverage"].as_f64().unwrap())
        .sum();
    assert!((sum - 6.0).abs() < 1e-9, "{sum}");

    let robust = cfc(copy.path(), &["--robust"]);
    let pooled = &robust["pooled"][0];
    assert_eq!(pooled["method"], "huber");
    for (name, key) in MILLING.iter().take(3) {
        let off = error(pooled, key, true_values[name].as_f64().unwrap());
        assert!(off < 0.01, "{key} {off}");
        let other = pooled[key]["least_squares"]["value"].as_f64().unwrap();
        let plain = ordinary["pooled"][0][key]["value"].as_f64().unwrap();
        assert!((other / plain - 1.0).abs() < 1e-9);
    }
    let weight = pooled["influence"]
        .as_array()
        .unwrap()
        .iter()
        .find(|i| i["cut"] == "09");
    assert!(weight.unwrap()["weight_share"].as_f64().unwrap() < 0.1);
}

#[test]
fn clean_cuts_agree_by_all_methods() {
    for name in ["force-9400", "force-9439"] {
        let copy = copy_of(name);
        let result = cfc(copy.path(), &[]);
        let pooled = &result["pooled"][0];
        let keys = pooled
            .as_object()
            .unwrap()
            .iter()
            .filter(|(_, v)| !v["std_error"].is_null());
        let mut compared = 0;
        for (key, coefficient) in keys.filter(|(key, _)| key.contains("_n_per_mm")) {
            let number = |v: &Value| v.as_f64().unwrap();
            let (value, std_error) = (number(&coefficient["value"]), number(&coefficient["std_error"]));
            if !coefficient["huber"].is_null() {
                assert!(
                    (number(&coefficient["huber"]["value"]) - value).abs() < std_error,
                    "{key}"
                );
                compared += 1;
            }
            // Five and six cuts: the bootstrap knows the order of size.
            let ratio = number(&coefficient["std_error_bootstrap"]) / std_error;
            assert!((0.05..2.5).contains(&ratio), "{name} {key} {ratio}");
        }
        assert!(name != "force-9400" || compared == 6, "{compared}");
        let told = warnings(&result);
        assert!(
            !told.contains("disagree") && !told.contains("bootstrap"),
            "{told}"
        );
        // Nothing changes with the speed in these.
        for trend in result["trends"].as_array().unwrap() {
            assert!(
                trend["reading"] == "none" || trend["reading"] == "not-determined",
                "{trend}"
            );
        }
    }
}

#[test]
fn an_active_constraint_says_what_it_holds_back() {
    let copy = copy_of("force-9400");
    let held = cfc(copy.path(), &["--nonnegative-edges", "--robust"]);
    let kae = &held["pooled"][0]["kae_n_per_mm"];
    assert_eq!(
        (&kae["value"], &kae["constraint_active"]),
        (&0.0.into(), &true.into())
    );
    let free = kae["unconstrained"]["value"].as_f64().unwrap();
    assert!((free + 0.373).abs() < 0.05, "{free}");
    let told = warnings(&held);
    assert!(
        told.contains("Kae is held at zero") && told.contains("without it -0.3"),
        "{told}"
    );
}

/// A material at each of two speeds: groups of their own, and a comparison that does not guess.
#[test]
fn material_and_speed_that_change_together_are_not_told_apart() {
    let copy = copy_of("force-9400");
    for id in ["01", "05", "09", "13"] {
        edit_cut(copy.path(), id, |cut| {
            cut.replace("order =", "material = \"cast\"\norder =")
        });
    }
    for id in ["04", "16"] {
        edit_cut(copy.path(), id, |cut| {
            cut.replace("order =", "material = \"printed\"\norder =")
        });
    }
    let result = cfc(copy.path(), &[]);
    let materials: Vec<&Value> = result["pooled"]
        .as_array()
        .unwrap()
        .iter()
        .map(|g| &g["material"])
        .collect();
    assert_eq!(materials, ["cast", "printed"]);
    assert_eq!(
        result["pooled"][0]["cuts"],
        serde_json::json!(["01", "05", "09", "13"])
    );
    let entries = result["materials"].as_array().unwrap();
    assert_eq!(entries.len(), 6);
    assert!(
        entries.iter().all(|e| e["reading"] == "not-determined"),
        "{entries:?}"
    );
}

/// The orthogonal table of docs/physics.md, "Reference cases" against cuts of another material: both numbers stand side by side.
#[test]
fn an_orthogonal_database_predicts_the_coefficients() {
    let copy = copy_of("force-9400");
    append(
        copy.path(),
        "\n[orthogonal]\nshear_stress_mpa = 613.0\nfriction_angle_deg = 22.58\nchip_ratio = 0.7069\nrake_deg = 12.0\n\
         inclination_deg = 30.0\n",
    );
    let predicted = &cfc(copy.path(), &[])["predicted"];
    assert!((predicted["shear_angle_deg"].as_f64().unwrap() - 39.03).abs() < 0.01);
    for (i, (want, found)) in [(1510.0, 929.9), (215.0, 374.4), (515.0, 218.6)]
        .into_iter()
        .enumerate()
    {
        let row = &predicted["coefficients"][i];
        assert!(
            (row["predicted"].as_f64().unwrap() / want - 1.0).abs() < 0.005,
            "{row}"
        );
        assert!(
            (row["value"].as_f64().unwrap() / found - 1.0).abs() < 0.01,
            "{row}"
        );
    }
    append(copy.path(), "shear_angle_deg = 39.0\n");
    let run = lobestone(&["cfc", copy.path().to_str().unwrap()]);
    assert_eq!(run.status, Some(1));
    assert!(
        run.stderr.contains("shear_angle_deg") && run.stderr.contains("chip_ratio"),
        "{}",
        run.stderr
    );
}
