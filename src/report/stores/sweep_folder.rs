//! The folder of a map of the workspace: shards as Parquet files, and all of them as one.
//!
//! Every file carries the settings it was made with in its metadata, under the key `lobestone.sweep`; a file is written
//! under a temporary name and renamed, so what has the name of a shard is a whole shard.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use polars::io::parquet::write::KeyValueMetadata;
use polars::prelude::{ParquetReader, ParquetWriter, PolarsError, SerReader};
use serde_json::{Map, Value, json};

use crate::analysis::{Shard, SweepRow};
use crate::files::{write_atomically, write_new, write_streamed};
use crate::report::stores::sweep_table::{MergedTable, ROWS_AT_A_TIME, frame, read};
use crate::{Error, InputError, Result};

/// Key of the settings in a file's metadata.
const SETTINGS: &str = "lobestone.sweep";
/// Shards that are named where some are missing.
const NAMED: usize = 12;

/// The folder of one map: `sweep.json` (what it is), `shards/` and what they are merged into.
pub struct SweepFolder {
    pub dir: PathBuf,
    pub settings: Map<String, Value>,
    pub shards: usize,
    pub places: usize,
}

impl SweepFolder {
    /// Begins the folder, or finds it begun with the same settings.
    ///
    /// # Errors
    /// A folder of another map: says which settings differ.
    pub fn begin(dir: &Path, settings: &Map<String, Value>, shards: usize, places: usize) -> Result<Self> {
        let folder = SweepFolder {
            dir: dir.to_path_buf(),
            settings: settings.clone(),
            shards,
            places,
        };
        let in_it = folder.dir.join("shards");
        std::fs::create_dir_all(&in_it).map_err(|e| Error::io(&in_it, e))?;
        let text = json!({ "settings": settings, "shards": shards, "places": places });
        // Shards that start together all write the same; one of them wins, the others compare.
        if write_new(&folder.head(), format!("{text:#}\n").as_bytes())? {
            return Ok(folder);
        }
        let other = SweepFolder::open(dir)?;
        let mut differ = differences(&other.settings, settings);
        if other.shards != shards {
            differ.push(format!("shards (there {}, now {shards})", other.shards));
        }
        match differ.is_empty() {
            true => Ok(other),
            false => Err(InputError::new(format!(
                "this folder holds a map with other settings; what differs: {}",
                differ.join("; ")
            ))
            .file(folder.head())
            .remedy("repeat the settings of the folder, or give another folder to --out")
            .into()),
        }
    }

    /// A folder that shards were written to.
    ///
    /// # Errors
    /// No `sweep.json`, or one that this program did not write.
    pub fn open(dir: &Path) -> Result<Self> {
        let head = dir.join("sweep.json");
        let text = std::fs::read_to_string(&head).map_err(|e| Error::io(&head, e))?;
        let refuse = |problem: String| -> Error {
            InputError::new(problem)
                .file(&head)
                .remedy("start the map again in a new folder")
                .into()
        };
        let document: Value = serde_json::from_str(&text).map_err(|e| refuse(format!("not JSON: {e}")))?;
        let whole = |key: &str| document[key].as_u64().map(|n| n as usize);
        let parts = document["settings"]
            .as_object()
            .zip(whole("shards").filter(|n| *n >= 1))
            .zip(whole("places"));
        let ((settings, shards), places) =
            parts.ok_or_else(|| refuse("not the head of a map (settings, shards, places)".into()))?;
        Ok(SweepFolder {
            dir: dir.to_path_buf(),
            settings: settings.clone(),
            shards,
            places,
        })
    }

    fn head(&self) -> PathBuf {
        self.dir.join("sweep.json")
    }

    pub fn path(&self, shard: Shard) -> PathBuf {
        self.dir.join("shards").join(shard.file_name("parquet"))
    }

