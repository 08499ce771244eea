//! Tables for other programs: [`column`] says what a table is, the others write it as CSV, as NumPy's NPZ, as a MATLAB file or as a
//! sheet of Excel.

mod archive;
mod column;
mod csv_text;
mod mat;
mod npz;
mod sheet;

pub use column::{Cells, ColumnTable, NamedArray, NamedColumn, variable_name};
pub use csv_text::csv_bytes;
pub use mat::mat_bytes;
pub use npz::npz_bytes;
pub use sheet::{MOST_ROWS, xlsx_bytes};
