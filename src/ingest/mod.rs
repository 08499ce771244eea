//! Reads lab files into SI records. Nothing outside this module knows a file format.
//!
//! [`read_file`] says what a file is and gives all it holds; [`read_frfs`] and [`read_time`] give the one thing a
//! caller wants and an error that says what the file holds instead.

mod budget;
mod channel_rule;
mod checks;
mod contents;
mod decode;
mod detect;
mod dof_names;
pub(crate) mod formats;
mod long;
mod preview;
mod quality;
mod read;
pub(crate) mod tables;
#[cfg(test)]
mod tests;
mod text;
pub mod units;

pub use crate::data::{Axis, Channel, ChannelRole, Dof, FrfRecord, Quantity, TimeRecord};
pub use channel_rule::{
    ChannelRule, Gain, Measures, NamedCut, NamedForce, Source, Timeless, cuts_of, forces_of, read_file_at,
    read_forces_with, read_time_with, timeless,
};
pub use contents::{Contents, Digest, Format, MeasurementFile, OtherRecord, TimeFile};
pub use detect::is_no_measurement;
pub use formats::columns::{
    Cells, ColumnTable, MOST_ROWS, NamedArray, NamedColumn, csv_bytes, mat_bytes, npz_bytes, variable_name,
    xlsx_bytes,
};
pub use formats::geometry::{Geometry, NodalShape, geometry_text, nodes_text, read_geometry};
pub use formats::mat::{MatArray, mat5_bytes};
pub use formats::uff::{
    Abscissa, ByteOrder, Dataset58, Encoding58, EntityDof, Ordinate, UnitAxis, frf_dataset, time_datasets,
    uff58_bytes, write_datasets58, write_uff58,
};
pub use long::{ForceFile, Survey, survey};
pub use preview::{PlainColumn, SIGNALS, plain_columns, taken_for};
pub use quality::quality_warnings;
pub use read::{read_file, read_frf_file, read_frfs, read_memory, read_time};
pub(crate) use tables::channel_names::{is_called_acceleration, is_called_hammer, is_called_marker};
pub use text::shown;
pub(crate) use text::without_byte_order_mark;
pub use units::unit_of_charge_or_other;

/// The first sheet of a workbook (xlsx) as tab separated text; `None` for all else.
pub fn sheet_text(bytes: &[u8]) -> Option<String> {
    formats::workbook::first_sheet(bytes).ok()?.map(|(text, _)| text)
}
