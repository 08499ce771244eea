//! Faults of force records, put one by one into a sound campaign: named by `inspect` and `cfc`, and what can be mended is.

use std::path::Path;

use serde_json::Value;

use crate::support::{COEFFICIENTS, copy_of, document};

const CUTS: [&str; 6] = ["01", "04", "05", "09", "13", "16"];

/// Rows of `time, Fx, Fy, Fz` of a record written with semicolons and decimal commas.
fn change(folder: &Path, cut: &str, change: impl Fn(&mut Vec<[f64; 4]>)) {
    let file = folder.join(format!("force/cut{cut}.txt"));
    let text = std::fs::read_to_string(&file).unwrap().replace(',', ".");
    let (head, rows): (Vec<&str>, Vec<&str>) = text
        .lines()
        .partition(|l| !l.starts_with(|c: char| c.is_ascii_digit()));
    let number = |l: &str| {
        let values: Vec<f64> = l.split(';').map(|v| v.parse().unwrap()).collect();
        <[f64; 4]>::try_from(values).unwrap()
    };
    let mut rows: Vec<[f64; 4]> = rows.into_iter().map(number).collect();
    change(&mut rows);
    let lines: Vec<String> = rows
        .iter()
        .map(|[t, x, y, z]| format!("{t:.4};{x:.5};{y:.5};{z:.5}").replace('.', ","))
        .collect();
    std::fs::write(file, head.join("\n") + "\n" + &lines.join("\n") + "\n").unwrap();
}

/// The sound campaign with `cuts` changed: the document of `cfc`, its warnings, and those of `inspect` on the first cut.
fn with(cuts: &[&str], rows: impl Fn(&mut Vec<[f64; 4]>)) -> (Value, String, String) {
    with_toml(cuts, rows, |toml| toml)
}

fn with_toml(
    cuts: &[&str],
    rows: impl Fn(&mut Vec<[f64; 4]>),
    toml: impl Fn(String) -> String,
) -> (Value, String, String) {
    let folder = copy_of("force-9400");
    cuts.iter().for_each(|cut| change(folder.path(), cut, &rows));
    let campaign = folder.path().join("campaign.toml");
    let text = toml(std::fs::read_to_string(&campaign).unwrap());
    std::fs::write(campaign, text).unwrap();
    let cfc = document(&["cfc", folder.path().to_str().unwrap()]);
    let file = folder
        .path()
        .join(format!("force/cut{}.txt", cuts.first().unwrap_or(&"05")));
    let inspect = document(&["inspect", file.to_str().unwrap()]);
    let lines = |list: &Value| {
        let list = list.as_array().unwrap();
        list.iter()
            .map(|w| w.as_str().unwrap())
            .collect::<Vec<_>>()
            .join("\n")
    };
    let told = (lines(&cfc["warnings"]), lines(&inspect["files"][0]["warnings"]));
    (cfc, told.0, told.1)
}

/// What is said of the sound campaign: it has few cuts, and a negative axial edge coefficient.
fn is_usual(line: &str) -> bool {
    ["the plan of", "Kae is negative", "at 81.4 m/min: two feeds"]
        .iter()
        .any(|start| line.starts_with(start))
}

fn told(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "{part:?} is not said in:\n{text}");
    }
}

fn coefficients(document: &Value) -> [f64; 6] {
    COEFFICIENTS.map(|key| document["pooled"][0][key]["value"].as_f64().unwrap())
}

/// Cutting coefficients within 0.2 %, edge coefficients within 0.1 N/mm of those of the sound records.
fn assert_unmoved(document: &Value, what: &str) {
    let sound = [929.79, 374.67, 218.55, 17.30, 16.51, -0.36];
    for (j, (value, sound)) in coefficients(document).into_iter().zip(sound).enumerate() {
        let limit = if j < 3 { 2e-3 * sound } else { 0.1 };
        assert!(
            (value - sound).abs() < limit,
            "{what}, {}: {value} for {sound}",
            COEFFICIENTS[j]
        );
    }
}

/// Only the fault is spoken of.
fn nothing_else(warnings: &str, fault: &str) {
    let other: Vec<&str> = warnings
        .lines()
        .filter(|l| !is_usual(l) && !l.contains(fault))
        .collect();
    assert!(other.is_empty(), "{other:?}");
}

#[test]
fn sound_records_are_silent() {
    let (cfc, warnings, inspect) = with(&["05"], |_| ());
    nothing_else(&warnings, "\0");
    assert_eq!(inspect, "");
    assert_unmoved(&cfc, "sound");
}

