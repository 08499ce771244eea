//! LabVIEW measurement files (.lvm): a file header, then segments, each with a header of its own.
//!
//! Source: National Instruments, "Specification for the LabVIEW Measurement File (.lvm)" (2010). The separator and the
//! decimal sign are declared in the file header, the sampling interval (`Delta_X`) in the segment's.

use crate::InputError;
use crate::data::TimeRecord;
use crate::ingest::budget::Budget;
use crate::ingest::formats::waveform;
use crate::ingest::tables::clock::{self, Grid, Stamps};
use crate::ingest::tables::number;
use crate::ingest::text::{Lines, Notes, decode};
use crate::text::figures;

const END_OF_HEADER: &str = "***End_of_Header***";
const FIRST_LINE: &str = "LabVIEW Measurement";

/// The file header.
struct Layout {
    separator: char,
    decimal: u8,
    x_columns: XColumns,
}

/// Columns of times: before all channels, before each, or none (its place stays empty).
#[derive(Clone, Copy, PartialEq)]
enum XColumns {
    None,
    One,
    Multi,
}

/// One header line by its key: the values by column.
type Entry = (String, Vec<String>);

struct Segment {
    entries: Vec<Entry>,
    names: Vec<String>,
    /// Line of the first row.
    first_row: usize,
    columns: Vec<Vec<f64>>,
}

/// Stand in a column for an empty field, and for one that is no number.
const EMPTY: f64 = f64::INFINITY;
const NO_NUMBER: f64 = f64::NAN;

pub(crate) fn looks_like(bytes: &[u8]) -> bool {
    let first = Lines::new(bytes).find(|l| !l.trim_ascii().is_empty());
    first.is_some_and(|l| decode(l).trim().starts_with(FIRST_LINE))
}

/// Reads all channels over time, one record for each time axis and segment. A segment that goes on where the one before
/// it ended is joined to it.
pub(crate) fn read(
    bytes: &[u8],
    budget: &mut Budget,
    notes: &mut Notes,
) -> Result<Vec<TimeRecord>, InputError> {
    let mut lines = Lines::new(bytes);
    let layout = layout(&mut lines)?;
    let mut records: Vec<TimeRecord> = Vec::new();
    // Without headings of its own a segment has those of the one before.
    let mut entries: Vec<Entry> = Vec::new();
    let mut names: Vec<String> = Vec::new();
    while let Some(segment) = next_segment(&mut lines, &layout, &mut entries, &mut names, budget)? {
        for record in of_segment(segment, &layout, notes)? {
            match records.last_mut().filter(|before| goes_on(before, &record)) {
                Some(before) => {
                    for (whole, part) in before.channels.iter_mut().zip(record.channels) {
                        whole.samples.extend(part.samples);
                    }
                }
                None => records.push(record),
            }
        }
    }
    if records.is_empty() {
        return Err(
            InputError::new("a LabVIEW measurement file without evenly sampled channels over time")
                .remedy("save the signals themselves, with time on the x axis"),
        );
    }
    Ok(records)
}

fn split(line: &[u8], separator: char) -> Vec<String> {
    decode(line)
        .split(separator)
        .map(|f| f.trim().to_owned())
        .collect()
}

fn layout(lines: &mut Lines) -> Result<Layout, InputError> {
    let mut layout = Layout {
        separator: '\t',
        decimal: b'.',
        x_columns: XColumns::One,
    };
    for line in lines.by_ref() {
        let text = decode(line);
        let mut words = text.split(['\t', ',']).map(str::trim);
        let (key, value) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
        match key {
            END_OF_HEADER => return Ok(layout),
            "Separator" if value.eq_ignore_ascii_case("comma") => layout.separator = ',',
            // The value itself may be the comma at which the line was split.
            "Decimal_Separator" if !text.contains('.') => layout.decimal = b',',
            "X_Columns" => {
                layout.x_columns = match value.to_lowercase().as_str() {
                    "no" => XColumns::None,
                    "multi" => XColumns::Multi,
                    _ => XColumns::One,
                }
            }
            _ => {}
        }
    }
    Err(InputError::new(format!(
        "a LabVIEW measurement file whose header does not end ({END_OF_HEADER} is missing)"
    ))
    .line(lines.number.max(1))
    .remedy("save it again: the file is cut off"))
}

/// Names without `X_Value` before them, as some programs write where there are no times: nothing, then text.
fn is_heading(fields: &[String], layout: &Layout) -> bool {
    let is_text = |f: &String| !f.is_empty() && number::field(f.as_bytes(), layout.decimal).is_none();
    fields[0].is_empty() && fields.get(1).is_some_and(is_text)
}

