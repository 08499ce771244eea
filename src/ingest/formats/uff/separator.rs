//! Where the datasets of a universal file begin and end.

use crate::ingest::text::Lines;

/// True where the file starts like a universal file: `-1`, then a dataset number.
pub(crate) fn looks_like(bytes: &[u8]) -> bool {
    let mut lines = Lines::new(bytes).filter(|l| !l.trim_ascii().is_empty());
    is_separator(lines.next().unwrap_or_default())
        && lines
            .next()
            .is_some_and(|line| is_separator(line) || dataset_number(line).is_some())
}

/// The line `-1`, before and after each dataset.
pub(crate) fn is_separator(line: &[u8]) -> bool {
    line.trim_ascii() == b"-1"
}

/// Number of a dataset and whether it is the binary form.
pub(crate) fn dataset_number(line: &[u8]) -> Option<(u32, bool)> {
    let line = line.trim_ascii();
    let digits = line.iter().take_while(|b| b.is_ascii_digit()).count();
    let number = std::str::from_utf8(&line[..digits.min(6)]).ok()?.parse().ok()?;
    match line.get(digits) {
        None => Some((number, false)),
        Some(b) if b.is_ascii_whitespace() => Some((number, false)),
        Some(b'b' | b'B') => Some((number, true)),
        Some(_) => None,
    }
}
