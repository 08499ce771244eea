//! NI TDMS: segments of metadata and raw samples (little- and big-endian, interleaved or not).
//!
//! Source: National Instruments, "TDMS File Format Internal Structure" (2023). Strings, time stamps as samples and
//! DAQmx scaled data are not read: a channel of that kind is named and left out.

use std::collections::HashMap;

use crate::InputError;
use crate::data::TimeRecord;
use crate::ingest::formats::waveform;
use crate::ingest::text::Notes;

const LEAD_IN: usize = 28;
const META: u32 = 1 << 1;
const NEW_LIST: u32 = 1 << 2;
const RAW: u32 = 1 << 3;
const INTERLEAVED: u32 = 1 << 5;
const BIG_ENDIAN: u32 = 1 << 6;
const DAQMX: u32 = 1 << 7;
const NO_DATA: u32 = 0xFFFF_FFFF;
const SAME_AS_BEFORE: u32 = 0;
const STRING: u32 = 0x20;
const TIME_STAMP: u32 = 0x44;
/// More samples than this are a damaged count, not a measurement.
const MOST_SAMPLES: usize = 1 << 30;

#[derive(Debug, Clone, PartialEq)]
enum Property {
    Number(f64),
    Text(String),
}

#[derive(Debug, Default)]
struct Object {
    path: String,
    properties: HashMap<String, Property>,
    kind: u32,
    /// Values in each chunk of the segments at hand.
    count: usize,
    has_data: bool,
    is_listed: bool,
    samples: Vec<f64>,
    unreadable: Option<&'static str>,
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

/// Reads all channels that are waveforms, one record for each time axis.
pub(crate) fn read(bytes: &[u8], notes: &mut Notes) -> Result<Vec<TimeRecord>, InputError> {
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
    records(objects.all, notes)
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
            length => {
                if flags & DAQMX != 0 || length == 0x1269 || length == 0x126A {
                    return Err(InputError::new(
                        "a TDMS file with unscaled DAQmx data, which is not read here",
                    )
                    .remedy("in LabVIEW or DIAdem: save the scaled data"));
                }
                object.kind = reader.u32()?;
                reader.u32()?;
                object.count = reader.integer(8)? as usize;
                if object.kind == STRING {
                    reader.integer(8)?;
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

fn data(
    raw: &[u8],
    flags: u32,
    big: bool,
    list: &[usize],
    objects: &mut [Object],
    work: &mut usize,
) -> Result<(), InputError> {
    let mut sizes = Vec::with_capacity(list.len());
    for &index in list {
        match size_of_kind(objects[index].kind) {
            Some(size) => sizes.push(size),
            None => {
                objects[index].unreadable = Some("text, time stamps or complex numbers: left out");
                // Where one channel's length is not known the others cannot be found.
                if list.len() > 1 {
                    return Err(InputError::new(format!(
                        "TDMS channel {} holds neither integers nor floating-point numbers",
                        objects[index].path
                    ))
                    .remedy("save the waveforms without text or time-stamp channels"));
                }
                return Ok(());
            }
        }
    }
    let chunk: usize = list
        .iter()
        .zip(&sizes)
        .try_fold(0usize, |sum, (i, size)| {
            sum.checked_add(objects[*i].count.checked_mul(*size)?)
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
                    let object = &mut objects[index];
                    object
                        .samples
                        .push(number(&values[at..at + size], object.kind, big));
                    at += size;
                }
            }
            continue;
        }
        for (&index, &size) in list.iter().zip(&sizes) {
            let object = &mut objects[index];
            let length = object.count * size;
            let own = &part[at.min(part.len())..(at + length).min(part.len())];
            if object.samples.len() + own.len() / size > MOST_SAMPLES {
                return Err(cut());
            }
            object
                .samples
                .extend(own.chunks_exact(size).map(|b| number(b, object.kind, big)));
            at += length;
        }
    }
    Ok(())
}

fn records(objects: Vec<Object>, notes: &mut Notes) -> Result<Vec<TimeRecord>, InputError> {
    let mut records: Vec<TimeRecord> = Vec::new();
    for object in objects {
        // /'group'/'channel'
        let name = object
            .path
            .rsplit("/'")
            .next()
            .unwrap_or_default()
            .trim_end_matches('\'')
            .to_owned();
        if let Some(why) = object.unreadable {
            notes.about(&name, why);
        }
        if object.samples.is_empty() {
            continue;
        }
        let property = |key: &str| object.properties.get(key);
        let step = match property("wf_increment") {
            Some(Property::Number(step)) if step.is_finite() && *step > 0.0 => *step,
            _ => {
                notes.about(&name, "no sampling interval (wf_increment): left out");
                continue;
            }
        };
        let start_s = match property("wf_start_offset") {
            Some(Property::Number(s)) if s.is_finite() => *s,
            _ => 0.0,
        };
        let file_unit = ["unit_string", "NI_UnitDescription", "unit"]
            .iter()
            .find_map(|key| match property(key) {
                Some(Property::Text(text)) if !text.is_empty() => Some(text.clone()),
                _ => None,
            })
            .unwrap_or_default();
        if object.samples.iter().any(|v| !v.is_finite()) {
            notes.about(&name, "values that are not numbers: left out");
            continue;
        }
        let channel = waveform::channel(name, file_unit, object.samples, notes)?;
        waveform::put(&mut records, 1.0 / step, start_s, channel)?;
    }
    if records.is_empty() {
        return Err(
            InputError::new("a TDMS file without waveforms (channels with a sampling interval)")
                .remedy("save the channels as waveforms, or export a CSV with a time column"),
        );
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
            let records = read(&file(interleaved, big), &mut Notes::default()).unwrap();
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
        let records = read(&twice, &mut Notes::default()).unwrap();
        assert_eq!(records[0].channels[1].samples.len(), 6);
        let whole = file(false, false);
        for cut_at in 0..whole.len() {
            // Never a panic; an error, or what is there of the samples.
            let _ = read(&whole[..cut_at], &mut Notes::default());
        }
        for at in 0..whole.len() {
            let mut damaged = whole.clone();
            damaged[at] ^= 0xFF;
            let _ = read(&damaged, &mut Notes::default());
        }
    }
}
