//! Columns of numbers under header lines: comma, semicolon, tab or blanks; decimal point or comma.

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use crate::InputError;
use crate::ingest::tables::channel_names;
use crate::ingest::tables::number;
use crate::ingest::text::{Lines, Notes, decode};
use crate::ingest::units;

/// Header lines looked at before a file is given up as "no table of numbers".
const HEADER_LINES_AT_MOST: usize = 200;
/// Rows that must follow before a row counts as data.
const ROWS_TO_BELIEVE: usize = 3;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Delimiter {
    Byte(u8),
    Blanks,
}

/// The lines above the numbers and how the numbers are written.
#[derive(Debug, Clone)]
pub(crate) struct Header {
    /// All lines above the names line (above the data where there is none).
    pub lines: Vec<String>,
    /// Column names, empty where the file has none.
    pub names: Vec<String>,
    /// Units line, empty where the file has none.
    pub units: Vec<String>,
    pub delimiter: Delimiter,
    pub decimal: u8,
    /// Decimal commas between commas: rows must be split by sense.
    pub decimal_comma_between_commas: bool,
    pub columns: usize,
    /// Offset and 1-based line number of the first row.
    pub data_at: usize,
    pub data_line: usize,
}

/// Columns of equal length; a missing or invalid number is NaN.
#[derive(Debug)]
pub(crate) struct Table {
    pub columns: Vec<Vec<f64>>,
}

impl Header {
    /// Finds where the numbers begin and how they are separated; `None` where the text holds no table.
    pub fn find(bytes: &[u8]) -> Option<Header> {
        let mut lines = Lines::new(bytes);
        let mut above: Vec<String> = last_section(&mut lines);
        let (data_at, data_line) = loop {
            let at = lines.position;
            let line = lines.next()?;
            if is_row(line) && rows_follow(lines.clone()) {
                break (at, lines.number);
            }
            above.push(decode(line));
            if above.len() > HEADER_LINES_AT_MOST {
                return None;
            }
        };
        while above.last().is_some_and(|l| l.trim().is_empty()) {
            above.pop();
        }
        let data = &bytes[data_at..];
        let first_row = decode(Lines::new(data).next()?);
        let delimiter = find_delimiter(above.last().map(String::as_str), &first_row, data);
        let fields = split_line(&first_row, delimiter).len();
        let mut below: Vec<String> = Vec::new();
        if let Some(at) = names_line(&above, delimiter, fields) {
            below = above.split_off(at + 1);
        }
        let mut names = above
            .last()
            .map(|l| split_names(l, delimiter))
            .unwrap_or_default();
        let mut units = Vec::new();
        let is_units = |names: &[String]| {
            let understood = names.iter().filter(|n| units::parse(n).is_some()).count();
            names.len() > 1 && understood > 0 && 2 * understood >= names.len()
        };
        if let Some(line) = below.first().map(|l| split_line(l, delimiter))
            && is_units(&line)
            && line.len() == names.len()
        {
            units = line;
        } else if let Some(labelled) = labelled_names(&above, delimiter, &names) {
            units = std::mem::replace(&mut names, labelled);
            units[0] = "s".into();
        } else if below.is_empty() && is_units(&names) && above.len() > 1 {
            let candidate = split_names(&above[above.len() - 2], delimiter);
            if candidate.len() == names.len() {
                units = std::mem::replace(&mut names, candidate);
                above.pop();
            }
        }
        // Behind a comment sign more may stand than names: `# Fx Fy Fz in N`.
        let is_comment = above.last().is_some_and(|l| l.trim_start().starts_with(COMMENTS));
        if is_comment && names.len() > fields && names[..fields].iter().all(|n| channel_names::is_known(n)) {
            names.truncate(fields);
        }
        // A last line such as `Cycle No:,1` is no names line.
        if names.len() < 2 && fields > 1 || names.first().is_some_and(|n| n.ends_with(':')) {
            names.clear();
            units.clear();
        } else {
            above.pop();
        }
        above.extend(below);
        // Each row has its time in two tokens then; a single long row is only a bad one.
        let between_commas = delimiter == Delimiter::Byte(b',')
            && !names.is_empty()
            && !holds(data, b'.')
            && !holds(data, b'"')
            && Lines::new(data)
                .take(20)
                .all(|l| l.trim_ascii().is_empty() || count_fields(l) > names.len());
        let decimal = match delimiter {
            Delimiter::Byte(b',') if between_commas || quoted_commas(data) => b',',
            Delimiter::Byte(b',') => b'.',
            _ if holds(data, b',') => b',',
            _ => b'.',
        };
        let columns = if names.is_empty() { fields } else { names.len() };
        Some(Header {
            lines: above,
            names,
            units,
            delimiter,
            decimal,
            decimal_comma_between_commas: between_commas,
            columns,
            data_at,
            data_line,
        })
    }

