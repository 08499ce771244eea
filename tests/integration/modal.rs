//! `lobestone modal`: the document of docs/json.md, and honesty about what is not there.

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

/// The same FRF as accelerance, mobility and receptance, in files that do not say which.
#[test]
fn what_files_do_not_say_can_be_said() {
    let dir = tempfile::tempdir().unwrap();
    for (power, quantity) in ["receptance", "mobility", "accelerance"].into_iter().enumerate() {
        let mut text = String::new();
        for k in 0..=570 {
            let w = TAU * (3.0 + 0.1 * f64::from(k));
            let w0 = TAU * 12.34;
            let h = 0.01 / Complex64::new(w0 * w0 - w * w, 0.06 * w0 * w)
                * Complex64::new(0.0, w).powi(power as i32);
            writeln!(text, "{:.1},{:e},{:e}", w / TAU, h.re, h.im).unwrap();
        }
        let file = dir.path().join(format!("{quantity}.csv"));
        std::fs::write(&file, text).unwrap();
        let document = json_of(&[file.to_str().unwrap(), "--quantity", quantity]);
        let constant = &document["frfs"][0]["modes"][0]["modal_constant"];
        let [re, im] = [0, 1].map(|k| constant[k].as_f64().unwrap());
        assert!(
            (re - 0.01).abs() < 1e-4 && im.abs() < 1e-4,
            "{quantity}: {re} {im}"
        );
    }
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

/// FRFs of three points (hit at the first) of a structure with three real modes, as CSV; the geometry next to it.
fn three_points(dir: &Path) -> (String, String) {
    const MODES: [(f64, f64, [f64; 3]); 3] = [
        (9.0, 0.02, [1.0, 0.6, -0.5]),
        (17.0, 0.015, [0.8, -0.9, 0.3]),
        (31.0, 0.02, [0.5, 0.7, 1.0]),
    ];
    let mut text = String::from("frequency_hz,re(1Z/1Z),im(1Z/1Z),re(2Z/1Z),im(2Z/1Z),re(3Z/1Z),im(3Z/1Z)");
    for k in 0..=470 {
        let f = 3.0 + 0.1 * f64::from(k);
        write!(text, "\n{f}").unwrap();
        for point in 0..3 {
            let w = TAU * f;
            let h: Complex64 = MODES
                .iter()
                .map(|(f0, zeta, phi)| {
                    let w0 = TAU * f0;
                    phi[point] * phi[0] / Complex64::new(w0 * w0 - w * w, 2.0 * zeta * w0 * w)
                })
                .sum();
            write!(text, ",{:e},{:e}", h.re, h.im).unwrap();
        }
    }
    let (frfs, geometry) = (dir.join("frfs.csv"), dir.join("geometry.csv"));
    std::fs::write(&frfs, text + "\n").unwrap();
    std::fs::write(
        &geometry,
        "node,x,y,z\n1,0,0,0\n2,0.5,0,0\n3,1,0,0\nline,1,2\nline,2,3\n",
    )
    .unwrap();
    let path = |p: &Path| p.to_str().unwrap().to_owned();
    (path(&frfs), path(&geometry))
}

fn frequencies(document: &Value) -> Vec<f64> {
    let modes = document["global"].as_array().unwrap();
    modes
        .iter()
        .map(|m| m["frequency_hz"].as_f64().unwrap())
        .collect()
}

#[test]
fn a_report_and_files_for_other_programs_are_written_and_read_back() {
    let dir = tempfile::tempdir().unwrap();
    let (frfs, geometry) = three_points(dir.path());
    let at = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (report, export) = (at("report"), at("export"));
    let document = json_of(&[
        &frfs,
        "--geometry",
        &geometry,
        "--report",
        &report,
        "--export",
        &export,
    ]);
    assert_eq!(document["exported"].as_array().unwrap().len(), 5);
    // The mass of a mode whose largest component is 1, of mass-normalised shapes.
    for (mode, expected) in document["global"]
        .as_array()
        .unwrap()
        .iter()
        .zip([1.0, 1.0 / 0.81, 1.0])
    {
        let scale = &mode["scale"];
        assert_eq!(scale["driving_point"], "1Z");
        let mass = scale["modal_mass_kg"].as_f64().unwrap();
        assert!((mass / expected - 1.0).abs() < 0.01, "{mass} for {expected}");
    }
    assert_eq!(
        document["sets"][0]["driving_points"][0]["verdict"],
        "as a driving point must be"
    );
    let html = std::fs::read_to_string(document["report"]["html"].as_str().unwrap()).unwrap();
    for part in [
        "Mode indicators",
        "Click poles to pick them",
        "Driving points",
        "<animate",
        "--pole",
    ] {
        assert!(html.contains(part), "{part}");
    }
    // Tables and drawings; an image's letters may spell anything.
    assert!(!html.contains(">NaN") && !html.contains("=\"NaN\""));
    for name in [
        "modal-cmif.png",
        "modal-mmif.png",
        "modal-shapes.png",
        "modal-complexity.png",
        "modal-stabilisation.png",
    ] {
        assert!(Path::new(&report).join(name).is_file(), "{name}");
    }
    // Synthesised FRFs hold the same modes; the shapes compare with themselves.
    let again = json_of(&[&at("export/synthesised.uff"), "--model", &at("export/modes.uff")]);
    for (a, b) in frequencies(&document).iter().zip(frequencies(&again)) {
        assert!((a / b - 1.0).abs() < 1e-4, "{a} {b}");
    }
    let pairs = again["model"][0]["pairs"].as_array().unwrap();
    assert_eq!(pairs.len(), 3);
    for pair in pairs {
        assert!(
            pair["mac"].as_f64().unwrap() > 0.999 && pair["frequency_error"].as_f64().unwrap().abs() < 1e-3
        );
    }
    let table = std::fs::read_to_string(at("export/modes.csv")).unwrap();
    assert_eq!(table.lines().count(), 4);
}

#[test]
fn the_analyst_gives_and_takes_poles_and_the_window_is_taken_out() {
    let dir = tempfile::tempdir().unwrap();
    let (frfs, _) = three_points(dir.path());
    let all = json_of(&[&frfs]);
    assert_eq!(all["global"].as_array().unwrap().len(), 3);
    let rounded =
        |document: &Value| -> Vec<f64> { frequencies(document).iter().map(|f| f.round()).collect() };
    assert_eq!(rounded(&json_of(&[&frfs, "--without", "17"])), [9.0, 31.0]);
    assert_eq!(
        rounded(&json_of(&[&frfs, "--pole", "31", "--pole", "9:0.02"])),
        [9.0, 31.0]
    );
    assert_eq!(
        json_of(&[&frfs, "--modes", "1"])["global"]
            .as_array()
            .unwrap()
            .len(),
        1
    );
    let nowhere = program()
        .args(["modal", &frfs, "--without", "24"])
        .output()
        .unwrap();
    assert_eq!(nowhere.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&nowhere.stderr).contains("24"));
    // 1/τ = 0.5/s of ζω; the frequency at which it swings stays.
    let windowed = json_of(&[&frfs, "--window-tau", "2"]);
    for (a, b) in all["global"]
        .as_array()
        .unwrap()
        .iter()
        .zip(windowed["global"].as_array().unwrap())
    {
        let [with, without] = [a, b].map(|m| {
            let [f, zeta] = ["frequency_hz", "damping_ratio"].map(|key| m[key].as_f64().unwrap());
            TAU * f * Complex64::new(-zeta, (1.0 - zeta * zeta).sqrt())
        });
        assert!((with + 0.5 - without).norm() < 1e-7, "{with} {without}");
    }
}

