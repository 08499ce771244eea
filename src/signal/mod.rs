//! Signals: drift of charge amplifiers, steady windows, spectra.