    /// Do the lines above the numbers say what they are in their first field (Kyowa)?
    pub fn is_labelled(&self) -> bool {
        let mut rows = self.lines.iter().map(|l| split_names(l, self.delimiter));
        rows.any(|row| {
            row.first()
                .is_some_and(|f| f.eq_ignore_ascii_case(CHANNEL_NUMBER))
        })
    }

    /// Takes their meaning from the columns of times: the sampling rate is to count. Whether there were any.
    pub fn without_time(&mut self) -> bool {
        let mut any = false;
        let is_time =
            |label: &String| units::parse(label).is_some_and(|u| u.dimension == units::Dimension::TIME);
        for (i, name) in self.names.iter_mut().enumerate() {
            let in_time = self.units.get(i).is_some_and(is_time)
                || channel_names::unit_in_name(name).is_some_and(|u| u.dimension == units::Dimension::TIME);
            if channel_names::is_time(name) || i == 0 && in_time {
                any = true;
                *name = format!("unused {}", i + 1);
                if let Some(unit) = self.units.get_mut(i) {
                    unit.clear();
                }
            }
        }
        any
    }

    /// `Key:,value` of a header line whose key contains one of `keys` (lower case); the unit of `Key [Hz]` is
    /// part of the key.
    pub fn entry(&self, keys: &[&str]) -> Option<(&str, &str)> {
        self.lines.iter().find_map(|line| {
            let at = line.find([':', ';', '\t', ',', '='])?;
            let (key, value) = line.split_at(at);
            let lower = key.to_lowercase();
            let value = value.trim_matches(|c: char| c.is_whitespace() || ":;,=\"".contains(c));
            keys.iter().any(|k| lower.contains(k)).then_some((key, value))
        })
    }

    /// How the table is written, for people.
    pub fn describe(&self) -> String {
        let delimiter = match self.delimiter {
            Delimiter::Byte(b'\t') => "tab",
            Delimiter::Byte(b';') => "semicolon",
            Delimiter::Byte(_) => "comma",
            Delimiter::Blanks => "blank",
        };
        let decimal = if self.decimal == b',' { "comma" } else { "point" };
        format!(
            "{delimiter} separated, decimal {decimal}, data from line {}",
            self.data_line
        )
    }

    /// Reads the rows of one piece of the file that ends with a line; its first line has number `first_line`. Only the last
    /// piece may end within a row.
    ///
    /// # Errors
    /// As [`Header::read`].
    pub fn read_rows(
        &self,
        data: &[u8],
        first_line: usize,
        is_last: bool,
        notes: &mut Notes,
    ) -> Result<Table, InputError> {
        let mut columns = Vec::new();
        self.read_rows_into(data, first_line, is_last, notes, &mut columns)?;
        Ok(Table { columns })
    }

