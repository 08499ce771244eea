//! What a group holds: old groups (B-tree, local heap), new ones with many links (fractal heap, B-tree of version 2).

use crate::ingest::formats::mat::hdf5::cursor::{Cursor, Fault, NAME, Step, Widths, bytes_for, damaged};
use crate::ingest::formats::mat::hdf5::header::{Object, heap_link};

/// Nodes and blocks looked at; each takes room in the file, so a file that refers to itself runs out of them.
pub(crate) struct Visits(pub usize);

impl Visits {
    pub fn one(&mut self) -> Step<()> {
        match self.0.checked_sub(1) {
            Some(left) => {
                self.0 = left;
                Ok(())
            }
            None => damaged("its structure refers to itself, or is far larger than the file"),
        }
    }
}

/// Names and addresses of all hard links of a group.
pub(crate) fn links(
    file: &[u8],
    widths: Widths,
    group: &Object,
    visits: &mut Visits,
) -> Step<Vec<(String, u64)>> {
    let mut links = group.links.clone();
    if let Some((tree, heap)) = group.symbol_table {
        let names = local_heap(file, heap, widths)?;
        symbols(file, tree, widths, names, DEPTH, visits, &mut links)?;
    }
    if let Some((heap, index)) = group.dense_links {
        let heap = FractalHeap::read(file, heap, widths)?;
        let mut ids = Vec::new();
        records(file, index, widths, 5, visits, &mut |record| {
            ids.push(record.get(4..).unwrap_or_default().to_vec());
            Ok(())
        })?;
        for id in ids {
            links.extend(heap_link(heap.object(file, &id, widths, visits)?, widths)?);
        }
    }
    Ok(links)
}

/// B-trees are followed this deep.
pub(crate) const DEPTH: usize = 16;

fn local_heap(file: &[u8], address: u64, widths: Widths) -> Step<&[u8]> {
    let mut cursor = Cursor::at(file, address, widths)?;
    cursor.signature(b"HEAP")?;
    cursor.take(4)?;
    let size = cursor.length()?;
    cursor.length()?;
    match cursor.address()? {
        Some(data) => Cursor::at(file, data, widths)?.take(size),
        None => damaged("a heap of names without data"),
    }
}

fn symbols(
    file: &[u8],
    address: u64,
    widths: Widths,
    names: &[u8],
    depth: usize,
    visits: &mut Visits,
    links: &mut Vec<(String, u64)>,
) -> Step<()> {
    visits.one()?;
    let mut cursor = Cursor::at(file, address, widths)?;
    if file[cursor.at..].starts_with(b"SNOD") {
        cursor.take(6)?;
        for _ in 0..cursor.count(2)? {
            let name_at = cursor.count(widths.offset)?;
            let object = cursor.address()?;
            cursor.take(4 + 4 + 16)?;
            let name = names.get(name_at..).unwrap_or_default();
            let end = name.iter().position(|b| *b == 0).unwrap_or(name.len());
            let name = crate::ingest::text::decode(&name[..end.min(NAME)]);
            links.extend(object.map(|o| (name, o)));
        }
        return Ok(());
    }
    cursor.signature(b"TREE")?;
    cursor.take(2)?;
    if depth == 0 {
        return damaged("a tree of names that is too deep");
    }
    let entries = cursor.count(2)?;
    cursor.take(2 * widths.offset)?;
    for _ in 0..entries {
        cursor.length()?;
        if let Some(child) = cursor.address()? {
            symbols(file, child, widths, names, depth - 1, visits, links)?;
        }
    }
    Ok(())
}

/// All records of a B-tree of version 2 of the given type.
pub(crate) fn records(
    file: &[u8],
    address: u64,
    widths: Widths,
    kind: u8,
    visits: &mut Visits,
    each: &mut dyn FnMut(&[u8]) -> Step<()>,
) -> Step<()> {
    let mut cursor = Cursor::at(file, address, widths)?;
    let start = cursor.at;
    if cursor.block(b"BTHD")? != kind {
        return damaged("a tree of another kind than expected");
    }
    let node_size = cursor.count(4)?;
    let record_size = cursor.count(2)?;
    let depth = cursor.count(2)?;
    cursor.take(2)?;
    let root = cursor.address()?;
    let in_root = cursor.count(2)?;
    cursor.length()?;
    cursor.checksum(start)?;
    let Some(root) = root else { return Ok(()) };
    if depth > DEPTH || record_size == 0 || node_size < 10 + record_size {
        return damaged("a tree with impossible measures");
    }
    // Signature, version, type and checksum of a node take ten bytes.
    let most_in_leaf = (node_size - 10) / record_size;
    let count_width = bytes_for(most_in_leaf as u64);
    let mut total_widths = vec![0];
    let mut most_below = most_in_leaf as u64;
    for _ in 0..depth {
        let pointer = widths.offset + count_width + total_widths.last().copied().unwrap_or(0);
        let most = node_size.saturating_sub(10 + pointer) / (record_size + pointer);
        most_below = (most as u64 + 1)
            .saturating_mul(most_below)
            .saturating_add(most as u64);
        total_widths.push(bytes_for(most_below));
    }
    let tree = Tree {
        file,
        widths,
        kind,
        record_size,
        count_width,
        total_widths,
    };
    tree.node(root, in_root, depth, visits, each)
}