#[test]
fn spikes_are_named_and_left_out() {
    let (cfc, warnings, inspect) = with(&["05"], |rows| {
        for (k, i) in [741, 2310, 5207, 6001, 7999, 8111, 9050, 12345, 15820]
            .into_iter()
            .enumerate()
        {
            rows[i][3] += if k % 2 == 0 { 2000.0 } else { -1500.0 };
        }
    });
    told(
        &warnings,
        &["cut 05 (Fz: spike to 19", "N at 0.148 s, and 8 more): spikes"],
    );
    nothing_else(&warnings, "spikes");
    told(
        &inspect,
        &["Fz: 9 spikes of up to three samples (the first at 0.1482 s"],
    );
    assert_unmoved(&cfc, "spikes");
}

#[test]
fn stuck_samples_are_named_and_left_out() {
    let (cfc, warnings, inspect) = with(&["05"], |rows| {
        let held = rows[7000][3];
        rows[7000..7312].iter_mut().for_each(|r| r[3] = held);
    });
    told(
        &warnings,
        &["cut 05 (Fz: 312 samples stuck at 24.36 N from 1.400 s): stuck"],
    );
    nothing_else(&warnings, "stuck");
    told(&inspect, &["Fz: 312 samples stuck at 24.36 N from 1.4000 s"]);
    assert_unmoved(&cfc, "stuck");

    let (cfc, warnings, _) = with(&["05"], |rows| {
        let held = rows[2000][3];
        rows[2000..9000].iter_mut().for_each(|r| r[3] = held);
    });
    told(
        &warnings,
        &[
            "Fz: 7000 samples stuck",
            "42 % of the record bad",
            "left out of this cut",
        ],
    );
    assert_unmoved(&cfc, "mostly stuck");
}

#[test]
fn dropped_samples_are_named_and_filled() {
    let (cfc, warnings, inspect) = with(&["05"], |rows| {
        rows.drain(9000..9037);
        rows.drain(7000..7100);
    });
    told(
        &warnings,
        &["cut 05 (137 samples dropped at 2 places (the first after 1.399800 s)"],
    );
    nothing_else(&warnings, "dropped");
    told(&inspect, &["137 samples dropped at 2 places"]);
    assert_unmoved(&cfc, "dropped");
    // The waveform has lost no phase.
    let wave = &cfc["groups"][0]["waveform"];
    assert!(wave["chi2_per_value"].as_f64().unwrap() < 1.2, "{wave}");
}

#[test]
fn clipped_channels_are_named_and_left_out() {
    // A quarter of each peak.
    let (cfc, warnings, inspect) = with(&["13"], |rows| {
        rows.iter_mut().for_each(|r| r[2] = r[2].min(430.0))
    });
    told(
        &warnings,
        &[
            "cut 13 (Fy: ",
            " samples at 430.0 N from ",
            "choose a larger range",
        ],
    );
    told(&inspect, &["Fy: clipped at 430.0 N: ", "Choose a larger range"]);
    nothing_else(&warnings, "clipped");
    // Recorded Fy is the tool's Fx.
    assert!(cfc["cuts"][4]["averages"]["fx"].is_null() && cfc["cuts"][4]["averages"]["fy"].is_object());
    let values = coefficients(&cfc);
    for (value, sound) in values.into_iter().zip([929.79, 374.67, 218.55]) {
        assert!((value / sound - 1.0).abs() < 0.01, "{values:?}");
    }
}

#[test]
fn units_of_one_channel_of_one_cut_and_of_all_are_told() {
    let scale = |channels: &'static [usize], factor: f64| {
        move |rows: &mut Vec<[f64; 4]>| {
            rows.iter_mut()
                .for_each(|r| channels.iter().for_each(|c| r[*c] *= factor))
        }
    };
    let (_, warnings, inspect) = with(&["05"], scale(&[1], 1e-3));
    told(&warnings, &["cut 05: Fx spans 1163 times less", "kN called N"]);
    told(&inspect, &["Fx: spans 2.75e-1 N, 1163 times less", "kN called N"]);
    let (_, warnings, _) = with(&["05"], scale(&[1, 2, 3], 1.0 / 4.448_221_6));
    told(&warnings, &["cut 05 does not fit the others", "lbf called N?"]);
    let (_, warnings, _) = with(&CUTS, scale(&[1, 2, 3], 1e-3));
    told(
        &warnings,
        &["specific cutting energy comes out as 1.26 N/mm²", "kN called N?"],
    );
    let (_, warnings, _) = with(&CUTS, scale(&[2], 1.0 / 4.448_221_6));
    told(
        &warnings,
        &[
            "Fy looks mis-scaled in all cuts (lbf called N?)",
            "931, 375, 219 N/mm²",
        ],
    );
    // What the material is settles what the numbers alone leave open.
    let lbf = |name: &'static str| {
        with_toml(&CUTS, scale(&[1, 2, 3], 1.0 / 4.448_221_6), move |t| {
            t.replace("unnamed", name)
        })
        .1
    };
    told(
        &lbf("Aluminium 6061"),
        &["284 N/mm², that of Aluminium 6061", "lbf called N?"],
    );
    nothing_else(&lbf("unnamed"), "\0");
}