    /// As [`Header::read_rows`]; writes over what is in `columns`, whose memory is used again. Gives the line ends in `data`.
    ///
    /// # Errors
    /// As [`Header::read`].
    pub fn read_rows_into(
        &self,
        data: &[u8],
        first_line: usize,
        is_last: bool,
        notes: &mut Notes,
        columns: &mut Vec<Vec<f64>>,
    ) -> Result<usize, InputError> {
        columns.resize_with(self.columns, Vec::new);
        let texts = split_at_lines(data);
        let line_ends: Vec<usize> = texts
            .par_iter()
            .map(|text| memchr::memchr_iter(b'\n', text).count())
            .collect();
        // Each part gets a stretch of the columns of its own; where rows are blank it stays longer than what is written.
        let room: Vec<usize> = texts
            .iter()
            .zip(&line_ends)
            .map(|(text, ends)| self.rows_at_most(text, *ends))
            .collect();
        let all_room = room.iter().sum();
        for column in columns.iter_mut() {
            // New memory is zero as it comes from the system; nobody has to write that.
            if column.is_empty() {
                *column = vec![0.0; all_room];
            }
            column.resize(all_room, 0.0);
        }
        let mut rests: Vec<&mut [f64]> = columns.iter_mut().map(Vec::as_mut_slice).collect();
        let mut stretches = Vec::with_capacity(texts.len());
        for rows in &room {
            let stretch: Vec<&mut [f64]> = rests
                .iter_mut()
                .map(|rest| rest.split_off_mut(..*rows).unwrap_or_default())
                .collect();
            stretches.push(stretch);
        }
        let parts: Vec<Part> = texts
            .into_par_iter()
            .zip(stretches)
            .map(|(text, mut stretch)| {
                Arch::new().dispatch(ReadPart {
                    header: self,
                    text,
                    columns: &mut stretch,
                })
            })
            .collect();
        let (mut rows, mut from, mut line) = (0, 0, first_line);
        let mut bad_row = None;
        let mut ends_in_a_row = true;
        for (k, (part, room)) in parts.iter().zip(&room).enumerate() {
            if rows < from {
                columns
                    .iter_mut()
                    .for_each(|c| c.copy_within(from..from + part.rows, rows));
            }
            rows += part.rows;
            from += room;
            if let Some((text, rest)) = &part.bad {
                let at_the_end = is_last && k + 1 == parts.len() && rows > 0;
                if at_the_end && *rest == Rest::Blank {
                    notes.file("the last row is incomplete and left out");
                } else if let (true, Rest::Footer(count)) = (at_the_end, rest) {
                    let text = text.trim_end().chars().take(20).collect::<String>();
                    let text = text.trim_end();
                    notes.file(match count {
                        1 => format!("1 line below the last row, {text:?}, is no row and left out"),
                        _ => format!(
                            "{count} lines below the last row, from {text:?} on, are no rows and left out"
                        ),
                    });
                    ends_in_a_row = false;
                } else {
                    bad_row = Some(self.bad_row(text, line + part.lines));
                }
                break;
            }
            line += part.lines;
        }
        columns.iter_mut().for_each(|c| c.truncate(rows));
        if let Some(error) = bad_row {
            return Err(error);
        }
        if is_last && ends_in_a_row && rows > 3 && ends_within_a_number(data, self.decimal) {
            columns.iter_mut().for_each(|c| c.truncate(c.len() - 1));
            notes.file(
                "the file ends without a line end, its last number has fewer digits than those above: cut off, the last row \
                 is left out",
            );
        }
        Ok(line_ends.iter().sum())
    }

    /// Rows that a text can hold: one a line, and a byte for each column. What a header announces cannot claim memory.
    fn rows_at_most(&self, text: &[u8], line_ends: usize) -> usize {
        let unfinished = text.last().is_some_and(|b| *b != b'\n');
        (line_ends + usize::from(unfinished)).min(text.len() / self.columns.max(1) + 1)
    }

    #[inline(always)]
    fn read_part(&self, data: &[u8], columns: &mut [&mut [f64]]) -> Part {
        let (mut at, mut lines, mut rows, mut bad) = (0, 0, 0, None);
        while at < data.len() {
            let row = match self.read_plain_row(data, at, rows, columns) {
                Some(next) => Row::Full(next),
                None => self.read_row(data, at, rows, columns),
            };
            match row {
                Row::Full(next) => {
                    rows += 1;
                    at = next;
                }
                Row::Blank(next) => at = next,
                Row::Bad => {
                    let length = memchr::memchr(b'\n', &data[at..]);
                    let text = decode(&data[at..length.map_or(data.len(), |l| at + l)]);
                    bad = Some((text, Rest::of(&data[at..])));
                    break;
                }
            }
            lines += 1;
        }
        Part { rows, lines, bad }
    }

