//! HDF5 as far as MAT v7.3 and plain files of numbers need it, bounded in memory and time whatever the file says.
//!
//! Source: The HDF Group, "HDF5 File Format Specification", version 3.0 (superblocks 0 to 3, object headers 1 and 2, both
//! kinds of groups, data layouts 3 and 4 with all their chunk indexes, the filters deflate, shuffle and Fletcher32;
//! checksums of metadata are verified).

use crate::InputError;
use crate::ingest::budget::Budget;
use crate::ingest::formats::mat::variable::Variable;
use crate::ingest::text::Notes;

mod chunks;
mod cursor;
mod group;
mod header;
#[cfg(test)]
mod tests;

use chunks::{ChunkGrid, unpacked};
use cursor::{Cursor, Fault, NAME, Step, Widths, damaged};
use group::Visits;
use header::{Layout, Object, Type};

const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";
/// Structs and cells are followed this deep.
const DEPTH: usize = 16;

/// Where the superblock begins: at the beginning, or behind the block of MATLAB.
fn superblock_at(bytes: &[u8]) -> Option<usize> {
    [0, 512]
        .into_iter()
        .find(|at| bytes.get(*at..at + SIGNATURE.len()) == Some(SIGNATURE))
}

pub(crate) fn looks_like(bytes: &[u8]) -> bool {
    superblock_at(bytes).is_some()
}

/// Reads all numeric arrays, those in groups (`s.f`) and cells (`c{3}`) too.
///
/// # Errors
/// A file whose structure cannot be read, or more memory than its budget.
pub(crate) fn read(
    bytes: &[u8],
    budget: &mut Budget,
    notes: &mut Notes,
) -> Result<Vec<Variable>, InputError> {
    let start = superblock_at(bytes).unwrap_or(0);
    let file = &bytes[start..];
    let mut walk = Walk {
        file,
        widths: Widths { offset: 8, length: 8 },
        // Every node, header and array element takes eight bytes at least.
        visits: Visits(file.len() / 8 + 64),
        variables: Vec::new(),
        lost: Vec::new(),
        budget,
        notes,
    };
    let outcome = walk.root().and_then(|root| walk.object(root, "", DEPTH));
    let unreadable = |why: &str| {
        InputError::new(format!("this HDF5 file (MAT v7.3) cannot be read ({why})"))
            .remedy("copy it again, or save it again in MATLAB in the older form: save('new.mat', '-v7')")
    };
    match outcome {
        Ok(()) if walk.variables.is_empty() && !walk.lost.is_empty() => {
            Err(unreadable(&walk.lost.join("; ")))
        }
        Ok(()) => Ok(walk.variables),
        Err(Fault::Budget(error)) => Err(error),
        Err(Fault::Damaged(why)) => Err(unreadable(&why)),
    }
}

struct Walk<'a> {
    file: &'a [u8],
    widths: Widths,
    visits: Visits,
    variables: Vec<Variable>,
    /// The first variables that could not be read.
    lost: Vec<String>,
    budget: &'a mut Budget,
    notes: &'a mut Notes,
}

