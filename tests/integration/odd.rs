//! Odd files: what breaks readers, cuts records short or would drive a terminal. Each is refused or told, never believed.

use std::io::Write;
use std::path::{Path, PathBuf};

use lobestone::ingest::{MeasurementFile, read_file};

use super::support::*;

fn odd(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data/odd")
        .join(name)
}

fn refused(path: &Path, words: &[&str]) {
    let error = match read_file(path) {
        Ok(file) => panic!("{}: {}", path.display(), file.contents.describe()),
        Err(error) => error.to_string(),
    };
    for word in words {
        assert!(
            error.contains(word),
            "{}: {word:?} not in {error}",
            path.display()
        );
    }
    assert!(
        error.contains(&path.display().to_string()) && error.contains("remedy"),
        "{error}"
    );
}

fn told(name: &str, words: &[&str]) -> MeasurementFile {
    let file = read_file(&odd(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
    for word in words {
        assert!(
            file.warnings.iter().any(|w| w.contains(word)),
            "{name}: {word:?} not in {:?}",
            file.warnings
        );
    }
    file
}

#[test]
fn mat_files_that_are_damaged_say_what_is_missing() {
    let whole = told("mat5-whole.mat", &[]);
    assert_eq!(whole.contents.times[0].channels.len(), 2);
    told("mat5-cut.mat", &["Fy: the file ends within this variable"]);
    told(
        "mat5-corrupt-middle.mat",
        &["a variable at byte 1041, its name unreadable: damaged"],
    );
    told("mat5-badtag.mat", &["a variable at byte 3456"]);
    told("mat5-stdout.mat", &["unknown type 1 at byte 3456"]);
    refused(
        &odd("mat5-nested.mat"),
        &["no variable of this MAT-file can be read"],
    );
    refused(&odd("mat73-memory-hang.mat"), &["s: cannot be read"]);
}

/// A variable packed a thousandfold: 600 MB of zeros in 0.6 MB.
#[test]
fn a_packed_file_that_would_fill_the_memory_is_refused() {
    let mut file = b"MATLAB 5.0 MAT-file".to_vec();
    file.resize(124, b' ');
    file.extend([0, 1, b'I', b'M']);
    let mut packed = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
    let (head, size) = ([14_u32, 600_000_000].map(u32::to_le_bytes).concat(), 600_000_000);
    packed.write_all(&head).unwrap();
    for _ in 0..size / 1_000_000 {
        packed.write_all(&vec![0; 1_000_000]).unwrap();
    }
    let packed = packed.finish().unwrap();
    file.extend([15_u32, packed.len() as u32].map(u32::to_le_bytes).concat());
    file.extend(packed);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bomb.mat");
    std::fs::write(&path, file).unwrap();
    refused(&path, &["MB of memory granted to a file of"]);
}

/// Digits that nobody needs and a unit that does not exist are not shown.
#[test]
fn inspect_shows_rates_and_units_for_people() {
    let shown = |name: &str| lobestone(&["inspect", odd(name).to_str().unwrap()]).stdout;
    let drift = shown("dt_drift.csv");
    assert!(drift.contains("samples at 998.4088 Hz"), "{drift}");
    let whole = shown("mat5-whole.mat");
    assert!(!whole.contains("(file: )"), "{whole}");
}

#[test]
fn stdout_holds_one_document_whatever_the_file() {
    let seen = document(&["inspect", odd("mat5-stdout.mat").to_str().unwrap()]);
    assert_eq!(seen["files"][0]["channels"][0]["name"], "Fx");
}

#[test]
fn uneven_sampling_is_told_and_resampled() {
    for (name, rate, first_s) in [
        ("jitter.csv", 998.85, 0.001011),
        ("rate-change.csv", 1000.0, 0.0),
        ("dt_drift.csv", 998.4, 0.0),
    ] {
        let file = told(name, &["not evenly spaced in time"]);
        let record = &file.contents.times[0];
        assert!(
            (record.sample_rate_hz / rate - 1.0).abs() < 1e-3,
            "{name}: {}",
            record.sample_rate_hz
        );
        assert_eq!(record.start_s, first_s);
        // The files hold 100 N at 50 Hz, 1 N at 5 Hz … : compare with the file's own rows by straight lines between samples.
        let text = std::fs::read_to_string(odd(name)).unwrap();
        let rows: Vec<Vec<f64>> = text
            .lines()
            .skip(1)
            .map(|l| l.split(',').map(|v| v.parse().unwrap()).collect())
            .collect();
        let largest = rows.iter().map(|r| r[1].abs()).fold(0.0, f64::max);
        let samples = &record.channels[0].samples;
        let off = |row: &Vec<f64>| {
            let at = (row[0] - record.start_s) * record.sample_rate_hz;
            let k = (at.floor() as usize).min(samples.len() - 2);
            let between = samples[k] + (at - k as f64) * (samples[k + 1] - samples[k]);
            (between - row[1]).abs() / largest
        };
        let mean = rows.iter().map(off).sum::<f64>() / rows.len() as f64;
        assert!(mean < 0.03, "{name}: {mean}");
    }
}

#[test]
fn seconds_called_milliseconds_are_refused_or_put_right() {
    let folder = tempfile::tempdir().unwrap();
    let rows: String = (0..400)
        .map(|i| format!("{:.4},{}\n", f64::from(i) * 1e-3, i % 7))
        .collect();
    let path = folder.path().join("seconds.csv");
    std::fs::write(&path, format!("Time [ms],Fx [N]\n{rows}")).unwrap();
    refused(&path, &["seconds called ms", "time_s"]);
    // At 500 Hz, too; and milliseconds that are milliseconds stay what they are, at 100 kHz as well.
    let rows_every = |step: f64| -> String {
        (0..400)
            .map(|i| format!("{:.4},{}\n", f64::from(i) * step, i % 7))
            .collect()
    };
    std::fs::write(&path, format!("Time [ms],Fx [N]\n{}", rows_every(2e-3))).unwrap();
    refused(&path, &["seconds called ms", "time_s"]);
    for (step_ms, rate) in [(0.01, 100e3), (1.0, 1000.0)] {
        std::fs::write(&path, format!("Time [ms],Fx [N]\n{}", rows_every(step_ms))).unwrap();
        let file = read_file(&path).unwrap();
        assert_eq!(file.contents.times[0].sample_rate_hz, rate);
    }
    std::fs::write(
        &path,
        format!("Sampling rate [Hz]:,1000\nTime [ms],Fx [N]\n{rows}"),
    )
    .unwrap();
    let file = read_file(&path).unwrap();
    assert_eq!(file.contents.times[0].sample_rate_hz, 1000.0);
    assert!(
        file.warnings.iter().any(|w| w.contains("called wrongly")),
        "{:?}",
        file.warnings
    );
}

#[test]
fn records_that_are_short_or_cut_are_refused_or_told() {
    refused(&odd("u_hole.uff"), &["1X/1X", "announces 8 points and holds 6"]);
    let file = told("cut_midnumber.csv", &["fewer digits than those above"]);
    assert_eq!(file.contents.times[0].len(), 39);
}

#[test]
fn numbers_that_are_none_never_leave_a_reader() {
    refused(&odd("fuzz-lvm-1.lvm"), &["Tip", "no measured value"]);
    refused(&odd("fuzz-tdms-2.tdms"), &["Fx: a sampling rate of inf Hz"]);
    refused(&odd("fuzz-tdms-3.tdms"), &["acc", "no measured value"]);
    refused(&odd("fuzz-mat5-4.mat"), &["Fx: damaged"]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("huge.csv");
    std::fs::write(&path, "time_s,fx_n\n0,1\n0.001,1e300\n0.002,3\n").unwrap();
    refused(&path, &["fx_n: 1e300 in sample 2"]);
    std::fs::write(
        &path,
        "frequency_hz,re(1X/1X),im(1X/1X)\n1,1,1\n2,1e300,1\n3,1,1\n",
    )
    .unwrap();
    refused(&path, &["1X/1X: 1e300 at 2e0 Hz"]);
    // What stands at 0 Hz is left out wherever in the file it stands (found by the fuzz test, seed 2000072363).
    std::fs::write(
        &path,
        "frq,amp_real,amp_imag\n6.0,0.07,0.0\n0.0,-0.0002,-999999999999999999191\n7.0,0.1,0.0\n",
    )
    .unwrap();
    let file = read_file(&path).unwrap();
    assert_eq!(file.contents.frfs[0].frequency_hz, [6.0, 7.0]);
}

#[test]
fn what_would_drive_a_terminal_is_shown_escaped() {
    for name in ["esc2.uff", "c1.csv"] {
        for form in [&["inspect"][..], &["--json", "inspect"][..]] {
            let run = lobestone(&[form, &[odd(name).to_str().unwrap()]].concat());
            assert_eq!(run.status, Some(0), "{}", run.stderr);
            let both = run.stdout + &run.stderr;
            let harmful =
                |c: char| c.is_control() && c != '\n' && c != '\t' || ('\u{202a}'..='\u{202e}').contains(&c);
            assert!(!both.contains(harmful), "{name}: {both:?}");
            assert!(both.contains("u{"), "{name}: the name is shown");
        }
    }
}

#[cfg(unix)]
#[test]
fn pipes_and_devices_are_refused_and_not_waited_for() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe.csv");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
    assert!(made.success());
    refused(&pipe, &["a pipe or device, not a file"]);
    refused(Path::new("/dev/zero"), &["a pipe or device, not a file"]);
    refused(folder.path(), &["a folder, not a file"]);
}

#[test]
fn numbers_and_texts_of_a_campaign_that_cannot_be_are_refused_by_file_and_key() {
    for (from, to, words) in [
        (
            "[0.0, 0.0, 0.0]",
            "[1e300, 0.0, 0.0]",
            ["point[0].position_m", "1e300, which no physical quantity is"],
        ),
        (
            "[0.0, 0.0, 0.0]",
            "[1e-300, 0.0, 0.0]",
            ["point[0].position_m", "1e-300, which no physical quantity is"],
        ),
        (
            "id = \"p1\"",
            "id = \"p\\u001b[2J\"",
            ["posture[0].id", "control characters"],
        ),
    ] {
        let campaign = copy_of("frf-9112");
        let file = campaign.path().join("campaign.toml");
        let text = std::fs::read_to_string(&file).unwrap();
        std::fs::write(&file, text.replacen(from, to, 1)).unwrap();
        let run = lobestone(&["calibrate", campaign.path().to_str().unwrap()]);
        assert_eq!(run.status, Some(1));
        for word in words.into_iter().chain(["campaign.toml"]) {
            assert!(run.stderr.contains(word), "{word}: {}", run.stderr);
        }
        assert!(!run.stderr.contains('\u{1b}'), "{:?}", run.stderr);
    }
}

/// The same measurement twice is used once: standard errors stay those of the single data.
#[test]
fn doubled_files_do_not_shrink_standard_errors() {
    let single = copy_of("frf-9112");
    let doubled = copy_of("frf-9112");
    let text = std::fs::read_to_string(doubled.path().join("campaign.toml")).unwrap();
    let mut more = String::new();
    for (k, table) in text.split("[[frf]]").skip(1).enumerate() {
        let table = table.split("\n[").next().unwrap();
        let file = table
            .split("file = \"")
            .nth(1)
            .unwrap()
            .split('"')
            .next()
            .unwrap();
        let copy = format!("frf/copy-{k}.uff");
        std::fs::copy(doubled.path().join(file), doubled.path().join(&copy)).unwrap();
        more += &format!("\n[[frf]]{}\n", table.replace(file, &copy).trim_end());
    }
    append(doubled.path(), &more);
    let fit = |folder: &Path| document(&["calibrate", folder.to_str().unwrap()]);
    let (one, two) = (fit(single.path()), fit(doubled.path()));
    assert_eq!(one["parameters"], two["parameters"]);
    let warnings = two["warnings"].to_string();
    assert!(warnings.contains("used once"), "{warnings}");
}
