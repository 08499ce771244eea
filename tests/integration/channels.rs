//! `[[channel]]`: force files that do not say what they hold.

use std::path::Path;

use crate::support::{blind, copy_of, document, lobestone};

const CHANNELS: &str = r#"
[[channel]]
name = "fx"
column = 1
unit = "V"
gain = "250 N/V"
offset = 0.5
rate_hz = 5000.0

[[channel]]
name = "fy"
column = 3
unit = "mV"
gain = "4 mV/N"

[[channel]]
name = "fz"
column = 2
unit = "pC"
gain = "-3.9 pC/N"
"#;

/// The records as a recorder leaves them: no names, no time, volts and charge.
fn bare_records(folder: &Path) {
    for entry in std::fs::read_dir(folder.join("force")).unwrap() {
        let path = entry.unwrap().path();
        let text = std::fs::read_to_string(&path).unwrap().replace(',', ".");
        let rows: Vec<String> = text
            .lines()
            .filter(|l| l.starts_with(|c: char| c.is_ascii_digit()))
            .map(|l| {
                let v: Vec<f64> = l.split(';').map(|v| v.parse().unwrap()).collect();
                format!("{:.7} {:.5} {:.5}", v[1] / 250.0 + 0.5, -3.9 * v[3], 4.0 * v[2])
            })
            .collect();
        std::fs::write(path, rows.join("\n") + "\n").unwrap();
    }
}

#[test]
fn columns_of_volts_and_charge_without_names_give_the_same_coefficients() {
    let folder = copy_of("force-9400");
    bare_records(folder.path());
    let file = folder.path().join("campaign.toml");
    let toml = std::fs::read_to_string(&file).unwrap();
    let dir = folder.path().to_str().unwrap();
    let refused = lobestone(&["cfc", dir]);
    assert_eq!(refused.status, Some(1), "{}", refused.stdout);
    std::fs::write(
        &file,
        toml.replacen("[[cut]]", &format!("{CHANNELS}\n[[cut]]"), 1),
    )
    .unwrap();
    let (ours, theirs) = (
        document(&["cfc", dir]),
        document(&["cfc", blind("force-9400").to_str().unwrap()]),
    );
    for key in ["ktc_n_per_mm2", "krc_n_per_mm2", "kac_n_per_mm2", "kte_n_per_mm"] {
        let of = |d: &serde_json::Value| d["pooled"][0][key]["value"].as_f64().unwrap();
        assert!(
            (of(&ours) / of(&theirs) - 1.0).abs() < 1e-4,
            "{key}: {} {}",
            of(&ours),
            of(&theirs)
        );
    }
    let compared = document(&["compare", dir]);
    assert!(compared["error"]["nrms"].as_f64().unwrap() < 0.1, "{compared}");
}

#[test]
fn a_file_without_names_is_shown_with_the_lines_to_write() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("kanal.dat");
    let rows: String = (0..50)
        .map(|i| {
            format!(
                "{:.4}\t{}\t{}\t{}\n",
                i as f64 * 2e-4,
                (i % 7) as f64 * 0.1,
                -1.5,
                0.25
            )
        })
        .collect();
    std::fs::write(&file, rows).unwrap();
    let run = lobestone(&["inspect", file.to_str().unwrap()]);
    assert_eq!(run.status, Some(1));
    for part in [
        "4 columns",
        "rises by 0.0002",
        "[[channel]]",
        "column = 1",
        "name = \"fz\"",
        "gain = \"500 N/V\"",
    ] {
        assert!(run.stderr.contains(part), "{part}: {}", run.stderr);
    }
}

#[test]
fn what_cannot_be_is_refused_by_key() {
    let folder = copy_of("force-9400");
    let file = folder.path().join("campaign.toml");
    let toml = std::fs::read_to_string(&file).unwrap();
    for (channel, parts) in [
        ("name = \"fx\"\nin_file = \"Kanal 9\"", ["Kanal 9", "Fx"]),
        ("name = \"fq\"", ["name", "fx"]),
        ("name = \"fx\"\ngain = \"3 apples\"", ["gain", "N/V"]),
        ("name = \"fx\"\ngain = \"500 N/V\"", ["gain", "volts"]),
        ("name = \"fx\"\nunit = \"V\"", ["unit", "file says"]),
        ("name = \"fx\"\ncut = \"99\"", ["cut", "99"]),
    ] {
        let text = toml.replacen("[[cut]]", &format!("[[channel]]\n{channel}\n\n[[cut]]"), 1);
        std::fs::write(&file, text).unwrap();
        let run = lobestone(&["cfc", folder.path().to_str().unwrap()]);
        assert_eq!(run.status, Some(1), "{channel}: {}", run.stdout);
        for part in parts {
            assert!(run.stderr.contains(part), "{channel}: {part}: {}", run.stderr);
        }
    }
}

