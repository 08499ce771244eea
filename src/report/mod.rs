//! Draws what the floors below computed; computes nothing itself.
//!
//! [`figure`] turns plain numbers into PNG images, [`interactive`] into figures that answer to the mouse, [`number`] into
//! readable text, and [`page`] puts all of them into one HTML file that needs nothing beside itself. [`campaign`] says what stands on that page, one
//! `*_section` a part; `tables` (feature `parquet`) writes the same numbers for other programs.

pub(crate) mod batch_folder;
pub(crate) mod batch_table;
mod block;
pub mod campaign;
mod card;
pub(crate) mod cutting_section;
pub(crate) mod diagnosis_section;
pub(crate) mod error_map_section;
pub(crate) mod figure;
pub(crate) mod fleet_page;
pub(crate) mod history_section;
mod hole_section;
pub(crate) mod interactive;
mod lobes_figure;
pub(crate) mod lobes_section;
pub(crate) mod modal_page;
pub(crate) mod modal_section;
pub mod number;
pub(crate) mod page;
pub(crate) mod parts;
mod picker;
mod picture;
mod real_case_section;
mod redundancy_section;
pub(crate) mod structure_section;
#[cfg(feature = "parquet")]
pub(crate) mod sweep_folder;
#[cfg_attr(not(feature = "parquet"), allow(dead_code))] // only the Parquet map of a sweep is summed up
pub(crate) mod sweep_summary;
#[cfg(feature = "parquet")]
pub(crate) mod sweep_table;
#[cfg(feature = "parquet")]
pub(crate) mod tables;
pub(crate) mod thesis_cutting;
pub(crate) mod thesis_section;
pub(crate) mod verdict_card;
pub(crate) mod waveform_section;
mod words;

pub(crate) use block::{Block, Drawing, Figure, Fold, OnScreen, ReportSection, ReportTable, TableColumn};
pub(crate) use card::VerdictCard;
pub use page::{Page, WrittenPage};
