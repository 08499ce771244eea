//! A list of cuts as labs keep it: a table with a row a cut, exported as CSV.

use std::path::Path;

use super::Answers;
use super::scan::{Scan, stem};
use super::tables::cut_ids;
use crate::campaign::load::CUT;
use crate::campaign::suggest::{closest, shown};
use crate::{Error, InputError, Result};

/// Keys of `[[cut]]` that a list cannot give: one is a pair of times, one names a posture that `init` does not know yet.
const NOT_IN_A_LIST: [&str; 2] = ["steady_s", "posture"];

fn columns() -> impl Iterator<Item = &'static str> {
    CUT.into_iter().filter(|key| !NOT_IN_A_LIST.contains(key))
}

/// Reads a CSV whose columns are keys of `[[cut]]`, one of them `file` (name or path of the force record), into
/// `answers`. Separators are commas, semicolons or tabs; with the latter two a comma may be the decimal sign.
///
/// # Errors
/// A file that cannot be read, an unknown column, a row without a record in the folder; with file, line and remedy.
pub fn read_cut_list(file: &Path, scan: &Scan, answers: &mut Answers) -> Result<()> {
    let ids = cut_ids(&scan.forces);
    let wrong = |problem: String, line: usize, remedy: String| {
        InputError::new(problem).file(file).line(line).remedy(remedy)
    };
    let bytes = std::fs::read(file).map_err(|e| Error::io(file, e))?;
    let text: String = match String::from_utf8(bytes) {
        Ok(text) => text.trim_start_matches('\u{feff}').to_string(),
        Err(e) => e.as_bytes().iter().map(|b| char::from(*b)).collect(),
    };
    let head = text.lines().next().unwrap_or("");
    let separator = [b';', b'\t', b',']
        .into_iter()
        .find(|s| head.contains(char::from(*s)))
        .unwrap_or(b',');
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(separator)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let broken = |e: csv::Error| {
        let line = e.position().map_or(1, |p| p.line() as usize);
        wrong(
            "not a table: rows differ in length".into(),
            line,
            "export the list as CSV, a row a cut".into(),
        )
    };
    let header: Vec<String> = reader
        .headers()
        .map_err(broken)?
        .iter()
        .map(str::to_lowercase)
        .collect();
    if let Some(unknown) = header.iter().find(|h| columns().all(|key| key != h.as_str())) {
        let remedy = match closest(unknown, columns()) {
            Some(near) => format!("did you mean {near}?"),
            None => format!("columns are {}", columns().collect::<Vec<_>>().join(", ")),
        };
        return Err(wrong(format!("unknown column {:?}", shown(unknown)), 1, remedy).into());
    }
    let Some(file_column) = header.iter().position(|h| h == "file") else {
        return Err(wrong(
            "there is no column \"file\"".into(),
            1,
            "add one with the name of each cut's force record".into(),
        )
        .into());
    };
    for row in reader.records() {
        let row = row.map_err(broken)?;
        let line = row.position().map_or(1, |p| p.line() as usize);
        let name = row[file_column].replace('\\', "/");
        let is_named =
            |path: &str| path == name || path.rsplit('/').next() == Some(&name) || stem(path) == name;
        let mut named = ids.iter().zip(&scan.forces).filter(|(_, f)| is_named(&f.path));
        let (Some((id, _)), None) = (named.next(), named.next()) else {
            return Err(wrong(
                format!(
                    "{:?} names no force record of the folder, or several",
                    shown(&name)
                ),
                line,
                "write the file's name, or its path from the folder".into(),
            )
            .into());
        };
        let table = format!("cut {id}");
        let mut angles = [None, None];
        for (key, value) in header.iter().zip(row.iter()) {
            match key.as_str() {
                _ if value.is_empty() => (),
                "file" => (),
                "start_deg" => angles[0] = Some(value.replace(',', ".")),
                "exit_deg" => angles[1] = Some(value.replace(',', ".")),
                key => answers.set(&table, key, value),
            }
        }
        match angles {
            [Some(start), Some(exit)] => answers.set(&table, "immersion", format!("{start} {exit}")),
            [None, None] => (),
            _ => {
                return Err(wrong(
                    "start_deg and exit_deg belong together".into(),
                    line,
                    "give both, or immersion = slot".into(),
                )
                .into());
            }
        }
    }
    Ok(())
}
