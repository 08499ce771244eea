//! MATLAB files: [`v5`] (to v7) and v7.3 ([`hdf5`]). Both become a list of named arrays; [`interpret`] says which of them
//! are FRFs, coherences and time signals.

use super::budget::Budget;
use super::contents::Contents;
use super::text::Notes;
use crate::InputError;

mod hdf5;
mod interpret;
mod v5;
mod variable;
mod write;

pub use write::{MatArray, mat5_bytes};

use variable::Variable;

pub(super) fn looks_like_v5(bytes: &[u8]) -> bool {
    bytes.starts_with(b"MATLAB 5.0 MAT-file")
}

/// An HDF5 file with MATLAB's block before it, or bare.
pub(super) fn looks_like_v73(bytes: &[u8]) -> bool {
    hdf5::looks_like(bytes)
}

pub(super) fn read_v5(bytes: &[u8], budget: &mut Budget, notes: &mut Notes) -> Result<Contents, InputError> {
    interpret::contents(v5::read(bytes, budget, notes)?, budget, notes)
}

pub(super) fn read_v73(bytes: &[u8], budget: &mut Budget, notes: &mut Notes) -> Result<Contents, InputError> {
    interpret::contents(hdf5::read(bytes, budget, notes)?, budget, notes)
}
