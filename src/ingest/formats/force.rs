//! Time records from text: DynoWare exports and plain force tables. Channel roles, units, time axis.

use crate::InputError;
use crate::data::{Channel, ChannelRole, TimeRecord};
use crate::ingest::checks;
use crate::ingest::tables::channel_names::{self, force_without_gain, role_of, split_unit, unit_label};
use crate::ingest::tables::clock;
use crate::ingest::tables::number;
use crate::ingest::tables::table::{Header, Table};
use crate::ingest::text::Notes;
use crate::ingest::units::{self, Dimension, Unit};

mod time_axis;

use crate::ingest::formats::force::time_axis::{Clock, Lost, Runs, fill, refused, time_axis, time_unit};

/// True where the table is a time record: a time column, or a sampling rate above it.
pub(crate) fn is_time_table(header: &Header) -> bool {
    time_column(header).is_some() || (!header.names.is_empty() && sampling_rate(header).is_some())
}

/// Reads the rows and makes them a time record in SI.
pub(crate) fn read(bytes: &[u8], header: &Header, notes: &mut Notes) -> Result<TimeRecord, InputError> {
    let bytes = first_cycle(bytes, header, notes);
    let mut pieces = Pieces::new(bytes, header.clone(), true);
    let table = header.read(bytes, pieces.rate, notes)?;
    let record = pieces.next(table, header.data_line, notes)?;
    pieces.finish(notes);
    Ok(record)
}

/// DynoWare writes the cycles of a triggered recording below one another, each under a line of its own: the first is read, and
/// it is told. They are not one record, for there may be any time between them.
fn first_cycle<'b>(bytes: &'b [u8], header: &Header, notes: &mut Notes) -> &'b [u8] {
    let rows = bytes.get(header.data_at..).unwrap_or_default();
    let starts = |word: &str| -> Vec<usize> {
        memchr::memmem::find_iter(rows, format!("\n{word}").as_bytes()).collect()
    };
    let cycles = [starts("Cycle No"), starts("Zyklus Nr")].concat();
    let Some(first) = cycles.iter().min() else {
        return bytes;
    };
    notes.file(format!(
        "{} cycles in one file: the first is read, {} left out; export each to a file of its own",
        cycles.len() + 1,
        cycles.len()
    ));
    &bytes[..header.data_at + first + 1]
}

/// A table of time signals that is read piece by piece: what one piece has to know of those before it.
pub(crate) struct Pieces {
    pub header: Header,
    /// Of the header lines.
    rate: Option<f64>,
    resolution_s: f64,
    clock: Option<Clock>,
    /// Last row of the piece before, time included.
    last: Vec<f64>,
    samples: usize,
    lost: Lost,
    /// There is one piece only.
    is_whole: bool,
    /// Puts right the unit of the time column.
    time_unit: Option<f64>,
    /// Memory of columns that nobody needs any more.
    pub spare: Vec<Vec<f64>>,
}

impl Pieces {
    /// `head`: the file's beginning, with the first rows.
    pub fn new(head: &[u8], header: Header, is_whole: bool) -> Self {
        let resolution_s = time_column(&header).map_or(0.0, |at| {
            time_resolution(head, &header, at) * time_factor(&header, at)
        });
        Pieces {
            rate: sampling_rate(&header),
            resolution_s,
            clock: None,
            last: Vec::new(),
            samples: 0,
            lost: Lost::default(),
            is_whole,
            time_unit: None,
            spare: Vec::new(),
            header,
        }
    }

