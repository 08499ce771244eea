//! Damaged, odd and meaningless input: a clear error or a sound result, never a panic, never a number that is not finite.

use std::path::Path;

use lobestone::ingest::{ByteOrder, Encoding58, FrfRecord, read_frfs, write_uff58};
use num_complex::Complex64;
use serde_json::Value;

use super::support::*;

const STRUCTURE_COMMANDS: [&str; 5] = ["calibrate", "compare", "model", "modal", "lobes"];

/// Runs a command that may fail, but only in the agreed way: status 1, nothing on stdout, a message that names
/// `culprit`. `Some(document)` where it went through.
fn survives(arguments: &[&str], culprit: &str) -> Option<Value> {
    let run = lobestone(&[arguments, &["--json"]].concat());
    let context = format!("{arguments:?}\n{}", run.stderr);
    assert!(!run.stderr.contains("panicked"), "{context}");
    match run.status {
        Some(0) => {
            let document: Value = serde_json::from_str(&run.stdout).expect(&context);
            for key in ["error", "parameters", "global", "postures", "absolute_limit_mm"] {
                no_nulls(&document[key], document.get(key).is_none(), &context);
            }
            Some(document)
        }
        Some(1) => {
            assert!(run.stdout.is_empty(), "{context}");
            assert!(run.stderr.starts_with("error: "), "{context}");
            assert!(run.stderr.contains(culprit), "does not name {culprit}: {context}");
            None
        }
        other => panic!("status {other:?}: {context}"),
    }
}

/// What a small measurement does not show.
const MAY_BE_ABSENT: [&str; 4] = ["held_out_nrms", "coherence", "reciprocity_nrms", "complexity"];

/// serde writes numbers that are not finite as null.
fn no_nulls(value: &Value, absent: bool, context: &str) {
    match value {
        Value::Null => assert!(absent, "null in the result: {context}"),
        Value::Array(values) => values.iter().for_each(|v| no_nulls(v, false, context)),
        Value::Object(values) => values
            .iter()
            .filter(|(key, _)| !MAY_BE_ABSENT.contains(&key.as_str()))
            .for_each(|(_, v)| no_nulls(v, false, context)),
        _ => {}
    }
}

fn path(folder: &Path) -> &str {
    folder.to_str().unwrap()
}

const LOBES: &str = "\n[lobes]\nprocess = \"drilling\"\nsource = \"measured\"\nktc_n_per_mm2 = 1014.2\n\
    krc_n_per_mm2 = 619.9\nteeth = 2\nhalf_point_angle_deg = 67.5\nspindle_rpm = [200.0, 500.0, 10.0]\n";

/// A campaign of one posture and one tool point, whose FRFs are what `edit` makes of XX and YY of a good one.
fn odd_campaign(edit: impl Fn(&mut Vec<FrfRecord>)) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let (mut records, _) = read_frfs(&blind("frf-9112/frf/p1.uff")).unwrap();
    edit(&mut records);
    let encoding = Encoding58 {
        binary: Some(ByteOrder::Little),
        double: true,
    };
    write_uff58(&folder.path().join("p1.uff"), &records, encoding).unwrap();
    let toml = "schema = \"lobestone/campaign/1\"\nname = \"odd\"\n[robot]\nmodel = \"irb6640\"\n\
        [[posture]]\nid = \"p1\"\njoints_deg = [135.0, -2.0, 53.0, 83.0, 30.0, -117.0]\n\
        [[point]]\nnode = 1\nbody = \"tool\"\nposition_m = [0.0, 0.0, 0.0]\naxes = \"base\"\n\
        [[point]]\nnode = 2\nbody = \"link2\"\nposition_m = [0.0, 0.0, 0.0]\naxes = \"base\"\n\
        [[frf]]\nfile = \"p1.uff\"\nposture = \"p1\"\n";
    std::fs::write(folder.path().join("campaign.toml"), toml).unwrap();
    append(folder.path(), LOBES);
    folder
}

