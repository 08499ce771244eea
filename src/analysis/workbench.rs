//! A campaign on the bench: its files are read once and its model is fitted once, however many analyses look at them.

use std::any::{Any, TypeId};
use std::collections::HashMap;
use std::fmt;
use std::ops::Deref;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::Result;
use crate::campaign::{Campaign, FrfFiles, FrfSet};
use crate::identify::model_history::Side;
use crate::ingest::Digest;
use crate::revision::{self, RevisionLog};

/// A campaign with what was read and worked out of its files so far. It stands for the campaign itself wherever only that
/// is needed.
#[derive(Clone)]
pub struct Workbench<'a> {
    campaign: &'a Campaign,
    shelf: Arc<Mutex<Shelf>>,
}

/// Results by their type, so that the bench need not know the analyses that leave them here.
type Shelf = HashMap<TypeId, Arc<dyn Any + Send + Sync>>;

/// The campaign's FRFs, and the fingerprint of the structural side as it was when they were read.
struct ReadFrfs {
    files: FrfFiles,
    /// `None` where the robot file cannot be read.
    fingerprint: Option<String>,
}

/// Of the cutting side.
struct CuttingFingerprint(String);

impl<'a> Workbench<'a> {
    /// Nothing is read before it is needed.
    pub fn new(campaign: &'a Campaign) -> Self {
        Workbench {
            campaign,
            shelf: Arc::default(),
        }
    }

    /// As [`new`](Self::new), where the revisions were read already.
    pub fn with_revisions(campaign: &'a Campaign, log: RevisionLog) -> Self {
        let bench = Self::new(campaign);
        bench.keep(log);
        bench
    }

    /// The same files for `campaign`, which is this one but for what it asks of them.
    pub fn for_request<'b>(&self, campaign: &'b Campaign) -> Workbench<'b> {
        Workbench {
            campaign,
            shelf: self.shelf.clone(),
        }
    }

    /// The campaign itself.
    pub fn campaign(&self) -> &'a Campaign {
        self.campaign
    }

    fn shelf(&self) -> MutexGuard<'_, Shelf> {
        // Whoever panicked with the lock held was only looking something up.
        self.shelf.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The campaign's one `T`, where it was worked out before.
    pub(crate) fn known<T: Any + Send + Sync>(&self) -> Option<Arc<T>> {
        let found = self.shelf().get(&TypeId::of::<T>()).cloned()?;
        found.downcast().ok()
    }

    /// The campaign's one `T` from now on.
    pub(crate) fn keep<T: Any + Send + Sync>(&self, value: T) -> Arc<T> {
        let value = Arc::new(value);
        // Where two worked it out at the same time the first counts, for both.
        let mut shelf = self.shelf();
        let first = shelf.entry(TypeId::of::<T>()).or_insert_with(|| value.clone());
        first.clone().downcast().unwrap_or(value)
    }

    /// The campaign's one `T`: as it was worked out before, else as `work_out` has it. What fails is tried again.
    ///
    /// No lock is held meanwhile: a thread that waited for another's result could be the one whose help that needs.
    pub(crate) fn once<T: Any + Send + Sync>(&self, work_out: impl FnOnce() -> Result<T>) -> Result<Arc<T>> {
        match self.known() {
            Some(known) => Ok(known),
            None => Ok(self.keep(work_out()?)),
        }
    }

    fn read_frfs(&self) -> Result<Arc<ReadFrfs>> {
        self.once(|| {
            let files = self.campaign.read_frf_files()?;
            let fingerprint = revision::structure_fingerprint(self.campaign, &files.digests).ok();
            Ok(ReadFrfs { files, fingerprint })
        })
    }

    /// As [`Campaign::load_frfs`].
    ///
    /// # Errors
    /// As there.
    pub fn load_frfs(&self) -> Result<(FrfSet, Vec<String>)> {
        let files = &self.read_frfs()?.files;
        Ok((files.set.clone(), files.warnings.clone()))
    }

    /// The campaign's revisions, as they were when they were first asked for.
    ///
    /// # Errors
    /// A broken log.
    pub fn revisions(&self) -> Result<Arc<RevisionLog>> {
        self.once(|| RevisionLog::load(&self.campaign.dir))
    }

    /// What is known of the content of the force records, cut by cut, from reading them.
    pub(crate) fn records_were_read(&self, digests: &[Option<Digest>]) {
        if let Ok(fingerprint) = revision::cutting_fingerprint(self.campaign, digests) {
            self.keep(CuttingFingerprint(fingerprint));
        }
    }

    /// What identifies the data of one side, as they were when they were read.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn fingerprint(&self, side: Side) -> Result<String> {
        let of_files = || revision::fingerprint(self.campaign, side);
        match side {
            // FRF files that say nothing have a fingerprint, too.
            Side::Structure => {
                let read = self.read_frfs().ok();
                read.and_then(|read| read.fingerprint.clone())
                    .map_or_else(of_files, Ok)
            }
            Side::Cutting => Ok(self.once(|| of_files().map(CuttingFingerprint))?.0.clone()),
        }
    }
}

