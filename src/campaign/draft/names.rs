//! What names and headers of files say about a cut or an FRF: `n1200_fz0.05_ap2`, `p3_200N`, `Spindle speed [rpm]:;1200`.

use std::collections::BTreeMap;

/// Key of `campaign.toml` and its value as a person would type it.
pub type Facts = BTreeMap<&'static str, String>;

/// Spindle speeds below this are sample numbers: `s1`, `n2`.
const SLOWEST_RPM: f64 = 50.0;

/// Facts in a name or a line of text.
pub fn facts_of(text: &str) -> Facts {
    let mut facts = Facts::new();
    let words: Vec<&str> = text
        .split(|c: char| c.is_whitespace() || "_-;=()[]/\\".contains(c))
        .filter(|w| !w.is_empty())
        .collect();
    let mut i = 0;
    while i < words.len() {
        let (mut letters, mut rest) = split_letters(words[i]);
        // `ap 2`, `n=1200`
        if rest.is_empty()
            && words
                .get(i + 1)
                .is_some_and(|w| w.starts_with(|c: char| c.is_ascii_digit()))
        {
            letters = words[i];
            rest = words[i + 1];
            i += 1;
        }
        let (number, mut unit) = split_number(rest);
        if unit.is_empty() && number.is_some() {
            unit = words.get(i + 1).filter(|w| is_unit(w)).copied().unwrap_or("");
        }
        if let Some((key, value)) = fact(&letters.to_lowercase(), number, &unit.to_lowercase()) {
            facts.entry(key).or_insert(value);
        }
        i += 1;
    }
    facts
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
        return match letters {
            "slot" | "slotting" | "fullslot" => Some(("immersion", "slot".into())),
            "mill" | "milling" | "fraesen" | "fräsen" => Some(("process", "milling".into())),
            "drill" | "drilling" | "bohren" => Some(("process", "drilling".into())),
            _ => None,
        };
    };
    let key = match (letters, unit) {
        (_, "rpm" | "upm") | ("rpm", "") => "spindle_rpm",
        ("n" | "s", "") if number >= SLOWEST_RPM => "spindle_rpm",
        ("fz", "" | "mm") => "feed_per_tooth_mm",
        ("f" | "fu", "" | "mm") => "feed_per_rev_mm",
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

/// The posture that an FRF file's path names: a word like `p3`, `pos3`, `posture-3`, else the folder it shares with
/// others of its posture, else its own name.
pub fn posture_of(path: &str, in_posture_folders: bool) -> String {
    let (folder, file) = path.rsplit_once('/').unwrap_or(("", path));
    let stem = file.rsplit_once('.').map_or(file, |(stem, _)| stem);
    let folder = folder.rsplit('/').next().unwrap_or("");
    for name in [stem, folder] {
        for word in name.split(|c: char| !c.is_alphanumeric()) {
            let (letters, digits) = split_letters(word);
            let is_number = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
            if is_number && ["p", "pos", "pose", "posture"].contains(&letters.to_lowercase().as_str()) {
                return word.to_string();
            }
        }
    }
    match in_posture_folders {
        true => folder.to_string(),
        false => stem.to_string(),
    }
}

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
        // Sample numbers and dates are no speeds.
        for text in [
            "cut01",
            "s1",
            "n2_2021-03-16",
            "force-9400 cut 01",
            "sample 12",
            "ap",
            "fz0",
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
        ] {
            assert_eq!(posture_of(path, folders), expected, "{path}");
        }
    }
}
