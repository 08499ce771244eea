//! Reads lab files into SI records. Nothing outside this module knows a file format.
//!
//! [`read_file`] says what a file is and gives all it holds; [`read_frfs`] and [`read_time`] give the one thing a
//! caller wants and an error that says what the file holds instead.

use std::path::{Path, PathBuf};

use num_complex::Complex64;
use serde::Serialize;

use crate::{Error, InputError, Result};

mod budget;
mod channel_rule;
mod checks;
mod clock;
mod detect;
mod dof_names;
mod force;
mod frf_text;
mod geometry;
mod long;
mod lvm;
mod mat;
mod number;
mod quality;
mod split_comma;
mod table;
mod tdms;
#[cfg(test)]
mod tests;
mod text;
mod uff;
pub mod units;
mod waveform;

pub use channel_rule::{ChannelRule, Gain, Measures, Source, read_time_with, unit_of_charge_or_other};
pub use geometry::{Geometry, NodalShape, geometry_text, read_geometry};
pub use long::{Survey, regular_file, survey};
pub use mat::{MatArray, mat5_bytes};
pub use quality::quality_warnings;
pub use uff::{
    Abscissa, ByteOrder, Dataset58, Encoding58, EntityDof, Ordinate, UnitAxis, frf_dataset, time_datasets,
    uff58_bytes, write_datasets58, write_uff58,
};

use budget::Budget;
use detect::Detected;
use text::Notes;
pub use text::shown;

/// How a file is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Format {
    /// Universal file, dataset 58.
    Uff58,
    /// Universal file, dataset 58b (binary).
    Uff58b,
    /// `frequency_hz,re(1X/1X),im(1X/1X),…` and relatives.
    FrfCsv,
    /// Three columns Hz, Re, Im without names.
    FrfText,
    /// CutPro-style `.frf`.
    CutproFrf,
    /// DynoWare export or text with header lines like it.
    DynoWare,
    /// Time series with column names.
    TimeCsv,
    /// National Instruments TDMS.
    Tdms,
    /// LabVIEW measurement file.
    Lvm,
    /// MATLAB, version 5 to 7.
    Mat5,
    /// MATLAB 7.3, or other HDF5 with plain arrays.
    Mat73,
}

impl std::fmt::Display for Format {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Format::Uff58 => "UFF 58",
            Format::Uff58b => "UFF 58b",
            Format::FrfCsv => "FRF CSV",
            Format::FrfText => "FRF text",
            Format::CutproFrf => "CutPro FRF",
            Format::DynoWare => "DynoWare export",
            Format::TimeCsv => "time CSV",
            Format::Tdms => "TDMS",
            Format::Lvm => "LabVIEW LVM",
            Format::Mat5 => "MAT v5",
            Format::Mat73 => "MAT v7.3",
        })
    }
}

/// All that a measurement file holds; a universal file may hold several kinds at once.
#[derive(Debug, Clone, Default)]
pub struct Contents {
    pub frfs: Vec<FrfRecord>,
    /// One record for each time axis.
    pub times: Vec<TimeRecord>,
    /// Spectra and other functions that nothing here computes with, as they stand in the file.
    pub others: Vec<OtherRecord>,
}

/// A function that is neither FRF nor time signal; units of the file.
#[derive(Debug, Clone)]
pub struct OtherRecord {
    /// Such as `power spectral density`.
    pub kind: &'static str,
    pub name: String,
    pub abscissa: Vec<f64>,
    pub abscissa_unit: String,
    pub value: Vec<Complex64>,
    pub unit: String,
}

/// A file that was read.
#[derive(Debug, Clone)]
pub struct MeasurementFile {
    pub path: PathBuf,
    pub format: Format,
    /// Why it was taken for this format.
    pub why: String,
    pub contents: Contents,
    /// What was assumed, contradicted or left out.
    pub warnings: Vec<String>,
}

impl Contents {
    /// Names and units of files are shown on terminals: control characters in them become visible.
    fn show_control_characters(&mut self) {
        let show = |text: &mut String| {
            *text = text::shown_on_one_line(text);
        };
        self.frfs.iter_mut().for_each(|frf| show(&mut frf.name));
        for channel in self.times.iter_mut().flat_map(|record| &mut record.channels) {
            show(&mut channel.name);
            show(&mut channel.file_unit);
        }
        for other in &mut self.others {
            show(&mut other.name);
            show(&mut other.unit);
            show(&mut other.abscissa_unit);
        }
    }

    /// `3 FRFs, 1 time record, 2 × coherence`.
    pub fn describe(&self) -> String {
        let mut parts = Vec::new();
        if !self.frfs.is_empty() {
            parts.push(count(self.frfs.len(), "FRF"));
        }
        if !self.times.is_empty() {
            parts.push(count(self.times.len(), "time record"));
        }
        let mut kinds: Vec<&str> = self.others.iter().map(|o| o.kind).collect();
        kinds.sort_unstable();
        for group in kinds.chunk_by(|a, b| a == b) {
            parts.push(format!("{} × {}", group.len(), group[0]));
        }
        if parts.is_empty() {
            "nothing usable".into()
        } else {
            parts.join(", ")
        }
    }
}

