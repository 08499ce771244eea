//! A table of columns as Parquet.

use polars::prelude::{Column, DataFrame, ParquetWriter};

use crate::ingest::{Cells, ColumnTable};
use crate::{Error, Result};

/// The bytes of a Parquet file with this table: numbers as numbers, nothing as null.
///
/// # Errors
/// polars', which would be a fault of this program.
pub fn parquet_bytes(table: &ColumnTable) -> Result<Vec<u8>> {
    let failed = |e| Error::computation(format!("table {}: {e}", table.name));
    let column = |(name, cells): &(String, Cells)| match cells {
        Cells::Text(text) => {
            let text: Vec<Option<&str>> = text
                .iter()
                .map(|t| Some(t.as_str()).filter(|t| !t.is_empty()))
                .collect();
            Column::new(name.as_str().into(), text)
        }
        Cells::Number(numbers) => {
            let numbers: Vec<Option<f64>> = numbers
                .iter()
                .map(|v| Some(*v).filter(|v| v.is_finite()))
                .collect();
            Column::new(name.as_str().into(), numbers)
        }
        // `plain_columns` has made two of each.
        Cells::Complex(z) => Column::new(
            name.as_str().into(),
            z.iter().map(|z| z.norm()).collect::<Vec<f64>>(),
        ),
    };
    let columns: Vec<Column> = table.plain_columns().iter().map(column).collect();
    let mut frame = DataFrame::new_infer_height(columns).map_err(failed)?;
    let mut bytes = Vec::new();
    ParquetWriter::new(&mut bytes)
        .finish(&mut frame)
        .map_err(failed)?;
    Ok(bytes)
}
