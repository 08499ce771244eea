//! Campaigns of an independent simulator, one for each effect that the other fixtures do not hide: the effect added, its
//! parameters and what else is fitted are those that the simulator had. (A formula with a wrong sign, axis or factor does not
//! pass.) `scripts/pack_practice.py` makes the fixtures.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use super::support::*;

#[derive(Deserialize)]
struct Fixture {
    truth: Value,
    /// Path in the campaign's folder and text.
    files: BTreeMap<String, String>,
}

impl Fixture {
    fn read(name: &str) -> Self {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/practice");
        let file = folder.join(format!("{name}.json.gz"));
        let mut text = String::new();
        let packed = std::fs::File::open(&file).unwrap();
        flate2::read::GzDecoder::new(packed)
            .read_to_string(&mut text)
            .unwrap();
        serde_json::from_str(&text).unwrap()
    }

    fn unpacked(&self) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (path, text) in &self.files {
            let path = folder.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        folder
    }

    fn effect(&self) -> String {
        let effect = self.truth["effect"].as_str().unwrap();
        match self.truth["site"].as_str() {
            Some(site) => format!("{effect}@{site}"),
            None => effect.to_string(),
        }
    }
}

/// What `add` finds with the effect that is hidden there.
struct Found {
    name: String,
    truth: Value,
    document: Value,
}

impl Found {
    fn of(name: &str) -> Self {
        let fixture = Fixture::read(name);
        let folder = fixture.unpacked();
        let document = document(&["add", folder.path().to_str().unwrap(), &fixture.effect()]);
        let chi2 = document["after"]["reduced_chi2"].as_f64().unwrap();
        assert!((0.8..1.15).contains(&chi2), "{name}: χ² {chi2}");
        Found {
            name: name.to_string(),
            truth: fixture.truth,
            document,
        }
    }

    /// Value and standard error of a parameter by the end of its name.
    fn parameter(&self, name: &str) -> [f64; 2] {
        let all = self.document["parameters"].as_array().unwrap();
        let found = all.iter().find(|p| p["name"].as_str().unwrap().ends_with(name));
        let found = found.unwrap_or_else(|| panic!("{}: no {name}", self.name));
        ["value", "std_error"].map(|key| found[key].as_f64().unwrap())
    }

    /// Within four standard errors, and these within `share` of the value.
    fn holds(&self, name: &str, truth: f64, share: f64) {
        let [value, std] = self.parameter(name);
        let context = format!("{}: {name} {value} ± {std}, true {truth}", self.name);
        assert!(
            (value - truth).abs() < 4.0 * std + 1e-4 * truth.abs(),
            "{context}"
        );
        assert!(std < share * truth.abs(), "{context}");
    }

    fn true_value(&self, key: &str) -> f64 {
        self.truth["parameters"][key].as_f64().unwrap()
    }

    fn true_list(&self, key: &str) -> Vec<f64> {
        let list = self.truth["parameters"][key].as_array().unwrap();
        list.iter().map(|v| v.as_f64().unwrap()).collect()
    }

    /// Cutting coefficients as the simulator had them, but for those that hardly cut.
    fn coefficients_hold(&self) {
        for (key, truth) in self.truth["true_coefficients"].as_object().unwrap() {
            let unit = if key.ends_with('c') {
                "_n_per_mm2"
            } else {
                "_n_per_mm"
            };
            let truth = truth.as_f64().unwrap();
            let share = if truth > 5.0 { 0.05 } else { 0.2 };
            self.holds(&format!("{}{unit}", key.to_lowercase()), truth, share);
        }
    }

    /// Joint stiffnesses and damping ratio.
    fn robot_holds(&self) {
        for (i, truth) in self.truth["joint_stiffness"]
            .as_array()
            .unwrap()
            .iter()
            .enumerate()
        {
            self.holds(
                &format!("joint-{}.stiffness", i + 1),
                truth.as_f64().unwrap(),
                0.01,
            );
        }
        self.holds("damping-ratio", self.truth["zeta"].as_f64().unwrap(), 0.01);
    }
}

#[test]
fn transverse_compliance_of_a_joint() {
    let found = Found::of("frf-careful-joint-transverse-compliance");
    found.holds(
        "transverse_nm_per_rad",
        found.true_value("transverse_nm_per_rad"),
        0.01,
    );
    found.robot_holds();
}

#[test]
fn stiffness_that_rises_with_the_load() {
    let found = Found::of("frf-careful-load-dependent-stiffness");
    found.holds("beta", found.true_value("beta"), 0.01);
    found.robot_holds();
}

