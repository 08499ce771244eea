//! Drive, gear loss, bearing, base, contact, warming, counterbalance, bulky loads: hidden in a campaign each, named, added, measured.

use serde_json::Value;

use crate::support::document;

/// What is hidden, with its parameters as asked for, and the key of the choice. (The two laws of a counterbalance differ too little at four
/// postures to be told apart.)
const HIDDEN: [&str; 9] = [
    "hysteretic-damping:extent=one,loss_factor=0.07,common_share=0",
    "drive-dynamics@joint-2:servo_ratio=3,frequency_hz=14,damping_ratio=0.5",
    "contact@tool:ground=rigid,stiffness_n_per_m=2e5,damping_ns_per_m=150,elevation_deg=60,azimuth_deg=30",
    "thermal-drift:stiffness_change=-0.08,damping_change=0.2",
    "bearing-compliance@joint-3:direction=radial,stiffness_n_per_m=6e6",
    "base-mounting:direction=horizontal,stiffness_n_per_m=8e6",
    "base-mounting:direction=vertical,stiffness_n_per_m=8e6",
    "counterbalance@joint-2:law=stiffness,stiffness_nm_per_rad=2e5,stiffest_at_deg=-40",
    "payload-inertia:mass_kg=20,com_x_m=0.12,com_y_m=-0.08,com_z_m=0.2,radius_of_gyration_m=0.15",
];

/// The effect and its place are named, `add` brings the misfit to the noise, and the parameters are those that were hidden,
/// to four of their standard errors.
#[test]
fn each_is_named_and_added_with_its_parameters() {
    for (seed, hidden) in (31..).zip(HIDDEN) {
        let folder = tempfile::tempdir().unwrap();
        let dir = folder.path().join("cell");
        let path = dir.to_str().unwrap();
        let seed: u64 = seed;
        document(&[
            "simulate",
            "--out",
            path,
            "--seed",
            &seed.to_string(),
            "--postures",
            "4",
            "--lines-hz",
            "0.5",
            "--effect",
            hidden,
        ]);
        let (label, values) = hidden.split_once(':').unwrap();
        let found = document(&["diagnose", path]);
        assert_eq!(found["verdict"], "effect", "{hidden}: {}", found["best_guess"]);
        let site = found["site"]
            .as_str()
            .map_or(String::new(), |site| format!("@{site}"));
        assert_eq!(
            format!("{}{site}", found["effect"].as_str().unwrap()),
            label,
            "{hidden}"
        );
        let added = document(&["add", path, label]);
        assert_eq!(added["progress"], true, "{hidden}");
        let after = added["after"]["reduced_chi2"].as_f64().unwrap();
        assert!((0.9..1.1).contains(&after), "{hidden}: {after}");
        for (key, value) in values.split(',').filter_map(|pair| pair.split_once('=')) {
            let Ok(value) = value.parse::<f64>() else { continue };
            let mut fitted = added["parameters"].as_array().unwrap().iter();
            let own = fitted.rfind(|p| p["name"].as_str().unwrap().ends_with(key));
            let own = own.unwrap_or_else(|| panic!("{hidden}: no {key} in {}", added["parameters"]));
            let off = own["value"].as_f64().unwrap() - value;
            let std = own["std_error"].as_f64().unwrap();
            assert!(off.abs() <= 4.0 * std, "{hidden} {key}: {} ± {std}", own["value"]);
        }
    }
}

/// The verdict on a campaign that `simulate` makes with these options.
fn diagnosed(options: &str) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("cell");
    let path = dir.to_str().unwrap();
    let options: Vec<&str> = options.split(' ').collect();
    document(&[&["simulate", "--out", path], &options[..]].concat());
    document(&["diagnose", path])
}

/// A campaign on which the fit with flexible links ran away to 1180 GPa, beyond the other candidates: `add` found the optimum that
/// `diagnose` had called unknown.
#[test]
fn what_add_finds_diagnose_finds() {
    let found = diagnosed("--seed 970131 --random trial --lines-hz 0.5");
    assert_eq!(found["effect"], "link-flexibility", "{}", found["best_guess"]);
    assert!(found["candidates"][0]["reduced_chi2"].as_f64().unwrap() < 1.05);
}

