//! Text for people: numbers with the figures that count, and what files say made harmless for a terminal.

use std::borrow::Cow;

/// A number for people, with so many figures that count and no exponent: `18.30`, `0.01265`, `29930`.
pub fn figures(value: f64, count: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let decimals = (count - 1 - value.abs().log10().floor() as i32).clamp(0, 12) as usize;
    format!("{value:.decimals$}")
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_would_drive_a_terminal_is_shown() {
        assert_eq!(shown("Fx [N]\tµm²"), "Fx [N]\tµm²");
        assert_eq!(shown("\u{1b}[31mFx\u{9b}2J\u{7}"), "\\u{1b}[31mFx\\u{9b}2J\\u{7}");
        assert_eq!(shown("a\u{202e}b\u{200b}"), "a\\u{202e}b\\u{200b}");
    }
}