#[test]
fn swapped_channels_are_told() {
    let (_, warnings, _) = with(&CUTS, |rows| rows.iter_mut().for_each(|r| r.swap(1, 2)));
    told(
        &warnings,
        &[
            "look swapped in all cuts (what is called Fy is in truth Fx",
            "931, 375, 219 N/mm²",
        ],
    );
    let (_, warnings, _) = with(&CUTS, |rows| rows.iter_mut().for_each(|r| r.swap(1, 3)));
    told(
        &warnings,
        &["what is called Fz is in truth Fx, what is called Fx is in truth Fz"],
    );
    let (_, warnings, _) = with(&CUTS, |rows| rows.iter_mut().for_each(|r| r[1] = -r[1]));
    told(
        &warnings,
        &["of the wrong sign in all cuts (what is called Fx is in truth −Fx)"],
    );
    let (_, warnings, _) = with(&["05"], |rows| rows.iter_mut().for_each(|r| r.swap(1, 2)));
    told(
        &warnings,
        &["cut 05 does not fit the others", "Fx and Fy look swapped"],
    );
    let (_, _, inspect) = with(&["05"], |rows| rows.iter_mut().for_each(|r| r[2] = r[1]));
    told(&inspect, &["Fy: the same samples as Fx"]);
}

#[test]
fn a_wrong_speed_and_wrong_teeth_are_told_with_the_right_ones() {
    let slower = |toml: String| {
        let cut = toml.find("id = \"05\"").unwrap();
        let (before, after) = toml.split_at(cut);
        before.to_owned() + &after.replacen("1160.0", "1200.0", 1)
    };
    let (_, warnings, _) = with_toml(&[], |_| (), slower);
    told(
        &warnings,
        &[
            "cut 05 is left out",
            "its spindle ran at about 1160 rpm and not at the stated 1200",
        ],
    );
    let (_, warnings, _) = with_toml(&[], |_| (), |t| t.replace("teeth = 6", "teeth = 4"));
    told(
        &warnings,
        &[
            "all cuts: the tooth-passing line stands at 1.500 times",
            "the tool has 6 teeth and not 4",
        ],
    );
    // Fewer than listed: all that comes back in a turn does so six times, and nothing seven times.
    for (listed, ratio) in [("7", "0.857"), ("12", "0.500")] {
        let written = format!("teeth = {listed}");
        let (_, warnings, _) = with_toml(&[], |_| (), |t| t.replace("teeth = 6", &written));
        told(
            &warnings,
            &[
                &format!("all cuts: the tooth-passing line stands at {ratio} times"),
                &format!("the tool has 6 teeth and not {listed}"),
            ],
        );
    }
}

#[test]
fn drift_along_a_line_and_a_curve_and_no_air_are_told() {
    let (cfc, warnings, inspect) = with(&["05"], |rows| rows.iter_mut().for_each(|r| r[3] += 80.0 * r[0]));
    told(
        &warnings,
        &[
            "cut 05 (Fz by +73.",
            "N/s",
            "the line through the air is taken off",
        ],
    );
    told(&inspect, &["Fz: the zero drifts along a line by +73."]);
    assert_unmoved(&cfc, "line");
    let warming = |rows: &mut Vec<[f64; 4]>| {
        rows.iter_mut()
            .for_each(|r| r[3] += 150.0 * (1.0 - (-r[0] / 1.2).exp()))
    };
    let (_, warnings, inspect) = with(&["05"], warming);
    told(
        &warnings,
        &[
            "cut 05 (Fz by 10.02 N (exponential, time constant about 1.18 s)",
            "not a line",
            "nonlinear-drift",
        ],
    );
    told(
        &inspect,
        &["Fz: the zero drifts along a curve (exponential, time constant about 1.2"],
    );
    let (_, warnings, inspect) = with(&["05"], |rows| *rows = rows[5500..10_500].to_vec());
    told(&warnings, &["cut 05: no air cut in the record"]);
    told(&inspect, &["no air time seen before and after the cut"]);
}
