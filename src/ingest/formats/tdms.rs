//! NI TDMS: segments of metadata and raw samples (little- and big-endian, interleaved or not).
//!
//! Source: National Instruments, "TDMS File Format Internal Structure" (2023). Scales that are stored beside raw values are
//! applied ([`scale`]); DAQmx data with one value a channel is read, digital lines are not. Text is left out.

mod scale;

use std::collections::HashMap;

use crate::InputError;
use crate::data::TimeRecord;
use crate::ingest::formats::tdms::scale::{Properties, Property};
use crate::ingest::formats::waveform;
use crate::ingest::tables::channel_names;
use crate::ingest::tables::clock::{self, Stamps};
use crate::ingest::text::Notes;
use crate::ingest::units::{self, Dimension};

const LEAD_IN: usize = 28;
const META: u32 = 1 << 1;
const NEW_LIST: u32 = 1 << 2;
const RAW: u32 = 1 << 3;
const INTERLEAVED: u32 = 1 << 5;
const BIG_ENDIAN: u32 = 1 << 6;
/// Raw data indices of DAQmx: format changing scaler, digital line scaler.
const DAQMX_SCALER: u32 = 0x1269;
const DAQMX_DIGITAL: u32 = 0x126A;
const NO_DATA: u32 = 0xFFFF_FFFF;
const SAME_AS_BEFORE: u32 = 0;
const STRING: u32 = 0x20;
const TIME_STAMP: u32 = 0x44;
/// More samples than this are a damaged count, not a measurement.
const MOST_SAMPLES: usize = 1 << 30;

#[derive(Debug, Default)]
struct Object {
    path: String,
    properties: Properties,
    kind: u32,
    /// Values in each chunk of the segments at hand.
    count: usize,
    /// Bytes in each chunk, where values differ in length (text).
    text_bytes: usize,
    /// Where DAQmx puts its values.
    daqmx: Option<Daqmx>,
    /// Seconds of the first time stamp, which the others are counted from.
    first_stamp: Option<i64>,
    has_data: bool,
    is_listed: bool,
    samples: Vec<f64>,
    unreadable: Option<&'static str>,
}

/// A channel's place in the raw data of DAQmx, which lies in one buffer a device, sample by sample.
#[derive(Debug, Clone, PartialEq)]
struct Daqmx {
    buffer: usize,
    offset: usize,
    /// Bytes of a sample of all channels, for each buffer.
    widths: Vec<usize>,
}

impl Object {
    fn push(&mut self, bytes: &[u8], big: bool) {
        let value = if self.kind == TIME_STAMP {
            let raw = if big {
                bytes.try_into().map(u128::from_be_bytes)
            } else {
                bytes.try_into().map(u128::from_le_bytes)
            };
            // Seconds since 1904 above, the fraction of one below.
            let raw = raw.unwrap_or(0);
            let (seconds, fraction) = ((raw >> 64) as i64, raw as u64);
            let first = *self.first_stamp.get_or_insert(seconds);
            seconds.wrapping_sub(first) as f64 + fraction as f64 / 2f64.powi(64)
        } else {
            number(bytes, self.kind, big)
        };
        self.samples.push(value);
    }
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    big: bool,
}

fn cut() -> InputError {
    InputError::new("the TDMS file is cut off or damaged").remedy("copy it again from where it was recorded")
}

impl<'a> Reader<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], InputError> {
        let end = self.at.checked_add(count).ok_or_else(cut)?;
        let part = self.bytes.get(self.at..end).ok_or_else(cut)?;
        self.at = end;
        Ok(part)
    }

    /// An unsigned integer of up to eight bytes.
    fn integer(&mut self, size: usize) -> Result<u64, InputError> {
        let part = self.take(size)?;
        let shift = |sum: u64, b: &u8| sum << 8 | u64::from(*b);
        Ok(if self.big {
            part.iter().fold(0, shift)
        } else {
            part.iter().rev().fold(0, shift)
        })
    }

    fn u32(&mut self) -> Result<u32, InputError> {
        Ok(self.integer(4)? as u32)
    }

    fn text(&mut self) -> Result<String, InputError> {
        let length = self.u32()? as usize;
        Ok(String::from_utf8_lossy(self.take(length)?).into_owned())
    }

    fn property(&mut self) -> Result<Property, InputError> {
        match self.u32()? {
            STRING => Ok(Property::Text(self.text()?)),
            TIME_STAMP => {
                self.take(16)?;
                Ok(Property::Text(String::new()))
            }
            kind => {
                let size = size_of_kind(kind).ok_or_else(cut)?;
                let bytes = self.take(size)?;
                Ok(Property::Number(number(bytes, kind, self.big)))
            }
        }
    }
}