    /// Whether a shard is there and whole; one that cannot be read counts as not there.
    ///
    /// # Errors
    /// One that was made with other settings (copied here from another map).
    pub fn has(&self, shard: Shard) -> Result<bool> {
        let path = self.path(shard);
        let Ok((rows, settings)) = head_of(&path) else {
            return Ok(false);
        };
        let differ = differences(&settings, &self.settings);
        if !differ.is_empty() {
            return Err(InputError::new(format!(
                "this shard was made with other settings; what differs: {}",
                differ.join("; ")
            ))
            .file(path)
            .remedy("take the file away and run the shard again")
            .into());
        }
        Ok(rows == shard.places(self.places).len())
    }

    /// Writes the rows of a shard.
    ///
    /// # Errors
    /// What the file system refuses, naming the file.
    pub fn write(&self, shard: Shard, rows: &[SweepRow]) -> Result<PathBuf> {
        let path = self.path(shard);
        let failed = |e| Error::computation(format!("{}: {e}", path.display()));
        let joints = self
            .settings
            .get("joints_deg")
            .and_then(Value::as_array)
            .map_or(0, Vec::len);
        let mut frame = frame(rows, joints).map_err(failed)?;
        let mut bytes = Vec::new();
        self.writer(&mut bytes).finish(&mut frame).map_err(failed)?;
        write_atomically(&path, &bytes)?;
        Ok(path)
    }

    /// All shards as one table, in the order of the places, written as `sweep.parquet`; byte for byte the same however
    /// many shards it was computed in.
    ///
    /// # Errors
    /// Shards that are missing, by name, or made with other settings.
    pub fn merge(&self) -> Result<MergedTable> {
        self.merge_in(ROWS_AT_A_TIME)
    }

    fn merge_in(&self, rows_a_group: usize) -> Result<MergedTable> {
        let all = (1..=self.shards).map(|number| Shard {
            number,
            of: self.shards,
        });
        let mut missing = Vec::new();
        for shard in all.clone() {
            if !self.has(shard)? {
                missing.push(format!("{}/{}", shard.number, shard.of));
            }
        }
        if !missing.is_empty() {
            let more = missing.len().saturating_sub(NAMED);
            let mut names = missing[..missing.len().min(NAMED)].join(", ");
            if more > 0 {
                names += &format!(" and {more} more");
            }
            return Err(InputError::new(format!(
                "{} of {} shards are missing: {names}",
                missing.len(),
                self.shards
            ))
            .file(self.dir.join("shards"))
            .remedy("run them with the same settings and --shard NUMBER/HOW_MANY, then merge again")
            .into());
        }
        let all: Vec<Shard> = all.collect();
        let path = self.merged();
        write_streamed(&path, |out| self.join(&all, rows_a_group, out))?;
        Ok(MergedTable {
            path,
            places: self.places,
        })
    }

    /// The rows of all shards, one behind the other, in groups of so many: a group is in memory, not the map.
    fn join(&self, shards: &[Shard], rows_a_group: usize, out: &mut dyn Write) -> Result<()> {
        let mut out = BufWriter::new(out);
        let Some(first) = shards.first() else {
            return Ok(());
        };
        // No rows, but the columns.
        let mut group = read(&self.path(*first), None, 0, 0)?;
        let faulty = |e: PolarsError| Error::computation(format!("the merged table: {e}"));
        let mut writer = self.writer(&mut out).batched(group.schema()).map_err(faulty)?;
        for shard in shards {
            let path = self.path(*shard);
            let rows = shard.places(self.places).len();
            let mut taken = 0;
            while taken < rows {
                let part = read(&path, None, taken, rows_a_group - group.height())?;
                if part.height() == 0 || part.schema() != group.schema() {
                    let now = format!(
                        "{}: changed while it was merged, or written with other columns",
                        path.display()
                    );
                    return Err(Error::computation(now));
                }
                taken += part.height();
                group.vstack_mut_owned(part).map_err(faulty)?;
                if group.height() == rows_a_group {
                    group.rechunk_mut();
                    writer.write_batch(&group).map_err(faulty)?;
                    group = group.clear();
                }
            }
        }
        if group.height() > 0 {
            group.rechunk_mut();
            writer.write_batch(&group).map_err(faulty)?;
        }
        writer.finish().map_err(faulty)?;
        drop(writer);
        out.flush().map_err(|e| Error::io(&self.merged(), e))
    }

