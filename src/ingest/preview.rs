//! Tables whose columns have no names, or names that say nothing: what is in them, and what to write so that they become forces.

use std::io::Read;
use std::path::Path;

use super::text::{Notes, is_binary, without_byte_order_mark};
use super::units;
use crate::data::Channel;
use crate::ingest::formats::force;
use crate::ingest::tables::table::Header;
use crate::{Error, Result};

/// Rows that are looked at; [`PlainColumn::how_far`] tells it.
const ROWS: usize = 2000;
/// Columns that are described one by one.
const SHOWN: usize = 12;
/// More columns than any recorder has channels: rows and columns may be exchanged.
const MANY: usize = 200;
/// Bytes read of a file to see them.
const START: u64 = 1 << 20;

/// A column of such a table, as its first rows show it.
#[derive(Debug, Clone, PartialEq)]
pub struct PlainColumn {
    /// What the file calls it; `None` in a table without names.
    pub name: Option<String>,
    /// Least and greatest value, in the unit of the file.
    pub range: [f64; 2],
    /// Step of the first column where it rises evenly, as times do; in the unit of the file.
    pub step: Option<f64>,
    /// Each value is above the one before.
    pub rises: bool,
    /// It has a name and knows two values only: a label or a trigger, no signal. (Without a name it may be a quiet channel.)
    pub is_state: bool,
    /// Rows that were looked at.
    pub rows: usize,
}

impl PlainColumn {
    fn of(name: Option<&String>, values: &[f64], is_first: bool) -> PlainColumn {
        let even = || -> Option<f64> {
            let [first, .., last] = values else { return None };
            let step = (last - first) / (values.len() - 1) as f64;
            let is_even = values
                .iter()
                .enumerate()
                .all(|(i, v)| (first + i as f64 * step - v).abs() <= 0.51 * step);
            (step > 0.0 && values.len() > 3 && is_even).then_some(step)
        };
        let (low, high) = values
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
                (a.min(*v), b.max(*v))
            });
        PlainColumn {
            name: name.cloned(),
            range: [low, high],
            step: even().filter(|_| is_first),
            rises: values.is_sorted_by(|a, b| a < b),
            is_state: name.is_some() && is_state(values),
            rows: values.len(),
        }
    }

    /// A channel of a file that says its times.
    pub fn of_channel(channel: &Channel) -> PlainColumn {
        let seen = channel.samples.len().min(ROWS);
        PlainColumn::of(Some(&channel.name), &channel.samples[..seen], false)
    }

    /// Does it count the rows (or milliseconds)? Then it is no time in seconds, and the rate must be said.
    pub fn counts(&self) -> bool {
        self.step == Some(1.0) && self.range[0].fract() == 0.0
    }

    /// Is it the times of the samples?
    pub fn is_clock(&self) -> bool {
        self.step.is_some() && !self.counts()
    }

    /// That only the file's start was looked at, where it is longer: a cut that begins later is not in the range.
    pub fn how_far(&self) -> String {
        match self.rows >= ROWS {
            true => format!(" in the first {ROWS} rows"),
            false => String::new(),
        }
    }

    /// `rises by 0.0001 (time?)`, `-0.12 to 3.4`.
    pub fn describe(&self) -> String {
        match self.step {
            Some(_) if self.counts() => "counts the rows, or milliseconds".to_owned(),
            Some(step) => format!("rises by {} (time?)", units::figures(step, 4)),
            None => format!(
                "{} to {}",
                units::figures(self.range[0], 4),
                units::figures(self.range[1], 4)
            ),
        }
    }
}

/// Values that a state takes, at most, and rows from which so few cannot be chance.
const STATES: usize = 2;
const ROWS_FOR_STATES: usize = 500;

fn is_state(values: &[f64]) -> bool {
    let mut states: Vec<f64> = Vec::new();
    values.len() >= ROWS_FOR_STATES
        && values.iter().all(|v| {
            if !states.contains(v) {
                states.push(*v);
            }
            states.len() <= STATES
        })
}

/// Signals in the order in which recorders write them.
pub const SIGNALS: [&str; 4] = ["fx", "fy", "fz", "mz"];

/// What each column of a force record is taken for, with its place from 1: a clock for `time`, one that counts for nothing, all else
/// for [`SIGNALS`] in their order. Ends where these do; where there are more columns than these, what follows the three forces is as
/// likely an accelerometer as a torque.
pub fn taken_for(columns: &[PlainColumn]) -> impl Iterator<Item = (usize, &PlainColumn, &'static str)> {
    let count = columns.iter().filter(|c| c.step.is_none() && !c.is_state).count();
    let mut signals = SIGNALS
        .into_iter()
        .take(if count > SIGNALS.len() { 3 } else { SIGNALS.len() });
    let own = columns
        .iter()
        .enumerate()
        .filter(|(_, c)| !c.counts() && !c.is_state);
    own.map_while(move |(i, column)| {
        let name = if column.is_clock() {
            "time"
        } else {
            signals.next()?
        };
        Some((i + 1, column, name))
    })
}

