//! Which format a file has, by what stands in it.

use std::path::Path;

use super::contents::Format;
use super::preview::{columns, lines_for_names, preview};
use super::text::{self, Lines};
use crate::InputError;
use crate::ingest::formats::force;
use crate::ingest::formats::frf_text;
use crate::ingest::formats::lvm;
use crate::ingest::formats::mat;
use crate::ingest::formats::numpy;
use crate::ingest::formats::pulse;
use crate::ingest::formats::twincat;
use crate::ingest::formats::uff;
use crate::ingest::tables::channel_names::{is_called_acceleration, is_called_hammer};
use crate::ingest::tables::table::Header;

/// Endings of files that nobody exports measurements to.
const OTHERS: [&str; 16] = [
    "html", "png", "jpg", "jpeg", "pdf", "md", "json", "docx", "zip", "xz", "py", "m", "svg", "parquet",
    "log", "toml",
];

/// Whether a file is no measurement by the ending of its name.
pub fn is_no_measurement(file: &Path) -> bool {
    let ending = file.extension().map(|e| e.to_string_lossy().to_lowercase());
    ending.is_some_and(|ending| OTHERS.contains(&ending.as_str()))
}

/// What was decided, and what the reader needs to know of it.
pub(super) enum Detected {
    Universal,
    Cutpro(Vec<String>),
    FrfTable(Header),
    PlainFrf(Header),
    TimeTable(Header),
    Tdms,
    Lvm,
    Mat4,
    Mat5,
    Mat73,
    Numpy,
}

/// Decides the format. The error of an unreadable format says what it is and how to export it.
pub(super) fn detect(bytes: &[u8], is_dwd_named: bool) -> Result<(Detected, Format, String), InputError> {
    if bytes.trim_ascii().is_empty() {
        return Err(InputError::new("the file is empty"));
    }
    if bytes.starts_with(b"TDSm") {
        return Ok((Detected::Tdms, Format::Tdms, "begins with TDSm".into()));
    }
    if mat::looks_like_v5(bytes) {
        return Ok((
            Detected::Mat5,
            Format::Mat5,
            "begins with MATLAB 5.0 MAT-file".into(),
        ));
    }
    if mat::looks_like_v4(bytes) {
        return Ok((
            Detected::Mat4,
            Format::Mat4,
            "begins with a variable as MATLAB 4 wrote them".into(),
        ));
    }
    if mat::looks_like_v73(bytes) {
        return Ok((Detected::Mat73, Format::Mat73, "has the signature of HDF5".into()));
    }
    if numpy::looks_like(bytes) {
        return Ok((
            Detected::Numpy,
            Format::Numpy,
            "has arrays as NumPy writes them".into(),
        ));
    }
    if lvm::looks_like(bytes) {
        return Ok((
            Detected::Lvm,
            Format::Lvm,
            "begins with LabVIEW Measurement".into(),
        ));
    }
    if let Some((what, remedy)) = foreign(bytes) {
        return Err(InputError::new(format!("{what}, which is not read here")).remedy(remedy));
    }
    // First, for a 58b is text and binary at once.
    if uff::looks_like(bytes) {
        return Ok((
            Detected::Universal,
            Format::Uff58,
            "starts with \"-1\" and a dataset number".into(),
        ));
    }
    if text::is_binary(bytes) {
        let head = text::head(bytes);
        let (what, remedy) = if is_dwd_named || mentions(head, b"DynoWare") || mentions(head, b"Kistler") {
            (
                "a DynoWare .dwd recording: an undocumented binary format",
                "in DynoWare: File, Export, with header, as text",
            )
        } else {
            (
                "a binary file of unknown format",
                "export it as UFF 58, CSV or tab separated text",
            )
        };
        return Err(InputError::new(what).remedy(remedy));
    }
    if let Some(problem) = foreign_text(bytes) {
        return Err(problem);
    }
    if let Some(labels) = frf_text::cutpro_labels(bytes) {
        let why = "three numbers and the labels Freq, Real, Imag on the first line".to_owned();
        return Ok((Detected::Cutpro(labels), Format::CutproFrf, why));
    }
    let Some(mut header) = Header::find(bytes) else {
        return Err(
            InputError::new("text without rows of numbers, no format known here")
                .remedy("FRFs are read from UFF 58 and CSV, forces from DynoWare exports and CSV"),
        );
    };
    frf_text::join_signalcalc(&mut header);
    frf_text::join_said_above(&mut header)?;
    pulse::join(&mut header)?;
    twincat::join(&mut header);
    let how = header.describe();
    if frf_text::is_frf_table(&header) {
        let why = format!("column names of FRFs ({}), {how}", abbreviated(&header.names));
        return Ok((Detected::FrfTable(header), Format::FrfCsv, why));
    }
    if force::is_time_table(&header) {
        let dynoware = header.lines.iter().any(|l| l.contains("DynoWare"))
            || header.entry(&["sampling rate"]).is_some()
                && !header.units.is_empty()
                && !header.is_labelled();
        let (format, what) = if dynoware {
            (Format::DynoWare, "DynoWare-like header lines")
        } else {
            (Format::TimeCsv, "a time column")
        };
        let why = format!("{what} and column names ({}), {how}", abbreviated(&header.names));
        return Ok((Detected::TimeTable(header), format, why));
    }
    // Forces in three columns are as nameless as an FRF, but none of them rises all the time.
    let is_nameless = |header: &Header| {
        let first = columns(bytes, header).into_iter().next();
        header.names.is_empty() && first.is_some_and(|c| !c.rises)
    };
    if frf_text::is_plain_frf(&header) && (frf_text::speaks_of_frequency(&header) || !is_nameless(&header)) {
        let why = format!("three columns of numbers, taken as Hz, Re, Im; {how}");
        return Ok((Detected::PlainFrf(header), Format::FrfText, why));
    }
    if header.names.is_empty() {
        let (problem, remedy) = preview(bytes, &header);
        return Err(InputError::new(problem)
            .line(header.data_line.max(1))
            .remedy(remedy));
    }
    let names = &header.names;
    if names.iter().any(|n| is_called_hammer(n)) && names.iter().any(|n| is_called_acceleration(n)) {
        return Err(InputError::new(format!(
            "a tap test without a time base: columns {}, and neither times nor a sampling rate",
            abbreviated(names)
        ))
        .line(header.data_line.saturating_sub(1).max(1))
        .remedy(
            "say how fast it was sampled: `lobestone modal FILE --rate 48000`, or a line `Sampling rate [Hz]:,48000` above the \
             names, or a column time_s",
        ));
    }
    let problem = format!("columns of unknown meaning ({})", abbreviated(&header.names));
    let mut remedy = "put a line of column names on top: frequency_hz,re,im for an FRF, time_s,force_n,acc_m_per_s2 for a tap test, \
         time_s,fx_n,fy_n,fz_n for cutting forces (without a time column: rate_hz in a [[channel]] of campaign.toml)"
        .to_owned();
    if let Some(lines) = lines_for_names(bytes, &header) {
        remedy += &format!(
            "; or, where they are cutting forces, say in campaign.toml which is which (gain_n_per_unit for values without a unit), such \
             as{lines}"
        );
    }
    Err(InputError::new(problem)
        .line(header.data_line.saturating_sub(1).max(1))
        .remedy(remedy))
}

