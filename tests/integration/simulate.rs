//! `lobestone simulate`: campaigns whose truth is known.

use std::path::{Path, PathBuf};

use lobestone::campaign::Campaign;
use lobestone::effects::{Registry, STRUCTURAL};
use lobestone::identify::StructureCase;
use serde_json::Value;

use crate::support::{document, lobestone};

/// A small campaign: 3 postures, 9 FRFs each, 88 lines.
const SMALL: [&str; 6] = ["--postures", "3", "--points", "tool", "--lines-hz", "1"];

struct Simulated {
    _folder: tempfile::TempDir,
    dir: PathBuf,
}

impl Simulated {
    fn new(options: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let dir = folder.path().join("cell");
        let said = document(&[&["simulate", "--out", dir.to_str().unwrap()], options].concat());
        assert_eq!(said["dir"], dir.to_str().unwrap());
        assert_eq!(said["truth"], Self::truth_file(&dir).to_str().unwrap());
        Simulated { _folder: folder, dir }
    }

    fn truth_file(dir: &Path) -> PathBuf {
        dir.with_file_name("cell.truth.json")
    }

    fn truth(&self) -> Value {
        serde_json::from_slice(&std::fs::read(Self::truth_file(&self.dir)).unwrap()).unwrap()
    }

    fn path(&self) -> &str {
        self.dir.to_str().unwrap()
    }

    fn case(&self) -> StructureCase {
        StructureCase::load(&Campaign::load(&self.dir).unwrap()).unwrap()
    }

    /// Path within the folder and content of every file.
    fn files(&self) -> Vec<(String, Vec<u8>)> {
        let mut all = vec![(
            "campaign.toml".into(),
            std::fs::read(self.dir.join("campaign.toml")).unwrap(),
        )];
        for entry in std::fs::read_dir(self.dir.join("frf")).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            all.push((name, std::fs::read(path).unwrap()));
        }
        all.sort();
        all
    }
}

fn with<'a>(options: &[&'a str]) -> Vec<&'a str> {
    [&SMALL[..], options].concat()
}

#[test]
fn the_same_seed_gives_the_same_bytes() {
    let options = with(&[
        "--effect",
        "local-resonator",
        "--visibility",
        "30",
        "--seed",
        "11",
    ]);
    let (a, b) = (Simulated::new(&options), Simulated::new(&options));
    assert_eq!(a.files(), b.files());
    assert_eq!(a.truth(), b.truth());
    let other = Simulated::new(&with(&["--seed", "12"]));
    assert_ne!(a.files(), other.files());
    assert_ne!(a.truth()["joint_stiffness"], other.truth()["joint_stiffness"]);
}

/// Seed by seed, noise is the only thing that the noise changes.
#[test]
fn noise_changes_neither_robot_nor_postures() {
    let (a, b) = (
        Simulated::new(&with(&["--noise", "0.01"])),
        Simulated::new(&with(&["--noise", "0.1"])),
    );
    assert_eq!(a.files()[0], b.files()[0]);
    assert_eq!(a.truth()["joint_stiffness"], b.truth()["joint_stiffness"]);
    assert_ne!(a.files()[1], b.files()[1]);
}

#[test]
fn the_folder_is_blind_and_loads() {
    let cell = Simulated::new(&with(&["--effect", "base-compliance", "--kind", "dirty"]));
    let toml = String::from_utf8(cell.files()[0].1.clone()).unwrap();
    assert!(
        !toml.contains("compliance") && toml.contains("mass_tolerance = 0.05"),
        "{toml}"
    );
    let file = cell.dir.join("frf/p1.uff");
    let seen = document(&["inspect", file.to_str().unwrap()]);
    assert_eq!(seen["files"][0]["kind"], "frf");
    assert_eq!(seen["files"][0]["channels"].as_array().unwrap().len(), 9);
    assert_eq!(seen["files"][0]["warnings"], serde_json::json!([]));
    let compared = document(&["compare", cell.path()]);
    assert_eq!(compared["by_posture"].as_object().unwrap().len(), 3);
    assert!(compared["error"]["nrms"].as_f64().unwrap() > 0.0);
}

