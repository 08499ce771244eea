//! What names and headers of files say about a cut or an FRF: `n1200_fz0.05_ap2`, `p3_200N`, `Spindle speed [rpm]:;1200`.

use std::collections::BTreeMap;

use super::list_columns::{CUTTING_SPEED, DIRECTION, FEED_RATE, RADIAL_DEPTH, english, is_down};

/// Key of `campaign.toml` and its value as a person would type it.
pub type Facts = BTreeMap<&'static str, String>;

/// Spindle speeds below this are sample numbers: `s1`, `n2`.
const SLOWEST_RPM: f64 = 50.0;

/// Fastest spindle that a number without a name is taken for, and slowest.
const BARE_RPM: std::ops::RangeInclusive<f64> = 200.0..=60_000.0;
/// A number like a year says nothing.
const YEARS: std::ops::Range<f64> = 1950.0..2050.0;
/// `f300` is a feed rate in mm/min, `f0.1` one in mm per turn.
const LEAST_FEED_RATE: f64 = 10.0;

/// Facts in a name or a line of text.
pub fn facts_of(text: &str) -> Facts {
    let mut facts = Facts::new();
    let words: Vec<&str> = text
        .split(|c: char| c.is_whitespace() || "_-;=()[]/\\".contains(c))
        .filter(|w| !w.is_empty())
        .collect();
    let mut bare: Vec<f64> = Vec::new();
    // The number after a word is the word's: `cut 4`, `force-9400`.
    let mut word_before = false;
    let mut i = 0;
    while i < words.len() {
        let pieces = pieces(words[i]);
        if pieces.len() > 1 {
            let found: Facts = pieces.iter().filter_map(|p| fact_of_piece(p, "")).collect();
            // One alone may be anything: a version, a serial number.
            if found.len() > 1 {
                found.into_iter().for_each(|(k, v)| {
                    facts.entry(k).or_insert(v);
                });
            }
            (word_before, i) = (false, i + 1);
            continue;
        }
        let starts_with_digit = |w: &&str| w.starts_with(|c: char| c.is_ascii_digit());
        let (letters, rest) = split_letters(words[i]);
        let mut piece = words[i].to_string();
        // `ap 2`, `n=1200`
        let takes_next = rest.is_empty() && words.get(i + 1).is_some_and(starts_with_digit);
        if takes_next {
            piece += words[i + 1];
            i += 1;
        }
        let unit = words.get(i + 1).filter(|w| is_unit(w)).copied().unwrap_or("");
        match fact_of_piece(&piece, unit) {
            Some((key, value)) => {
                facts.entry(key).or_insert(value);
            }
            None if letters.is_empty() && unit.is_empty() && !word_before => {
                bare.extend(
                    split_number(words[i])
                        .0
                        .filter(|_| split_number(words[i]).1.is_empty()),
                );
            }
            None => (),
        }
        word_before = !letters.is_empty() && !takes_next && rest.is_empty();
        i += 1;
    }
    let is_dated = words
        .iter()
        .filter_map(|w| w.parse::<f64>().ok())
        .any(|n| YEARS.contains(&n) || n > 1e7);
    let speeds: Vec<&f64> = bare
        .iter()
        .filter(|n| BARE_RPM.contains(n) && n.fract() == 0.0)
        .collect();
    if let ([speed], false) = (speeds.as_slice(), is_dated) {
        facts.entry("spindle_rpm").or_insert_with(|| speed.to_string());
    }
    facts
}

/// `n6000f300ap3` → `n6000`, `f300`, `ap3`; what holds one number stays whole.
fn pieces(word: &str) -> Vec<&str> {
    let mut starts = vec![0];
    let bytes = word.as_bytes();
    let mut at = 0;
    while let Some(letter) = (at + 1..bytes.len()).find(|&i| {
        bytes[i].is_ascii_alphabetic() && !bytes[i - 1].is_ascii_alphabetic() && word.is_char_boundary(i)
    }) {
        let run = word[letter..].bytes().take_while(u8::is_ascii_alphabetic).count();
        let before = bytes[letter - 1].is_ascii_digit();
        let after = bytes.get(letter + run).is_some_and(u8::is_ascii_digit);
        // `2p5` is a decimal point.
        if before && after && &word[letter..letter + run] != "p" {
            starts.push(letter);
        }
        at = letter + run - 1;
    }
    let ends = starts.iter().copied().skip(1).chain([word.len()]);
    starts
        .iter()
        .zip(ends)
        .map(|(from, to)| &word[*from..to])
        .collect()
}

/// The fact in letters, a number and a unit behind it; `unit` where none is.
fn fact_of_piece(piece: &str, unit: &str) -> Option<(&'static str, String)> {
    let (letters, rest) = split_letters(piece);
    let (number, own) = split_number(rest);
    let unit = if own.is_empty() && number.is_some() {
        unit
    } else {
        own
    };
    fact(&letters.to_lowercase(), number, &unit.to_lowercase())
}

