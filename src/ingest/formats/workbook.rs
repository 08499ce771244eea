//! XLSX: the first sheet of a workbook as tab separated text, which the readers of text then read.
//!
//! Source: ECMA-376, Office Open XML File Formats, part 1 (SpreadsheetML), sections 18.3 and 18.4.

use memchr::memmem;

use crate::InputError;
use crate::ingest::budget::Budget;
use crate::ingest::formats::packed::{self, Member};

/// Columns of a sheet that are looked at.
const MOST_COLUMNS: usize = 256;

/// The first sheet as text, and what else the workbook holds; `None` for an archive that is no workbook.
///
/// # Errors
/// A damaged workbook, or one without a sheet.
pub(crate) fn first_sheet(bytes: &[u8]) -> Result<Option<(String, Option<String>)>, InputError> {
    if !packed::looks_like(bytes) {
        return Ok(None);
    }
    let members = packed::members(bytes)?;
    let number = |m: &Member| -> Option<usize> {
        let name = m.name.strip_prefix("xl/worksheets/sheet")?.strip_suffix(".xml")?;
        name.parse().ok()
    };
    let sheets = members.iter().filter(|m| number(m).is_some());
    let count = sheets.clone().count();
    let Some(sheet) = sheets.min_by_key(|m| number(m)) else {
        return Ok(None);
    };
    let mut budget = Budget::for_file(bytes.len());
    let strings = match members.iter().find(|m| m.name == "xl/sharedStrings.xml") {
        Some(member) => shared_strings(&member.bytes(&mut budget)?),
        None => Vec::new(),
    };
    let sheet = sheet.bytes(&mut budget)?;
    budget.take(sheet.len(), "the sheet's text")?;
    let told = (count > 1).then(|| format!("the first of {count} sheets is read"));
    Ok(Some((text_of(&sheet, &strings), told)))
}

/// Text between `open` and `close`, and where it ends.
fn between<'a>(bytes: &'a [u8], from: usize, open: &[u8], close: &[u8]) -> Option<(&'a [u8], usize)> {
    let start = from + memmem::find(bytes.get(from..)?, open)? + open.len();
    let length = memmem::find(&bytes[start..], close)?;
    Some((&bytes[start..start + length], start + length + close.len()))
}

/// All `<t>` of an element, in one.
fn texts(element: &[u8]) -> String {
    let (mut out, mut at) = (String::new(), 0);
    while let Some(found) = memmem::find(&element[at..], b"<t") {
        let start = at + found + 2;
        // `<t>` or `<t xml:space="preserve">`, not `<tableParts>`.
        if !matches!(element.get(start), Some(b'>' | b' ')) {
            at = start;
            continue;
        }
        let Some((text, end)) = between(element, start, b">", b"</t>") else {
            break;
        };
        out.push_str(&unescaped(text));
        at = end;
    }
    out
}

fn unescaped(text: &[u8]) -> String {
    let text = String::from_utf8_lossy(text);
    let plain = if text.contains('&') {
        let named = text
            .replace("&lt;", "<")
            .replace("&gt;", ">")
            .replace("&quot;", "\"")
            .replace("&apos;", "'");
        named.replace("&#10;", " ").replace("&amp;", "&")
    } else {
        text.into_owned()
    };
    plain.replace(['\t', '\n', '\r'], " ")
}

fn shared_strings(xml: &[u8]) -> Vec<String> {
    let (mut strings, mut at) = (Vec::new(), 0);
    while let Some((element, end)) = between(xml, at, b"<si>", b"</si>") {
        strings.push(texts(element));
        at = end;
    }
    strings
}

/// Column of a cell's place, `AB12`: 27.
fn column_of(place: &[u8]) -> Option<usize> {
    let letters = place.iter().take_while(|b| b.is_ascii_uppercase());
    let number = letters.fold(0usize, |sum, b| {
        sum.saturating_mul(26).saturating_add(usize::from(b - b'A') + 1)
    });
    number.checked_sub(1).filter(|c| *c < MOST_COLUMNS)
}

