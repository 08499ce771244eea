//! The binary ordinates of dataset 58b.

use crate::InputError;
use crate::ingest::formats::uff::ordinate_form::{OrdinateForm, too_short};
use crate::ingest::formats::uff::separator::is_separator;
use crate::ingest::text::{Lines, Notes};

/// The number line of a 58b: `FORMAT(I6,1A1,I6,I6,I12,I12,…)`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BinaryHeader {
    big_endian: bool,
    pub header_lines: usize,
    bytes: usize,
}

impl BinaryHeader {
    pub fn read(line: &str) -> Result<BinaryHeader, InputError> {
        let mut fields = line.split_whitespace().skip(1).map(|f| f.parse::<u64>().ok());
        let mut field = || fields.next().flatten();
        let big_endian = match field() {
            Some(1) => false,
            Some(2) => true,
            other => {
                return Err(InputError::new(format!(
                    "dataset 58b does not say its byte order (1 little, 2 big endian): {}",
                    other.map_or("nothing".to_owned(), |v| v.to_string())
                )));
            }
        };
        match field() {
            Some(2) => {}
            Some(1) => return Err(vintage("DEC VMS")),
            Some(3) => return Err(vintage("IBM 5/370")),
            _ => {
                return Err(InputError::new(
                    "dataset 58b does not say its floating point format",
                ));
            }
        }
        let count = |value: Option<u64>| value.and_then(|v| usize::try_from(v).ok()).unwrap_or(0);
        Ok(BinaryHeader {
            big_endian,
            header_lines: count(field()),
            bytes: count(field()),
        })
    }
}

fn vintage(name: &str) -> InputError {
    InputError::new(format!(
        "dataset 58b with {name} floating point numbers, which is not read"
    ))
    .remedy("export as IEEE 754 binary or as ASCII (dataset 58)")
}

/// Numbers of a binary dataset; moves `lines` behind its closing separator.
pub(crate) fn read_binary(
    lines: &mut Lines,
    form: OrdinateForm,
    announced: usize,
    header: BinaryHeader,
    title: &str,
    notes: &mut Notes,
) -> Result<Vec<f64>, InputError> {
    let data = lines.rest();
    let value_width = if form.double { 8 } else { 4 };
    // Uneven double precision: the abscissa stays single as in ASCII (E13.5); some writers make it double too.
    let abscissa_widths: &[usize] = match (form.even, form.double) {
        (true, _) => &[0],
        (false, false) => &[4],
        (false, true) => &[4, 8],
    };
    let layouts = abscissa_widths.iter().map(|&abscissa| {
        let width = abscissa + form.values() * value_width;
        (abscissa, width, announced.saturating_mul(width))
    });
    let by_count = layouts.clone().find(|&(.., size)| size == header.bytes);
    let by_closing = || layouts.clone().find(|&(.., size)| closes_at(data, size));
    let Some((abscissa, width, expected)) = by_count.or_else(by_closing).or_else(|| layouts.clone().next())
    else {
        return Ok(Vec::new());
    };
    let fits = |size: usize| size > 0 && size <= data.len();
    let size = if closes_at(data, expected) || !(fits(header.bytes) && closes_at(data, header.bytes)) {
        expected.min(data.len())
    } else {
        header.bytes
    };
    let points = (size / width).min(announced);
    let mut numbers = Vec::with_capacity(points * form.numbers_per_point());
    for point in data[..points * width].chunks_exact(width) {
        let (first, values) = point.split_at(abscissa);
        match abscissa {
            0 => {}
            4 => numbers.push(single(first, header.big_endian)),
            _ => numbers.push(double(first, header.big_endian)),
        }
        for value in values.chunks_exact(value_width) {
            numbers.push(match value_width {
                4 => single(value, header.big_endian),
                _ => double(value, header.big_endian),
            });
        }
    }
    if points < announced {
        return Err(too_short(title, points, announced, size == data.len()).line(lines.number));
    }
    let end = lines.position + size;
    if closes_at(data, size) {
        lines.position = end;
        // The separator may follow the data directly or on a line of its own.
        while lines.next().is_some_and(|line| !is_separator(line)) {}
    } else {
        notes.about(title, "the closing -1 is missing after the binary data");
        lines.position = next_opening(lines.bytes, end);
    }
    Ok(numbers)
}

/// True where the closing separator comes at `at`, blanks and line ends before it allowed.
fn closes_at(data: &[u8], at: usize) -> bool {
    let Some(rest) = data.get(at..) else { return false };
    let rest = rest.trim_ascii_start();
    rest.starts_with(b"-1") && rest.get(2).is_none_or(u8::is_ascii_whitespace)
}

/// Where the next dataset 58 opens after a binary one without a proper end; the end of the file if none does.
fn next_opening(bytes: &[u8], from: usize) -> usize {
    let rest = bytes.get(from..).unwrap_or_default();
    let opening = rest
        .windows(17)
        .position(|w| w.starts_with(b"    -1") && w[6..].trim_ascii_start().starts_with(b"58"));
    opening.map_or(bytes.len(), |at| from + at)
}

fn single(bytes: &[u8], big_endian: bool) -> f64 {
    let Ok(bytes) = bytes.try_into() else {
        return f64::NAN;
    };
    f64::from(if big_endian {
        f32::from_be_bytes(bytes)
    } else {
        f32::from_le_bytes(bytes)
    })
}

fn double(bytes: &[u8], big_endian: bool) -> f64 {
    let Ok(bytes) = bytes.try_into() else {
        return f64::NAN;
    };
    if big_endian {
        f64::from_be_bytes(bytes)
    } else {
        f64::from_le_bytes(bytes)
    }
}