fn is_unit(word: &str) -> bool {
    ["rpm", "n", "mm"].contains(&word.to_lowercase().as_str())
}

fn split_letters(word: &str) -> (&str, &str) {
    let end = word.find(|c: char| !c.is_alphabetic()).unwrap_or(word.len());
    word.split_at(end)
}

/// `0.05mm`, `0,05`, `0p05` → the number and what follows.
fn split_number(text: &str) -> (Option<f64>, &str) {
    let mut end = 0;
    let mut point = false;
    let bytes = text.as_bytes();
    for (i, b) in bytes.iter().enumerate() {
        let digit_next = bytes.get(i + 1).is_some_and(u8::is_ascii_digit);
        match b {
            b'0'..=b'9' => end = i + 1,
            b'.' | b',' | b'p' if !point && i > 0 && digit_next => point = true,
            _ => break,
        }
    }
    let (number, rest) = text.split_at(end);
    (number.replace([',', 'p'], ".").parse().ok(), rest)
}

fn fact(letters: &str, number: Option<f64>, unit: &str) -> Option<(&'static str, String)> {
    let Some(number) = number else {
        let direction = is_down(letters).map(|down| (DIRECTION, if down { "down" } else { "up" }));
        return english(letters)
            .or(direction)
            .map(|(key, word)| (key, word.into()));
    };
    let key = match (letters, unit) {
        (_, "rpm" | "upm") | ("rpm", "") => "spindle_rpm",
        ("n" | "s", "") if number >= SLOWEST_RPM => "spindle_rpm",
        ("fz", "" | "mm") => "feed_per_tooth_mm",
        ("vf", "") => FEED_RATE,
        ("vc", "") => CUTTING_SPEED,
        ("f", "") if number >= LEAST_FEED_RATE => FEED_RATE,
        ("f" | "fu", "" | "mm") => "feed_per_rev_mm",
        ("ae", "" | "mm") => RADIAL_DEPTH,
        ("ap", "" | "mm") => "axial_depth_mm",
        ("pilot", "" | "mm") => "pilot_diameter_mm",
        ("" | "f", "n") => "force_level_n",
        _ => return None,
    };
    (number > 0.0).then(|| (key, number.to_string()))
}

/// Facts in the first lines of a text file: `Key:,value`, `Key:;value`, `Key: value`.
pub fn facts_of_header(start: &[u8]) -> Facts {
    const LINES: usize = 30;
    let mut facts = Facts::new();
    // Latin-1: every byte is a character, and only ASCII words are looked for.
    let text: String = start.iter().map(|b| char::from(*b)).collect();
    for line in text.lines().take(LINES) {
        let Some((key, value)) = line.split_once(':') else {
            continue;
        };
        let key = key.to_lowercase();
        let value = value.trim_matches(|c: char| c.is_whitespace() || ",;\"".contains(c));
        let has = |words: &[&str]| words.iter().all(|w| key.contains(w));
        let wanted = match () {
            _ if has(&["spindle"]) && (has(&["rpm"]) || has(&["speed"])) => "spindle_rpm",
            _ if has(&["feed", "tooth"]) => "feed_per_tooth_mm",
            _ if has(&["feed", "rev"]) => "feed_per_rev_mm",
            _ if has(&["axial", "depth"]) => "axial_depth_mm",
            _ if has(&["pilot"]) => "pilot_diameter_mm",
            _ if has(&["hole", "depth"]) => "hole_depth_mm",
            // Free text.
            _ if key == "name" || key == "title" || key == "comment" => {
                facts.extend(facts_of(value));
                continue;
            }
            _ => continue,
        };
        if let (Some(number), "" | "mm" | "rpm" | " mm" | " rpm") = split_number(value) {
            facts.insert(wanted, number.to_string());
        }
    }
    facts
}

const POSTURE_WORDS: [&str; 10] = [
    "pos",
    "pose",
    "posture",
    "position",
    "stellung",
    "lage",
    "haltung",
    "posicion",
    "posición",
    "postura",
];
/// Letters alone that name a posture; F and H are what is measured, X, Y and Z directions.
const POSTURE_LETTERS: std::ops::RangeInclusive<char> = 'A'..='E';

