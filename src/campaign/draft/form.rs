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
    pub fields: Vec<Field>,
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Field {
    pub key: &'static str,
    /// What it is, with its unit; empty: a fact that is not to be changed.
    pub what: &'static str,
    pub example: &'static str,
    /// Empty: anything.
    pub choices: &'static [&'static str],
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
