//! MATLAB files: [`v4`], [`v5`] (to v7) and v7.3 ([`hdf5`]). All become a list of named arrays; [`interpret`] says which of them
//! are FRFs, coherences and time signals.

use crate::InputError;
use crate::ingest::budget::Budget;
use crate::ingest::contents::Contents;
use crate::ingest::text::Notes;

mod hdf5;
mod interpret;
mod v4;
mod v5;
mod variable;
mod write;

pub(crate) use variable::Variable;
pub use write::{MatArray, mat5_bytes};

pub(crate) fn looks_like_v5(bytes: &[u8]) -> bool {
    bytes.starts_with(b"MATLAB 5.0 MAT-file")
}

/// An HDF5 file with MATLAB's block before it, or bare.
pub(crate) fn looks_like_v73(bytes: &[u8]) -> bool {
    crate::ingest::formats::mat::hdf5::looks_like(bytes)
}

pub(crate) fn looks_like_v4(bytes: &[u8]) -> bool {
    crate::ingest::formats::mat::v4::looks_like(bytes)
}

pub(crate) fn read_v4(
    bytes: &[u8],
    rate_hz: Option<f64>,
    budget: &mut Budget,
    notes: &mut Notes,
) -> Result<Contents, InputError> {
    let variables = crate::ingest::formats::mat::v4::read(bytes, budget, notes)?;
    interpret::contents(with_rate(variables, rate_hz), &[], budget, notes)
}

pub(crate) fn read_v5(
    bytes: &[u8],
    rate_hz: Option<f64>,
    budget: &mut Budget,
    notes: &mut Notes,
) -> Result<Contents, InputError> {
    let (variables, labels) = crate::ingest::formats::mat::v5::read(bytes, budget, notes)?;
    interpret::contents(with_rate(variables, rate_hz), &labels, budget, notes)
}

pub(crate) fn read_v73(
    bytes: &[u8],
    rate_hz: Option<f64>,
    budget: &mut Budget,
    notes: &mut Notes,
) -> Result<Contents, InputError> {
    let variables = crate::ingest::formats::mat::hdf5::read(bytes, budget, notes)?;
    interpret::contents(with_rate(variables, rate_hz), &[], budget, notes)
}

/// Named arrays of another format, taken as those of a MAT-file.
pub(crate) fn of_arrays(
    variables: Vec<Variable>,
    rate_hz: Option<f64>,
    budget: &mut Budget,
    notes: &mut Notes,
) -> Result<Contents, InputError> {
    interpret::contents(with_rate(variables, rate_hz), &[], budget, notes)
}

/// A rate that the campaign says stands beside the arrays as if the file had it.
fn with_rate(mut variables: Vec<Variable>, rate_hz: Option<f64>) -> Vec<Variable> {
    variables.extend(rate_hz.map(|rate| Variable {
        name: "fs".into(),
        size: vec![1, 1],
        re: vec![rate],
        im: None,
    }));
    variables
}