fn size_of_kind(kind: u32) -> Option<usize> {
    Some(match kind {
        1 | 5 | 0x21 => 1,
        2 | 6 => 2,
        3 | 7 | 9 | 0x19 => 4,
        4 | 8 | 0xA | 0x1A => 8,
        TIME_STAMP => 16,
        _ => return None,
    })
}

fn number(bytes: &[u8], kind: u32, big: bool) -> f64 {
    let mut raw = 0u64;
    let mut push = |b: &u8| raw = raw << 8 | u64::from(*b);
    if big {
        bytes.iter().for_each(&mut push);
    } else {
        bytes.iter().rev().for_each(&mut push);
    }
    match kind {
        1 => f64::from(raw as u8 as i8),
        2 => f64::from(raw as u16 as i16),
        3 => f64::from(raw as u32 as i32),
        4 => raw as i64 as f64,
        9 | 0x19 => f64::from(f32::from_bits(raw as u32)),
        0xA | 0x1A => f64::from_bits(raw),
        _ => raw as f64,
    }
}

/// Kinds of number as DAQmx counts them.
fn daqmx_kind(code: u32) -> Option<u32> {
    Some(match code {
        0 => 5,
        1 => 1,
        2 => 6,
        3 => 2,
        4 => 7,
        5 => 3,
        _ => return None,
    })
}

/// Reads all channels with a time axis, one record for each. `rate_hz`: of channels that have none.
pub(crate) fn read(
    bytes: &[u8],
    rate_hz: Option<f64>,
    notes: &mut Notes,
) -> Result<Vec<TimeRecord>, InputError> {
    let mut objects = Objects::default();
    let mut list: Vec<usize> = Vec::new();
    // Every segment goes through its list of channels: what a file may make us do grows with its size, not with its square.
    let mut work = 64 * bytes.len() + (1 << 20);
    let mut at = 0;
    while at + LEAD_IN <= bytes.len() {
        let mut lead = Reader {
            bytes,
            at,
            big: false,
        };
        if lead.take(4)? != b"TDSm" {
            return Err(InputError::new(format!(
                "no TDMS segment begins at byte {at}: the file is damaged"
            ))
            .remedy("copy it again from where it was recorded"));
        }
        let flags = lead.u32()?;
        lead.big = flags & BIG_ENDIAN != 0;
        lead.u32()?;
        let next = lead.integer(8)?;
        let raw = lead.integer(8)?;
        let from = at + LEAD_IN;
        // All ones: the writer was stopped before it could write the length.
        let unfinished = next == u64::MAX;
        let end = match unfinished {
            true => bytes.len(),
            false => usize::try_from(next)
                .ok()
                .and_then(|n| from.checked_add(n))
                .ok_or_else(cut)?,
        };
        let raw_at = usize::try_from(raw)
            .ok()
            .and_then(|r| from.checked_add(r))
            .ok_or_else(cut)?;
        if unfinished || end > bytes.len() {
            notes.file("the last TDMS segment is not complete: what is there of it was read");
        }
        let end = end.min(bytes.len());
        if raw_at > end {
            return Err(cut());
        }
        if flags & META != 0 {
            let mut reader = Reader {
                bytes: &bytes[..raw_at],
                at: from,
                big: lead.big,
            };
            metadata(&mut reader, flags, &mut objects, &mut list)?;
        }
        if flags & RAW != 0 {
            work = work.checked_sub(list.len()).ok_or_else(cut)?;
            data(
                &bytes[raw_at..end],
                flags,
                lead.big,
                &list,
                &mut objects.all,
                &mut work,
            )?;
        }
        if end <= at {
            return Err(cut());
        }
        at = end;
    }
    records(objects.all, rate_hz, notes)
}