impl Walk<'_> {
    /// Reads the superblock; the address of the root group.
    fn root(&mut self) -> Step<u64> {
        let mut cursor = Cursor {
            bytes: self.file,
            at: SIGNATURE.len(),
            widths: self.widths,
        };
        let version = cursor.byte()?;
        let mut width = |cursor: &mut Cursor, skip: usize| {
            cursor.take(skip)?;
            let (offset, length) = (cursor.count(1)?, cursor.count(1)?);
            if ![2, 4, 8].contains(&offset) || ![2, 4, 8].contains(&length) {
                return damaged("addresses of unknown width");
            }
            self.widths = Widths { offset, length };
            cursor.widths = self.widths;
            Ok(())
        };
        match version {
            0 | 1 => {
                width(&mut cursor, 4)?;
                cursor.take(1 + 2 + 2 + 4 + if version == 1 { 4 } else { 0 })?;
                cursor.take(4 * self.widths.offset + self.widths.offset)?;
            }
            2 | 3 => {
                width(&mut cursor, 0)?;
                cursor.take(1 + 3 * self.widths.offset)?;
            }
            _ => return damaged(format!("a superblock of version {version}")),
        }
        let root = cursor.address()?;
        if version > 1 {
            cursor.checksum(0)?;
        }
        root.map_or_else(|| damaged("no root group"), Ok)
    }

    fn object(&mut self, address: u64, path: &str, depth: usize) -> Step<()> {
        self.visits.one()?;
        let object = Object::read(self.file, address, self.widths)?;
        self.attributes(&object, path);
        if !object.is_group() {
            return self.dataset(&object, path, depth);
        }
        if depth == 0 {
            self.notes
                .about(path, "structs or cells in too many others: left out");
            return Ok(());
        }
        for (name, address) in crate::ingest::formats::mat::hdf5::group::links(
            self.file,
            self.widths,
            &object,
            &mut self.visits,
        )? {
            // `#refs#` and `#subsystem#` are MATLAB's own.
            if !name.starts_with('#') {
                let full = if path.is_empty() {
                    name
                } else {
                    format!("{path}.{name}")
                };
                self.inside(address, &full, depth)?;
            }
        }
        Ok(())
    }

    /// A sampling rate or interval that stands beside the data, as h5py programs write it.
    fn attributes(&mut self, object: &Object, path: &str) {
        for (name, kind, bytes) in &object.numbers {
            let variable = |re| Variable {
                name: if path.is_empty() {
                    name.clone()
                } else {
                    format!("{path}.{name}")
                },
                size: vec![1, 1],
                re,
                im: None,
            };
            let (re, _) = of_bytes(bytes, kind);
            let variable = variable(re);
            if variable.says_rate_hz().is_some() {
                self.variables.push(variable);
            }
        }
    }

    /// An object in another one: what is damaged is named, and the rest is read.
    fn inside(&mut self, address: u64, path: &str, depth: usize) -> Step<()> {
        let mut end = path.len().min(NAME);
        while !path.is_char_boundary(end) {
            end -= 1;
        }
        let path = &path[..end];
        match self.object(address, path, depth - 1) {
            Err(Fault::Damaged(why)) => {
                let why = format!("cannot be read ({why}): left out");
                if self.lost.len() < 4 {
                    self.lost.push(format!("{path}: {why}"));
                }
                self.notes.about(path, why);
                // Without visits left every further object would say the same.
                if self.visits.0 == 0 {
                    damaged("its structure refers to itself")
                } else {
                    Ok(())
                }
            }
            other => other,
        }
    }

    fn dataset(&mut self, object: &Object, path: &str, depth: usize) -> Step<()> {
        let (Some(kind), Some(layout)) = (&object.kind, &object.layout) else {
            return Ok(());
        };
        match object.class.as_str() {
            "char" => return Ok(()),
            "" | "double" | "single" | "cell" | "struct" | "logical" => {}
            class if class.starts_with("int") || class.starts_with("uint") => {}
            class => {
                self.notes.about(
                    path,
                    format!("a MATLAB object of class {class}: left out; in MATLAB, save its numbers as plain arrays"),
                );
                return Ok(());
            }
        }
        let Some(dimensions) = object.dimensions.as_ref().filter(|_| !object.is_empty) else {
            return Ok(());
        };
        if let Type::Other(_) = kind {
            return Ok(());
        }
        let element = kind.size(self.widths);
        let count = dimensions.iter().try_fold(1usize, |all, n| all.checked_mul(*n));
        let size = count.and_then(|c| c.checked_mul(element));
        let (Some(count), Some(size)) = (count, size) else {
            return damaged("its size is beyond all bounds");
        };
        if count == 0 {
            return Ok(());
        }
        let what = format!("variable {path}");
        let numbers = count.saturating_mul(16).saturating_add(path.len());
        self.budget.take(numbers, &what).map_err(Fault::Budget)?;
        let raw = self.raw(object, layout, dimensions, element, size, &what)?;
        if *kind == Type::Reference {
            if depth == 0 {
                self.notes
                    .about(path, "structs or cells in too many others: left out");
                return Ok(());
            }
            for (k, address) in raw.chunks_exact(element).enumerate() {
                let address = address
                    .iter()
                    .rev()
                    .fold(0_u64, |sum, b| sum << 8 | u64::from(*b));
                if address != 0 {
                    self.inside(address, &format!("{path}{{{}}}", k + 1), depth)?;
                }
            }
            return Ok(());
        }
        let (re, im) = of_bytes(&raw, kind);
        // HDF5 counts the dimensions from the slowest, MATLAB from the fastest.
        let mut size: Vec<usize> = dimensions.iter().rev().copied().collect();
        size.resize(size.len().max(2), 1);
        self.variables.push(Variable {
            name: path.to_owned(),
            size,
            re,
            im,
        });
        Ok(())
    }

    /// The bytes of a dataset, `size` in all.
    fn raw(
        &mut self,
        object: &Object,
        layout: &Layout,
        dimensions: &[usize],
        element: usize,
        size: usize,
        what: &str,
    ) -> Step<Vec<u8>> {
        let (index, address, chunk) = match layout {
            Layout::Compact(at, length) if *length >= size => return Ok(self.file[*at..at + size].to_vec()),
            Layout::Contiguous(Some(address), length) if *length >= size => {
                let place = Cursor::at(self.file, *address, self.widths)?.take(size)?;
                return Ok(place.to_vec());
            }
            Layout::Contiguous(None, _) => return damaged("never written"),
            Layout::Compact(..) | Layout::Contiguous(..) => return damaged("fewer bytes than its size says"),
            Layout::Chunked {
                index,
                address,
                chunk,
            } => (index, *address, chunk),
        };
        let Some(address) = address else {
            return damaged("never written");
        };
        let bytes = chunk.iter().try_fold(element, |all, n| all.checked_mul(*n));
        let Some(bytes) = bytes.filter(|b| *b > 0 && chunk.len() == dimensions.len()) else {
            return damaged("chunks of impossible size");
        };
        let grid = ChunkGrid {
            file: self.file,
            widths: self.widths,
            size: dimensions,
            most: &object.most,
            chunk,
            bytes,
            filtered: !object.filters.is_empty(),
        };
        let expected = grid.count().unwrap_or(usize::MAX);
        // Unpacking works through so many bytes, whatever of them lies within the dataset.
        let work = expected.saturating_mul(bytes);
        self.budget.take(work, what).map_err(Fault::Budget)?;
        let found = grid.chunks(index, address, &mut self.visits)?;
        let mut raw = vec![0; size];
        let mut put = 0;
        for chunk in &found {
            let within = chunk.from.iter().zip(dimensions).all(|(from, n)| from < n);
            if !within {
                continue;
            }
            put += 1;
            if put > expected {
                return damaged("more chunks than its size allows");
            }
            let stored = Cursor::at(self.file, chunk.address, self.widths)?.take(chunk.size)?;
            let data = unpacked(stored, &object.filters, chunk.mask, element, bytes)?;
            copy(&data, &chunk.from, grid.chunk, &mut raw, dimensions, element);
        }
        if put < expected {
            return damaged(format!("{} of {expected} pieces are missing", expected - put));
        }
        self.budget.give_back(work);
        Ok(raw)
    }
}

