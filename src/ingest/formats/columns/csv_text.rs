//! CSV as RFC 4180 has it, with line feeds and decimal points.

use super::column::{Cells, ColumnTable, number_text};
use crate::{Error, Result};

/// The bytes of a CSV file with this table.
///
/// # Errors
/// Columns of different lengths, which would be a fault of this program.
pub fn csv_bytes(table: &ColumnTable) -> Result<Vec<u8>> {
    let failed = |e: csv::Error| Error::computation(format!("table {}: {e}", table.name));
    let columns = table.plain_columns();
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer
        .write_record(columns.iter().map(|c| &c.0))
        .map_err(failed)?;
    for row in 0..table.rows() {
        let cells = columns.iter().map(|(_, cells)| cell(cells, row));
        writer.write_record(cells).map_err(failed)?;
    }
    writer
        .into_inner()
        .map_err(|e| Error::computation(format!("table {}: {e}", table.name)))
}

fn cell(cells: &Cells, row: usize) -> String {
    match cells {
        Cells::Text(text) => text.get(row).cloned().unwrap_or_default(),
        Cells::Number(numbers) => numbers.get(row).map_or(String::new(), |v| number_text(*v)),
        Cells::Complex(_) => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use num_complex::Complex64;

    use super::*;
    use crate::ingest::formats::columns::NamedColumn;

    #[test]
    fn what_there_is_none_of_is_empty_and_complex_numbers_are_two_columns() {
        let table = ColumnTable::new(
            "t",
            vec![
                NamedColumn::text("name", vec!["a, \"b\"".into(), String::new()]),
                NamedColumn::known("depth", "mm", [Some(2.0), None]),
                NamedColumn::complex(
                    "model",
                    "m_per_n",
                    vec![Complex64::new(1e-7, -0.25), Complex64::ZERO],
                ),
            ],
        );
        let text = String::from_utf8(csv_bytes(&table).unwrap()).unwrap();
        assert_eq!(
            text,
            "name,depth_mm,model_re_m_per_n,model_im_m_per_n\n\"a, \"\"b\"\"\",2,1e-7,-0.25\n,,0,0\n"
        );
    }
}
