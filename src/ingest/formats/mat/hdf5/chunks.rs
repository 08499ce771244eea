//! Where the chunks of a dataset lie, by each kind of index, and what the filters make of them.

use std::io::Read;

use crate::ingest::formats::mat::hdf5::cursor::{Cursor, Step, Widths, damaged};
use crate::ingest::formats::mat::hdf5::group::{DEPTH, Visits, records};
use crate::ingest::formats::mat::hdf5::header::Index;

const DEFLATE: u16 = 1;
const SHUFFLE: u16 = 2;
const FLETCHER: u16 = 3;

/// One stored chunk.
pub(crate) struct Chunk {
    /// First element along each dimension.
    pub from: Vec<usize>,
    pub address: u64,
    /// Bytes in the file.
    pub size: usize,
    /// Filters that were not used, a bit each.
    pub mask: u32,
}

/// The grid of chunks of a dataset.
pub(crate) struct ChunkGrid<'a> {
    pub file: &'a [u8],
    pub widths: Widths,
    /// Elements along each dimension; the most there may be; elements of a chunk.
    pub size: &'a [usize],
    pub most: &'a [Option<usize>],
    pub chunk: &'a [usize],
    /// Bytes of a chunk unpacked.
    pub bytes: usize,
    pub filtered: bool,
}