/// Without noise and without an effect the calibration must find what was put in.
#[test]
fn a_noise_free_campaign_calibrates_to_its_truth() {
    let cell = Simulated::new(&with(&["--noise", "0", "--seed", "5"]));
    let truth = cell.truth();
    let found = document(&["calibrate", cell.path()]);
    assert_eq!(found["converged"], true);
    let parameters = found["parameters"].as_array().unwrap();
    for (i, stiffness) in truth["joint_stiffness"].as_array().unwrap().iter().enumerate() {
        let (value, expected) = (
            parameters[i]["value"].as_f64().unwrap(),
            stiffness.as_f64().unwrap(),
        );
        assert!(
            (value / expected - 1.0).abs() < 1e-4,
            "joint {}: {value} {expected}",
            i + 1
        );
    }
    let zeta = parameters[6]["value"].as_f64().unwrap();
    assert!((zeta / truth["zeta"].as_f64().unwrap() - 1.0).abs() < 1e-4);
}

#[test]
fn formats_and_quantities_hold_the_same_data() {
    let reference = Simulated::new(&SMALL).case().data;
    for format in ["uff-ascii", "uff-binary", "csv"] {
        for quantity in ["receptance", "mobility", "accelerance"] {
            let other = Simulated::new(&with(&["--format", format, "--quantity", quantity]));
            let other = other.case().data;
            assert_eq!(reference.frfs().count(), 27);
            assert_eq!(other.frfs().count(), 27);
            for ((a, x), (b, y)) in reference.frfs().zip(other.frfs()) {
                assert_eq!(x.name, y.name);
                assert_eq!(a.frequency_hz.len(), 88);
                for (k, (f, g)) in a.frequency_hz.iter().zip(&b.frequency_hz).enumerate() {
                    assert!((f - g).abs() < 1e-9 * f);
                    let size = x.receptance[k].norm();
                    assert!(
                        (x.receptance[k] - y.receptance[k]).norm() < 1e-9 * size,
                        "{format} {quantity}"
                    );
                }
            }
        }
    }
}

/// Value by its path `name` or `name[i]` in the truth's parameters.
fn parameter(truth: &Value, name: &str) -> f64 {
    match name.trim_end_matches(']').split_once('[') {
        Some((list, i)) => &truth["parameters"][list][i.parse::<usize>().unwrap()],
        None => &truth["parameters"][name],
    }
    .as_f64()
    .unwrap_or_else(|| panic!("{name}: {truth}"))
}

/// χ² per complex value of what the truth file says against the files, σ from the truth file.
fn chi2_per_value(cell: &Simulated) -> f64 {
    let truth = cell.truth();
    let StructureCase { mut model, data, .. } = cell.case();
    let summary = data.summary();
    let mut values: Vec<f64> = Vec::new();
    for p in &model.parameters {
        let number = |key: &str, i: usize| truth[key][i].as_f64().unwrap();
        let index = || p.name[6..].chars().next().unwrap().to_digit(10).unwrap() as usize - 1;
        values.push(match p.name.as_str() {
            "damping-ratio" => truth["zeta"].as_f64().unwrap(),
            name if name.starts_with("joint-") => number("joint_stiffness", index()),
            name if name.starts_with("link-") => {
                let link = name[5..6].parse::<usize>().unwrap() - 1;
                number("mass_scale", link) * p.nominal
            }
            name => panic!("{name}"),
        });
    }
    let effect = truth["effect"].as_str().unwrap();
    if effect != "none" {
        let name = match truth["site"].as_str() {
            Some(site) => format!("{effect}@{site}"),
            None => effect.to_string(),
        };
        let instance = Registry::structure()
            .find(&model.robot.spec, &name)
            .into_iter()
            .find(|i| {
                let label = i.variant_label();
                label.is_none_or(|(key, value)| truth["parameters"][key] == value)
            })
            .unwrap();
        let own = instance.effect.parameters(instance.at(), &model.known(&summary));
        values.extend(own.iter().map(|p| parameter(&truth, &p.name)));
        model = model.with_effect(instance, &model.known(&summary));
    }
    let theta: Vec<f64> = model
        .parameters
        .iter()
        .zip(&values)
        .map(|(p, v)| p.internal(*v))
        .collect();
    let noise = |i: usize| truth["noise"][i].as_f64().unwrap();
    let predicted = model.predict(&theta, &data).unwrap();
    let mut sum = 0.0;
    for ((_, frf), model) in data.frfs().zip(&predicted) {
        for (h, m) in frf.receptance.iter().zip(model) {
            sum += (h - m).norm_sqr() / ((noise(0) * m.norm()).powi(2) + noise(1).powi(2));
        }
    }
    sum / data.value_count() as f64
}

