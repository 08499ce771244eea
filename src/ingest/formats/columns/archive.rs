//! ZIP archives, of which NPZ and XLSX are made: deflated members, no directories, nothing beyond 4 GB.
//!
//! Source: APPNOTE.TXT, .ZIP File Format Specification 6.3 (PKWARE), sections 4.3.7, 4.3.12 and 4.3.16.

use std::io::Write as _;

use flate2::Compression;
use flate2::write::DeflateEncoder;

use crate::{Error, Result};

const LOCAL: u32 = 0x0403_4b50;
const CENTRAL: u32 = 0x0201_4b50;
const END: u32 = 0x0605_4b50;
/// Version that can unpack it (2.0), names in UTF-8, deflated.
const VERSION: u16 = 20;
const UTF8: u16 = 1 << 11;
const DEFLATED: u16 = 8;
/// 1 January 1980, midnight: the earliest that the format knows. The same content has the same bytes.
const TIME: u16 = 0;
const DATE: u16 = (1 << 5) | 1;

/// The bytes of an archive with these members.
///
/// # Errors
/// More than the format holds without its extension for large files.
pub(super) fn zip_bytes(members: &[(String, Vec<u8>)]) -> Result<Vec<u8>> {
    let too_large = |what: usize| {
        u32::try_from(what)
            .map_err(|_| Error::computation("more than 4 GB in one file: choose csv or parquet"))
    };
    let count = u16::try_from(members.len())
        .map_err(|_| Error::computation("more than 65535 arrays in one file: choose csv or parquet"))?;
    let (mut bytes, mut directory) = (Vec::new(), Vec::new());
    for (name, content) in members {
        let failed = |e: std::io::Error| Error::computation(format!("{name}: {e}"));
        let mut encoder = DeflateEncoder::new(Vec::new(), Compression::default());
        encoder.write_all(content).map_err(failed)?;
        let packed = encoder.finish().map_err(failed)?;
        let offset = too_large(bytes.len())?;
        let mut head = Vec::new();
        for word in [VERSION, UTF8, DEFLATED, TIME, DATE] {
            head.extend(word.to_le_bytes());
        }
        for long in [
            crc32fast::hash(content),
            too_large(packed.len())?,
            too_large(content.len())?,
        ] {
            head.extend(long.to_le_bytes());
        }
        head.extend((name.len() as u16).to_le_bytes());
        // No extra field.
        head.extend(0u16.to_le_bytes());
        bytes.extend(LOCAL.to_le_bytes());
        bytes.extend(&head);
        bytes.extend(name.as_bytes());
        bytes.extend(&packed);
        directory.extend(CENTRAL.to_le_bytes());
        directory.extend(VERSION.to_le_bytes());
        directory.extend(&head);
        // No comment, first disk, no attributes.
        directory.extend([0; 10]);
        directory.extend(offset.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let start = too_large(bytes.len())?;
    let length = too_large(directory.len())?;
    bytes.extend(directory);
    bytes.extend(END.to_le_bytes());
    bytes.extend([0; 4]);
    bytes.extend(count.to_le_bytes());
    bytes.extend(count.to_le_bytes());
    bytes.extend(length.to_le_bytes());
    bytes.extend(start.to_le_bytes());
    bytes.extend(0u16.to_le_bytes());
    Ok(bytes)
}