    fn bad_row(&self, text: &str, line: usize) -> InputError {
        InputError::new(format!(
            "{} numbers are expected here, not {:?}",
            self.columns,
            text.trim_end().chars().take(60).collect::<String>()
        ))
        .line(line)
        .remedy(
            "remove the line, or export the file again with one number per column and no thousands separator",
        )
    }

    /// A row as recorders print it: plain numbers with one delimiter between them. Gives where the next begins; `None` for all
    /// else, which [`Header::read_row`] looks at.
    #[inline(always)]
    fn read_plain_row(
        &self,
        data: &[u8],
        start: usize,
        row: usize,
        columns: &mut [&mut [f64]],
    ) -> Option<usize> {
        let (delimiter, blank) = match self.delimiter {
            Delimiter::Byte(byte) => (byte, b' '),
            Delimiter::Blanks => (b' ', b' '),
        };
        let mut at = start;
        let last = columns.len().checked_sub(1)?;
        for (i, column) in columns.iter_mut().enumerate() {
            while *data.get(at)? == blank {
                at += 1;
            }
            let (value, end) = number::scan_plain(data, at, self.decimal)?;
            *column.get_mut(row)? = value;
            at = end;
            if i < last {
                if *data.get(at)? != delimiter {
                    return None;
                }
                at += 1;
            }
        }
        at += usize::from(*data.get(at)? == b'\r');
        (*data.get(at)? == b'\n').then_some(at + 1)
    }

    fn read_row(&self, data: &[u8], start: usize, row: usize, columns: &mut [&mut [f64]]) -> Row {
        let mut at = start;
        let blank = |at: usize| match data.get(at) {
            Some(b' ') => true,
            Some(b'\t') => self.delimiter != Delimiter::Byte(b'\t'),
            _ => false,
        };
        let line_end = |at: usize| match data.get(at) {
            None => Some(at),
            Some(b'\n') => Some(at + 1),
            Some(b'\r') if matches!(data.get(at + 1), None | Some(b'\n')) => Some((at + 2).min(data.len())),
            _ => None,
        };
        while blank(at) {
            at += 1;
        }
        if let Some(next) = line_end(at) {
            return Row::Blank(next);
        }
        let count = columns.len();
        let put = |column: &mut [f64], value| {
            if let Some(place) = column.get_mut(row) {
                *place = value;
            }
        };
        for (i, column) in columns.iter_mut().enumerate() {
            match number::scan(data, at, self.decimal) {
                Some((value, end)) => {
                    put(column, value);
                    at = end;
                }
                // An empty field is a missing sample.
                None if self.delimiter != Delimiter::Blanks && is_field_end(data.get(at), self.delimiter) => {
                    put(column, f64::NAN);
                }
                None => return Row::Bad,
            }
            let number_end = at;
            while blank(at) {
                at += 1;
            }
            if i + 1 < count {
                match self.delimiter {
                    Delimiter::Byte(b) if data.get(at) == Some(&b) => at += 1,
                    Delimiter::Blanks if at > number_end && line_end(at).is_none() => {}
                    _ => return Row::Bad,
                }
                while blank(at) {
                    at += 1;
                }
            }
        }
        // Delimiters after the last field are a habit of spreadsheets.
        while let Delimiter::Byte(b) = self.delimiter
            && data.get(at) == Some(&b)
        {
            at += 1;
            while blank(at) {
                at += 1;
            }
        }
        match line_end(at) {
            Some(next) => Row::Full(next),
            None => Row::Bad,
        }
    }