/// Every structural command on such a campaign; the document of `calibrate` where it went through.
fn odd(edit: impl Fn(&mut Vec<FrfRecord>)) -> Option<Value> {
    let folder = odd_campaign(edit);
    let documents = STRUCTURE_COMMANDS.map(|command| {
        // Errors of a fit as a whole may name the campaign instead of the file.
        survives(&[command, path(folder.path())], "")
    });
    documents.into_iter().next().flatten()
}

fn each_value(records: &mut [FrfRecord], change: impl Fn(f64, Complex64) -> Complex64) {
    for record in records {
        for (f, h) in record.frequency_hz.iter().zip(&mut record.value) {
            *h = change(*f, *h);
        }
    }
}

fn keep_lines(record: &mut FrfRecord, keep: impl Fn(usize) -> bool) {
    let mut index = 0..;
    record.frequency_hz.retain(|_| keep(index.next().unwrap()));
    let mut index = 0..;
    record.value.retain(|_| keep(index.next().unwrap()));
}

#[test]
fn one_posture_calibrates() {
    let document = odd(|_| {}).unwrap();
    assert_eq!(document["converged"], true);
    assert!(document["error"]["nrms"].as_f64().unwrap() < 0.05);
}

#[test]
fn one_frf_calibrates() {
    let document = odd(|records| records.truncate(1)).unwrap();
    assert!(document["error"]["nrms"].as_f64().unwrap() < 0.05);
}

#[test]
fn frfs_on_different_lines() {
    let document = odd(|records| keep_lines(&mut records[1], |i| i % 2 == 0)).unwrap();
    assert!(document["error"]["nrms"].as_f64().unwrap() < 0.05);
}

#[test]
fn frfs_without_content() {
    assert!(odd(|records| each_value(records, |_, _| Complex64::ZERO)).is_none());
    odd(|records| each_value(records, |_, _| Complex64::new(1e-6, 0.0)));
    let document = odd(|records| each_value(&mut records[..1], |_, _| Complex64::ZERO)).unwrap();
    let dead = "1X/1X: zero on every line";
    assert!(
        document["warnings"].to_string().contains(dead),
        "{}",
        document["warnings"]
    );
    assert!(document["error"]["nrms"].as_f64().unwrap() < 0.05);
    odd(|records| each_value(records, |f, h| if f > 20.0 { Complex64::ZERO } else { h }));
}

#[test]
fn very_few_lines() {
    for lines in [1, 2, 3, 5] {
        odd(|records| records.iter_mut().for_each(|r| keep_lines(r, |i| i < lines)));
    }
}

/// Receptance labelled m/N but written in mm/N, and other slips of units: the fit is bad and says so.
#[test]
fn wrong_units_fit_badly_but_soundly() {
    for (factor, warned) in [(1e3, true), (1e-3, true), (1e-12, true), (1e12, false)] {
        let document = odd(|records| each_value(records, |_, h| h * factor)).unwrap();
        let nrms = document["error"]["nrms"].as_f64().unwrap();
        assert!(nrms > 0.2, "{factor}: {nrms}");
        let warnings = document["warnings"].as_array().unwrap();
        assert!(!warned || !warnings.is_empty(), "{factor}: no warning");
    }
}

#[test]
fn conjugated_and_spiked_frfs() {
    odd(|records| each_value(records, |_, h| h.conj()));
    odd(|records| records[0].value[100] = Complex64::new(1e30, 0.0));
}

#[test]
fn roving_points_only() {
    let rename = |record: &mut FrfRecord, name: &str| {
        record.name = name.into();
        let (response, reference) = name.split_once('/').unwrap();
        record.response = response.parse().ok();
        record.reference = reference.parse().ok();
    };
    odd(|records| {
        rename(&mut records[0], "2X/2X");
        rename(&mut records[1], "2Y/2X");
    });
}

#[test]
fn the_same_posture_twice() {
    let folder = odd_campaign(|_| {});
    append(
        folder.path(),
        "\n[[posture]]\nid = \"again\"\njoints_deg = [135.0, -2.0, 53.0, 83.0, 30.0, -117.0]\n\
         [[frf]]\nfile = \"p1.uff\"\nposture = \"again\"\n",
    );
    for command in STRUCTURE_COMMANDS {
        survives(&[command, path(folder.path())], "");
    }
    append(
        folder.path(),
        "\n[[posture]]\nid = \"p1\"\njoints_deg = [135.0, -2.0, 53.0, 83.0, 30.0, -117.0]\n",
    );
    assert!(survives(&["calibrate", path(folder.path())], "campaign.toml").is_none());
}

