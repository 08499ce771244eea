//! The report as a page that answers to the mouse: what it holds, and, where there is a browser, that it works.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::Command;

use lobestone::builtin::SECOND_CELL;
use lobestone::campaign::Campaign;
use serde_json::Value;
use tempfile::TempDir;

use crate::report::{assert_self_contained, json_of};
use crate::support::blind;

/// What breaks out of attributes, of scripts and of JSON, and what plotly.js would take for markup.
const HOSTILE: &str = "p1</script><script>alert(1)</script>\"'<b>&amp;%{x}";

/// The built-in cell with something hidden in it, after that was added: three states of the model. Its first posture has a
/// hostile name.
fn hostile_campaign() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let dir = SECOND_CELL.write(folder.path()).unwrap();
    let file = dir.join("campaign.toml");
    let mut document: toml::Table = std::fs::read_to_string(&file).unwrap().parse().unwrap();
    document["name"] = HOSTILE.into();
    document["posture"].as_array_mut().unwrap()[0]["id"] = HOSTILE.into();
    document["frf"].as_array_mut().unwrap()[0]["posture"] = HOSTILE.into();
    std::fs::write(&file, document.to_string()).unwrap();
    json_of(&["add", dir.to_str().unwrap(), "tool-flexibility", "--json"]);
    (folder, dir)
}

fn report(dir: &Path, more: &[&str]) -> (PathBuf, String) {
    let arguments = [
        &["report", dir.to_str().unwrap(), "--no-diagnosis", "--json"],
        more,
    ]
    .concat();
    let json = json_of(&arguments);
    let path = PathBuf::from(json["html"].as_str().unwrap());
    let html = std::fs::read_to_string(&path).unwrap();
    (path, html)
}

/// RFC 4648, section 4.
fn from_base64(text: &str) -> Vec<u8> {
    let value = |letter: u8| match letter {
        b'A'..=b'Z' => letter - b'A',
        b'a'..=b'z' => letter - b'a' + 26,
        b'0'..=b'9' => letter - b'0' + 52,
        b'+' => 62,
        b'/' => 63,
        _ => panic!("{letter}"),
    };
    let letters: Vec<u8> = text.trim_end_matches('=').bytes().map(value).collect();
    let mut bytes = Vec::new();
    for four in letters.chunks(4) {
        let word = (0..4).fold(0u32, |word, i| {
            word << 6 | u32::from(four.get(i).copied().unwrap_or(0))
        });
        bytes.extend_from_slice(&word.to_be_bytes()[1..four.len()]);
    }
    bytes
}

/// What the element `id` of the page holds.
fn unpacked(html: &str, id: &str) -> String {
    let start = format!("<script type=\"application/octet-stream\" id=\"{id}\">");
    let packed = html
        .split(&start)
        .nth(1)
        .unwrap()
        .split("</script>")
        .next()
        .unwrap();
    let mut text = String::new();
    flate2::read::GzDecoder::new(&from_base64(packed)[..])
        .read_to_string(&mut text)
        .unwrap();
    text
}

/// Magnitudes out of the whole numbers that the page holds: differences, of calculated curves (`order` 2) differences of those.
fn magnitudes(packed: &Value, order: usize) -> Vec<f64> {
    let mut steps: Vec<i64> = packed
        .as_array()
        .unwrap()
        .iter()
        .map(|d| d.as_i64().unwrap())
        .collect();
    for _ in 0..order {
        let mut sum = 0;
        for step in &mut steps {
            sum += *step;
            *step = sum;
        }
    }
    steps.iter().map(|n| (*n as f64 * 1e-4).exp()).collect()
}

