//! The sample reports in `reports/` say what the program says today. `scripts/sample_reports.py` writes them; which
//! commands were run and which numbers were kept stands in each sample's `summary.json`.

use std::path::{Path, PathBuf};

use lobestone::report::number::percent;
use serde_json::Value;

use crate::support::{copy_folder, program};

/// Half a unit in the fourth digit, to which the samples are rounded, is up to 5·10⁻⁴; the rest is room for the last
/// digits of a fit on another processor.
const RELATIVE: f64 = 1e-3;

/// Of a printed number, see [`same_line`].
const PRINTED: f64 = 0.01;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// A sample, and two copies of its campaign (`add` changes it): for the documents and for the printed text.
struct Sample {
    folder: PathBuf,
    summary: Value,
    copies: [tempfile::TempDir; 2],
}

impl Sample {
    fn new(name: &str) -> Self {
        let folder = root().join("reports").join(name);
        let summary: Value = serde_json::from_str(&read(&folder.join("summary.json"))).unwrap();
        let copies = [(); 2].map(|()| {
            let copy = tempfile::tempdir().unwrap();
            if let Some(campaign) = summary["campaign"].as_str() {
                let from = root().join("datasets/campaigns").join(campaign);
                copy_folder(&from, &copy.path().join(campaign));
            }
            copy
        });
        Self {
            folder,
            summary,
            copies,
        }
    }

    /// Every number of the summary against a fresh run, and every word of `loop.txt`.
    fn assert_up_to_date(&self) {
        let steps = self.summary["steps"].as_array().unwrap();
        let (documents, printed) = std::thread::scope(|scope| {
            let text = scope.spawn(|| {
                let step = |step: &Value| {
                    let command = step["command"].as_str().unwrap();
                    format!("$ lobestone {command}\n{}\n", run(command, &[], &self.copies[0]))
                };
                steps.iter().map(step).collect::<String>()
            });
            let document = |step: &Value| -> Value {
                let command = step["command"].as_str().unwrap();
                serde_json::from_str(&run(command, &["--json"], &self.copies[1])).unwrap()
            };
            let documents: Vec<Value> = steps.iter().map(document).collect();
            (documents, text.join().unwrap())
        });
        let mut wrong = vec![];
        for (step, document) in steps.iter().zip(&documents) {
            let values = step["values"].as_object().unwrap();
            assert!(!values.is_empty());
            for (path, sample) in values {
                let today = at(document, path);
                if !today.is_some_and(|today| same(sample, today)) {
                    wrong.push(format!(
                        "{} {path}: {sample} in the sample, {today:?} today",
                        step["command"]
                    ));
                }
            }
        }
        let sample = read(&self.folder.join("loop.txt"));
        wrong.extend(first_difference(&sample, &printed));
        assert!(
            wrong.is_empty(),
            "{}: run `python3 scripts/sample_reports.py` if this is as it should be\n{}",
            self.folder.display(),
            wrong.join("\n")
        );
    }

    /// A value of the summary that must be there.
    fn value(&self, step: usize, path: &str) -> &Value {
        let value = &self.summary["steps"][step]["values"][path];
        assert!(!value.is_null(), "step {step} has no {path}");
        value
    }

    /// The error of a step as the page states it.
    fn assert_page_states(&self, step: usize, path: &str) {
        let stated = percent(self.value(step, path).as_f64().unwrap());
        let page = read(&self.folder.join("report.html"));
        assert!(page.contains(&stated), "{path}: {stated} is not in the page");
    }

    /// Every image that the page links to lies next to it, and the sample stays small, in bytes.
    fn assert_complete_and_small(&self, most: u64) {
        let page = read(&self.folder.join("report.html"));
        for link in page.split("class=\"file\" href=\"").skip(1) {
            let image = self.folder.join(link.split('"').next().unwrap());
            crate::report::assert_png(&image);
        }
        let files = std::fs::read_dir(&self.folder).unwrap();
        let size: u64 = files.map(|f| f.unwrap().metadata().unwrap().len()).sum();
        assert!(size < most, "{size} bytes");
    }
}

/// What a command line prints that must succeed.
pub fn run(command: &str, more: &[&str], folder: &tempfile::TempDir) -> String {
    let output = program()
        .args(command.split(' '))
        .args(more)
        .current_dir(folder.path())
        .output()
        .unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command}: {stderr}");
    String::from_utf8(output.stdout).unwrap()
}

/// As `at` in the script: an entry of a list is found by position, or by any of its texts.
fn at<'a>(document: &'a Value, path: &str) -> Option<&'a Value> {
    path.split('/').try_fold(document, |value, key| match value {
        Value::Array(entries) => match key.parse::<usize>() {
            Ok(position) => entries.get(position),
            Err(_) => entries
                .iter()
                .find(|e| e.as_object().is_some_and(|e| e.values().any(|v| v == key))),
        },
        _ => value.get(key),
    })
}

fn same(sample: &Value, today: &Value) -> bool {
    match (sample.as_f64(), today.as_f64()) {
        (Some(sample), Some(today)) => (sample - today).abs() <= RELATIVE * sample.abs(),
        _ => sample == today,
    }
}

fn first_difference(sample: &str, today: &str) -> Option<String> {
    let found = sample.lines().zip(today.lines()).find(|(a, b)| !same_line(a, b));
    let count = |text: &str| text.lines().count();
    found
        .map(|(a, b)| format!("the sample has\n  {a}\nand today it is\n  {b}"))
        .or_else(|| {
            (count(sample) != count(today)).then(|| {
                format!(
                    "the sample has {} lines, today there are {}",
                    count(sample),
                    count(today)
                )
            })
        })
}

