//! A table as a MATLAB file of version 5.

use super::column::{Cells, ColumnTable, NamedArray};
use crate::ingest::formats::mat::{MatArray, mat5_bytes};

/// Longest name that MATLAB takes.
const LONGEST: usize = 63;

/// The bytes of a MATLAB file with the table's arrays; lists are columns.
pub fn mat_bytes(table: &ColumnTable) -> Vec<u8> {
    let arrays: Vec<MatArray> = table.as_arrays().iter().map(mat_array).collect();
    mat5_bytes(&arrays)
}

fn mat_array(array: &NamedArray) -> MatArray {
    let name: String = array.name.chars().take(LONGEST).collect();
    let rows = array.shape.first().copied().unwrap_or(0);
    let columns = array.shape.get(1).copied().unwrap_or(1);
    // By columns in MATLAB, by rows here.
    let turned = |values: &[f64]| -> Vec<f64> {
        let at = |k: usize| values[(k % rows) * columns + k / rows];
        (0..rows * columns).map(at).collect()
    };
    match &array.cells {
        Cells::Text(text) => MatArray::text(&name, text),
        Cells::Number(v) => MatArray {
            name,
            rows,
            columns,
            re: turned(v),
            im: None,
            text: false,
        },
        Cells::Complex(v) => {
            let part =
                |of: fn(&num_complex::Complex64) -> f64| turned(&v.iter().map(of).collect::<Vec<f64>>());
            MatArray {
                name,
                rows,
                columns,
                re: part(|z| z.re),
                im: Some(part(|z| z.im)),
                text: false,
            }
        }
    }
}
