//! What may reach a terminal.

use std::borrow::Cow;

/// Beginnings and ends of what [`Emphasis`](super::text::Emphasis) marks; nothing else that begins with an escape is printed.
const STYLES: [&str; 5] = ["\u{1b}[0m", "\u{1b}[1m", "\u{1b}[31m", "\u{1b}[32m", "\u{1b}[33m"];

/// Whether a terminal would do something with it instead of showing it, line breaks and tabs apart: control characters and
/// the marks that turn the direction of writing.
fn is_order(c: char) -> bool {
    (c.is_control() && !matches!(c, '\n' | '\t'))
        || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// `text` with every order to the terminal written out (`\u{1b}`), except this program's own colours.
pub fn shown(text: &str) -> Cow<'_, str> {
    if !text.chars().any(is_order) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        if let Some(style) = STYLES.iter().find(|style| rest.starts_with(**style)) {
            out += style;
            rest = &rest[style.len()..];
            continue;
        }
        match is_order(c) {
            true => out.extend(c.escape_unicode()),
            false => out.push(c),
        }
        rest = &rest[c.len_utf8()..];
    }
    Cow::Owned(out)
}

/// A JSON document in which characters that a terminal obeys are written as escapes: the same document.
pub fn shown_json(text: &str) -> Cow<'_, str> {
    // What lies below a blank is escaped already; line breaks stand between values.
    if !text.chars().any(is_order) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match is_order(c) {
            true => out += &format!("\\u{:04x}", u32::from(c)),
            false => out.push(c),
        }
    }
    Cow::Owned(out)
}

#[cfg(test)]
mod tests {
    use super::super::text::Emphasis;
    use super::*;

    #[test]
    fn orders_of_a_file_are_shown_and_own_colours_stay() {
        let own = Emphasis::Bad.on("wrong") + "\n\tµ";
        assert_eq!(shown(&own), own);
        let title = "\u{1b}]0;gone\u{7}\u{1b}[2Ja\u{9b}31m\r\u{202e}b\u{7f}";
        assert_eq!(
            shown(title),
            "\\u{1b}]0;gone\\u{7}\\u{1b}[2Ja\\u{9b}31m\\u{d}\\u{202e}b\\u{7f}"
        );
        for emphasis in [
            Emphasis::Strong,
            Emphasis::Good,
            Emphasis::Doubtful,
            Emphasis::Bad,
        ] {
            let text = emphasis.on("x");
            assert_eq!(shown(&text), text, "{emphasis:?}");
        }
    }

    #[test]
    fn a_document_stays_the_same_document() {
        let value = serde_json::json!({ "name": "a\u{1b}[2J\u{9b}b\u{7f}\u{202e}" });
        let text = serde_json::to_string_pretty(&value).unwrap();
        let printed = shown_json(&text);
        assert!(!printed.chars().any(is_order));
        assert_eq!(
            serde_json::from_str::<serde_json::Value>(&printed).unwrap(),
            value
        );
    }
}