impl ChunkGrid<'_> {
    /// Chunks within the dataset; more is damage.
    pub fn count(&self) -> Option<usize> {
        let along = self.size.iter().zip(self.chunk);
        along
            .map(|(n, c)| n.div_ceil(*c))
            .try_fold(1usize, usize::checked_mul)
    }

    pub fn chunks(&self, index: &Index, address: u64, visits: &mut Visits) -> Step<Vec<Chunk>> {
        let mut found = Vec::new();
        match index {
            Index::BTree1 => self.tree(address, DEPTH, visits, &mut found)?,
            Index::Single(size) => found.push(Chunk {
                from: vec![0; self.size.len()],
                address,
                size: size.unwrap_or(self.bytes),
                mask: 0,
            }),
            Index::Implicit => {
                for k in 0..self.count().unwrap_or(0) {
                    visits.one()?;
                    let at = address.saturating_add((k as u64).saturating_mul(self.bytes as u64));
                    self.push(k, at, self.bytes, 0, &mut found);
                }
            }
            Index::FixedArray => self.fixed_array(address, visits, &mut found)?,
            Index::ExtensibleArray => self.extensible_array(address, visits, &mut found)?,
            Index::BTree2 => {
                let rank = self.size.len();
                let kind = if self.filtered { 11 } else { 10 };
                records(self.file, address, self.widths, kind, visits, &mut |record| {
                    let mut r = Cursor {
                        bytes: record,
                        at: 0,
                        widths: self.widths,
                    };
                    let own = record.len().saturating_sub(self.widths.offset + 8 * rank);
                    let (address, size, mask) = self.element(&mut r, own + self.widths.offset)?;
                    let from = (0..rank).map(|d| Ok(r.count(8)?.saturating_mul(self.chunk[d])));
                    let from = from.collect::<Step<Vec<usize>>>()?;
                    found.extend(address.map(|address| Chunk {
                        from,
                        address,
                        size,
                        mask,
                    }));
                    Ok(())
                })?;
            }
        }
        Ok(found)
    }

    /// A chunk by its number in an array; the dimension that may grow counts slowest.
    fn push(&self, number: usize, address: u64, size: usize, mask: u32, found: &mut Vec<Chunk>) {
        let grows = self.most.iter().position(Option::is_none).unwrap_or(0);
        let mut order: Vec<usize> = (0..self.size.len()).filter(|d| *d != grows).collect();
        let mut rest = number;
        let mut from = vec![0; self.size.len()];
        while let Some(d) = order.pop() {
            let along = self.most[d]
                .unwrap_or(self.size[d])
                .max(self.size[d])
                .div_ceil(self.chunk[d])
                .max(1);
            from[d] = (rest % along).saturating_mul(self.chunk[d]);
            rest /= along;
        }
        if let Some(slowest) = from.get_mut(grows) {
            *slowest = rest.saturating_mul(self.chunk[grows]);
        }
        found.push(Chunk {
            from,
            address,
            size,
            mask,
        });
    }

    /// An array element of `width` bytes: address, and where there are filters size and mask.
    fn element(&self, cursor: &mut Cursor, width: usize) -> Step<(Option<u64>, usize, u32)> {
        let address = cursor.address()?;
        if !self.filtered {
            return Ok((address, self.bytes, 0));
        }
        let size = cursor.count(width.saturating_sub(self.widths.offset + 4))?;
        Ok((address, size, cursor.uint(4)? as u32))
    }

    fn tree(&self, address: u64, depth: usize, visits: &mut Visits, found: &mut Vec<Chunk>) -> Step<()> {
        visits.one()?;
        let mut cursor = Cursor::at(self.file, address, self.widths)?;
        cursor.signature(b"TREE")?;
        if cursor.byte()? != 1 {
            return damaged("a tree that holds no chunks");
        }
        let level = cursor.byte()?;
        let entries = cursor.count(2)?;
        cursor.take(2 * self.widths.offset)?;
        for _ in 0..entries {
            let size = cursor.count(4)?;
            let mask = cursor.uint(4)? as u32;
            let from = (0..self.size.len())
                .map(|_| cursor.count(8))
                .collect::<Step<Vec<usize>>>()?;
            cursor.take(8)?;
            let Some(child) = cursor.address()? else { continue };
            if level == 0 {
                visits.one()?;
                found.push(Chunk {
                    from,
                    address: child,
                    size,
                    mask,
                });
            } else if depth == 0 {
                return damaged("a tree of chunks that is too deep");
            } else {
                self.tree(child, depth - 1, visits, found)?;
            }
        }
        Ok(())
    }

    fn fixed_array(&self, address: u64, visits: &mut Visits, found: &mut Vec<Chunk>) -> Step<()> {
        let mut cursor = Cursor::at(self.file, address, self.widths)?;
        let start = cursor.at;
        cursor.block(b"FAHD")?;
        let width = cursor.count(1)?;
        let page_bits = cursor.count(1)?;
        let count = cursor.length()?;
        let block = cursor.address()?;
        cursor.checksum(start)?;
        let Some(block) = block else { return Ok(()) };
        let mut cursor = Cursor::at(self.file, block, self.widths)?;
        let start = cursor.at;
        cursor.block(b"FADB")?;
        cursor.take(self.widths.offset)?;
        let page = 1usize.checked_shl(page_bits as u32).unwrap_or(usize::MAX);
        let mut written = &[][..];
        if count > page {
            written = cursor.take(count.div_ceil(page).div_ceil(8))?;
            cursor.checksum(start)?;
        }
        let mut number = 0;
        while number < count {
            let here = page.min(count - number);
            let start = cursor.at.min(if count > page { cursor.at } else { start });
            let is_there = count <= page || {
                let k = number / page;
                written[k / 8] & (0x80 >> (k % 8)) != 0
            };
            if !is_there {
                cursor.take(here.saturating_mul(width).saturating_add(4))?;
                number += here;
                continue;
            }
            for k in number..number + here {
                visits.one()?;
                let (address, size, mask) = self.element(&mut cursor, width)?;
                if let Some(address) = address {
                    self.push(k, address, size, mask, found);
                }
            }
            cursor.checksum(start)?;
            number += here;
        }
        Ok(())
    }

    fn extensible_array(&self, address: u64, visits: &mut Visits, found: &mut Vec<Chunk>) -> Step<()> {
        let mut cursor = Cursor::at(self.file, address, self.widths)?;
        let start = cursor.at;
        cursor.block(b"EAHD")?;
        let width = cursor.count(1)?;
        let max_bits = cursor.count(1)?;
        let in_index = cursor.count(1)?;
        let least_in_block = cursor.count(1)?;
        let least_pointers = cursor.count(1)?;
        let page_bits = cursor.count(1)?;
        cursor.take(4 * self.widths.length)?;
        let count = cursor.length()?;
        cursor.length()?;
        let index = cursor.address()?;
        cursor.checksum(start)?;
        if !least_in_block.is_power_of_two()
            || !least_pointers.is_power_of_two()
            || max_bits > 64
            || page_bits > 32
        {
            return damaged("an array of chunks with impossible measures");
        }
        let Some(index) = index else { return Ok(()) };
        let array = Array {
            grid: self,
            width,
            offset_bytes: max_bits.div_ceil(8),
            page: 1 << page_bits,
            count,
        };
        let mut cursor = Cursor::at(self.file, index, self.widths)?;
        let start = cursor.at;
        cursor.block(b"EAIB")?;
        cursor.take(self.widths.offset)?;
        let mut number = 0;
        array.elements(&mut cursor, in_index, &mut number, visits, found)?;
        // The first super blocks have their data blocks in the index.
        let super_blocks = 1 + max_bits.saturating_sub(least_in_block.ilog2() as usize);
        let in_place = (2 * least_pointers.ilog2() as usize).min(super_blocks);
        let blocks = |u: usize| 1usize << (u / 2).min(31);
        let in_block = |u: usize| (1usize << u.div_ceil(2).min(40)) * least_in_block;
        let mut data = Vec::new();
        for u in 0..in_place {
            for _ in 0..blocks(u) {
                data.push((cursor.address()?, in_block(u)));
            }
        }
        let mut supers = Vec::new();
        for u in in_place..super_blocks {
            supers.push((cursor.address()?, u));
        }
        cursor.checksum(start)?;
        for (address, size) in data {
            array.data_block(address, size, &mut number, visits, found)?;
        }
        for (address, u) in supers {
            let Some(address) = address else {
                number = number.saturating_add(blocks(u).saturating_mul(in_block(u)));
                continue;
            };
            visits.one()?;
            let mut cursor = Cursor::at(self.file, address, self.widths)?;
            let start = cursor.at;
            cursor.block(b"EASB")?;
            cursor.take(self.widths.offset + array.offset_bytes)?;
            let pages = in_block(u) / array.page;
            cursor.take(if in_block(u) > array.page {
                blocks(u) * pages.div_ceil(8)
            } else {
                0
            })?;
            let mut data = Vec::new();
            for _ in 0..blocks(u) {
                data.push(cursor.address()?);
            }
            cursor.checksum(start)?;
            for address in data {
                array.data_block(address, in_block(u), &mut number, visits, found)?;
            }
        }
        Ok(())
    }
}

