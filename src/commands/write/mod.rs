//! Write and try out.

pub(crate) mod document_schemas;
pub(crate) mod export;
pub(crate) mod report;
pub(crate) mod schema;
pub(crate) mod shell;
pub(crate) mod simulate;
pub(crate) mod thesis;
