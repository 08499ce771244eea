//! Text logs too long to be held as text: time tables are read piece by piece.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::contents::{Contents, Digest, Format, MeasurementFile, TimeFile};
use super::decode::{dofs_from_file_name, read_bytes};
use super::detect::{self, Detected};
use super::quality::{QualityCheck, quality_warnings};
use super::text::{self, Notes};
use crate::data::{Channel, Sample, TimeRecord};
use crate::files::regular_file;
use crate::ingest::formats::force::Pieces;
use crate::ingest::tables::table::{Header, Table, holds};
use crate::progress::Progress;
use crate::{Error, InputError, Result};

/// Bytes of text up to which a file is read as a whole: a record of 150 s, 4 channels and 10 kHz.
const SHORT: usize = 64 << 20;
/// The same where nothing but a survey is wanted: what is not kept needs no memory, and memory costs more time than reading.
const SHORT_FOR_SURVEY: usize = 8 << 20;
/// Bytes of text held at once of a longer one: few enough for text and numbers to stay in the processor's cache between one
/// look at them and the next.
const PIECE: usize = 4 << 20;

/// A file that was read, or one that is read piece by piece.
pub(super) enum Opened {
    Read(MeasurementFile),
    Long(Box<LongRecord>),
}

/// The force record of a file.
pub enum ForceFile {
    /// As it was read.
    Short(TimeFile),
    /// Of a long file, whose samples would need about as much memory as its text.
    Long(TimeFile<f32>),
}

/// Do samples that differ from their neighbours still do so with seven digits? Then these tell all that the recorder told.
fn is_told_by_half(samples: &[f64]) -> bool {
    let mut pairs = samples.windows(2);
    pairs.all(|w| w[0] == w[1] || w[0] as f32 != w[1] as f32)
}

/// A time table of more than [`SHORT`] bytes.
pub(super) struct LongRecord {
    path: PathBuf,
    bytes: u64,
    text: Text,
    format: Format,
    why: String,
    pieces: Pieces,
    /// Of the text that comes next.
    line: usize,
    at_end: bool,
    /// Bytes of text for each sample, from the first piece.
    bytes_per_sample: f64,
    /// It became a time table by what a campaign says of it.
    pub(super) is_named: bool,
    notes: Notes,
    progress: Progress,
}

/// A file's text, a piece at a time.
struct Text {
    file: File,
    piece: usize,
    /// Read and not yet made numbers.
    read: Vec<u8>,
    /// Nothing comes behind what is read.
    is_last: bool,
    /// Of what was read so far.
    digest: Digest,
}

impl Text {
    /// Reads on until there is a whole piece.
    fn fill(&mut self) -> std::io::Result<()> {
        let kept = self.read.len();
        let missing = self.piece.saturating_sub(kept);
        let read = (&mut self.file)
            .take(missing as u64)
            .read_to_end(&mut self.read)?;
        self.is_last = read < missing;
        self.digest.extend(&self.read[kept..]);
        Ok(())
    }
}

/// What a file is and what looks wrong with its time records, without their samples where there are very many.
pub struct Survey {
    /// The time records of a long file have their channels and no samples.
    pub file: MeasurementFile,
    /// Samples of each time record.
    pub samples: Vec<usize>,
    /// What looks wrong with the time records, see [`super::quality_warnings`].
    pub quality: Vec<String>,
}

/// Reads a file to see what it is; a text log of any length in bounded memory.
///
/// # Errors
/// As [`super::read_file`].
pub fn survey(path: &Path) -> Result<Survey> {
    let of_file = |file: MeasurementFile| {
        let times = &file.contents.times;
        Survey {
            samples: times.iter().map(TimeRecord::len).collect(),
            quality: times.iter().flat_map(quality_warnings).collect(),
            file,
        }
    };
    match open_by(path, SHORT_FOR_SURVEY, PIECE, &|_| None)? {
        Opened::Read(file) => Ok(of_file(file)),
        // Some can be read as a whole only, those with uneven times among them.
        Opened::Long(long) if long.bytes <= SHORT as u64 => {
            survey_by_pieces(*long).or_else(|_| read_at_once(path).map(of_file))
        }
        Opened::Long(long) => survey_by_pieces(*long),
    }
}

fn read_at_once(path: &Path) -> Result<MeasurementFile> {
    decoded(path, &std::fs::read(path).map_err(|e| Error::io(path, e))?)
}