    /// Files with quoted fields, by the `csv` crate.
    pub(crate) fn read_quoted(&self, data: &[u8], notes: &mut Notes) -> Result<Table, InputError> {
        let delimiter = match self.delimiter {
            Delimiter::Byte(b) => b,
            Delimiter::Blanks => b' ',
        };
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(delimiter)
            .has_headers(false)
            .flexible(true)
            .from_reader(data);
        let mut columns: Vec<Vec<f64>> = vec![Vec::new(); self.columns];
        let mut record = csv::ByteRecord::new();
        let mut bad: Option<InputError> = None;
        while reader.read_byte_record(&mut record).unwrap_or(false) {
            if let Some(error) = bad {
                return Err(error);
            }
            let row: Option<Vec<f64>> = record
                .iter()
                .take(self.columns)
                .map(|f| number::field(f, self.decimal))
                .collect();
            let more = record
                .iter()
                .skip(self.columns)
                .any(|f| !f.trim_ascii().is_empty());
            match row {
                Some(row) if row.len() == self.columns && !more => {
                    columns
                        .iter_mut()
                        .zip(row)
                        .for_each(|(column, value)| column.push(value));
                }
                _ => {
                    let line = record.position().map_or(0, |p| p.line() as usize) + self.data_line - 1;
                    let text: Vec<String> = record.iter().map(decode).collect();
                    bad = Some(self.bad_row(&text.join(" "), line));
                }
            }
        }
        match bad {
            Some(error) if columns.first().is_none_or(Vec::is_empty) => return Err(error),
            Some(_) => notes.file("the last row is incomplete and left out"),
            None => {}
        }
        Ok(Table { columns })
    }
}

/// [`Header::read_part`] in the instructions that the processor has: a fifth less time, for the shifts by a number of digits
/// above all. (A type of its own: a closure is compiled for that one where it is not inlined.)
struct ReadPart<'a, 'c, 'v> {
    header: &'a Header,
    text: &'a [u8],
    columns: &'c mut [&'v mut [f64]],
}

impl WithSimd for ReadPart<'_, '_, '_> {
    type Output = Part;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Part {
        self.header.read_part(self.text, self.columns)
    }
}

/// True where the last line has no end and its last number fewer digits than the last numbers of the rows above, which all
/// have as many.
fn ends_within_a_number(data: &[u8], decimal: u8) -> bool {
    if data.last().is_none_or(|b| matches!(b, b'\n' | b'\r')) {
        return false;
    }
    let mut rows = data.rsplit(|b| *b == b'\n');
    let digits = |row: &[u8]| {
        let is_end = |b: &u8| *b != decimal && b" \t;,".contains(b);
        let last = row.trim_ascii().rsplit(is_end).next().unwrap_or_default();
        let fraction = last.iter().rev().take_while(|b| **b != decimal).count();
        let has_point = last.contains(&decimal);
        (has_point, if has_point { fraction } else { 0 })
    };
    let Some(last) = rows.next().map(digits) else {
        return false;
    };
    let above: Vec<(bool, usize)> = rows.take(8).map(digits).collect();
    let Some(usual) = above
        .first()
        .filter(|first| above.len() >= 3 && above.iter().all(|a| a == *first))
    else {
        return false;
    };
    usual.0 && last.1 < usual.1
}

/// What one thread read.
struct Part {
    rows: usize,
    /// Lines read before the end or the bad row.
    lines: usize,
    /// A row that is none, and what follows it.
    bad: Option<(String, Rest)>,
}

/// What stands from a row that is none on.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Rest {
    /// The row is the last.
    Blank,
    /// So many lines of words, as programs put them below their tables.
    Footer(usize),
    /// Rows of numbers, or more than a footer.
    Rows,
}

impl Rest {
    /// Lines that a footer has at most.
    const FOOTER_LINES: usize = 60;