fn attribute<'a>(tag: &'a [u8], name: &[u8]) -> Option<&'a [u8]> {
    between(tag, 0, &[b" ", name, b"=\""].concat(), b"\"").map(|(value, _)| value)
}

/// Rows as lines, cells between tabs; cells that are empty at the end of a row are left out.
fn text_of(sheet: &[u8], strings: &[String]) -> String {
    let (mut out, mut at) = (String::new(), 0);
    while let Some(found) = memmem::find(&sheet[at..], b"<row") {
        let start = at + found;
        let Some(open) = memchr::memchr(b'>', &sheet[start..]).map(|p| start + p) else {
            break;
        };
        // `<row r="3"/>` is an empty one.
        let (row, end) = if sheet[open - 1] == b'/' {
            (&[][..], open + 1)
        } else {
            match between(sheet, open, b">", b"</row>") {
                Some(found) => found,
                None => break,
            }
        };
        at = end;
        let mut written = 0;
        for (column, text) in cells(row, strings) {
            if text.is_empty() || column < written {
                continue;
            }
            (written..column).for_each(|_| out.push('\t'));
            out.push_str(&text);
            written = column;
        }
        out.push('\n');
    }
    out
}

fn cells(row: &[u8], strings: &[String]) -> Vec<(usize, String)> {
    let (mut cells, mut at) = (Vec::new(), 0);
    while let Some(found) = memmem::find(&row[at..], b"<c ") {
        let start = at + found;
        let Some(open) = memchr::memchr(b'>', &row[start..]).map(|p| start + p) else {
            break;
        };
        let tag = &row[start..open];
        if tag.ends_with(b"/") {
            at = open + 1;
            continue;
        }
        let Some((content, end)) = between(row, open, b">", b"</c>") else {
            break;
        };
        at = end;
        let Some(column) = attribute(tag, b"r").and_then(column_of) else {
            continue;
        };
        let value = || {
            between(content, 0, b"<v>", b"</v>")
                .map(|(v, _)| unescaped(v))
                .unwrap_or_default()
        };
        let text = match attribute(tag, b"t") {
            Some(b"s") => value()
                .parse::<usize>()
                .ok()
                .and_then(|i| strings.get(i).cloned())
                .unwrap_or_default(),
            Some(b"inlineStr") => texts(content),
            Some(b"e") => "NaN".into(),
            _ => value(),
        };
        cells.push((column, text));
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ingest::{Cells, ColumnTable, NamedColumn, xlsx_bytes};

    #[test]
    fn a_sheet_becomes_lines_of_cells() {
        let sheet = br#"<worksheet><sheetData><row r="1"><c r="A1" t="s"><v>1</v></c><c r="C1" t="inlineStr"><is><t xml:space="preserve">ap &amp; ae</t></is></c></row><row r="2"/><row r="3"><c r="A3"><v>0.5</v></c><c r="B3" s="1"/><c r="C3"><v>1E-4</v></c></row></sheetData></worksheet>"#;
        let strings =
            shared_strings(b"<sst><si><t>a</t></si><si><r><t>Ti</t></r><r><t>me</t></r></si></sst>");
        assert_eq!(text_of(sheet, &strings), "Time\t\tap & ae\n\n0.5\t\t1E-4\n");
        assert_eq!(column_of(b"AB12"), Some(27));
    }

    #[test]
    fn a_workbook_of_our_own_comes_back_and_damage_is_an_error() {
        let column = |name: &str, values: Vec<f64>| NamedColumn {
            quantity: name.into(),
            unit: "",
            cells: Cells::Number(values),
        };
        let columns = vec![column("time_s", vec![0.0, 0.5]), column("fx_n", vec![1.0, -2.5])];
        let table = ColumnTable::new("record", columns);
        let bytes = xlsx_bytes(&table).unwrap();
        let (text, told) = first_sheet(&bytes).unwrap().unwrap();
        assert_eq!((text.as_str(), told), ("time_s\tfx_n\n0\t1\n0.5\t-2.5\n", None));
        for cut in 0..bytes.len() {
            let _ = first_sheet(&bytes[..cut]);
        }
        assert!(first_sheet(b"time,fx\n").unwrap().is_none());
    }
}
