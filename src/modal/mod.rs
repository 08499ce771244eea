//! Modal parameters from measured FRFs: peaks, then half-power, circle fit and a local rational fit at each
//! peak, then all FRFs of a posture together.
//!
//! Nothing is returned that was not found: a mode needs a peak that stands out of the noise, lies inside the
//! band, turns the right way round in the complex plane and whose fit converges there. What the lines cannot
//! tell is said in the standard deviation and in a warning.

mod alike;
mod analysis;
#[cfg(test)]
mod analysis_tests;
pub mod chosen;
mod circle_fit;
mod condense;
mod curve;
pub mod delay;
mod findings;
#[cfg(test)]
mod foreign_marks;
mod frf_modes;
mod global;
#[cfg(test)]
mod global_marks;
mod global_modes;
mod half_power;
mod hits;
mod impact_test;
pub mod indicators;
mod joint_fit;
mod local_fit;
mod lscf;
#[cfg(test)]
mod marks;
mod ml_fit;
mod ml_linear;
pub mod operational;
mod peaks;
pub mod quality;
mod reconstruction;
pub mod scaling;
mod select;
mod set_member;
mod set_noise;
mod settings;
pub mod shape;
mod sine_lines;
pub mod stabilisation;
#[cfg(test)]
mod synthetic;
pub mod tracking;
mod verify;

pub use analysis::{analyse_frf, analyse_frfs};
pub use frf_modes::{FrfMode, FrfModes, Method, ModeEstimate};
pub use global::global;
pub use global_modes::{GlobalMode, GlobalModes, RejectedMode};
pub use hits::Hit;
pub use impact_test::{Estimator, TapFrfs, TapRecord, TapSettings, impact_test};
pub use reconstruction::Reconstruction;
pub use set_member::SetMember;
pub use settings::Settings;
pub use sine_lines::{SineLine, sine_lines, without_sines};
pub use stabilisation::Tolerances;
