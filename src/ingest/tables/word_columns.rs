//! Tables that have columns of words beside their numbers: the state of a machine, a label, a remark.

use crate::ingest::tables::number;
use crate::ingest::text::{self, Lines};

/// Rows that a table has at least.
const LEAST_ROWS: usize = 5;
/// Lines that its names stand in, at most.
const MOST_LINES_ABOVE: usize = 200;

/// The text without the columns that hold no number in any row, and what is to be told of them; `None` where there is no such table,
/// or where a column holds now a number, now words: that is a fault, and no reason to leave the column out.
pub(crate) fn without_words(bytes: &[u8]) -> Option<(Vec<u8>, String)> {
    let lines: Vec<&[u8]> = Lines::new(bytes).collect();
    [b'\t', b';', b','].into_iter().find_map(|delimiter| {
        let names_at = names_line(&lines, delimiter)?;
        without_words_by(&lines, names_at, delimiter)
    })
}

fn fields(line: &[u8], delimiter: u8) -> impl Iterator<Item = &[u8]> {
    line.split(move |b| *b == delimiter).map(<[u8]>::trim_ascii)
}

fn is_number(field: &[u8], delimiter: u8) -> bool {
    let is = |decimal| number::field(field, decimal).is_some();
    is(b'.') || delimiter != b',' && is(b',')
}

/// The line of names: as many fields as each of the rows below it, none of them a number.
fn names_line(lines: &[&[u8]], delimiter: u8) -> Option<usize> {
    let count = |line: &[u8]| fields(line, delimiter).count();
    (0..lines.len().min(MOST_LINES_ABOVE)).find(|&at| {
        let columns = count(lines[at]);
        let rows = lines.get(at + 1..at + 1 + LEAST_ROWS);
        columns > 2
            && fields(lines[at], delimiter).all(|f| !f.is_empty() && !is_number(f, delimiter))
            && rows.is_some_and(|rows| rows.iter().all(|row| count(row) == columns))
    })
}

fn without_words_by(lines: &[&[u8]], names_at: usize, delimiter: u8) -> Option<(Vec<u8>, String)> {
    let names: Vec<&[u8]> = fields(lines[names_at], delimiter).collect();
    let end = lines.iter().rposition(|l| !l.trim_ascii().is_empty())? + 1;
    let rows = &lines[names_at + 1..end];
    let (mut numbers, mut words) = (vec![0; names.len()], vec![0; names.len()]);
    for row in rows {
        let mut count = 0;
        for (column, field) in fields(row, delimiter).enumerate() {
            count += 1;
            if column < names.len() && !field.is_empty() {
                let is_number = is_number(field, delimiter);
                numbers[column] += usize::from(is_number);
                words[column] += usize::from(!is_number);
            }
        }
        if count != names.len() {
            return None;
        }
    }
    let is_mixed = |(n, w): (&usize, &usize)| *n > 0 && *w > 0;
    let kept: Vec<bool> = numbers.iter().map(|n| *n > 0).collect();
    let left_out: Vec<String> = names
        .iter()
        .zip(&kept)
        .filter(|(_, kept)| !**kept)
        .map(|(name, _)| text::decode(name))
        .collect();
    if numbers.iter().zip(&words).any(is_mixed)
        || left_out.is_empty()
        || kept.iter().filter(|kept| **kept).count() < 2
    {
        return None;
    }
    let mut without = Vec::new();
    for (at, line) in lines[..end].iter().enumerate() {
        if at < names_at {
            without.extend_from_slice(line);
        } else {
            let own = line
                .split(|b| *b == delimiter)
                .zip(&kept)
                .filter(|(_, kept)| **kept);
            let own: Vec<&[u8]> = own.map(|(field, _)| field).collect();
            without.extend(own.join(&delimiter));
        }
        without.push(b'\n');
    }
    let told = match left_out.as_slice() {
        [one] => format!("column {one} holds no numbers and is left out"),
        many => format!("columns {} hold no numbers and are left out", many.join(", ")),
    };
    Some((without, told))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_words_go_and_lines_stay_where_they_were() {
        let rows: String = (0..6).map(|i| format!("run A;0,00{i};{i},5;cut;\n")).collect();
        let text = format!("Messung;17\nlabel;time_s;fx_n;state;remark\n{rows}");
        let (without, told) = without_words(text.as_bytes()).unwrap();
        let without = String::from_utf8(without).unwrap();
        assert!(
            without.starts_with("Messung;17\ntime_s;fx_n\n0,000;0,5\n0,001;1,5\n"),
            "{without}"
        );
        assert_eq!(
            told,
            "columns label, state, remark hold no numbers and are left out"
        );
    }

    #[test]
    fn a_damaged_number_is_no_column_of_words() {
        let table = |bad: &str| format!("time_s,fx_n,fy_n\n0,1,2\n1,{bad},2\n2,1,2\n3,1,2\n4,1,2\n5,1,2\n");
        assert_eq!(without_words(table("12.x").as_bytes()), None);
        // Nothing to leave out, no names, and rows of different lengths.
        assert_eq!(without_words(table("1").as_bytes()), None);
        assert_eq!(without_words(b"0,1,a\n1,1,a\n2,1,a\n3,1,a\n4,1,a\n5,1,a\n"), None);
        assert_eq!(
            without_words(b"t,x,s\n0,1,a\n1,1,a\n2,1,a\n3,1,a\n4,1,a\n5,1\n"),
            None
        );
        assert_eq!(without_words(b""), None);
    }
}
