//! What the name of a column or channel says: its unit, whether it is the time, which force it is.

use crate::data::{Channel, ChannelRole};
use crate::ingest::text::Notes;
use crate::ingest::units::{self, Dimension, Unit};

/// Names of a time column, whole.
const TIME: [&str; 12] = [
    "time",
    "t",
    "zeit",
    "temps",
    "tiempo",
    "tempo",
    "cas",
    "čas",
    "x_value",
    "timestamp",
    "datetime",
    "elapsed",
];
/// Words of which one makes a name that of the time, where it comes first or behind one of [`BEFORE_TIME`].
const TIME_WORDS: [&str; 8] = [
    "time",
    "zeit",
    "temps",
    "tiempo",
    "tempo",
    "čas",
    "timestamp",
    "zeitstempel",
];
const BEFORE_TIME: [&str; 9] = [
    "elapsed",
    "x",
    "relative",
    "rel",
    "test",
    "sample",
    "scan",
    "measurement",
    "abs",
];
/// Behind a word for time these make something else of it: a window, a setting.
const NOT_THE_TIME: [&str; 4] = ["weighting", "constant", "window", "zone"];
const FORCE_WORDS: [&str; 10] = [
    "force", "forces", "kraft", "fuerza", "effort", "forza", "força", "kracht", "síla", "f",
];
const MOMENT_WORDS: [&str; 9] = [
    "torque",
    "moment",
    "drehmoment",
    "momento",
    "couple",
    "koppel",
    "spindlemoment",
    "m",
    "扭矩",
];
/// What a channel with a force's name is not the force itself for.
const NO_FORCE: [&str; 33] = [
    "power",
    "leistung",
    "puissance",
    "potencia",
    "max",
    "min",
    "mean",
    "rms",
    "std",
    "set",
    "soll",
    "target",
    "limit",
    "error",
    "offset",
    "drift",
    "acc",
    "accel",
    "acceleration",
    "vib",
    "vibration",
    "hammer",
    "impact",
    "fft",
    "sim",
    "simulated",
    "model",
    "pred",
    "predicted",
    "calc",
    "cmd",
    "command",
    "psd",
];

/// Name and unit of `Fx [N]`, `Fx (N)`, `fx_n`, `Fx`.
pub(crate) fn split_unit(name: &str) -> (&str, Option<Unit>) {
    let name = name.trim();
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let Some((base, rest)) = name.split_once(open)
            && let Some((unit, _)) = rest.split_once(close)
        {
            // `acc_(m_s2)`, as names of variables have it.
            let understood = units::parse(unit).or_else(|| {
                let is_suffix = unit.contains('_');
                is_suffix.then(|| units::parse_suffix(unit)).flatten()
            });
            return (base.trim(), understood);
        }
    }
    for (at, _) in name.match_indices('_') {
        if let Some(unit) = units::parse_suffix(&name[at + 1..]) {
            return (&name[..at], Some(unit));
        }
    }
    // `F_x / N`, as ISO 80000 writes headings.
    if let Some((base, unit)) = name.rsplit_once(" / ")
        && let Some(unit) = units::parse(unit)
    {
        return (base.trim(), Some(unit));
    }
    (name, None)
}

/// The unit that a channel's name gives: `fx_n`, `Fx [N]`.
pub(crate) fn unit_in_name(name: &str) -> Option<Unit> {
    split_unit(name).1
}

/// What to tell of a force whose values are what the amplifier gave: there is no gain, so that the number of volts (or of what stands in
/// the file) goes on as that of newtons. `None` for a unit that is a force's, and for what is no force.
pub(crate) fn force_without_gain(role: ChannelRole, unit: Option<Unit>, label: &str) -> Option<&'static str> {
    if role == ChannelRole::Other {
        return None;
    }
    let electric = unit.or_else(|| units::unit_of_charge_or_other(label))?;
    match electric.dimension {
        Dimension::VOLTAGE if unit.is_none() => Some(
            "a force as a charge, without a gain: the numbers are taken as newtons; give gain (\"-3.9 pC/N\") in a [[channel]] of \
             campaign.toml",
        ),
        Dimension::VOLTAGE => Some(
            "a force in volts, without a gain: as many newtons are taken as it has volts; give gain (\"500 N/V\") in a [[channel]] of \
             campaign.toml",
        ),
        _ => None,
    }
}