    /// The next rows as a record of their own; they begin at line `first_line`.
    pub fn next(
        &mut self,
        mut table: Table,
        first_line: usize,
        notes: &mut Notes,
    ) -> Result<TimeRecord, InputError> {
        let header = &self.header;
        check_numbers(&table, header, first_line)?;
        let time_at = time_column(header);
        if let Some(at) = time_at {
            let factor = time_factor(header, at);
            scale(&mut table.columns[at], factor);
            let seconds = &table.columns[at];
            let again = match self.time_unit {
                Some(again) => again,
                None => {
                    let again = time_unit(seconds, self.resolution_s, factor, self.rate, header, notes)?;
                    self.resolution_s *= again;
                    again
                }
            };
            self.time_unit = Some(again);
            scale(&mut table.columns[at], again);
        }
        let rows = table.columns.iter().map(Vec::len).max().unwrap_or(0);
        if self.clock.is_none() && rows < 2 {
            return Err(InputError::new("a time record of less than two samples").line(header.data_line));
        }
        let clock = match (self.clock, time_at) {
            (Some(clock), Some(at)) if clock.rounding_s.is_some() && rows > 2 => {
                let runs = Runs::find(&table.columns[at], self.resolution_s);
                let same = (runs.step_s * clock.rate_hz - 1.0).abs() <= 1e-3 + 2.0 * runs.rounding;
                if !(same && runs.are_even(&table.columns[at])) {
                    return Err(refused(
                        "steps that change, in a file too long to be resampled at once",
                        header,
                    ));
                }
                clock
            }
            (Some(clock), _) => clock,
            (None, Some(at)) => {
                let seconds = &table.columns[at];
                time_axis(
                    seconds,
                    self.resolution_s,
                    self.rate,
                    header,
                    self.is_whole,
                    notes,
                )?
            }
            (None, None) => {
                let rate_hz = self.rate.ok_or_else(|| no_time(header))?;
                notes.file("no time column: time from the sampling rate, starting at 0 s");
                Clock {
                    rate_hz,
                    start_s: 0.0,
                    rounding_s: None,
                    grid: None,
                }
            }
        };
        checks::plausible_clock("time", clock.rate_hz, clock.start_s)
            .map_err(|e| e.line(header.data_line))?;
        self.clock = Some(clock);
        // The last row of the piece before, so that a gap between pieces is one too.
        let overlap = usize::from(!self.last.is_empty());
        let next_last: Vec<f64> = table.columns.iter().filter_map(|c| c.last().copied()).collect();
        let last = std::mem::take(&mut self.last);
        if let (Some(at), [_, ..]) = (time_at, last.as_slice()) {
            table.columns[at].insert(0, last[at]);
        }
        self.last = if next_last.is_empty() {
            last.clone()
        } else {
            next_last
        };
        let gaps = match (time_at, clock.rounding_s, clock.grid) {
            (Some(at), Some(rounding_s), None) => self
                .lost
                .look(&table.columns[at], 1.0 / clock.rate_hz, rounding_s)
                .map_err(|problem| refused(&problem, header))?,
            _ => Vec::new(),
        };
        let mut filled = Vec::new();
        let times_column = time_at.map(|at| std::mem::take(&mut table.columns[at]));
        let columns = table.columns.into_iter().enumerate();
        let mut channels = columns
            .filter(|(i, _)| Some(*i) != time_at)
            .map(|(i, mut values)| {
                if let (Some(times), Some(grid)) = (&times_column, clock.grid) {
                    return channel(header, i, clock::resample(times, &values, grid), notes);
                }
                if !gaps.is_empty() {
                    values.splice(0..0, last.get(i).copied());
                    filled = fill(&mut values, &gaps);
                    values.drain(..overlap.min(values.len()));
                }
                channel(header, i, values, notes)
            })
            .collect::<Result<Vec<Channel>, _>>()?;
        self.spare.extend(times_column);
        if channels.is_empty() {
            return Err(InputError::new("a time column and no channel beside it").line(header.data_line));
        }
        filled
            .iter_mut()
            .for_each(|r| *r = r.start - overlap..r.end - overlap);
        channel_names::settle(&mut channels, notes);
        let mut seen: Vec<ChannelRole> = Vec::new();
        for channel in channels.iter().filter(|c| c.role != ChannelRole::Other) {
            if seen.contains(&channel.role) {
                notes.about(
                    &channel.name,
                    "a second channel for the same force: the first one is used",
                );
            }
            seen.push(channel.role);
        }
        let record = TimeRecord {
            sample_rate_hz: clock.rate_hz,
            start_s: clock.start_s + self.samples as f64 / clock.rate_hz,
            channels,
            filled,
        };
        self.samples += record.len();
        Ok(record)
    }

    /// What the time column showed over all pieces.
    pub fn finish(&self, notes: &mut Notes) {
        self.lost.tell(notes);
    }
}

