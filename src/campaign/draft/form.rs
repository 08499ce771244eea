//! A draft as a form: every key with its value, why it has that, and what may be typed instead.

use serde::Serialize;

use super::campaign_draft::Draft;
use super::entry::{DraftTable, Entry, Kind};

/// A table of the file to be.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Form {
    /// `cut`, `posture`, …
    pub kind: &'static str,
    /// Which of them; empty where there is one.
    pub name: String,
    /// One for each key, in the order of the file.
    pub fields: Vec<Field>,
}

/// One key of the file to be, for somebody to fill in.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Field {
    /// Key of `campaign.toml`.
    pub key: &'static str,
    /// What it is, with its unit; empty: a fact that is not to be changed.
    pub what: &'static str,
    /// A value as it may be typed.
    pub example: &'static str,
    /// Empty: anything.
    pub choices: &'static [&'static str],
    /// The file is incomplete without it.
    pub required: bool,
    /// As a person would type it.
    pub value: Option<String>,
    /// Why a value was taken that nobody gave.
    pub guessed: Option<String>,
}

impl Draft {
    /// In the order of the file.
    pub fn forms(&self) -> Vec<Form> {
        let form = |table: &DraftTable| Form {
            kind: table.kind,
            name: table.name.clone(),
            fields: table.entries.iter().map(field).collect(),
        };
        self.tables.iter().map(form).collect()
    }
}

fn field(entry: &Entry) -> Field {
    Field {
        key: entry.key,
        what: entry.what,
        example: entry.example,
        choices: match entry.kind {
            Kind::Choice(words) => words,
            _ => &[],
        },
        required: entry.required,
        value: entry.typed(),
        guessed: entry.guessed.clone(),
    }
}
