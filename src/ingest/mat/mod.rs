//! MATLAB files: v5 (to v7) by the crate `matfile`, v7.3 (HDF5) by `hdf5-pure`. Both become a list of named arrays;
//! [`interpret`] says which of them are FRFs, coherences and time signals.

use super::text::Notes;
use super::{Contents, InputError};

mod interpret;
mod read;
mod write;

pub use write::{MatArray, mat5_bytes};

/// A numeric array, column by column as MATLAB holds it.
#[derive(Debug, Clone, PartialEq)]
struct Variable {
    /// Fields of a struct as `struct.field`.
    name: String,
    size: Vec<usize>,
    re: Vec<f64>,
    /// Same length as `re`; `None` for a real array.
    im: Option<Vec<f64>>,
}

pub(super) fn looks_like_v5(bytes: &[u8]) -> bool {
    bytes.starts_with(b"MATLAB 5.0 MAT-file")
}

/// An HDF5 file with MATLAB's block before it, or bare.
pub(super) fn looks_like_v73(bytes: &[u8]) -> bool {
    const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";
    bytes.starts_with(SIGNATURE) || bytes.get(512..520) == Some(SIGNATURE)
}

pub(super) fn read_v5(bytes: &[u8], notes: &mut Notes) -> Result<Contents, InputError> {
    interpret::contents(read::v5(bytes)?, notes)
}

pub(super) fn read_v73(bytes: &[u8], notes: &mut Notes) -> Result<Contents, InputError> {
    interpret::contents(read::v73(bytes, notes)?, notes)
}
