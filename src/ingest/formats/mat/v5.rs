//! MAT-files of version 5 to 7: elements of tag and data, each variable an element of its own, packed (zlib) or not.
//!
//! Source: The MathWorks, "MAT-File Format" (2019), chapter 1. The class 17 (opaque: objects, `string`, `table`, …) is
//! not in it; its element has no dimensions but the names of the variable, of the type system and of the class.
//!
//! A variable that cannot be read is named in a warning, and the rest is read all the same.

#[cfg(test)]
mod tests;

use std::io::Read;

use crate::InputError;
use crate::ingest::budget::Budget;
use crate::ingest::formats::mat::variable::{Labels, Variable};
use crate::ingest::text::{Notes, decode};

const HEADER: usize = 128;
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;
/// Structs and cells are followed this deep.
const DEPTH: usize = 16;
/// MATLAB allows 63 characters.
const NAME: usize = 256;

const CELL: u8 = 1;
const STRUCT: u8 = 2;
const OBJECT: u8 = 3;
const CHAR: u8 = 4;
const SPARSE: u8 = 5;
const FUNCTION: u8 = 16;
const OPAQUE: u8 = 17;

/// More text than this says nothing of channels.
const MOST_TEXT: usize = 1 << 16;

/// Reads all numeric arrays, those in structs (`s.f`, `s(2).f`) and cells (`c{3}`) too, and what text there is.
///
/// # Errors
/// No valid header, no variable that can be read, or more memory than the budget of the file.
pub(crate) fn read(
    bytes: &[u8],
    budget: &mut Budget,
    notes: &mut Notes,
) -> Result<(Vec<Variable>, Vec<Labels>), InputError> {
    let big = match bytes.get(126..HEADER) {
        Some(b"IM") => false,
        Some(b"MI") => true,
        _ => {
            return Err(
                InputError::new("this MAT-file is cut off within its header, or damaged")
                    .remedy("save it again in MATLAB: save('new.mat', '-v7')"),
            );
        }
    };
    let mut found = Found {
        variables: Vec::new(),
        labels: Vec::new(),
        budget,
        notes,
    };
    let mut lost = 0;
    let mut cursor = Cursor {
        bytes,
        at: HEADER,
        big,
    };
    while cursor.at < bytes.len() {
        let from = cursor.at;
        let Some(tag) = cursor.tag() else {
            found
                .notes
                .file(format!("the file ends within a variable, at byte {from}"));
            lost += 1;
            break;
        };
        let there = &bytes[cursor.at..];
        let whole = tag.size <= there.len();
        let data = &there[..tag.size.min(there.len())];
        let outcome = match tag.kind {
            MATRIX => found.top(data, big, whole),
            COMPRESSED => found.packed(data, big, whole),
            _ if data.iter().all(|b| *b == 0) => Ok(()),
            kind => Err(Trouble::Damaged(
                String::new(),
                format!("an element of unknown type {kind} at byte {from}"),
            )),
        };
        match outcome {
            Ok(()) => {}
            Err(Trouble::Budget(error)) => return Err(error),
            Err(Trouble::Damaged(name, why)) => {
                lost += 1;
                let why = if whole {
                    format!("damaged ({why}): left out")
                } else {
                    "the file ends within this variable: left out".to_owned()
                };
                match name.is_empty() {
                    true => found
                        .notes
                        .file(format!("a variable at byte {from}, its name unreadable: {why}")),
                    false => found.notes.about(&name, why),
                }
            }
        }
        if !whole {
            break;
        }
        // What is packed is not padded.
        cursor.at += if tag.kind == COMPRESSED {
            tag.size
        } else {
            tag.padded()
        };
    }
    if found.variables.is_empty() && lost > 0 {
        let list = std::mem::take(found.notes).into_warnings().join("; ");
        return Err(
            InputError::new(format!("no variable of this MAT-file can be read: {list}")).remedy(
                "copy it again from where it was saved, or save it again in MATLAB: save('new.mat', '-v7')",
            ),
        );
    }
    Ok((found.variables, found.labels))
}

/// Why a variable was not read.
enum Trouble {
    /// Its name, where that could be read, and what is wrong.
    Damaged(String, String),
    Budget(InputError),
}

