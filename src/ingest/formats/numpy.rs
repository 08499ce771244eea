//! NumPy's arrays: NPY, and NPZ with several of them.
//!
//! Source: numpy.lib.format, NPY format versions 1.0 to 3.0 (NumPy enhancement proposal 1).

use crate::InputError;
use crate::ingest::budget::Budget;
use crate::ingest::formats::mat::Variable;
use crate::ingest::formats::packed;
use crate::ingest::text::Notes;

const MAGIC: &[u8] = b"\x93NUMPY";

pub(crate) fn looks_like(bytes: &[u8]) -> bool {
    let is_npy = bytes.starts_with(MAGIC);
    let member = |m: &packed::Member| m.name.ends_with(".npy");
    is_npy || packed::looks_like(bytes) && packed::members(bytes).is_ok_and(|all| all.iter().any(member))
}

/// The arrays with their names (`data` where there is one without).
///
/// # Errors
/// A damaged file; more memory than its budget.
pub(crate) fn read(
    bytes: &[u8],
    budget: &mut Budget,
    notes: &mut Notes,
) -> Result<Vec<Variable>, InputError> {
    if bytes.starts_with(MAGIC) {
        return Ok(array("data", bytes, budget, notes)?.into_iter().collect());
    }
    let mut variables = Vec::new();
    for member in packed::members(bytes)? {
        if let Some(name) = member.name.strip_suffix(".npy") {
            let own = member.bytes(budget)?;
            variables.extend(array(name, &own, budget, notes)?);
        }
    }
    Ok(variables)
}

fn damaged(name: &str) -> InputError {
    InputError::new(format!("NumPy array {name} is cut off or damaged"))
        .remedy("copy the file again, or save it again with numpy.save")
}

/// What stands behind `'key':` in the header.
fn entry<'h>(header: &'h str, key: &str) -> Option<&'h str> {
    let at = header.find(&format!("'{key}':"))? + key.len() + 3;
    Some(header[at..].trim_start())
}

/// `None`, with a note, for what holds no numbers.
fn array(
    name: &str,
    bytes: &[u8],
    budget: &mut Budget,
    notes: &mut Notes,
) -> Result<Option<Variable>, InputError> {
    let wrong = || damaged(name);
    let version = *bytes.get(6).ok_or_else(wrong)?;
    let little =
        |part: Option<&[u8]>| part.map(|p| p.iter().rev().fold(0, |sum, b| sum << 8 | usize::from(*b)));
    let (length, from): (usize, usize) = match version {
        1 => (little(bytes.get(8..10)).ok_or_else(wrong)?, 10),
        2 | 3 => (little(bytes.get(8..12)).ok_or_else(wrong)?, 12),
        _ => return Err(wrong()),
    };
    let header = bytes.get(from..from.saturating_add(length)).ok_or_else(wrong)?;
    let header = String::from_utf8_lossy(header);
    let data = &bytes[from + length..];
    let kind = entry(&header, "descr")
        .and_then(|d| d.strip_prefix('\''))
        .and_then(|d| d.split('\'').next());
    let Some((big, letter, size)) = kind.and_then(number_kind) else {
        notes.about(
            name,
            "no plain array of numbers: left out; save each column as an array of its own",
        );
        return Ok(None);
    };
    let is_fortran = entry(&header, "fortran_order").is_some_and(|v| v.starts_with("True"));
    let shape = entry(&header, "shape")
        .and_then(|v| v.strip_prefix('('))
        .and_then(|v| v.split(')').next());
    let shape: Option<Vec<usize>> = shape.map(|s| {
        let parts = s.split(',').map(str::trim).filter(|p| !p.is_empty());
        parts.filter_map(|p| p.parse().ok()).collect()
    });
    let mut shape = shape.ok_or_else(wrong)?;
    let count = shape
        .iter()
        .try_fold(1usize, |all, n| all.checked_mul(*n))
        .ok_or_else(wrong)?;
    let bytes_needed = count.checked_mul(size).ok_or_else(wrong)?;
    let data = data.get(..bytes_needed).ok_or_else(wrong)?;
    budget.take(count.saturating_mul(24), &format!("array {name}"))?;
    let value = |b: &[u8]| number(b, letter, big);
    let (re, im): (Vec<f64>, Option<Vec<f64>>) = if letter == 'c' {
        let half = size / 2;
        let parts = data.chunks_exact(size);
        let of = |from: usize| {
            parts
                .clone()
                .map(|b| number(&b[from..from + half], 'f', big))
                .collect()
        };
        (of(0), Some(of(half)))
    } else {
        (data.chunks_exact(size).map(value).collect(), None)
    };
    let by_columns = |values: Vec<f64>| match shape.as_slice() {
        [rows, columns] if !is_fortran => (0..count)
            .map(|i| values[(i % rows) * columns + i / rows])
            .collect(),
        _ => values,
    };
    let (re, im) = (by_columns(re), im.map(by_columns));
    if !is_fortran && shape.len() > 2 {
        shape.reverse();
    }
    shape.resize(shape.len().max(2), 1);
    Ok(Some(Variable {
        name: name.to_owned(),
        size: shape,
        re,
        im,
    }))
}