/// The truth file explains the files down to the noise, whatever is hidden; without the effect it does not.
#[test]
fn the_truth_of_every_effect_reproduces_the_data() {
    for effect in STRUCTURAL {
        for kind in ["careful", "dirty"] {
            let levels = ["--force-levels", "200,50"];
            let cell = Simulated::new(&with(
                &[
                    &["--effect", effect.id(), "--kind", kind, "--seed", "8"],
                    &levels[..],
                ]
                .concat(),
            ));
            assert_eq!(cell.truth()["effect"], effect.id());
            assert_eq!(cell.case().data.blocks.len(), 6);
            // 4752 complex values: the mean has a standard deviation of 0.0145.
            let chi2 = chi2_per_value(&cell);
            assert!((chi2 - 1.0).abs() < 0.06, "{} {kind}: {chi2}", effect.id());
        }
    }
    let spoilt = Simulated::new(&with(&["--effect", "payload:mass_kg=30"]));
    let mut truth = spoilt.truth();
    assert_eq!(truth["parameters"]["mass_kg"], 30.0);
    truth["parameters"]["mass_kg"] = 20.0.into();
    std::fs::write(Simulated::truth_file(&spoilt.dir), truth.to_string()).unwrap();
    assert!(chi2_per_value(&spoilt) > 2.0);
}

#[test]
fn effects_are_made_as_visible_as_asked_for() {
    for (effect, sigmas) in [("payload", 6.0), ("link-flexibility", 80.0), ("time-delay", 20.0)] {
        let cell = Simulated::new(&with(&["--effect", effect, "--visibility", &sigmas.to_string()]));
        let seen = cell.truth()["visibility"]["sigmas"].as_f64().unwrap();
        assert!(
            (seen / sigmas - 1.0).abs() < 0.05,
            "{effect}: {seen} for {sigmas}"
        );
    }
    let weak = Simulated::new(&with(&["--effect", "payload", "--strength", "0.1"])).truth();
    let full = Simulated::new(&with(&["--effect", "payload"])).truth();
    let ratio = parameter(&weak, "mass_kg") / parameter(&full, "mass_kg");
    assert!((ratio - 0.1).abs() < 1e-9);
    assert!(
        weak["visibility"]["sigmas"].as_f64().unwrap() < 0.3 * full["visibility"]["sigmas"].as_f64().unwrap()
    );
}

#[test]
fn several_effects_sites_and_choices_are_taken_as_given() {
    let cell = Simulated::new(&with(&[
        "--effect",
        "local-resonator@link-3:direction=y,frequency_hz=12.5",
        "--effect",
        "joint-transverse-compliance@joint-4",
    ]));
    let truth = cell.truth();
    assert_eq!(truth["effect"], "local-resonator");
    assert_eq!(truth["site"], "link-3");
    assert_eq!(truth["parameters"]["direction"], "y");
    assert!((parameter(&truth, "frequency_hz") - 12.5).abs() < 1e-9);
    assert_eq!(truth["also"][0]["effect"], "joint-transverse-compliance");
    assert_eq!(truth["also"][0]["site"], "joint-4");
}

