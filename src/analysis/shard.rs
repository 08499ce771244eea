//! One of many parts of a piece of work, for many workers.

use std::ops::Range;
use std::str::FromStr;

use crate::{Error, InputError, Result};

/// Which part of a piece of work: the `number`th (from 1) of `of` even parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// Which part, from 1.
    pub number: usize,
    /// How many parts there are.
    pub of: usize,
}

impl FromStr for Shard {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let whole = |part: &str| part.trim().parse::<usize>().ok();
        let read = text.split_once('/').and_then(|(k, n)| whole(k).zip(whole(n)));
        match read {
            Some((number, of)) if number >= 1 && number <= of && of <= 99_999 => Ok(Shard { number, of }),
            _ => Err(InputError::new(format!("{text:?} is no shard"))
                .remedy("write NUMBER/HOW_MANY, the number from 1: --shard 3/20")
                .into()),
        }
    }
}

impl Shard {
    /// A stretch of `count` places; stretches differ by one place at most.
    pub fn places(&self, count: usize) -> Range<usize> {
        let edge = |i: usize| (count as u128 * i as u128 / self.of as u128) as usize;
        edge(self.number - 1)..edge(self.number)
    }

    /// Every `of`th of `count` rows: a row keeps its shard when rows are added behind it.
    pub fn rows(&self, count: usize) -> impl Iterator<Item = usize> + use<> {
        (self.number - 1..count).step_by(self.of)
    }

    /// `shard-00003-of-00020` with an ending.
    pub fn file_name(&self, ending: &str) -> String {
        format!("shard-{:05}-of-{:05}.{ending}", self.number, self.of)
    }

    /// The shard that a file of [`file_name`](Self::file_name) holds.
    pub fn of_file_name(name: &str, ending: &str) -> Option<Shard> {
        let stem = name.strip_suffix(ending)?.strip_suffix('.')?;
        let (number, of) = stem.strip_prefix("shard-")?.split_once("-of-")?;
        let shard: Shard = format!("{number}/{of}").parse().ok()?;
        (shard.file_name(ending) == name).then_some(shard)
    }

    /// The task of a Slurm job array: `variable` gives the value of an environment variable.
    ///
    /// # Errors
    /// No job array, or one whose numbers have gaps.
    pub fn of_slurm(variable: impl Fn(&str) -> Option<String>) -> Result<Shard> {
        let number = |name: &str| variable(name).and_then(|text| text.trim().parse::<usize>().ok());
        let (Some(task), Some(of)) = (number("SLURM_ARRAY_TASK_ID"), number("SLURM_ARRAY_TASK_COUNT")) else {
            return Err(InputError::new(
                "this is no task of a Slurm job array: SLURM_ARRAY_TASK_ID and SLURM_ARRAY_TASK_COUNT are not set",
            )
            .remedy("submit it with sbatch --array=1-20, or write the shard: --shard 3/20")
            .into());
        };
        let first = number("SLURM_ARRAY_TASK_MIN").unwrap_or(1);
        let step = number("SLURM_ARRAY_TASK_STEP").unwrap_or(1).max(1);
        let last = number("SLURM_ARRAY_TASK_MAX").unwrap_or(first + of.saturating_sub(1) * step);
        let whole = task >= first
            && (task - first).is_multiple_of(step)
            && last == first + of.saturating_sub(1) * step;
        let found = whole.then(|| (task - first) / step + 1);
        found
            .and_then(|number| format!("{number}/{of}").parse().ok())
            .ok_or_else(|| {
                InputError::new(format!("task {task} of a job array of {of} tasks with gaps is no shard"))
                    .remedy("submit the whole array again (what is done is skipped), or write the shard: --shard 3/20")
                    .into()
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_cover_all_places_once() {
        for (of, count) in [(1, 10), (3, 10), (10, 10), (7, 100)] {
            let all: Vec<usize> = (1..=of)
                .flat_map(|number| Shard { number, of }.places(count))
                .collect();
            assert_eq!(all, (0..count).collect::<Vec<_>>());
        }
        assert_eq!("3/20".parse::<Shard>().unwrap(), Shard { number: 3, of: 20 });
        for slip in ["", "3", "0/2", "3/2", "a/b", "1/0", "-1/2"] {
            assert!(slip.parse::<Shard>().is_err(), "{slip}");
        }
    }

    #[test]
    fn rows_are_dealt_out_once_and_stay_when_more_come() {
        for (of, count) in [(1, 7), (3, 10), (5, 3)] {
            let mut all: Vec<usize> = (1..=of)
                .flat_map(|number| Shard { number, of }.rows(count))
                .collect();
            all.sort_unstable();
            assert_eq!(all, (0..count).collect::<Vec<_>>());
        }
        let second = Shard { number: 2, of: 3 };
        assert_eq!(second.rows(6).collect::<Vec<_>>(), [1, 4]);
        assert_eq!(second.rows(9).collect::<Vec<_>>(), [1, 4, 7]);
    }

    #[test]
    fn file_names_go_both_ways() {
        let shard = Shard { number: 3, of: 20 };
        let name = shard.file_name("csv");
        assert_eq!(name, "shard-00003-of-00020.csv");
        assert_eq!(Shard::of_file_name(&name, "csv"), Some(shard));
        for other in [
            "shard-00003-of-00020.parquet",
            "shard-3-of-20.csv",
            ".lobestone-x",
            "shard-00003-of-00002.csv",
        ] {
            assert_eq!(Shard::of_file_name(other, "csv"), None, "{other}");
        }
    }

    #[test]
    fn a_job_array_of_slurm() {
        let read = |set: &[(&str, &str)]| {
            let set: Vec<(String, String)> =
                set.iter().map(|(k, v)| (k.to_string(), v.to_string())).collect();
            Shard::of_slurm(move |name| set.iter().find(|(k, _)| k == name).map(|(_, v)| v.clone()))
        };
        let array = |id, count, min, max, step| {
            read(&[
                ("SLURM_ARRAY_TASK_ID", id),
                ("SLURM_ARRAY_TASK_COUNT", count),
                ("SLURM_ARRAY_TASK_MIN", min),
                ("SLURM_ARRAY_TASK_MAX", max),
                ("SLURM_ARRAY_TASK_STEP", step),
            ])
        };
        assert_eq!(
            array("3", "20", "1", "20", "1").unwrap(),
            Shard { number: 3, of: 20 }
        );
        assert_eq!(
            array("0", "4", "0", "3", "1").unwrap(),
            Shard { number: 1, of: 4 }
        );
        assert_eq!(
            array("5", "3", "1", "5", "2").unwrap(),
            Shard { number: 3, of: 3 }
        );
        assert_eq!(
            read(&[("SLURM_ARRAY_TASK_ID", "2"), ("SLURM_ARRAY_TASK_COUNT", "2")]).unwrap(),
            Shard { number: 2, of: 2 }
        );
        // --array=3,7: two tasks, and nobody knows of how many.
        assert!(
            array("7", "2", "3", "7", "1")
                .unwrap_err()
                .to_string()
                .contains("gaps")
        );
        assert!(read(&[]).unwrap_err().to_string().contains("no task of a Slurm"));
    }
}
