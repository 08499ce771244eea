//! Modal parameters from measured FRFs: peaks, then half-power, circle fit and a local rational fit at each
//! peak, then all FRFs of a posture together.
//!
//! Nothing is returned that was not found: a mode needs a peak that stands out of the noise, lies inside the
//! band, turns the right way round in the complex plane and whose fit converges there. What the lines cannot
//! tell is said in the standard deviation and in a warning.

pub mod chosen;
pub mod delay;
mod hits;
mod impact_test;
pub mod indicators;
pub(crate) mod low_end;
pub(crate) mod max_likelihood;
pub mod operational;
pub(crate) mod pole_fit;
pub mod quality;
pub mod scaling;
mod settings;
pub mod shape;
mod sine_lines;
pub(crate) mod single;
pub mod stabilisation;
#[cfg(test)]
mod synthetic;
pub(crate) mod together;
pub mod tracking;

pub use hits::Hit;
pub use impact_test::{Estimator, TapFrfs, TapRecord, TapSettings, impact_test};
pub use settings::Settings;
pub use sine_lines::{SineLine, sine_lines, undamped_hum, without_sines};
pub use single::analysis::{analyse_frf, analyse_frfs};
pub use single::frf_modes::{Disturbance, FrfMode, FrfModes, Method, ModeEstimate};
pub use stabilisation::Tolerances;
pub use together::global::global;
pub use together::global_modes::{GlobalMode, GlobalModes, RejectedMode};
pub use together::reconstruction::Reconstruction;
pub use together::set_member::SetMember;
