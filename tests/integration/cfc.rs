//! `lobestone cfc` from files to JSON, on campaigns made here with known coefficients.

use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::Path;

use crate::support::{COEFFICIENTS, program};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

const RATE: f64 = 2000.0;
const TEETH: usize = 4;
/// Ktc Krc Kac Kte Kre Kae.
const TRUTH: [f64; 6] = [900.0, 380.0, 220.0, 18.0, 15.0, 3.0];

#[derive(Clone)]
struct MadeCut {
    id: String,
    rpm: f64,
    /// Spindle speed of the record, where it is not what the campaign says.
    true_rpm: f64,
    feed_mm: f64,
    /// Added to every force inside the cut, as a fault.
    gain: f64,
    /// Written part of the record, s.
    span_s: (f64, f64),
    dead_z: bool,
    material: Option<&'static str>,
    file: String,
}

fn plan() -> Vec<MadeCut> {
    let mut cuts = Vec::new();
    for rpm in [1200.0, 1800.0] {
        for feed_mm in [0.05, 0.1, 0.15] {
            let id = format!("{:02}", cuts.len() + 1);
            cuts.push(MadeCut {
                file: format!("force/cut{id}.csv"),
                id,
                rpm,
                true_rpm: rpm,
                feed_mm,
                gain: 1.0,
                span_s: (0.0, 3.0),
                dead_z: false,
                material: None,
            });
        }
    }
    cuts
}

/// Tool forces of docs/physics.md, "Cutting forces", summed over teeth and helix slices, 0° to 90° immersion, 2 mm deep.
fn force(k: &[f64; 6], turn_rad: f64, feed_mm: f64) -> [f64; 3] {
    let mut sum = [0.0; 3];
    let slices = 12;
    for tooth in 0..TEETH {
        for slice in 0..slices {
            let lag = 0.25 * (slice as f64 + 0.5) / slices as f64;
            let phi = (turn_rad + TAU * tooth as f64 / TEETH as f64 - lag).rem_euclid(TAU);
            if phi >= TAU / 4.0 {
                continue;
            }
            let (h, dz) = (feed_mm * phi.sin(), 2.0 / slices as f64);
            let (t, r, a) = (
                (k[0] * h + k[3]) * dz,
                (k[1] * h + k[4]) * dz,
                (k[2] * h + k[5]) * dz,
            );
            sum[0] += -t * phi.cos() - r * phi.sin();
            sum[1] += t * phi.sin() - r * phi.cos();
            sum[2] += a;
        }
    }
    sum
}

fn record(cut: &MadeCut, k: &[f64; 6], seed: u64) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut text = String::from("time_s,fx_n,fy_n,fz_n\n");
    for i in 0..(3.0 * RATE) as usize {
        let t = i as f64 / RATE;
        let mut noise = || 2.0 * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0);
        let noise = [noise(), noise(), noise()];
        if t < cut.span_s.0 || t >= cut.span_s.1 {
            continue;
        }
        let engaged = ((t - 0.7) / 0.2)
            .clamp(0.0, 1.0)
            .min(((2.5 - t) / 0.1).clamp(0.0, 1.0));
        let tool = force(k, TAU * cut.true_rpm / 60.0 * t, cut.feed_mm);
        let hum = 1.5 * (TAU * 50.0 * t).sin();
        // Recorded axes: the matrix in campaign.toml is its own inverse.
        let recorded = [-tool[1], -tool[0], tool[2]];
        let v: Vec<f64> = (0..3)
            .map(|j| {
                cut.gain * engaged * recorded[j]
                    + [8.0, -5.0, 12.0][j]
                    + [6.0, 3.0, -4.0][j] * t
                    + hum
                    + noise[j]
            })
            .collect();
        let z = if cut.dead_z { 0.0 } else { v[2] };
        writeln!(text, "{t:.4},{:.3},{:.3},{z:.3}", v[0], v[1]).unwrap();
    }
    text
}