impl fmt::Debug for Workbench<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Workbench").field(&self.campaign.dir).finish()
    }
}

impl Deref for Workbench<'_> {
    type Target = Campaign;

    fn deref(&self) -> &Campaign {
        self.campaign
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Error;

    #[test]
    fn what_was_worked_out_is_worked_out_once_and_what_failed_again() {
        struct Answer(u32);
        let dir = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/blind/frf-9112");
        let campaign = Campaign::load(&dir).unwrap();
        let bench = Workbench::new(&campaign);
        assert!(
            bench
                .once::<Answer>(|| Err(Error::computation("not yet")))
                .is_err()
        );
        assert_eq!(bench.once(|| Ok(Answer(42))).unwrap().0, 42);
        let again = bench.for_request(&campaign);
        assert_eq!(again.once(|| Ok(Answer(43))).unwrap().0, 42);
        assert_eq!(Workbench::new(&campaign).once(|| Ok(Answer(43))).unwrap().0, 43);
    }

    #[test]
    fn each_file_is_read_once() {
        use crate::analysis::forces::force_records::identify_forces;
        use crate::analysis::{CuttingFindings, LobeFindings, ModalAnalysis, StructureFindings};
        use crate::cutting::CfcOptions;
        use crate::identify::Options;

        let folder = tempfile::tempdir().unwrap();
        let dir = crate::builtin::FIRST_CELL.write(folder.path()).unwrap();
        let campaign = Campaign::load(&dir).unwrap();
        let bench = Workbench::new(&campaign);
        identify_forces(&bench, CfcOptions::default()).unwrap();
        StructureFindings::on(&bench).unwrap();
        for file in campaign
            .frfs
            .iter()
            .map(|f| &f.file)
            .chain(campaign.cuts.iter().map(|c| &c.file))
        {
            std::fs::remove_file(file).unwrap();
        }
        ModalAnalysis::usual(&bench).unwrap();
        CuttingFindings::on(&bench, Options::default()).unwrap();
        LobeFindings::on(&bench).unwrap();
        for side in [Side::Structure, Side::Cutting] {
            bench.fingerprint(side).unwrap();
        }
    }

    #[test]
    fn a_fingerprint_is_the_same_whether_the_files_were_read_or_not() {
        for (name, side) in [("frf-9112", Side::Structure), ("force-9400", Side::Cutting)] {
            let dir = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/blind");
            let campaign = Campaign::load(&dir.join(name)).unwrap();
            let of_files = revision::fingerprint(&campaign, side).unwrap();
            let bench = Workbench::new(&campaign);
            if side == Side::Cutting {
                crate::analysis::forces::force_records::ForceRecords::of(&bench);
                assert!(bench.known::<CuttingFingerprint>().is_some());
            }
            assert_eq!(bench.fingerprint(side).unwrap(), of_files);
        }
    }
}
