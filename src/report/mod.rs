//! Draws what the floors below computed; computes nothing itself.
//!
//! `figure` turns plain numbers into PNG images, `interactive` into figures that answer to the mouse, [`number`] into
//! readable text, and [`Page`] is all of them as one HTML file that needs nothing else. [`campaign`] says what stands on that
//! page, `sections` has its parts; `stores` (feature `parquet`) writes the same numbers for other programs.

mod block;
pub mod campaign;
mod card;
pub(crate) mod figure;
pub(crate) mod fleet_page;
pub(crate) mod interactive;
pub(crate) mod modal_page;
pub mod number;
pub(crate) mod page;
pub(crate) mod parts;
mod picker;
mod picture;
pub(crate) mod sections;
pub(crate) mod stores;
pub(crate) mod verdict_card;
pub(crate) mod words;

pub(crate) use block::{Block, Drawing, Figure, Fold, OnScreen, ReportSection, ReportTable, TableColumn};
pub(crate) use card::VerdictCard;
pub use page::{Page, WrittenPage};