/// `<f8`, `|i1`, `>c16`: whether the highest byte is first, the kind and the bytes of a value.
fn number_kind(descr: &str) -> Option<(bool, char, usize)> {
    let mut letters = descr.chars();
    let big = match letters.next()? {
        '<' | '|' | '=' => false,
        '>' => true,
        _ => return None,
    };
    let letter = letters.next()?;
    let size: usize = letters.as_str().parse().ok()?;
    let fits = match letter {
        'f' => matches!(size, 4 | 8),
        'i' | 'u' => matches!(size, 1 | 2 | 4 | 8),
        'c' => matches!(size, 8 | 16),
        'b' => size == 1,
        _ => false,
    };
    fits.then_some((big, letter, size))
}

fn number(bytes: &[u8], letter: char, big: bool) -> f64 {
    let shift = |sum: u64, b: &u8| sum << 8 | u64::from(*b);
    let raw = if big {
        bytes.iter().fold(0, shift)
    } else {
        bytes.iter().rev().fold(0, shift)
    };
    match (letter, bytes.len()) {
        ('f', 4) => f64::from(f32::from_bits(raw as u32)),
        ('f', _) => f64::from_bits(raw),
        ('i', size) => {
            let unused = 64 - 8 * size as u32;
            ((raw << unused) as i64 >> unused) as f64
        }
        _ => raw as f64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn npy(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let mut head = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}");
        while (10 + head.len() + 1) % 64 != 0 {
            head.push(' ');
        }
        head.push('\n');
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((head.len() as u16).to_le_bytes());
        bytes.extend(head.as_bytes());
        bytes.extend(data);
        bytes
    }

    fn one(bytes: &[u8]) -> Variable {
        read(bytes, &mut Budget::for_file(bytes.len()), &mut Notes::default())
            .unwrap()
            .remove(0)
    }

    #[test]
    fn arrays_are_read_whatever_their_numbers_are() {
        let rows: Vec<u8> = [1.0f32, 2.0, 3.0, 4.0, 5.0, 6.0]
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        let table = one(&npy("'<f4'", "(3, 2)", &rows));
        assert_eq!(
            (table.size, table.re),
            (vec![3, 2], vec![1.0, 3.0, 5.0, 2.0, 4.0, 6.0])
        );
        let counts: Vec<u8> = [-2i16, 7].iter().flat_map(|v| v.to_be_bytes()).collect();
        assert_eq!(one(&npy("'>i2'", "(2,)", &counts)).re, [-2.0, 7.0]);
        let whole = npy("'<f4'", "(3, 2)", &rows);
        for at in 0..whole.len() {
            let mut bent = whole.clone();
            bent[at] ^= 0x41;
            let _ = read(&bent, &mut Budget::for_file(bent.len()), &mut Notes::default());
            let _ = read(&whole[..at], &mut Budget::for_file(at), &mut Notes::default());
        }
        let mut notes = Notes::default();
        let text = npy("'<U3'", "(1,)", &[0; 12]);
        assert!(
            read(&text, &mut Budget::for_file(99), &mut notes)
                .unwrap()
                .is_empty()
        );
        assert!(notes.into_warnings()[0].contains("no plain array"));
    }
}