fn survey_by_pieces(mut long: LongRecord) -> Result<Survey> {
    let mut check: Option<QualityCheck> = None;
    let (mut first, mut rows) = (None, 0);
    let mut next = long.next_piece()?;
    while let Some(mut piece) = next {
        let expected = long.expected_samples();
        let check = check.get_or_insert_with(|| QualityCheck::for_length(expected));
        // A piece is looked at while the one behind it is read.
        let (_, read) = rayon::join(|| check.add(&piece), || long.next_piece());
        next = read?;
        rows += piece.len();
        let samples = piece.channels.iter_mut().map(|c| std::mem::take(&mut c.samples));
        long.pieces.spare.extend(samples);
        piece.filled = Vec::new();
        first.get_or_insert(piece);
    }
    Ok(Survey {
        file: long.file_with(first.into_iter().collect()),
        samples: vec![rows],
        quality: check.map_or(Vec::new(), |c| c.warnings()),
    })
}

/// Reads a file, or opens it as a long record.
pub(super) fn open(path: &Path) -> Result<Opened> {
    open_by(path, SHORT, PIECE, &|_| None)
}

/// As [`open`]; `named` makes a time table of what is none by itself.
pub(super) fn open_named(path: &Path, named: Named) -> Result<Opened> {
    open_by(path, SHORT, PIECE, named)
}

/// Gives a header without names or times both, where it can.
type Named<'a> = &'a dyn Fn(Header) -> Option<Header>;

fn open_by(path: &Path, short: usize, piece: usize, named: Named) -> Result<Opened> {
    let refused = |e| Error::io(path, e);
    regular_file(path)?;
    let mut file = File::open(path).map_err(refused)?;
    let bytes = file.metadata().map_err(refused)?.len();
    let is_short = bytes <= short as u64;
    let at_once = if is_short { short } else { piece };
    let mut head = Vec::with_capacity(bytes.min(at_once as u64) as usize + 1);
    (&mut file)
        .take(at_once as u64)
        .read_to_end(&mut head)
        .map_err(refused)?;
    // Of the rows of a long record nothing but what is not yet read stays in `head`.
    let head_digest = Digest::of(&head);
    if !is_short && let Some(long) = long_record(path, &mut head, bytes, named) {
        let Found {
            format,
            why,
            pieces,
            is_named,
        } = long;
        let line = pieces.header.data_line;
        let mut text = Text {
            file,
            piece,
            read: head,
            is_last: false,
            digest: head_digest,
        };
        text.fill().map_err(refused)?;
        return Ok(Opened::Long(Box::new(LongRecord {
            path: path.to_path_buf(),
            bytes,
            text,
            format,
            why,
            pieces,
            line,
            at_end: false,
            bytes_per_sample: 0.0,
            is_named,
            notes: Notes::default(),
            progress: Progress::new(
                format!("reading {}", path.display()),
                bytes.div_ceil(piece as u64) as usize,
            ),
        })));
    }
    file.read_to_end(&mut head).map_err(refused)?;
    Ok(Opened::Read(decoded(path, &head)?))
}

/// The file at `path`, whose whole content is `bytes`.
pub(super) fn decoded(path: &Path, bytes: &[u8]) -> Result<MeasurementFile> {
    let mut notes = Notes::default();
    let (format, why, mut contents) =
        read_bytes(bytes, is_dwd_named(path), &mut notes).map_err(|e| e.file(path))?;
    dofs_from_file_name(path, &mut contents.frfs, &mut notes);
    Ok(MeasurementFile {
        path: path.to_path_buf(),
        format,
        why,
        contents,
        warnings: notes.into_warnings(),
        digest: Digest::of(bytes),
    })
}

fn is_dwd_named(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("dwd"))
}

/// A file that can be read by pieces.
struct Found {
    format: Format,
    why: String,
    pieces: Pieces,
    is_named: bool,
}

/// Decides from the first piece of a file whether it is a table that can be read by pieces; leaves the rows in `head`.
fn long_record(path: &Path, head: &mut Vec<u8>, bytes: u64, named: Named) -> Option<Found> {
    debug_assert!(bytes > head.len() as u64);
    if head.starts_with(b"\xFF\xFE") || head.starts_with(b"\xFE\xFF") {
        return None;
    }
    let whole_lines = memchr::memrchr(b'\n', head)? + 1;
    let text = text::without_byte_order_mark(&head[..whole_lines]);
    let mark = whole_lines - text.len();
    let (header, format, why, is_named) = match detect::detect(&text, is_dwd_named(path)) {
        Ok((Detected::TimeTable(header), format, why)) => (header, format, why, false),
        Ok(_) => return None,
        Err(_) => {
            let why = "channels as campaign.toml has them".to_owned();
            (named(Header::find(&text)?)?, Format::TimeCsv, why, true)
        }
    };
    let rows = text.get(header.data_at..).unwrap_or_default();
    if header.decimal_comma_between_commas || holds(rows, b'"') {
        return None;
    }
    let pieces = Pieces::new(&text, header, false);
    let data_at = mark + pieces.header.data_at;
    drop(text);
    head.drain(..data_at);
    Some(Found {
        format,
        why,
        pieces,
        is_named,
    })
}

