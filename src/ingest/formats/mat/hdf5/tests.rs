use hdf5_pure::{FileBuilder, LibVer, MaxExtent};

use crate::ingest::formats::mat::hdf5::*;

fn read_all(bytes: &[u8]) -> (Result<Vec<Variable>, InputError>, Vec<String>) {
    let mut notes = Notes::default();
    let found = read(bytes, &mut Budget::for_file(bytes.len()), &mut notes);
    (found, notes.into_warnings())
}

fn ramp(n: usize) -> Vec<f64> {
    (0..n).map(|k| (0.37 * k as f64).sin() + k as f64).collect()
}

/// Every way to store an array that the writer knows, in one file of a version.
fn file(versions: Option<(LibVer, LibVer)>, userblock: bool, many: usize, columns: usize) -> Vec<u8> {
    let mut builder = FileBuilder::new();
    if let Some((low, high)) = versions {
        builder.with_libver_bounds(low, high);
    }
    if userblock {
        builder.with_userblock(512);
    }
    let shape = [7, columns as u64];
    let values = ramp(7 * columns);
    builder
        .create_dataset("plain")
        .with_f64_data(&values)
        .with_shape(&shape);
    builder
        .create_dataset("chunks")
        .with_f64_data(&values)
        .with_shape(&shape)
        .with_chunks(&[3, 50]);
    builder
        .create_dataset("packed")
        .with_f64_data(&values)
        .with_shape(&shape)
        .with_chunks(&[2, 64])
        .with_shuffle()
        .with_deflate(6)
        .with_fletcher32();
    builder
        .create_dataset("single")
        .with_f64_data(&values)
        .with_shape(&shape)
        .with_chunks(&shape)
        .with_deflate(6);
    for (name, most, chunk) in [
        (
            "grows",
            [MaxExtent::Unlimited, MaxExtent::Fixed(columns as u64)],
            [1, 10],
        ),
        ("grows2", [MaxExtent::Fixed(9), MaxExtent::Unlimited], [2, 1]),
    ] {
        let data = builder.create_dataset(name);
        data.with_f64_data(&values)
            .with_shape(&shape)
            .with_maxshape(&most)
            .with_chunks(&chunk);
        if name != "grows" {
            data.with_deflate(4);
        }
    }
    builder
        .create_dataset("complex")
        .with_complex64_data(&[(1.0, -1.0), (2.0, -2.0)])
        .with_shape(&[1, 2]);
    builder
        .create_dataset("int")
        .with_i16_data(&[-1, 2, 300])
        .with_shape(&[3, 1]);
    builder
        .create_dataset("float")
        .with_f32_data(&[0.5, -2.0])
        .with_shape(&[2]);
    let mut group = builder.create_group("s");
    for k in 0..many {
        group
            .create_dataset(&format!("field_{k}"))
            .with_u8_data(&[k as u8])
            .with_shape(&[1, 1]);
    }
    builder.add_group(group.finish());
    builder.finish().unwrap()
}

#[test]
fn every_layout_index_and_filter_gives_the_numbers_that_were_written() {
    let versions = [
        None,
        Some((LibVer::V110, LibVer::V110)),
        Some((LibVer::V114, LibVer::V114)),
    ];
    for (k, version) in versions.into_iter().enumerate() {
        for many in [3, 60] {
            let bytes = file(version, k % 2 == 0, many, 301);
            let (found, warnings) = read_all(&bytes);
            let found = found.unwrap_or_else(|e| panic!("{version:?}: {e}"));
            assert!(warnings.is_empty(), "{version:?}: {warnings:?}");
            let by_name = |name: &str| {
                found
                    .iter()
                    .find(|v| v.name == name)
                    .unwrap_or_else(|| panic!("{version:?} {name} {many}"))
            };
            for name in ["plain", "chunks", "packed", "single", "grows", "grows2"] {
                assert_eq!(by_name(name).size, [301, 7], "{name}");
                assert_eq!(by_name(name).re, ramp(7 * 301), "{version:?} {name}");
            }
            assert_eq!(by_name("complex").im.as_deref(), Some(&[-1.0, -2.0][..]));
            assert_eq!(by_name("int").re, [-1.0, 2.0, 300.0]);
            assert_eq!(by_name("float").re, [0.5, -2.0]);
            for k in 0..many {
                assert_eq!(by_name(&format!("s.field_{k}")).re, [k as f64]);
            }
        }
    }
}

#[test]
fn damage_is_found_and_bounded() {
    let bytes = file(None, true, 12, 9);
    let whole = read_all(&bytes).0.unwrap();
    let same = |a: &Variable, b: &Variable| a == b;
    // Whatever byte is changed: an error, a warning, or (in unused room and in data without checksum) the same variables.
    for at in (512..bytes.len()).step_by(7) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x41;
        let _ = read_all(&damaged);
    }
    for end in (520..bytes.len()).step_by(97) {
        if let (Ok(found), warnings) = read_all(&bytes[..end]) {
            let lost = whole.iter().any(|v| !found.iter().any(|f| same(f, v)));
            assert!(
                !lost || !warnings.is_empty(),
                "cut at {end}: variables gone without a word"
            );
        }
    }
}

#[test]
fn the_checksums_are_those_of_the_format() {
    // Jenkins' own test values for lookup3 (hashlittle with start value 0).
    assert_eq!(cursor::lookup3(b""), 0xdead_beef);
    assert_eq!(cursor::lookup3(b"Four score and seven years ago"), 0x1777_0551);
}
