//! Signals: drift of charge amplifiers, steady windows, spectra.
pub mod frf_noise;
