//! Reading TOML so that every complaint can name file, dotted key, line and remedy.
//!
//! A [`Document`] is the text of one file, a [`Section`] one of its tables that knows where it stands.
//! Tables of an array are counted from 0 in key names: `cut[0]` is the first `[[cut]]`.

use std::path::{Path, PathBuf};

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::bounds::Bounds;
use super::suggest::{closest, shown};
use crate::{Error, InputError, Result};

/// The text of a TOML file.
#[derive(Debug)]
pub struct Document {
    file: PathBuf,
    text: String,
}

impl Document {
    /// Reads a file. A UTF-8 byte order mark is accepted, another encoding is refused with the line.
    pub fn read(file: &Path) -> Result<Document> {
        let bytes = std::fs::read(file).map_err(|e| Error::io(file, e))?;
        Document::from_bytes(file, bytes)
    }

    pub fn from_bytes(file: &Path, bytes: Vec<u8>) -> Result<Document> {
        let text = String::from_utf8(bytes).map_err(|e| {
            let valid = e.utf8_error().valid_up_to();
            let line = 1 + e.as_bytes()[..valid].iter().filter(|b| **b == b'\n').count();
            InputError::new("the text is not UTF-8")
                .file(file)
                .line(line)
                .remedy("save the file as UTF-8 (in most editors: Save as, encoding UTF-8)")
        })?;
        Ok(Document::from_text(file, &text))
    }

    pub fn from_text(file: &Path, text: &str) -> Document {
        Document {
            file: file.to_path_buf(),
            text: text.strip_prefix('\u{feff}').unwrap_or(text).to_string(),
        }
    }

    /// Parses the text and hands its top table, whose keys must be among `keys`, to `read`.
    pub fn parse<T>(&self, keys: &[&str], read: impl FnOnce(&Section<'_>) -> Result<T>) -> Result<T> {
        let table = DeTable::parse(&self.text).map_err(|e| self.syntax_error(&e))?;
        let top = Section {
            document: self,
            table: table.get_ref(),
            path: String::new(),
            start: 0,
        };
        top.only(keys)?;
        read(&top)
    }

    fn line_of(&self, offset: usize) -> usize {
        1 + self.text.bytes().take(offset).filter(|b| *b == b'\n').count()
    }

    fn syntax_error(&self, error: &toml::de::Error) -> InputError {
        let offset = error.span().map_or(self.text.len(), |s| s.start);
        let what = error.message().trim();
        let remedy = match what {
            "duplicate key" => "a key may stand once in a table: keep one of the two",
            _ => {
                "mend the TOML there: key = value, text in double quotes, a point as decimal sign, [section] or [[section]] alone on a line"
            }
        };
        let problem = match what {
            "duplicate key" => what.to_string(),
            _ => format!("not valid TOML: {what}"),
        };
        let out = InputError::new(problem)
            .file(&self.file)
            .line(self.line_of(offset))
            .remedy(remedy);
        match self.guess_key(offset) {
            Some(key) => out.key(key),
            None => out,
        }
    }

    /// Dotted key at an offset of a text that does not parse, from the section headers above it.
    fn guess_key(&self, offset: usize) -> Option<String> {
        let line = self.line_of(offset);
        let mut section = String::new();
        let mut count = std::collections::BTreeMap::new();
        let mut key = None;
        for text in self.text.lines().take(line) {
            let text = text.trim();
            key = None;
            if let Some(name) = text.strip_prefix("[[") {
                let name = name.split(']').next().unwrap_or(name).trim();
                let n = count.entry(name).or_insert(0usize);
                section = format!("{name}[{n}]");
                *n += 1;
            } else if let Some(name) = text.strip_prefix('[') {
                section = name.split(']').next().unwrap_or(name).trim().to_string();
            } else {
                key = text.split_once('=').map(|(k, _)| k.trim());
            }
        }
        let plain = |s: &str| {
            !s.is_empty()
                && s.len() <= 80
                && s.chars()
                    .all(|c| c.is_ascii_alphanumeric() || "_-.[]".contains(c))
        };
        let path = match (section.is_empty(), key) {
            (true, None) => return None,
            (true, Some(key)) => key.to_string(),
            (false, None) => section,
            (false, Some(key)) => format!("{section}.{key}"),
        };
        plain(&path).then_some(path)
    }
}

/// One table of a document.
pub struct Section<'d> {
    document: &'d Document,
    table: &'d DeTable<'d>,
    /// Dotted, `cut[3]`; empty for the top table.
    path: String,
    /// Byte offset of the header.
    start: usize,
}