#[test]
fn order_tolerances_and_method_are_the_analysts() {
    let dir = tempfile::tempdir().unwrap();
    let (frfs, _) = three_points(dir.path());
    let diagram = |arguments: &[&str]| {
        let document = json_of(&[&[frfs.as_str()], arguments].concat());
        assert_eq!(document["global"].as_array().unwrap().len(), 3, "{arguments:?}");
        document["sets"][0]["stabilisation"].clone()
    };
    let usual = diagram(&[]);
    let low = diagram(&["--order", "12"]);
    assert_eq!(low["max_order"], 12);
    assert!(usual["max_order"].as_u64().unwrap() > 12);
    let stable = |diagram: &Value| {
        let poles = diagram["poles"].as_array().unwrap();
        poles.iter().filter(|p| p["stability"] == "full").count()
    };
    // The same poles, judged more strictly.
    let strict = diagram(&["--tolerances", "1e-9:1e-9:0.999999999"]);
    assert_eq!(
        strict["poles"].as_array().unwrap().len(),
        usual["poles"].as_array().unwrap().len()
    );
    assert!(stable(&strict) < stable(&usual));
    // 471 lines determine no more than 157 poles.
    let document = json_of(&[&frfs, "--order", "300"]);
    assert_eq!(document["sets"][0]["stabilisation"]["max_order"], 157);
    let warnings = document["warnings"].to_string();
    assert!(warnings.contains("order 300 was asked for"), "{warnings}");

    let document = json_of(&[&frfs, "--method", "half-power"]);
    for frf in document["frfs"].as_array().unwrap() {
        let modes = frf["modes"].as_array().unwrap();
        assert!(!modes.is_empty() && modes.iter().all(|m| m["method"] == "half-power"));
    }
    for wrong in [
        ["--tolerances", "0.01:0.1"],
        ["--tolerances", "0.01:0.1:2"],
        ["--order", "1"],
    ] {
        let run = program().args(["modal", &frfs]).args(wrong).output().unwrap();
        assert_eq!(run.status.code(), Some(2), "{wrong:?}");
    }
}

