//! XLSX: a workbook of one sheet, names in its first row.
//!
//! Source: ECMA-376, Office Open XML File Formats, part 1 (SpreadsheetML), sections 18.2 and 18.3; part 2 (packages). The
//! crates that write it (rust_xlsxwriter) bring a dozen others with them; a sheet of plain cells is a page of code.

use std::fmt::Write as _;

use super::archive::zip_bytes;
use super::column::{Cells, ColumnTable, number_text};
use crate::text::xml_escaped;
use crate::{Error, Result};

/// Rows that a sheet of Excel holds, names included.
pub const MOST_ROWS: usize = 1_048_576;

const DECLARATION: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\" standalone=\"yes\"?>\n";
const MAIN: &str = "http://schemas.openxmlformats.org/spreadsheetml/2006/main";
const RELATIONS: &str = "http://schemas.openxmlformats.org/officeDocument/2006/relationships";
const PACKAGE: &str = "http://schemas.openxmlformats.org/package/2006";

/// The bytes of a workbook with this table on its one sheet.
///
/// # Errors
/// More rows than a sheet holds.
pub fn xlsx_bytes(table: &ColumnTable) -> Result<Vec<u8>> {
    if table.rows() >= MOST_ROWS {
        return Err(Error::computation(format!(
            "{}: {} rows, and a sheet of Excel holds {MOST_ROWS}: choose csv, npz, mat or parquet",
            table.name,
            table.rows()
        )));
    }
    let types = format!(
        "{DECLARATION}<Types xmlns=\"{PACKAGE}/content-types\"><Default Extension=\"rels\" \
         ContentType=\"application/vnd.openxmlformats-package.relationships+xml\"/><Default Extension=\"xml\" \
         ContentType=\"application/xml\"/><Override PartName=\"/xl/workbook.xml\" \
         ContentType=\"application/vnd.openxmlformats-officedocument.spreadsheetml.sheet.main+xml\"/><Override \
         PartName=\"/xl/worksheets/sheet1.xml\" \
         ContentType=\"application/vnd.openxmlformats-officedocument.spreadsheetml.worksheet+xml\"/></Types>"
    );
    let relation = |kind: &str, target: &str| {
        format!(
            "{DECLARATION}<Relationships xmlns=\"{PACKAGE}/relationships\"><Relationship Id=\"rId1\" \
             Type=\"{RELATIONS}/{kind}\" Target=\"{target}\"/></Relationships>"
        )
    };
    // Excel takes 31 characters, without brackets, slashes and the like.
    let title: String = table
        .name
        .chars()
        .filter(|c| c.is_alphanumeric() || *c == '-')
        .take(31)
        .collect();
    let workbook = format!(
        "{DECLARATION}<workbook xmlns=\"{MAIN}\" xmlns:r=\"{RELATIONS}\"><sheets><sheet name=\"{}\" sheetId=\"1\" \
         r:id=\"rId1\"/></sheets></workbook>",
        xml_escaped(&title)
    );
    zip_bytes(&[
        ("[Content_Types].xml".into(), types.into_bytes()),
        (
            "_rels/.rels".into(),
            relation("officeDocument", "xl/workbook.xml").into_bytes(),
        ),
        ("xl/workbook.xml".into(), workbook.into_bytes()),
        (
            "xl/_rels/workbook.xml.rels".into(),
            relation("worksheet", "worksheets/sheet1.xml").into_bytes(),
        ),
        ("xl/worksheets/sheet1.xml".into(), sheet(table).into_bytes()),
    ])
}

fn sheet(table: &ColumnTable) -> String {
    let columns = table.plain_columns();
    let mut out = format!("{DECLARATION}<worksheet xmlns=\"{MAIN}\"><sheetData>");
    let letters: Vec<String> = (0..columns.len()).map(letters).collect();
    // Writing to a String cannot fail.
    let text = |out: &mut String, at: &str, row: usize, text: &str| {
        let _ = write!(
            out,
            "<c r=\"{at}{row}\" t=\"inlineStr\"><is><t xml:space=\"preserve\">{}</t></is></c>",
            xml_escaped(text)
        );
    };
    out += "<row r=\"1\">";
    for ((name, _), at) in columns.iter().zip(&letters) {
        text(&mut out, at, 1, name);
    }
    out += "</row>";
    for k in 0..table.rows() {
        let row = k + 2;
        let _ = write!(out, "<row r=\"{row}\">");
        for ((_, cells), at) in columns.iter().zip(&letters) {
            match cells {
                Cells::Text(values) if !values[k].is_empty() => text(&mut out, at, row, &values[k]),
                Cells::Number(values) if values[k].is_finite() => {
                    let _ = write!(out, "<c r=\"{at}{row}\"><v>{}</v></c>", number_text(values[k]));
                }
                _ => {}
            }
        }
        out += "</row>";
    }
    out + "</sheetData></worksheet>"
}

/// A, B, …, Z, AA, …
fn letters(column: usize) -> String {
    let (mut rest, mut letters) = (column + 1, Vec::new());
    while rest > 0 {
        letters.push(char::from(b'A' + ((rest - 1) % 26) as u8));
        rest = (rest - 1) / 26;
    }
    letters.iter().rev().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_have_the_letters_of_excel() {
        let of = [0, 25, 26, 51, 52, 701, 702].map(letters);
        assert_eq!(of, ["A", "Z", "AA", "AZ", "BA", "ZZ", "AAA"]);
    }
}