/// Physics outside the library: named only in the truth, and no effect of the library explains it.
#[test]
fn unknown_physics_stays_unexplained() {
    for kind in ["viscoelastic-joints", "cross-axis-leak"] {
        let cell = Simulated::new(&with(&["--unknown", kind]));
        let truth = cell.truth();
        assert_eq!(truth["effect"], "unknown");
        assert_eq!(truth["parameters"]["kind"], kind);
        let left = truth["nearest_library_effect"]["excess_chi2_per_value"]
            .as_f64()
            .unwrap();
        let seen = truth["visibility"]["excess_chi2_per_value"].as_f64().unwrap();
        assert!(left > 0.5 && left <= 1.001 * seen, "{kind}: {left} of {seen}");
    }
}

#[test]
fn random_campaigns_load() {
    for seed in ["1", "2", "3"] {
        let cell = Simulated::new(&["--random", "--seed", seed, "--lines-hz", "3"]);
        assert!(cell.case().data.value_count() > 100);
        assert_eq!(cell.truth()["seed"].to_string(), seed);
    }
}

/// A robot from a file goes into the campaign with it.
#[test]
fn another_robot_is_copied_into_the_campaign() {
    let folder = tempfile::tempdir().unwrap();
    let robot = folder.path().join("arm.toml");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets/irb6640/robot.toml");
    std::fs::copy(source, &robot).unwrap();
    let cell = Simulated::new(&with(&["--robot", robot.to_str().unwrap(), "--noise", "0.01"]));
    assert!(cell.dir.join("robot.toml").is_file());
    let chi2 = chi2_per_value(&cell);
    assert!((chi2 - 1.0).abs() < 0.1, "{chi2}");
}

#[test]
fn what_is_there_is_not_overwritten() {
    let cell = Simulated::new(&SMALL);
    let before = cell.files();
    let again = |dir: &Path| lobestone(&[&["simulate", "--out", dir.to_str().unwrap()], &SMALL[..]].concat());
    let run = again(&cell.dir);
    assert_eq!(run.status, Some(1));
    assert!(
        run.stderr.contains("not empty") && run.stderr.contains("--out"),
        "{}",
        run.stderr
    );
    assert_eq!(cell.files(), before);
    // An old truth file is worth as much.
    std::fs::remove_dir_all(&cell.dir).unwrap();
    let run = again(&cell.dir);
    assert!(run.stderr.contains("truth"), "{}", run.stderr);
    assert!(!cell.dir.exists());
    // An empty folder is taken.
    std::fs::remove_file(Simulated::truth_file(&cell.dir)).unwrap();
    std::fs::create_dir(&cell.dir).unwrap();
    assert_eq!(again(&cell.dir).status, Some(0));
    let left_over = std::fs::read_dir(cell.dir.parent().unwrap()).unwrap();
    assert_eq!(left_over.count(), 2);
}

#[test]
fn wrong_wishes_are_refused_plainly() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("cell");
    for (options, words) in [
        (vec!["--effect", "paylod"], "did you mean payload?"),
        (vec!["--effect", "payload@link-3"], "no site"),
        (
            vec!["--effect", "local-resonator@link-7"],
            "link-2, link-3, link-4",
        ),
        (vec!["--effect", "payload:mas_kg=3"], "did you mean mass_kg?"),
        (vec!["--effect", "payload:mass_kg=-3"], "mass_kg = -3"),
        (vec!["--effect", "payload:mass_kg=NaN"], "mass_kg = NaN"),
        (vec!["--effect", "local-resonator:direction=w"], "x, y, z"),
        (
            vec!["--effect", "payload", "--effect", "payload"],
            "same effect twice",
        ),
        (
            vec!["--effect", "amplitude-dependent-stiffness"],
            "--force-levels",
        ),
        (vec!["--unknown", "ghosts"], "viscoelastic-joints"),
        (vec!["--lines-hz", "50"], "--lines-hz"),
        (vec!["--lines-hz", "0"], "--lines-hz"),
        (vec!["--lines-hz", "0.0002"], "--lines-hz"),
        (vec!["--noise=-1"], "--noise"),
        (vec!["--noise", "inf"], "--noise"),
        (vec!["--postures", "0"], "--postures"),
        (vec!["--mass-error", "2"], "--mass-error"),
        (vec!["--force-levels", "50,50"], "--force-levels"),
        (vec!["--robot", "kr210"], "irb6640"),
    ] {
        let run = lobestone(&[&["simulate", "--out", dir.to_str().unwrap()], &options[..]].concat());
        assert_eq!(run.status, Some(1), "{options:?}: {}", run.stderr);
        assert!(
            run.stderr.contains(words) && run.stderr.contains("remedy"),
            "{options:?}: {}",
            run.stderr
        );
        assert_eq!(
            std::fs::read_dir(folder.path()).unwrap().count(),
            0,
            "{options:?}"
        );
    }
    let run = lobestone(&[
        "simulate",
        "--out",
        dir.to_str().unwrap(),
        "--effect",
        "payload:3",
    ]);
    assert_eq!(run.status, Some(2), "{}", run.stderr);
}

