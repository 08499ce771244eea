//! The folder of a batch: a file a campaign, tables of the shards, and what they are put together to.
//!
//! A file is written under a temporary name and renamed: what has the name of a result is a whole one, and a worker that is
//! killed loses the campaign in hand.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::analysis::Shard;
use crate::analysis::many::batch::Record;
use crate::files::write_atomically;
use crate::report::stores::batch_table::BatchTable;
use crate::revision::text_fingerprint;
use crate::{Error, InputError, Result};

pub struct BatchFolder {
    dir: PathBuf,
}

/// The tables of all shards of the last division.
pub struct Shards {
    pub table: BatchTable,
    pub of: usize,
    pub missing: Vec<Shard>,
}

impl BatchFolder {
    /// # Errors
    /// Folders that cannot be made.
    pub fn begin(dir: &Path) -> Result<Self> {
        for part in ["campaigns", "shards"] {
            let folder = dir.join(part);
            std::fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, e))?;
        }
        Ok(BatchFolder {
            dir: dir.to_path_buf(),
        })
    }

    /// `campaigns/` and a name that a person recognises and no other campaign has.
    fn path(&self, campaign: &str) -> PathBuf {
        const LONGEST: usize = 60;
        let plain = |c: char| {
            if c.is_ascii_alphanumeric() || "-_.".contains(c) {
                c
            } else {
                '-'
            }
        };
        let tail: Vec<char> = campaign.chars().rev().take(LONGEST).collect();
        let name: String = tail.into_iter().rev().map(plain).collect();
        let name = format!(
            "{}-{}.json",
            name.trim_start_matches(['.', '-']),
            text_fingerprint(campaign)
        );
        self.dir.join("campaigns").join(name)
    }

    /// What was kept of a campaign, if it was made of the same; a file that is not whole counts as none.
    pub fn kept(&self, campaign: &str, fingerprint: &str) -> Option<Record> {
        let bytes = std::fs::read(self.path(campaign)).ok()?;
        let record: Record = serde_json::from_slice(&bytes).ok()?;
        (record.campaign == campaign && record.fingerprint == fingerprint).then_some(record)
    }

    /// Keeps a record, and gives it back as the file has it.
    ///
    /// # Errors
    /// What the file system refuses, naming the file.
    pub fn keep(&self, record: &Record) -> Result<Record> {
        let failed = |e: serde_json::Error| Error::computation(e.to_string());
        let bytes = serde_json::to_vec_pretty(record).map_err(failed)?;
        write_atomically(&self.path(&record.campaign), &bytes)?;
        // Numbers are the same whether a table is made now or of the file.
        serde_json::from_slice(&bytes).map_err(failed)
    }

    /// Writes the table of a shard; gives the paths.
    ///
    /// # Errors
    /// What the file system refuses, naming the file.
    pub fn write_shard(&self, shard: Shard, table: &BatchTable) -> Result<Vec<PathBuf>> {
        let folder = self.dir.join("shards");
        write(table, |ending| folder.join(shard.file_name(ending)))
    }

    /// The tables of all shards as one. Where a folder holds several divisions (into 4 and into 20), the one that was
    /// written last counts.
    ///
    /// # Errors
    /// No shards, or one that cannot be read.
    pub fn shards(dir: &Path) -> Result<Shards> {
        let folder = dir.join("shards");
        let none = || {
            InputError::new("there are no shards of a batch")
                .file(&folder)
                .remedy("run lobestone batch first, and give the folder of its --out")
        };
        let files = std::fs::read_dir(&folder).map_err(|_| none())?;
        let mut found: Vec<(Shard, SystemTime)> = files
            .filter_map(|entry| {
                let entry = entry.ok()?;
                let shard = Shard::of_file_name(entry.file_name().to_str()?, "csv")?;
                Some((shard, entry.metadata().and_then(|m| m.modified()).ok()?))
            })
            .collect();
        found.sort_by_key(|(shard, when)| (*when, shard.of));
        let of = found.last().ok_or_else(none)?.0.of;
        let there: Vec<Shard> = found.iter().map(|(s, _)| *s).filter(|s| s.of == of).collect();
        let mut tables = Vec::new();
        let mut missing = Vec::new();
        for number in 1..=of {
            let shard = Shard { number, of };
            match there.contains(&shard) {
                true => tables.push(BatchTable::read(&folder.join(shard.file_name("csv")))?),
                false => missing.push(shard),
            }
        }
        Ok(Shards {
            table: BatchTable::merged(&tables),
            of,
            missing,
        })
    }
}

/// Writes a table as CSV and, where that is built in, as Parquet; gives the paths.
///
/// # Errors
/// What the file system refuses, naming the file.
pub fn write(table: &BatchTable, path: impl Fn(&str) -> PathBuf) -> Result<Vec<PathBuf>> {
    let csv = path("csv");
    write_atomically(&csv, &table.csv()?)?;
    #[cfg(feature = "parquet")]
    {
        let parquet = path("parquet");
        write_atomically(&parquet, &table.parquet()?)?;
        Ok(vec![csv, parquet])
    }
    #[cfg(not(feature = "parquet"))]
    Ok(vec![csv])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(campaign: &str) -> Record {
        Record {
            campaign: campaign.into(),
            fingerprint: "f1".into(),
            version: "1".into(),
            command: "calibrate".into(),
            robot: None,
            date: None,
            sides: Vec::new(),
        }
    }

    #[test]
    fn half_a_file_and_other_contents_are_not_kept_work() {
        let folder = tempfile::tempdir().unwrap();
        let batch = BatchFolder::begin(folder.path()).unwrap();
        let campaign = "../nights/zelle 7 ü";
        assert_eq!(batch.kept(campaign, "f1"), None);
        batch.keep(&record(campaign)).unwrap();
        assert_eq!(batch.kept(campaign, "f1"), Some(record(campaign)));
        assert_eq!(batch.kept(campaign, "f2"), None);
        assert_eq!(batch.kept("../nights/zelle-7--", "f1"), None);
        let path = batch.path(campaign);
        assert!(path.starts_with(folder.path().join("campaigns")), "{path:?}");
        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, &whole[..whole.len() / 2]).unwrap();
        assert_eq!(batch.kept(campaign, "f1"), None);
    }

    #[test]
    fn the_division_written_last_counts_and_what_lacks_is_named() {
        let folder = tempfile::tempdir().unwrap();
        assert!(BatchFolder::shards(folder.path()).is_err());
        let batch = BatchFolder::begin(folder.path()).unwrap();
        let work: [(&crate::analysis::many::batch::ManifestEntry, Record); 0] = [];
        let manifest = crate::analysis::many::batch::Manifest {
            file: "m.csv".into(),
            columns: Vec::new(),
            entries: Vec::new(),
        };
        let table = BatchTable::new(&manifest, &work);
        batch.write_shard(Shard { number: 1, of: 1 }, &table).unwrap();
        std::thread::sleep(std::time::Duration::from_millis(30));
        batch.write_shard(Shard { number: 3, of: 3 }, &table).unwrap();
        std::fs::write(folder.path().join("shards/.lobestone-half"), "campaign").unwrap();
        let shards = BatchFolder::shards(folder.path()).unwrap();
        assert_eq!(shards.of, 3);
        assert_eq!(
            shards.missing,
            [Shard { number: 1, of: 3 }, Shard { number: 2, of: 3 }]
        );
    }
}
