//! What people call things that have a key: effects, places, parameters, how sure a verdict is.

use super::number::{format_si, significant};
use crate::discrepancy::TrendPoint;
use crate::discrepancy::joint_trends::{JointAgainst, JointTrend};
use crate::effects::Site;
use crate::identify::Estimate;
use crate::text::{capitalised, chance};

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

/// `mass 5.70 kg, frequency 20.9 Hz`.
pub fn sizes(parameters: &[Estimate]) -> String {
    let one = |p: &Estimate| format!("{} {}", parameter(&p.name), format_si(p.value, p.unit, 3));
    parameters.iter().map(one).collect::<Vec<_>>().join(", ")
}

/// Endings of keys that are units, longest first where one ends in another, and the units.
const UNITS: [(&str, &str); 20] = [
    ("_nms_per_rad", "N·m·s/rad"),
    ("_um_per_n", "µm/N"),
    ("_nm_per_rad", "N·m/rad"),
    ("_n_per_mm2", "N/mm²"),
    ("_n_per_mm", "N/mm"),
    ("_ns_per_m", "N·s/m"),
    ("_n_per_m", "N/m"),
    ("_kg_m2", "kg·m²"),
    ("_kg", "kg"),
    ("_hz", "Hz"),
    ("_mm", "mm"),
    ("_um", "µm"),
    ("_deg", "°"),
    ("_rad", "rad"),
    ("_pa", "Pa"),
    ("_ms", "ms"),
    ("_us", "µs"),
    ("_s", "s"),
    ("_n", "N"),
    ("_m", "m"),
];

/// Keys that are no words.
const NAMES: [(&str, &str); 27] = [
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
    ("d", "offset d"),
    ("a", "length a"),
    ("wall", "wall thickness"),
    ("inertia-x", "moment of inertia about x"),
    ("inertia-y", "moment of inertia about y"),
    ("inertia-z", "moment of inertia about z"),
    ("com-x", "centre of mass, x"),
    ("com-y", "centre of mass, y"),
    ("com-z", "centre of mass, z"),
];

/// A parameter's key in words: `joint-transverse-compliance@joint-2.transverse_nm_per_rad` → `stiffness across the axis`.
/// What stands in brackets becomes a joint, a tooth, a channel: `c_nms_per_rad[0]` → `damping of joint 1`.
pub fn parameter(key: &str) -> String {
    let last = key.rsplit('.').next().unwrap_or(key);
    let (last, index) = match last.split_once('[') {
        Some((name, rest)) => (name, rest),
        None => (last, ""),
    };
    let bare = UNITS
        .iter()
        .find_map(|(ending, _)| last.strip_suffix(ending))
        .unwrap_or(last);
    let index = of_which(bare, index);
    let named = NAMES.iter().find(|(name, _)| *name == bare);
    let words = match named {
        Some((_, words)) => (*words).to_string(),
        None if bare.len() == 3 && bare.starts_with('k') => capitalised(bare),
        None => bare.replace(['_', '-'], " "),
    };
    words + &index
}

/// A parameter's key in words, with what it is a parameter of: `joint-1.stiffness` → `joint 1: stiffness`.
pub fn parameter_of(key: &str) -> String {
    match key.rsplit_once('.') {
        Some((owner, _)) => format!("{}: {}", at_place(owner), parameter(key)),
        None => parameter(key),
    }
}

/// An effect with its place: `local-resonator@link-3` → `local resonator, link 3`.
pub fn at_place(label: &str) -> String {
    label.replace('-', " ").replace('@', ", ")
}

/// What a joint follows from posture to posture, and how it goes: `joint 2: stiffness follows the torque of gravity (p < 0.0001 after 26
/// tests), from −4.1 % at 120 N·m to +3 % at 2100 N·m; usually …`.
pub fn joint_trend(trend: &JointTrend) -> String {
    let end = |p: &TrendPoint| {
        let x = format!("{} {}", significant(p.x, 3), trend.x_unit);
        let place = match trend.against {
            JointAgainst::Order => format!("place {:.0}", p.x),
            _ => x.trim_end().to_string(),
        };
        format!("{:+.2} % at {place}", 100.0 * p.rest.exp_m1()).replace('-', "−")
    };
    let ends = match trend.points.as_slice() {
        [first, .., last] => format!(", from {} to {}", end(first), end(last)),
        _ => String::new(),
    };
    format!(
        "{} follows {} ({} after {} tests){ends}; usually {}",
        parameter_of(&trend.parameter),
        trend.against.words(),
        chance(trend.p_value),
        trend.tests,
        trend.usual_cause
    )
}