    fn of(text: &[u8]) -> Rest {
        let mut lines = Lines::new(text).filter(|line| !line.trim_ascii().is_empty());
        let first = lines.next().unwrap_or_default().trim_ascii();
        let more: Vec<&[u8]> = lines.take(Self::FOOTER_LINES).collect();
        let is_in_words = first
            .first()
            .is_some_and(|b| b.is_ascii_alphabetic() || b"#%*[\"".contains(b))
            && !is_row(first);
        if is_in_words && more.len() < Self::FOOTER_LINES && !more.iter().any(|line| is_row(line)) {
            Rest::Footer(1 + more.len())
        } else if more.is_empty() {
            Rest::Blank
        } else {
            Rest::Rows
        }
    }
}

/// Bytes worth a thread of their own.
const PART: usize = 1 << 20;

/// The text in parts that end with a line.
fn split_at_lines(data: &[u8]) -> Vec<&[u8]> {
    let (mut parts, mut rest) = (Vec::new(), data);
    while rest.len() > 2 * PART {
        let Some(end) = memchr::memchr(b'\n', &rest[PART..]) else {
            break;
        };
        let (part, after) = rest.split_at(PART + end + 1);
        // What is blank to the end belongs to the row before it.
        if after.len() <= PART && after.trim_ascii().is_empty() {
            break;
        }
        parts.push(part);
        rest = after;
    }
    parts.push(rest);
    parts
}

enum Row {
    Full(usize),
    Blank(usize),
    Bad,
}

fn is_field_end(byte: Option<&u8>, delimiter: Delimiter) -> bool {
    match byte {
        None | Some(b'\n' | b'\r') => true,
        Some(&b) => delimiter == Delimiter::Byte(b),
    }
}

fn count_fields(line: &[u8]) -> usize {
    split_line(&decode(line), Delimiter::Byte(b',')).len()
}

/// Signs that begin a comment line.
const COMMENTS: [char; 2] = ['#', '%'];

/// Names as they stand behind a comment sign too.
fn split_names(line: &str, delimiter: Delimiter) -> Vec<String> {
    // A line of units may begin with an empty field: the time's own is in its name.
    let line = match delimiter {
        Delimiter::Byte(b'\t') => line.trim_start_matches(' '),
        _ => line.trim_start(),
    };
    split_line(line.trim_start_matches(COMMENTS), delimiter)
}

/// The line of names where it is not the last one above the numbers (units below it are looked at by the caller): as many
/// fields as a row has, and one of them a name that is understood, while the last line has none.
fn names_line(above: &[String], delimiter: Delimiter, fields: usize) -> Option<usize> {
    const LINES: usize = 8;
    let is_names = |line: &String| {
        let names = split_names(line, delimiter);
        names.len() > 1 && names.len() == fields && names.iter().any(|n| channel_names::is_known(n))
    };
    let from = above.len().saturating_sub(LINES);
    let at = from + above[from..].iter().rposition(is_names)?;
    // The last line, or the last but one above units: as ever.
    (at + 2 < above.len() || at + 2 == above.len() && !is_unit_line(above.last()?, delimiter)).then_some(at)
}

/// First fields of the lines above the numbers, in small letters, as Kyowa's recorders (PCD-400A) write them.
const CHANNEL_NAME: &str = "ch name";
const CHANNEL_NUMBER: &str = "ch no.";

/// Names of the columns above a last line (`units`) that begins with `Unit`, where each line says in its first field what it
/// holds: the line `CH Name`, `CH No.` where that is blank. The first column is the time.
fn labelled_names(above: &[String], delimiter: Delimiter, units: &[String]) -> Option<Vec<String>> {
    if !units.first()?.eq_ignore_ascii_case("unit") {
        return None;
    }
    let line = |label: &str| {
        let rows = above.iter().map(|l| split_names(l, delimiter));
        let mut named = rows.filter(|r| r.len() == units.len() && r[0].eq_ignore_ascii_case(label));
        named.find(|r| r[1..].iter().all(|name| !name.is_empty()))
    };
    let mut names = line(CHANNEL_NAME).or_else(|| line(CHANNEL_NUMBER))?;
    names[0] = "time".into();
    Some(names)
}

fn is_unit_line(line: &str, delimiter: Delimiter) -> bool {
    let fields = split_line(line, delimiter);
    let understood = fields.iter().filter(|n| units::parse(n).is_some()).count();
    understood > 0 && 2 * understood >= fields.len()
}