/// Header, names and rows of the next segment; `None` at the end of the file.
fn next_segment(
    lines: &mut Lines,
    layout: &Layout,
    entries: &mut Vec<Entry>,
    names: &mut Vec<String>,
    budget: &mut Budget,
) -> Result<Option<Segment>, InputError> {
    let mut fresh = Vec::new();
    let mut in_header = true;
    let mut special = false;
    let mut columns: Vec<Vec<f64>> = Vec::new();
    let mut rows = 0;
    let mut first_row = 0;
    while let Some(line) = lines.next() {
        let fields = split(line, layout.separator);
        let blank = fields.iter().all(String::is_empty);
        let key = fields[0].as_str();
        special |= key == "***Start_Special***";
        if special {
            special = key != "***End_Special***";
            continue;
        }
        // Text in the first field is a header line, a number or nothing a row.
        let is_row = !blank && (key.is_empty() || number::field(key.as_bytes(), layout.decimal).is_some());
        if blank {
            if rows == 0 {
                continue;
            }
            break;
        }
        if is_row && (!in_header || !names.is_empty() && fresh.is_empty()) {
            if rows == 0 {
                first_row = lines.number;
            }
            for (k, field) in fields.iter().enumerate().take(names.len()) {
                if k == columns.len() {
                    columns.push(Vec::new());
                }
                let column = &mut columns[k];
                budget.take(
                    8 * (rows + 1 - column.len()),
                    "a table with rows of very different length",
                )?;
                column.resize(rows, EMPTY);
                column.push(match field.is_empty() {
                    true => EMPTY,
                    false => number::field(field.as_bytes(), layout.decimal)
                        .filter(|v| v.is_finite())
                        .unwrap_or(NO_NUMBER),
                });
            }
            rows += 1;
        } else if key == END_OF_HEADER {
            *entries = std::mem::take(&mut fresh);
        } else if key == "X_Value"
            || in_header && is_heading(&fields, layout) && fresh.is_empty() && !entries.is_empty()
        {
            *names = fields;
            in_header = false;
        } else if in_header {
            fresh.push((key.to_owned(), fields));
        } else {
            return Err(
                InputError::new(format!("{key:?} where a row of numbers is expected")).line(lines.number),
            );
        }
    }
    if rows == 0 {
        return Ok(None);
    }
    Ok(Some(Segment {
        entries: entries.clone(),
        names: names.clone(),
        first_row,
        columns,
    }))
}

fn of_segment(segment: Segment, layout: &Layout, notes: &mut Notes) -> Result<Vec<TimeRecord>, InputError> {
    let entry = |key: &str, column: usize| {
        let (_, fields) = segment.entries.iter().find(|(k, _)| k == key)?;
        fields.get(column).filter(|f| !f.is_empty()).cloned()
    };
    let value = |key: &str, column: usize| {
        number::field(entry(key, column)?.as_bytes(), layout.decimal).filter(|v| v.is_finite())
    };
    let declared = value("Channels", 1).filter(|n| *n >= 1.0).map(|n| n as usize);
    let named = segment
        .names
        .iter()
        .skip(1)
        .filter(|n| !n.is_empty() && *n != "Comment" && *n != "X_Value");
    let channels = declared.unwrap_or_else(|| named.count()).min(segment.names.len());
    let mut records = Vec::new();
    for k in 0..channels {
        let column = match layout.x_columns {
            XColumns::Multi => 2 * k + 1,
            XColumns::None | XColumns::One => k + 1,
        };
        let name = segment.names.get(column).filter(|n| !n.is_empty()).cloned();
        let name = name.unwrap_or_else(|| format!("column {}", column + 1));
        let samples = numbers(&segment, column)?;
        // A header that was written before the recording ended says less than there is; that is no fault.
        if let Some(announced) = value("Samples", column).filter(|n| *n > samples.len() as f64) {
            notes.about(
                &name,
                format!(
                    "the header announces {} samples, {} are there: the file or the recording was cut short",
                    announced.round(),
                    samples.len()
                ),
            );
        }
        if samples.len() < 2 {
            notes.about(&name, "less than two samples in a segment: left out");
            continue;
        }
        if let Some(dimension) = entry("X_Dimension", column).filter(|d| d != "Time") {
            notes.about(&name, format!("runs over {dimension}, not over time: left out"));
            continue;
        }
        if is_spectrum(&name) {
            notes.about(
                &name,
                "a spectrum by its name, though the header says time: left out",
            );
            continue;
        }
        let times = match layout.x_columns {
            XColumns::None => None,
            XColumns::One => Some(numbers(&segment, 0)?),
            XColumns::Multi => Some(numbers(&segment, column - 1)?),
        };
        let declared = value("Delta_X", column).filter(|d| *d > 0.0);
        let axis = match time_axis(times.as_deref(), declared, value("X0", column)) {
            Ok(axis) => axis,
            Err(problem) => {
                notes.about(
                    &name,
                    format!("times that are not evenly spaced, or no sampling interval (Delta_X): {problem}: left out"),
                );
                continue;
            }
        };
        let (step, start_s) = (axis.step_s, axis.start_s);
        if let Some(declared) = declared.filter(|d| (step / d - 1.0).abs() > 1e-3) {
            notes.about(
                &name,
                format!(
                    "the header says steps of {} s, the time column {} s: the time column is taken",
                    figures(declared, 6),
                    figures(step, 6)
                ),
            );
        }
        let samples = match (axis.uneven, &times) {
            (Some((grid, told)), Some(times)) => {
                notes.about(&name, told);
                clock::resample(times, &samples, grid)
            }
            _ => samples,
        };
        let unit = entry("Y_Unit_Label", column).unwrap_or_default();
        let channel = waveform::channel(name, unit, samples, notes)?;
        waveform::put(&mut records, 1.0 / step, start_s, channel)?;
    }
    Ok(records)
}

