//! Effects that make cuts differ beyond the older library: hidden in force records counted in the domain of time, named, added.

use serde_json::Value;

use crate::support::document;

/// A campaign of milled cuts and its truth.
fn made(folder: &std::path::Path, seed: &str, effect: &str) -> (String, Value) {
    let dir = folder.join("cell");
    let path = dir.to_str().unwrap().to_string();
    document(&["simulate", "--out", &path, "--seed", seed, "--effect", effect]);
    let truth = std::fs::read(folder.join("cell.truth.json")).unwrap();
    (path, serde_json::from_slice(&truth).unwrap())
}

/// Named by `diagnose`; after `add` what is left is noise; gives the effect's own parameters with their errors.
fn named_and_added(path: &str, effect: &str) -> Vec<(String, f64, f64)> {
    let found = document(&["diagnose", path]);
    assert_eq!(found["verdict"], "effect", "{}", found["effect"]);
    assert_eq!(found["effect"], effect);
    let added = document(&["add", path, effect]);
    let compared = document(&["compare", path]);
    let number = |key: &str| compared["error"][key].as_f64().unwrap();
    assert!(
        number("nrms") < 1.1 * number("noise_floor_nrms"),
        "{} against {}",
        compared["error"]["nrms"],
        compared["error"]["noise_floor_nrms"]
    );
    let own = added["parameters"].as_array().unwrap().iter();
    own.filter(|p| p["name"].as_str().unwrap().starts_with(effect))
        .map(|p| {
            let at = |key: &str| p[key].as_f64().unwrap();
            (
                p["name"].as_str().unwrap().to_string(),
                at("value"),
                at("std_error"),
            )
        })
        .collect()
}

#[test]
fn a_chipped_tooth_is_named_with_its_size() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = made(folder.path(), "3", "tooth-radii:teeth=one,short_mm=0.03");
    let own = named_and_added(&path, "tooth-radii");
    let (_, value, std) = &own[0];
    assert!((value - 0.03).abs() < 4.0 * std, "{own:?}");
    assert!(*std < 0.003, "{own:?}");
}

#[test]
fn a_missing_tooth_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = made(folder.path(), "4", "tooth-radii:teeth=one,short_mm=0.5");
    let own = named_and_added(&path, "tooth-radii");
    assert!(own[0].1 > 0.15, "{own:?}");
}

#[test]
fn uneven_pitch_is_named_with_its_angles() {
    let folder = tempfile::tempdir().unwrap();
    let (path, truth) = made(folder.path(), "5", "uneven-pitch");
    let mut own = named_and_added(&path, "uneven-pitch");
    let whole = |angles: &mut Vec<f64>| angles.push(360.0 - angles.iter().sum::<f64>());
    let list = truth["parameters"]["pitch_deg"].as_array().unwrap();
    let mut hidden: Vec<f64> = list.iter().map(|v| v.as_f64().unwrap()).collect();
    whole(&mut hidden);
    own.sort_by(|a, b| a.0.cmp(&b.0));
    let mut found: Vec<f64> = own.iter().map(|p| p.1).collect();
    whole(&mut found);
    // Which tooth is the first the forces do not say. The last angle is the sum of the others.
    let std = own.iter().map(|p| p.2).fold(0.0, f64::max) * (own.len() as f64).sqrt();
    let off = |shift: usize| {
        let pairs = found.iter().enumerate();
        pairs
            .map(|(j, f)| (f - hidden[(j + shift) % hidden.len()]).abs())
            .fold(0.0, f64::max)
    };
    let least = (0..hidden.len()).map(off).fold(f64::INFINITY, f64::min);
    assert!(
        least < 4.0 * std && std < 0.2,
        "{least} ± {std}: {found:?} for {hidden:?}"
    );
}

#[test]
fn push_off_is_named_with_its_compliance() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = made(folder.path(), "6", "push-off:compliance_um_per_n=2");
    let own = named_and_added(&path, "push-off");
    let (_, value, std) = &own[0];
    assert!((value - 2.0).abs() < 4.0 * std && *std < 0.5, "{own:?}");
}

#[test]
fn force_records_are_made_the_same_for_the_same_seed_and_lack_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let record = |name: &str| {
        let dir = folder.path().join(name);
        document(&[
            "simulate",
            "--out",
            dir.to_str().unwrap(),
            "--seed",
            "8",
            "--milling",
        ]);
        std::fs::read(dir.join("force/c01.txt")).unwrap()
    };
    assert_eq!(record("a"), record("b"));
    let found = document(&["diagnose", folder.path().join("a").to_str().unwrap()]);
    assert_eq!(found["verdict"], "none", "{}", found["effect"]);
}