/// A clamp that holds the tool changes everything, so that the screen sees other places first; of two faint resonators on one link, the
/// second leaves next to nothing.
#[test]
fn the_data_draw_what_hides_behind_the_rest() {
    let drawn = |kind: &str, seed: &str| {
        let cell = Simulated::new(&["--unknown", kind, "--seed", seed]);
        let found = document(&["localise", cell.path()]);
        (found["places"][0].clone(), cell.truth()["parameters"].clone())
    };
    let (clamp, truth) = drawn("clamp-to-table", "800");
    assert_eq!(clamp["place"], "tool-ground.x");
    assert!(clamp["left"].as_f64().unwrap() < 1.1, "{clamp}");
    // One law at all postures, seen from where it puts the robot.
    assert!(clamp["consistency"].as_f64().unwrap() < 1.3, "{clamp}");
    let of_truth = clamp["parameters"]["stiffness_n_per_m"].as_f64().unwrap()
        / truth["stiffness_n_per_m"].as_f64().unwrap();
    assert!((of_truth - 1.0).abs() < 0.02, "{of_truth}");
    let (pair, truth) = drawn("two-resonators", "804");
    assert_eq!(pair["place"], "link-3.z");
    assert!(!pair["second"].is_null(), "{pair}");
    let of_truth = pair["parameters"]["mass_kg"].as_f64().unwrap() / truth["mass_kg"][0].as_f64().unwrap();
    assert!((of_truth - 1.0).abs() < 0.05, "{of_truth}");
    // Begun with rotors that are too light the fit ended without one, at 2.8 times the noise.
    let (rotor, truth) = drawn("soft-servo", "1201");
    assert_eq!(
        (rotor["place"].as_str(), rotor["form"].as_str()),
        (Some("drive-4"), Some("rotor-on-spring"))
    );
    assert!(rotor["left"].as_f64().unwrap() < 1.1, "{rotor}");
    let of_truth =
        rotor["parameters"]["inertia_kg_m2"].as_f64().unwrap() / truth["rotor_kg_m2"].as_f64().unwrap();
    assert!((of_truth - 1.0).abs() < 0.15, "{of_truth}");
}