/// A compliant base that leaves a thousandth above the noise: the coarse view shows next to nothing of it, and next to where it vanishes its
/// prior pulls harder than the data. All data show it by ΔBIC −60; the verdict was `unknown`.
#[test]
fn what_only_all_data_show_is_found() {
    let found = diagnosed("--seed 970155 --random trial");
    assert_eq!(found["effect"], "base-compliance", "{}", found["best_guess"]);
    let leader = &found["candidates"][0];
    assert!(leader["delta_bic"].as_f64().unwrap() < -50.0, "{leader}");
}

/// A bearing that is missing drives the joints so far that it is not seen from there; what the data draw puts them right, and is that
/// bearing. The verdict was `unknown`, with the bearing as what the data draw.
#[test]
fn what_the_data_draw_gets_its_name() {
    let found = diagnosed("--seed 1900028 --kind direct --effect bearing-compliance --lines-hz 2.0");
    assert_eq!(found["effect"], "bearing-compliance", "{}", found["lead"]);
    assert_eq!(found["site"], "joint-4");
    assert!(found["lead"].is_null());
    assert!(found["candidates"][0]["reduced_chi2"].as_f64().unwrap() < 1.2);
}

/// From where the model stands a soft fixing makes all worse until the joints have made room for it: the verdict was unknown, and `add`
/// found it.
#[test]
fn an_effect_that_a_first_look_passed_over_is_found_from_a_possible_size() {
    let found = diagnosed("--seed 1960060 --kind direct --effect base-mounting --lines-hz 1.0");
    assert_eq!(found["effect"], "base-mounting", "{found:#}");
    assert!(found["confidence"].as_f64().unwrap() > 0.9);
    assert!(found["candidates"][0]["reduced_chi2"].as_f64().unwrap() < 1.2);
}

/// The leader is another effect of an impossible size, beside which the right one is found: it alone explains all. The verdict was the
/// leader.
#[test]
fn an_effect_that_only_led_to_the_right_one_is_dropped() {
    let found = diagnosed("--seed 1960026 --kind direct --effect bearing-compliance --lines-hz 1.0");
    assert_eq!(found["effect"], "bearing-compliance", "{found:#}");
    assert_eq!(found["site"], "joint-5");
    assert!(found["companion"].is_null());
    assert!(found["candidates"][0]["reduced_chi2"].as_f64().unwrap() < 1.2);
}

/// Effects that are rare or have many places, so faint in the noise of a quick test (7 %) that a look at few data promises nothing: all
/// data show them by ΔBIC −170 and more. All were `unknown` (0.83 to 0.97) or `none`.
#[test]
fn rare_effects_that_only_all_data_show_are_found() {
    for (seed, sigmas, effect, site) in [
        (6200110, "12.7", "bearing-compliance", Some("joint-4")),
        (6200113, "28.8", "payload-inertia", None),
        (6200044, "18.1", "local-resonator", Some("link-3")),
    ] {
        let hide = format!("--seed {seed} --kind dirty --effect {effect} --visibility {sigmas} --possible");
        let found = diagnosed(&hide);
        assert_eq!(found["effect"], effect, "{}", found["candidates"][0]);
        assert_eq!(found["site"].as_str(), site);
        let leader = &found["candidates"][0];
        assert!(leader["delta_bic"].as_f64().unwrap() < -150.0, "{leader}");
    }
}

/// Contact with a table that moves: the contact with rigid ground takes 99 % and leaves 1.03 times the noise, but with structure, at the
/// table's resonance. The verdict was `unknown` (0.98).
#[test]
fn another_choice_of_the_leader_follows_what_it_leaves() {
    let found = diagnosed("--seed 6200108 --kind dirty --effect contact --visibility 833 --possible");
    assert_eq!(found["effect"], "contact", "{}", found["best_guess"]);
    let leader = &found["candidates"][0];
    assert_eq!(leader["parameters"]["ground"], "table", "{leader}");
    assert!(leader["reduced_chi2"].as_f64().unwrap() < 1.02, "{leader}");
}