fn write_campaign(dir: &Path, cuts: &[MadeCut], k: &[f64; 6]) {
    std::fs::create_dir_all(dir.join("force")).unwrap();
    let mut toml = format!(
        "schema = \"lobestone/campaign/1\"\nname = \"made\"\n\n[tool]\nkind = \"endmill\"\ndiameter_mm = 16.0\n\
         teeth = {TEETH}\nhelix_deg = 30.0\n\n[dynamometer]\n\
         tool_from_dyno = [[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]\n"
    );
    for (i, cut) in cuts.iter().enumerate() {
        let path = dir.join(&cut.file);
        if !path.exists() {
            std::fs::write(path, record(cut, k, i as u64)).unwrap();
        }
        write!(
            toml,
            "\n[[cut]]\nid = \"{}\"\nfile = \"{}\"\nprocess = \"milling\"\nspindle_rpm = {:.1}\n\
             feed_per_tooth_mm = {}\naxial_depth_mm = 2.0\nstart_deg = 0.0\nexit_deg = 90.0\n",
            cut.id, cut.file, cut.rpm, cut.feed_mm
        )
        .unwrap();
        if let Some(material) = cut.material {
            writeln!(toml, "material = \"{material}\"").unwrap();
        }
    }
    std::fs::write(dir.join("campaign.toml"), toml).unwrap();
}

fn cfc(dir: &Path, more: &[&str]) -> Value {
    let output = program()
        .args(["cfc", "--json"])
        .args(more)
        .arg(dir)
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    serde_json::from_slice(&output.stdout).unwrap()
}

fn run(cuts: &[MadeCut]) -> Value {
    let dir = tempfile::tempdir().unwrap();
    write_campaign(dir.path(), cuts, &TRUTH);
    cfc(dir.path(), &[])
}

fn warnings(document: &Value) -> String {
    let list = document["warnings"].as_array().unwrap();
    list.iter()
        .map(|w| w.as_str().unwrap())
        .collect::<Vec<_>>()
        .join("\n")
}

#[test]
fn every_group_finds_the_coefficients_and_has_the_contract_form() {
    let document = run(&plan());
    let groups = document["groups"].as_array().unwrap();
    assert_eq!(groups.len(), 2);
    for group in groups.iter().chain(document["pooled"].as_array().unwrap()) {
        assert_eq!(group["process"], "milling");
        assert!(group["cutting_speed_m_per_min"].as_f64().unwrap() > 50.0);
        for (key, truth) in COEFFICIENTS.iter().zip(TRUTH) {
            let value = group[key]["value"].as_f64().unwrap();
            let std_error = group[key]["std_error"].as_f64().unwrap();
            let tolerance = if key.ends_with("mm2") { 0.02 } else { 0.1 };
            assert!(
                (value / truth - 1.0).abs() < tolerance,
                "{key}: {value} for {truth}"
            );
            assert!(
                (value - truth).abs() < 5.0 * std_error,
                "{key}: {value} ± {std_error} for {truth}"
            );
        }
    }
    assert_eq!(groups[0]["cuts"], serde_json::json!(["01", "02", "03"]));
    for axis in ["x", "y", "z"] {
        assert!(document["r2"][axis].as_f64().unwrap() > 0.999);
    }
    assert_eq!(document["warnings"], serde_json::json!([]));
}

#[test]
fn one_feed_is_said_and_not_guessed() {
    let mut cuts = plan();
    cuts.retain(|c| c.feed_mm == 0.1);
    let document = run(&cuts);
    let group = &document["groups"][0];
    assert!(
        COEFFICIENTS.iter().all(|key| group[key]["value"].is_null()),
        "{group}"
    );
    let told = warnings(&document);
    assert!(
        told.contains("Ktc, Krc, Kte and Kre cannot be separated with one feed"),
        "{told}"
    );
}

#[test]
fn a_dead_channel_takes_its_own_coefficients_only() {
    let mut cuts = plan();
    cuts.iter_mut().for_each(|c| c.dead_z = true);
    let document = run(&cuts);
    let group = &document["groups"][0];
    assert!(group["kac_n_per_mm2"]["value"].is_null() && document["r2"]["z"].is_null());
    assert!((group["ktc_n_per_mm2"]["value"].as_f64().unwrap() / TRUTH[0] - 1.0).abs() < 0.02);
    let told = warnings(&document);
    assert!(told.contains("Fz") && told.contains("dead"), "{told}");
}

#[test]
fn records_without_air_are_told() {
    let mut cuts = plan();
    cuts.iter_mut().for_each(|c| c.span_s = (1.0, 2.4));
    let told = warnings(&run(&cuts));
    assert!(told.contains("all cuts: no air cut"), "{told}");
    let mut cuts = plan();
    cuts[1].span_s = (0.0, 2.4);
    cuts[2].span_s = (1.0, 3.0);
    let told = warnings(&run(&cuts));
    assert!(
        told.contains("cut 02: no air after") && told.contains("cut 03: no air before"),
        "{told}"
    );
}