    fn merged(&self) -> PathBuf {
        self.dir.join("sweep.parquet")
    }

    /// Of tables of this map.
    fn writer<W: Write>(&self, out: W) -> ParquetWriter<W> {
        let settings = Value::Object(self.settings.clone()).to_string();
        let metadata = KeyValueMetadata::from_static(vec![(SETTINGS.into(), settings)]);
        ParquetWriter::new(out)
            .with_row_group_size(Some(ROWS_AT_A_TIME))
            .with_key_value_metadata(Some(metadata))
    }
}

/// Settings that are not the same, with both values.
fn differences(there: &Map<String, Value>, now: &Map<String, Value>) -> Vec<String> {
    let mut keys: Vec<&String> = there.keys().chain(now.keys()).collect();
    keys.sort();
    keys.dedup();
    let text = |map: &Map<String, Value>, key: &str| map.get(key).unwrap_or(&Value::Null).to_string();
    keys.into_iter()
        .filter(|key| text(there, key) != text(now, key))
        .map(|key| format!("{key} (there {}, now {})", text(there, key), text(now, key)))
        .collect()
}

/// Rows and settings of a file.
fn head_of(path: &Path) -> std::result::Result<(usize, Map<String, Value>), String> {
    let file = File::open(path).map_err(|e| e.to_string())?;
    let mut reader = ParquetReader::new(file);
    let metadata = reader.get_metadata().map_err(|e| e.to_string())?.clone();
    let pairs = metadata.key_value_metadata().iter().flatten();
    let text = pairs
        .filter(|pair| pair.key == SETTINGS)
        .find_map(|pair| pair.value.clone())
        .ok_or("no settings in it")?;
    let settings: Map<String, Value> = serde_json::from_str(&text).map_err(|e| e.to_string())?;
    Ok((metadata.num_rows, settings))
}

#[cfg(test)]
mod tests {
    use polars::prelude::DataFrame;

    use super::*;
    use crate::analysis::stability::sweep::PlaceFindings;
    use crate::lobes::best_speed::BestSpeed;
    use crate::lobes::workspace::PlaceStatus;
    use crate::lobes::workspace_grid::GridPlace;
    use crate::report::stores::sweep_summary::MapTable;

    fn settings(step: f64) -> Map<String, Value> {
        json!({ "angle_step_deg": step, "posture": "p1", "joints_deg": vec![0.0; 6] })
            .as_object()
            .unwrap()
            .clone()
    }

    fn row(index: usize) -> SweepRow {
        let usable = index % 3 != 0;
        SweepRow {
            place: GridPlace {
                index,
                tcp_m: [1.0, 0.1 * index as f64, 0.5],
                tool_axis: [0.0, 0.0, -1.0],
                angle_deg: 30.0,
            },
            status: if usable {
                PlaceStatus::Reachable
            } else {
                PlaceStatus::JointLimit
            },
            findings: usable.then(|| PlaceFindings {
                joints_deg: vec![1.0, 2.0, 3.0, 4.0, 5.0, index as f64],
                ik_branch: 3,
                limit_margin_deg: None,
                singularity_margin: 0.4,
                absolute: None,
                best: BestSpeed {
                    spindle_rpm: 300.0,
                    depth_mm: Some(0.1 * index as f64),
                },
                tcp_stiffness_n_per_m: [1e6, 2e6, 3e6],
                lowest_frequency_hz: Some(7.0),
            }),
        }
    }

