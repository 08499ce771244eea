//! Object headers and their messages: what a group or a dataset is.

use crate::ingest::formats::mat::hdf5::cursor::{Cursor, Fault, NAME, Step, Widths, damaged};

/// Continuations of one header and messages in it: no real object comes near.
const BLOCKS_AT_MOST: usize = 64;
const MESSAGES_AT_MOST: usize = 65_536;

/// Numbers as the file holds them.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Type {
    Integer {
        size: usize,
        signed: bool,
        big: bool,
    },
    Float {
        size: usize,
        big: bool,
    },
    /// Real and imaginary part, of one float type.
    Complex {
        size: usize,
        big: bool,
    },
    /// Addresses of other objects.
    Reference,
    /// Of no use here; its size.
    Other(usize),
}

impl Type {
    /// Bytes of one element.
    pub fn size(&self, widths: Widths) -> usize {
        match self {
            Type::Integer { size, .. } | Type::Float { size, .. } | Type::Other(size) => *size,
            Type::Complex { size, .. } => 2 * size,
            Type::Reference => widths.offset,
        }
    }
}

/// How the chunks of a dataset are found.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Index {
    BTree1,
    /// Stored size where it is filtered.
    Single(Option<usize>),
    Implicit,
    FixedArray,
    ExtensibleArray,
    BTree2,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Layout {
    /// Where in the file, and how long.
    Compact(usize, usize),
    Contiguous(Option<u64>, usize),
    Chunked {
        index: Index,
        address: Option<u64>,
        /// Elements of a chunk along each dimension.
        chunk: Vec<usize>,
    },
}

/// Attributes of one object that are kept.
const NUMBERS_AT_MOST: usize = 64;

/// All that is used of an object header.
#[derive(Debug, Default)]
pub(crate) struct Object {
    pub dimensions: Option<Vec<usize>>,
    /// Largest sizes; `None` where a dimension may grow without end.
    pub most: Vec<Option<usize>>,
    pub kind: Option<Type>,
    pub layout: Option<Layout>,
    /// Filter ids, in the order of writing.
    pub filters: Vec<u16>,
    /// Names and addresses of what a group holds.
    pub links: Vec<(String, u64)>,
    /// B-tree and heap of an old group.
    pub symbol_table: Option<(u64, u64)>,
    /// Heap and name index of a group with many links.
    pub dense_links: Option<(u64, u64)>,
    /// Text of the attribute `MATLAB_class`.
    pub class: String,
    /// Attributes that hold one number: name, kind and bytes.
    pub numbers: Vec<(String, Type, Vec<u8>)>,
    /// Whether there is an attribute `MATLAB_empty`.
    pub is_empty: bool,
    is_group: bool,
}

impl Object {
    pub fn is_group(&self) -> bool {
        self.is_group
    }

    pub fn read(file: &[u8], address: u64, widths: Widths) -> Step<Object> {
        let mut object = Object::default();
        let mut cursor = Cursor::at(file, address, widths)?;
        let mut blocks: Vec<(u64, usize)> = Vec::new();
        let new_form = file.get(cursor.at..cursor.at + 4) == Some(b"OHDR");
        let start = cursor.at;
        let (flags, size) = if new_form {
            cursor.take(4)?;
            if cursor.byte()? != 2 {
                return damaged("an object header of unknown version");
            }
            let flags = cursor.byte()?;
            cursor.take(if flags & 0x20 != 0 { 16 } else { 0 })?;
            cursor.take(if flags & 0x10 != 0 { 4 } else { 0 })?;
            (flags, cursor.count(1 << (flags & 3))?)
        } else {
            if cursor.uint(2)? & 0xFF != 1 {
                return damaged("no object header where one should be");
            }
            cursor.take(2 + 4)?;
            let size = cursor.count(4)?;
            cursor.take(4)?;
            (0, size)
        };
        let mut messages = 0;
        object.block(&mut cursor, size, new_form, flags, &mut blocks, &mut messages)?;
        if new_form {
            cursor.checksum(start)?;
        }
        let mut done = 0;
        while let Some((address, length)) = blocks.get(done).copied() {
            done += 1;
            if done > BLOCKS_AT_MOST {
                return damaged("an object header in too many pieces");
            }
            let mut cursor = Cursor::at(file, address, widths)?;
            let start = cursor.at;
            if !new_form {
                object.block(&mut cursor, length, false, flags, &mut blocks, &mut messages)?;
                continue;
            }
            cursor.signature(b"OCHK")?;
            let inside = length
                .checked_sub(8)
                .ok_or_else(|| Fault::Damaged("a short header block".into()))?;
            object.block(&mut cursor, inside, true, flags, &mut blocks, &mut messages)?;
            cursor.checksum(start)?;
        }
        Ok(object)
    }