/// Puts a chunk into its place; what lies beyond the dataset is left out.
fn copy(data: &[u8], from: &[usize], chunk: &[usize], raw: &mut [u8], size: &[usize], element: usize) {
    let Some(last) = size.len().checked_sub(1) else {
        return raw.copy_from_slice(&data[..raw.len()]);
    };
    let along = chunk[last].min(size[last] - from[last]) * element;
    let rows: usize = chunk[..last].iter().product();
    let mut at = vec![0; last];
    for row in 0..rows {
        let mut rest = row;
        for d in (0..last).rev() {
            at[d] = from[d] + rest % chunk[d];
            rest /= chunk[d];
        }
        if at.iter().zip(size).all(|(k, n)| k < n) {
            let place = at.iter().zip(size).fold(0, |sum, (k, n)| sum * n + k) * size[last] + from[last];
            let source = row * chunk[last] * element;
            raw[place * element..place * element + along].copy_from_slice(&data[source..source + along]);
        }
    }
}

/// Real and imaginary parts. 64-bit integers beyond 2⁵³ are rounded; measurements are not that long.
fn of_bytes(raw: &[u8], kind: &Type) -> (Vec<f64>, Option<Vec<f64>>) {
    let word = |b: &[u8], big: bool| {
        let shift = |sum: u64, b: &u8| sum << 8 | u64::from(*b);
        if big {
            b.iter().fold(0, shift)
        } else {
            b.iter().rev().fold(0, shift)
        }
    };
    let float = |b: &[u8], big: bool| match b.len() {
        4 => f64::from(f32::from_bits(word(b, big) as u32)),
        _ => f64::from_bits(word(b, big)),
    };
    match *kind {
        Type::Integer { size, signed, big } => {
            let number = |b: &[u8]| {
                let bits = word(b, big);
                let unused = 64 - 8 * size as u32;
                if signed {
                    ((bits << unused) as i64 >> unused) as f64
                } else {
                    bits as f64
                }
            };
            (raw.chunks_exact(size).map(number).collect(), None)
        }
        Type::Float { size, big } => (raw.chunks_exact(size).map(|b| float(b, big)).collect(), None),
        Type::Complex { size, big } => {
            let pairs = raw.chunks_exact(2 * size);
            let re = pairs.clone().map(|b| float(&b[..size], big)).collect();
            (re, Some(pairs.map(|b| float(&b[size..], big)).collect()))
        }
        Type::Reference | Type::Other(_) => (Vec::new(), None),
    }
}
