//! Rows of decimal commas between commas: `0,0001,0,013079,-0,000435965,12`. A value takes one token (whole
//! numbers, the bare `0`) or two, so the token count varies from row to row.
//!
//! Every way to cut a row into the right number of values is weighed: the time must be what the sampling rate
//! says, the other channels should stay near their last value. Dynamic programming over tokens and channels keeps
//! the two best ways; where the second is nearly as good the row is reported.

use crate::InputError;
use crate::ingest::tables::number;
use crate::ingest::tables::table::{Header, Table};
use crate::ingest::text::{Lines, Notes, decode};

/// Two cuts whose costs differ by less (in standard deviations of a channel) cannot be told apart.
const MARGIN: f64 = 2.0;
/// Weight of a time error of one sampling interval, in the same measure.
const TIME_WEIGHT: f64 = 1e3;
/// Work grows with the square of the channels.
const CHANNELS_AT_MOST: usize = 64;
/// Against a bare whole number other than 0, and against a fraction that ends in 0: programs that print a bare `0`
/// strip trailing zeros, and measured values are hardly ever whole.
const UNLIKELY: f64 = 3.0;

pub(crate) fn read(
    data: &[u8],
    header: &Header,
    rate_hz: Option<f64>,
    notes: &mut Notes,
) -> Result<Table, InputError> {
    let channels = header.columns;
    let mut columns: Vec<Vec<f64>> = vec![Vec::new(); channels];
    if channels > CHANNELS_AT_MOST {
        return Err(
            InputError::new(format!("{channels} columns of decimal commas between commas"))
                .line(header.data_line)
                .remedy("export with a semicolon or tab between the columns, or with a decimal point"),
        );
    }
    let usual = usual_values(data, channels);
    let step = rate_hz.map(|rate| 1.0 / rate);
    let mut previous: Vec<f64> = Vec::new();
    let mut unsure = Vec::new();
    let mut lines = Lines::new(data);
    while let Some(line) = lines.next() {
        if line.trim_ascii().is_empty() {
            continue;
        }
        let tokens = tokens(line);
        // Time goes on by one step; without a sampling rate it only has to stay near.
        let cost = |channel: usize, value: f64, unlikely: bool| {
            let (mean, spread) = usual[channel];
            match (previous.get(channel), channel, step) {
                (None, 0, _) => 0.0,
                (Some(last), 0, Some(step)) => TIME_WEIGHT * ((value - last) / step - 1.0).abs(),
                (last, ..) => {
                    let far = (value - last.unwrap_or(&mean)).abs() / spread;
                    far + if unlikely && channel > 0 { UNLIKELY } else { 0.0 }
                }
            }
        };
        let Some(cut) = cut(&tokens, channels, cost) else {
            if lines.rest().trim_ascii().is_empty() && !previous.is_empty() {
                notes.file("the last row is incomplete and left out");
                break;
            }
            return Err(InputError::new(format!(
                "cannot be cut into {channels} numbers with decimal commas: {:?}",
                decode(line).chars().take(80).collect::<String>()
            ))
            .line(header.data_line + lines.number - 1)
            .remedy("export with a semicolon or tab between the columns, or with a decimal point"));
        };
        if cut.margin < MARGIN {
            unsure.push(header.data_line + lines.number - 1);
        }
        columns
            .iter_mut()
            .zip(&cut.values)
            .for_each(|(column, value)| column.push(*value));
        previous = cut.values;
    }
    notes.file("decimal commas between commas: rows were cut by the time step and by continuity");
    if let Some(first) = unsure.first() {
        notes.file(format!(
            "{} rows can be cut in more than one way that fits (the first is line {first}): export with semicolons",
            unsure.len()
        ));
    }
    Ok(Table { columns })
}

fn tokens(line: &[u8]) -> Vec<&[u8]> {
    let line = line.trim_ascii();
    line.strip_suffix(b",")
        .unwrap_or(line)
        .split(|b| *b == b',')
        .map(|t| t.trim_ascii())
        .collect()
}

