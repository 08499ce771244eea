//! A list of cuts as labs keep it: a table with a row a cut, exported as CSV.

use std::collections::BTreeMap;
use std::path::Path;

use super::answers::Answers;
use super::found::{Scan, cut_ids, stem};
use super::list_columns::{
    Column, DIAMETER, DIRECTION, NUMBER, OF_TOOL, TEETH, column, english, is_down, name_of, plain,
};
use crate::campaign::load::CUT;
use crate::ingest::{sheet_text, without_byte_order_mark};
use crate::text::{closest, shown_briefly as shown};
use crate::{Error, InputError, Result};

/// A key of `[[cut]]` that a list cannot give: it names a posture that `init` does not know yet.
const NOT_IN_A_LIST: [&str; 1] = ["posture"];
/// Lines above the column names that are looked at: title, date, who cut.
const TITLE_LINES: usize = 10;

fn keys() -> Vec<&'static str> {
    CUT.into_iter()
        .filter(|key| !NOT_IN_A_LIST.contains(key))
        .collect()
}

fn separator(line: &str) -> u8 {
    let all = [b';', b'\t', b','];
    let found = all.into_iter().find(|s| line.contains(char::from(*s)));
    found.unwrap_or(b',')
}

fn cells(line: &str, separator: u8) -> Vec<String> {
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(separator)
        .has_headers(false)
        .trim(csv::Trim::All)
        .from_reader(line.as_bytes());
    let row = reader.records().next().and_then(|r| r.ok());
    row.map_or_else(Vec::new, |r| r.iter().map(str::to_string).collect())
}

/// Which columns name the record of a row: that of files, else that of numbers.
fn naming_column(head: &[String]) -> Option<usize> {
    let known: Vec<Option<&str>> = head
        .iter()
        .map(|h| column(h, &keys()).ok().flatten().map(|c| c.key))
        .collect();
    let at = |key: &str| known.iter().position(|k| *k == Some(key));
    at("file").or_else(|| at(NUMBER)).or_else(|| at("id"))
}

/// As UTF-8 with line feeds alone: `csv` counts the lines of others from the wrong end.
fn decoded(bytes: &[u8]) -> String {
    let text = match String::from_utf8(without_byte_order_mark(bytes).into_owned()) {
        Ok(text) => text,
        // Latin-1.
        Err(e) => e.as_bytes().iter().map(|b| char::from(*b)).collect(),
    };
    text.replace("\r\n", "\n").replace('\r', "\n")
}

/// The line of the column names: the first that names records and something that was cut with.
fn names_line(text: &str) -> Option<usize> {
    text.lines().take(TITLE_LINES).position(|line| {
        let head = cells(line, separator(line));
        let known = head.iter().filter(|h| !matches!(column(h, &keys()), Ok(None)));
        known.count() >= 2 && naming_column(&head).is_some()
    })
}

/// Is this text the beginning of a list of cuts?
pub(super) fn looks_like_one(start: &[u8]) -> bool {
    names_line(&decoded(start)).is_some()
}

