//! A table of campaign.toml in the making: what was answered, else what is guessed, with the reason.

use super::answers::Answers;
use super::entry::{DraftTable, Entry, Kind};
use crate::{InputError, Result};

/// A table in the making.
pub(super) struct Making<'a> {
    answers: &'a Answers,
    pub table: DraftTable,
}

impl<'a> Making<'a> {
    pub fn new(answers: &'a Answers, kind: &'static str, name: &str, repeated: bool) -> Self {
        Making {
            answers,
            table: DraftTable {
                kind,
                name: name.to_string(),
                repeated,
                entries: Vec::new(),
            },
        }
    }

    pub fn single(answers: &'a Answers, kind: &'static str) -> Self {
        Making::new(answers, kind, "", false)
    }

    /// Adds `entry` with the answer given for it, else what `guesses` (value, why) say, the first that is there.
    pub fn add(&mut self, mut entry: Entry, guesses: &[(Option<&str>, &str)]) -> Result<()> {
        let DraftTable { kind, name, .. } = &self.table;
        match self.answers.get(kind, name, entry.key) {
            Some(typed) => entry.give(typed).map_err(|problem| {
                InputError::new(problem)
                    .key(format!("{kind} {name}").trim_end().to_string() + "." + entry.key)
                    .remedy(format!("give {}, such as {}", entry.what, entry.example))
            })?,
            None => {
                if let Some((Some(value), why)) = guesses.iter().find(|(v, _)| v.is_some()) {
                    entry.guess(value, why);
                }
            }
        }
        self.table.entries.push(entry);
        Ok(())
    }

    /// A value that is known for certain, and nobody's to change.
    pub fn fact(&mut self, key: &'static str, kind: Kind, value: &str) {
        self.known(Entry::new(key, kind, "", ""), value);
    }

    /// A value that is known for certain.
    pub fn known(&mut self, mut entry: Entry, value: &str) {
        // What a scan found is always of its form.
        if entry.give(value).is_ok() {
            self.table.entries.push(entry);
        }
    }
}