struct Tree<'a> {
    file: &'a [u8],
    widths: Widths,
    kind: u8,
    record_size: usize,
    /// Bytes of a count of records in a child, and of the total below it, by depth.
    count_width: usize,
    total_widths: Vec<usize>,
}

impl Tree<'_> {
    fn node(
        &self,
        address: u64,
        count: usize,
        depth: usize,
        visits: &mut Visits,
        each: &mut dyn FnMut(&[u8]) -> Step<()>,
    ) -> Step<()> {
        visits.one()?;
        let mut cursor = Cursor::at(self.file, address, self.widths)?;
        let start = cursor.at;
        if cursor.block(if depth == 0 { b"BTLF" } else { b"BTIN" })? != self.kind {
            return damaged("a tree node of another kind than expected");
        }
        for _ in 0..count {
            each(cursor.take(self.record_size)?)?;
        }
        let mut children = Vec::new();
        for _ in 0..if depth == 0 { 0 } else { count + 1 } {
            let child = cursor.address()?;
            let records = cursor.count(self.count_width)?;
            cursor.take(if depth > 1 {
                self.total_widths[depth - 1]
            } else {
                0
            })?;
            children.extend(child.map(|c| (c, records)));
        }
        cursor.checksum(start)?;
        for (child, records) in children {
            self.node(child, records, depth - 1, visits, each)?;
        }
        Ok(())
    }
}

/// Heap in which large groups keep their links.
struct FractalHeap {
    width: usize,
    starting_size: usize,
    max_direct: usize,
    offset_bytes: usize,
    length_bytes: usize,
    root: Option<u64>,
    root_rows: usize,
}

impl FractalHeap {
    fn read(file: &[u8], address: u64, widths: Widths) -> Step<FractalHeap> {
        let mut cursor = Cursor::at(file, address, widths)?;
        let start = cursor.at;
        cursor.signature(b"FRHP")?;
        cursor.take(1 + 2)?;
        let filters = cursor.count(2)?;
        cursor.take(1)?;
        let max_managed = cursor.uint(4)?;
        cursor.take(2 * widths.length + 2 * widths.offset + 8 * widths.length)?;
        let width = cursor.count(2)?;
        let starting_size = cursor.length()?;
        let max_direct = cursor.length()?;
        let max_bits = cursor.count(2)?;
        cursor.take(2)?;
        let root = cursor.address()?;
        let root_rows = cursor.count(2)?;
        if filters > 0 {
            return damaged("a packed heap of links, which is not read here");
        }
        cursor.checksum(start)?;
        if width == 0 || starting_size == 0 || max_direct < starting_size || max_bits > 64 || root_rows > 64 {
            return damaged("a heap with impossible measures");
        }
        Ok(FractalHeap {
            width,
            starting_size,
            max_direct,
            offset_bytes: max_bits.div_ceil(8),
            length_bytes: bytes_for(max_direct as u64).min(bytes_for(max_managed)),
            root,
            root_rows,
        })
    }

    /// Size of a block in a row; `None` beyond all bounds.
    fn row_size(&self, row: usize) -> Option<usize> {
        self.starting_size
            .checked_mul(1usize.checked_shl(row.saturating_sub(1) as u32)?)
    }

    /// The object of a heap id.
    fn object<'a>(&self, file: &'a [u8], id: &[u8], widths: Widths, visits: &mut Visits) -> Step<&'a [u8]> {
        let mut id = Cursor {
            bytes: id,
            at: 0,
            widths,
        };
        if id.byte()? & 0x30 != 0 {
            return damaged("a link outside the heap of its group, which is not read here");
        }
        let mut offset = id.count(self.offset_bytes)?;
        let length = id.count(self.length_bytes)?;
        let mut address = self.root;
        let mut rows = self.root_rows;
        // Down through the indirect blocks.
        for _ in 0..DEPTH {
            visits.one()?;
            let Some(at) = address else {
                return damaged("a link in a block that is not there");
            };
            if rows == 0 {
                let mut block = Cursor::at(file, at, widths)?;
                block.signature(b"FHDB")?;
                let mut place = Cursor::at(file, at, widths)?;
                place.take(offset)?;
                return place.take(length);
            }
            let mut block = Cursor::at(file, at, widths)?;
            block.signature(b"FHIB")?;
            block.take(1 + widths.offset + self.offset_bytes)?;
            let beyond = || Fault::Damaged("a link beyond its heap".into());
            let mut row = 0;
            let size = loop {
                let size = self.row_size(row).filter(|_| row < rows).ok_or_else(beyond)?;
                let whole = size.checked_mul(self.width).ok_or_else(beyond)?;
                if offset < whole {
                    break size;
                }
                offset -= whole;
                row += 1;
            };
            block.take((row * self.width + offset / size) * widths.offset)?;
            address = block.address()?;
            offset %= size;
            rows = 0;
            if size > self.max_direct {
                // An indirect block covers as many rows as make up its size.
                let first = self.starting_size * self.width;
                rows = (size / first.max(1)).max(1).ilog2() as usize + 1;
            }
        }
        damaged("a heap of links that is too deep")
    }
}
