//! Rows whose time is a date or a time of day (`2024-03-12T10:11:12.3456`, `12.03.2024;10:11:12,123`): made seconds since the
//! first row, so that the table is one of numbers.

use std::fmt::Write as _;

use crate::ingest::tables::table::is_row;
use crate::ingest::text::{Lines, decode};

/// Header lines looked at for the first row.
const HEADER_LINES_AT_MOST: usize = 200;
/// Rows that must be alike before they are believed.
const ROWS_TO_BELIEVE: usize = 3;
const NANOSECONDS: i128 = 1_000_000_000;

/// Nanoseconds of a clock, and whether a date is part of it.
#[derive(Clone, Copy)]
struct Stamp {
    nanoseconds: i128,
    has_clock: bool,
}

/// Digits and what stands between them.
fn numbers(text: &str) -> Option<Vec<(i64, usize)>> {
    let mut numbers = Vec::new();
    for part in text.split(|c: char| !c.is_ascii_digit()) {
        if !part.is_empty() {
            numbers.push((part.get(..part.len().min(9))?.parse().ok()?, part.len()));
        }
    }
    Some(numbers)
}

fn date(text: &str) -> Option<i128> {
    let slash = text.contains('/');
    if !(slash || text.contains('-') || text.matches('.').count() == 2) {
        return None;
    }
    let parts = numbers(text)?;
    let [(a, digits), (b, _), (c, last)] = parts.as_slice() else {
        return None;
    };
    let (year, month, day) = match (*digits == 4, *last == 4 || *last == 2) {
        (true, _) => (*a, *b, *c),
        // Americans put the month first, between slashes.
        (false, true) if slash && *b > 12 => (*c, *a, *b),
        (false, true) if slash && *a <= 12 => (*c, *a, *b),
        (false, true) => (*c, *b, *a),
        _ => return None,
    };
    if !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    // Days of the Gregorian calendar, years counted from March (Richards 2013, "Explanatory Supplement to the Astronomical
    // Almanac", 15.11).
    let years = year - i64::from(month < 3);
    let days = 365 * years + years / 4 - years / 100 + years / 400 + (153 * ((month + 9) % 12) + 2) / 5 + day;
    Some(i128::from(days) * 86_400 * NANOSECONDS)
}

fn time_of_day(text: &str) -> Option<i128> {
    let lower = text.to_lowercase();
    let (clock, half) = match lower
        .strip_suffix("am")
        .map(|t| (t, 0))
        .or(lower.strip_suffix("pm").map(|t| (t, 12)))
    {
        Some((clock, add)) => (clock.trim_end(), Some(add)),
        None => (lower.trim_end_matches('z'), None),
    };
    if !clock.bytes().all(|b| b.is_ascii_digit() || b":.,".contains(&b)) || clock.matches(':').count() < 1 {
        return None;
    }
    let parts = numbers(clock)?;
    let [hours, minutes, rest @ ..] = parts.as_slice() else {
        return None;
    };
    let seconds = rest.first().map_or(0, |s| s.0);
    let fraction = match rest.get(1) {
        Some((value, digits)) => i128::from(*value) * 10_i128.pow(9 - (*digits).min(9) as u32),
        None => 0,
    };
    if rest.len() > 2 || hours.0 > 24 || minutes.0 > 59 || seconds > 60 {
        return None;
    }
    let hours = match half {
        Some(add) => hours.0 % 12 + add,
        None => hours.0,
    };
    Some(i128::from(hours * 3600 + minutes.0 * 60 + seconds) * NANOSECONDS + fraction)
}

fn stamp(text: &str) -> Option<Stamp> {
    let text = text.trim().trim_matches('"').trim();
    if let Some(nanoseconds) = time_of_day(text) {
        return Some(Stamp {
            nanoseconds,
            has_clock: true,
        });
    }
    let split = text.find(['T', ' ']);
    let (day, clock) = split.map_or((text, None), |at| (&text[..at], Some(text[at + 1..].trim())));
    let day = date(day)?;
    let clock = match clock {
        Some(clock) => Some(time_of_day(clock)?),
        None => None,
    };
    Some(Stamp {
        nanoseconds: day + clock.unwrap_or(0),
        has_clock: clock.is_some(),
    })
}

/// Digits behind the seconds of a clock.
fn places(clock: &str) -> usize {
    let seconds = clock.rsplit(':').next().unwrap_or_default();
    let fraction = seconds.split(['.', ',']).nth(1).unwrap_or_default();
    fraction.bytes().take_while(u8::is_ascii_digit).count()
}