fn abbreviated(names: &[String]) -> String {
    let few: Vec<&str> = names.iter().take(4).map(String::as_str).collect();
    let more = if names.len() > 4 { ", …" } else { "" };
    few.join(", ") + more
}

fn mentions(bytes: &[u8], word: &[u8]) -> bool {
    memchr::memmem::find(bytes, word).is_some()
}

/// Formats of others by their first bytes: what it is, and how to get at the data.
fn foreign(bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    let starts = |magic: &[u8]| bytes.starts_with(magic);
    Some(if starts(b"TDSh") {
        (
            "the index of a National Instruments TDMS file",
            "give the .tdms file itself",
        )
    } else if starts(b"MATLAB ") {
        (
            "a MATLAB file of unknown version, or cut off",
            "in MATLAB: load it, then save('new.mat', '-v7')",
        )
    } else if starts(b"PK\x03\x04") {
        (
            "a zip archive or a document in one (ods, docx)",
            "save a sheet as CSV or xlsx, or unpack the archive",
        )
    } else if starts(b"\xD0\xCF\x11\xE0\xA1\xB1\x1A\xE1") {
        ("an old Office document (xls)", "save the sheet as CSV")
    } else if starts(b"\x1F\x8B") || starts(b"7z\xBC\xAF") || starts(b"\xFD7zXZ") || starts(b"BZh") {
        ("a compressed file", "unpack it first")
    } else if starts(b"PAR1") {
        ("a Parquet file", "export it as CSV")
    } else if starts(b"RIFF") {
        (
            "a WAV sound file",
            "export it as CSV with columns time_s and one per channel, in physical units",
        )
    } else if starts(b"%PDF") || starts(b"\x89PNG") || starts(b"\xFF\xD8\xFF") {
        (
            "a document or image",
            "give the measurement file it was made from",
        )
    } else {
        return None;
    })
}

/// Text formats that are recognised and not read.
fn foreign_text(bytes: &[u8]) -> Option<InputError> {
    let first = text::decode(Lines::new(bytes).find(|l| !l.trim_ascii().is_empty())?);
    let first = first.trim();
    if first.starts_with('(') && first.ends_with("j)") {
        return Some(
            InputError::new(
                "complex numbers as Python prints them, one per line: the frequency axis is missing",
            )
            .line(1)
            .remedy("write a CSV with the columns frequency_hz,re,im"),
        );
    }
    None
}