#[test]
fn an_interactive_report_holds_every_frf_and_every_state_of_the_model() {
    let (_folder, dir) = hostile_campaign();
    let (path, html) = report(&dir, &[]);
    assert_self_contained(&html);
    assert!(html.len() < 3_000_000, "{}", html.len());
    assert!(!html.contains(HOSTILE) && !html.contains("<script>alert"));
    assert!(unpacked(&html, "plotly").starts_with("/**\n* plotly.js (lobestone"));

    let figures: Value = serde_json::from_str(&unpacked(&html, "figures")).unwrap();
    let explorer = &figures["explorers"][0];
    let frfs = explorer["frfs"].as_array().unwrap();
    assert_eq!(
        frfs[0]["posture"], HOSTILE,
        "plain here: the page's script sets it as text"
    );
    // What plotly.js sets is escaped, since it knows some HTML.
    for figure in figures["figures"].as_array().unwrap() {
        let drawn = figure["data"].to_string() + &figure["layout"].to_string();
        assert!(
            !drawn.contains("<script") && !drawn.contains("%{x}</"),
            "{drawn:.200}"
        );
    }

    let models = explorer["models"].as_array().unwrap();
    let titles: Vec<&str> = models.iter().map(|m| m["title"].as_str().unwrap()).collect();
    assert_eq!(titles, ["robot file", "r0 baseline", "r1 + tool-flexibility"]);
    // The errors are those of the history and of compare.
    let compared = json_of(&["compare", dir.to_str().unwrap(), "--json"]);
    let history = json_of(&["history", dir.to_str().unwrap(), "--json"]);
    let percent = |value: &Value| lobestone::report::number::percent(value.as_f64().unwrap());
    assert_eq!(models[1]["error"], percent(&history["revisions"][0]["nrms"]));
    assert_eq!(models[2]["error"], percent(&compared["error"]["nrms"]));

    // Measured values as the files have them, to four digits; every model on the same lines.
    let (set, _) = Campaign::load(&dir).unwrap().load_frfs().unwrap();
    assert_eq!(set.frfs.len(), frfs.len());
    let lines = explorer["grids"][0].as_array().unwrap().len();
    assert!(lines > 100);
    for (k, frf) in frfs.iter().enumerate() {
        let measured = magnitudes(&frf["magnitude"], 1);
        assert_eq!(measured.len(), lines);
        for (shown, value) in measured.iter().zip(&set.frfs[k].receptance_m_per_n) {
            assert!((shown / value.norm() - 1.0).abs() < 1e-4, "FRF {k}");
        }
        for model in models {
            assert_eq!(model["magnitude"][k].as_array().unwrap().len(), lines);
            assert_eq!(model["phase"][k].as_array().unwrap().len(), lines);
        }
        // The model with the effect follows the measurement, the one without does not: by the logarithm's mean square.
        let off = |m: usize| {
            let model = magnitudes(&models[m]["magnitude"][k], 2);
            let squares = model.iter().zip(&measured).map(|(a, b)| (a / b).ln().powi(2));
            squares.sum::<f64>() / lines as f64
        };
        assert!(off(2) < off(0), "FRF {k}");
    }

    // The map of the error: one state a model, and every cell leads to an FRF of its posture and direction.
    let map = figures["figures"]
        .as_array()
        .unwrap()
        .iter()
        .find(|f| f["links"].is_object())
        .unwrap();
    assert_eq!(map["stages"].as_array().unwrap().len(), 3);
    let rows = map["layout"]["yaxis"]["ticktext"].as_array().unwrap();
    for (row, cells) in rows.iter().zip(map["links"]["frf"].as_array().unwrap()) {
        for cell in cells.as_array().unwrap() {
            let frf = &frfs[cell.as_u64().unwrap() as usize];
            let axis = |dof: &Value| dof.as_str().unwrap().chars().last().unwrap();
            let direction = format!(" {}{}", axis(&frf["response"]), axis(&frf["reference"]));
            assert!(row.as_str().unwrap().ends_with(&direction), "{row} {frf:.100}");
        }
    }

    if let Some(used) = in_a_browser(&path) {
        assert!(used["figures"].as_u64().unwrap() >= 8, "{used}");
        assert_eq!(used["models"], 3);
        let errors: Vec<f64> = used["errors_percent"]
            .as_array()
            .unwrap()
            .iter()
            .map(|e| e.as_f64().unwrap())
            .collect();
        assert!(errors[0] > errors[1] && errors[1] > 5.0 * errors[2], "{errors:?}");
    }
}

#[test]
fn a_static_report_has_no_scripts_and_the_same_images() {
    let folder = tempfile::tempdir().unwrap();
    let dir = SECOND_CELL.write(folder.path()).unwrap();
    let (_, live) = report(&dir, &[]);
    let (_, quiet) = report(&dir, &["--static"]);
    assert_self_contained(&quiet);
    assert!(!quiet.contains("<script") && !quiet.contains("<figure data-plot"));
    assert_eq!(quiet.matches("<img").count(), live.matches("<img").count());
    assert!(quiet.len() < 2_500_000 && quiet.len() < live.len());
}

/// Uses the page as a reader would (`scripts/check_report.py`). Without a browser this says so and checks nothing, unless
/// LOBESTONE_BROWSER_TEST says that there is one.
fn in_a_browser(page: &Path) -> Option<Value> {
    let found = |name: &str| {
        Command::new(name)
            .arg("--version")
            .output()
            .is_ok_and(|o| o.status.success())
    };
    if !(found("chromium") && found("python3")) {
        assert!(
            std::env::var_os("LOBESTONE_BROWSER_TEST").is_none(),
            "LOBESTONE_BROWSER_TEST is set, but chromium or python3 is missing"
        );
        eprintln!("skipped: no chromium or no python3, so the report was not opened in a browser");
        return None;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/check_report.py");
    let output = Command::new("python3").arg(script).arg(page).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{stderr}");
    Some(serde_json::from_slice(&output.stdout).unwrap())
}

#[test]
fn poles_are_picked_without_a_mouse_and_files_are_named_once() {
    let folder = tempfile::tempdir().unwrap();
    let file = blind("frf-9000").join("frf/p1.uff");
    let [file, out] = [file.as_path(), folder.path()].map(|p| p.to_str().unwrap());
    let json = json_of(&["modal", file, "--report", out, "--json"]);
    let path = PathBuf::from(json["report"]["html"].as_str().unwrap());
    let html = std::fs::read_to_string(&path).unwrap();
    // In the header, and in the command that repeats the analysis.
    let times = html.matches(&file.replace('/', "&#x2f;")).count();
    assert_eq!(times, 2);
    assert!(html.contains("FRF data"), "a fingerprint of the file");
    if let Some(used) = in_a_browser(&path) {
        assert!(used["picked"].as_str().unwrap().contains(" --pole "), "{used}");
    }
}
