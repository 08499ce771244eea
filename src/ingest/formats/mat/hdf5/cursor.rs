//! Bytes of an HDF5 file, read with bounds: every address and length in it is a claim.

use crate::InputError;

/// Characters of a name.
pub(crate) const NAME: usize = 256;

/// Why something was not read.
#[derive(Debug)]
pub(crate) enum Fault {
    Damaged(String),
    /// More memory or work than the file is granted.
    Budget(InputError),
}

pub(crate) type Step<T> = Result<T, Fault>;

pub(crate) fn damaged<T>(why: impl Into<String>) -> Step<T> {
    Err(Fault::Damaged(why.into()))
}

/// Widths of addresses and lengths, from the superblock.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Widths {
    pub offset: usize,
    pub length: usize,
}

/// A place in the file; addresses count from the superblock's base.
#[derive(Clone)]
pub(crate) struct Cursor<'a> {
    pub bytes: &'a [u8],
    pub at: usize,
    pub widths: Widths,
}

impl<'a> Cursor<'a> {
    pub fn at(bytes: &'a [u8], address: u64, widths: Widths) -> Step<Self> {
        match usize::try_from(address).ok().filter(|at| *at < bytes.len()) {
            Some(at) => Ok(Cursor { bytes, at, widths }),
            None => damaged("an address beyond the end of the file: cut off or damaged"),
        }
    }

    pub fn take(&mut self, count: usize) -> Step<&'a [u8]> {
        let end = self.at.checked_add(count);
        match end.and_then(|end| self.bytes.get(self.at..end)) {
            Some(part) => {
                self.at += count;
                Ok(part)
            }
            None => damaged("the file ends within its structure: cut off or damaged"),
        }
    }

    /// An unsigned integer of up to eight bytes, little-endian.
    pub fn uint(&mut self, size: usize) -> Step<u64> {
        if size > 8 {
            return damaged("an integer of more than eight bytes");
        }
        Ok(self
            .take(size)?
            .iter()
            .rev()
            .fold(0, |sum, b| sum << 8 | u64::from(*b)))
    }

    pub fn byte(&mut self) -> Step<u8> {
        Ok(self.uint(1)? as u8)
    }

    pub fn count(&mut self, size: usize) -> Step<usize> {
        match usize::try_from(self.uint(size)?) {
            Ok(count) => Ok(count),
            Err(_) => damaged("a count beyond all bounds"),
        }
    }

    /// An address; `None` where it is all ones, which means none.
    pub fn address(&mut self) -> Step<Option<u64>> {
        let width = self.widths.offset;
        let value = self.uint(width)?;
        let none = if width == 8 {
            u64::MAX
        } else {
            (1 << (8 * width)) - 1
        };
        Ok((value != none).then_some(value))
    }

    pub fn length(&mut self) -> Step<usize> {
        self.count(self.widths.length)
    }

    pub fn signature(&mut self, expected: &[u8]) -> Step<()> {
        let found = self.take(expected.len())?;
        if found == expected {
            return Ok(());
        }
        damaged(format!(
            "no block {} where one should be",
            String::from_utf8_lossy(expected)
        ))
    }

    /// Signature, then version 0 and one more byte, as most index blocks begin.
    pub fn block(&mut self, signature: &[u8]) -> Step<u8> {
        self.signature(signature)?;
        match self.byte()? {
            0 => self.byte(),
            version => damaged(format!("version {version} of a block that is not known here")),
        }
    }

    /// Compares the checksum that follows with that of the bytes from `start` on.
    pub fn checksum(&mut self, start: usize) -> Step<()> {
        let covered = self.bytes.get(start..self.at).unwrap_or_default();
        match self.uint(4)? as u32 == lookup3(covered) {
            true => Ok(()),
            false => damaged("a checksum is wrong"),
        }
    }
}

/// Bytes that hold a number up to `limit` (`H5VM_limit_enc_size`).
pub(crate) fn bytes_for(limit: u64) -> usize {
    (limit.max(1).ilog2() / 8 + 1) as usize
}

/// Checksum of the format's metadata: lookup3, little-endian, start value 0 (Jenkins 2006, public domain).
pub(crate) fn lookup3(bytes: &[u8]) -> u32 {
    let start = 0xdead_beef_u32.wrapping_add(bytes.len() as u32);
    let [mut a, mut b, mut c] = [start; 3];
    let word = |part: &[u8]| part.iter().rev().fold(0_u32, |sum, b| sum << 8 | u32::from(*b));
    let mut rest = bytes;
    while rest.len() > 12 {
        a = a.wrapping_add(word(&rest[..4]));
        b = b.wrapping_add(word(&rest[4..8]));
        c = c.wrapping_add(word(&rest[8..12]));
        rest = &rest[12..];
        for turn in [4, 6, 8, 16, 19, 4] {
            // a −= c; a ^= rot(c, n); c += b, and the same with the names moved on by one.
            a = a.wrapping_sub(c) ^ c.rotate_left(turn);
            c = c.wrapping_add(b);
            (a, b, c) = (b, c, a);
        }
    }
    if rest.is_empty() {
        return c;
    }
    let mut last = [0; 12];
    last[..rest.len()].copy_from_slice(rest);
    a = a.wrapping_add(word(&last[..4]));
    b = b.wrapping_add(word(&last[4..8]));
    c = c.wrapping_add(word(&last[8..]));
    for turn in [14, 11, 25, 16, 4, 14, 24] {
        // c ^= b; c −= rot(b, n), and the same with the names moved on by one.
        c = (c ^ b).wrapping_sub(b.rotate_left(turn));
        (a, b, c) = (b, c, a);
    }
    // Seven turns of three names: the last one changed stands in b.
    b
}