/// The columns of a file that is a table of numbers without times, or without names at all; `None` for all else.
///
/// # Errors
/// The operating system's.
pub fn plain_columns(path: &Path) -> Result<Option<Vec<PlainColumn>>> {
    let refused = |e| Error::io(path, e);
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).map_err(refused)?;
    file.take(START).read_to_end(&mut bytes).map_err(refused)?;
    let text = without_byte_order_mark(&bytes);
    let whole = memchr::memrchr(b'\n', &text).map_or(text.len(), |at| at + 1);
    if is_binary(&text) {
        return Ok(None);
    }
    let is_plain = |header: &Header| header.names.is_empty() || !force::is_time_table(header);
    let found = Header::find(&text[..whole]).filter(is_plain);
    Ok(found.map(|header| columns(&text[..whole], &header)))
}

/// What the first rows show; empty where they cannot be read.
pub(super) fn columns(bytes: &[u8], header: &Header) -> Vec<PlainColumn> {
    let end = memchr::memchr_iter(b'\n', &bytes[header.data_at..])
        .nth(ROWS)
        .map_or(bytes.len(), |at| header.data_at + at + 1);
    let table = header.read(&bytes[..end], None, &mut Notes::default());
    let columns = table.map_or_else(|_| Vec::new(), |t| t.columns);
    let of = |(i, values): (usize, &Vec<f64>)| PlainColumn::of(header.names.get(i), values, i == 0);
    columns.iter().enumerate().map(of).collect()
}

/// The lines of `campaign.toml` that make forces of the columns.
fn channel_lines(columns: &[PlainColumn]) -> String {
    let mut lines = String::new();
    let mut has_time = false;
    for (place, column, name) in taken_for(columns) {
        let source = match &column.name {
            Some(own) => format!("in_file = {own:?}"),
            None => format!("column = {place}"),
        };
        let gain = match column.is_clock() {
            true => "unit = \"s\"",
            false => "unit = \"V\"\ngain = \"500 N/V\"",
        };
        has_time |= column.is_clock();
        lines += &format!("\n[[channel]]\nname = \"{name}\"\n{source}\n{gain}");
        if !has_time {
            lines += "\nrate_hz = 10000.0";
            has_time = true;
        }
    }
    lines
}

/// For columns whose names say nothing: the lines of `campaign.toml` that make forces of them, where they may be such.
pub(super) fn lines_for_names(bytes: &[u8], header: &Header) -> Option<String> {
    let columns = columns(bytes, header);
    let signals = columns.iter().filter(|c| c.step.is_none() && !c.is_state).count();
    let may_be = (1..=SHOWN).contains(&signals) && columns.iter().all(|c| !c.rises || c.step.is_some());
    may_be.then(|| channel_lines(&columns))
}

/// What a table without names holds, and the lines of `campaign.toml` that give it names.
pub(super) fn preview(bytes: &[u8], header: &Header) -> (String, String) {
    let columns = columns(bytes, header);
    let seen = columns.iter().enumerate();
    let seen: Vec<String> = seen
        .map(|(i, column)| format!("{}: {}", i + 1, column.describe()))
        .collect();
    let lines = channel_lines(&columns);
    let more = match seen.len().saturating_sub(SHOWN) {
        0 => String::new(),
        n => format!("; and {n} more"),
    };
    let what = format!(
        "{} columns of numbers without names ({}{more}{})",
        header.columns,
        seen[..seen.len().min(SHOWN)].join("; "),
        columns.first().map_or_else(String::new, PlainColumn::how_far)
    );
    let rows = columns.first().map_or(0, |c| c.rows);
    let turned = if header.columns > MANY && header.columns > 10 * rows {
        format!(
            "{rows} rows of {} numbers are one row a channel: exchange rows and columns first (one row a sample); then ",
            header.columns
        )
    } else {
        String::new()
    };
    let remedy = format!(
        "{turned}put a line of column names on top (frequency_hz,re,im for an FRF; time_s,force_n,acc_m_per_s2 for a tap test; \
         time_s,fx_n,fy_n,fz_n for cutting forces), or, for cutting forces, say in campaign.toml what they are (`lobestone init` \
         writes and asks it), such as{lines}"
    );
    (what, remedy)
}