/// LabVIEW's spectral measurements keep `Time` as their dimension; what they add to a signal's name tells:
/// `Acceleration (FFT - (RMS))`.
fn is_spectrum(name: &str) -> bool {
    let name = name.to_lowercase();
    ["(fft", "power spectr", "(psd", "spectral density"]
        .iter()
        .any(|mark| name.contains(mark))
}

/// Step and start, and the grid to put the samples on where the times are uneven.
struct TimeAxis {
    step_s: f64,
    start_s: f64,
    uneven: Option<(Grid, String)>,
}

/// The declared step is exact, the printed times are rounded: they decide only where they contradict it.
fn time_axis(times: Option<&[f64]>, declared: Option<f64>, start: Option<f64>) -> Result<TimeAxis, String> {
    let even = |step_s: f64, start_s: f64| TimeAxis {
        step_s,
        start_s,
        uneven: None,
    };
    let Some(times) = times.filter(|t| t.len() >= 2) else {
        let step_s = declared.ok_or("no times and no interval")?;
        return Ok(even(step_s, start.unwrap_or(0.0)));
    };
    let rounding = clock::six_digits(times);
    if let Some(step_s) = declared.filter(|step| clock::is_even(times, *step, rounding)) {
        return Ok(even(step_s, times[0]));
    }
    match clock::look(times, rounding)? {
        Stamps::Even(grid) => Ok(even(1.0 / grid.rate_hz, grid.start_s)),
        Stamps::Uneven(grid, told) => Ok(TimeAxis {
            step_s: 1.0 / grid.rate_hz,
            start_s: grid.start_s,
            uneven: Some((grid, told)),
        }),
    }
}

/// A column of the rows; shorter where its last fields are empty.
fn numbers(segment: &Segment, column: usize) -> Result<Vec<f64>, InputError> {
    let values = segment.columns.get(column).map_or(&[][..], Vec::as_slice);
    let length = values
        .iter()
        .rposition(|v| *v != EMPTY)
        .map_or(0, |last| last + 1);
    match values[..length].iter().position(|v| !v.is_finite()) {
        Some(row) => Err(InputError::new(format!("no number in column {}", column + 1))
            .line(segment.first_row + row)
            .remedy(
                "a record with missing samples cannot be used: export it again or cut the row range out",
            )),
        None => Ok(values[..length].to_vec()),
    }
}

