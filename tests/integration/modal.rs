//! `lobestone modal`: the document of the contract, and honesty about what is not there.

use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::Path;

use crate::support::program;
use num_complex::Complex64;
use serde_json::Value;

/// Writes an FRF CSV of one mode a direction (receptance, 0.1 Hz lines from 3 to 60 Hz).
fn write_csv(path: &Path, modes: &[(f64, f64)], conjugated: bool) {
    let mut text = String::from("frequency_hz");
    for k in 1..=modes.len() {
        write!(text, ",re({k}X/1X),im({k}X/1X)").unwrap();
    }
    for k in 0..=570 {
        let f = 3.0 + 0.1 * f64::from(k);
        write!(text, "\n{f}").unwrap();
        for &(f0, zeta) in modes {
            let (w, w0) = (TAU * f, TAU * f0);
            let h = 0.01 / Complex64::new(w0 * w0 - w * w, 2.0 * zeta * w0 * w);
            write!(text, ",{:e},{:e}", h.re, if conjugated { -h.im } else { h.im }).unwrap();
        }
    }
    std::fs::write(path, text + "\n").unwrap();
}

fn json_of(arguments: &[&str]) -> Value {
    let output = program()
        .arg("modal")
        .arg("--json")
        .args(arguments)
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn the_document_has_the_keys_of_the_contract_and_the_right_numbers() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("taps.csv");
    write_csv(&file, &[(12.34, 0.03), (20.0, 0.02)], false);
    let document = json_of(&[file.to_str().unwrap()]);

    let frfs = document["frfs"].as_array().unwrap();
    assert_eq!(frfs.len(), 2);
    for (frf, (name, f0, zeta)) in frfs.iter().zip([("1X/1X", 12.34, 0.03), ("2X/1X", 20.0, 0.02)]) {
        assert_eq!(frf["name"], name);
        let modes = frf["modes"].as_array().unwrap();
        let methods: Vec<&str> = modes.iter().map(|m| m["method"].as_str().unwrap()).collect();
        assert_eq!(methods, ["local-fit", "circle-fit", "half-power"]);
        for mode in modes {
            assert!(
                (mode["frequency_hz"].as_f64().unwrap() / f0 - 1.0).abs() < 1e-5,
                "{mode}"
            );
            assert!(
                (mode["damping_ratio"].as_f64().unwrap() / zeta - 1.0).abs() < 1e-4,
                "{mode}"
            );
        }
    }
    let global = document["global"].as_array().unwrap();
    assert_eq!(global.len(), 2);
    for (mode, f0) in global.iter().zip([12.34, 20.0]) {
        assert!(
            (mode["frequency_hz"].as_f64().unwrap() / f0 - 1.0).abs() < 1e-4,
            "{mode}"
        );
        for key in ["damping_ratio", "frequency_std_hz", "damping_std"] {
            assert!(mode[key].as_f64().unwrap() >= 0.0, "{key} in {mode}");
        }
    }
}

#[test]
fn a_band_leaves_out_the_modes_outside_and_conjugated_phase_is_said() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("taps.csv");
    write_csv(&file, &[(12.34, 0.03), (20.0, 0.02)], true);
    let document = json_of(&["--band", "15:30", file.to_str().unwrap()]);
    assert!(document["frfs"][0]["modes"].as_array().unwrap().is_empty());
    assert_eq!(document["global"].as_array().unwrap().len(), 1);
    let warnings: Vec<&str> = document["warnings"]
        .as_array()
        .unwrap()
        .iter()
        .map(|w| w.as_str().unwrap())
        .collect();
    assert!(
        warnings
            .iter()
            .any(|w| w.contains("2X/1X") && w.contains("conjugated")),
        "{warnings:?}"
    );
}

#[test]
fn a_band_that_is_none_is_wrong_usage() {
    let run = program()
        .args(["modal", "--band", "60:3", "x.csv"])
        .output()
        .unwrap();
    assert_eq!(run.status.code(), Some(2));
}
