//! Wrong files before missing physics: ordinary mistakes of a laboratory, tried on a fitted model and named as what they are.
//!
//! Two kinds of mistake. A [`Mistake`] has a size (an encoder offset, a gain, a corner frequency) and changes what the model
//! predicts for the files; its score is a linear estimate with what the baseline can absorb projected out, and the
//! promising ones are fitted together with the baseline. A [`FileReading`] has none (axes exchanged, a sign, a posture's file
//! filed under another): the data are put right and the baseline is fitted again. A finding has to be more than chance, to
//! leave less than the physics of the library would, and to explain what stands above the noise.

mod apart;
mod care;
mod cutting;
mod decide;
mod examine;
mod finding;
mod fit;
mod group;
mod mistake;
mod mistakes;
mod numbers;
mod reading;
mod readings;
mod scene;
mod score;
mod slipped;
mod slips;
#[cfg(test)]
mod tests;
mod truth;

pub use care::CARE;
pub use cutting::examine_cutting;
pub use decide::Rival;
pub use examine::{SetupCheck, examine, library_rival};
pub use finding::{LIKELY, SetupFinding};
pub use group::FrfGroup;
pub use mistake::Mistake;
pub use reading::FileReading;
pub use slips::absorb as absorb_slips;