/// All objects, and where each stands by its path.
#[derive(Default)]
struct Objects {
    all: Vec<Object>,
    by_path: HashMap<String, usize>,
}

fn metadata(
    reader: &mut Reader,
    flags: u32,
    objects: &mut Objects,
    list: &mut Vec<usize>,
) -> Result<(), InputError> {
    if flags & NEW_LIST != 0 {
        for index in list.drain(..) {
            objects.all[index].is_listed = false;
        }
    }
    for _ in 0..reader.u32()? {
        let path = reader.text()?;
        let index = match objects.by_path.get(&path) {
            Some(index) => *index,
            None => {
                objects.by_path.insert(path.clone(), objects.all.len());
                objects.all.push(Object {
                    path,
                    ..Object::default()
                });
                objects.all.len() - 1
            }
        };
        let object = &mut objects.all[index];
        match reader.u32()? {
            NO_DATA => object.has_data = false,
            SAME_AS_BEFORE => object.has_data = true,
            DAQMX_DIGITAL => {
                return Err(InputError::new(
                    "a TDMS file with the digital lines of DAQmx, which are not read here",
                )
                .remedy("in LabVIEW or DIAdem: save the scaled data without the digital channels"));
            }
            DAQMX_SCALER => {
                object.has_data = true;
                daqmx_index(reader, object)?;
            }
            _ => {
                object.kind = reader.u32()?;
                object.daqmx = None;
                reader.u32()?;
                object.count = reader.integer(8)? as usize;
                if object.kind == STRING {
                    object.text_bytes = reader.integer(8)? as usize;
                }
                object.has_data = true;
            }
        }
        if object.has_data != object.is_listed {
            object.is_listed = object.has_data;
            match object.has_data {
                true => list.push(index),
                false => list.retain(|i| *i != index),
            }
        }
        for _ in 0..reader.u32()? {
            let name = reader.text()?;
            let value = reader.property()?;
            objects.all[index].properties.insert(name, value);
        }
    }
    Ok(())
}

/// The raw data index of DAQmx: kind, count, scalers and widths of the buffers.
fn daqmx_index(reader: &mut Reader, object: &mut Object) -> Result<(), InputError> {
    reader.u32()?;
    reader.u32()?;
    object.count = reader.integer(8)? as usize;
    let scalers = reader.u32()?;
    let mut first = None;
    for _ in 0..scalers {
        let code = reader.u32()?;
        let buffer = reader.u32()? as usize;
        let offset = reader.u32()? as usize;
        reader.u32()?;
        reader.u32()?;
        first.get_or_insert((code, buffer, offset));
    }
    let mut widths = Vec::new();
    for _ in 0..reader.u32()? {
        widths.push(reader.u32()? as usize);
    }
    let (code, buffer, offset) = first.ok_or_else(cut)?;
    object.unreadable = (scalers > 1).then_some("several raw values a sample (DAQmx): left out");
    object.kind = daqmx_kind(code).ok_or_else(cut)?;
    let size = size_of_kind(object.kind).unwrap_or(8);
    if widths.get(buffer).is_none_or(|w| offset + size > *w) {
        return Err(cut());
    }
    object.daqmx = Some(Daqmx {
        buffer,
        offset,
        widths,
    });
    Ok(())
}

