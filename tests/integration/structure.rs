//! Practice campaigns with known truth: what was put in must come out, within its own standard errors.

use std::f64::consts::TAU;

use lobestone::ingest::{Quantity, read_frfs};
use serde_json::Value;

use super::support::*;

/// What a perfect model leaves over, from the truth: noise of a|H| + b on every value.
fn true_noise_nrms(name: &str) -> f64 {
    let truth = truth(name);
    let [a, b] = [0, 1].map(|i| truth["noise"][i].as_f64().unwrap());
    let (mut noise, mut signal) = (0.0, 0.0);
    for entry in std::fs::read_dir(blind(name).join("frf")).unwrap() {
        for frf in read_frfs(&entry.unwrap().path()).unwrap().0 {
            let order = match frf.quantity.unwrap() {
                Quantity::Receptance => 0,
                Quantity::Mobility => 1,
                Quantity::Accelerance => 2,
            };
            for (f, h) in frf.frequency_hz.iter().zip(&frf.value) {
                let receptance = h.norm() / (TAU * f).powi(order);
                noise += (a * receptance).powi(2) + b * b;
                signal += receptance.powi(2);
            }
        }
    }
    (noise / signal).sqrt()
}

fn parameter<'a>(document: &'a Value, name: &str) -> &'a Value {
    let parameters = document["parameters"].as_array().unwrap();
    parameters.iter().find(|p| p["name"] == name).expect(name)
}

/// Value within `share` of `truth` and within four of its standard errors.
fn assert_recovered(found: &Value, truth: f64, share: f64, label: &str) {
    let number = |key: &str| found[key].as_f64().unwrap_or_else(|| panic!("{label}: {found}"));
    let (value, std_error) = (number("value"), number("std_error"));
    let off = (value - truth).abs();
    assert!(off <= share * truth.abs(), "{label}: {value} against {truth}");
    assert!(
        off <= 4.0 * std_error,
        "{label}: {value} ± {std_error} against {truth}"
    );
    // A standard error that is no information would make the line above hold for anything.
    assert!(std_error < share * truth.abs(), "{label}: ± {std_error}");
}

/// A correlation matrix in the order of the parameters: symmetric, ones on the diagonal, nothing beyond one.
fn assert_correlation(document: &Value) {
    let rows = document["correlation"].as_array().unwrap();
    assert_eq!(rows.len(), document["parameters"].as_array().unwrap().len());
    let at = |i: usize, j: usize| rows[i][j].as_f64().unwrap();
    let mut off_diagonal = 0.0_f64;
    for i in 0..rows.len() {
        assert!((at(i, i) - 1.0).abs() < 1e-9);
        for j in 0..i {
            assert!((at(i, j) - at(j, i)).abs() < 1e-9 && at(i, j).abs() < 1.0);
            off_diagonal = off_diagonal.max(at(i, j).abs());
        }
    }
    // Joints of a chain are never independent of each other.
    assert!(off_diagonal > 0.05, "{off_diagonal}");
}

fn calibrated(name: &str) -> Value {
    let document = document(&["calibrate", blind(name).to_str().unwrap()]);
    let truth = truth(name);
    for (i, stiffness) in truth["joint_stiffness"].as_array().unwrap().iter().enumerate() {
        let key = format!("joint-{}.stiffness", i + 1);
        assert_recovered(
            parameter(&document, &key),
            stiffness.as_f64().unwrap(),
            0.01,
            &key,
        );
    }
    let zeta = truth["zeta"].as_f64().unwrap();
    assert_recovered(parameter(&document, "damping-ratio"), zeta, 0.01, "damping-ratio");
    let noise = true_noise_nrms(name);
    let error = &document["error"];
    let nrms = error["nrms"].as_f64().unwrap();
    assert!(nrms <= 1.1 * noise, "nrms {nrms}, noise {noise}");
    // Better than the noise by more than its own scatter would be a fit to the noise.
    assert!(nrms >= 0.9 * noise, "nrms {nrms}, noise {noise}");
    let floor = error["noise_floor_nrms"].as_f64().unwrap();
    assert!(
        (floor / noise - 1.0).abs() < 0.1,
        "noise floor {floor}, noise {noise}"
    );
    assert_eq!(document["converged"], true);
    assert_correlation(&document);
    document
}

