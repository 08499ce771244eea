//! ZIP archives read: what NPZ and XLSX are made of. Members without encryption, stored or deflated, up to 4 GB.
//!
//! Source: APPNOTE.TXT, .ZIP File Format Specification 6.3 (PKWARE), sections 4.3.7, 4.3.12 and 4.3.16.

use std::io::Read as _;

use flate2::read::DeflateDecoder;

use crate::InputError;
use crate::ingest::budget::Budget;

const CENTRAL: &[u8] = b"PK\x01\x02";
const END: &[u8] = b"PK\x05\x06";
/// The end record has a comment of up to so many bytes behind it.
const COMMENT: usize = 65_557;
const MOST_MEMBERS: usize = 10_000;

/// A member, still packed.
pub(crate) struct Member<'a> {
    pub name: String,
    packed: &'a [u8],
    method: usize,
    size: usize,
}

fn damaged() -> InputError {
    InputError::new("a zip archive (xlsx, npz) that is cut off or damaged")
        .remedy("copy it again from where it was saved")
}

fn number(bytes: &[u8], at: usize, size: usize) -> Result<usize, InputError> {
    let part = bytes.get(at..at + size).ok_or_else(damaged)?;
    Ok(part.iter().rev().fold(0, |sum, b| sum << 8 | usize::from(*b)))
}

pub(crate) fn looks_like(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PK\x03\x04")
}

/// What the archive holds.
///
/// # Errors
/// A damaged archive.
pub(crate) fn members(bytes: &[u8]) -> Result<Vec<Member<'_>>, InputError> {
    let tail = bytes.len().saturating_sub(COMMENT);
    let end = memchr::memmem::rfind(&bytes[tail..], END).ok_or_else(damaged)? + tail;
    let count = number(bytes, end + 10, 2)?;
    let mut at = number(bytes, end + 16, 4)?;
    let mut members = Vec::new();
    for _ in 0..count.min(MOST_MEMBERS) {
        if bytes.get(at..at + 4) != Some(CENTRAL) {
            return Err(damaged());
        }
        let (method, packed, size) = (
            number(bytes, at + 10, 2)?,
            number(bytes, at + 20, 4)?,
            number(bytes, at + 24, 4)?,
        );
        let (name, extra, comment) = (
            number(bytes, at + 28, 2)?,
            number(bytes, at + 30, 2)?,
            number(bytes, at + 32, 2)?,
        );
        let local = number(bytes, at + 42, 4)?;
        let text = bytes.get(at + 46..at + 46 + name).ok_or_else(damaged)?;
        let data = local + 30 + number(bytes, local + 26, 2)? + number(bytes, local + 28, 2)?;
        members.push(Member {
            name: String::from_utf8_lossy(text).into_owned(),
            packed: bytes.get(data..data + packed).ok_or_else(damaged)?,
            method,
            size,
        });
        at += 46 + name + extra + comment;
    }
    Ok(members)
}

impl Member<'_> {
    /// Its bytes.
    ///
    /// # Errors
    /// A damaged member, a way of packing that is not known, or more memory than the budget has.
    pub fn bytes(&self, budget: &mut Budget) -> Result<Vec<u8>, InputError> {
        budget.take(self.size, &format!("member {}", self.name))?;
        let mut out = Vec::new();
        match self.method {
            0 => out.extend_from_slice(self.packed),
            8 => {
                let most = self.size as u64 + 1;
                DeflateDecoder::new(self.packed)
                    .take(most)
                    .read_to_end(&mut out)
                    .map_err(|_| damaged())?;
            }
            _ => return Err(damaged()),
        }
        if out.len() == self.size {
            Ok(out)
        } else {
            Err(damaged())
        }
    }
}
