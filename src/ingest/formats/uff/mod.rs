//! Universal files (UFF, UNV): dataset 58 and its binary form 58b, with 164 (units); all others are skipped.
//!
//! Source: Universal Dataset Number 58, Structural Dynamics Research Laboratory, University of Cincinnati
//! (revision of 23 April 1993), as kept in the repository tekniskakustik/readunv; dataset 164 of the same series.

mod binary;
mod dataset58;
mod datasets;
mod interpret;
mod ordinate_form;
#[cfg(test)]
mod round_trip;
mod separator;
#[cfg(test)]
mod tests;
mod write;

pub use dataset58::{Abscissa, Dataset58, EntityDof, Ordinate, UnitAxis};
pub use write::{
    ByteOrder, Encoding58, frf_dataset, time_datasets, uff58_bytes, write_datasets58, write_uff58,
};

pub(crate) use datasets::contents;
pub(crate) use separator::{is_separator, looks_like};