/// All records of a campaign in one file, each in channels of its own: every cut counts.
#[test]
fn several_cuts_in_one_file_are_several_cuts() {
    let folder = copy_of("force-9400");
    let dir = folder.path().to_str().unwrap();
    let before = document(&["cfc", dir]);
    let ids: Vec<String> = before["cuts"]
        .as_array()
        .unwrap()
        .iter()
        .map(|c| c["id"].as_str().unwrap().to_owned())
        .collect();
    let file = folder.path().join("campaign.toml");
    let toml = std::fs::read_to_string(&file).unwrap();
    let (mut columns, mut rules, mut text) = (Vec::new(), String::new(), toml.clone());
    for id in &ids {
        let name = toml
            .split("[[cut]]")
            .find(|t| t.contains(&format!("id = \"{id}\"")))
            .and_then(|t| t.split("file = \"").nth(1)?.split('"').next())
            .unwrap();
        let record = std::fs::read_to_string(folder.path().join(name))
            .unwrap()
            .replace(',', ".");
        let rows: Vec<Vec<String>> = record
            .lines()
            .filter(|l| l.starts_with(|c: char| c.is_ascii_digit()))
            .map(|l| l.split(';').skip(1).take(3).map(str::to_owned).collect())
            .collect();
        columns.push(rows);
        text = text.replace(&format!("\"{name}\""), "\"all.csv\"");
        for axis in ["x", "y", "z"] {
            rules +=
                &format!("[[channel]]\nname = \"f{axis}\"\nin_file = \"F{axis}_{id}\"\ncut = \"{id}\"\n");
        }
        rules += "rate_hz = 5000.0\n";
    }
    let length = columns.iter().map(Vec::len).min().unwrap();
    let head: Vec<String> = ids
        .iter()
        .flat_map(|id| ["x", "y", "z"].map(|a| format!("F{a}_{id}")))
        .collect();
    let mut table = head.join(",") + "\n";
    for i in 0..length {
        let row: Vec<&str> = columns
            .iter()
            .flat_map(|rows| rows[i].iter().map(String::as_str))
            .collect();
        table += &(row.join(",") + "\n");
    }
    std::fs::write(folder.path().join("all.csv"), table).unwrap();
    std::fs::write(&file, text.replacen("[[cut]]", &format!("{rules}\n[[cut]]"), 1)).unwrap();
    let after = document(&["cfc", dir]);
    let warnings = after["warnings"].to_string();
    assert!(!warnings.contains("same data"), "{warnings}");
    for key in ["ktc_n_per_mm2", "krc_n_per_mm2", "kac_n_per_mm2"] {
        let of = |d: &serde_json::Value| d["pooled"][0][key]["value"].as_f64().unwrap();
        assert!(
            (of(&after) / of(&before) - 1.0).abs() < 0.02,
            "{key}: {} {}",
            of(&after),
            of(&before)
        );
    }
    // One cut listed twice still counts once.
    let twice = std::fs::read_to_string(&file).unwrap();
    let first = twice.find("[[cut]]").unwrap();
    let end = twice[first + 7..]
        .find("[[cut]]")
        .map_or(twice.len(), |at| first + 7 + at);
    let again = twice[first..end].replacen("id = \"", "id = \"again-", 1);
    let rules: String = ["x", "y", "z"]
        .iter()
        .map(|a| {
            format!(
                "[[channel]]\nname = \"f{a}\"\nin_file = \"F{a}_{}\"\ncut = \"again-{0}\"\n",
                ids[0]
            )
        })
        .collect();
    std::fs::write(
        &file,
        format!(
            "{}{rules}rate_hz = 5000.0\n\n{again}{}",
            &twice[..first],
            &twice[first..]
        ),
    )
    .unwrap();
    let warnings = document(&["cfc", dir])["warnings"].to_string();
    assert!(warnings.contains("same data"), "{warnings}");
}