/// An extensible array while it is read.
struct Array<'a> {
    grid: &'a ChunkGrid<'a>,
    width: usize,
    offset_bytes: usize,
    /// Elements of a page of a large data block.
    page: usize,
    /// Elements that were ever set.
    count: usize,
}

impl Array<'_> {
    fn elements(
        &self,
        cursor: &mut Cursor,
        count: usize,
        number: &mut usize,
        visits: &mut Visits,
        found: &mut Vec<Chunk>,
    ) -> Step<()> {
        for _ in 0..count {
            visits.one()?;
            let (address, size, mask) = self.grid.element(cursor, self.width)?;
            if let Some(address) = address.filter(|_| *number < self.count) {
                self.grid.push(*number, address, size, mask, found);
            }
            *number = number.saturating_add(1);
        }
        Ok(())
    }

    fn data_block(
        &self,
        address: Option<u64>,
        size: usize,
        number: &mut usize,
        visits: &mut Visits,
        found: &mut Vec<Chunk>,
    ) -> Step<()> {
        let Some(address) = address.filter(|_| *number < self.count) else {
            *number = number.saturating_add(size);
            return Ok(());
        };
        let mut cursor = Cursor::at(self.grid.file, address, self.grid.widths)?;
        let start = cursor.at;
        cursor.block(b"EADB")?;
        cursor.take(self.grid.widths.offset + self.offset_bytes)?;
        if size <= self.page {
            self.elements(&mut cursor, size, number, visits, found)?;
            return cursor.checksum(start);
        }
        cursor.checksum(start)?;
        for _ in 0..size / self.page {
            let start = cursor.at;
            // What was never set has no valid page.
            if *number >= self.count {
                break;
            }
            self.elements(&mut cursor, self.page, number, visits, found)?;
            cursor.checksum(start)?;
        }
        Ok(())
    }
}

/// A stored chunk as it was before the filters: `bytes` long.
pub(crate) fn unpacked(
    stored: &[u8],
    filters: &[u16],
    mask: u32,
    element: usize,
    bytes: usize,
) -> Step<Vec<u8>> {
    let mut data = stored.to_vec();
    for (k, filter) in filters.iter().enumerate().rev() {
        if k < 32 && mask & (1 << k) != 0 {
            continue;
        }
        data = match *filter {
            DEFLATE => {
                let mut out = Vec::with_capacity(bytes);
                let read = flate2::read::ZlibDecoder::new(&data[..])
                    .take(bytes as u64 + 5)
                    .read_to_end(&mut out);
                match read {
                    Ok(_) => out,
                    Err(e) => return damaged(e.to_string()),
                }
            }
            SHUFFLE => unshuffled(&data, element),
            FLETCHER => {
                let Some(at) = data.len().checked_sub(4) else {
                    return damaged("a chunk without its checksum");
                };
                let said = data[at..]
                    .iter()
                    .rev()
                    .fold(0_u32, |sum, b| sum << 8 | u32::from(*b));
                data.truncate(at);
                if said != fletcher32(&data) {
                    return damaged("the checksum of a chunk is wrong");
                }
                data
            }
            other => return damaged(format!("packed with filter {other}, which is not read here")),
        };
    }
    match data.len() == bytes {
        true => Ok(data),
        false => damaged(format!("a chunk of {} bytes instead of {bytes}", data.len())),
    }
}

fn unshuffled(data: &[u8], element: usize) -> Vec<u8> {
    if element < 2 {
        return data.to_vec();
    }
    let count = data.len() / element;
    let mut out = data.to_vec();
    for k in 0..count {
        for b in 0..element {
            out[k * element + b] = data[b * count + k];
        }
    }
    out
}

/// Fletcher's checksum over 16-bit big-endian words, as the format has it.
fn fletcher32(data: &[u8]) -> u32 {
    let (mut low, mut high) = (0_u32, 0_u32);
    let mut words = data.chunks_exact(2);
    let mut add = |word: u32| {
        low = (low + word) % 65_535;
        high = (high + low) % 65_535;
    };
    for word in words.by_ref() {
        add(u32::from(word[0]) << 8 | u32::from(word[1]));
    }
    if let [last] = words.remainder() {
        add(u32::from(*last) << 8);
    }
    high << 16 | low
}
