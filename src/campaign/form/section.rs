//! One table of a TOML file, read key by key; see [`Document`](crate::campaign::form::document::Document).

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::campaign::form::bounds::Bounds;
use crate::campaign::form::document::Document;
use crate::text::{closest, shown_briefly as shown};
use crate::{Error, InputError, Result};

/// Numbers beyond these, in whatever unit a key has, are slips of the keyboard or a damaged file; they would only overflow
/// further on.
const LARGEST: f64 = 1e15;
const SMALLEST: f64 = 1e-30;

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
    pub(crate) fn top(document: &'d Document, table: &'d DeTable<'d>, keys: &[&str]) -> Result<Section<'d>> {
        let top = Section {
            document,
            table,
            path: String::new(),
            start: 0,
        };
        top.only(keys)?;
        Ok(top)
    }

    /// Line of the header, 1-based.
    pub fn line(&self) -> usize {
        self.document.line_of(self.start)
    }

    /// Does the table have this key, whatever its value?
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
            .file(self.document.file())
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
            DeValue::String(s) if matches!(crate::ingest::shown(s), std::borrow::Cow::Owned(_)) => Err(self
                .error(key, format!("holds control characters: {:?}", shown(s)))
                .remedy("write letters, digits and signs that can be seen")
                .into()),
            DeValue::String(s) => Ok(Some(s.as_ref())),
            other => Err(self.wrong_type(key, "text in quotes", other, &format!("{key} = \"…\""))),
        }
    }

    /// A list of texts, none of them blank.
    pub fn texts(&self, key: &str) -> Result<Option<Vec<String>>> {
        let Some(value) = self.value(key) else {
            return Ok(None);
        };
        let example = format!("{key} = [\"…\"]");
        let DeValue::Array(items) = value.get_ref() else {
            return Err(self.wrong_type(key, "a list of texts", value.get_ref(), &example));
        };
        let text = |item: &Spanned<DeValue<'_>>| match item.get_ref() {
            DeValue::String(s) if !s.trim().is_empty() => Ok(crate::ingest::shown(s).into_owned()),
            other => Err(self.wrong_type(key, "a list of texts", other, &example)),
        };
        items.iter().map(text).collect::<Result<_>>().map(Some)
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
        let mut remedy = format!("it must be {}{all}", if words.len() > 1 { "one of " } else { "" });
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
        if let DeValue::Float(float) = value.get_ref() {
            return Err(self
                .error(
                    key,
                    format!("is {}, but must be a whole number", shown(float.as_str())),
                )
                .remedy("write it without point and exponent")
                .into());
        }
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
            let mut error = self
                .error(
                    key,
                    format!("must be a list of numbers, not {}", type_name(value)),
                )
                .remedy(format!("write it as {key} = {example}"));
            error.key = Some(self.dotted(name));
            return Err(error.into());
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
            Some(number) if number.abs() > LARGEST || number != 0.0 && number.abs() < SMALLEST => Err(named(
                self.error(key, format!("is {}, which no physical quantity is", shown(text)))
                    .remedy("write the measured value, in the unit that the key's name ends with"),
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

impl Document {
    /// Parses the text and hands its top table, whose keys must be among `keys`, to `read`.
    pub fn parse<T>(&self, keys: &[&str], read: impl FnOnce(&Section<'_>) -> Result<T>) -> Result<T> {
        let table = DeTable::parse(self.text()).map_err(|e| self.syntax_error(&e))?;
        let top = Section::top(self, table.get_ref(), keys)?;
        read(&top)
    }
}
