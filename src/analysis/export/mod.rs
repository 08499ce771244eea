//! What a campaign measured and what became of it, as tables and universal files for other programs.

mod cutting_tables;
mod exported;
mod frf_tables;
mod lobe_table;
mod mode_tables;

pub use exported::{ExportFile, ExportForm, ExportPart, Exported, exported};
