//! A first `campaign.toml` for a folder of files: what the files say is filled in, what they do not say is asked for.
//!
//! [`scan`] looks at the files, [`Draft::new`] makes tables of what it found and of the [`Answers`] that are known
//! already, [`Draft::ask`] gets further ones, [`Draft::toml`] writes it all down.

mod answers;
mod campaign_draft;
mod channels;
mod cut_list;
mod entry;
mod form;
mod found;
mod list_columns;
mod making;
mod names;
mod scan;
mod tables;

pub use answers::Answers;
pub use campaign_draft::{Draft, Guess, Missing, folder_name};
pub use cut_list::read_cut_list;
pub use entry::{DraftTable, Entry, Kind};
pub use form::{Field, Form};
pub use found::{FoundForce, FoundFrf, Scan};
pub use scan::{measurement_files, scan};