impl<'d> Section<'d> {
    /// Line of the header, 1-based.
    pub fn line(&self) -> usize {
        self.document.line_of(self.start)
    }

    pub fn has(&self, key: &str) -> bool {
        self.table.contains_key(key)
    }

    fn dotted(&self, key: &str) -> String {
        match (self.path.is_empty(), key.is_empty()) {
            (true, _) => key.to_string(),
            (false, true) => self.path.clone(),
            (false, false) => format!("{}.{key}", self.path),
        }
    }

    /// How the section is written: `[tool]`, `[[cut]]`.
    fn header(&self) -> String {
        match self.path.rsplit_once('[') {
            Some((name, _)) => format!("this [[{name}]]"),
            None if self.path.is_empty() => "the top of the file".to_string(),
            None => format!("[{}]", self.path),
        }
    }

    /// An error about `key` of this section (about the section itself where `key` is empty), with its line.
    pub fn error(&self, key: &str, problem: impl Into<String>) -> InputError {
        let offset = self
            .table
            .get_key_value(key)
            .map_or(self.start, |(k, _)| k.span().start);
        InputError::new(problem)
            .file(&self.document.file)
            .line(self.document.line_of(offset))
            .key(self.dotted(key))
    }

    /// Refuses keys that are not among `keys`.
    fn only(&self, keys: &[&str]) -> Result<()> {
        // The first in the file, not in the alphabet: that is the one the reader meets first.
        let unknown = self
            .table
            .iter()
            .map(|(key, _)| key)
            .filter(|key| !keys.contains(&key.get_ref().as_ref()))
            .min_by_key(|key| key.span().start);
        let Some(key) = unknown else { return Ok(()) };
        let remedy = match closest(key.get_ref(), keys.iter().copied()) {
            Some(near) => format!("did you mean {near}?"),
            None => format!("take it out; {} knows {}", self.header(), keys.join(", ")),
        };
        let mut error = self.error("", "unknown key").remedy(remedy);
        error.line = Some(self.document.line_of(key.span().start));
        error.key = Some(self.dotted(&shown(key.get_ref())));
        Err(error.into())
    }

    fn value(&self, key: &str) -> Option<&'d Spanned<DeValue<'d>>> {
        self.table.get(key)
    }

    fn wrong_type(&self, key: &str, wanted: &str, found: &DeValue<'_>, example: &str) -> Error {
        self.error(key, format!("must be {wanted}, not {}", type_name(found)))
            .remedy(format!("write it as {example}"))
            .into()
    }

    /// `value`, or an error that says what is missing. `example` is the value's form in the remedy.
    pub fn required<T>(&self, key: &str, value: Option<T>, example: &str) -> Result<T> {
        value.ok_or_else(|| {
            self.error(key, "missing")
                .remedy(format!("add {key} = {example} to {}", self.header()))
                .into()
        })
    }