    fn merged(shards: usize, places: usize, rows_a_group: usize) -> Vec<u8> {
        let dir = tempfile::tempdir().unwrap();
        let folder = SweepFolder::begin(dir.path(), &settings(30.0), shards, places).unwrap();
        for number in (1..=shards).rev() {
            let shard = Shard { number, of: shards };
            let rows: Vec<SweepRow> = shard.places(places).map(row).collect();
            assert!(!folder.has(shard).unwrap());
            folder.write(shard, &rows).unwrap();
            assert!(folder.has(shard).unwrap());
        }
        let table = SweepFolder::open(dir.path())
            .unwrap()
            .merge_in(rows_a_group)
            .unwrap();
        assert_eq!(table.places, places);
        let frame = read(&table.path, None, 0, usize::MAX).unwrap();
        assert_eq!(frame.height(), places);
        let number = |name: &str, i: usize| frame.column(name).unwrap().f64().unwrap().get(i);
        assert_eq!(number("q6_deg", 4), Some(4.0));
        assert_eq!(
            (number("q6_deg", 3), number("absolute_limit_mm", 4)),
            (None, None)
        );
        assert_eq!(
            frame.column("status").unwrap().str().unwrap().get(6),
            Some("joint-limit")
        );
        std::fs::read(&table.path).unwrap()
    }

    /// As it was merged when the whole map was held: one table on top of the other, written at once.
    fn held_whole(shards: usize, places: usize) -> (DataFrame, Vec<u8>) {
        let dir = tempfile::tempdir().unwrap();
        let folder = SweepFolder::begin(dir.path(), &settings(30.0), shards, places).unwrap();
        let mut whole = DataFrame::default();
        for number in 1..=shards {
            let rows: Vec<SweepRow> = Shard { number, of: shards }.places(places).map(row).collect();
            whole.vstack_mut_owned(frame(&rows, 6).unwrap()).unwrap();
        }
        whole.rechunk_mut();
        let mut bytes = Vec::new();
        folder.writer(&mut bytes).finish(&mut whole).unwrap();
        (whole, bytes)
    }

    #[test]
    fn the_merged_table_does_not_know_how_many_shards_there_were() {
        let (_, held) = held_whole(1, 11);
        for shards in [1, 4, 11] {
            assert_eq!(merged(shards, 11, ROWS_AT_A_TIME), held, "{shards} shards");
        }
        // Groups that begin and end within shards, at their ends, and hold several of them.
        for rows_a_group in [1, 3, 5, 11, 12] {
            let one = merged(1, 11, rows_a_group);
            for shards in [2, 4, 11] {
                assert_eq!(
                    merged(shards, 11, rows_a_group),
                    one,
                    "{shards} shards, groups of {rows_a_group}"
                );
            }
        }
    }

    /// Several groups of the size that is used: every cell and its place as in a table that is held whole, and what is
    /// read of it a stretch at a time.
    #[test]
    fn a_long_map_is_the_table_that_it_was() {
        let places = 2 * ROWS_AT_A_TIME + 5;
        let dir = tempfile::tempdir().unwrap();
        let folder = SweepFolder::begin(dir.path(), &settings(30.0), 3, places).unwrap();
        for number in 1..=3 {
            let shard = Shard { number, of: 3 };
            let rows: Vec<SweepRow> = shard.places(places).map(row).collect();
            folder.write(shard, &rows).unwrap();
        }
        let table = folder.merge().unwrap();
        let (held, _) = held_whole(3, places);
        let read_back = read(&table.path, None, 0, usize::MAX).unwrap();
        assert_eq!(read_back.schema(), held.schema());
        assert!(read_back.equals_missing(&held));
        let metadata = ParquetReader::new(File::open(&table.path).unwrap())
            .get_metadata()
            .unwrap()
            .clone();
        let groups: Vec<usize> = metadata.row_groups.iter().map(|group| group.num_rows()).collect();
        assert_eq!(groups, [ROWS_AT_A_TIME, ROWS_AT_A_TIME, 5]);

        let column = |name: &str| {
            held.column(name)
                .unwrap()
                .f64()
                .unwrap()
                .iter()
                .collect::<Vec<_>>()
        };
        let (depth, y) = (column("best_depth_mm"), column("y_m"));
        let mut place = 0;
        table
            .numbers(&["best_depth_mm", "y_m"], &mut |values| {
                assert_eq!(values, [depth[place], y[place]], "{place}");
                place += 1;
            })
            .unwrap();
        assert_eq!(place, places);
        let mut statuses = Vec::new();
        table
            .statuses(&mut |name| statuses.push(name.to_string()))
            .unwrap();
        let status = held.column("status").unwrap().str().unwrap();
        assert!(status.iter().eq(statuses.iter().map(|s| Some(s.as_str()))));
        for place in [0, 1, ROWS_AT_A_TIME, places - 1] {
            let row = table.row(place).unwrap();
            assert_eq!(
                (&row["place"], &row["q6_deg"]),
                (&json!(place), &json!(column("q6_deg")[place]))
            );
        }
        assert!(table.numbers(&["no_such_column"], &mut |_| {}).is_err());
    }