/// A robot of seven joints, against FRFs of another one: a bad fit that says so; the model alone is sound.
#[test]
fn seven_joints() {
    let folder = odd_campaign(|_| {});
    let robot = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/cobot7.toml");
    std::fs::copy(robot, folder.path().join("cobot7.toml")).unwrap();
    let file = folder.path().join("campaign.toml");
    let toml = std::fs::read_to_string(&file)
        .unwrap()
        .replace("irb6640", "cobot7.toml")
        .replace("-117.0]", "-117.0, 20.0]");
    std::fs::write(file, toml).unwrap();
    for command in STRUCTURE_COMMANDS {
        survives(&[command, path(folder.path())], "").expect(command);
    }
    let model = document(&["model", path(folder.path())]);
    let posture = &model["postures"][0];
    assert_eq!(posture["natural_frequencies_hz"].as_array().unwrap().len(), 7);
    // Not every link of this robot bends, so there is no stiffness between all centres of mass.
    assert!(survives(&["model", "--matrices", path(folder.path())], "section").is_none());
}

/// What stands where a measurement file should.
fn spoil(file: &Path, how: &str) {
    std::fs::remove_file(file).unwrap();
    match how {
        "empty" => std::fs::write(file, "").unwrap(),
        "folder" => std::fs::create_dir(file).unwrap(),
        "junk" => {
            let junk: Vec<u8> = (0..20_000u32)
                .map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8)
                .collect();
            std::fs::write(file, junk).unwrap();
        }
        "prose" => std::fs::write(file, "Dear all, the data follow.\n").unwrap(),
        _ => std::fs::write(file, "frequency_hz,re(1X/1X),im(1X/1X)\n3,nan,inf\n4,nan,2\n").unwrap(),
    }
}

#[test]
fn what_is_no_measurement_is_named() {
    for how in ["empty", "folder", "junk", "prose", "not numbers"] {
        let structure = copy_of("frf-9112");
        spoil(&structure.path().join("frf/p2.uff"), how);
        for command in ["calibrate", "compare", "modal"] {
            assert!(
                survives(&[command, path(structure.path())], "p2.uff").is_none(),
                "{how}"
            );
        }
        let cutting = copy_of("force-9439");
        spoil(&cutting.path().join("force/cut05.txt"), how);
        // A folder is found out while the campaign is read; otherwise the other cuts still say something.
        let document = survives(&["cfc", path(cutting.path())], "cut05.txt");
        assert_eq!(document.is_none(), how == "folder", "{how}");
        let warnings = document.map_or("cut05.txt".into(), |d| d["warnings"].to_string());
        assert!(warnings.contains("cut05.txt"), "{how}: {warnings}");
        let file = cutting.path().join("force/cut05.txt");
        assert!(
            survives(&["inspect", path(&file)], "cut05.txt").is_none(),
            "{how}"
        );
    }
}

#[cfg(unix)]
#[test]
fn a_file_that_may_not_be_read() {
    use std::os::unix::fs::PermissionsExt;
    let campaign = copy_of("frf-9112");
    let file = campaign.path().join("frf/p3.uff");
    std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o000)).unwrap();
    // The superuser may read everything.
    if std::fs::read(&file).is_err() {
        assert!(survives(&["calibrate", path(campaign.path())], "p3.uff").is_none());
        assert!(survives(&["inspect", path(&file)], "p3.uff").is_none());
    }
}

