//! Draws what the floors below computed; computes nothing itself.
//!
//! [`figure`] turns plain numbers into PNG images, [`number`] into readable text, and [`page`] puts
//! both into one HTML file that needs nothing beside itself.

pub mod figure;
pub mod number;
pub mod page;

pub use page::{Block, Column, Figure, Page, Section, Table, Written};