/// The unit that a channel's name gives, as people write it: `m/s²` for `acc_m_per_s2`, `g` for `Acc [g]`; blank where it
/// gives none.
pub(crate) fn unit_label(name: &str) -> String {
    let unit = unit_in_name(name);
    if let Some((_, label)) = name.split_once(['[', '(']) {
        let label = label.trim_end_matches([']', ')']);
        // `x(1,:)` is a part of an array.
        let says_something =
            unit.is_none() && label.contains(|c: char| c.is_alphabetic() || "%°".contains(c));
        if says_something || units::parse_named(label).is_some() {
            return label.to_owned();
        }
    }
    match unit.and_then(|u| Some((u.factor, u.dimension.describe()?.1))) {
        Some((factor, si)) if (factor - 1.0).abs() < 1e-12 => si.to_owned(),
        _ if unit.is_some() => name
            .split_once('_')
            .map_or_else(String::new, |(_, suffix)| suffix.to_owned()),
        _ => String::new(),
    }
}

/// Is it called as the hammer of a tap test is?
pub(crate) fn is_called_hammer(name: &str) -> bool {
    let name = name.to_lowercase();
    ["hammer", "force", "impact", "kladivo", "kraft"]
        .iter()
        .any(|w| name.contains(w))
}

/// Is it called as a signal that marks turns or moments, in volts like an uncalibrated hammer?
pub(crate) fn is_called_marker(name: &str) -> bool {
    let name = name.to_lowercase();
    [
        "tach", "trig", "rpm", "speed", "drehzahl", "sync", "key", "puls", "clock", "encoder",
    ]
    .iter()
    .any(|w| name.contains(w))
}

/// Is it called as an accelerometer is? `acc`, `Acc 1`, `tool_acceleration`.
pub(crate) fn is_called_acceleration(name: &str) -> bool {
    words(name).iter().any(|w| w.starts_with("acc"))
}

/// Words of a name in small letters, those of `DynoFx` and `CH1Fx` too.
fn words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut before = ' ';
    for c in name.chars() {
        let begins = c.is_uppercase() && (before.is_lowercase() || before.is_ascii_digit());
        if (begins || !c.is_alphanumeric()) && words.last().is_some_and(|w| !w.is_empty()) {
            words.push(String::new());
        }
        if c.is_alphanumeric()
            && let Some(word) = words.last_mut()
        {
            word.extend(c.to_lowercase());
        }
        before = c;
    }
    words.retain(|w| !w.is_empty());
    words
}

/// Is it the time of the samples? `Time (s)`, `Zeit  1 - Standardmessrate`, `Elapsed Time`.
pub(crate) fn is_time(name: &str) -> bool {
    let base = split_unit(name).0.to_lowercase();
    if TIME.contains(&base.as_str()) || base.contains("时间") || base.contains("時間") {
        return true;
    }
    let words = words(split_unit(name).0);
    let is_word = |at: usize| words.get(at).is_some_and(|w| TIME_WORDS.contains(&w.as_str()));
    if words.get(1).is_some_and(|w| NOT_THE_TIME.contains(&w.as_str())) {
        return false;
    }
    is_word(0) || words.first().is_some_and(|w| BEFORE_TIME.contains(&w.as_str())) && is_word(1)
}

fn named(letters: &str) -> Option<ChannelRole> {
    // Two digits (`Fx12`) are the sum of two of four sensors, not the whole force.
    let bare = letters.trim_end_matches(|c: char| c.is_ascii_digit());
    if letters.len() - bare.len() > 1 {
        return None;
    }
    Some(match bare {
        "fx" | "afx" | "forcex" | "xforce" | "kraftx" => ChannelRole::ForceX,
        "fy" | "afy" | "forcey" | "yforce" | "krafty" => ChannelRole::ForceY,
        "fz" | "afz" | "forcez" | "zforce" | "kraftz" | "thrust" | "thrustforce" => ChannelRole::ForceZ,
        "mz" | "amz" | "momentz" | "torquez" | "torque" | "drehmoment" | "mzmoment" => ChannelRole::TorqueZ,
        _ => return None,
    })
}