    #[test]
    fn other_settings_and_missing_shards_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let folder = SweepFolder::begin(dir.path(), &settings(30.0), 3, 9).unwrap();
        let refused = |step: f64, shards: usize| {
            SweepFolder::begin(dir.path(), &settings(step), shards, 9)
                .err()
                .map(|e| e.to_string())
        };
        assert_eq!(refused(30.0, 3), None);
        let message = refused(20.0, 3).unwrap();
        assert!(
            message.contains("angle_step_deg (there 30.0, now 20.0)"),
            "{message}"
        );
        assert!(!message.contains("posture"), "{message}");
        assert!(refused(30.0, 4).unwrap().contains("shards (there 3, now 4)"));

        let second = Shard { number: 2, of: 3 };
        let rows: Vec<SweepRow> = second.places(9).map(row).collect();
        folder.write(second, &rows).unwrap();
        let message = folder.merge().err().unwrap().to_string();
        assert!(
            message.contains("2 of 3 shards are missing: 1/3, 3/3"),
            "{message}"
        );
        assert!(!dir.path().join("sweep.parquet").exists());

        // Settings as they should be, and other columns: of another version of this program.
        for shard in [Shard { number: 1, of: 3 }, Shard { number: 3, of: 3 }] {
            folder
                .write(shard, &shard.places(9).map(row).collect::<Vec<_>>())
                .unwrap();
        }
        let mut other = Vec::new();
        let mut five_joints = frame(&rows, 5).unwrap();
        folder.writer(&mut other).finish(&mut five_joints).unwrap();
        std::fs::write(folder.path(second), other).unwrap();
        let message = folder.merge().err().unwrap().to_string();
        assert!(
            message.contains("00002-of-00003") && message.contains("other columns"),
            "{message}"
        );
        let left: Vec<_> = std::fs::read_dir(dir.path())
            .unwrap()
            .map(|e| e.unwrap().file_name())
            .collect();
        assert_eq!(left.len(), 2, "{left:?}");
        folder.write(second, &rows).unwrap();
        folder.merge().unwrap();

        // Cut off by a full disk, short of rows, or from another map: none of them passes for the shard.
        let whole = std::fs::read(folder.path(second)).unwrap();
        std::fs::write(folder.path(second), &whole[..whole.len() / 2]).unwrap();
        assert!(!folder.has(second).unwrap());
        folder.write(second, &rows[1..]).unwrap();
        assert!(!folder.has(second).unwrap());
        let elsewhere = tempfile::tempdir().unwrap();
        let other = SweepFolder::begin(elsewhere.path(), &settings(20.0), 3, 9).unwrap();
        std::fs::copy(other.write(second, &rows).unwrap(), folder.path(second)).unwrap();
        let message = folder.has(second).unwrap_err().to_string();
        assert!(message.contains("made with other settings"), "{message}");
    }
}
