//! Text for people: numbers with the figures that count, what files say made harmless for a terminal, and what a writer may
//! have meant.

use std::borrow::Cow;
use std::path::Path;

/// A number for people, with so many figures that count and no exponent: `18.30`, `0.01265`, `29930`.
pub fn figures(value: f64, count: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let decimals = (count - 1 - value.abs().log10().floor() as i32).clamp(0, 12) as usize;
    format!("{value:.decimals$}")
}

/// A frequency in a sentence: two places, three figures below 1 Hz.
pub fn hertz(value: f64) -> String {
    match value.abs() < 1.0 {
        true => figures(value, 3),
        false => format!("{value:.2}"),
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

/// A path as one word of a command line.
pub fn shell_word(path: &Path) -> String {
    let text = path.display().to_string();
    let plain = |c: char| c.is_alphanumeric() || "/\\._-+:,@%~=".contains(c);
    let quoted = match text.chars().all(plain) && !text.is_empty() {
        true => text,
        false if text.contains('\'') => format!("\"{text}\""),
        false => format!("'{text}'"),
    };
    match quoted.starts_with('-') {
        true => format!("./{quoted}"),
        false => quoted,
    }
}

/// The first letter large.
pub fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    first.chain(letters).collect()
}

/// The probability of a chance finding, in a sentence: `p = 0.03`, `p < 0.0001`. What is smaller tells a reader nothing more.
pub fn chance(p: f64) -> String {
    const LEAST: f64 = 1e-4;
    match p {
        p if p < LEAST => format!("p < {LEAST}"),
        p if p < 0.01 => format!("p = {p:.4}"),
        p if p < 0.1 => format!("p = {p:.3}"),
        p => format!("p = {p:.2}"),
    }
}

/// Text as XML holds it, also within quotes; control characters, which it cannot hold, are left out.
pub fn xml_escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out += "&amp;",
            '<' => out += "&lt;",
            '>' => out += "&gt;",
            '"' => out += "&quot;",
            c if c.is_control() && !matches!(c, '\n' | '\t') => {}
            '\u{fffe}' | '\u{ffff}' => {}
            c => out.push(c),
        }
    }
    out
}

/// Text of a file as it may be shown on a terminal: control characters, and those that turn the direction of writing
/// around or cannot be seen, become `\u{1b}`.
pub fn shown(text: &str) -> Cow<'_, str> {
    let is_harmful = |c: char| {
        c.is_control() && c != '\t' && c != '\n'
            || matches!(c, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
    };
    if !text.contains(is_harmful) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match is_harmful(c) {
            true => shown.extend(c.escape_unicode()),
            false => shown.push(c),
        }
    }
    Cow::Owned(shown)
}

/// As [`shown`], for names and remarks: a line break, too, becomes `\u{a}`.
pub fn shown_on_one_line(text: &str) -> String {
    shown(text).replace('\n', "\\u{a}")
}

/// The candidate nearest to `word`, if one is near enough to be a slip of the finger or only has more
/// behind it: most often the unit (`helix` for `helix_deg`).
pub fn closest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // A longer word is no slip, and the distance (Levenshtein) costs length × length.
    if word.len() > 64 {
        return None;
    }
    let word = word.to_lowercase();
    let candidates: Vec<&str> = candidates.into_iter().collect();
    let unit_left_out = |candidate: &&&str| {
        candidate
            .strip_prefix(word.as_str())
            .is_some_and(|rest| rest.starts_with('_'))
    };
    if let Some(longer) = candidates.iter().find(unit_left_out) {
        return Some(longer);
    }
    candidates
        .into_iter()
        .map(|candidate| (strsim::levenshtein(&word, &candidate.to_lowercase()), candidate))
        .filter(|(distance, candidate)| *distance <= 1 + candidate.len().min(word.len()) / 4)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// Text of a file as a message may show it: short, without control characters.
pub fn shown_briefly(text: &str) -> String {
    const LONGEST: usize = 60;
    let mut out: String = text
        .chars()
        .take(LONGEST)
        .map(|c| if c.is_control() { '\u{fffd}' } else { c })
        .collect();
    if text.chars().nth(LONGEST).is_some() {
        out.push('…');
    }
    out
}

/// Degrees of an angle, without the last digits that a conversion to radians leaves behind (1e-12 of a degree).
pub fn to_degrees(rad: f64) -> f64 {
    let degrees = rad.to_degrees();
    let round = (degrees * 1e12).round() * 1e-12;
    match degrees.abs() < 1e3 {
        // Through text: 90.0, not 90.00000000000001.
        true => format!("{round:.12}").parse().unwrap_or(degrees) + 0.0,
        false => degrees,
    }
}

/// Text in quotes as TOML has it.
pub fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_would_drive_a_terminal_is_shown() {
        assert_eq!(shown("Fx [N]\tµm²"), "Fx [N]\tµm²");
        assert_eq!(shown("\u{1b}[31mFx\u{9b}2J\u{7}"), "\\u{1b}[31mFx\\u{9b}2J\\u{7}");
        assert_eq!(shown("a\u{202e}b\u{200b}"), "a\\u{202e}b\\u{200b}");
    }

    #[test]
    fn lists_read_as_people_write_them() {
        let of = |n: usize| listed(&["a", "b", "c"].map(String::from)[..n]);
        assert_eq!([of(0), of(1), of(2), of(3)], ["", "a", "a and b", "a, b and c"]);
    }

    #[test]
    fn a_chance_has_no_more_digits_than_it_is_known_to() {
        assert_eq!(chance(0.6249), "p = 0.62");
        assert_eq!(chance(0.0499), "p = 0.050");
        assert_eq!(chance(0.00321), "p = 0.0032");
        assert_eq!(chance(3.2e-9), "p < 0.0001");
    }

    #[test]
    fn slips_are_recognised_and_strangers_are_not() {
        let keys = ["feed_per_tooth_mm", "feed_per_rev_mm", "id", "file"];
        assert_eq!(closest("feeed_per_tooth_mm", keys), Some("feed_per_tooth_mm"));
        assert_eq!(closest("Feed_per_rev_mm", keys), Some("feed_per_rev_mm"));
        assert_eq!(closest("fiel", keys), Some("file"));
        assert_eq!(closest("feed_per_tooth", keys), Some("feed_per_tooth_mm"));
        assert_eq!(closest("operator", keys), None);
        assert_eq!(closest(&"x".repeat(100_000), keys), None);
    }

    #[test]
    fn a_path_is_one_word() {
        for (path, expected) in [
            ("cell7", "cell7"),
            ("/tmp/my cell", "'/tmp/my cell'"),
            ("it's", "\"it's\""),
            ("-x", "./-x"),
            ("", "''"),
        ] {
            assert_eq!(shell_word(Path::new(path)), expected);
        }
    }

    #[test]
    fn shown_text_is_short_and_printable() {
        assert_eq!(shown_briefly("a\u{1b}[31m\nb"), "a\u{fffd}[31m\u{fffd}b");
        assert_eq!(shown_briefly(&"é".repeat(100)).chars().count(), 61);
    }
}