#[test]
fn a_wrong_speed_a_spoilt_cut_and_a_double_file_are_named() {
    let mut cuts = plan();
    cuts[4].true_rpm = 1900.0;
    let told = warnings(&run(&cuts));
    assert!(told.contains("cut 05 is left out"), "{told}");
    assert!(told.contains("its spindle ran at about 1900 rpm"), "{told}");

    let mut cuts = plan();
    cuts[3].gain = 1.3;
    let told = warnings(&run(&cuts));
    assert!(told.contains("cut 04 does not fit the others"), "{told}");

    let mut cuts = plan();
    cuts[2].file = cuts[1].file.clone();
    let told = warnings(&run(&cuts));
    assert!(told.contains("cut 03 holds the same data as cut 02"), "{told}");
    assert!(told.contains("no usable cut at 1200 rpm with 0.15 mm"), "{told}");
}

#[test]
fn an_unusable_record_is_left_out_by_name_and_nothing_but_such_is_an_error() {
    let dir = tempfile::tempdir().unwrap();
    write_campaign(dir.path(), &plan(), &TRUTH);
    std::fs::write(dir.path().join("force/cut02.csv"), "time_s,fx_n,fy_n,fz_n\n").unwrap();
    let document = cfc(dir.path(), &[]);
    let told = warnings(&document);
    assert!(told.contains("cut 02 is left out"), "{told}");
    assert_eq!(document["groups"][0]["cuts"], serde_json::json!(["01", "03"]));
    assert!(told.contains("two feeds only"), "{told}");

    for cut in plan() {
        std::fs::write(dir.path().join(&cut.file), "time_s,fx_n,fy_n,fz_n\n").unwrap();
    }
    let output = program()
        .args(["cfc", "--json"])
        .arg(dir.path())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(output.stdout.is_empty());
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.contains("none of the 6 cuts"), "{message}");
}

#[test]
fn the_edge_constraint_holds_a_negative_edge_at_zero() {
    let dir = tempfile::tempdir().unwrap();
    let negative = [900.0, 380.0, 220.0, 18.0, 15.0, -1.5];
    write_campaign(dir.path(), &plan(), &negative);
    let free = cfc(dir.path(), &[]);
    assert!(free["groups"][0]["kae_n_per_mm"]["value"].as_f64().unwrap() < -1.3);
    assert!(warnings(&free).contains("--nonnegative-edges"));
    let held = cfc(dir.path(), &["--nonnegative-edges"]);
    let kae = &held["groups"][0]["kae_n_per_mm"];
    assert_eq!(kae["value"], 0.0);
    assert_eq!(kae["constraint_active"], true);
    assert!((held["groups"][0]["ktc_n_per_mm2"]["value"].as_f64().unwrap() / 900.0 - 1.0).abs() < 0.02);
    assert!(warnings(&held).contains("Kae is held at zero"));
}

/// Cuts of two materials at both speeds and all feeds, the second with 15 % higher forces throughout.
#[test]
fn materials_are_fitted_apart_and_compared() {
    let mut cuts = plan();
    cuts.iter_mut().for_each(|c| c.material = Some("cast"));
    for mut cut in plan() {
        cut.id = format!("p{}", cut.id);
        cut.file = format!("force/cut{}.csv", cut.id);
        (cut.gain, cut.material) = (1.15, Some("printed"));
        cuts.push(cut);
    }
    let document = run(&cuts);
    let materials = |key: &str| -> Vec<&str> {
        let list = document[key].as_array().unwrap().iter();
        list.map(|g| g["material"].as_str().unwrap()).collect()
    };
    assert_eq!(materials("pooled"), ["cast", "printed"]);
    assert_eq!(materials("groups"), ["cast", "cast", "printed", "printed"]);
    let entries = document["materials"].as_array().unwrap();
    assert_eq!(entries.len(), 6);
    for entry in entries {
        assert_eq!(
            (&entry["material"], &entry["reference"]),
            (&"printed".into(), &"cast".into())
        );
        // 15 % of a small axial edge force is within its error; the leading coefficients are not.
        let (ratio, error) = (&entry["ratio"]["value"], &entry["ratio"]["std_error"]);
        let off = (ratio.as_f64().unwrap() - 1.15).abs();
        assert!(off < 4.0 * error.as_f64().unwrap(), "{entry}");
    }
    assert_eq!(entries[0]["reading"], "rises", "{}", entries[0]);
    assert!(entries[0]["p_value"].as_f64().unwrap() < 1e-4);
    for trend in document["trends"].as_array().unwrap() {
        assert_eq!(trend["reading"], "none", "{trend}");
    }
}