/// How many fields of a row are its time (date and clock may stand apart), and that time; `None` for no such row.
fn stamped(line: &str, delimiter: char) -> Option<(usize, i128)> {
    let mut fields = line.split(delimiter);
    let first = stamp(fields.next()?)?;
    if first.has_clock {
        return Some((1, first.nanoseconds));
    }
    let second = stamp(fields.next()?).filter(|s| s.has_clock)?;
    Some((2, first.nanoseconds + second.nanoseconds))
}

/// The text with seconds since its first row instead of dates and clocks, and a remark about it; `None` where its rows do not
/// begin with one.
pub(crate) fn as_seconds(bytes: &[u8]) -> Option<(Vec<u8>, String)> {
    let mut lines = Lines::new(bytes);
    let (at, delimiter, width, first) = loop {
        let at = lines.position;
        if lines.number > HEADER_LINES_AT_MOST {
            return None;
        }
        let line = decode(lines.next()?);
        let begun = [';', '\t', ','].into_iter().find_map(|d| {
            let (width, time) = stamped(&line, d)?;
            let rest: String = line.split(d).skip(width).collect::<Vec<_>>().join(&d.to_string());
            is_row(rest.as_bytes()).then_some((d, width, time))
        });
        if let Some((d, width, time)) = begun {
            let alike = lines.clone().take(ROWS_TO_BELIEVE);
            if alike
                .filter(|l| !l.trim_ascii().is_empty())
                .all(|l| stamped(&decode(l), d).is_some())
            {
                break (at, d, width, time);
            }
        }
    };
    let mut out = String::with_capacity(bytes.len());
    // Header lines of the table lose the column that the date had.
    let head = decode(&bytes[..at]);
    let row = decode(Lines::new(&bytes[at..]).next()?);
    let fields = row.split(delimiter).count();
    let values: Vec<&str> = row.split(delimiter).skip(width).collect();
    let has = |c: char| values.iter().any(|v| v.contains(c));
    let point = if has(',') && !has('.') { ',' } else { '.' };
    for line in head.lines() {
        let is_of_table = width > 1 && line.split(delimiter).count() == fields;
        let line = match line.split_once(delimiter) {
            Some((_, rest)) if is_of_table => rest,
            _ => line,
        };
        out.push_str(line);
        out.push('\n');
    }
    // As many digits as the clock has: what comes after tells from them how the times were rounded.
    let places = row.split(delimiter).nth(width - 1).map_or(0, places).min(9);
    let mut days = 0;
    let mut before = first;
    for line in Lines::new(&bytes[at..]) {
        let text = decode(line);
        if text.trim().is_empty() {
            continue;
        }
        let Some((_, time)) = stamped(&text, delimiter) else {
            // What is no row stays one, for the reader of tables to name.
            out.push_str(&text);
            out.push('\n');
            continue;
        };
        // A clock without a date begins anew at midnight.
        if time + days * 86_400 * NANOSECONDS < before - 43_200 * NANOSECONDS {
            days += 1;
        }
        let time = time + days * 86_400 * NANOSECONDS;
        before = time;
        let since = time - first;
        let sign = if since < 0 { "-" } else { "" };
        let _ = write!(out, "{sign}{}", since.abs() / NANOSECONDS);
        if places > 0 {
            let fraction = since.abs() % NANOSECONDS / 10_i128.pow(9 - places as u32);
            let _ = write!(out, "{point}{fraction:0places$}");
        }
        for field in text.split(delimiter).skip(width) {
            out.push(delimiter);
            out.push_str(field);
        }
        out.push('\n');
    }
    Some((
        out.into_bytes(),
        "the time column is a clock: seconds since the first row".to_owned(),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_become_seconds() {
        let of = |text: &str| String::from_utf8(as_seconds(text.as_bytes()).unwrap().0).unwrap();
        let iso = of(
            "time;fx\n2024-03-12T23:59:59.9995;1.5\n2024-03-13T00:00:00.0000;2.5\n2024-03-13T00:00:00.0005;3\n",
        );
        assert_eq!(iso, "time;fx\n0.0000;1.5\n0.0005;2.5\n0.0010;3\n");
        let apart = of(
            "Date,Time,Fx\n12.03.2024,10:11:12.25,1\n12.03.2024,10:11:12.50,2\n12.03.2024,10:11:12.75,3\n",
        );
        assert_eq!(apart, "Time,Fx\n0.00,1\n0.25,2\n0.50,3\n");
        let clock = of("t\tFx\n11:59:59 PM\t1.0\n12:00:00 AM\t2.0\n12:00:01 AM\t3.0\n");
        assert_eq!(clock, "t\tFx\n0\t1.0\n1\t2.0\n2\t3.0\n");
        assert!(as_seconds(b"time,fx\n0.1,2\n0.2,3\n0.3,4\n").is_none());
        assert!(as_seconds(b"2024-03-12 10:11,abc\n").is_none());
    }
}