struct Found<'a> {
    variables: Vec<Variable>,
    labels: Vec<Labels>,
    budget: &'a mut Budget,
    notes: &'a mut Notes,
}

#[derive(Clone, Copy)]
struct Tag {
    kind: u32,
    size: usize,
    /// Tag and data in eight bytes.
    small: bool,
}

impl Tag {
    fn padded(self) -> usize {
        self.size.div_ceil(8).saturating_mul(8)
    }
}

struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    big: bool,
}

impl<'a> Cursor<'a> {
    fn u32(&self, at: usize) -> Option<u32> {
        let four: [u8; 4] = self.bytes.get(at..at.checked_add(4)?)?.try_into().ok()?;
        Some(if self.big {
            u32::from_be_bytes(four)
        } else {
            u32::from_le_bytes(four)
        })
    }

    /// The next tag; moves to its data.
    fn tag(&mut self) -> Option<Tag> {
        let first = self.u32(self.at)?;
        let size = first >> 16;
        if size != 0 {
            self.at += 4;
            let small = Tag {
                kind: first & 0xFFFF,
                size: size as usize,
                small: true,
            };
            return (small.size <= 4).then_some(small);
        }
        let size = self.u32(self.at.checked_add(4)?)? as usize;
        self.at += 8;
        Some(Tag {
            kind: first,
            size,
            small: false,
        })
    }

    /// The next element; moves behind it. What is missing of the padding at the very end does no harm.
    fn element(&mut self) -> Option<(u32, &'a [u8])> {
        let tag = self.tag()?;
        let data = self.bytes.get(self.at..self.at.checked_add(tag.size)?)?;
        let length = if tag.small { 4 } else { tag.padded() };
        self.at = self.at.checked_add(length)?.min(self.bytes.len());
        Some((tag.kind, data))
    }
}

fn name_of(data: &[u8]) -> String {
    let end = data.iter().position(|b| *b == 0).unwrap_or(data.len());
    decode(&data[..end.min(NAME)])
}

/// Array flags, dimensions and name of a matrix.
struct Head {
    class: u8,
    complex: bool,
    size: Vec<usize>,
    name: String,
}

fn head(cursor: &mut Cursor) -> Option<Head> {
    let (_, flags) = cursor
        .element()
        .filter(|(kind, data)| *kind == 6 && data.len() >= 8)?;
    let flags = Cursor {
        bytes: flags,
        at: 0,
        big: cursor.big,
    }
    .u32(0)?;
    let class = (flags & 0xFF) as u8;
    let mut size = Vec::new();
    if class != OPAQUE {
        let (_, sizes) = cursor.element().filter(|(kind, _)| *kind == 5)?;
        let sizes = Cursor {
            bytes: sizes,
            at: 0,
            big: cursor.big,
        };
        let count = sizes.bytes.len() / 4;
        if !(1..=32).contains(&count) {
            return None;
        }
        size = (0..count)
            .map_while(|k| Some(sizes.u32(4 * k)? as usize))
            .collect();
    }
    let (_, name) = cursor.element().filter(|(kind, _)| matches!(kind, 1 | 2 | 16))?;
    Some(Head {
        class,
        complex: flags & 0x800 != 0,
        size,
        name: name_of(name),
    })
}

