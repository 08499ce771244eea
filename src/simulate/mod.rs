//! The virtual lab: writes a campaign whose truth is known.
//!
//! A side of a campaign ([`structure`], or [`forces`] of milled cuts) turns its scenario into a
//! [`LabCampaign`]: the files of the folder and the truth. [`LabCampaign::write`] puts both on disk, the truth next to
//! the folder, so that the folder itself stays blind.
//!
//! What is simulated comes from the same model that is fitted. A program that finds what it has put there itself proves
//! its mathematics and its statistics, not its physics.

mod campaign_folder;
pub mod departure;
pub mod draw;
mod files;
pub mod forces;
pub mod foreign;
mod lab_robot;
mod laboratory;
mod noise;
mod postures;
pub mod random;
mod request;
mod scenario;
pub(crate) mod sizes;
pub mod structure;
mod world;

pub use campaign_folder::{LabCampaign, Written, check_target, truth_beside};
pub use files::FrfFormat;
pub use lab_robot::LabRobot;
pub use laboratory::Slip;
pub use noise::LineNoise;
pub use postures::PostureScheme;
pub use request::EffectRequest;
pub use scenario::{CampaignKind, FrfLayout, StructureScenario};
pub use sizes::visibility::Visibility;
