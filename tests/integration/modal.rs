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

/// A LabVIEW file with a segment for each hit (a half sine of 4 ms): acceleration of one mode of 50 kg, and a little noise.
fn write_lvm(path: &Path, frequencies_hz: &[f64]) {
    let (rate_hz, zeta, mass_kg) = (1000.0, 0.04, 50.0);
    let mut text =
        String::from("LabVIEW Measurement\nSeparator\tTab\nX_Columns\tNo\n***End_of_Header***\n\n");
    let mut state = 1u32;
    for (segment, &f0) in frequencies_hz.iter().enumerate() {
        text += "Channels\t2\nY_Unit_Label\tN\tm/s^2\nX_Dimension\tTime\tTime\nX0\t0.0\t0.0\nDelta_X\t0.001\t0.001\n";
        text += "***End_of_Header***\nX_Value\thammer\ttool\tComment\n";
        // Exact steps of the free vibration; the force is held over a step.
        let w0 = TAU * f0;
        let s = Complex64::new(-zeta, (1.0 - zeta * zeta).sqrt()) * w0;
        let step = (s / rate_hz).exp();
        let mut z = Complex64::ZERO;
        for k in 0..3000 {
            let at = k - 200 - 7 * segment as i32;
            let force = if (0..4).contains(&at) {
                300.0 * (std::f64::consts::PI * (f64::from(at) + 0.5) / 4.0).sin()
            } else {
                0.0
            };
            // x = Im z/(m ω_d) with ż = s z + f, so a = Im(s² z + s f)/(m ω_d).
            let acceleration = ((s * s * z + s * force).im / s.im) / mass_kg;
            z = step * z + (step - 1.0) / s * force;
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let noise = f64::from(state >> 8) / f64::from(1 << 24) - 0.5;
            writeln!(
                text,
                "\t{:.6}\t{:.8}",
                force + 0.2 * noise,
                acceleration + 0.004 * noise
            )
            .unwrap();
        }
        text += "\n";
    }
    std::fs::write(path, text).unwrap();
}

#[test]
fn hits_in_segments_of_one_file_are_averaged_unless_they_contradict_each_other() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("taps.lvm");
    let run = |frequencies_hz: &[f64]| {
        write_lvm(&file, frequencies_hz);
        let document = json_of(&[file.to_str().unwrap()]);
        let warnings = document["warnings"].to_string();
        let count = document["frfs"].as_array().unwrap().len();
        (document, warnings, count)
    };
    let (document, warnings, count) = run(&[12.0; 4]);
    assert_eq!(count, 1, "{warnings}");
    assert!(warnings.contains("hits are averaged"), "{warnings}");
    assert!(!warnings.contains("single good hit"), "{warnings}");
    let mode = &document["global"][0];
    assert!(
        (mode["frequency_hz"].as_f64().unwrap() / 12.0 - 1.0).abs() < 2e-3,
        "{mode}"
    );
    assert!(
        (mode["damping_ratio"].as_f64().unwrap() / 0.04 - 1.0).abs() < 0.05,
        "{mode}"
    );

    let (_, warnings, count) = run(&[12.0, 31.0, 55.0]);
    assert_eq!(count, 3, "{warnings}");
    assert!(warnings.contains("contradict each other"), "{warnings}");
}