    /// The messages of one block of `size` bytes.
    fn block(
        &mut self,
        cursor: &mut Cursor,
        size: usize,
        new_form: bool,
        flags: u8,
        blocks: &mut Vec<(u64, usize)>,
        messages: &mut usize,
    ) -> Step<()> {
        let bytes = cursor.bytes;
        let start = cursor.at;
        cursor.take(size)?;
        let end = cursor.at;
        let mut inside = Cursor {
            bytes: &bytes[..end],
            at: start,
            widths: cursor.widths,
        };
        let head = if new_form {
            4 + 2 * usize::from(flags & 4 != 0)
        } else {
            8
        };
        // What is left and too short for a message is a gap.
        while end - inside.at >= head {
            let kind = inside.count(if new_form { 1 } else { 2 })?;
            let length = inside.count(2)?;
            let shared = inside.byte()? & 2 != 0;
            inside.take(head - if new_form { 4 } else { 5 })?;
            let at = inside.at;
            inside.take(length)?;
            *messages += 1;
            if *messages > MESSAGES_AT_MOST {
                return damaged("an object header with too many messages");
            }
            if shared {
                // A type of its own name: what it is stands elsewhere and MATLAB does not write it.
                continue;
            }
            let message = Cursor {
                bytes: &bytes[..at + length],
                at,
                widths: inside.widths,
            };
            self.message(kind, message, blocks)?;
        }
        Ok(())
    }