/// Chunks of DAQmx data: for each buffer as many samples as its channels have, all channels side by side.
fn daqmx_data(
    raw: &[u8],
    big: bool,
    list: &[usize],
    objects: &mut [Object],
    work: &mut usize,
) -> Result<(), InputError> {
    let place = |index: usize, objects: &[Object]| objects[index].daqmx.clone().ok_or_else(cut);
    let widths = match list.first() {
        Some(index) => place(*index, objects)?.widths,
        None => return Ok(()),
    };
    let places = list
        .iter()
        .map(|i| place(*i, objects))
        .collect::<Result<Vec<Daqmx>, _>>()?;
    if places.iter().any(|p| p.widths != widths) {
        return Err(cut());
    }
    let rows = |buffer: usize| {
        let of = list.iter().zip(&places).filter(|(_, p)| p.buffer == buffer);
        of.map(|(i, _)| objects[*i].count).max().unwrap_or(0)
    };
    let sizes: Vec<(usize, usize)> = widths.iter().enumerate().map(|(b, w)| (rows(b), *w)).collect();
    let chunk = sizes
        .iter()
        .try_fold(0usize, |sum, (n, w)| sum.checked_add(n.checked_mul(*w)?));
    let chunk = chunk.ok_or_else(cut)?;
    if chunk == 0 {
        return Ok(());
    }
    for part in raw.chunks(chunk) {
        let mut rest = part;
        for (buffer, (count, width)) in sizes.iter().enumerate() {
            let (own, after) = rest.split_at((count * width).min(rest.len()));
            rest = after;
            for row in own.chunks_exact((*width).max(1)) {
                *work = work.checked_sub(list.len()).ok_or_else(cut)?;
                for (&index, place) in list.iter().zip(&places).filter(|(_, p)| p.buffer == buffer) {
                    let size = size_of_kind(objects[index].kind).ok_or_else(cut)?;
                    let bytes = row.get(place.offset..place.offset + size).ok_or_else(cut)?;
                    objects[index].push(bytes, big);
                }
            }
        }
    }
    Ok(())
}

fn data(
    raw: &[u8],
    flags: u32,
    big: bool,
    list: &[usize],
    objects: &mut [Object],
    work: &mut usize,
) -> Result<(), InputError> {
    if list.iter().any(|i| objects[*i].daqmx.is_some()) {
        return daqmx_data(raw, big, list, objects, work);
    }
    let mut sizes = Vec::with_capacity(list.len());
    for &index in list {
        match size_of_kind(objects[index].kind) {
            Some(size) => sizes.push(size),
            None if objects[index].kind == STRING && flags & INTERLEAVED == 0 => {
                objects[index].unreadable = Some("text: left out");
                sizes.push(0);
            }
            None => {
                objects[index].unreadable = Some("neither numbers nor time stamps: left out");
                // Where one channel's length is not known the others cannot be found.
                if list.len() > 1 {
                    return Err(InputError::new(format!(
                        "TDMS channel {} holds neither integers nor floating-point numbers",
                        objects[index].path
                    ))
                    .remedy("save the waveforms without it"));
                }
                return Ok(());
            }
        }
    }
    let length = |object: &Object, size: usize| match size {
        0 => Some(object.text_bytes),
        size => object.count.checked_mul(size),
    };
    let chunk: usize = list
        .iter()
        .zip(&sizes)
        .try_fold(0usize, |sum, (i, size)| {
            sum.checked_add(length(&objects[*i], *size)?)
        })
        .ok_or_else(cut)?;
    if chunk == 0 {
        return Ok(());
    }
    for part in raw.chunks(chunk) {
        let mut at = 0;
        *work = work.checked_sub(list.len()).ok_or_else(cut)?;
        if flags & INTERLEAVED != 0 {
            let row: usize = sizes.iter().sum();
            for values in part.chunks_exact(row.max(1)) {
                let mut at = 0;
                for (&index, &size) in list.iter().zip(&sizes) {
                    objects[index].push(&values[at..at + size], big);
                    at += size;
                }
            }
            continue;
        }
        for (&index, &size) in list.iter().zip(&sizes) {
            let object = &mut objects[index];
            let length = length(object, size).ok_or_else(cut)?;
            if size == 0 {
                at += length;
                continue;
            }
            let own = &part[at.min(part.len())..(at + length).min(part.len())];
            if object.samples.len() + own.len() / size > MOST_SAMPLES {
                return Err(cut());
            }
            object.samples.reserve(own.len() / size);
            own.chunks_exact(size).for_each(|b| object.push(b, big));
            at += length;
        }
    }
    Ok(())
}