    /// Text that is not blank.
    pub fn text(&self, key: &str) -> Result<Option<&'d str>> {
        let Some(value) = self.value(key) else {
            return Ok(None);
        };
        match value.get_ref() {
            DeValue::String(s) if s.trim().is_empty() => Err(self
                .error(key, "is empty")
                .remedy("write something between the quotes")
                .into()),
            DeValue::String(s) => Ok(Some(s.as_ref())),
            other => Err(self.wrong_type(key, "text in quotes", other, &format!("{key} = \"…\""))),
        }
    }

    /// One of a few words.
    pub fn choice<T: Copy>(&self, key: &str, words: &[(&str, T)]) -> Result<Option<T>> {
        let Some(word) = self.text(key)? else {
            return Ok(None);
        };
        if let Some((_, choice)) = words.iter().find(|(w, _)| *w == word) {
            return Ok(Some(*choice));
        }
        let all = words
            .iter()
            .map(|(w, _)| format!("{w:?}"))
            .collect::<Vec<_>>()
            .join(", ");
        let mut remedy = format!("one of {all}");
        if let Some(near) = closest(word, words.iter().map(|(w, _)| *w)) {
            remedy = format!("did you mean {near:?}? Known: {all}");
        }
        Err(self
            .error(key, format!("{:?} is not known here", shown(word)))
            .remedy(remedy)
            .into())
    }

    /// A finite number within bounds.
    pub fn number(&self, key: &str, bounds: Bounds) -> Result<Option<f64>> {
        self.value(key)
            .map(|value| self.finite(key, key, value.get_ref(), bounds))
            .transpose()
    }

    /// A whole number from `low` to `high`.
    pub fn whole(&self, key: &str, low: i64, high: i64) -> Result<Option<i64>> {
        let Some(value) = self.value(key) else {
            return Ok(None);
        };
        let DeValue::Integer(integer) = value.get_ref() else {
            return Err(self.wrong_type(
                key,
                "a whole number",
                value.get_ref(),
                &format!("{key} = {}", low.max(1)),
            ));
        };
        let number = i64::from_str_radix(integer.as_str(), integer.radix()).ok();
        match number.filter(|n| (low..=high).contains(n)) {
            Some(number) => Ok(Some(number)),
            None => Err(self
                .error(key, format!("is {}, out of range", shown(integer.as_str())))
                .remedy(match high {
                    i64::MAX => format!("a whole number of at least {low}"),
                    _ => format!("a whole number from {low} to {high}"),
                })
                .into()),
        }
    }

    /// A list of finite numbers of any length.
    pub fn numbers(&self, key: &str) -> Result<Option<Vec<f64>>> {
        self.value(key)
            .map(|value| self.list(key, key, value.get_ref(), "[1.0, 2.0]"))
            .transpose()
    }

    /// Exactly `N` finite numbers.
    pub fn array<const N: usize>(&self, key: &str, example: &str) -> Result<Option<[f64; N]>> {
        self.value(key)
            .map(|value| self.fixed(key, key, value.get_ref(), example))
            .transpose()
    }

    /// A list of rows of exactly `N` finite numbers each.
    pub fn rows<const N: usize>(&self, key: &str, example: &str) -> Result<Option<Vec<[f64; N]>>> {
        let Some(value) = self.value(key) else {
            return Ok(None);
        };
        let DeValue::Array(rows) = value.get_ref() else {
            return Err(self.wrong_type(
                key,
                "a list of lists",
                value.get_ref(),
                &format!("{key} = {example}"),
            ));
        };
        rows.iter()
            .enumerate()
            .map(|(i, row)| self.fixed(key, &format!("{key}[{i}]"), row.get_ref(), example))
            .collect::<Result<_>>()
            .map(Some)
    }

    fn fixed<const N: usize>(
        &self,
        key: &str,
        name: &str,
        value: &DeValue<'_>,
        example: &str,
    ) -> Result<[f64; N]> {
        let list = self.list(key, name, value, example)?;
        let found = list.len();
        list.try_into().map_err(|_| {
            let mut error = self
                .error(key, format!("has {found} numbers, must have {N}"))
                .remedy(format!("write it as {key} = {example}"));
            error.key = Some(self.dotted(name));
            error.into()
        })
    }

    fn list(&self, key: &str, name: &str, value: &DeValue<'_>, example: &str) -> Result<Vec<f64>> {
        let DeValue::Array(items) = value else {
            return Err(self.wrong_type(key, "a list of numbers", value, &format!("{key} = {example}")));
        };
        items
            .iter()
            .enumerate()
            .map(|(i, item)| self.finite(key, &format!("{name}[{i}]"), item.get_ref(), Bounds::ANY))
            .collect()
    }

    /// The number in `value`; `name` is its key as an error shows it, `key` the one that has a line.
    fn finite(&self, key: &str, name: &str, value: &DeValue<'_>, bounds: Bounds) -> Result<f64> {
        let named = |mut error: InputError| {
            error.key = Some(self.dotted(name));
            Error::from(error)
        };
        let (text, number) = match value {
            DeValue::Float(float) => (float.as_str(), float.as_str().parse().ok()),
            DeValue::Integer(integer) => (
                integer.as_str(),
                i64::from_str_radix(integer.as_str(), integer.radix())
                    .ok()
                    .map(|i| i as f64),
            ),
            DeValue::String(s) if s.trim().parse::<f64>().is_ok() => {
                return Err(named(
                    self.error(key, "must be a number, not text in quotes")
                        .remedy("take the quotes off"),
                ));
            }
            other => {
                return Err(named(
                    self.error(key, format!("must be a number, not {}", type_name(other)))
                        .remedy("write a plain number such as 12.5"),
                ));
            }
        };
        match number.filter(|n: &f64| n.is_finite()) {
            None => Err(named(
                self.error(key, format!("is {}, not a finite number", shown(text)))
                    .remedy("write the measured value; a value that is not known is left out, not written as nan or inf"),
            )),
            Some(number) if !bounds.contain(number) => Err(named(
                self.error(key, format!("is {}, out of range", shown(text)))
                    .remedy(format!("{bounds}")),
            )),
            Some(number) => Ok(number),
        }
    }

    /// The table `[key]`, with `keys` the keys it may have.
    pub fn section(&self, key: &str, keys: &[&str]) -> Result<Option<Section<'d>>> {
        let Some(value) = self.value(key) else {
            return Ok(None);
        };
        let DeValue::Table(table) = value.get_ref() else {
            let header = self.dotted(key);
            return Err(match value.get_ref() {
                DeValue::Array(_) => self
                    .error(key, "may stand only once")
                    .remedy(format!("write [{header}] with single brackets")),
                other => self
                    .error(key, format!("must be a section, not {}", type_name(other)))
                    .remedy(format!(
                        "write [{header}] on a line of its own and its keys below"
                    )),
            }
            .into());
        };
        let section = self.below(table, self.dotted(key), value);
        section.only(keys)?;
        Ok(Some(section))
    }

    /// The tables `[[key]]`, with `keys` the keys each may have.
    pub fn sections(&self, key: &str, keys: &[&str]) -> Result<Vec<Section<'d>>> {
        let Some(value) = self.value(key) else {
            return Ok(Vec::new());
        };
        let remedy = format!(
            "write [[{}]] with double brackets, once for each",
            self.dotted(key)
        );
        let DeValue::Array(items) = value.get_ref() else {
            let what = type_name(value.get_ref());
            return Err(self
                .error(key, format!("must be a list of sections, not {what}"))
                .remedy(remedy)
                .into());
        };
        let mut out = Vec::with_capacity(items.len());
        for (i, item) in items.iter().enumerate() {
            let DeValue::Table(table) = item.get_ref() else {
                let what = type_name(item.get_ref());
                return Err(self
                    .error(key, format!("must be a list of sections, but holds {what}"))
                    .remedy(remedy)
                    .into());
            };
            let section = self.below(table, format!("{}[{i}]", self.dotted(key)), item);
            section.only(keys)?;
            out.push(section);
        }
        Ok(out)
    }

    fn below(&self, table: &'d DeTable<'d>, path: String, value: &Spanned<DeValue<'_>>) -> Section<'d> {
        Section {
            document: self.document,
            table,
            path,
            start: value.span().start,
        }
    }
}

