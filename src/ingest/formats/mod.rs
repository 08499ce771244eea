//! A file for each format of laboratory files.

pub(crate) mod columns;
pub(crate) mod force;
pub(crate) mod frf_text;
pub(crate) mod geometry;
pub(crate) mod lvm;
pub(crate) mod mat;
pub(crate) mod numpy;
pub(crate) mod packed;
pub(crate) mod pulse;
pub(crate) mod tdms;
pub(crate) mod twincat;
pub(crate) mod uff;
pub(crate) mod waveform;
pub(crate) mod workbook;
