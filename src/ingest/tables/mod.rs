//! Tables of numbers in text, and their time stamps.

pub(crate) mod channel_names;
pub(crate) mod clock;
pub(crate) mod number;
pub(crate) mod split_comma;
pub(crate) mod stamps;
pub(crate) mod table;
pub(crate) mod table_rows;
pub(crate) mod word_columns;
