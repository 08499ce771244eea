//! One line of the file to be, and how what a person types becomes TOML.

use crate::campaign::guesses::MARK;
use crate::text::quoted;

/// What a value looks like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Any text that is not empty.
    Text,
    /// One of these words; case does not count.
    Choice(&'static [&'static str]),
    /// A finite number; a comma is a decimal point.
    Number,
    /// A whole number.
    Whole,
    /// A list of numbers.
    Numbers,
    /// `slot`, or start and exit angle in degrees: becomes other keys.
    Immersion,
    /// Three rows of three numbers.
    Matrix,
}

/// A key of the file to be.
#[derive(Debug, Clone)]
pub struct Entry {
    /// Key of `campaign.toml`.
    pub key: &'static str,
    /// What its value looks like.
    pub kind: Kind,
    /// In words, with the unit: what is asked for.
    pub what: &'static str,
    /// As typed, and as it stands after `key =` in a comment.
    pub example: &'static str,
    /// The file is incomplete without it.
    pub required: bool,
    /// Stands in the file only where it is given.
    pub unmentioned: bool,
    /// Keys and values as TOML; empty: not known.
    value: Vec<(&'static str, String)>,
    /// Why a value was taken that nobody gave.
    pub guessed: Option<String>,
}

impl Entry {
    pub(crate) fn new(key: &'static str, kind: Kind, what: &'static str, example: &'static str) -> Self {
        Entry {
            key,
            kind,
            what,
            example,
            required: true,
            unmentioned: false,
            value: Vec::new(),
            guessed: None,
        }
    }

    pub(crate) fn optional(mut self) -> Self {
        self.required = false;
        self
    }

    /// Optional, and without a line that says so.
    pub fn unmentioned(mut self) -> Self {
        self.unmentioned = true;
        self.optional()
    }

    pub(crate) fn is_given(&self) -> bool {
        !self.value.is_empty()
    }

    pub(crate) fn is_missing(&self) -> bool {
        self.required && self.value.is_empty()
    }

    /// The value as TOML, for a message.
    pub fn value_text(&self) -> Option<String> {
        let values: Vec<&str> = self.value.iter().map(|(_, v)| v.as_str()).collect();
        (!values.is_empty()).then(|| values.join(" to "))
    }

    /// The value as a person would type it.
    pub fn typed(&self) -> Option<String> {
        let values: Vec<String> = self.value.iter().map(|(_, v)| typed(v)).collect();
        (!values.is_empty()).then(|| values.join(", "))
    }

    /// Takes what a person typed.
    ///
    /// # Errors
    /// What is wrong with it, as a sentence.
    pub fn give(&mut self, typed: &str) -> Result<(), String> {
        self.value = parse(self.kind, self.key, typed.trim())?;
        self.guessed = None;
        Ok(())
    }

    /// Takes a value that was concluded; what cannot be understood stays unknown.
    pub fn guess(&mut self, value: &str, why: &str) {
        if let Ok(value) = parse(self.kind, self.key, value) {
            self.value = value;
            self.guessed = Some(why.to_string());
        }
    }