/// A channel's times: what has no sampling interval of its own may have a channel of times beside it.
struct Times {
    group: String,
    seconds: Vec<f64>,
    /// Of the times as they were stored.
    resolution_s: f64,
}

/// `/'group'/'channel'`.
fn group_and_name(path: &str) -> (String, String) {
    let (group, name) = path.rsplit_once("/'").unwrap_or(("", path));
    (group.to_owned(), name.trim_end_matches('\'').to_owned())
}

/// Channels of times: time stamps, and what is called so and rises.
fn times_of(objects: &[Object]) -> Vec<Times> {
    let times = objects
        .iter()
        .filter(|o| !o.properties.contains_key("wf_increment"));
    let times = times.filter_map(|object| {
        let (group, name) = group_and_name(&object.path);
        let label = unit_label(object);
        let unit = units::parse_named(&label).or_else(|| channel_names::unit_in_name(&name));
        let unit = unit.filter(|u| u.dimension == Dimension::TIME);
        let is_time = object.kind == TIME_STAMP || channel_names::is_time(&name);
        let rises = object.samples.len() > 1 && object.samples.windows(2).all(|w| w[0] <= w[1]);
        let finite = object.samples.iter().all(|t| t.is_finite());
        let factor = unit.map_or(1.0, |u| u.factor);
        (is_time && rises && finite).then(|| Times {
            group,
            seconds: object.samples.iter().map(|t| t * factor).collect(),
            resolution_s: 1e-9,
        })
    });
    times.collect()
}

fn unit_label(object: &Object) -> String {
    let text = |key: &&str| match object.properties.get(*key) {
        Some(Property::Text(text)) if !text.is_empty() => Some(text.clone()),
        _ => None,
    };
    let keys = ["unit_string", "NI_UnitDescription", "unit"];
    keys.iter().find_map(text).unwrap_or_default()
}

