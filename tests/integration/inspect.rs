//! `lobestone inspect`: the JSON of docs/json.md, the text for people, and errors that name the file.

use std::path::Path;
use std::process::Output;

use crate::support::program;
use lobestone::ingest::{ByteOrder, Encoding58, FrfRecord, Quantity, write_uff58};
use num_complex::Complex64;
use serde_json::Value;

fn inspect(folder: &Path, arguments: &[&str]) -> Output {
    program()
        .current_dir(folder)
        .arg("inspect")
        .args(arguments)
        .output()
        .unwrap()
}

fn document(folder: &Path, arguments: &[&str]) -> Value {
    let output = inspect(folder, &[arguments, &["--json"]].concat());
    assert!(output.status.success());
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
    serde_json::from_slice(&output.stdout).unwrap()
}

fn write_files(folder: &Path) {
    let frf = FrfRecord {
        name: "1X/1X".into(),
        response: "1X".parse().ok(),
        reference: "1X".parse().ok(),
        quantity: Some(Quantity::Accelerance),
        frequency_hz: (0..50).map(|i| 3.0 + 0.5 * f64::from(i)).collect(),
        value: (0..50)
            .map(|i| Complex64::new(-1e-3, 1e-4 * f64::from(i)))
            .collect(),
        coherence: None,
    };
    let encoding = Encoding58 {
        binary: Some(ByteOrder::Big),
        double: true,
    };
    write_uff58(&folder.join("frf.uff"), &[frf], encoding).unwrap();
    let header = "Sampling rate [Hz]:;1000\nTime;Fx;Fy;Mz\ns;N;kN;Nm\n";
    let row = |i: usize| format!("0,{i:03};{};{i};1,5\n", i % 3);
    let rows: String = (0..100).map(row).collect();
    std::fs::write(folder.join("cut.txt"), header.to_owned() + &rows).unwrap();
    std::fs::write(
        folder.join("tap.csv"),
        "time_s,hammer_n,acc_g\n0,1,1\n0.1,2,1\n0.2,3,2\n",
    )
    .unwrap();
    std::fs::write(folder.join("rec.dwd"), b"\x01\x00\x02\x00Kistler").unwrap();
}

#[test]
fn json_as_the_contract_says() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path());
    let document = document(folder.path(), &["frf.uff", "cut.txt", "tap.csv"]);
    let files = document["files"].as_array().unwrap();
    let kinds: Vec<&str> = files.iter().map(|f| f["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["frf", "force", "time"]);
    let formats: Vec<&str> = files.iter().map(|f| f["format"].as_str().unwrap()).collect();
    assert_eq!(formats, ["UFF 58b", "DynoWare export", "time CSV"]);
    assert_eq!(files[0]["path"], "frf.uff");
    for file in files {
        assert!(file["warnings"].is_array());
        for channel in file["channels"].as_array().unwrap() {
            assert!(
                channel["name"].is_string() && channel["role"].is_string(),
                "{channel}"
            );
        }
    }
    let frf = &files[0]["channels"][0];
    assert_eq!(
        (&frf["quantity"], &frf["lines"], &frf["from_hz"]),
        (&"accelerance".into(), &50.into(), &3.0.into())
    );
    let roles: Vec<&str> = files[1]["channels"]
        .as_array()
        .unwrap()
        .iter()
        .map(|c| c["role"].as_str().unwrap())
        .collect();
    assert_eq!(roles, ["force-x", "force-y", "torque-z"]);
    let torque = &files[1]["channels"][2];
    assert_eq!(
        (&torque["unit"], &torque["sample_rate_hz"]),
        (&"N·m".into(), &1000.0.into())
    );
    assert_eq!(files[2]["channels"][1]["unit"], "m/s²");
}

#[test]
fn text_names_format_channels_and_warnings() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path());
    let output = inspect(folder.path(), &["cut.txt"]);
    assert!(output.status.success());
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    for part in [
        "cut.txt",
        "semicolon separated, decimal comma",
        "force-x",
        "N (file: kN)",
        "1000 Hz",
        "warning: Mz: the same value",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
}

#[test]
fn a_labview_file_is_read_with_the_decimal_sign_that_it_declares() {
    let folder = tempfile::tempdir().unwrap();
    let text = "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t,\nX_Columns\tNo\n***End_of_Header***\t\n\t\n\
        Channels\t1\t\nY_Unit_Label\tNewtons\t\nX_Dimension\tTime\t\nX0\t0,0E+0\t\nDelta_X\t5,0E-4\t\n\
        ***End_of_Header***\t\t\nX_Value\tHammer\tComment\n\t0,5\n\t1,5\n\t2,5\n";
    std::fs::write(folder.path().join("tap.lvm"), text).unwrap();
    let output = inspect(folder.path(), &["tap.lvm"]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    for part in ["LabVIEW LVM", "Hammer", "2000 Hz", "3 samples"] {
        assert!(text.contains(part), "{part}: {text}");
    }
}

#[test]
fn an_unreadable_file_fails_and_is_named() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path());
    let failed = |arguments: &[&str]| {
        let output = inspect(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(1));
        assert_eq!(String::from_utf8_lossy(&output.stdout), "");
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let error = failed(&["rec.dwd"]);
    assert!(
        error.contains("rec.dwd") && error.contains("DynoWare") && error.contains("remedy"),
        "{error}"
    );
    let both = failed(&["rec.dwd", "missing.uff"]);
    assert!(
        both.contains("2 of 2") && both.contains("rec.dwd") && both.contains("missing.uff"),
        "{both}"
    );

    // What can be read is told all the same, and the status says that something is wrong.
    let mixed = inspect(folder.path(), &["rec.dwd", "missing.uff", "cut.txt", "frf.uff"]);
    assert_eq!(mixed.status.code(), Some(1));
    let (told, error) = (
        String::from_utf8_lossy(&mixed.stdout).into_owned(),
        String::from_utf8_lossy(&mixed.stderr).into_owned(),
    );
    assert!(
        told.contains("cut.txt") && told.contains("frf.uff") && !told.contains("rec.dwd"),
        "{told}"
    );
    assert!(
        error.contains("2 of 4") && error.contains("missing.uff"),
        "{error}"
    );
    let mixed = inspect(folder.path(), &["rec.dwd", "cut.txt", "--json"]);
    let document: Value = serde_json::from_slice(&mixed.stdout).unwrap();
    assert_eq!(mixed.status.code(), Some(1));
    assert_eq!(document["files"].as_array().unwrap().len(), 1);
    assert!(document["unreadable"][0].as_str().unwrap().contains("rec.dwd"));

    // A folder is the files in it, but for notes and the like.
    std::fs::write(folder.path().join("notes.md"), "# notes").unwrap();
    let whole = inspect(
        folder.path().parent().unwrap(),
        &[folder.path().to_str().unwrap()],
    );
    let told = String::from_utf8_lossy(&whole.stdout).into_owned();
    assert!(
        ["cut.txt", "frf.uff", "tap.csv"]
            .iter()
            .all(|name| told.contains(name)),
        "{told}"
    );
    assert!(!String::from_utf8_lossy(&whole.stderr).contains("notes.md"));
    assert_eq!(whole.status.code(), Some(1), "rec.dwd lies there, too");
    let empty = tempfile::tempdir().unwrap();
    let nothing = inspect(folder.path(), &[empty.path().to_str().unwrap()]);
    assert!(String::from_utf8_lossy(&nothing.stderr).contains("holds no measurement files"));
    assert_eq!(inspect(folder.path(), &[]).status.code(), Some(2));
}
