//! TOML whose errors name file, key, line and remedy; the list of all keys.

pub mod bounds;
pub mod document;
pub(crate) mod json_schema;
pub mod keys;
pub mod paths;
pub(crate) mod section;
