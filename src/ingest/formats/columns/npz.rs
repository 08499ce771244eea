//! NPZ: a ZIP archive of NumPy's arrays, compressed, as `numpy.savez_compressed` writes it.
//!
//! Source: numpy.lib.format, NPY format version 1.0 (NumPy enhancement proposal 1).

use super::archive::zip_bytes;
use super::column::{Cells, ColumnTable, NamedArray};
use crate::Result;

/// The bytes of an NPZ file with the table's arrays.
///
/// # Errors
/// More than 4 GB.
pub fn npz_bytes(table: &ColumnTable) -> Result<Vec<u8>> {
    let members: Vec<(String, Vec<u8>)> = table
        .as_arrays()
        .iter()
        .map(|array| (format!("{}.npy", array.name), npy(array)))
        .collect();
    zip_bytes(&members)
}

fn npy(array: &NamedArray) -> Vec<u8> {
    let (kind, data): (String, Vec<u8>) = match &array.cells {
        Cells::Number(v) => ("<f8".into(), v.iter().flat_map(|x| x.to_le_bytes()).collect()),
        Cells::Complex(v) => {
            let parts = v.iter().flat_map(|z| [z.re, z.im]);
            ("<c16".into(), parts.flat_map(f64::to_le_bytes).collect())
        }
        Cells::Text(v) => {
            // A width of nothing is no type.
            let width = v.iter().map(|t| t.chars().count()).max().unwrap_or(0).max(1);
            let padded = |t: &String| {
                let codes = t.chars().map(u32::from).chain(std::iter::repeat(0));
                codes.take(width).flat_map(u32::to_le_bytes).collect::<Vec<u8>>()
            };
            (format!("<U{width}"), v.iter().flat_map(padded).collect())
        }
    };
    let shape: String = array.shape.iter().map(|n| format!("{n}, ")).collect();
    let mut head = format!(
        "{{'descr': '{kind}', 'fortran_order': False, 'shape': ({}), }}",
        shape.trim_end()
    );
    // Magic, version and length are ten bytes; the data begins at a multiple of 64, after a line feed.
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