/// Does a record go on where another ended, with the same channels?
fn goes_on(before: &TimeRecord, after: &TimeRecord) -> bool {
    let end_s = before.start_s + before.len() as f64 / before.sample_rate_hz;
    let alike = before.channels.len() == after.channels.len()
        && before
            .channels
            .iter()
            .zip(&after.channels)
            .all(|(a, b)| a.name == b.name && a.file_unit == b.file_unit);
    alike
        && (before.sample_rate_hz / after.sample_rate_hz - 1.0).abs() < 1e-9
        && (after.start_s - end_s).abs() < 0.5 / after.sample_rate_hz
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(separator: &str, decimal: &str, x_columns: &str, body: &str) -> String {
        let text = format!(
            "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\t{}\nDecimal_Separator\t{decimal}\n\
             Multi_Headings\tYes\nX_Columns\t{x_columns}\nTime_Pref\tAbsolute\nOperator\tlab\nDate\t2024/02/19\n\
             Time\t09:51:39{decimal}19705\n***End_of_Header***\t\n\t\n{body}",
            if separator == "," { "Comma" } else { "Tab" }
        );
        text.replace('\t', separator)
    }

    const HEADER: &str = "Channels\t2\t\t\nSamples\t3\t3\t\nDate\t2024/02/19\t2024/02/19\t\n\
        Y_Unit_Label\tNewtons\tg\t\nX_Dimension\tTime\tTime\t\nX0\t0.0E+0\t0.0E+0\t\nDelta_X\t1.0E-3\t1.0E-3\t\n\
        ***End_of_Header***\t\t\t\nX_Value\tHammer\tTip\tComment\n";

    fn records(text: &str) -> Vec<TimeRecord> {
        read(text.as_bytes(), &mut Budget::for_file(0), &mut Notes::default())
            .unwrap_or_else(|e| panic!("{e}\n{text}"))
    }

    fn assert_two_channels(records: &[TimeRecord]) {
        assert_eq!(records.len(), 1);
        let record = &records[0];
        approx::assert_relative_eq!(record.sample_rate_hz, 1000.0, max_relative = 1e-12);
        assert_eq!(record.channels[0].name, "Hammer");
        assert_eq!(record.channels[0].samples, [1.5, 2.0, 3.0]);
        approx::assert_relative_eq!(
            record.channels[1].samples[2],
            30.0 * crate::ingest::units::STANDARD_GRAVITY
        );
    }

    #[test]
    fn separator_decimal_sign_and_columns_of_times_are_as_declared() {
        let none = format!("{HEADER}\t1.5\t10\n\t2\t20\n\t3.0\t30\tlast\n");
        assert_two_channels(&records(&file("\t", ".", "No", &none)));
        assert_two_channels(&records(&file(",", ".", "No", &none)));
        assert_two_channels(&records(&file("\t", ",", "No", &none.replace('.', ","))));
        // Some programs leave out the word before the names.
        assert_two_channels(&records(&file("\t", ".", "No", &none.replace("X_Value", ""))));
        let one = format!("{HEADER}0\t1.5\t10\n0.001\t2\t20\n0.002\t3.0\t30\n");
        assert_two_channels(&records(&file("\t", ".", "One", &one)));
        let header = HEADER
            .replace("3\t3", "3\t\t3")
            .replace("Newtons\tg", "Newtons\t\tg")
            .replace("E+0\t0.0", "E+0\t\t0.0")
            .replace("E-3\t1.0", "E-3\t\t1.0")
            .replace("Hammer\tTip", "Hammer\tX_Value\tTip");
        let multi = format!("{header}0\t1.5\t0\t10\n0.001\t2\t0.001\t20\n0.002\t3.0\t0.002\t30\n");
        assert_two_channels(&records(&file("\t", ".", "Multi", &multi)));
    }

    #[test]
    fn a_spectrum_is_no_time_record_whatever_the_header_says() {
        let header = HEADER.replace("Hammer\tTip", "Hammer\tTip (FFT - (RMS))");
        let found = records(&file(
            "\t",
            ".",
            "No",
            &format!("{header}\t1.5\t-77\n\t2\t-90\n\t3.0\t-95\n"),
        ));
        let names: Vec<&str> = found[0].channels.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["Hammer"]);
    }

    #[test]
    fn segments_that_go_on_are_joined_and_others_are_records_of_their_own() {
        let first = format!("{HEADER}\t1.5\t10\n\t2\t20\n\t3.0\t30\n\n");
        let later = HEADER.replace("0.0E+0", "3.0E-3");
        let joined = records(&file(
            "\t",
            ".",
            "No",
            &format!("{first}{later}\t4\t40\n\t5\t50\n"),
        ));
        assert_eq!((joined.len(), joined[0].len()), (1, 5));
        let twice = records(&file(
            "\t",
            ".",
            "No",
            &format!("{first}{HEADER}\t4\t40\n\t5\t50\n"),
        ));
        assert_eq!(twice.len(), 2);
    }

    #[test]
    fn uneven_times_holes_and_damage_are_said() {
        let uneven = format!("{HEADER}0\t1.5\t10\n0.001\t2\t20\n0.009\t3.0\t30\n");
        let error = read(
            file("\t", ".", "One", &uneven).as_bytes(),
            &mut Budget::for_file(0),
            &mut Notes::default(),
        )
        .unwrap_err();
        assert!(error.to_string().contains("evenly"), "{error}");
        let hole = format!("{HEADER}\t1.5\t10\n\t\t20\n\t3.0\t30\n");
        let error = read(
            file("\t", ".", "No", &hole).as_bytes(),
            &mut Budget::for_file(0),
            &mut Notes::default(),
        )
        .unwrap_err();
        assert_eq!(error.line, Some(24), "{error}");
        let whole = file("\t", ".", "No", &format!("{HEADER}\t1.5\t10\n\t2\t20\n"));
        for cut_at in 0..whole.len() {
            let _ = read(
                &whole.as_bytes()[..cut_at],
                &mut Budget::for_file(0),
                &mut Notes::default(),
            );
        }
    }
}
