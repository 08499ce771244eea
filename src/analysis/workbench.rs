//! A campaign on the bench: its FRF files, its revisions and what identifies its data are read once, however many analyses
//! look at them.

use std::ops::Deref;
use std::sync::{Arc, OnceLock};

use crate::Result;
use crate::campaign::{Campaign, FrfSet};
use crate::identify::model_history::Side;
use crate::revision::{self, RevisionLog};

/// A campaign with what was read of its files so far. It stands for the campaign itself wherever only that is needed.
#[derive(Debug, Clone)]
pub struct Workbench<'a> {
    campaign: &'a Campaign,
    read: Arc<ReadOnce>,
}

/// What is read when it is first asked for. What fails is tried again.
#[derive(Debug, Default)]
struct ReadOnce {
    frfs: OnceLock<FrfFiles>,
    revisions: OnceLock<RevisionLog>,
    /// Of the force records.
    cutting_fingerprint: OnceLock<String>,
}

/// The campaign's FRFs, what was noticed while they were read, and the fingerprint of the structural side.
#[derive(Debug)]
struct FrfFiles {
    set: FrfSet,
    warnings: Vec<String>,
    /// `None` where the robot file cannot be read.
    fingerprint: Option<String>,
}

fn once<T>(cell: &OnceLock<T>, read: impl FnOnce() -> Result<T>) -> Result<&T> {
    match cell.get() {
        Some(known) => Ok(known),
        None => {
            let value = read()?;
            Ok(cell.get_or_init(|| value))
        }
    }
}

impl<'a> Workbench<'a> {
    /// Nothing is read before it is needed.
    pub fn new(campaign: &'a Campaign) -> Self {
        Workbench {
            campaign,
            read: Arc::default(),
        }
    }

    /// As [`new`](Self::new), where the revisions were read already.
    pub fn with_revisions(campaign: &'a Campaign, log: RevisionLog) -> Self {
        let bench = Self::new(campaign);
        // The lock is new: nobody was there before.
        let _ = bench.read.revisions.set(log);
        bench
    }

    /// The same files for `campaign`, which is this one but for what it asks of them.
    pub fn for_request<'b>(&self, campaign: &'b Campaign) -> Workbench<'b> {
        Workbench {
            campaign,
            read: self.read.clone(),
        }
    }

    /// The campaign itself.
    pub fn campaign(&self) -> &'a Campaign {
        self.campaign
    }

    fn frf_files(&self) -> Result<&FrfFiles> {
        once(&self.read.frfs, || {
            let contents = self.campaign.frf_contents();
            let fingerprint = revision::structure_fingerprint_of(self.campaign, &contents).ok();
            let (set, warnings) = self.campaign.frfs_in(contents)?;
            Ok(FrfFiles {
                set,
                warnings,
                fingerprint,
            })
        })
    }

    /// As [`Campaign::load_frfs`].
    ///
    /// # Errors
    /// As there.
    pub fn load_frfs(&self) -> Result<(FrfSet, Vec<String>)> {
        let files = self.frf_files()?;
        Ok((files.set.clone(), files.warnings.clone()))
    }

    /// The campaign's revisions, as they were when they were first asked for.
    ///
    /// # Errors
    /// A broken log.
    pub fn revisions(&self) -> Result<&RevisionLog> {
        once(&self.read.revisions, || RevisionLog::load(&self.campaign.dir))
    }

    /// What identifies the data of one side, as they were when they were read.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn fingerprint(&self, side: Side) -> Result<String> {
        match side {
            // FRF files that say nothing have a fingerprint, too.
            Side::Structure => match self.frf_files().ok().and_then(|f| f.fingerprint.clone()) {
                Some(known) => Ok(known),
                None => revision::structure_fingerprint(self.campaign),
            },
            Side::Cutting => once(&self.read.cutting_fingerprint, || {
                revision::cutting_fingerprint(self.campaign)
            })
            .cloned(),
        }
    }
}

impl Deref for Workbench<'_> {
    type Target = Campaign;

    fn deref(&self) -> &Campaign {
        self.campaign
    }
}