#[test]
fn modes_of_accelerations_alone() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("idle.csv");
    // A mass on a spring at 12 Hz under random force, and a spindle at 20 Hz.
    let (rate, zeta) = (200.0, 0.02);
    let (w, dt) = (TAU * 12.0, 1.0 / rate);
    let (mut x, mut v, mut seed) = (0.0, 0.0, 7u64);
    let mut text = String::from("time_s,table_m_s2,head_m_s2\n");
    for k in 0..40_000 {
        let mut force = 0.0;
        for _ in 0..6 {
            // A linear congruential generator: six of them add up to next to a normal number.
            seed = seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            force += (seed >> 33) as f64 / f64::from(1u32 << 31) - 0.5;
        }
        const STEPS: i32 = 20;
        let a = force - 2.0 * zeta * w * v - w * w * x;
        for _ in 0..STEPS {
            let h = dt / f64::from(STEPS);
            v += h * (force - 2.0 * zeta * w * v - w * w * x);
            x += h * v;
        }
        let t = f64::from(k) * dt;
        let spindle = 2.0 * (TAU * 20.0 * t).sin();
        writeln!(text, "{t},{:.5},{:.5}", a + spindle, 0.5 * a - spindle).unwrap();
    }
    std::fs::write(&file, text).unwrap();
    let document = json_of(&[
        file.to_str().unwrap(),
        "--output-only",
        "--band",
        "4:40",
        "--spindle",
        "1200",
    ]);
    let found = &document["output_only"][0];
    let modes = found["modes"].as_array().unwrap();
    assert_eq!(modes.len(), 1, "{found:#}");
    let value = |key: &str| modes[0][key].as_f64().unwrap();
    assert!(
        (value("frequency_hz") - 12.0).abs() < 4.0 * value("frequency_std_hz"),
        "{}",
        modes[0]
    );
    assert!(
        (value("damping_ratio") - zeta).abs() < 4.0 * value("damping_std"),
        "{}",
        modes[0]
    );
    assert_eq!(found["harmonics"][0]["multiple"], 1);
    assert!((found["harmonics"][0]["frequency_hz"].as_f64().unwrap() - 20.0).abs() < 0.01);
}
