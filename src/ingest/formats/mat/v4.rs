//! MAT-files of version 4 (MATLAB before 1996, and what analysers of that time still write): one variable after the other,
//! each with five numbers and its name before its data.
//!
//! Source: The MathWorks, "MAT-File Format" (2019), appendix "MAT-File Level 4".

use crate::InputError;
use crate::ingest::budget::Budget;
use crate::ingest::formats::mat::variable::Variable;
use crate::ingest::text::{Notes, decode};

const HEADER: usize = 20;
/// MATLAB 4 allowed 19 characters and a zero.
const NAME: usize = 64;

/// How the numbers of a variable are written.
#[derive(Clone, Copy)]
enum Number {
    F64,
    F32,
    I32,
    I16,
    U16,
    U8,
}

impl Number {
    fn bytes(self) -> usize {
        match self {
            Number::F64 => 8,
            Number::F32 | Number::I32 => 4,
            Number::I16 | Number::U16 => 2,
            Number::U8 => 1,
        }
    }

    fn value(self, data: &[u8], big: bool) -> f64 {
        let mut eight = [0; 8];
        for (k, to) in eight.iter_mut().take(data.len()).enumerate() {
            *to = data[if big { data.len() - 1 - k } else { k }];
        }
        let whole = u64::from_le_bytes(eight);
        match self {
            Number::F64 => f64::from_bits(whole),
            Number::F32 => f64::from(f32::from_bits(whole as u32)),
            Number::I32 => f64::from(whole as u32 as i32),
            Number::I16 => f64::from(whole as u16 as i16),
            Number::U16 | Number::U8 => whole as f64,
        }
    }
}

/// What stands before the data of a variable.
struct Head {
    big: bool,
    number: Number,
    /// Full matrix of numbers; else text or sparse.
    numeric: bool,
    rows: usize,
    columns: usize,
    complex: bool,
    name: String,
    /// Where its data begin.
    data_at: usize,
}

impl Head {
    /// `None` where no variable begins at `at`.
    fn at(bytes: &[u8], at: usize) -> Option<Head> {
        let head = bytes.get(at..at.checked_add(HEADER)?)?;
        let word = |k: usize, big: bool| {
            let four = [head[4 * k], head[4 * k + 1], head[4 * k + 2], head[4 * k + 3]];
            if big {
                u32::from_be_bytes(four)
            } else {
                u32::from_le_bytes(four)
            }
        };
        // Thousands: order of the bytes; tens: kind of the numbers; ones: full, text, sparse.
        let big = [false, true]
            .into_iter()
            .find(|&big| word(0, big) / 1000 == u32::from(big))?;
        let kind = word(0, big) % 1000;
        let number = match kind / 10 {
            0 => Number::F64,
            1 => Number::F32,
            2 => Number::I32,
            3 => Number::I16,
            4 => Number::U16,
            5 => Number::U8,
            _ => return None,
        };
        let (numeric, complex) = (kind % 10 == 0, word(3, big));
        let length = word(4, big) as usize;
        if kind % 10 > 2 || complex > 1 || !(2..=NAME).contains(&length) {
            return None;
        }
        let name_at = at + HEADER;
        let name = bytes.get(name_at..name_at + length)?;
        let (end, name) = name.split_last()?;
        let plain = |c: &u8| c.is_ascii_alphanumeric() || *c == b'_';
        let named = name.first().is_some_and(u8::is_ascii_alphabetic) && name.iter().all(plain) && *end == 0;
        named.then(|| Head {
            big,
            number,
            numeric,
            rows: word(1, big) as usize,
            columns: word(2, big) as usize,
            complex: complex == 1,
            name: decode(name),
            data_at: name_at + length,
        })
    }

    /// Bytes of its data; `None` where that is more than any file holds.
    fn size(&self) -> Option<usize> {
        let cells = self.rows.checked_mul(self.columns)?;
        cells.checked_mul(self.number.bytes() * (1 + usize::from(self.complex)))
    }
}

/// Four numbers and a name that only such a file begins with.
pub(crate) fn looks_like(bytes: &[u8]) -> bool {
    Head::at(bytes, 0).is_some()
}