/// `1 FRF`, `2 FRFs`.
fn count(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

/// Reads a measurement file of any known format, decided by its content.
///
/// # Errors
/// The operating system's; an unknown or unreadable format, or a damaged file, with file, line and remedy.
pub fn read_file(path: &Path) -> Result<MeasurementFile> {
    match long::open(path)? {
        long::Opened::Read(file) => Ok(file),
        long::Opened::Long(record) => record.whole(),
    }
}

/// As [`read_file`], on the bytes of a file; errors name no file.
///
/// # Errors
/// As [`read_file`].
pub fn read_memory(bytes: &[u8]) -> std::result::Result<MeasurementFile, InputError> {
    let mut notes = Notes::default();
    let (format, why, contents) = read_bytes(bytes, false, &mut notes)?;
    Ok(MeasurementFile {
        path: PathBuf::new(),
        format,
        why,
        contents,
        warnings: notes.into_warnings(),
    })
}

/// Where a file holds one FRF that does not say where it was measured, its name may.
fn dofs_from_file_name(path: &Path, frfs: &mut [FrfRecord], notes: &mut Notes) {
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
fn read_bytes(
    bytes: &[u8],
    is_dwd_named: bool,
    notes: &mut Notes,
) -> std::result::Result<(Format, String, Contents), InputError> {
    match read_as_it_is(bytes, is_dwd_named, notes) {
        Ok((format, why, mut contents)) => {
            contents.show_control_characters();
            checks::drop_copies(&mut contents.frfs, notes);
            Ok((format, text::shown(&why).into_owned(), contents))
        }
        Err(error) => Err(error),
    }
}

fn read_as_it_is(
    bytes: &[u8],
    is_dwd_named: bool,
    notes: &mut Notes,
) -> std::result::Result<(Format, String, Contents), InputError> {
    let bytes = &*text::without_byte_order_mark(bytes);
    let (detected, format, why) = detect::detect(bytes, is_dwd_named)?;
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
        Detected::Tdms => (format, why, signals(tdms::read(bytes, notes)?)),
        Detected::Lvm => (format, why, signals(lvm::read(bytes, &mut budget, notes)?)),
        Detected::Mat5 => (format, why, mat::read_v5(bytes, &mut budget, notes)?),
        Detected::Mat73 => (format, why, mat::read_v73(bytes, &mut budget, notes)?),
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

/// FRFs of a file, and its warnings.
///
/// # Errors
/// As [`read_file`], and a file without FRFs.
pub fn read_frfs(path: &Path) -> Result<(Vec<FrfRecord>, Vec<String>)> {
    let file = read_file(path)?;
    if file.contents.frfs.is_empty() {
        return Err(no_such(&file, "FRF", "give a UFF 58 file or a CSV with FRFs"));
    }
    Ok((file.contents.frfs, file.warnings))
}

/// The time record of a file, and its warnings.
///
/// # Errors
/// As [`read_file`], and a file without time signals or with several that do not share one time axis.
pub fn read_time(path: &Path) -> Result<(TimeRecord, Vec<String>)> {
    let mut file = read_file(path)?;
    match (file.contents.times.pop(), file.contents.times.len()) {
        (Some(record), 0) => Ok((record, file.warnings)),
        (None, _) => Err(no_such(
            &file,
            "time signal",
            "give a DynoWare export or a CSV with a time column",
        )),
        (Some(_), more) => Err(InputError::new(format!(
            "{} time records with different time axes",
            more + 1
        ))
        .file(path)
        .remedy("keep the channels of one record in one file")
        .into()),
    }
}

fn no_such(file: &MeasurementFile, what: &str, remedy: &str) -> Error {
    let mut problem = format!(
        "no {what} in this {} file, but {}",
        file.format,
        file.contents.describe()
    );
    if let Some(first) = file.warnings.first() {
        problem.push_str(&format!(" ({first})"));
    }
    InputError::new(problem).file(&file.path).remedy(remedy).into()
}

/// What an FRF's response is: displacement, velocity or acceleration per newton.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Quantity {
    /// Displacement per force, m/N.
    Receptance,
    /// Velocity per force, (m/s)/N.
    Mobility,
    /// Acceleration per force, (m/s²)/N. (`acceleration` in campaign files.)
    #[serde(rename = "acceleration", alias = "accelerance")]
    Accelerance,
}

/// One of the three axes of a measurement frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
pub enum Axis {
    X,
    Y,
    Z,
}

impl Axis {
    pub const ALL: [Axis; 3] = [Axis::X, Axis::Y, Axis::Z];

    pub fn index(self) -> usize {
        self as usize
    }

    pub fn letter(self) -> char {
        ['X', 'Y', 'Z'][self.index()]
    }
}

/// A degree of freedom as measurement files name it: node number, axis, and sense along it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
pub struct Dof {
    pub node: i64,
    pub axis: Axis,
    /// True where the file says −X, −Y or −Z.
    pub negative: bool,
}

impl std::fmt::Display for Dof {
    /// `1X`, `12-Z`: the form of the FRF CSV header.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let sign = if self.negative { "-" } else { "" };
        write!(f, "{}{}{}", self.node, sign, self.axis.letter())
    }
}

impl std::str::FromStr for Dof {
    type Err = InputError;

    /// Node, optional sign, axis letter: `1X`, `12-Z`, `1+x`.
    fn from_str(text: &str) -> std::result::Result<Self, InputError> {
        let wrong = || {
            InputError::new(format!("{text:?} is no degree of freedom"))
                .remedy("write node, optional sign and axis: 1X, 12-Z")
        };
        let text = text.trim();
        let digits = text.chars().take_while(char::is_ascii_digit).count();
        let (node, rest) = text.split_at_checked(digits).ok_or_else(wrong)?;
        let (negative, letter) = match rest.strip_prefix('-') {
            Some(letter) => (true, letter),
            None => (false, rest.strip_prefix('+').unwrap_or(rest)),
        };
        let axis = match letter {
            "X" | "x" => Axis::X,
            "Y" | "y" => Axis::Y,
            "Z" | "z" => Axis::Z,
            _ => return Err(wrong()),
        };
        Ok(Dof {
            node: node.parse().map_err(|_| wrong())?,
            axis,
            negative,
        })
    }
}

/// One frequency response function, in SI per newton, in the quantity of the file.
#[derive(Debug, Clone)]
pub struct FrfRecord {
    /// What the file calls it, e.g. `1X/1X`.
    pub name: String,
    pub response: Option<Dof>,
    pub reference: Option<Dof>,
    /// `None` where the file does not say (the campaign file must).
    pub quantity: Option<Quantity>,
    /// Ascending, Hz.
    pub frequency_hz: Vec<f64>,
    /// Same length as `frequency_hz`; SI units of `quantity`.
    pub value: Vec<Complex64>,
    /// Ordinary coherence 0..1 on the same lines, where the file holds it.
    pub coherence: Option<Vec<f64>>,
}

/// One recorded channel of a time record.
#[derive(Debug, Clone)]
pub struct Channel {
    /// Name as in the file.
    pub name: String,
    /// Unit as in the file.
    pub file_unit: String,
    pub role: ChannelRole,
    /// Samples in SI (N, N·m, m/s², m, …; volts and unknown units as they stand).
    pub samples: Vec<f64>,
}

impl Channel {
    /// What the samples are and their SI unit; the file's own label where it is not understood.
    pub fn quantity_and_unit(&self) -> (&'static str, &str) {
        let by_role = match self.role {
            ChannelRole::ForceX | ChannelRole::ForceY | ChannelRole::ForceZ => Some(("force", "N")),
            ChannelRole::TorqueZ => Some(("moment", "N·m")),
            ChannelRole::Other => None,
        };
        let by_unit = units::parse_named(&self.file_unit).and_then(|u| u.dimension.describe());
        by_unit.or(by_role).unwrap_or(("unknown", &self.file_unit))
    }
}

/// What a channel records, decided from its name and unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum ChannelRole {
    ForceX,
    ForceY,
    ForceZ,
    /// Moment about the spindle axis, N·m.
    TorqueZ,
    Other,
}

