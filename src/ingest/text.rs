//! Bytes to text: encodings, lines, and the warnings that files collect.

use std::borrow::Cow;

pub use crate::text::{shown, shown_on_one_line};

/// UTF-8 where it is UTF-8, else Latin-1 (every byte sequence is).
pub fn decode(bytes: &[u8]) -> String {
    match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(_) => bytes.iter().map(|&b| char::from(b)).collect(),
    }
}

/// The bytes that decide what a file is.
pub fn head(bytes: &[u8]) -> &[u8] {
    const LOOK_AT: usize = 8192;
    &bytes[..bytes.len().min(LOOK_AT)]
}

/// Is this no text? Control characters tell; a lone one among a thousand bytes, such as the end of a string that a program wrote with it,
/// does not.
pub fn is_binary(bytes: &[u8]) -> bool {
    let head = head(bytes);
    let odd = head.iter().filter(|b| **b < 9 || (14..32).contains(*b)).count();
    odd > head.len() / 1000
}

/// Drops a UTF-8 byte order mark, turns UTF-16 (spreadsheets call it "Unicode text") into UTF-8.
pub fn without_byte_order_mark(bytes: &[u8]) -> Cow<'_, [u8]> {
    let utf16 = |order: fn([u8; 2]) -> u16| {
        let units = bytes[2..].chunks_exact(2).map(|pair| order([pair[0], pair[1]]));
        let text: String = char::decode_utf16(units)
            .map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER))
            .collect();
        Cow::Owned(text.into_bytes())
    };
    match bytes {
        [0xEF, 0xBB, 0xBF, rest @ ..] => Cow::Borrowed(rest),
        [0xFF, 0xFE, ..] => utf16(u16::from_le_bytes),
        [0xFE, 0xFF, ..] => utf16(u16::from_be_bytes),
        _ => Cow::Borrowed(bytes),
    }
}

/// Walks over the lines of a file (LF or CRLF), knowing where it is.
#[derive(Clone)]
pub struct Lines<'a> {
    pub bytes: &'a [u8],
    /// Offset of the line that `next` will give.
    pub position: usize,
    /// Number of the line that `next` gave last, 1-based.
    pub number: usize,
}

impl<'a> Lines<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Lines {
            bytes,
            position: 0,
            number: 0,
        }
    }

    pub fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.position..).unwrap_or_default()
    }

    /// True when the line given last had no line end: the file stops in it.
    pub fn at_unfinished_end(&self) -> bool {
        self.position >= self.bytes.len() && self.bytes.last().is_some_and(|b| *b != b'\n')
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = &'a [u8];

    /// The next line without its end.
    fn next(&mut self) -> Option<&'a [u8]> {
        let rest = self.rest();
        if rest.is_empty() {
            return None;
        }
        let end = rest.iter().position(|b| *b == b'\n');
        let line = &rest[..end.unwrap_or(rest.len())];
        self.position += end.map_or(rest.len(), |e| e + 1);
        self.number += 1;
        Some(line.strip_suffix(b"\r").unwrap_or(line))
    }
}

/// Different remarks kept; a file that gives more is broken through and through.
const REMARKS_AT_MOST: usize = 100;
/// Records named in one remark.
const NAMED_AT_MOST: usize = 4;

/// Warnings about a file. The same remark about many records becomes one line.
#[derive(Debug, Default)]
pub struct Notes {
    remarks: Vec<Remark>,
    left_out: usize,
}

#[derive(Debug)]
struct Remark {
    text: String,
    /// The first subjects.
    subjects: Vec<String>,
    last: String,
    count: usize,
}

impl Notes {
    /// A remark about the file.
    pub fn file(&mut self, remark: impl Into<String>) {
        self.about("", remark);
    }

    /// A remark about one record or channel.
    pub fn about(&mut self, subject: &str, remark: impl Into<String>) {
        let text = shown_on_one_line(&remark.into());
        let subject = &*shown_on_one_line(subject);
        let at = self
            .remarks
            .iter()
            .position(|r| r.text == text)
            .unwrap_or(self.remarks.len());
        if at == REMARKS_AT_MOST {
            self.left_out += 1;
            return;
        }
        if at == self.remarks.len() {
            self.remarks.push(Remark {
                text,
                subjects: Vec::new(),
                last: String::new(),
                count: 0,
            });
        }
        let remark = &mut self.remarks[at];
        if !subject.is_empty() && remark.last != subject {
            remark.count += 1;
            remark.last = subject.to_owned();
            if remark.subjects.len() < NAMED_AT_MOST {
                remark.subjects.push(subject.to_owned());
            }
        }
    }

    pub fn into_warnings(self) -> Vec<String> {
        let line = |remark: Remark| match remark.count {
            0 => remark.text,
            n if n <= NAMED_AT_MOST => format!("{}: {}", remark.subjects.join(", "), remark.text),
            n => format!(
                "{} and {} more: {}",
                remark.subjects[..3].join(", "),
                n - 3,
                remark.text
            ),
        };
        let more = (self.left_out > 0).then(|| format!("{} further warnings", self.left_out));
        self.remarks.into_iter().map(line).chain(more).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_in_lf_or_crlf_or_the_file() {
        let mut lines = Lines::new(b"a\r\n\nlast");
        assert_eq!(lines.next(), Some(&b"a"[..]));
        assert_eq!(lines.next(), Some(&b""[..]));
        assert!(!lines.at_unfinished_end());
        assert_eq!(lines.next(), Some(&b"last"[..]));
        assert!(lines.at_unfinished_end());
        assert_eq!((lines.next(), lines.number), (None, 3));
    }

    #[test]
    fn encodings() {
        assert_eq!(decode(b"m/s\xb2"), "m/s²");
        assert_eq!(decode("m/s²".as_bytes()), "m/s²");
        assert_eq!(&*without_byte_order_mark(b"\xEF\xBB\xBFa"), b"a");
        assert_eq!(&*without_byte_order_mark(b"\xFF\xFEa\0;\0"), b"a;");
    }

    #[test]
    fn repeated_remarks_become_one() {
        let mut notes = Notes::default();
        for name in ["a", "b", "c", "d", "e", "e"] {
            notes.about(name, "no unit");
        }
        notes.file("cut short");
        assert_eq!(
            notes.into_warnings(),
            ["a, b, c and 2 more: no unit", "cut short"]
        );
    }

    #[test]
    fn what_would_drive_a_terminal_is_shown_in_notes() {
        let mut notes = Notes::default();
        notes.about("\u{1b}c", "odd\u{8}\n");
        assert_eq!(notes.into_warnings(), ["\\u{1b}c: odd\\u{8}\\u{a}"]);
    }
}
