//! What a campaign's model has learned so far: one revision for each effect that was added, kept in the campaign's
//! folder (`lobestone/revisions.json`).
//!
//! The log holds labels, numbers and where they come from; what an effect is and how a model gets it is the affair of
//! the floors above.

mod clock;
mod evidence;
mod fingerprint;
mod folder;
mod lock;
mod log;

pub use crate::identify::model_history::{
    Evidence, RecordedCandidate, RecordedEffect, RecordedParameter, Revision, Side,
};
pub use clock::now;
pub use evidence::{keep, recall};
pub use fingerprint::{
    cutting_fingerprint, files_fingerprint, fingerprint, folder_fingerprint, structure_fingerprint,
    text_fingerprint,
};
pub use folder::log_file;
pub use lock::hold;
pub use log::RevisionLog;