/// What a named effect leaves is drawn beside it; each of two parts that are drawn is added by the form that it was drawn with.
#[test]
fn what_an_effect_leaves_is_drawn_and_two_parts_are_added_one_after_the_other() {
    let hose = ["--unknown", "hose-to-ground", "--share", "0.02"];
    let cell = Simulated::new(&[&["--effect", "tool-flexibility", "--seed", "78"][..], &hose].concat());
    let found = document(&["diagnose", cell.path()]);
    assert_eq!(found["effect"], "tool-flexibility", "{found}");
    assert_eq!(found["lead"]["place"], "link-3-ground.z", "{found}");
    assert_eq!(found["lead_beside"], "tool-flexibility", "{found}");
    // Where the best guess is not all of it, what it leaves is drawn, not what it already explains.
    let hose = [
        "--unknown",
        "hose-to-ground",
        "--share",
        "0.05",
        "--points",
        "tool",
    ];
    let cell = Simulated::new(&[&["--effect", "payload", "--seed", "77"][..], &hose].concat());
    let found = document(&["diagnose", cell.path()]);
    assert_eq!(found["best_guess"], "payload", "{found}");
    assert_eq!(found["lead_beside"], "payload", "{found}");
    assert_eq!(found["lead"]["place"], "link-5-ground.y", "{found}");
    let cell = Simulated::new(&["--unknown", "two-resonators", "--seed", "1003"]);
    let found = document(&["localise", cell.path()]);
    let place = &found["places"][0];
    for part in [place, &place["second"]] {
        let request = part["add"].as_str().unwrap();
        assert!(request.ends_with(":form=resonator"), "{request}");
        let added = document(&["add", cell.path(), request]);
        assert_eq!(added["progress"], true, "{added}");
    }
}

/// Physics outside the library, as faint as asked for, named in the truth and nowhere in the folder.
#[test]
fn a_departure_is_as_faint_as_asked_for() {
    let cell = Simulated::new(&with(&[
        "--unknown",
        "encoder-offset",
        "--share",
        "0.05",
        "--seed",
        "2",
    ]));
    let truth = cell.truth();
    assert_eq!(truth["effect"], "unknown");
    assert_eq!(truth["parameters"]["kind"], "encoder-offset");
    let left = truth["visibility"]["excess_chi2_per_value"].as_f64().unwrap();
    assert!((left / 0.05 - 1.0).abs() < 0.06, "{left}");
    assert!(truth["site"].as_str().unwrap().starts_with("joint-"));
    let nearest = &truth["nearest_library_effect"];
    assert!(nearest["excess_chi2_per_value"].as_f64().unwrap() <= left);
    let toml = String::from_utf8(cell.files()[0].1.clone()).unwrap();
    assert!(!toml.contains("encoder"), "{toml}");
}

#[test]
fn a_laboratory_and_its_noise_stand_in_the_truth() {
    let options = [
        "--laboratory",
        "hammer-gain,lines",
        "--common-noise",
        "0.5",
        "--seed",
        "4",
    ];
    let cell = Simulated::new(&with(&options));
    let truth = cell.truth();
    assert_eq!(truth["effect"], "none");
    assert_eq!(truth["laboratory"]["slips"].as_object().unwrap().len(), 2);
    assert_eq!(truth["line_noise"], "hann");
    assert_eq!(truth["common_noise"], 0.5);
    let whole = Simulated::new(&with(&["--laboratory", "--seed", "4"])).truth();
    assert_eq!(whole["laboratory"]["slips"].as_object().unwrap().len(), 8);
    assert_eq!(
        whole["laboratory"]["slips"]["hammer-gain"],
        truth["laboratory"]["slips"]["hammer-gain"]
    );
    // Noise alone is changed by how its lines belong together.
    let white = Simulated::new(&with(&["--seed", "4"]));
    let padded = Simulated::new(&with(&["--line-noise", "zero-padded", "--seed", "4"]));
    assert_eq!(white.files()[0], padded.files()[0]);
    assert_ne!(white.files()[1], padded.files()[1]);
    assert_eq!(
        white.truth()["joint_stiffness"],
        padded.truth()["joint_stiffness"]
    );
}

#[test]
fn tiers_are_drawn_by_the_seed() {
    for tier in ["control", "faint", "foreign", "trial", "laboratory", "three"] {
        let options = ["--random", tier, "--lines-hz", "2", "--seed", "9"];
        let cell = Simulated::new(&options);
        let truth = cell.truth();
        match tier {
            "control" => assert_eq!(truth["effect"], "none"),
            "foreign" => assert_eq!(truth["effect"], "unknown"),
            "laboratory" => assert_eq!(truth["laboratory"]["slips"].as_object().unwrap().len(), 8),
            "three" => assert_eq!(truth["also"].as_array().unwrap().len(), 2),
            _ => assert!(truth["laboratory"].is_null()),
        }
    }
}
