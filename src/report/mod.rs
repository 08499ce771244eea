//! Draws what the floors below computed; computes nothing itself.
//!
//! [`figure`] turns plain numbers into PNG images, [`interactive`] into figures that answer to the mouse, [`number`] into
//! readable text, and [`page`] puts all of them into one HTML file that needs nothing beside itself. [`campaign`] says what stands on that page, one
//! `*_section` a part; `tables` (feature `parquet`) writes the same numbers for other programs.

pub mod batch_folder;
pub mod batch_table;
pub mod campaign;
pub mod cutting_section;
pub mod diagnosis_section;
pub mod error_map_section;
pub mod figure;
pub mod fleet_page;
pub mod history_section;
mod hole_section;
pub mod interactive;
pub mod lobes_section;
pub mod modal_page;
pub mod modal_section;
pub mod number;
pub mod page;
pub(crate) mod parts;
mod picker;
mod picture;
mod real_case_section;
mod redundancy_section;
pub mod structure_section;
#[cfg(feature = "parquet")]
pub mod sweep_folder;
pub mod sweep_summary;
#[cfg(feature = "parquet")]
pub mod sweep_table;
#[cfg(feature = "parquet")]
pub mod tables;
pub mod thesis_cutting;
pub mod thesis_section;
pub mod verdict_card;
pub mod waveform_section;
mod words;

pub use page::{Block, Column, Drawing, Figure, Fold, OnScreen, Page, Section, Table, Written};
pub use verdict_card::VerdictCard;