/// Reads a CSV whose columns are keys of `[[cut]]` or usual names for them in English, German, French or Spanish, one of them
/// the file (name or path of the force record) or the number of the cut, into `answers`. Separators are commas, semicolons or
/// tabs; with the latter two a comma may be the decimal sign. Gives what was passed over.
///
/// # Errors
/// A file that cannot be read, a column that looks like a key misspelt or has an unknown unit, a row without a record in the
/// folder; with file, line and remedy.
pub fn read_cut_list(file: &Path, scan: &Scan, answers: &mut Answers) -> Result<Vec<String>> {
    let ids = cut_ids(&scan.forces);
    let wrong = |problem: String, line: usize, remedy: String| {
        InputError::new(problem).file(file).line(line).remedy(remedy)
    };
    let bytes = std::fs::read(file).map_err(|e| Error::io(file, e))?;
    let text = sheet_text(&bytes).unwrap_or_else(|| decoded(&bytes));
    let skipped = names_line(&text).unwrap_or(0);
    let offset: usize = text.split_inclusive('\n').take(skipped).map(str::len).sum();
    let text = &text[offset..];
    let separator = separator(text.lines().next().unwrap_or(""));
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(separator)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let broken = |e: csv::Error| {
        let line = skipped + e.position().map_or(1, |p| p.line() as usize);
        wrong(
            "not a table: rows differ in length".into(),
            line,
            "export the list as CSV, a row a cut".into(),
        )
    };
    let head: Vec<String> = reader
        .headers()
        .map_err(broken)?
        .iter()
        .map(str::to_string)
        .collect();
    let rows: Vec<csv::StringRecord> = reader
        .records()
        .collect::<std::result::Result<_, _>>()
        .map_err(broken)?;
    // A column that holds nothing but up and down says what it is, whatever it is called.
    let is_direction = |i: usize| {
        let mut words = rows
            .iter()
            .filter_map(|r| r.get(i))
            .filter(|w| !w.is_empty())
            .peekable();
        words.peek().is_some() && words.all(|word| is_down(word).is_some())
    };
    let (mut columns, mut passed_over) = (Vec::new(), Vec::new());
    for (i, name) in head.iter().enumerate() {
        let named = column(name, &keys())
            .map_err(|problem| wrong(problem, skipped + 1, "write the unit in brackets: ap [mm]".into()))?;
        let by_values = || {
            is_direction(i).then_some(Column {
                key: DIRECTION,
                factor: 1.0,
            })
        };
        let known = named.or_else(by_values);
        if known.is_none() && !name.is_empty() {
            if let Some(near) = closest(name, keys()) {
                let problem = format!("unknown column {:?}", shown(name));
                return Err(wrong(problem, skipped + 1, format!("did you mean {near}?")).into());
            }
            passed_over.push(format!("column {:?} is not used", shown(name)));
        }
        columns.push(known);
    }
    let Some(naming) = naming_column(&head) else {
        return Err(wrong(
            "there is no column \"file\"".into(),
            skipped + 1,
            "add one with the name of each cut's force record".into(),
        )
        .into());
    };
    let mut of_tool = OfTool::default();
    // The row that spoke of each record, and rows that speak of none.
    let (mut seen, mut strangers) = (BTreeMap::new(), Vec::new());
    for row in &rows {
        let line = skipped + row.position().map_or(1, |p| p.line() as usize);
        let name = row[naming].replace('\\', "/");
        let has_number = row.iter().any(|cell| cell.contains(|c: char| c.is_ascii_digit()));
        if name.is_empty() || (!has_number && row.iter().any(|c| ["mm", "1/min", "rpm"].contains(&c))) {
            // An empty row, or one of units.
            continue;
        }
        let found = cut_in_file(&name, &rows, row, naming, &ids, scan);
        let Some(at) = found.or_else(|| record_named(&name, scan)) else {
            let unread = scan.not_used.iter().find(|(path, _)| is_named(path, &name));
            if let Some((path, why)) = unread {
                let problem = format!("{} is no force record that can be read: {why}", shown(path));
                return Err(wrong(problem, line, format!("see `lobestone inspect {}`", shown(path))).into());
            }
            strangers.push((line, name));
            continue;
        };
        if let Some((first, others)) = seen.get(&at) {
            if *others == row {
                passed_over.push(format!("line {line} is not used: the same as line {first}"));
                continue;
            }
            return Err(wrong(
                format!("lines {first} and {line} name the same record, {:?}, and say different things", shown(&name)),
                line,
                "leave the one that holds; a record of several cuts needs a [[cut]] for each in campaign.toml, with steady_s = [from, to]"
                    .into(),
            )
            .into());
        }
        seen.insert(at, (line, row));
        let table = format!("cut {}", ids[at]);
        let mut angles = [None, None];
        for (i, (column, value)) in columns.iter().zip(row.iter()).enumerate() {
            let Some(Column { key, factor }) = column else {
                continue;
            };
            if value.is_empty() || i == naming || *key == NUMBER {
                continue;
            }
            let value = match is_number(key) {
                true => in_key_unit(value, &head[i], *factor, key).map_err(|problem| {
                    let remedy = "write the number alone, and its unit in the column's name: ap [mm]";
                    wrong(
                        format!("column {:?}: {problem}", shown(&head[i])),
                        line,
                        remedy.into(),
                    )
                })?,
                false => value.to_string(),
            };
            match *key {
                "file" => (),
                "start_deg" => angles[0] = Some(value.replace(',', ".")),
                "exit_deg" => angles[1] = Some(value.replace(',', ".")),
                DIAMETER => {
                    // In turning it is the workpiece's.
                    answers.set(&table, DIAMETER, value.clone());
                    of_tool.take(DIAMETER, value);
                }
                key if OF_TOOL.contains(&key) => of_tool.take(key, value),
                "spindle_rpm" => match of_thousands(&value) {
                    Some(rpm) => {
                        passed_over.push(format!("{:?} read as {rpm} rpm", shown(&value)));
                        answers.set(&table, *key, rpm);
                    }
                    None => answers.set(&table, *key, value),
                },
                DIRECTION => match is_down(&value) {
                    Some(down) => answers.set(&table, DIRECTION, if down { "down" } else { "up" }),
                    None => {
                        let remedy = "write down (Gleichlauf, avalant) or up (Gegenlauf, opposition)";
                        return Err(wrong(
                            format!("{:?} is no direction of milling", shown(&value)),
                            line,
                            remedy.into(),
                        )
                        .into());
                    }
                },
                "process" | "immersion" => {
                    answers.set(
                        &table,
                        *key,
                        english(&value).map_or(value.as_str(), |(_, word)| word),
                    );
                }
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
    for (line, name) in strangers {
        if seen.is_empty() {
            let problem = format!(
                "{:?} names no force record of the folder, or several",
                shown(&name)
            );
            let remedy = "write the file's name, or its path from the folder";
            return Err(wrong(problem, line, remedy.into()).into());
        }
        let row = format!(
            "line {line} is not used: {:?} names no force record of the folder, or several",
            shown(&name)
        );
        passed_over.push(row);
    }
    let turned = ids
        .iter()
        .any(|id| answers.get("cut", id, "process") == Some("turning"));
    passed_over.extend(of_tool.hand_over(answers, turned));
    Ok(passed_over)
}

/// The tool stands in every row of some lists.
#[derive(Default)]
struct OfTool(Vec<(&'static str, String)>);

impl OfTool {
    fn take(&mut self, key: &'static str, value: String) {
        if !self.0.contains(&(key, value.clone())) {
            self.0.push((key, value));
        }
    }

    fn hand_over(self, answers: &mut Answers, turned: bool) -> Vec<String> {
        let mut told = Vec::new();
        for key in OF_TOOL {
            let values: Vec<&String> = self.0.iter().filter(|(k, _)| *k == key).map(|(_, v)| v).collect();
            match values.as_slice() {
                [] => (),
                [one] if answers.get("tool", "", key).is_none() => answers.set("tool", key, one.as_str()),
                [_] => (),
                _ if turned && key == DIAMETER => (),
                _ => told.push(format!(
                    "{key} changes from row to row: one campaign holds one tool"
                )),
            }
        }
        told
    }
}

/// Does a column of this key hold numbers?
fn is_number(key: &str) -> bool {
    key == TEETH
        || ["_mm", "_rpm", "_deg", "_per_min", "_per_turn"]
            .iter()
            .any(|end| key.ends_with(end))
}

/// The number of a cell in the unit of `key`, as it was typed where that is it: `0,04`, `3'007 U/min`, `Ø12 mm`, `40 µm`. `factor`: of
/// the column `head`.
fn in_key_unit(cell: &str, head: &str, factor: f64, key: &str) -> std::result::Result<String, String> {
    let no_number = || format!("{:?} is no number", shown(cell));
    let begins = |c: char| c.is_ascii_digit() || "+-.,".contains(c);
    let text = cell.trim_start_matches(|c: char| "Øø⌀= ".contains(c));
    let end = text
        .find(|c: char| !begins(c) && !is_gap(c))
        .unwrap_or(text.len());
    let is_exponent = text[end..].starts_with(['e', 'E']) && text.replace(',', ".").parse::<f64>().is_ok();
    let (number, unit) = match is_exponent {
        true => (text, ""),
        false => text.split_at(end),
    };
    let (number, unit) = match without_gaps(number.trim()) {
        Some(number) if !unit.starts_with('/') => (number, unit),
        // `3007 1/min`: the last figure is one of the unit's.
        _ => {
            let (number, unit) = text.split_once(char::is_whitespace).ok_or_else(no_number)?;
            (without_gaps(number).ok_or_else(no_number)?, unit)
        }
    };
    let value: f64 = number.replace(',', ".").parse().map_err(|_| no_number())?;
    if !value.is_finite() {
        return Err(no_number());
    }
    let factor = match unit.trim() {
        "" => factor,
        unit => {
            let own = column(&format!("{} [{unit}]", name_of(head)), &keys())?;
            let own = own
                .filter(|c| c.key == key)
                .ok_or_else(|| format!("{:?} has a unit of something else", shown(cell)))?;
            own.factor
        }
    };
    Ok(if factor == 1.0 {
        number
    } else {
        format!("{}", value * factor)
    })
}

/// May it stand between thousands?
fn is_gap(c: char) -> bool {
    c.is_whitespace() || "'’".contains(c)
}

/// A number without the marks between its thousands; `None` where they stand elsewhere.
fn without_gaps(number: &str) -> Option<String> {
    let mut groups = number.split(is_gap);
    let first = groups.next().unwrap_or("");
    let has_three = |group: &str| {
        let digits = group.split(['.', ',']).next().unwrap_or("");
        digits.len() == 3 && digits.bytes().all(|b| b.is_ascii_digit())
    };
    let rest: Vec<&str> = groups.collect();
    let is_whole = rest.is_empty() || first.len() <= 3;
    (is_whole && rest.iter().all(|g| has_three(g))).then(|| format!("{first}{}", rest.concat()))
}

/// `12.000` or `12,000` as a spindle speed: a mark of thousands, where it would be slower than a hundred turns a minute.
fn of_thousands(value: &str) -> Option<String> {
    const SLOWEST_RPM: f64 = 100.0;
    let (front, back) = value.split_once(['.', ','])?;
    let all_digits = |text: &str| text.bytes().all(|b| b.is_ascii_digit());
    let is_slow = front
        .parse::<f64>()
        .is_ok_and(|rpm| (1.0..SLOWEST_RPM).contains(&rpm));
    (is_slow && all_digits(front) && back.len() == 3 && all_digits(back)).then(|| format!("{front}{back}"))
}

/// Is this the path's own name, with or without folders and ending?
fn is_named(path: &str, name: &str) -> bool {
    path == name || path.rsplit('/').next() == Some(name) || stem(path) == name
}

/// Index of the record that a row means where its file holds several cuts: the one whose id a cell of the row says; where none does and
/// the list has a row for each of them, in their order.
fn cut_in_file(
    name: &str,
    rows: &[csv::StringRecord],
    row: &csv::StringRecord,
    naming: usize,
    ids: &[String],
    scan: &Scan,
) -> Option<usize> {
    let forces = scan.forces.iter().enumerate();
    let cuts: Vec<usize> = forces
        .filter(|(_, f)| f.part.is_some() && is_named(&f.path, name))
        .map(|(at, _)| at)
        .collect();
    let mut cells = row.iter().enumerate().filter(|(i, _)| *i != naming);
    let said = cells.find_map(|(_, cell)| cuts.iter().copied().find(|at| ids[*at] == cell));
    let alike: Vec<&csv::StringRecord> = rows.iter().filter(|r| r[naming] == row[naming]).collect();
    let place = alike.iter().position(|other| other.position() == row.position());
    let in_order = place
        .filter(|_| alike.len() == cuts.len())
        .map(|place| cuts[place]);
    said.or(in_order)
}

/// Index of the force record that a row's name means: its path, its name, the name written a little differently, or its number.
fn record_named(name: &str, scan: &Scan) -> Option<usize> {
    let letters = |text: &str| -> String { plain(text).chars().filter(|c| c.is_alphanumeric()).collect() };
    let number = |text: &str| -> Option<u64> {
        let digits = text.trim_start_matches(|c: char| !c.is_ascii_digit());
        digits.split(|c: char| !c.is_ascii_digit()).next()?.parse().ok()
    };
    let is_number = name.bytes().all(|b| b.is_ascii_digit());
    let exact = |path: &str| is_named(path, name);
    let nearly =
        |path: &str| letters(stem(path)) == letters(name) || letters(stem(path)) == letters(stem(name));
    let by_number = |path: &str| is_number && number(stem(path)) == name.parse().ok();
    let tests: [&dyn Fn(&str) -> bool; 3] = [&exact, &nearly, &by_number];
    tests.into_iter().find_map(|test| {
        let mut named = scan.forces.iter().enumerate().filter(|(_, f)| test(&f.path));
        match (named.next(), named.next()) {
            (Some((at, _)), None) => Some(at),
            _ => None,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_read_as_people_write_them() {
        let read = |cell: &str, head: &str| {
            let column = column(head, &keys()).unwrap().unwrap();
            in_key_unit(cell, head, column.factor, column.key)
        };
        for (cell, head, value) in [
            ("0,04", "fz [mm]", "0,04"),
            ("3'007", "n", "3007"),
            ("3 007 U/min", "Drehzahl [1/min]", "3007"),
            ("3\u{a0}007", "Drehzahl", "3007"),
            ("12 345,5", "n", "12345,5"),
            ("0,04 mm", "fz [mm]", "0,04"),
            ("40 µm", "fz [mm]", "0.04"),
            ("40", "fz [µm]", "0.04"),
            ("0.04 mm", "fz [µm]", "0.04"),
            ("Ø12 mm", "D", "12"),
            ("1e3", "n", "1e3"),
            ("50 1/s", "n [1/min]", "3000"),
            ("3007 1/min", "n", "3007"),
            ("30°", "Drall", "30"),
        ] {
            let found = read(cell, head);
            let same = |a: &str| a.replace(',', ".").parse::<f64>().unwrap();
            assert!(
                (same(found.as_ref().unwrap()) - same(value)).abs() < 1e-12,
                "{cell}: {found:?}"
            );
        }
        for (cell, head) in [
            ("ca. 3", "ap"),
            ("3 0", "n"),
            ("3 mm/min", "ap"),
            ("3 kg", "ap"),
            ("-", "n"),
            ("inf", "ap"),
        ] {
            assert!(read(cell, head).is_err(), "{cell}");
        }
    }

    #[test]
    fn a_mark_of_thousands_is_none_of_decimals() {
        for (written, rpm) in [("12.000", "12000"), ("8,500", "8500"), ("1.200", "1200")] {
            assert_eq!(of_thousands(written).as_deref(), Some(rpm), "{written}");
        }
        // So many turns a minute are slow enough, and so few are not written with three digits of them.
        for written in ["955.000", "1200.5", "12.00", "0.500", "3000", "1.2000", "a.000"] {
            assert_eq!(of_thousands(written), None, "{written}");
        }
    }
}
