//! Signals: drift of charge amplifiers, steady windows, spectra.

mod air_check;
mod blocks;
mod drift;
mod end_states;
mod engagement;
mod faults;
pub mod frf_noise;
mod local_rational;
mod mains;
pub mod noise_law;
mod order_spectrum;
mod pulses;
mod spindle_track;
mod steady_window;
mod tooth_line;

pub use blocks::{SignalBlocks, Spindle, mean, median};
pub(crate) use blocks::{line, robust_std};
pub use drift::{Air, DriftLine, fit_drift};
pub use engagement::change;
pub(crate) use faults::least_and_greatest;
pub use faults::{Clipping, Faults, find_faults, samples_in};
pub use mains::{MAINS_HZ, from_mains_hz};
pub use order_spectrum::{
    OrderSpectrum, highest_order, highest_order_seen_whole, line_amplitude, mean_between, order_spectrum,
    order_spectrum_above,
};
pub use pulses::pulsed_channel;
pub use spindle_track::{SpindleTrack, spindle_track};
pub use steady_window::{Phases, find_phases, whole_revolutions};
pub use tooth_line::{ToothLine, tooth_line};