/// A uniformly sampled record of one or more channels.
#[derive(Debug, Clone)]
pub struct TimeRecord {
    pub sample_rate_hz: f64,
    /// Time of the first sample, s.
    pub start_s: f64,
    pub channels: Vec<Channel>,
    /// Samples that the recorder dropped: stretches filled by a straight line, so that the times behind them are right.
    pub filled: Vec<std::ops::Range<usize>>,
}

impl TimeRecord {
    /// Are these two recordings of the same channels?
    pub fn same_channels(&self, other: &TimeRecord) -> bool {
        let rate = (self.sample_rate_hz / other.sample_rate_hz - 1.0).abs() < 1e-6;
        let mut channels = self.channels.iter().zip(&other.channels);
        rate && self.channels.len() == other.channels.len()
            && channels.all(|(a, b)| a.name == b.name && a.file_unit == b.file_unit)
    }

    /// Puts the samples of a recording of the same channels behind its own.
    pub fn append(&mut self, next: &TimeRecord) {
        let before = self.channels.first().map_or(0, |c| c.samples.len());
        for (channel, more) in self.channels.iter_mut().zip(&next.channels) {
            channel.samples.extend_from_slice(&more.samples);
        }
        let filled = next.filled.iter().map(|r| r.start + before..r.end + before);
        self.filled.extend(filled);
    }

    pub fn channel(&self, role: ChannelRole) -> Option<&Channel> {
        self.channels.iter().find(|c| c.role == role)
    }

    /// Number of samples per channel.
    pub fn len(&self) -> usize {
        self.channels.first().map_or(0, |c| c.samples.len())
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}