fn fits(role: ChannelRole, unit: Option<Unit>) -> bool {
    let expected = if role == ChannelRole::TorqueZ {
        Dimension::MOMENT
    } else {
        Dimension::FORCE
    };
    unit.is_none_or(|u| u.dimension == expected || u.dimension == Dimension::VOLTAGE)
}

/// Role by name (`Fx`, `FX1`, `AFx`, `force_x`, `Mz`, `torque`) where the unit does not speak against it.
pub(crate) fn role_of(name: &str, unit: Option<Unit>) -> ChannelRole {
    let base = split_unit(name).0.to_lowercase();
    let letters: String = base.chars().filter(|c| c.is_alphanumeric()).collect();
    named(&letters)
        .filter(|role| fits(*role, unit))
        .unwrap_or(ChannelRole::Other)
}

/// Role by a part of the name: `Dyno_Fx`, `CH1 Fx`, `AI 1/Fx`, `Fuerza X`, `Moment Z`, `X向力`.
fn role_in(name: &str) -> Option<ChannelRole> {
    let words = words(split_unit(name).0);
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    if words.iter().any(|w| NO_FORCE.contains(w)) {
        return None;
    }
    let mut found: Vec<ChannelRole> = words.iter().filter_map(|w| named(w)).collect();
    let axes: Vec<&str> = words
        .iter()
        .copied()
        .filter(|w| ["x", "y", "z"].contains(w))
        .collect();
    let of_axis = |axis: &str| match axis {
        "x" => ChannelRole::ForceX,
        "y" => ChannelRole::ForceY,
        _ => ChannelRole::ForceZ,
    };
    if found.is_empty() {
        let chinese = words.iter().find(|w| w.contains('力')).and_then(|w| {
            let mut letters = w.chars().filter(char::is_ascii_alphabetic);
            let axis = letters.next().filter(|c| "xyz".contains(*c))?;
            letters.next().is_none().then(|| of_axis(&axis.to_string()))
        });
        let is_moment = words.iter().any(|w| MOMENT_WORDS.contains(w));
        let is_force = words.iter().any(|w| FORCE_WORDS.contains(w) || w.contains('力'));
        let lone_letter = |letter: &str| {
            let mut pairs = words.windows(2);
            !words.contains(&letter) || pairs.any(|p| p[0] == letter && ["x", "y", "z"].contains(&p[1]))
        };
        match axes.as_slice() {
            _ if chinese.is_some() => found.extend(chinese),
            ["z"] if is_moment && lone_letter("m") => found.push(ChannelRole::TorqueZ),
            [] if is_moment && !words.contains(&"m") => found.push(ChannelRole::TorqueZ),
            [axis] if is_force && !is_moment && lone_letter("f") => found.push(of_axis(axis)),
            _ => {}
        }
    }
    match found.as_slice() {
        [one] => Some(*one),
        _ => None,
    }
}

/// What turning calls its forces: cutting force, feed force, passive force.
fn turning_force(name: &str) -> Option<ChannelRole> {
    let base = split_unit(name).0.to_lowercase();
    let letters: String = base.chars().filter(|c| c.is_alphanumeric()).collect();
    Some(match letters.as_str() {
        "fc" | "cuttingforce" | "schnittkraft" | "fuerzadecorte" | "forcedecoupe" | "effortdecoupe" => {
            ChannelRole::ForceZ
        }
        "ff" | "feedforce" | "vorschubkraft" | "fuerzadeavance" | "forcedavance" | "effortdavance" => {
            ChannelRole::ForceX
        }
        "fp" | "passiveforce" | "passivkraft" | "fuerzapasiva" | "forcepassive" | "effortpassif" => {
            ChannelRole::ForceY
        }
        _ => return None,
    })
}

/// True where a header line's field is a name that is understood here.
pub(crate) fn is_known(name: &str) -> bool {
    is_time(name)
        || role_of(name, None) != ChannelRole::Other
        || role_in(name).is_some()
        || turning_force(name).is_some()
}

/// The sensors of a dynamometer with four three-component sensors, as its eight raw channels bring them out: x and y of two together, z
/// of each.
const SENSORS: [(ChannelRole, &str, &[&str]); 3] = [
    (ChannelRole::ForceX, "fx", &["12", "34"]),
    (ChannelRole::ForceY, "fy", &["14", "23"]),
    (ChannelRole::ForceZ, "fz", &["1", "2", "3", "4"]),
];