fn type_name(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::String(_) => "text",
        DeValue::Integer(_) => "a whole number",
        DeValue::Float(_) => "a number with a fraction",
        DeValue::Boolean(_) => "true or false",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "a list",
        DeValue::Table(_) => "a section",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problem<T>(text: &str, keys: &[&str], read: impl FnOnce(&Section<'_>) -> Result<T>) -> InputError {
        match Document::from_text(Path::new("a.toml"), text).parse(keys, read) {
            Err(Error::Input(error)) => *error,
            Err(other) => panic!("{other}"),
            Ok(_) => panic!("accepted"),
        }
    }

    #[test]
    fn array_tables_and_nested_tables_know_their_key_and_line() {
        let text = "a = 1\n\n[[cut]]\nid = 'x'\n[[cut]]\n# why\nid = 'y'\n  [cut.extra]\n  depth = -1\n";
        Document::from_text(Path::new("a.toml"), text)
            .parse(&["a", "cut"], |top| {
                let cuts = top.sections("cut", &["id", "extra"])?;
                assert_eq!(cuts.iter().map(Section::line).collect::<Vec<_>>(), [3, 5]);
                let extra = cuts[1].section("extra", &["depth"])?.unwrap();
                let error = extra.number("depth", Bounds::POSITIVE).unwrap_err().to_string();
                assert!(
                    error.starts_with("a.toml:9: cut[1].extra.depth: is -1, out of range"),
                    "{error}"
                );
                Ok(())
            })
            .unwrap();
    }

    #[test]
    fn the_first_unknown_key_in_the_file_is_named_with_a_suggestion() {
        let error = problem("[t]\nzzz = 1\nfeeed = 2\n", &["t"], |top| {
            top.section("t", &["feed"]).map(drop)
        });
        assert_eq!((error.key.as_deref(), error.line), (Some("t.zzz"), Some(2)));
        let error = problem("[t]\nfeeed = 2\n", &["t"], |top| {
            top.section("t", &["feed"]).map(drop)
        });
        assert_eq!(error.remedy.as_deref(), Some("did you mean feed?"));
    }

    #[test]
    fn duplicate_keys_and_broken_syntax_name_key_and_line() {
        let error = problem("[[cut]]\n[[cut]]\nid = 'x'\nid = 'y'\n", &["cut"], |_| Ok(()));
        assert_eq!((error.key.as_deref(), error.line), (Some("cut[1].id"), Some(4)));
        let error = problem("[tool]\r\nteeth = = 3\r\n", &["tool"], |_| Ok(()));
        assert_eq!((error.key.as_deref(), error.line), (Some("tool.teeth"), Some(2)));
    }

    #[test]
    fn numbers_that_are_none_are_refused() {
        for text in [
            "x = nan",
            "x = -inf",
            "x = 1e999",
            "x = 99999999999999999999",
            "x = '3'",
            "x = true",
        ] {
            problem(text, &["x"], |top| top.number("x", Bounds::ANY));
        }
        let read = |text: &str| {
            Document::from_text(Path::new("a"), text)
                .parse(&["x"], |top| top.number("x", Bounds::ANY))
                .unwrap()
        };
        assert_eq!(read("x = 1_000"), Some(1000.0));
        assert_eq!(read("\u{feff}x = 1_0.5e1\r\n"), Some(105.0));
        assert_eq!(read("x = 0x1f"), Some(31.0));
    }

    #[test]
    fn rows_have_one_length() {
        let error = problem("m = [[1, 2],\n [3]]", &["m"], |top| {
            top.rows::<2>("m", "[[1, 2]]")
        });
        assert_eq!((error.key.as_deref(), error.line), (Some("m[1]"), Some(1)));
    }

    #[test]
    fn text_that_is_not_utf8_is_refused_with_its_line() {
        let error = Document::from_bytes(Path::new("a"), b"x = 1\ny = '\xe9'\n".to_vec()).unwrap_err();
        assert!(
            error.to_string().starts_with("a:2: the text is not UTF-8"),
            "{error}"
        );
    }
}