impl Found<'_> {
    /// A variable at the top level of the file.
    fn top(&mut self, data: &[u8], big: bool, whole: bool) -> Result<(), Trouble> {
        let mut cursor = Cursor {
            bytes: data,
            at: 0,
            big,
        };
        let name = head(&mut cursor).map(|h| h.name).unwrap_or_default();
        if !whole {
            return Err(Trouble::Damaged(name, "cut off".into()));
        }
        // MATLAB's own block behind objects has no name.
        self.matrix(data, big, None, DEPTH)
            .map_err(|trouble| match trouble {
                Trouble::Damaged(inner, why) if inner.is_empty() => Trouble::Damaged(name, why),
                other => other,
            })
    }

    /// A packed variable: unpacked within the budget.
    fn packed(&mut self, data: &[u8], big: bool, whole: bool) -> Result<(), Trouble> {
        let most = self.budget.left();
        let mut unpacked = Vec::new();
        let reading = flate2::read::ZlibDecoder::new(data)
            .take(most as u64 + 1)
            .read_to_end(&mut unpacked);
        let mut cursor = Cursor {
            bytes: &unpacked,
            at: 0,
            big,
        };
        let tag = cursor.tag();
        let inside = unpacked.get(cursor.at..).unwrap_or_default();
        let name = || {
            let mut cursor = Cursor {
                bytes: inside,
                at: 0,
                big,
            };
            head(&mut cursor).map(|h| h.name).unwrap_or_default()
        };
        if unpacked.len() > most {
            let name = name();
            let what = if name.is_empty() {
                "a packed variable".to_owned()
            } else {
                format!("variable {name}")
            };
            return Err(Trouble::Budget(self.budget.exceeded(&what)));
        }
        if let Err(e) = reading {
            return Err(Trouble::Damaged(name(), e.to_string()));
        }
        match tag {
            Some(tag) if tag.kind == MATRIX && tag.size <= inside.len() => {
                // The unpacked bytes are given back when its numbers are read.
                let size = unpacked.len();
                self.budget
                    .take(size, "a packed variable")
                    .map_err(Trouble::Budget)?;
                let outcome = self.top(&inside[..tag.size], big, whole);
                self.budget.give_back(size);
                outcome
            }
            _ => Err(Trouble::Damaged(name(), "no variable in the packed data".into())),
        }
    }

    /// A matrix: numbers become a variable, structs and cells are gone into. `path` is its name where it lies in
    /// another one.
    fn matrix(&mut self, data: &[u8], big: bool, path: Option<&str>, depth: usize) -> Result<(), Trouble> {
        let mut cursor = Cursor {
            bytes: data,
            at: 0,
            big,
        };
        if data.is_empty() {
            return Ok(());
        }
        let Some(head) = head(&mut cursor) else {
            return Err(Trouble::Damaged(
                path.unwrap_or_default().to_owned(),
                "no array header".into(),
            ));
        };
        let name = path.map_or(head.name, str::to_owned);
        let damaged = |why: &str| Trouble::Damaged(name.clone(), why.to_owned());
        let count = head.size.iter().try_fold(1usize, |all, n| all.checked_mul(*n));
        let count = count.ok_or_else(|| damaged("its size is beyond all bounds"))?;
        match head.class {
            OPAQUE => {
                let mut text = || {
                    cursor
                        .element()
                        .map(|(_, data)| name_of(data))
                        .unwrap_or_default()
                };
                let (_, class) = (text(), text());
                self.notes.about(
                    &name,
                    format!("a MATLAB object of class {class}: left out; in MATLAB, save its numbers as plain arrays"),
                );
            }
            FUNCTION => self.notes.about(&name, "a function handle: left out"),
            SPARSE => self
                .notes
                .about(&name, "a sparse matrix: left out; in MATLAB, save full(…) of it"),
            CHAR => {
                let text = cursor.element().filter(|_| (1..=MOST_TEXT).contains(&count));
                if let Some(rows) = text.and_then(|(kind, data)| rows(kind, data, big, &head.size)) {
                    self.labels.push(Labels { name, rows });
                }
            }
            CELL | STRUCT | OBJECT if depth == 0 => {
                self.notes
                    .about(&name, "structs or cells in too many others: left out");
            }
            CELL => {
                for k in 1..=count {
                    if !self.nested(&mut cursor, &format!("{name}{{{k}}}"), depth)? {
                        return Err(damaged("cells are missing"));
                    }
                }
            }
            STRUCT | OBJECT => {
                if head.class == OBJECT {
                    cursor.element().ok_or_else(|| damaged("no class name"))?;
                }
                let fields = fields(&mut cursor).ok_or_else(|| damaged("no names of fields"))?;
                for k in 1..=count {
                    for field in &fields {
                        let full = match count {
                            1 => format!("{name}.{field}"),
                            _ => format!("{name}({k}).{field}"),
                        };
                        if !self.nested(&mut cursor, &full, depth)? {
                            return Err(damaged("fields are missing"));
                        }
                    }
                }
            }
            6..=15 => {
                if name.is_empty() || count == 0 {
                    return Ok(());
                }
                let parts = if head.complex { 2 } else { 1 };
                let memory = count.saturating_mul(8 * parts).saturating_add(name.len());
                let mut part = || {
                    let (kind, data) = cursor
                        .element()
                        .ok_or_else(|| damaged("its numbers are missing"))?;
                    let width = width(kind).ok_or_else(|| damaged("numbers of an unknown kind"))?;
                    if data.len() / width != count {
                        return Err(damaged(&format!("{} numbers of {count}", data.len() / width)));
                    }
                    Ok((kind, data))
                };
                let re = part()?;
                let im = if head.complex { Some(part()?) } else { None };
                self.budget
                    .take(memory, &format!("variable {name}"))
                    .map_err(Trouble::Budget)?;
                self.variables.push(Variable {
                    name,
                    size: head.size,
                    re: numbers(re.0, re.1, big),
                    im: im.map(|(kind, data)| numbers(kind, data, big)),
                });
            }
            class => return Err(damaged(&format!("unknown class {class}"))),
        }
        Ok(())
    }

    /// The next element as a part of another variable; false where there is none. A damaged part is named, and the rest
    /// is read.
    fn nested(&mut self, cursor: &mut Cursor, path: &str, depth: usize) -> Result<bool, Trouble> {
        let Some((kind, data)) = cursor.element() else {
            return Ok(false);
        };
        let mut cut = path.len().min(NAME);
        while !path.is_char_boundary(cut) {
            cut -= 1;
        }
        let path = &path[..cut];
        if kind != MATRIX {
            self.notes.about(path, "damaged (no array): left out");
            return Ok(true);
        }
        match self.matrix(data, cursor.big, Some(path), depth - 1) {
            Err(Trouble::Damaged(name, why)) => {
                self.notes.about(&name, format!("damaged ({why}): left out"));
                Ok(true)
            }
            Err(budget) => Err(budget),
            Ok(()) => Ok(true),
        }
    }
}