/// Seconds, as most times are printed, are left alone.
fn scale(times: &mut [f64], factor: f64) {
    if factor != 1.0 {
        times.iter_mut().for_each(|t| *t *= factor);
    }
}

fn time_factor(header: &Header, at: usize) -> f64 {
    let unit = column_unit(header, at).filter(|u| u.dimension == Dimension::TIME);
    unit.map_or(1.0, |u| u.factor)
}

fn no_time(header: &Header) -> InputError {
    InputError::new("no time column and no sampling rate")
        .line(header.data_line.saturating_sub(1).max(1))
        .remedy("name a column `time_s` or add a line `Sampling rate [Hz]:,10000` above the names")
}

fn check_numbers(table: &Table, header: &Header, first_line: usize) -> Result<(), InputError> {
    for (i, column) in table.columns.iter().enumerate() {
        if let Some(row) = checks::first_that_is_not(column, f64::is_finite) {
            let name = header
                .names
                .get(i)
                .map_or_else(|| format!("column {}", i + 1), |n| format!("channel {n}"));
            return Err(InputError::new(format!(
                "{name} has no valid number in data row {}",
                first_line - header.data_line + row + 1
            ))
            .line(first_line + row)
            .remedy(
                "a record with missing samples cannot be used: export it again or cut the row range out",
            ));
        }
    }
    Ok(())
}

fn time_column(header: &Header) -> Option<usize> {
    let by_name = header.names.iter().position(|name| channel_names::is_time(name));
    // A first column in seconds or milliseconds is the time, whatever language its name is in.
    by_name.or_else(|| {
        let first = column_unit(header, 0).is_some_and(|u| u.dimension == Dimension::TIME);
        (first && header.names.len() > 1).then_some(0)
    })
}

/// Keys of the sampling rate in header lines, parts of a key in small letters.
const RATES: [&str; 15] = [
    "sampling rate",
    "sample rate",
    "samplerate",
    "samplingrate",
    "sampling frequency",
    "sample frequency",
    "sampling_rate",
    "sample_rate",
    "sampling_frequency",
    "abtastrate",
    "abtastfrequenz",
    "messrate",
    "frecuencia de muestreo",
    "d'échantillonnage",
    "采样频率",
];
/// Keys of the sampling interval.
const INTERVALS: [&str; 14] = [
    "sampling interval",
    "sample interval",
    "sampling_interval",
    "sample_interval",
    "sampling period",
    "sample period",
    "time interval",
    "time step",
    "timestep",
    "delta t",
    "delta_t",
    "abtastintervall",
    "intervalo de muestreo",
    "采样间隔",
];

/// `Sampling rate [Hz]:,10000`, `# fs = 5 kHz`, `dt,0.0002`, `Sample interval [ms];0,2` and their relatives, Hz; also in a table of
/// settings above the rows, whose values stand below their names.
fn sampling_rate(header: &Header) -> Option<f64> {
    let clean = |text: &str| -> String {
        text.trim_matches(|c: char| c.is_whitespace() || ":;,=\"".contains(c))
            .into()
    };
    let entries = header.lines.iter().enumerate().filter_map(|(i, line)| {
        let line = line.trim_start_matches(['#', '%', '/', '*', ' ', '"']);
        let at = line.find([':', ';', '\t', ',', '='])?;
        let (key, value) = line.split_at(at);
        let value = clean(value);
        // SignalExpress writes the value below its key.
        let below = || header.lines.get(i + 1).map(|l| clean(l)).unwrap_or_default();
        Some((key.trim(), if value.is_empty() { below() } else { value }))
    });
    let settings = header.lines.windows(2).flat_map(|rows| {
        let keys = rows[0].split('\t').map(str::trim);
        keys.zip(rows[1].split('\t').map(clean))
    });
    entries.chain(settings).find_map(|(key, value)| {
        let lower = key.to_lowercase();
        let base = lower.split(['[', '(']).next().unwrap_or_default().trim();
        let is_rate = RATES.iter().any(|k| lower.contains(k)) || ["fs", "sr", "f_s", "rate"].contains(&base);
        let is_interval =
            INTERVALS.iter().any(|k| lower.contains(k)) || ["dt", "delta_x", "x_delta"].contains(&base);
        if !(is_rate || is_interval) || lower.contains("average") {
            return None;
        }
        let unit = key
            .split(['[', '('])
            .nth(1)
            .and_then(|u| u.split([']', ')']).next())
            .map(str::trim);
        // The unit may stand behind the value too.
        let mut words = value.split([' ', '\t', ';', '\u{a0}']).filter(|w| !w.is_empty());
        let word = words.next()?.trim_end_matches(',');
        let (number, glued) = word.split_at(
            word.find(|c: char| c.is_alphabetic() && c != 'e' && c != 'E')
                .unwrap_or(word.len()),
        );
        let number =
            number::field(number.as_bytes(), b'.').or_else(|| number::field(number.as_bytes(), b','))?;
        let glued = Some(glued).filter(|g| !g.is_empty());
        let unit = unit.or(glued).or_else(|| words.next());
        let rate = if is_rate {
            number * unit.and_then(units::frequency_factor).unwrap_or(1.0)
        } else {
            let seconds = unit
                .and_then(units::parse)
                .filter(|u| u.dimension == Dimension::TIME);
            1.0 / (number * seconds.map_or(1.0, |u| u.factor))
        };
        (rate.is_finite() && rate > 0.0).then_some(rate)
    })
}