/// The figures that a name ends with behind its axis: `12` of `Fx1+2`, `Dyno Fx12 [N]`, `Fx_1+2`; blank of `Fx`.
fn figures_behind(name: &str, axis: &str) -> Option<String> {
    let base = split_unit(name).0.to_lowercase();
    let letters: String = base.chars().filter(|c| c.is_alphanumeric()).collect();
    let rest = &letters[letters.rfind(axis)? + axis.len()..];
    rest.bytes().all(|b| b.is_ascii_digit()).then(|| rest.to_string())
}

fn is_sensor(channel: &Channel) -> bool {
    SENSORS.iter().any(|(_, axis, sensors)| {
        figures_behind(&channel.name, axis).is_some_and(|f| sensors.contains(&f.as_str()))
    })
}

/// Forces of which a record has the parts, each from one sensor or two, are their sums. A part is no force by itself. Whether there are
/// such parts.
fn add_up_sensors(channels: &mut Vec<Channel>, notes: &mut Notes) -> bool {
    let parts_of = |channels: &[Channel], axis: &str, sensors: &[&str]| -> Vec<usize> {
        let figures: Vec<Option<String>> = channels.iter().map(|c| figures_behind(&c.name, axis)).collect();
        let found: Vec<usize> = (0..channels.len())
            .filter(|i| figures[*i].as_ref().is_some_and(|f| !f.is_empty()))
            .collect();
        let place = |i: &usize| sensors.iter().position(|s| figures[*i].as_deref() == Some(*s));
        let mut places: Vec<Option<usize>> = found.iter().map(place).collect();
        places.sort_unstable();
        // Each once and no other: `Fx12` among `Fx1` to `Fx40` is one of forty cuts.
        match places.into_iter().eq((0..sensors.len()).map(Some)) {
            true => found,
            false => Vec::new(),
        }
    };
    // `Fz1` to `Fz4` alone may be of four cuts.
    if SENSORS[..2]
        .iter()
        .all(|(_, axis, sensors)| parts_of(channels, axis, sensors).is_empty())
    {
        return false;
    }
    for (role, axis, sensors) in SENSORS {
        let parts = parts_of(channels, axis, sensors);
        channels
            .iter_mut()
            .filter(|c| c.role == role && is_sensor(c))
            .for_each(|c| c.role = ChannelRole::Other);
        let unit = |i: usize| channels[i].file_unit.clone();
        let length = parts
            .iter()
            .map(|i| channels[*i].samples.len())
            .min()
            .unwrap_or(0);
        if parts.is_empty() || channels.iter().any(|c| c.role == role) {
            continue;
        }
        if parts.iter().any(|i| unit(*i) != unit(parts[0])) {
            notes.file(format!(
                "the parts of {} have several units and are not added up",
                text_of(channels, &parts)
            ));
            continue;
        }
        let sum = |at: usize| parts.iter().map(|i| channels[*i].samples[at]).sum();
        let whole = Channel {
            name: text_of(channels, &parts),
            file_unit: unit(parts[0]),
            role,
            samples: (0..length).map(sum).collect(),
        };
        notes.about(&whole.name, "sensors of one dynamometer: added up to the force");
        channels.push(whole);
    }
    true
}

/// `Fx1+2 + Fx3+4`, the names of these channels without their units.
fn text_of(channels: &[Channel], parts: &[usize]) -> String {
    let names: Vec<&str> = parts.iter().map(|i| split_unit(&channels[*i].name).0).collect();
    names.join(" + ")
}

