//! A campaign folder: what was measured, where, and on what. SI values keep the unit of the file in their name.

use std::path::{Path, PathBuf};

pub mod bounds;
mod channels;
pub mod document;
pub mod draft;
pub mod frf_set;
mod json_schema;
pub mod keys;
mod load;
mod lobes_section;
mod named_files;
pub mod paths;
pub mod robot_file;
pub mod robot_spec;
pub mod robot_text;
pub mod schema;
mod section;
pub mod suggest;
mod tool_and_cut;

pub use frf_set::{FrfSet, MeasuredDof, MeasuredFrf};
pub use json_schema::{SchemaOf, json_schema};
pub use named_files::named_files;
pub use schema::*;

/// Key of an error that is about the reference to a robot file, not about the file.
pub(crate) const ROBOT_KEY: &str = "robot.model";

/// The file that makes a folder a campaign.
pub fn campaign_file(dir: &Path) -> PathBuf {
    dir.join("campaign.toml")
}