/// Mean and spread of each channel over the rows that can be cut in one way only; 0 and 1 where there are none.
fn usual_values(data: &[u8], channels: usize) -> Vec<(f64, f64)> {
    let mut sums = vec![(0.0_f64, 0.0_f64, 0.0_f64); channels];
    for line in Lines::new(data).take(20_000) {
        let Some(cut) = cut(&tokens(line), channels, |_, _, _| 0.0).filter(|c| c.margin == f64::INFINITY)
        else {
            continue;
        };
        for ((n, sum, squares), value) in sums.iter_mut().zip(cut.values) {
            *n += 1.0;
            *sum += value;
            *squares += value * value;
        }
    }
    let usual = |(n, sum, squares): (f64, f64, f64)| {
        let mean = sum / n;
        let spread = (squares / n - mean * mean).max(0.0).sqrt();
        if spread > 0.0 && spread.is_finite() {
            (mean, spread)
        } else {
            (0.0, 1.0)
        }
    };
    sums.into_iter().map(usual).collect()
}

struct Cut {
    values: Vec<f64>,
    /// Cost of the second best cut above the best; infinite where there is one cut only.
    margin: f64,
}

/// One of the two best ways to have cut some tokens into some channels.
#[derive(Clone, Copy)]
struct Way {
    cost: f64,
    value: f64,
    tokens_used: usize,
    /// Which of the two ways before it.
    rank: usize,
}

fn cut(tokens: &[&[u8]], channels: usize, cost: impl Fn(usize, f64, bool) -> f64) -> Option<Cut> {
    if tokens.len() < channels || tokens.len() > 2 * channels {
        return None;
    }
    // ways[c][t]: the best ways to make channels 0..c of tokens 0..t.
    let width = tokens.len() + 1;
    let mut ways: Vec<Vec<Way>> = vec![Vec::new(); (channels + 1) * width];
    ways[0].push(Way {
        cost: 0.0,
        value: 0.0,
        tokens_used: 0,
        rank: 0,
    });
    for channel in 0..channels {
        for at in channel..=(2 * channel).min(tokens.len()) {
            let here = ways[channel * width + at].clone();
            if here.is_empty() {
                continue;
            }
            for used in 1..=2 {
                let Some(part) = tokens.get(at..at + used) else {
                    continue;
                };
                let Some(value) = value_of(part) else { continue };
                let own = cost(channel, value, is_unlikely(part));
                let there = &mut ways[(channel + 1) * width + at + used];
                for (rank, way) in here.iter().enumerate() {
                    there.push(Way {
                        cost: way.cost + own,
                        value,
                        tokens_used: used,
                        rank,
                    });
                }
                there.sort_by(|a, b| a.cost.total_cmp(&b.cost));
                there.truncate(2);
            }
        }
    }
    let ends = &ways[channels * width + tokens.len()];
    let best = ends.first()?;
    let margin = ends
        .get(1)
        .map_or(f64::INFINITY, |second| second.cost - best.cost);
    let mut values = vec![0.0; channels];
    let (mut at, mut rank) = (tokens.len(), 0);
    for channel in (0..channels).rev() {
        let way = ways[(channel + 1) * width + at].get(rank)?;
        values[channel] = way.value;
        at -= way.tokens_used;
        rank = way.rank;
    }
    Some(Cut { values, margin })
}

fn is_unlikely(part: &[&[u8]]) -> bool {
    match part {
        [whole] => *whole != b"0" && !whole.contains(&b'e') && !whole.contains(&b'E'),
        [_, fraction] => fraction.ends_with(b"0"),
        _ => false,
    }
}