fn column_unit(header: &Header, at: usize) -> Option<Unit> {
    let from_line = header.units.get(at).and_then(|label| units::parse_named(label));
    from_line.or_else(|| header.names.get(at).and_then(|name| split_unit(name).1))
}

fn channel(
    header: &Header,
    at: usize,
    mut samples: Vec<f64>,
    notes: &mut Notes,
) -> Result<Channel, InputError> {
    let name = header
        .names
        .get(at)
        .cloned()
        .unwrap_or_else(|| format!("column {}", at + 1));
    let unit = column_unit(header, at);
    let role = role_of(&name, unit);
    let label = header.units.get(at).cloned();
    let file_unit = label.unwrap_or_else(|| unit_label(&name));
    match (force_without_gain(role, unit, &file_unit), unit, role) {
        (Some(told), ..) => notes.about(&name, told),
        (None, Some(_), _) | (None, None, ChannelRole::Other) => {}
        (None, None, ChannelRole::TorqueZ) => notes.about(&name, "no unit that is understood: N·m assumed"),
        (None, None, _) => notes.about(&name, "no unit that is understood: N assumed"),
    }
    let factor = unit.map_or(1.0, |u| u.factor);
    if (factor - 1.0).abs() > 1e-12 {
        samples.iter_mut().for_each(|v| *v *= factor);
    }
    checks::plausible_samples(&name, &samples).map_err(|e| e.line(header.data_line))?;
    Ok(Channel {
        name,
        file_unit,
        role,
        samples,
    })
}

/// Resolution of the printed time: a unit in the last place, in the coarsest of the first, middle and last stretches of rows.
/// Within a stretch the finest counts: some programs leave trailing zeros out (`0`, `0.001`, …, `0.1`).
fn time_resolution(bytes: &[u8], header: &Header, column: usize) -> f64 {
    const STRETCH: usize = 12;
    let data = bytes.get(header.data_at..).unwrap_or_default();
    if header.decimal_comma_between_commas {
        return 1e-6;
    }
    let place = |line: &[u8]| {
        let line = crate::ingest::text::decode(line);
        let field = crate::ingest::tables::table::split_line(&line, header.delimiter)
            .into_iter()
            .nth(column)?;
        let (mantissa, exponent) = field.split_once(['e', 'E']).unwrap_or((&field, "0"));
        let fraction = mantissa
            .split(char::from(header.decimal))
            .nth(1)
            .map_or(0, str::len) as i32;
        Some(exponent.parse::<i32>().ok()?.saturating_sub(fraction))
    };
    let places = |from: usize| {
        let rest = &data[from..];
        let start = match from {
            0 => 0,
            _ => rest.iter().position(|b| *b == b'\n')? + 1,
        };
        let lines = crate::ingest::text::Lines::new(&rest[start..]).take(STRETCH);
        lines.filter_map(place).min()
    };
    let coarsest = [0, data.len() / 2, data.len().saturating_sub(600)]
        .into_iter()
        .filter_map(places)
        .max();
    10_f64.powi(coarsest.unwrap_or(-9).clamp(-12, 3))
}
