//! What the writer may have meant.

pub use crate::text::{closest, shown_briefly as shown};