#[test]
fn the_answer_does_not_depend_on_the_number_of_threads() {
    let dir = tempfile::tempdir().unwrap();
    write_campaign(dir.path(), &plan(), &TRUTH);
    let out = |threads: &str| {
        let mut command = program();
        command
            .env("RAYON_NUM_THREADS", threads)
            .args(["cfc", "--json"])
            .arg(dir.path());
        command.output().unwrap().stdout
    };
    assert_eq!(out("1"), out("3"));
}

/// Thrust and torque of a 10 mm drill, with entry; one feed or several.
fn write_holes(dir: &Path, feeds: &[f64]) {
    std::fs::create_dir_all(dir.join("force")).unwrap();
    let mut toml = String::from(
        "schema = \"lobestone/campaign/1\"\nname = \"holes\"\n\n[tool]\nkind = \"drill\"\ndiameter_mm = 10.0\n\
         teeth = 2\nhalf_point_angle_deg = 59.0\nweb_thickness_mm = 1.5\n",
    );
    let kappa = 59f64.to_radians();
    for (i, feed) in feeds.iter().enumerate() {
        let mut rng = ChaCha8Rng::seed_from_u64(i as u64);
        let (rpm, depth, inner, outer) = (1200.0, 6.0, 2.0, 5.0);
        let h = feed / 2.0 * kappa.sin();
        let speed = feed * rpm / 60.0;
        let end = 0.8 + ((outer - inner) / kappa.tan() + depth) / speed;
        let mut text = String::from("time_s,fx_n,fy_n,fz_n,mz_nm\n");
        for j in 0..((end + 0.6) * 1000.0) as usize {
            let t = j as f64 / 1000.0;
            let engaged = if (0.8..end).contains(&t) { 1.0 } else { 0.0 };
            let r = f64::min(outer, inner + (t - 0.8).max(0.0) * speed * kappa.tan());
            let thrust = engaged * 2.0 * (400.0 * h + 9.0) * (r - inner);
            let torque =
                engaged * 2.0 * (700.0 * h + 12.0) * (r * r - inner * inner) / (2.0 * kappa.sin()) / 1000.0;
            let mut noise = || rng.random_range(-1.0..1.0);
            let (x, y, z, m) = (noise(), noise(), noise(), noise());
            let torque = torque + 0.05 - 0.003 * t + 0.01 * m;
            writeln!(
                text,
                "{t:.4},{x:.3},{y:.3},{:.3},{torque:.5}",
                thrust + 4.0 + 0.5 * t + z
            )
            .unwrap();
        }
        let id = i + 1;
        std::fs::write(dir.join(format!("force/{id}.csv")), text).unwrap();
        write!(
            toml,
            "\n[[cut]]\nid = \"{id}\"\nfile = \"force/{id}.csv\"\nprocess = \"drilling\"\nspindle_rpm = {rpm:.1}\n\
             feed_per_rev_mm = {feed}\npilot_diameter_mm = 4.0\nhole_depth_mm = {depth:.1}\n"
        )
        .unwrap();
    }
    std::fs::write(dir.join("campaign.toml"), toml).unwrap();
}

#[test]
fn drilling_gives_the_coefficients_of_its_own_baseline() {
    let dir = tempfile::tempdir().unwrap();
    write_holes(dir.path(), &[0.05, 0.1, 0.2]);
    let document = cfc(dir.path(), &[]);
    let group = &document["groups"][0];
    assert_eq!(group["process"], "drilling");
    for (key, truth, tolerance) in [
        ("ktc_n_per_mm2", 700.0, 0.01),
        ("kte_n_per_mm", 12.0, 0.05),
        ("kfc_n_per_mm2", 400.0, 0.01),
        ("kfe_n_per_mm", 9.0, 0.05),
    ] {
        let value = group[key]["value"].as_f64().unwrap();
        assert!(
            (value / truth - 1.0).abs() < tolerance,
            "{key}: {value} for {truth}"
        );
    }
    assert!(document["r2"]["mz"].as_f64().unwrap() > 0.999);

    let dir = tempfile::tempdir().unwrap();
    write_holes(dir.path(), &[0.1, 0.1]);
    let told = warnings(&cfc(dir.path(), &[]));
    assert!(
        told.contains("Kfc and Kfe cannot be separated with one feed"),
        "{told}"
    );
}