/// The number of one token (`-12`, `0`, `1e-05`) or two (`-0` and `000435965`).
fn value_of(part: &[&[u8]]) -> Option<f64> {
    let [whole, fraction @ ..] = part else { return None };
    let digits = whole
        .strip_prefix(b"-")
        .or(whole.strip_prefix(b"+"))
        .unwrap_or(whole);
    // `013079` can only be a fraction: whole numbers have no leading zeros.
    if !digits.first()?.is_ascii_digit()
        || (digits.len() > 1 && digits[0] == b'0' && digits[1].is_ascii_digit())
    {
        return None;
    }
    match fraction {
        [] => number::field(whole, b'.'),
        [fraction] => {
            if !digits.iter().all(u8::is_ascii_digit) || !fraction.first()?.is_ascii_digit() {
                return None;
            }
            let mut joined = whole.to_vec();
            joined.push(b'.');
            joined.extend_from_slice(fraction);
            number::field(&joined, b'.')
        }
        _ => None,
    }
    .filter(|v| v.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// `%g`-like with a decimal comma: six digits, no trailing zeros.
    fn print(value: f64) -> String {
        let text = format!("{:.6}", value);
        let text = text.trim_end_matches('0').trim_end_matches('.');
        if text == "-0" {
            "0".into()
        } else {
            text.replace('.', ",")
        }
    }

    fn table(rows: &[[f64; 3]]) -> (Vec<Vec<f64>>, Vec<String>) {
        let mut text = String::from("Time,Fx,Fy,Fz\ns,N,N,N\n");
        for (i, row) in rows.iter().enumerate() {
            let time = format!("{:.6}", i as f64 / 1e4).replace('.', ",");
            text += &format!("{time},{},{},{}\n", print(row[0]), print(row[1]), print(row[2]));
        }
        let header = Header::find(text.as_bytes()).unwrap();
        assert!(header.decimal_comma_between_commas);
        let mut notes = Notes::default();
        let table = header.read(text.as_bytes(), Some(1e4), &mut notes).unwrap();
        (table.columns, notes.into_warnings())
    }

    #[test]
    fn bare_zeros_among_fractions() {
        let rows = [
            [0.0, 0.013079, -0.000435],
            [0.1, 0.0, 0.25],
            [0.12, 0.02, 0.3],
            [-0.3, 0.0, 0.0],
            [0.5, 1.2, -1.25],
        ];
        let (columns, warnings) = table(&rows);
        for (i, row) in rows.iter().enumerate() {
            assert_eq!([columns[1][i], columns[2][i], columns[3][i]], *row, "row {i}");
        }
        assert_eq!(warnings.len(), 1, "{warnings:?}");
    }

    #[test]
    fn a_row_that_fits_two_ways_is_reported() {
        // `1,2,3,4,5`: (1.2, 3.4, 5), (1.2, 3, 4.5) or (1, 2.3, 4.5), all near the row before.
        let (columns, warnings) = table(&[[9.5, -9.4, 9.5], [1.1, 3.1, 4.8], [1.2, 3.4, 5.0]]);
        assert_eq!(columns[0].len(), 3);
        assert!(
            warnings.iter().any(|w| w.contains("more than one way")),
            "{warnings:?}"
        );
    }

    proptest! {
        #[test]
        fn continuous_signals_come_back(phase in 0.0..6.0_f64, scale in 0.5..3.0_f64) {
            let rows: Vec<[f64; 3]> = (0..200).map(|i| {
                let t = phase + 0.02 * f64::from(i);
                // Measured values are hardly ever whole: where they are, a row is ambiguous and reported.
                let round = |v: f64| Some((v * 1e6).round() / 1e6).filter(|r| r.fract() != 0.0).unwrap_or(0.5);
                let gate = if i % 17 == 0 { 0.0 } else { 1.0 };
                [round(scale * t.sin()), gate * round(0.1 * t.cos()), round(-scale * t.cos())]
            }).collect();
            let (columns, _) = table(&rows);
            for (i, row) in rows.iter().enumerate() {
                for (c, value) in row.iter().enumerate() {
                    prop_assert!((columns[c + 1][i] - value).abs() < 1e-9, "row {} channel {}", i, c);
                }
            }
        }

        #[test]
        fn never_panics(text in "[0-9,e-]{0,40}") {
            let _ = cut(&tokens(text.as_bytes()), 4, |_, v, _| v.abs());
        }
    }
}
