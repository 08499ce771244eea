//! MATLAB files, version 5, uncompressed: what other programs read everywhere.
//!
//! Source: MAT-File Format, The MathWorks (version 5 level).

use num_complex::Complex64;

/// A matrix of doubles (or of characters) by columns, as MATLAB stores it.
#[derive(Debug, Clone, PartialEq)]
pub struct MatArray {
    /// Letters, digits and underscores, a letter first.
    pub name: String,
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// Real parts, one column after the other: `rows` × `columns` of them.
    pub re: Vec<f64>,
    /// Same length as `re`; `None` for a real matrix.
    pub im: Option<Vec<f64>>,
    /// Are the numbers characters (UTF-16), a text a row?
    pub text: bool,
}

impl MatArray {
    /// A column of real numbers.
    pub fn column(name: &str, values: &[f64]) -> MatArray {
        MatArray {
            name: name.into(),
            rows: values.len(),
            columns: 1,
            re: values.to_vec(),
            im: None,
            text: false,
        }
    }

    /// A text a row, filled up with blanks: MATLAB's char matrix.
    pub fn text(name: &str, rows: &[String]) -> MatArray {
        let rows: Vec<Vec<u16>> = rows.iter().map(|t| t.encode_utf16().collect()).collect();
        let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
        let at = |row: &Vec<u16>, k: usize| f64::from(row.get(k).copied().unwrap_or(u16::from(b' ')));
        MatArray {
            name: name.into(),
            rows: rows.len(),
            columns,
            re: (0..columns)
                .flat_map(|k| rows.iter().map(move |row| at(row, k)))
                .collect(),
            im: None,
            text: true,
        }
    }

    /// A complex matrix, given by its columns, all of one length.
    pub fn complex(name: &str, columns: &[Vec<Complex64>]) -> MatArray {
        let values = || columns.iter().flatten();
        MatArray {
            name: name.into(),
            rows: columns.first().map_or(0, Vec::len),
            columns: columns.len(),
            re: values().map(|z| z.re).collect(),
            im: Some(values().map(|z| z.im).collect()),
            text: false,
        }
    }
}

/// Data types of the format.
const INT8: u32 = 1;
const UINT16: u32 = 4;
const INT32: u32 = 5;
const UINT32: u32 = 6;
const DOUBLE: u32 = 9;
const MATRIX: u32 = 14;
/// Classes of characters and of double matrices, and the flag for complex ones.
const CHAR_CLASS: u32 = 4;
const DOUBLE_CLASS: u32 = 6;
const COMPLEX: u32 = 0x0800;

/// The bytes of a file with these arrays.
pub fn mat5_bytes(arrays: &[MatArray]) -> Vec<u8> {
    let mut bytes = b"MATLAB 5.0 MAT-file, written by Lobestone".to_vec();
    bytes.resize(124, b' ');
    bytes.extend(0x0100u16.to_le_bytes());
    bytes.extend(b"IM");
    for array in arrays {
        let mut body = Vec::new();
        let flags = match (array.text, &array.im) {
            (true, _) => CHAR_CLASS,
            (false, Some(_)) => DOUBLE_CLASS | COMPLEX,
            (false, None) => DOUBLE_CLASS,
        };
        let words = |values: &[u32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        push(&mut body, UINT32, &words(&[flags, 0]));
        push(
            &mut body,
            INT32,
            &words(&[array.rows as u32, array.columns as u32]),
        );
        push(&mut body, INT8, array.name.as_bytes());
        if array.text {
            let units: Vec<u8> = array.re.iter().flat_map(|v| (*v as u16).to_le_bytes()).collect();
            push(&mut body, UINT16, &units);
            push(&mut bytes, MATRIX, &body);
            continue;
        }
        for part in std::iter::once(&array.re).chain(&array.im) {
            let part: Vec<u8> = part.iter().flat_map(|v| v.to_le_bytes()).collect();
            push(&mut body, DOUBLE, &part);
        }
        push(&mut bytes, MATRIX, &body);
    }
    bytes
}

/// Type, length, data, and zeros to a multiple of eight.
fn push(bytes: &mut Vec<u8>, kind: u32, data: &[u8]) {
    bytes.extend(kind.to_le_bytes());
    bytes.extend((data.len() as u32).to_le_bytes());
    bytes.extend(data);
    bytes.resize(bytes.len().next_multiple_of(8), 0);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_reader_finds_the_same_numbers() {
        let shapes = [
            vec![Complex64::new(1.0, 0.0), Complex64::new(-0.5, 0.25)],
            vec![Complex64::new(0.0, 2.0), Complex64::new(3.0, 4.0)],
        ];
        let bytes = mat5_bytes(&[
            MatArray::column("frequency_hz", &[12.5, 33.0, 47.125]),
            MatArray::complex("shape", &shapes),
        ]);
        let file = matfile::MatFile::parse(bytes.as_slice()).unwrap();
        let frequency = file.find_by_name("frequency_hz").unwrap();
        let matfile::NumericData::Double { real, imag } = frequency.data() else {
            panic!("not double");
        };
        assert_eq!(real, &[12.5, 33.0, 47.125]);
        assert!(imag.is_none());
        let shape = file.find_by_name("shape").unwrap();
        assert_eq!(shape.size(), &vec![2, 2]);
        let matfile::NumericData::Double { real, imag } = shape.data() else {
            panic!("not double");
        };
        assert_eq!(real, &[1.0, -0.5, 0.0, 3.0]);
        assert_eq!(imag.as_deref(), Some(&[0.0, 0.25, 2.0, 4.0][..]));
    }
}