#[test]
fn a_turned_sensor() {
    let found = Found::of("frf-careful-sensor-misalignment");
    for (i, truth) in found.true_list("rotation_vector_deg").into_iter().enumerate() {
        found.holds(&format!("rotation_vector_deg[{i}]"), truth, 0.01);
    }
    found.robot_holds();
}

#[test]
fn a_late_response() {
    let found = Found::of("frf-careful-time-delay");
    found.holds("delay_s", found.true_value("delay_s"), 0.01);
    found.robot_holds();
}

#[test]
fn a_dynamometer_that_resonates_leaks_or_tilts() {
    let found = Found::of("mill-dynamometer-resonance");
    for key in ["frequency_hz", "zeta"] {
        for (i, truth) in found.true_list(key).into_iter().enumerate() {
            found.holds(&format!("{key}[{i}]"), truth, 0.01);
        }
    }
    found.coefficients_hold();

    let found = Found::of("mill-nonlinear-drift");
    for (i, truth) in found.true_list("tau_s").into_iter().enumerate() {
        found.holds(&format!("tau_s[{i}]"), truth, 0.05);
    }
    found.coefficients_hold();

    let found = Found::of("mill-tilt");
    found.holds("angle_deg", found.true_value("angle_deg"), 0.01);
    found.coefficients_hold();
}

#[test]
fn crosstalk_between_channels() {
    let found = Found::of("mill-crosstalk");
    let matrix = found.truth["parameters"]["matrix"].as_array().unwrap().clone();
    for (i, row) in matrix.iter().enumerate() {
        for (j, truth) in row.as_array().unwrap().iter().enumerate() {
            // A turn about the tool's axis is nearly another set of coefficients.
            let share = if i == 2 { 0.1 } else { 1.0 };
            if i != j {
                found.holds(&format!("matrix[{i}][{j}]"), truth.as_f64().unwrap(), share);
            }
        }
    }
}

#[test]
fn runout_of_the_tool() {
    let found = Found::of("mill-runout");
    found.holds("offset_mm", found.true_value("offset_mm"), 0.01);
    // Counted from one of six teeth.
    let [angle, std] = found.parameter("angle_deg");
    let off = (angle - found.true_value("angle_deg") + 30.0).rem_euclid(60.0) - 30.0;
    assert!(off.abs() < 4.0 * std && std < 0.1, "{off} ± {std}");
    found.coefficients_hold();
}

#[test]
fn laws_of_the_cutting_force() {
    for (name, key) in [("mill-size-effect", "p"), ("drill-size-effect", "p")] {
        let found = Found::of(name);
        found.holds(".p", found.true_value(key), 0.03);
        found.coefficients_hold();
    }
    // Its coefficients are those of another speed.
    let found = Found::of("mill-speed-dependence");
    found.holds(".q", found.true_value("q"), 0.01);
    for name in ["mill-tool-wear", "drill-tool-wear"] {
        let found = Found::of(name);
        let growth = found.true_list("growth");
        let directions = found.truth["parameters"]["direction"].as_array().unwrap();
        for (direction, truth) in directions.iter().zip(growth) {
            found.holds(&format!("growth[{}]", direction.as_str().unwrap()), truth, 0.05);
        }
        found.coefficients_hold();
    }
}

#[test]
fn chatter_that_grows_with_the_feed() {
    let found = Found::of("mill-chatter");
    // It differs by a quarter from cut to cut, as its explanation says; so does its frequency by some per cent.
    let [amplitude, _] = found.parameter("amplitude_per_feed");
    let truth = found.true_value("amplitude_per_feed");
    assert!((amplitude / truth - 1.0).abs() < 0.25, "{amplitude} {truth}");
    let cuts = found.truth["parameters"]["cuts"].as_object().unwrap();
    let [frequency, _] = found.parameter("frequency_hz");
    let near = cuts
        .values()
        .map(|c| (c["frequency_hz"].as_f64().unwrap() / frequency - 1.0).abs());
    assert!(near.fold(f64::INFINITY, f64::min) < 0.01, "{frequency}");
    found.coefficients_hold();
}

#[test]
fn what_a_drill_has_beside_its_lips() {
    let found = Found::of("drill-chisel-edge");
    found.holds("coefficient_n", found.true_value("coefficient_n"), 0.01);
    found.holds("exponent", found.true_value("exponent"), 0.01);
    found.coefficients_hold();
    let found = Found::of("drill-margin-friction");
    found.holds("k_margin_n_per_mm", found.true_value("k_margin_n_per_mm"), 0.01);
    found.coefficients_hold();
}