impl LongRecord {
    /// The next rows; `None` at the end.
    fn next_piece(&mut self) -> Result<Option<TimeRecord>> {
        if self.at_end {
            return Ok(None);
        }
        let text = &mut self.text;
        self.at_end = text.is_last;
        let end = match memchr::memrchr(b'\n', &text.read) {
            Some(at) if !text.is_last => at + 1,
            _ => text.read.len(),
        };
        let fail = |e: crate::InputError| Error::from(e.file(&self.path));
        let (pieces, notes) = (&mut self.pieces, &mut self.notes);
        let mut columns = std::mem::take(&mut pieces.spare);
        let lines = pieces
            .header
            .read_rows_into(&text.read[..end], self.line, text.is_last, notes, &mut columns)
            .map_err(fail)?;
        text.read.drain(..end);
        // The numbers are looked at one after the other, while the disk gives what comes next.
        let (record, filled) = rayon::join(
            || pieces.next(Table { columns }, self.line, notes),
            || if text.is_last { Ok(()) } else { text.fill() },
        );
        let record = record.map_err(fail)?;
        filled.map_err(|e| Error::io(&self.path, e))?;
        self.bytes_per_sample = end as f64 / record.len().max(1) as f64;
        self.line += lines;
        self.progress.step();
        if self.at_end {
            self.pieces.finish(&mut self.notes);
        }
        Ok(Some(record))
    }

    /// Samples of the whole file, from its length.
    fn expected_samples(&self) -> usize {
        (self.bytes as f64 / self.bytes_per_sample.max(1.0)) as usize
    }

    /// All pieces in one record.
    pub(super) fn whole(mut self) -> Result<MeasurementFile> {
        let times = match self.next_piece()? {
            Some(first) => vec![self.joined(first, &mut Ok)?],
            None => Vec::new(),
        };
        Ok(self.file_with(times))
    }

    /// What `each` makes of the pieces, in one record: in half the memory where that loses nothing.
    pub(super) fn forces(
        mut self,
        mut each: impl FnMut(TimeRecord) -> Result<TimeRecord>,
    ) -> Result<ForceFile> {
        let first = self.next_piece()?;
        let first = first.ok_or_else(|| InputError::new("a time table without rows").file(&self.path))?;
        let first = each(first)?;
        if first.channels.iter().all(|c| is_told_by_half(&c.samples)) {
            let record = self.joined(first, &mut each)?;
            Ok(ForceFile::Long(self.time_file(record)))
        } else {
            let record = self.joined(first, &mut each)?;
            Ok(ForceFile::Short(self.time_file(record)))
        }
    }

    /// The piece read last and those after it.
    fn joined<S: Sample>(
        &mut self,
        first: TimeRecord,
        each: &mut impl FnMut(TimeRecord) -> Result<TimeRecord>,
    ) -> Result<TimeRecord<S>> {
        let expected = self.expected_samples();
        let with_room = |channel: Channel| {
            let mut samples = Vec::with_capacity((expected + expected / 50).max(channel.samples.len()));
            samples.extend(channel.samples.into_iter().map(S::of));
            Channel {
                name: channel.name,
                file_unit: channel.file_unit,
                role: channel.role,
                samples,
            }
        };
        let mut record = TimeRecord {
            sample_rate_hz: first.sample_rate_hz,
            start_s: first.start_s,
            channels: first.channels.into_iter().map(with_room).collect(),
            filled: first.filled,
        };
        while let Some(piece) = self.next_piece()? {
            let piece = each(piece)?;
            let at = record.len();
            record
                .filled
                .extend(piece.filled.iter().map(|r| r.start + at..r.end + at));
            for (channel, more) in record.channels.iter_mut().zip(piece.channels) {
                channel.samples.extend(more.samples.iter().map(|v| S::of(*v)));
                self.pieces.spare.push(more.samples);
            }
        }
        Ok(record)
    }

    fn time_file<S>(self, record: TimeRecord<S>) -> TimeFile<S> {
        TimeFile {
            record,
            warnings: self.notes.into_warnings(),
            digest: self.text.digest,
        }
    }

