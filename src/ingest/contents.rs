//! What a measurement file is and holds.

use std::io::Read;
use std::path::{Path, PathBuf};

use num_complex::Complex64;
use serde::Serialize;

use super::text;
use crate::data::{FrfRecord, TimeRecord};
use crate::files::regular_file;
use crate::{Error, Result};

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
    /// MATLAB, version 4.
    Mat4,
    /// MATLAB, version 5 to 7.
    Mat5,
    /// MATLAB 7.3, or other HDF5 with plain arrays.
    Mat73,
    /// NumPy's NPY or NPZ.
    Numpy,
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
            Format::Mat4 => "MAT v4",
            Format::Mat5 => "MAT v5",
            Format::Mat73 => "MAT v7.3",
            Format::Numpy => "NumPy",
        })
    }
}

/// All that a measurement file holds; a universal file may hold several kinds at once.
#[derive(Debug, Clone, Default)]
pub struct Contents {
    /// Frequency response functions, each with frequencies of its own.
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
    /// What the file calls it; may be empty.
    pub name: String,
    /// Finite; in the order of the file.
    pub abscissa: Vec<f64>,
    /// Unit label of the abscissa.
    pub abscissa_unit: String,
    /// Same length as `abscissa`; real functions have no imaginary part.
    pub value: Vec<Complex64>,
    /// Unit label of the values; empty where the file has none.
    pub unit: String,
}

/// What tells one content of a file from another: enough to notice a change, no defence against a forger.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Digest {
    /// Length of the file, bytes.
    pub bytes: u64,
    /// Its cyclic redundancy check, as in zip files (IEEE 802.3).
    pub crc32: u32,
}

impl Digest {
    /// Of a file that is `content`.
    pub fn of(content: &[u8]) -> Self {
        let mut digest = Digest::default();
        digest.extend(content);
        digest
    }

    /// Of the file at `path`, in bounded memory.
    ///
    /// # Errors
    /// The operating system's; a folder, pipe or device, by its path.
    pub fn read(path: &Path) -> Result<Self> {
        let refused = |e| Error::io(path, e);
        regular_file(path)?;
        let mut file = std::fs::File::open(path).map_err(refused)?;
        let (mut digest, mut buffer) = (Digest::default(), vec![0; 1 << 16]);
        loop {
            match file.read(&mut buffer).map_err(refused)? {
                0 => return Ok(digest),
                read => digest.extend(&buffer[..read]),
            }
        }
    }

    /// `more` stands after what was seen so far.
    pub(super) fn extend(&mut self, more: &[u8]) {
        let mut check = crc32fast::Hasher::new_with_initial_len(self.crc32, self.bytes);
        check.update(more);
        self.bytes += more.len() as u64;
        self.crc32 = check.finalize();
    }
}

/// A file that was read.
#[derive(Debug, Clone)]
pub struct MeasurementFile {
    /// Path of the file, as it was given; empty for bytes from memory.
    pub path: PathBuf,
    /// How it is written.
    pub format: Format,
    /// Why it was taken for this format.
    pub why: String,
    /// All that could be read of it.
    pub contents: Contents,
    /// What was assumed, contradicted or left out.
    pub warnings: Vec<String>,
    /// Of the content as it was read.
    pub digest: Digest,
}

/// The one time record of a file.
#[derive(Debug, Clone)]
pub struct TimeFile<S = f64> {
    /// Its channels.
    pub record: TimeRecord<S>,
    /// What was assumed, contradicted or left out.
    pub warnings: Vec<String>,
    /// Of the file's content.
    pub digest: Digest,
}

impl Contents {
    /// Names and units of files are shown on terminals: control characters in them become visible.
    pub(super) fn show_control_characters(&mut self) {
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
pub(super) fn count(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_digest_is_the_same_in_pieces() {
        // The check value of the standard.
        let whole = Digest::of(b"123456789");
        assert_eq!((whole.bytes, whole.crc32), (9, 0xcbf4_3926));
        let mut pieces = Digest::default();
        for piece in [&b"1234"[..], b"", b"56789"] {
            pieces.extend(piece);
        }
        assert_eq!(pieces, whole);
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), b"123456789").unwrap();
        assert_eq!(Digest::read(file.path()).unwrap(), whole);
        assert_ne!(Digest::of(b"123456780"), whole);
    }
}