/// Words must be the same; numbers may differ by one in the last printed digit, which rounding decides, or by
/// [`PRINTED`]: where a fit stops depends on the processor's last bits, and what is derived from it (a standard error, a
/// p value) more than the fit itself. The numbers that matter stand in `summary.json`.
pub fn same_line(a: &str, b: &str) -> bool {
    let (a, b): (Vec<&str>, Vec<&str>) = (a.split_whitespace().collect(), b.split_whitespace().collect());
    a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| same_word(a, b))
}

fn same_word(a: &str, b: &str) -> bool {
    /// Bars of a table: their numbers stand next to them.
    const BARS: &str = "#█▉▊▋▌▍▎▏";
    let bar = |word: &str| !word.is_empty() && word.chars().all(|c| BARS.contains(c));
    let number = |word: &str| -> Option<(f64, f64)> {
        let plain = word.trim_matches(|c: char| !(c.is_ascii_digit() || "+-".contains(c)));
        let mantissa = plain.split('e').next()?;
        let decimals = mantissa.split_once('.').map_or(0, |(_, d)| d.len());
        let exponent: i32 = plain.split_once('e').map_or(Some(0), |(_, e)| e.parse().ok())?;
        Some((plain.parse().ok()?, 10f64.powi(exponent - decimals as i32)))
    };
    match (number(a), number(b)) {
        _ if a == b => true,
        (Some((x, unit)), Some((y, other))) => {
            (x - y).abs() <= (1.001 * unit.max(other)).max(PRINTED * x.abs())
        }
        _ => bar(a) && bar(b),
    }
}

#[test]
fn the_thesis_put_right() {
    let sample = Sample::new("thesis");
    sample.assert_up_to_date();
    sample.assert_complete_and_small(3_000_000);
    for path in ["fitted_frequency_error", "predicted_frequency_error"] {
        sample.assert_page_states(0, path);
    }
    // The whole page, but for the pixels and the hour.
    let words = |folder: &Path| {
        let page = read(&folder.join("report.html"));
        let (before, made) = page
            .split_once("<span>made ")
            .expect("the page says when it was made");
        let page = format!("{before}{}", made.split_once(" UTC</span>").unwrap().1);
        let lines: Vec<&str> = page.lines().filter(|l| !l.contains("<img")).collect();
        lines.join("\n")
    };
    let today = sample.copies[0].path().join("page");
    assert_eq!(first_difference(&words(&sample.folder), &words(&today)), None);
}

#[test]
fn a_hidden_effect_campaign_solved() {
    let sample = Sample::new("hidden-effect");
    sample.assert_up_to_date();
    // For the mouse: with plotly.js, and every FRF with every state of the model.
    sample.assert_complete_and_small(8_000_000);
    // What was put in: datasets/README.md.
    assert_eq!(sample.value(1, "effect"), "tool-flexibility");
    let noise = sample.value(2, "error/noise_floor_nrms").as_f64().unwrap();
    let left = sample.value(2, "error/held_out_nrms").as_f64().unwrap();
    assert!(left < 1.1 * noise, "{left} against {noise}");
    for path in ["error/nrms", "error/noise_floor_nrms", "error/held_out_nrms"] {
        sample.assert_page_states(2, path);
    }
}

#[test]
fn milling_with_wear() {
    let sample = Sample::new("milling-wear");
    sample.assert_up_to_date();
    sample.assert_complete_and_small(3_000_000);
    assert_eq!(sample.value(2, "effect"), "tool-wear");
    assert_eq!(sample.value(4, "verdict"), "none");
    // What was put in: datasets/README.md.
    let truth = [
        ("ktc_n_per_mm2", 1729.28),
        ("krc_n_per_mm2", 1170.28),
        ("kac_n_per_mm2", 514.42),
        ("kte_n_per_mm", 19.446),
        ("kre_n_per_mm", 18.159),
        ("kae_n_per_mm", 1.1568),
        ("tool-wear.growth[t]", 2.1966),
        ("tool-wear.growth[r]", 3.2033),
        ("tool-wear.growth[a]", 3.4337),
    ];
    for (name, truth) in truth {
        let value = |key: &str| {
            sample
                .value(3, &format!("parameters/{name}/{key}"))
                .as_f64()
                .unwrap()
        };
        let (fitted, std_error) = (value("value"), value("std_error"));
        assert!(
            (fitted - truth).abs() < 3.0 * std_error,
            "{name}: {fitted} ± {std_error} against {truth}"
        );
    }
    for path in ["error/nrms", "error/held_out_nrms"] {
        sample.assert_page_states(3, path);
    }
}

#[test]
fn a_changed_number_or_word_is_noticed() {
    let text = "error (nrms)    5.83 % -> 0.447 %, p = 3.2e-3\n";
    assert_eq!(first_difference(text, text), None);
    assert_eq!(
        first_difference(text, &text.replace("5.83", "5.84")),
        None,
        "rounding"
    );
    for (old, new) in [
        ("5.83", "5.95"),
        ("0.447", "0.457"),
        ("3.2e-3", "3.2e-2"),
        ("nrms", "rms"),
    ] {
        assert!(first_difference(text, &text.replace(old, new)).is_some(), "{new}");
    }
    let document = serde_json::json!({"a": [{"name": "x", "v": 1.0}, {"name": "y", "v": 2.0004}]});
    assert_eq!(at(&document, "a/y/v"), at(&document, "a/1/v"));
    assert!(same(&serde_json::json!(2.0), at(&document, "a/y/v").unwrap()));
    assert!(!same(&serde_json::json!(2.01), at(&document, "a/y/v").unwrap()));
    assert_eq!(at(&document, "a/z/v"), None);
}