    fn message(&mut self, kind: usize, mut m: Cursor, blocks: &mut Vec<(u64, usize)>) -> Step<()> {
        match kind {
            0x01 => (self.dimensions, self.most) = dataspace(&mut m)?,
            0x02 => {
                self.is_group = true;
                m.take(1)?;
                let flags = m.byte()?;
                m.take(if flags & 1 != 0 { 8 } else { 0 })?;
                if let (Some(heap), Some(index)) = (m.address()?, m.address()?) {
                    self.dense_links = Some((heap, index));
                }
            }
            0x03 => self.kind = Some(datatype(&mut m)?),
            0x06 => {
                self.is_group = true;
                self.links.extend(link(&mut m)?);
            }
            0x08 => self.layout = layout(m)?,
            0x0A => self.is_group = true,
            0x0B => self.filters = filters(&mut m)?,
            // A damaged attribute is no reason to lose the data.
            0x0C => drop(self.attribute(&mut m)),
            0x10 => {
                if let Some(address) = m.address()? {
                    blocks.push((address, m.length()?));
                }
            }
            0x11 => {
                self.is_group = true;
                if let (Some(tree), Some(heap)) = (m.address()?, m.address()?) {
                    self.symbol_table = Some((tree, heap));
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn attribute(&mut self, m: &mut Cursor) -> Step<()> {
        let version = m.byte()?;
        m.take(1)?;
        let (name, kind, space) = (m.count(2)?, m.count(2)?, m.count(2)?);
        m.take(usize::from(version == 3))?;
        let padded = |size: usize| if version == 1 { size.div_ceil(8) * 8 } else { size };
        let name = text(m.take(padded(name))?);
        let kind = m.take(padded(kind))?;
        let space = m.take(padded(space))?;
        let part = |bytes| Cursor {
            bytes,
            at: 0,
            widths: m.widths,
        };
        let (kind, space) = (datatype(&mut part(kind)), dataspace(&mut part(space)));
        if let (Ok(kind @ (Type::Integer { .. } | Type::Float { .. })), Ok((Some(sizes), _))) = (kind, space)
            && sizes.iter().all(|n| *n == 1)
            && self.numbers.len() < NUMBERS_AT_MOST
            && let Some(bytes) = m.bytes.get(m.at..m.at + kind.size(m.widths))
        {
            self.numbers.push((name.clone(), kind, bytes.to_vec()));
        }
        match name.as_str() {
            "MATLAB_class" => self.class = text(&m.bytes[m.at..]),
            "MATLAB_empty" => self.is_empty = true,
            _ => {}
        }
        Ok(())
    }
}

fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    crate::ingest::text::decode(&bytes[..end.min(NAME)])
}

/// Sizes (none for the empty dataspace) and largest sizes (none: without limit).
type Sizes = (Option<Vec<usize>>, Vec<Option<usize>>);

fn dataspace(m: &mut Cursor) -> Step<Sizes> {
    let version = m.byte()?;
    let rank = m.byte()?;
    let flags = m.byte()?;
    match version {
        1 => m.take(5)?,
        2 if m.byte()? == 2 => return Ok((None, Vec::new())),
        2 => &[],
        _ => return damaged("a dataspace of unknown version"),
    };
    if rank > 32 {
        return damaged("more than 32 dimensions");
    }
    let sizes = (0..rank).map(|_| m.length()).collect::<Step<Vec<usize>>>()?;
    if flags & 1 == 0 {
        let most = sizes.iter().map(|n| Some(*n)).collect();
        return Ok((Some(sizes), most));
    }
    let most = (0..rank).map(|_| Ok(Some(m.length()?).filter(|n| *n != usize::MAX)));
    let most = most.collect::<Step<_>>()?;
    Ok((Some(sizes), most))
}

fn datatype(m: &mut Cursor) -> Step<Type> {
    let class = m.byte()?;
    let version = class >> 4;
    let bits = m.uint(3)?;
    let size = m.count(4)?;
    let big = bits & 1 != 0;
    Ok(match class & 0xF {
        0 if matches!(size, 1 | 2 | 4 | 8) => {
            m.take(4)?;
            let signed = bits & 8 != 0;
            Type::Integer { size, signed, big }
        }
        1 if matches!(size, 4 | 8) && bits & 0x40 == 0 => {
            m.take(12)?;
            Type::Float { size, big }
        }
        6 if bits & 0xFFFF == 2 => {
            let mut parts = Vec::new();
            for _ in 0..2 {
                let start = m.at;
                let length = m.bytes[start..].iter().position(|b| *b == 0);
                let Some(length) = length else {
                    return Ok(Type::Other(size));
                };
                let name = text(m.take(length + 1)?);
                if version < 3 {
                    m.take((length + 1).div_ceil(8) * 8 - length - 1)?;
                }
                let offset = m.count(if version < 3 {
                    4
                } else {
                    crate::ingest::formats::mat::hdf5::cursor::bytes_for(size as u64)
                })?;
                m.take(if version == 1 { 28 } else { 0 })?;
                parts.push((name.to_lowercase(), offset, datatype(m)?));
            }
            match parts.as_slice() {
                [(re, 0, Type::Float { size: own, big }), (im, at, other)]
                    if re.starts_with('r')
                        && im.starts_with('i')
                        && at == own
                        && *other
                            == (Type::Float {
                                size: *own,
                                big: *big,
                            })
                        && size == 2 * own =>
                {
                    Type::Complex {
                        size: *own,
                        big: *big,
                    }
                }
                _ => Type::Other(size),
            }
        }
        7 if bits & 0xF == 0 && size == m.widths.offset => Type::Reference,
        _ => Type::Other(size),
    })
}

/// Name and address of a hard link; `None` for others.
fn link(m: &mut Cursor) -> Step<Option<(String, u64)>> {
    m.take(1)?;
    let flags = m.byte()?;
    let kind = if flags & 8 != 0 { m.byte()? } else { 0 };
    m.take(if flags & 4 != 0 { 8 } else { 0 })?;
    m.take(usize::from(flags & 0x10 != 0))?;
    let length = m.count(1 << (flags & 3))?;
    let name = text(m.take(length)?);
    if kind != 0 {
        return Ok(None);
    }
    Ok(m.address()?.map(|address| (name, address)))
}

/// A link as the heap of a large group holds it.
pub(crate) fn heap_link(bytes: &[u8], widths: Widths) -> Step<Option<(String, u64)>> {
    link(&mut Cursor { bytes, at: 0, widths })
}

fn layout(mut m: Cursor) -> Step<Option<Layout>> {
    let version = m.byte()?;
    if !(3..=4).contains(&version) {
        return damaged(format!(
            "a data layout of version {version}, which is not read here"
        ));
    }
    let class = m.byte()?;
    Ok(Some(match class {
        0 => {
            let size = m.count(2)?;
            let at = m.at;
            m.take(size)?;
            Layout::Compact(at, size)
        }
        1 => {
            let address = m.address()?;
            Layout::Contiguous(address, m.length()?)
        }
        2 => {
            let flags = if version == 4 { m.byte()? } else { 0 };
            // The size of an element counts as a dimension more.
            let rank = m.byte()?;
            let mut address = None;
            let width = if version == 4 {
                m.count(1)?
            } else {
                address = m.address()?;
                4
            };
            let mut chunk = (0..rank).map(|_| m.count(width)).collect::<Step<Vec<usize>>>()?;
            chunk.pop();
            let mut index = Index::BTree1;
            if version == 4 {
                index = match m.byte()? {
                    1 if flags & 2 != 0 => {
                        let size = m.length()?;
                        m.take(4)?;
                        Index::Single(Some(size))
                    }
                    1 => Index::Single(None),
                    2 => Index::Implicit,
                    3 => {
                        m.take(1)?;
                        Index::FixedArray
                    }
                    4 => {
                        m.take(5)?;
                        Index::ExtensibleArray
                    }
                    5 => {
                        m.take(6)?;
                        Index::BTree2
                    }
                    kind => return damaged(format!("chunks in an index of unknown kind {kind}")),
                };
                address = m.address()?;
            }
            Layout::Chunked {
                index,
                address,
                chunk,
            }
        }
        _ => return Ok(None),
    }))
}

fn filters(m: &mut Cursor) -> Step<Vec<u16>> {
    let version = m.byte()?;
    let count = m.byte()?;
    m.take(if version == 1 { 6 } else { 0 })?;
    (0..count)
        .map(|_| {
            let id = m.uint(2)? as u16;
            let name = if version == 1 || id >= 256 { m.count(2)? } else { 0 };
            m.take(2)?;
            let values = m.count(2)?;
            m.take(if version == 1 { name.div_ceil(8) * 8 } else { name })?;
            m.take(4 * values + if version == 1 { 4 * (values % 2) } else { 0 })?;
            Ok(id)
        })
        .collect()
}