/// True for a line of numbers and separators only.
pub(crate) fn is_row(line: &[u8]) -> bool {
    let line = line.trim_ascii();
    let mut tokens = line
        .split(|b| b" \t;,\"".contains(b))
        .filter(|t| !t.is_empty())
        .peekable();
    tokens.peek().is_some() && tokens.all(|t| number::scan(t, 0, b'.').is_some_and(|(_, end)| end == t.len()))
}

fn rows_follow(lines: Lines) -> bool {
    lines
        .filter(|l| !l.trim_ascii().is_empty())
        .take(ROWS_TO_BELIEVE)
        .all(is_row)
}

pub(crate) fn holds(data: &[u8], byte: u8) -> bool {
    memchr::memchr(byte, data).is_some()
}

/// True where a comma separated file writes its decimal commas in quotes.
fn quoted_commas(data: &[u8]) -> bool {
    holds(data, b'"') && !holds(data, b'.')
}

/// Lines up to the title of the last section, where a file has titled sections (`*** Results ***`, as Setitec's drilling units write
/// them): tables of settings come first, what was recorded comes last. Leaves `lines` behind that title.
fn last_section(lines: &mut Lines) -> Vec<String> {
    let is_title = |line: &[u8]| {
        let line = line.trim_ascii();
        line.len() > 6 && line.starts_with(b"***") && line.ends_with(b"***")
    };
    if !lines.clone().next().is_some_and(is_title) {
        return Vec::new();
    }
    let titles = lines.clone().take(HEADER_LINES_AT_MOST).enumerate();
    let last = titles.filter(|(_, line)| is_title(line)).last();
    let count = last.map_or(0, |(at, _)| at + 1);
    lines.take(count).map(decode).collect()
}

fn find_delimiter(names: Option<&str>, first_row: &str, data: &[u8]) -> Delimiter {
    let first_row = first_row.trim();
    if let Some(byte) = [b';', b'\t']
        .into_iter()
        .find(|b| first_row.contains(char::from(*b)))
    {
        return Delimiter::Byte(byte);
    }
    let names = names.filter(|n| n.contains([';', '\t', ',']));
    // `1,5 2,5` are decimal commas between blanks, `1.5, 2.5` points between commas.
    let comma_between = match names {
        Some(names) => names.contains(','),
        None => first_row.contains(", ") || !first_row.contains(' ') || holds(data, b'.'),
    };
    if first_row.contains(',') && comma_between {
        Delimiter::Byte(b',')
    } else {
        Delimiter::Blanks
    }
}

/// Fields of a line, trimmed, without quotes and without an empty last one.
pub(crate) fn split_line(line: &str, delimiter: Delimiter) -> Vec<String> {
    let clean = |field: &str| field.trim().trim_matches('"').trim().to_owned();
    match delimiter {
        Delimiter::Blanks => {
            // `Time [s]` is one name.
            let mut fields: Vec<String> = Vec::new();
            for word in line.split_whitespace().map(|w| clean(w.trim_end_matches(','))) {
                match fields.last_mut() {
                    Some(last) if word.starts_with(['[', '(']) => {
                        last.push(' ');
                        last.push_str(&word);
                    }
                    _ => fields.push(word),
                }
            }
            fields
        }
        Delimiter::Byte(byte) if line.contains('"') => {
            let mut reader = csv::ReaderBuilder::new()
                .delimiter(byte)
                .has_headers(false)
                .from_reader(line.as_bytes());
            let record = reader.records().next().and_then(Result::ok).unwrap_or_default();
            without_last_empty(record.iter().map(clean).collect())
        }
        Delimiter::Byte(byte) => without_last_empty(line.split(char::from(byte)).map(clean).collect()),
    }
}

fn without_last_empty(mut fields: Vec<String>) -> Vec<String> {
    if fields.len() > 1 && fields.last().is_some_and(String::is_empty) {
        fields.pop();
    }
    fields
}