/// What a column of tables of many campaigns is, with its unit: `joint-1.stiffness_nm_per_rad` →
/// `joint 1: stiffness (N·m/rad)`, `milling.Ti-6Al-4V.ktc_n_per_mm2` → `milling, Ti-6Al-4V: Ktc (N/mm²)`.
pub fn quantity(key: &str) -> String {
    if key == "nrms" {
        return "error (ratio)".into();
    }
    let (owner, last) = key.rsplit_once('.').unwrap_or(("", key));
    let words = match owner.split_once('.') {
        Some((process, material)) => format!("{process}, {material}: {}", parameter(last)),
        None => parameter_of(key),
    };
    let bare = last.split('[').next().unwrap_or(last);
    match UNITS.iter().find(|(ending, _)| bare.ends_with(ending)) {
        Some((_, unit)) => format!("{words} ({unit})"),
        None => words,
    }
}

/// The rest of a key after its first bracket in words; keys count from 0, people from 1.
fn of_which(bare: &str, rest: &str) -> String {
    if rest.is_empty() {
        return String::new();
    }
    const CHANNELS: [&str; 4] = ["Fx", "Fy", "Fz", "Mz"];
    let places: Vec<&str> = rest.trim_end_matches(']').split("][").collect();
    let number = |k: usize| places.get(k).and_then(|p| p.parse::<usize>().ok());
    let channel = |k: usize| number(k).and_then(|i| CHANNELS.get(i));
    let told = match (bare, places.as_slice()) {
        ("c" | "loss_factor", [_]) => number(0).map(|i| format!("of joint {}", i + 1)),
        ("offset" | "pitch", [_]) => number(0).map(|i| format!("of tooth {}", i + 1)),
        ("frequency" | "zeta" | "tau", [_]) => channel(0).map(|c| format!("of {c}")),
        ("matrix", [_, _]) => channel(0)
            .zip(channel(1))
            .map(|(into, from)| format!("of {from} into {into}")),
        ("rotation_vector", [_]) => number(0)
            .and_then(|i| ["x", "y", "z"].get(i))
            .map(|axis| format!("about {axis}")),
        (_, ["t"]) => Some("(tangential)".into()),
        (_, ["r"]) => Some("(radial)".into()),
        (_, ["a"]) => Some("(axial)".into()),
        (_, ["f"]) => Some("(feed)".into()),
        _ => None,
    };
    format!(" {}", told.unwrap_or_else(|| format!("[{rest}")))
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
            ("dynamometer-resonance.frequency_hz[1]", "frequency of Fy"),
            ("joint-damping.c_nms_per_rad[0]", "damping of joint 1"),
            ("tooth-radii.offset_mm[4]", "offset of tooth 5"),
            ("crosstalk.matrix[0][2]", "leak of Fz into Fx"),
            ("tool-wear.growth[t]", "growth of the edge force (tangential)"),
            ("x.strange[q]", "strange [q]"),
            ("push-off.compliance_um_per_n", "compliance"),
            ("damping-ratio", "damping ratio"),
            ("edge-force.kte_n_per_mm", "Kte"),
            ("time-delay.delay_s", "delay"),
            ("tool-flexibility.damping_ratio", "damping ratio"),
        ] {
            assert_eq!(parameter(key), words, "{key}");
        }
        for (key, words) in [
            ("joint-1.stiffness", "joint 1: stiffness"),
            ("damping-ratio", "damping ratio"),
            ("ktc_n_per_mm2", "Ktc"),
            ("tool-flexibility.mass_kg", "tool flexibility: mass"),
            (
                "local-resonator@link-3.frequency_hz",
                "local resonator, link 3: frequency",
            ),
            ("link-4.inertia-x", "link 4: moment of inertia about x"),
            ("joint-4.d", "joint 4: offset d"),
        ] {
            assert_eq!(parameter_of(key), words, "{key}");
        }
        for (key, words) in [
            ("joint-1.stiffness_nm_per_rad", "joint 1: stiffness (N·m/rad)"),
            (
                "milling.Ti-6Al-4V.ktc_n_per_mm2",
                "milling, Ti-6Al-4V: Ktc (N/mm²)",
            ),
            (
                "dynamometer-resonance.frequency_hz[1]",
                "dynamometer resonance: frequency of Fy (Hz)",
            ),
            ("damping-ratio", "damping ratio"),
            ("nrms", "error (ratio)"),
        ] {
            assert_eq!(quantity(key), words, "{key}");
        }
        assert_eq!(at_place("local-resonator@link-3"), "local resonator, link 3");
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
    fn one_and_many_are_told_apart() {
        assert_eq!(count(1, "cut", "cuts"), "1 cut");
        assert_eq!(count(0, "cut", "cuts"), "0 cuts");
    }

    #[test]
    fn settings_keep_their_digits() {
        assert_eq!(setting(1160.0), "1160");
        assert_eq!(setting(0.05), "0.05");
    }
}