#[test]
fn calibrate_on_a_full_three_by_three_campaign() {
    calibrated("frf-9000");
}

/// Accelerance of XX and YY only, four postures.
#[test]
fn calibrate_on_direct_frfs_only() {
    calibrated("frf-9112");
}

/// Roving points, 6 % noise, link masses up to 5 % off.
#[test]
fn calibrate_on_noisy_frfs_with_wrong_masses() {
    let document = calibrated("frf-9216");
    let truth = truth("frf-9216");
    for (i, scale) in truth["mass_scale"].as_array().unwrap().iter().enumerate() {
        let mass = parameter(&document, &format!("link-{}.mass", i + 1));
        let expected = scale.as_f64().unwrap() * mass["initial"].as_f64().unwrap();
        assert_recovered(mass, expected, 0.05, &format!("link-{}", i + 1));
    }
}

/// Postures left out of the fit are predicted to the noise, and no part of the data stands out.
#[test]
fn compare_finds_nothing_where_nothing_is_missing() {
    let name = "frf-9000";
    let document = document(&["compare", blind(name).to_str().unwrap()]);
    let noise = true_noise_nrms(name);
    let held_out = document["error"]["held_out_nrms"].as_f64().unwrap();
    assert!(
        held_out < 1.1 * noise && held_out >= document["error"]["nrms"].as_f64().unwrap(),
        "{held_out}"
    );
    for key in ["by_posture", "by_point"] {
        for (group, nrms) in document[key].as_object().unwrap() {
            assert!(nrms.as_f64().unwrap() < 1.2 * noise, "{key} {group}: {nrms}");
        }
    }
}

/// Cutting coefficients within 2 %, edge coefficients within 10 % of the truth, all within four standard errors.
fn assert_coefficients(name: &str, keys: &[(&str, &str)]) {
    let document = document(&["cfc", blind(name).to_str().unwrap()]);
    let truth = truth(name);
    let truth = &truth["true_coefficients"];
    let of = |short: &str| truth[short].as_f64().unwrap();
    let pooled = &document["pooled"][0];
    let fullest = document["groups"]
        .as_array()
        .unwrap()
        .iter()
        .max_by_key(|g| g["cuts"].as_array().unwrap().len())
        .unwrap();
    for group in [pooled, fullest] {
        for (short, key) in keys {
            let share = if short.ends_with('e') { 0.1 } else { 0.02 };
            let value = group[key]["value"].as_f64().unwrap();
            let std_error = group[key]["std_error"].as_f64().unwrap();
            let off = (value - of(short)).abs();
            assert!(
                off <= share * of(short).abs(),
                "{name} {short}: {value} against {}",
                of(short)
            );
            assert!(
                off <= 4.0 * std_error,
                "{name} {short}: {value} ± {std_error} against {}",
                of(short)
            );
        }
    }
}

#[test]
fn milling_coefficients() {
    assert_coefficients(
        "force-9400",
        &[
            ("Ktc", "ktc_n_per_mm2"),
            ("Krc", "krc_n_per_mm2"),
            ("Kac", "kac_n_per_mm2"),
            ("Kte", "kte_n_per_mm"),
            ("Kre", "kre_n_per_mm"),
            ("Kae", "kae_n_per_mm"),
        ],
    );
}

#[test]
fn drilling_coefficients() {
    assert_coefficients(
        "force-9439",
        &[
            ("Ktc", "ktc_n_per_mm2"),
            ("Kte", "kte_n_per_mm"),
            ("Kfc", "kfc_n_per_mm2"),
            ("Kfe", "kfe_n_per_mm"),
        ],
    );
}

/// The same campaign gives the same document, whatever the number of threads.
#[test]
fn results_do_not_depend_on_threads() {
    let folder = blind("frf-9112");
    let with = |threads: &str| {
        let output = crate::support::program()
            .env("RAYON_NUM_THREADS", threads)
            .args(["calibrate", folder.to_str().unwrap(), "--json"])
            .output()
            .unwrap();
        assert!(output.status.success());
        output.stdout
    };
    assert_eq!(with("1"), with("3"));
}