    /// As it stands in the file.
    pub fn lines(&self) -> String {
        if self.value.is_empty() && self.unmentioned {
            return String::new();
        }
        if self.value.is_empty() {
            // No value stands there that somebody could leave by mistake.
            let hint = if self.required { "fill in: " } else { "" };
            return format!(
                "# {hint}{} = …  # {}, such as {}\n",
                self.key, self.what, self.example
            );
        }
        let note = self
            .guessed
            .as_ref()
            .map_or(String::new(), |why| format!("  {MARK}{why}"));
        let lines = self
            .value
            .iter()
            .map(|(key, value)| format!("{key} = {value}{note}\n"));
        lines.collect()
    }
}

fn parse(kind: Kind, key: &'static str, typed: &str) -> Result<Vec<(&'static str, String)>, String> {
    if typed.is_empty() {
        return Err(format!("{key} is empty"));
    }
    let value = match kind {
        Kind::Text => quoted(typed),
        Kind::Choice(words) => {
            let word = words.iter().find(|w| w.eq_ignore_ascii_case(typed));
            let word = word.ok_or_else(|| format!("{typed:?} is none of {}", words.join(", ")))?;
            quoted(word)
        }
        Kind::Number => toml_number(number(typed)?),
        Kind::Whole => {
            let whole: i64 = typed
                .parse()
                .map_err(|_| format!("{typed:?} is no whole number"))?;
            whole.to_string()
        }
        Kind::Numbers => list(&numbers(typed)?),
        Kind::Matrix => {
            let all = numbers(typed)?;
            if all.len() != 9 {
                return Err(format!("{typed:?} is not three rows of three numbers"));
            }
            let rows: Vec<String> = all.chunks(3).map(list).collect();
            format!("[{}]", rows.join(", "))
        }
        Kind::Immersion => {
            if typed.eq_ignore_ascii_case("slot") {
                return Ok(vec![("immersion", quoted("slot"))]);
            }
            return match numbers(typed)?.as_slice() {
                [start, exit] => Ok(vec![
                    ("start_deg", toml_number(*start)),
                    ("exit_deg", toml_number(*exit)),
                ]),
                _ => Err(format!("{typed:?} is neither slot nor two angles")),
            };
        }
    };
    Ok(vec![(key, value)])
}

/// TOML as a person would type it; the reverse of [`parse`].
fn typed(toml: &str) -> String {
    fn plain(value: &toml::Value) -> String {
        match value {
            toml::Value::String(text) => text.clone(),
            toml::Value::Float(number) => number.to_string(),
            toml::Value::Array(rows) if rows.iter().any(toml::Value::is_array) => {
                rows.iter().map(plain).collect::<Vec<_>>().join("; ")
            }
            toml::Value::Array(numbers) => numbers.iter().map(plain).collect::<Vec<_>>().join(", "),
            other => other.to_string(),
        }
    }
    let table: Option<toml::Table> = format!("v = {toml}").parse().ok();
    table
        .as_ref()
        .and_then(|t| t.get("v"))
        .map_or_else(|| toml.to_string(), plain)
}

/// A comma is taken for a decimal point.
fn number(typed: &str) -> Result<f64, String> {
    typed
        .replace(',', ".")
        .parse()
        .ok()
        .filter(|n: &f64| n.is_finite())
        .ok_or_else(|| format!("{typed:?} is no number"))
}

/// Numbers between blanks, commas, semicolons or brackets.
fn numbers(typed: &str) -> Result<Vec<f64>, String> {
    let parts = typed
        .split(|c: char| c.is_whitespace() || ",;[]()".contains(c))
        .filter(|p| !p.is_empty());
    let all: Vec<f64> = parts.map(number).collect::<Result<_, _>>()?;
    match all.is_empty() {
        true => Err(format!("{typed:?} holds no number")),
        false => Ok(all),
    }
}

fn list(numbers: &[f64]) -> String {
    let all: Vec<String> = numbers.iter().map(|n| toml_number(*n)).collect();
    format!("[{}]", all.join(", "))
}

fn toml_number(number: f64) -> String {
    format!("{number:?}")
}

/// A section of the file to be.
#[derive(Debug, Clone)]
pub struct DraftTable {
    /// `cut`, `posture`, …
    pub kind: &'static str,
    /// Which of them; empty where there is one.
    pub name: String,
    /// Stands in double brackets.
    pub repeated: bool,
    /// One for each key, in the order of the file.
    pub entries: Vec<Entry>,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(kind: Kind, typed: &str) -> String {
        let mut entry = Entry::new("k", kind, "what", "1");
        match entry.give(typed) {
            Ok(()) => entry.lines(),
            Err(problem) => problem,
        }
    }

    #[test]
    fn what_is_typed_becomes_toml() {
        assert_eq!(line(Kind::Number, "0,05"), "k = 0.05\n");
        assert_eq!(line(Kind::Whole, "6"), "k = 6\n");
        assert_eq!(line(Kind::Numbers, "1, 2 ;3"), "k = [1.0, 2.0, 3.0]\n");
        assert_eq!(line(Kind::Text, "a \"b\""), "k = 'a \"b\"'\n");
        assert_eq!(line(Kind::Choice(&["milling"]), "Milling"), "k = \"milling\"\n");
        assert_eq!(line(Kind::Immersion, "slot"), "immersion = \"slot\"\n");
        assert_eq!(
            line(Kind::Matrix, "0,-1,0;-1,0,0;0,0,1"),
            "k = [[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]\n"
        );
    }

    #[test]
    fn what_was_typed_can_be_shown_and_typed_again() {
        for (kind, text, shown) in [
            (Kind::Number, "0,05", "0.05"),
            (Kind::Number, "1200.0", "1200"),
            (Kind::Whole, "6", "6"),
            (Kind::Numbers, "1, -2.5 ;3", "1, -2.5, 3"),
            (Kind::Text, "a \"b\" 'c'", "a \"b\" 'c'"),
            (Kind::Immersion, "slot", "slot"),
            (Kind::Immersion, "0 90", "0, 90"),
            (Kind::Matrix, "0,-1,0;-1,0,0;0,0,1", "0, -1, 0; -1, 0, 0; 0, 0, 1"),
        ] {
            let mut entry = Entry::new("k", kind, "what", "1");
            entry.give(text).unwrap();
            assert_eq!(entry.typed().as_deref(), Some(shown));
            let lines = entry.lines();
            entry.give(shown).unwrap();
            assert_eq!(entry.lines(), lines);
        }
        assert_eq!(Entry::new("k", Kind::Text, "what", "1").typed(), None);
        assert_eq!(Entry::new("k", Kind::Text, "what", "1").unmentioned().lines(), "");
    }

    #[test]
    fn what_is_no_value_is_said() {
        for (kind, typed) in [
            (Kind::Number, "fast"),
            (Kind::Number, "nan"),
            (Kind::Whole, "2.5"),
            (Kind::Numbers, " "),
            (Kind::Choice(&["milling"]), "turning"),
            (Kind::Immersion, "90"),
            (Kind::Matrix, "1 2 3"),
        ] {
            assert!(!line(kind, typed.trim()).contains(" = "), "{typed}");
        }
        let mut entry = Entry::new("k", Kind::Number, "what", "1.0");
        entry.guess("x", "why");
        assert!(entry.is_missing());
        assert_eq!(entry.lines(), "# fill in: k = …  # what, such as 1.0\n");
    }
}