/// Names of the fields of a struct: their width, then all of them.
fn fields(cursor: &mut Cursor) -> Option<Vec<String>> {
    let (_, width) = cursor.element()?;
    let width = Cursor {
        bytes: width,
        at: 0,
        big: cursor.big,
    }
    .u32(0)? as usize;
    let (_, names) = cursor.element()?;
    if width == 0 {
        return names.is_empty().then(Vec::new);
    }
    Some(names.chunks_exact(width).map(name_of).collect())
}

/// The rows of a matrix of characters, without the blanks at their ends; `None` where it is damaged.
fn rows(kind: u32, data: &[u8], big: bool, size: &[usize]) -> Option<Vec<String>> {
    const UTF8: u32 = 16;
    const UTF16: u32 = 17;
    let &[count, columns] = size else { return None };
    let characters: Vec<char> = match kind {
        UTF8 => decode(data).chars().collect(),
        1 | 2 => data.iter().map(|b| char::from(*b)).collect(),
        4 | UTF16 => {
            let units = numbers(4, data, big).into_iter().map(|v| v as u16);
            char::decode_utf16(units)
                .map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER))
                .collect()
        }
        _ => return None,
    };
    (characters.len() == count * columns).then(|| {
        (0..count)
            .map(|row| {
                let line: String = characters.iter().skip(row).step_by(count).collect();
                line.trim_end_matches([' ', '\0']).to_string()
            })
            .collect()
    })
}

/// Bytes of a number.
fn width(kind: u32) -> Option<usize> {
    Some(match kind {
        1 | 2 => 1,
        3 | 4 => 2,
        5..=7 => 4,
        9 | 12 | 13 => 8,
        _ => return None,
    })
}

/// Numbers of any kind. 64-bit integers beyond 2⁵³ are rounded; measurements are not that long.
fn numbers(kind: u32, data: &[u8], big: bool) -> Vec<f64> {
    macro_rules! of {
        ($kind:ty) => {
            data.chunks_exact(size_of::<$kind>())
                .map(|b| {
                    let b = b.try_into().unwrap_or_default();
                    (if big {
                        <$kind>::from_be_bytes(b)
                    } else {
                        <$kind>::from_le_bytes(b)
                    }) as f64
                })
                .collect()
        };
    }
    match kind {
        1 => of!(i8),
        2 => of!(u8),
        3 => of!(i16),
        4 => of!(u16),
        5 => of!(i32),
        6 => of!(u32),
        7 => of!(f32),
        12 => of!(i64),
        13 => of!(u64),
        _ => of!(f64),
    }
}
