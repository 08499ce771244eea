//! The bytes of a file become what it holds, by its format.

use std::path::Path;

use super::budget::Budget;
use super::contents::{Contents, Format, count};
use super::detect::{self, Detected};
use super::text::{self, Notes};
use super::units::figures;
use super::{checks, dof_names};
use crate::InputError;
use crate::data::{FrfRecord, TimeRecord};
use crate::ingest::formats::mat::NamedArrays;
use crate::ingest::formats::{force, frf_text, lvm, numpy, tdms, uff, workbook};
use crate::ingest::tables::{channel_names, stamps, word_columns};

/// Where a file holds one FRF that does not say where it was measured, its name may.
pub(super) fn dofs_from_file_name(path: &Path, frfs: &mut [FrfRecord], notes: &mut Notes) {
    let [frf] = frfs else { return };
    if frf.response.is_some() || frf.reference.is_some() {
        return;
    }
    let stem = path.file_stem().map(|s| s.to_string_lossy()).unwrap_or_default();
    (frf.response, frf.reference) = dof_names::dofs(&stem);
    if let (Some(response), Some(reference)) = (frf.response, frf.reference) {
        frf.name = format!("{response}/{reference}");
        notes.file(format!(
            "measured at {response}, excited at {reference}: taken from the name of the file"
        ));
    }
}

/// As [`read_file`], on bytes.
pub(super) fn read_bytes(
    bytes: &[u8],
    is_dwd_named: bool,
    notes: &mut Notes,
) -> std::result::Result<(Format, String, Contents), InputError> {
    read_bytes_at(bytes, is_dwd_named, None, notes)
}

/// As [`read_bytes`]; `rate_hz` is that of signals in binary formats that say no rate.
pub(super) fn read_bytes_at(
    bytes: &[u8],
    is_dwd_named: bool,
    rate_hz: Option<f64>,
    notes: &mut Notes,
) -> std::result::Result<(Format, String, Contents), InputError> {
    match read_as_it_is(bytes, is_dwd_named, rate_hz, notes) {
        Ok((format, why, mut contents)) => {
            for record in &mut contents.times {
                channel_names::settle(&mut record.channels, notes);
                tell_slow_times(record, notes);
            }
            contents.show_control_characters();
            checks::drop_copies(&mut contents.frfs, notes);
            Ok((format, text::shown(&why).into_owned(), contents))
        }
        Err(error) => Err(error),
    }
}

/// Samples of which a record has more.
const A_FEW: usize = 200;

/// Says where the times go up by a second or more from sample to sample: nobody records vibration or force so, and a column `time`
/// may as well hold milliseconds, or count the samples.
fn tell_slow_times(record: &TimeRecord, notes: &mut Notes) {
    if record.sample_rate_hz <= 1.0 && record.len() >= A_FEW {
        notes.file(format!(
            "{} samples, one every {} s, if the times are seconds: milliseconds, or a count of samples? Then name the column time_ms, or say \
             how fast it was sampled (`lobestone modal FILE --rate HZ`; for cutting forces rate_hz in a [[channel]] of campaign.toml)",
            record.len(),
            figures(1.0 / record.sample_rate_hz, 4)
        ));
    }
}

fn read_as_it_is(
    bytes: &[u8],
    is_dwd_named: bool,
    rate_hz: Option<f64>,
    notes: &mut Notes,
) -> std::result::Result<(Format, String, Contents), InputError> {
    let bytes = &*text::without_byte_order_mark(bytes);
    let sheet = workbook::first_sheet(bytes)?;
    if let Some((_, told)) = &sheet {
        notes.file("from a workbook");
        told.iter().for_each(|told| notes.file(told));
    }
    let bytes = sheet.as_ref().map_or(bytes, |(text, _)| text.as_bytes());
    let mut seconds = None;
    let found = detect::detect(bytes, is_dwd_named).or_else(|problem| {
        // Rows that begin with a clock are no table of numbers yet, nor are those with words in them.
        let without_clock = stamps::as_seconds(bytes)
            .and_then(|made| Some((detect::detect(&made.0, is_dwd_named).ok()?, made)));
        let (found, (text, told)) = match without_clock {
            Some((found, made)) => (found, made),
            None => {
                let made = word_columns::without_words(bytes).ok_or(problem)?;
                (detect::detect(&made.0, is_dwd_named)?, made)
            }
        };
        notes.file(told);
        seconds = Some(text);
        Ok(found)
    });
    let (detected, format, why) = found?;
    let bytes = seconds.as_deref().unwrap_or(bytes);
    let mut budget = Budget::for_file(bytes.len());
    let frfs = |frfs| Contents {
        frfs,
        ..Contents::default()
    };
    let signals = |times| Contents {
        times,
        ..Contents::default()
    };
    Ok(match detected {
        Detected::Tdms => (format, why, signals(tdms::read(bytes, rate_hz, notes)?)),
        Detected::Lvm => (format, why, signals(lvm::read(bytes, &mut budget, notes)?)),
        Detected::Mat4 | Detected::Mat5 | Detected::Mat73 | Detected::Numpy => {
            let arrays = match detected {
                Detected::Mat4 => NamedArrays::of_v4(bytes, &mut budget, notes)?,
                Detected::Mat5 => NamedArrays::of_v5(bytes, &mut budget, notes)?,
                Detected::Mat73 => NamedArrays::of_v73(bytes, &mut budget, notes)?,
                _ => numpy::read(bytes, &mut budget, notes)?.into(),
            };
            (format, why, arrays.contents(rate_hz, &mut budget, notes)?)
        }
        Detected::Universal => {
            let (summary, contents) = uff::contents(bytes, notes)?;
            let skipped: Vec<String> = summary.skipped.iter().map(u32::to_string).collect();
            let (format, count) = match (summary.ascii, summary.binary) {
                (ascii, 0) => (Format::Uff58, count(ascii, "ASCII dataset")),
                (0, binary) => (Format::Uff58b, count(binary, "binary dataset")),
                (ascii, binary) => (
                    Format::Uff58b,
                    format!(
                        "{}, {}",
                        count(ascii, "ASCII dataset"),
                        count(binary, "binary dataset")
                    ),
                ),
            };
            let rest = if skipped.is_empty() {
                String::new()
            } else {
                format!(", skipped {}", skipped.join(", "))
            };
            (format, format!("{why}; {count}{rest}"), contents)
        }
        Detected::Cutpro(labels) => (format, why, frfs(frf_text::read_cutpro(bytes, &labels, notes)?)),
        Detected::FrfTable(header) => (format, why, frfs(frf_text::read_table(bytes, &header, notes)?)),
        Detected::PlainFrf(header) => {
            notes.file("no column names: taken as frequency in Hz, real and imaginary part");
            (
                format,
                why,
                frfs(frf_text::read_plain(bytes, &header, None, 1.0, notes)?),
            )
        }
        Detected::TimeTable(header) => (format, why, signals(vec![force::read(bytes, &header, notes)?])),
    })
}