#[test]
fn files_cut_short() {
    let structure = copy_of("frf-9112");
    let cutting = copy_of("force-9439");
    let frf = structure.path().join("frf/p1.uff");
    let force = cutting.path().join("force/cut14.txt");
    for (campaign, file, command) in [(&structure, frf, "calibrate"), (&cutting, force, "cfc")] {
        let name = file.file_name().unwrap().to_str().unwrap().to_owned();
        let whole = std::fs::read(&file).unwrap();
        for twentieth in 0..20 {
            std::fs::write(&file, &whole[..whole.len() * twentieth / 20]).unwrap();
            survives(&["inspect", path(&file)], &name);
            if twentieth % 4 == 1 {
                survives(&[command, path(campaign.path())], &name);
            }
        }
        std::fs::write(&file, whole).unwrap();
        let toml = campaign.path().join("campaign.toml");
        let whole = std::fs::read(&toml).unwrap();
        for twentieth in 0..20 {
            std::fs::write(&toml, &whole[..whole.len() * twentieth / 20]).unwrap();
            survives(&[command, path(campaign.path())], "campaign.toml");
        }
    }
}

/// One drilling cut with the record that is given.
fn cut_campaign(record: &str, more: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("cut.csv"), record).unwrap();
    let toml = format!(
        "schema = \"lobestone/campaign/1\"\nname = \"cut\"\n[tool]\nkind = \"endmill\"\ndiameter_mm = 16.0\nteeth = 6\n\
         helix_deg = 42.0\n[[cut]]\nid = \"1\"\nfile = \"cut.csv\"\nprocess = \"milling\"\nspindle_rpm = 1160.0\n\
         feed_per_tooth_mm = 0.05\naxial_depth_mm = 2.0\nimmersion = \"slot\"\n{more}"
    );
    std::fs::write(folder.path().join("campaign.toml"), toml).unwrap();
    folder
}

fn force_record(header: &str, rows: usize, row: impl Fn(f64) -> String) -> String {
    let rows: String = (0..rows)
        .map(|i| format!("{}\n", row(i as f64 / 1000.0)))
        .collect();
    format!("{header}\n{rows}")
}

#[test]
fn odd_force_records() {
    let three = "time_s,fx_n,fy_n,fz_n";
    let cutting = |t: f64| if (0.5..2.5).contains(&t) { 100.0 } else { 0.0 };
    let sound = force_record(three, 3000, |t| {
        let (c, s) = (cutting(t), (700.0 * t).sin());
        format!("{t},{},{},{}", c + s, 0.5 * c - s, 0.2 * c)
    });
    let cases = [
        (
            force_record("time_s,fx_n", 3000, |t| format!("{t},{}", cutting(t))),
            "",
        ),
        (
            force_record("time_s,fz_n", 3000, |t| format!("{t},{}", cutting(t))),
            "",
        ),
        (force_record(three, 3000, |t| format!("{t},0,0,0")), ""),
        (force_record(three, 3000, |t| format!("{t},5,5,5")), ""),
        (force_record(three, 1, |t| format!("{t},1,2,3")), ""),
        (force_record(three, 2, |t| format!("{t},1,2,3")), ""),
        (force_record(three, 20, |t| format!("{t},1,2,3")), ""),
        (force_record(three, 3000, |_| "0,1,2,3".into()), ""),
        (force_record(three, 3000, |t| format!("{},1,2,3", 3.0 - t)), ""),
        (
            force_record(three, 3000, |t| format!("{t},1e300,-1e300,1e300")),
            "",
        ),
        (sound.clone(), "steady_s = [1.0, 1.0]"),
        (sound.clone(), "steady_s = [2.0, 1.0]"),
        (sound.clone(), "steady_s = [1.0, 1.001]"),
        (sound.clone(), "steady_s = [10.0, 20.0]"),
        (sound.clone(), "steady_s = [-5.0, 20.0]"),
    ];
    for (record, more) in cases {
        let folder = cut_campaign(&record, more);
        survives(&["cfc", path(folder.path())], path(folder.path()));
        survives(&["inspect", path(&folder.path().join("cut.csv"))], "cut.csv");
    }
    // One feed: cutting and edge parts cannot be told apart, and nothing is invented.
    let folder = cut_campaign(&sound, "");
    let document = survives(&["cfc", path(folder.path())], "").unwrap();
    assert!(document["groups"][0]["ktc_n_per_mm2"]["value"].is_null());
    assert!(!document["warnings"].as_array().unwrap().is_empty());
}