/// Reads all full numeric matrices.
///
/// # Errors
/// No whole variable, or more memory than the budget of the file.
pub(crate) fn read(
    bytes: &[u8],
    budget: &mut Budget,
    notes: &mut Notes,
) -> Result<Vec<Variable>, InputError> {
    let mut variables = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let Some(head) = Head::at(bytes, at) else {
            notes.file(format!(
                "no variable begins at byte {at}: the rest of the file is left out"
            ));
            break;
        };
        let data = head
            .size()
            .and_then(|size| bytes.get(head.data_at..head.data_at.checked_add(size)?));
        let Some(data) = data else {
            notes.about(&head.name, "the file ends within this variable: left out");
            break;
        };
        at = head.data_at + data.len();
        if !head.numeric {
            continue;
        }
        let wide = head.number.bytes();
        budget.take(8 * (data.len() / wide), &format!("variable {}", head.name))?;
        let mut numbers: Vec<f64> = data
            .chunks_exact(wide)
            .map(|number| head.number.value(number, head.big))
            .collect();
        let im = head.complex.then(|| numbers.split_off(numbers.len() / 2));
        variables.push(Variable {
            name: head.name,
            size: vec![head.rows, head.columns],
            re: numbers,
            im,
        });
    }
    if variables.is_empty() {
        return Err(
            InputError::new("no variable of this MAT-file (version 4) can be read")
                .remedy("copy it again from where it was saved, or in MATLAB: save('new.mat', '-v7')"),
        );
    }
    Ok(variables)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One variable as MATLAB 4 writes it.
    fn variable(name: &str, kind: u32, rows: u32, columns: u32, numbers: &[u8], complex: bool) -> Vec<u8> {
        let big = kind / 1000 == 1;
        let words = [kind, rows, columns, u32::from(complex), name.len() as u32 + 1];
        let mut out: Vec<u8> = words
            .iter()
            .flat_map(|w| if big { w.to_be_bytes() } else { w.to_le_bytes() })
            .collect();
        out.extend(name.as_bytes());
        out.push(0);
        out.extend(numbers);
        out
    }

    fn read_all(bytes: &[u8]) -> (Vec<Variable>, Vec<String>) {
        let mut notes = Notes::default();
        let found = read(bytes, &mut Budget::for_file(bytes.len()), &mut notes).unwrap();
        (found, notes.into_warnings())
    }

    #[test]
    fn both_byte_orders_all_kinds_of_numbers_and_complex_ones() {
        let big: Vec<u8> = [1.5f64, -2.0, 0.25, 4.0]
            .iter()
            .flat_map(|v| v.to_be_bytes())
            .collect();
        let mut file = variable("Xfer", 1000, 2, 1, &big, true);
        let small: Vec<u8> = [1.0f32, -3.5].iter().flat_map(|v| v.to_le_bytes()).collect();
        file.extend(variable("single", 10, 1, 2, &small, false));
        let short: Vec<u8> = [-7i16, 300].iter().flat_map(|v| v.to_be_bytes()).collect();
        file.extend(variable("counts", 1030, 2, 1, &short, false));
        file.extend(variable("words", 1, 1, 2, &[0; 16], false));
        assert!(looks_like(&file));
        let (found, warnings) = read_all(&file);
        assert_eq!(warnings, Vec::<String>::new());
        let names: Vec<&str> = found.iter().map(|v| v.name.as_str()).collect();
        // Text is no number.
        assert_eq!(names, ["Xfer", "single", "counts"]);
        assert_eq!(found[0].size, [2, 1]);
        assert_eq!(found[0].re, [1.5, -2.0]);
        assert_eq!(found[0].im.as_deref(), Some(&[0.25, 4.0][..]));
        assert_eq!(found[1].re, [1.0, -3.5]);
        assert_eq!(found[2].re, [-7.0, 300.0]);
    }

    #[test]
    fn a_cut_file_gives_what_is_whole_and_rubbish_is_none() {
        let numbers: Vec<u8> = (0..4).flat_map(|k| f64::from(k).to_le_bytes()).collect();
        let mut file = variable("f", 0, 4, 1, &numbers, false);
        file.extend(variable("H", 0, 4, 1, &numbers, false));
        let (found, warnings) = read_all(&file[..file.len() - 3]);
        assert_eq!(found.len(), 1);
        assert!(warnings[0].contains("ends within"), "{warnings:?}");
        // More cells than any file has.
        let huge = variable("f", 0, u32::MAX, u32::MAX, &numbers, false);
        assert!(read(&huge, &mut Budget::for_file(huge.len()), &mut Notes::default()).is_err());
        for other in [&b"0.5 1 2\n1 2 3\n"[..], &[0; 64], b"\x00\x00\x03\xe8"] {
            assert!(!looks_like(other));
        }
    }
}
