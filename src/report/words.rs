//! What people call things that have a key: effects, places, parameters, how sure a verdict is.

use super::number::significant;
use crate::effects::Site;

/// `local-resonator` → `local resonator`.
pub fn effect(id: &str) -> String {
    id.replace('-', " ")
}

/// `on link 3`; `None` where an effect has no place of its own.
pub fn place(site: Site) -> Option<String> {
    match site {
        Site::Everywhere => None,
        Site::Joint(i) => Some(format!("at joint {i}")),
        Site::Link(i) => Some(format!("on link {i}")),
        Site::Tool => Some("at the tool".into()),
        Site::At(spot) => Some(spot.words()),
    }
}

/// Endings of keys that are units, longest first where one ends in another.
const UNITS: [&str; 18] = [
    "_nms_per_rad",
    "_nm_per_rad",
    "_n_per_mm2",
    "_n_per_mm",
    "_ns_per_m",
    "_n_per_m",
    "_kg",
    "_hz",
    "_mm",
    "_um",
    "_deg",
    "_rad",
    "_pa",
    "_ms",
    "_us",
    "_s",
    "_n",
    "_m",
];

/// Keys that are no words.
const NAMES: [(&str, &str); 18] = [
    ("zeta", "damping ratio"),
    ("c", "damping"),
    ("young", "Young's modulus"),
    ("beta", "growth of stiffness with load (per kN·m)"),
    ("low_level_ratio", "stiffness at small over large force"),
    ("common_share", "share of damping that all joints keep"),
    ("transverse", "stiffness across the axis"),
    ("rocking", "rocking stiffness"),
    ("hysteretic", "hysteretic stiffness"),
    ("rotation_vector", "rotation"),
    ("tau", "time constant"),
    ("p", "exponent of the chip thickness"),
    ("q", "exponent of the cutting speed"),
    ("growth", "growth of the edge force"),
    ("coefficient", "force of the chisel edge"),
    ("k_margin", "friction force of the margin"),
    ("amplitude_per_feed", "amplitude over feed"),
    ("matrix", "leak"),
];

/// A parameter's key in words: `joint-transverse-compliance@joint-2.transverse_nm_per_rad` → `stiffness across the axis`.
/// What stands in brackets is kept: `frequency_hz[1]` → `frequency [1]`.
pub fn parameter(key: &str) -> String {
    let last = key.rsplit('.').next().unwrap_or(key);
    let (last, index) = match last.split_once('[') {
        Some((name, rest)) => (name, format!(" [{rest}")),
        None => (last, String::new()),
    };
    let bare = UNITS
        .iter()
        .find_map(|unit| last.strip_suffix(unit))
        .unwrap_or(last);
    let named = NAMES.iter().find(|(name, _)| *name == bare);
    let words = match named {
        Some((_, words)) => (*words).to_string(),
        None if bare.len() == 3 && bare.starts_with('k') => {
            let mut letters = bare.chars();
            letters
                .next()
                .map_or(String::new(), |c| c.to_uppercase().chain(letters).collect())
        }
        None => bare.replace('_', " "),
    };
    words + &index
}

/// How sure a probability is, in words: `very likely (97 of 100 such verdicts are right)`.
pub fn confidence(probability: f64) -> String {
    let words = match probability {
        p if p >= 0.985 => "practically certain",
        p if p >= 0.945 => "very likely",
        p if p >= 0.795 => "likely",
        p if p >= 0.595 => "more likely than not",
        p if p >= 0.395 => "open: it may as well be something else",
        _ => "hardly more than a guess",
    };
    let hundred = (100.0 * probability).round().clamp(0.0, 99.0);
    format!("{words} (about {hundred:.0} of 100 such verdicts are right)")
}

/// `3 cuts`, `1 cut`.
pub fn count(number: usize, one: &str, many: &str) -> String {
    match number {
        1 => format!("1 {one}"),
        n => format!("{n} {many}"),
    }
}

/// `a`, `a and b`, `a, b and c`.
pub fn listed(items: &[String]) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [most @ .., last] => format!("{} and {last}", most.join(", ")),
    }
}

/// A setting as somebody wrote it: `1160`, `0.05`.
pub fn setting(value: f64) -> String {
    if value.is_finite() && value.abs() < 1e9 {
        // Display gives the shortest form that reads back the same.
        format!("{value}")
    } else {
        significant(value, 5)
    }
}

/// FRF names often hold the posture already.
pub fn frf_name(posture: &str, name: &str) -> String {
    if name.split_once(' ').is_some_and(|(first, _)| first == posture) {
        format!(
            "Posture {posture}, {}",
            name.trim_start_matches(posture).trim_start()
        )
    } else {
        format!("Posture {posture}, {name}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_become_words() {
        assert_eq!(
            effect("joint-transverse-compliance"),
            "joint transverse compliance"
        );
        assert_eq!(place(Site::Joint(2)).as_deref(), Some("at joint 2"));
        assert_eq!(place(Site::Everywhere), None);
        for (key, words) in [
            ("payload.mass_kg", "mass"),
            (
                "joint-transverse-compliance@joint-2.transverse_nm_per_rad",
                "stiffness across the axis",
            ),
            ("dynamometer-resonance.frequency_hz[1]", "frequency [1]"),
            ("joint-damping.c_nms_per_rad[0]", "damping [0]"),
            ("edge-force.kte_n_per_mm", "Kte"),
            ("time-delay.delay_s", "delay"),
            ("tool-flexibility.damping_ratio", "damping ratio"),
        ] {
            assert_eq!(parameter(key), words, "{key}");
        }
    }

    #[test]
    fn a_confidence_is_a_promise_and_never_certain() {
        assert_eq!(
            confidence(0.97),
            "very likely (about 97 of 100 such verdicts are right)"
        );
        assert!(confidence(1.0).contains("about 99 of 100"));
        assert!(confidence(0.3).starts_with("hardly more than a guess (about 30"));
        let steps: Vec<String> = [0.99, 0.95, 0.8, 0.6, 0.4, 0.1].map(confidence).to_vec();
        for pair in steps.windows(2) {
            assert_ne!(pair[0].split('(').next(), pair[1].split('(').next());
        }
    }

    #[test]
    fn lists_read_as_people_write_them() {
        let items = |n: usize| {
            ["a", "b", "c"][..n]
                .iter()
                .map(|s| s.to_string())
                .collect::<Vec<_>>()
        };
        assert_eq!(listed(&items(0)), "");
        assert_eq!(listed(&items(1)), "a");
        assert_eq!(listed(&items(2)), "a and b");
        assert_eq!(listed(&items(3)), "a, b and c");
        assert_eq!(count(1, "cut", "cuts"), "1 cut");
        assert_eq!(count(0, "cut", "cuts"), "0 cuts");
    }

    #[test]
    fn settings_keep_their_digits() {
        assert_eq!(setting(1160.0), "1160");
        assert_eq!(setting(0.05), "0.05");
    }
}