/// A joint that is half as stiff at small force: without it the joint's resonance leaves the measured band, and from there no size of the
/// effect does anything. The verdict was `unknown` at 0.98, and `add` found nothing.
#[test]
fn an_effect_of_a_joint_that_left_the_band_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("cell");
    let path = dir.to_str().unwrap();
    document(&[
        "simulate", "--out", path, "--random", "trial", "--seed", "8400263",
    ]);
    let found = document(&["diagnose", path]);
    assert_eq!(
        found["effect"], "amplitude-dependent-stiffness",
        "{}",
        found["best_guess"]
    );
    assert_eq!(found["site"], "joint-6");
    let added = document(&["add", path, "amplitude-dependent-stiffness@joint-6"]);
    let ratio = added["parameters"].as_array().unwrap().last().unwrap();
    let off = ratio["value"].as_f64().unwrap() - 0.480_130;
    assert!(off.abs() < 4.0 * ratio["std_error"].as_f64().unwrap(), "{ratio}");
    assert!(added["after"]["reduced_chi2"].as_f64().unwrap() < 1.1);
}

/// Three effects of which two leave less than the scatter of χ²/ν, but not without structure: the third was not sought, and the verdict was
/// `unknown` at 0.98.
#[test]
fn a_third_effect_is_sought_where_two_leave_structure() {
    let found = diagnosed("--seed 8600009 --random three --lines-hz 0.5");
    assert_eq!(
        found["effect"], "load-dependent-stiffness",
        "{}",
        found["best_guess"]
    );
    let besides: Vec<&str> = found["companions"]
        .as_array()
        .unwrap()
        .iter()
        .map(|c| c.as_str().unwrap())
        .collect();
    assert_eq!(besides, ["base-compliance", "local-resonator@link-3"]);
}

/// A direction that was chosen while something else was missing is chosen anew once that is there.
#[test]
fn a_choice_made_too_early_is_made_anew() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("cell");
    let path = dir.to_str().unwrap();
    document(&[
        "simulate",
        "--out",
        path,
        "--seed",
        "31",
        "--postures",
        "4",
        "--lines-hz",
        "0.5",
        "--effect",
        "local-resonator@link-3:direction=z,mass_kg=6,frequency_hz=14,damping_ratio=0.05",
        "--effect",
        "load-dependent-stiffness:beta=0.1",
    ]);
    let first = document(&["add", path, "local-resonator@link-3:direction=x"]);
    assert_eq!(first["chosen_anew"].as_array().unwrap().len(), 0);
    let second = document(&["add", path, "load-dependent-stiffness"]);
    assert_eq!(second["chosen_anew"][0], "local-resonator@link-3 (direction z)");
    let after = second["after"]["reduced_chi2"].as_f64().unwrap();
    assert!((0.9..1.1).contains(&after), "{after}");
    // The revision has it, too.
    let model = document(&["calibrate", path]);
    assert!(model["reduced_chi2"].as_f64().unwrap() < 1.1);
    assert_eq!(document(&["diagnose", path])["verdict"], "none");
}

/// Noise that the outputs of one hit share, on lines filled in by padding: it is not as large in all patterns, and its largest is no resonance.
#[test]
fn shared_noise_on_padded_lines_is_no_resonance() {
    let found = diagnosed("--seed 7240001 --random control");
    assert_eq!(found["verdict"], "none", "{}", found["rest"]);
    let tests = found["rest"]["tests"].as_array().unwrap();
    let resonance = tests.iter().find(|t| t["frequency_hz"].is_number()).unwrap();
    assert!(resonance["p_value"].as_f64().unwrap() > 1e-3, "{resonance}");
}

/// A mode of the table under the sensor is no effect of the library: that something is there is said, and at which frequency.
#[test]
fn a_mode_of_the_table_is_told_with_its_frequency() {
    let found = diagnosed("--seed 8400328 --random trial");
    assert_eq!(found["verdict"], "unknown", "{}", found["rest"]);
    let looks_like = found["rest"]["looks_like"].as_str().unwrap();
    assert!(looks_like.starts_with("a resonance at one place"), "{looks_like}");
    let tests = found["rest"]["tests"].as_array().unwrap();
    let hz = tests.iter().find_map(|t| t["frequency_hz"].as_f64()).unwrap();
    assert!((hz / 19.78 - 1.0).abs() < 0.02, "{hz}");
}