fn records(
    objects: Vec<Object>,
    rate_hz: Option<f64>,
    notes: &mut Notes,
) -> Result<Vec<TimeRecord>, InputError> {
    let mut records: Vec<TimeRecord> = Vec::new();
    let times = times_of(&objects);
    let is_all_about = |path: &str| times.iter().any(|t| t.group == group_and_name(path).0);
    let (mut timeless, mut had_samples) = (Vec::new(), false);
    for mut object in objects {
        let (group, name) = group_and_name(&object.path);
        if let Some(why) = object.unreadable {
            notes.about(&name, why);
            continue;
        }
        if object.samples.is_empty() {
            continue;
        }
        let is_waveform = object.properties.contains_key("wf_increment");
        if !is_waveform
            && (object.kind == TIME_STAMP || is_all_about(&object.path) && channel_names::is_time(&name))
        {
            continue;
        }
        had_samples = true;
        match scale::scales(&object.properties) {
            Ok(scales) => scale::apply(&scales, &mut object.samples),
            Err(kind) => {
                notes.about(&name, format!("raw values with a scale {kind}: left out"));
                continue;
            }
        }
        if object.samples.iter().any(|v| !v.is_finite()) {
            notes.about(&name, "values that are not numbers: left out");
            continue;
        }
        let property = |key: &str| match object.properties.get(key) {
            Some(Property::Number(value)) if value.is_finite() => Some(*value),
            _ => None,
        };
        let start_s = property("wf_start_offset").unwrap_or(0.0);
        let length = object.samples.len();
        let mut own = times.iter().filter(|t| t.seconds.len() == length);
        let beside = own.clone().find(|t| t.group == group).or_else(|| own.next());
        let (rate, start_s) = match (property("wf_increment").filter(|s| *s > 0.0), beside, rate_hz) {
            (Some(step), _, _) => (1.0 / step, start_s),
            (None, Some(times), _) => match clock::look(&times.seconds, times.resolution_s) {
                Ok(Stamps::Even(grid)) => (grid.rate_hz, grid.start_s),
                Ok(Stamps::Uneven(grid, told)) => {
                    notes.file(told);
                    object.samples = clock::resample(&times.seconds, &object.samples, grid);
                    (grid.rate_hz, grid.start_s)
                }
                Err(problem) => {
                    notes.about(
                        &name,
                        format!("times are not evenly spaced ({problem}): left out"),
                    );
                    continue;
                }
            },
            (None, None, Some(rate)) => {
                notes.about(
                    &name,
                    "no sampling interval in the file: that of rate_hz in [[channel]]",
                );
                (rate, 0.0)
            }
            (None, None, None) => {
                timeless.push(name);
                continue;
            }
        };
        let label = unit_label(&object);
        let channel = waveform::channel(name, label, object.samples, notes)?;
        waveform::put(&mut records, rate, start_s, channel)?;
    }
    for name in &timeless {
        notes.about(
            name,
            "no sampling interval (wf_increment) and no channel of times: left out",
        );
    }
    if records.is_empty() {
        let remedy =
            "give rate_hz = 10000.0 in a [[channel]] of campaign.toml, or save the channels as waveforms";
        return Err(match (timeless.is_empty(), had_samples) {
            (false, _) => InputError::new(format!(
                "a TDMS file whose channels ({}) have no sampling interval",
                timeless.join(", ")
            ))
            .remedy(remedy),
            (true, true) => InputError::new("a TDMS file without a channel that can be read here")
                .remedy("in LabVIEW or DIAdem: save the scaled data as numbers"),
            (true, false) => InputError::new("a TDMS file without samples").remedy(remedy),
        });
    }
    Ok(records)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ingest::units;

    /// A segment of two double channels of three samples, by the specification.
    fn file(interleaved: bool, big: bool) -> Vec<u8> {
        let int = |v: u64, size: usize| {
            let bytes = v.to_le_bytes()[..size].to_vec();
            if big {
                bytes.into_iter().rev().collect()
            } else {
                bytes
            }
        };
        let text = |t: &str| [int(t.len() as u64, 4), t.as_bytes().to_vec()].concat();
        let double = |v: f64| int(v.to_bits(), 8);
        let mut meta = int(2, 4);
        for (name, unit) in [("hammer", "N"), ("acc", "g")] {
            meta.extend(text(&format!("/'taps'/'{name}'")));
            meta.extend([int(20, 4), int(0xA, 4), int(1, 4), int(3, 8), int(2, 4)].concat());
            meta.extend([text("wf_increment"), int(0xA, 4), double(0.001)].concat());
            meta.extend([text("unit_string"), int(0x20, 4), text(unit)].concat());
        }
        let values = if interleaved {
            [1.0, 10.0, 2.0, 20.0, 3.0, 30.0]
        } else {
            [1.0, 2.0, 3.0, 10.0, 20.0, 30.0]
        };
        let raw: Vec<u8> = values.iter().flat_map(|v| double(*v)).collect();
        let flags = META
            | NEW_LIST
            | RAW
            | if interleaved { INTERLEAVED } else { 0 }
            | if big { BIG_ENDIAN } else { 0 };
        let mut bytes = b"TDSm".to_vec();
        bytes.extend(flags.to_le_bytes());
        bytes.extend(int(4713, 4));
        bytes.extend(int((meta.len() + raw.len()) as u64, 8));
        bytes.extend(int(meta.len() as u64, 8));
        bytes.extend(meta);
        bytes.extend(raw);
        bytes
    }

    #[test]
    fn waveforms_come_out_whatever_their_order_of_bytes() {
        for (interleaved, big) in [(false, false), (true, false), (false, true)] {
            let records = read(&file(interleaved, big), None, &mut Notes::default()).unwrap();
            assert_eq!(records.len(), 1);
            let record = &records[0];
            approx::assert_relative_eq!(record.sample_rate_hz, 1000.0, max_relative = 1e-12);
            assert_eq!(record.channels[0].name, "hammer");
            assert_eq!(record.channels[0].samples, [1.0, 2.0, 3.0]);
            approx::assert_relative_eq!(record.channels[1].samples[2], 30.0 * units::STANDARD_GRAVITY);
        }
    }

    #[test]
    fn two_segments_are_one_record_and_damage_is_an_error() {
        let mut twice = file(false, false);
        twice.extend(file(false, false));
        let records = read(&twice, None, &mut Notes::default()).unwrap();
        assert_eq!(records[0].channels[1].samples.len(), 6);
        let whole = file(false, false);
        for cut_at in 0..whole.len() {
            // Never a panic; an error, or what is there of the samples.
            let _ = read(&whole[..cut_at], None, &mut Notes::default());
        }
        for at in 0..whole.len() {
            let mut damaged = whole.clone();
            damaged[at] ^= 0xFF;
            let _ = read(&damaged, None, &mut Notes::default());
        }
    }

    /// Name, raw data index and properties.
    type Written<'n> = (&'n str, Vec<u8>, Vec<(&'n str, Property)>);

    /// Objects of one group with their raw data indices and properties, by the specification.
    fn written(objects: &[Written], raw: &[u8]) -> Vec<u8> {
        let text = |t: &str| [(t.len() as u32).to_le_bytes().to_vec(), t.as_bytes().to_vec()].concat();
        let mut meta = (objects.len() as u32).to_le_bytes().to_vec();
        for (name, index, properties) in objects {
            meta.extend(text(&format!("/'dyno'/'{name}'")));
            meta.extend(index);
            meta.extend((properties.len() as u32).to_le_bytes());
            for (key, value) in properties {
                meta.extend(text(key));
                match value {
                    Property::Number(v) => {
                        meta.extend(0xA_u32.to_le_bytes());
                        meta.extend(v.to_le_bytes());
                    }
                    Property::Text(t) => {
                        meta.extend(STRING.to_le_bytes());
                        meta.extend(text(t));
                    }
                }
            }
        }
        let mut bytes = b"TDSm".to_vec();
        bytes.extend((META | NEW_LIST | RAW).to_le_bytes());
        bytes.extend(4713_u32.to_le_bytes());
        bytes.extend(((meta.len() + raw.len()) as u64).to_le_bytes());
        bytes.extend((meta.len() as u64).to_le_bytes());
        bytes.extend(meta);
        bytes.extend(raw);
        bytes
    }

    fn plain(kind: u32, count: u64) -> Vec<u8> {
        let mut index = 20_u32.to_le_bytes().to_vec();
        index.extend(kind.to_le_bytes());
        index.extend(1_u32.to_le_bytes());
        index.extend(count.to_le_bytes());
        index
    }

    fn linear(slope: f64) -> Vec<(&'static str, Property)> {
        vec![
            ("NI_Scaling_Status", Property::Text("unscaled".into())),
            ("NI_Number_Of_Scales", Property::Number(2.0)),
            ("NI_Scale[1]_Scale_Type", Property::Text("Linear".into())),
            ("NI_Scale[1]_Linear_Slope", Property::Number(slope)),
            ("NI_Scale[1]_Linear_Y_Intercept", Property::Number(1.0)),
            ("NI_Scale[1]_Linear_Input_Source", Property::Number(0.0)),
        ]
    }

    #[test]
    fn raw_counts_are_scaled_by_the_properties_beside_them() {
        let mut properties = linear(0.5);
        properties.push(("wf_increment", Property::Number(0.001)));
        let raw: Vec<u8> = [2_i16, -4, 100].iter().flat_map(|v| v.to_le_bytes()).collect();
        let bytes = written(&[("Fx", plain(2, 3), properties.clone())], &raw);
        let record = &read(&bytes, None, &mut Notes::default()).unwrap()[0];
        assert_eq!(record.channels[0].samples, [2.0, -1.0, 51.0]);
        // A scale that is not known leaves its channel out: raw values are no forces.
        properties[2].1 = Property::Text("Thermistor".into());
        let mut notes = Notes::default();
        assert!(
            read(
                &written(&[("Fx", plain(2, 3), properties)], &raw),
                None,
                &mut notes
            )
            .is_err()
        );
        assert!(notes.into_warnings().join("").contains("Thermistor"));
    }

    #[test]
    fn daqmx_data_is_taken_apart_and_scaled() {
        let index = |offset: u32| {
            let mut index = DAQMX_SCALER.to_le_bytes().to_vec();
            index.extend(u32::MAX.to_le_bytes());
            index.extend(1_u32.to_le_bytes());
            index.extend(3_u64.to_le_bytes());
            index.extend(1_u32.to_le_bytes());
            for v in [3_u32, 0, offset, 0, 0] {
                index.extend(v.to_le_bytes());
            }
            index.extend(1_u32.to_le_bytes());
            index.extend(4_u32.to_le_bytes());
            index
        };
        let with_step = |slope: f64| {
            let mut properties = linear(slope);
            properties.push(("wf_increment", Property::Number(1e-4)));
            properties
        };
        // Two chunks of three samples, the second cut short.
        let rows: [[i16; 2]; 5] = [[1, 10], [2, 20], [3, 30], [4, 40], [5, 50]];
        let raw: Vec<u8> = rows.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let objects = [
            ("Fx", index(0), with_step(2.0)),
            ("Fy", index(2), with_step(-1.0)),
        ];
        let record = &read(&written(&objects, &raw), None, &mut Notes::default()).unwrap()[0];
        assert_eq!(record.channels[0].samples, [3.0, 5.0, 7.0, 9.0, 11.0]);
        assert_eq!(record.channels[1].samples, [-9.0, -19.0, -29.0, -39.0, -49.0]);
        assert!((record.sample_rate_hz - 1e4).abs() < 1e-6);
        let whole = written(&objects, &raw);
        for at in 0..whole.len() {
            let mut damaged = whole.clone();
            damaged[at] ^= 0xFF;
            let _ = read(&damaged, None, &mut Notes::default());
            let _ = read(&whole[..at], None, &mut Notes::default());
        }
    }

    #[test]
    fn times_beside_the_channels_or_a_rate_from_outside_will_do() {
        let doubles = |values: &[f64]| -> Vec<u8> { values.iter().flat_map(|v| v.to_le_bytes()).collect() };
        let stamps = |ticks: &[f64]| -> Vec<u8> {
            let stamp = |s: &f64| (3_800_000_000_u128 << 64) + ((s * 2f64.powi(64)) as u128);
            ticks.iter().flat_map(|s| stamp(s).to_le_bytes()).collect()
        };
        let force = doubles(&[1.0, 2.0, 3.0, 4.0]);
        let ms = [doubles(&[0.0, 0.5, 1.0, 1.5]), force.clone()].concat();
        let unit = vec![("unit_string", Property::Text("ms".into()))];
        let named = [("Time", plain(0xA, 4), unit), ("Fx", plain(0xA, 4), vec![])];
        let record = &read(&written(&named, &ms), None, &mut Notes::default()).unwrap()[0];
        assert!((record.sample_rate_hz - 2000.0).abs() < 1e-6 && record.channels.len() == 1);
        let stamped = [
            ("clock", plain(TIME_STAMP, 4), vec![]),
            ("Fx", plain(0xA, 4), vec![]),
        ];
        let raw = [stamps(&[0.0, 0.25, 0.5, 0.75]), force.clone()].concat();
        let record = &read(&written(&stamped, &raw), None, &mut Notes::default()).unwrap()[0];
        assert!(
            (record.sample_rate_hz - 4.0).abs() < 1e-6,
            "{}",
            record.sample_rate_hz
        );
        // Text beside them is passed over.
        let mut text_index = 28_u32.to_le_bytes().to_vec();
        text_index.extend(plain(STRING, 2)[4..].to_vec());
        text_index.extend(10_u64.to_le_bytes());
        let commented = [("note", text_index, vec![]), ("Fx", plain(0xA, 4), vec![])];
        let raw = [b"0123456789".to_vec(), force].concat();
        let bytes = written(&commented, &raw);
        let error = read(&bytes, None, &mut Notes::default()).unwrap_err().to_string();
        assert!(error.contains("(Fx) have no sampling interval"), "{error}");
        let record = &read(&bytes, Some(500.0), &mut Notes::default()).unwrap()[0];
        assert_eq!(
            (record.sample_rate_hz, record.channels[0].samples.as_slice()),
            (500.0, &[1.0, 2.0, 3.0, 4.0][..])
        );
    }
}