    fn file_with(self, times: Vec<TimeRecord>) -> MeasurementFile {
        MeasurementFile {
            path: self.path,
            format: self.format,
            why: self.why,
            contents: Contents {
                times,
                ..Contents::default()
            },
            warnings: self.notes.into_warnings(),
            digest: self.text.digest,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write as _;

    /// A log at 2 kHz with a gap wherever a piece may end, and the file it is in.
    fn log(change: impl Fn(&mut String)) -> tempfile::NamedTempFile {
        let mut text = String::from("Sampling rate [Hz]:,2000\nTime,Fx,Fy,Mz\nms,N,kN,Nm\n");
        for i in (0..6000).filter(|i| i % 37 != 5) {
            let v = f64::from(i * i % 1013);
            let _ = writeln!(
                text,
                "{:.1},{:.2},{:.4},{:.3}",
                f64::from(i) * 0.5,
                v - 300.0,
                v / 700.0,
                0.1 * v
            );
        }
        change(&mut text);
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        file
    }

    #[test]
    fn half_the_memory_holds_what_seven_digits_tell() {
        let file = log(|_| ());
        let whole = super::super::read_file(file.path()).unwrap();
        let record = &whole.contents.times[0];
        let opened = open_by(file.path(), 4096, 4096, &|_| None).unwrap();
        let Opened::Long(long) = opened else {
            panic!("read as a whole")
        };
        let ForceFile::Long(narrow) = long.forces(Ok).unwrap() else {
            panic!("four digits need no more than seven")
        };
        assert_eq!(narrow.record.filled, record.filled);
        assert_eq!(narrow.digest, whole.digest);
        for (a, b) in record.channels.iter().zip(&narrow.record.channels) {
            assert_eq!(
                (&a.name, a.role, a.samples.len()),
                (&b.name, b.role, b.samples.len())
            );
            let pairs = a.samples.iter().zip(&b.samples);
            assert!(
                pairs
                    .clone()
                    .all(|(a, b)| (a - b.value()).abs() <= 1e-7 * a.abs())
            );
        }
        assert!(is_told_by_half(&[1e4, 1e4, 1.0001e4]));
        assert!(!is_told_by_half(&[1e4, 1e4 + 1e-5]));
    }

    #[test]
    fn a_table_without_names_is_read_by_pieces_where_a_campaign_names_it() {
        let file = log(|text| *text = text.split_off(text.find("\n0.0").unwrap() + 1));
        let named = |mut header: Header| {
            header.names = (1..=header.columns).map(|i| format!("column {i}")).collect();
            header.lines.push("Sampling rate [Hz]:,2000".into());
            Some(header)
        };
        assert!(matches!(
            open_by(file.path(), 9000, 9000, &|_| None),
            Err(Error::Input(_))
        ));
        let Ok(Opened::Long(long)) = open_by(file.path(), 9000, 9000, &named) else {
            panic!("not read by pieces")
        };
        assert!(long.is_named);
        let whole = long.whole().unwrap();
        let record = &whole.contents.times[0];
        // One in 37 rows is missing, and nothing tells it.
        assert_eq!((record.len(), record.channels.len()), (5837, 4));
        assert_eq!(record.channels[1].samples[3], 3.0 * 3.0 - 300.0);
    }

    fn by_pieces(path: &Path, piece: usize) -> Result<MeasurementFile> {
        match open_by(path, piece, piece, &|_| None)? {
            Opened::Long(long) => long.whole(),
            Opened::Read(_) => panic!("read as a whole"),
        }
    }

    #[test]
    fn pieces_add_up_to_the_whole() {
        let file = log(|_| ());
        let whole = super::super::read_file(file.path()).unwrap();
        let record = &whole.contents.times[0];
        // Every 37th sample is missing and filled, but for the very last.
        assert_eq!((record.len(), record.filled.len()), (5999, 162));
        for piece in [4096, 10_000, 33_333, 100_000] {
            let long = by_pieces(file.path(), piece).unwrap();
            let other = &long.contents.times[0];
            assert_eq!(other.sample_rate_hz, 2000.0);
            assert_eq!((other.start_s, &other.filled), (record.start_s, &record.filled));
            for (a, b) in record.channels.iter().zip(&other.channels) {
                assert_eq!((&a.name, a.role, &a.file_unit), (&b.name, b.role, &b.file_unit));
                assert!(a.samples == b.samples, "{piece}: {}", a.name);
            }
            assert_eq!(whole.warnings, long.warnings);
            assert_eq!(whole.digest, long.digest);
        }
    }

    #[test]
    fn errors_name_the_line_wherever_pieces_end() {
        let spoilt = log(|text| *text = text.replacen("\n2000.0,", "\n2000.0;", 1));
        let message = |e: Result<MeasurementFile>| e.unwrap_err().to_string();
        let whole = message(super::super::read_file(spoilt.path()));
        assert!(whole.contains(":3896: 4 numbers are expected"), "{whole}");
        for piece in [4096, 50_000] {
            assert_eq!(message(by_pieces(spoilt.path(), piece)), whole);
        }
        let cut_short = log(|text| text.truncate(text.len() - 9));
        let long = by_pieces(cut_short.path(), 8192).unwrap();
        assert!(
            long.warnings
                .contains(&"the last row is incomplete and left out".to_owned())
        );
        assert_eq!(long.contents.times[0].len(), 5998);
    }
}
