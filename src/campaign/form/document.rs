//! Reading TOML so that every complaint can name file, dotted key, line and remedy.
//!
//! A [`Document`] is the text of one file, a [`Section`](crate::campaign::form::section::Section) one of its tables that knows where it stands.
//! Tables of an array are counted from 0 in key names: `cut[0]` is the first `[[cut]]`.

use std::path::{Path, PathBuf};

use crate::{Error, InputError, Result};

/// The text of a TOML file.
#[derive(Debug)]
pub struct Document {
    file: PathBuf,
    text: String,
    /// Byte offsets of the line breaks, ascending.
    breaks: Vec<usize>,
}

impl Document {
    /// Reads a file. A UTF-8 byte order mark is accepted, another encoding is refused with the line.
    pub fn read(file: &Path) -> Result<Document> {
        crate::files::regular_file(file)?;
        let bytes = std::fs::read(file).map_err(|e| Error::io(file, e))?;
        Document::from_bytes(file, bytes)
    }

    pub(crate) fn from_bytes(file: &Path, bytes: Vec<u8>) -> Result<Document> {
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

    pub(crate) fn from_text(file: &Path, text: &str) -> Document {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text).to_string();
        Document {
            file: file.to_path_buf(),
            breaks: text.match_indices('\n').map(|(at, _)| at).collect(),
            text,
        }
    }

    pub(crate) fn text(&self) -> &str {
        &self.text
    }

    pub(crate) fn file(&self) -> &Path {
        &self.file
    }

    /// 1-based line of a byte offset.
    pub(crate) fn line_of(&self, offset: usize) -> usize {
        1 + self.breaks.partition_point(|at| *at < offset)
    }

    pub(crate) fn syntax_error(&self, error: &toml::de::Error) -> InputError {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::form::bounds::Bounds;
    use crate::campaign::form::section::Section;

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