/// Gives roles to the channels of a record that only a part of their name tells, where nobody else has them; and tells it.
pub(crate) fn settle(channels: &mut Vec<Channel>, notes: &mut Notes) {
    const ROLES: [(ChannelRole, &str); 4] = [
        (ChannelRole::ForceX, "Fx"),
        (ChannelRole::ForceY, "Fy"),
        (ChannelRole::ForceZ, "Fz"),
        (ChannelRole::TorqueZ, "Mz"),
    ];
    let has_sensors = add_up_sensors(channels, notes);
    let unit = |c: &Channel| units::parse_named(&c.file_unit).or_else(|| unit_in_name(&c.name));
    let open = |c: &Channel, role: ChannelRole| c.role == ChannelRole::Other && fits(role, unit(c));
    for (role, label) in ROLES {
        // Elements of one cell array (`Fx{1}`, `Fx{2}`) are of several cuts, none is the force.
        let elements = |c: &Channel| c.role == role && c.name.ends_with('}');
        if channels.iter().filter(|c| elements(c)).count() > 1 {
            channels
                .iter_mut()
                .filter(|c| elements(c))
                .for_each(|c| c.role = ChannelRole::Other);
        }
        if channels.iter().any(|c| c.role == role) {
            continue;
        }
        let mine = |c: &&mut Channel| {
            open(c, role) && role_in(&c.name) == Some(role) && !(has_sensors && is_sensor(c))
        };
        let mut mine: Vec<&mut Channel> = channels.iter_mut().filter(mine).collect();
        match mine.as_mut_slice() {
            [] => {}
            [one] => {
                one.role = role;
                notes.about(&one.name, "taken for a force (moment) by a part of the name");
            }
            several => {
                let names: Vec<&str> = several.iter().map(|c| c.name.as_str()).collect();
                notes.file(format!(
                    "{} could each be {label}: say which it is in a [[channel]] of campaign.toml (name, in_file, and cut where each \
                     is a cut of its own; `lobestone init FOLDER` writes them)",
                    names.join(", ")
                ));
            }
        }
    }
    let is_force = |c: &Channel| ROLES[..3].iter().any(|(role, _)| c.role == *role);
    if channels.iter().any(is_force) {
        return;
    }
    let has_torque = channels.iter().any(|c| c.role == ChannelRole::TorqueZ);
    let of_turning = |c: &Channel| turning_force(&c.name).filter(|role| open(c, *role));
    let roles: Vec<Option<ChannelRole>> = channels.iter().map(of_turning).collect();
    let count = |role: ChannelRole| roles.iter().filter(|r| **r == Some(role)).count();
    let kinds: Vec<usize> = ROLES[..3].iter().map(|(role, _)| count(*role)).collect();
    if kinds.iter().any(|n| *n > 1) {
        return;
    }
    match kinds.as_slice() {
        // A feed force beside a torque is what pushes a drill.
        [1, 0, 0] if has_torque => {
            for (channel, role) in channels.iter_mut().zip(&roles) {
                if role.is_some() {
                    channel.role = ChannelRole::ForceZ;
                    notes.about(
                        &channel.name,
                        "a feed force beside a torque: taken for Fz, the thrust of a drill",
                    );
                }
            }
        }
        kinds if kinds.iter().sum::<usize>() >= 2 => {
            for (channel, role) in channels.iter_mut().zip(&roles) {
                if let Some(role) = role {
                    channel.role = *role;
                    notes.about(
                        &channel.name,
                        "turning's names: the feed force is taken for x, the passive for y, the cutting force for z",
                    );
                }
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_as_laboratories_write_them() {
        use ChannelRole::{ForceX, ForceY, ForceZ, TorqueZ};
        for (name, role) in [
            ("Dyno_Fx [N]", ForceX),
            ("CH1 Fx", ForceX),
            ("AI 2/Fy (N)", ForceY),
            ("DynoFz", ForceZ),
            ("Fuerza X (N)", ForceX),
            ("Effort Y (N)", ForceY),
            ("Kraft Z", ForceZ),
            ("Force-Z-axis", ForceZ),
            ("Dyno F_x", ForceX),
            ("X向力(N)", ForceX),
            ("cut1.Force_X", ForceX),
            ("Fx.amplitude", ForceX),
            ("Data1_Fy", ForceY),
            ("Moment Z (N-m)", TorqueZ),
            ("Spindle torque", TorqueZ),
        ] {
            assert_eq!(role_in(name), Some(role), "{name}");
        }
        for name in [
            "Acc_x [g]",
            "Fx max",
            "hammer Fx",
            "Moment X",
            "Force",
            "x",
            "Fx12",
            "f_x_sim",
            "m",
            "temperature",
            "F1",
        ] {
            assert_eq!(role_in(name), None, "{name}");
        }
    }

    #[test]
    fn the_time_is_known_by_its_name() {
        for name in [
            "Time (s)",
            "Zeit  1 - Standardmessrate [s]",
            "Elapsed Time (sec)",
            "X_Time [s]",
            "时间(s)",
            "timestamp",
            "t_s",
        ] {
            assert!(is_time(name), "{name}");
        }
        for name in ["T_tool", "temperature", "torque", "runtime", "Fx", "delay"] {
            assert!(!is_time(name), "{name}");
        }
    }

    fn channels(names: &[&str]) -> Vec<Channel> {
        let channel = |name: &&str| Channel {
            name: (*name).into(),
            file_unit: String::new(),
            role: role_of(name, None),
            samples: Vec::new(),
        };
        names.iter().map(channel).collect()
    }

    #[test]
    fn the_sensors_of_a_dynamometer_are_added_up() {
        use ChannelRole::{ForceX, ForceY, ForceZ, Other};
        let names = [
            "Fx1+2", "Fx3+4", "Fy14 [N]", "Fy23 [N]", "Fz1", "Fz2", "Fz3", "Fz4",
        ];
        let mut all = channels(&names);
        for (i, channel) in all.iter_mut().enumerate() {
            channel.samples = vec![i as f64, 10.0];
        }
        let mut notes = Notes::default();
        settle(&mut all, &mut notes);
        let told = notes.into_warnings().join("\n");
        assert!(told.contains("Fz1 + Fz2 + Fz3 + Fz4"), "{told}");
        let of = |role| {
            all.iter()
                .filter(|c| c.role == role)
                .map(|c| c.samples.clone())
                .collect::<Vec<_>>()
        };
        assert_eq!(of(ForceX), [[1.0, 20.0]]);
        assert_eq!(of(ForceY), [[5.0, 20.0]]);
        assert_eq!(of(ForceZ), [[22.0, 40.0]]);
        assert_eq!(of(Other).len(), 8);
        // Once more changes nothing: long files are read in pieces and looked at again as a whole.
        settle(&mut all, &mut Notes::default());
        assert_eq!(all.len(), 11);
        // One of four is not the force.
        let mut some = channels(&["Fx12", "Fx34", "Fy", "Fz1"]);
        settle(&mut some, &mut Notes::default());
        assert_eq!(
            some.iter().map(|c| c.role).collect::<Vec<_>>(),
            [Other, Other, ForceY, Other, ForceX]
        );
        let mut cuts = channels(&["Fz1", "Fz2", "Fz3", "Fz4"]);
        settle(&mut cuts, &mut Notes::default());
        assert_eq!(cuts.len(), 4);
        // Nor are two of forty cuts.
        let forty: Vec<String> = (1..=40).map(|i| format!("Fx{i}")).collect();
        let mut cuts = channels(&forty.iter().map(String::as_str).collect::<Vec<_>>());
        settle(&mut cuts, &mut Notes::default());
        assert_eq!(cuts.len(), 40);
    }

    #[test]
    fn roles_are_given_once_and_what_could_be_two_is_told() {
        let roles = |names: &[&str]| -> (Vec<ChannelRole>, String) {
            let (mut all, mut notes) = (channels(names), Notes::default());
            settle(&mut all, &mut notes);
            (
                all.iter().map(|c| c.role).collect(),
                notes.into_warnings().join("\n"),
            )
        };
        use ChannelRole::{ForceX, ForceY, ForceZ, Other, TorqueZ};
        assert_eq!(roles(&["Fx", "Dyno_Fx"]).0, [ForceX, Other]);
        let (two, told) = roles(&["Fx_R_1", "Fx_R_2", "Fy_R_1"]);
        assert_eq!(two, [Other, Other, ForceY]);
        assert!(told.contains("Fx_R_1, Fx_R_2 could each be Fx"), "{told}");
        let (cells, told) = roles(&["Fx{1}", "Fx{2}", "Fy"]);
        assert_eq!(cells, [Other, Other, ForceY]);
        assert!(told.contains("Fx{1}, Fx{2} could each be Fx"), "{told}");
        assert_eq!(roles(&["Fc [N]", "Ff [N]", "Fp [N]"]).0, [ForceZ, ForceX, ForceY]);
        assert_eq!(roles(&["Vorschubkraft", "Drehmoment"]).0, [ForceZ, TorqueZ]);
        assert_eq!(roles(&["Fc", "Acc"]).0, [Other, Other]);
    }
}
