//! What a person said.

use std::collections::BTreeMap;

/// What a person said, by table and key: `("cut", "spindle_rpm")` holds for every cut, `("cut 01", "spindle_rpm")` for
/// one. Values as typed.
#[derive(Debug, Clone, Default)]
pub struct Answers(BTreeMap<(String, String), String>);

impl Answers {
    /// Keeps what was typed for a key of one table (`cut 01`) or of all of a kind (`cut`); a later answer replaces it.
    pub fn set(&mut self, table: impl Into<String>, key: impl Into<String>, value: impl Into<String>) {
        self.0.insert((table.into(), key.into()), value.into());
    }

    /// The answer for the table of this name, else the one for all of its kind.
    pub(super) fn get(&self, kind: &str, name: &str, key: &str) -> Option<&str> {
        let look = |table: &str| self.0.get(&(table.to_string(), key.to_string()));
        look(&format!("{kind} {name}"))
            .or_else(|| look(kind))
            .map(String::as_str)
    }

    /// Names that answers of this kind were given for: postures, nodes, cuts.
    pub(super) fn names(&self, kind: &str) -> Vec<&str> {
        let prefix = format!("{kind} ");
        let mut names: Vec<&str> = self
            .0
            .keys()
            .filter_map(|(t, _)| t.strip_prefix(&prefix))
            .collect();
        names.dedup();
        names
    }
}