/// The posture that an FRF file's path names, and why where that is a guess: a word like `p3`, `pos3`, `Pos A`, a letter alone,
/// else the folder it shares with others of its posture, else its own name.
pub fn posture_of(path: &str, in_posture_folders: bool) -> (String, Option<&'static str>) {
    let (folder, file) = path.rsplit_once('/').unwrap_or(("", path));
    let stem = file.rsplit_once('.').map_or(file, |(stem, _)| stem);
    let folder = folder.rsplit('/').next().unwrap_or("");
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let letter = |text: &str| {
        let mut letters = text.chars();
        match (letters.next(), letters.next()) {
            (Some(one), None) => POSTURE_LETTERS
                .contains(&one.to_ascii_uppercase())
                .then(|| one.to_ascii_uppercase().to_string()),
            _ => None,
        }
    };
    for name in [stem, folder] {
        let words: Vec<&str> = name
            .split(|c: char| !c.is_alphanumeric())
            .filter(|w| !w.is_empty())
            .collect();
        for (i, word) in words.iter().enumerate() {
            let (letters, digits) = split_letters(word);
            let lower = letters.to_lowercase();
            if is_number(digits) && (lower == "p" || POSTURE_WORDS.contains(&lower.as_str())) {
                return (word.to_string(), None);
            }
            // `Pos A`, `Pos 3`, `posC`
            if digits.is_empty() && POSTURE_WORDS.contains(&lower.as_str()) {
                let next = words.get(i + 1).copied().unwrap_or("");
                if is_number(next) {
                    return (format!("{word}{next}"), Some(FROM_NAME));
                }
                if let Some(id) = letter(next) {
                    return (id, Some(FROM_NAME));
                }
            }
            let attached = POSTURE_WORDS
                .iter()
                .find_map(|w| lower.strip_prefix(w).and_then(letter));
            if let (Some(id), true) = (attached, digits.is_empty()) {
                return (id, Some(FROM_NAME));
            }
        }
        let alone = words.iter().filter(|w| w.chars().all(char::is_uppercase));
        if let [id] = alone.filter_map(|w| letter(w)).collect::<Vec<_>>().as_slice() {
            return (id.clone(), Some("from a letter in the file name"));
        }
    }
    match in_posture_folders {
        true => (folder.to_string(), Some("from the folder")),
        false => (stem.to_string(), None),
    }
}

pub(super) const FROM_NAME: &str = "from the file name";

#[cfg(test)]
mod tests {
    use super::*;

    fn list(text: &str) -> Vec<(&'static str, String)> {
        facts_of(text).into_iter().collect()
    }

    #[test]
    fn names_say_what_was_cut() {
        let all = list("cut01_slot_n1200_fz0.05_ap2mm");
        let expected = [
            ("axial_depth_mm", "2"),
            ("feed_per_tooth_mm", "0.05"),
            ("immersion", "slot"),
            ("spindle_rpm", "1200"),
        ];
        assert_eq!(all, expected.map(|(k, v)| (k, v.to_string())));
        for text in ["S4500 ap=2,5", "4500rpm-ap2p5", "ap 2.5 mm, 4500 rpm"] {
            let facts = facts_of(text);
            assert_eq!(facts["spindle_rpm"], "4500", "{text}");
            assert_eq!(facts["axial_depth_mm"], "2.5", "{text}");
        }
        assert_eq!(list("p3_F200N"), [("force_level_n", "200".to_string())]);
        let compact = list("6-n6000f300ap3ae25");
        let expected = [
            ("axial_depth_mm", "3"),
            ("feed_mm_per_min", "300"),
            ("radial_depth_mm", "25"),
            ("spindle_rpm", "6000"),
        ];
        assert_eq!(compact, expected.map(|(k, v)| (k, v.to_string())));
        let bare = facts_of("Versuch_4 1620 fz0,05 Gleichlauf");
        assert_eq!(bare["spindle_rpm"], "1620");
        assert_eq!(bare["feed_per_tooth_mm"], "0.05");
        assert_eq!(bare["direction"], "down");
        // Sample numbers and dates are no speeds.
        for text in [
            "cut01",
            "s1",
            "n2_2021-03-16",
            "force-9400 cut 01",
            "sample 12",
            "ap",
            "fz0",
            "Messung 2024-03-12_1542",
            "rev2b3",
        ] {
            assert!(list(text).is_empty(), "{text}: {:?}", list(text));
        }
    }

    #[test]
    fn headers_say_what_was_cut() {
        let header = "Name:;trial n900\nSpindle speed [rpm]:;1200\nFeed per tooth:,0.05 mm\nSampling rate [Hz]:;5000\n";
        let facts = facts_of_header(header.as_bytes());
        assert_eq!(facts["spindle_rpm"], "1200");
        assert_eq!(facts["feed_per_tooth_mm"], "0.05");
        assert_eq!(facts.len(), 2);
    }

    #[test]
    fn postures_are_named_by_word_folder_or_file() {
        for (path, folders, expected) in [
            ("frf/p1.uff", false, "p1"),
            ("frf/cell7_p12_200N.uff", false, "p12"),
            ("frf/Pos3/x.csv", true, "Pos3"),
            ("home/x.csv", true, "home"),
            ("frf/home.csv", false, "home"),
            ("frf/plate2.csv", false, "plate2"),
            ("roh/FRF_Pos A (neu).csv", false, "A"),
            ("roh/frf_posC_v2.CSV", true, "C"),
            ("frf_B_200N.uff", false, "B"),
            ("frf/Stellung 3.uff", false, "Stellung3"),
            ("frf/FRF_X.uff", false, "FRF_X"),
        ] {
            assert_eq!(posture_of(path, folders).0, expected, "{path}");
        }
    }
}
