use crate::ingest::formats::mat::v5::*;

/// An element with its tag, padded.
fn element(kind: u32, data: &[u8], big: bool) -> Vec<u8> {
    let word = |v: u32| if big { v.to_be_bytes() } else { v.to_le_bytes() };
    let mut out = [word(kind), word(data.len() as u32)].concat();
    out.extend(data);
    out.resize(out.len().div_ceil(8) * 8, 0);
    out
}

fn words(values: &[u32], big: bool) -> Vec<u8> {
    values
        .iter()
        .flat_map(|v| if big { v.to_be_bytes() } else { v.to_le_bytes() })
        .collect()
}

fn doubles(values: &[f64], big: bool) -> Vec<u8> {
    values
        .iter()
        .flat_map(|v| if big { v.to_be_bytes() } else { v.to_le_bytes() })
        .collect()
}

/// Flags, size and name of an array.
fn array(class: u32, complex: bool, size: &[u32], name: &str, big: bool) -> Vec<u8> {
    let flags = class | if complex { 0x800 } else { 0 };
    [
        element(6, &words(&[flags, 0], big), big),
        element(5, &words(size, big), big),
        element(1, name.as_bytes(), big),
    ]
    .concat()
}

fn real(name: &str, values: &[f64], big: bool) -> Vec<u8> {
    let head = array(6, false, &[values.len() as u32, 1], name, big);
    element(
        MATRIX,
        &[head, element(9, &doubles(values, big), big)].concat(),
        big,
    )
}

fn file(big: bool, elements: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = b"MATLAB 5.0 MAT-file".to_vec();
    bytes.resize(124, b' ');
    bytes.extend(if big { *b"\x01\x00MI" } else { *b"\x00\x01IM" });
    bytes.extend(elements.concat());
    bytes
}

fn read_all(bytes: &[u8]) -> (Result<Vec<Variable>, InputError>, Vec<String>) {
    let mut notes = Notes::default();
    let found = read(bytes, &mut Budget::for_file(bytes.len()), &mut notes).map(|(variables, _)| variables);
    (found, notes.into_warnings())
}

fn packed(element: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut encoder, element).unwrap();
    let data = encoder.finish().unwrap();
    [words(&[COMPRESSED, data.len() as u32], false), data].concat()
}

#[test]
fn arrays_of_both_byte_orders_packed_or_not_and_of_small_integers() {
    for big in [false, true] {
        let mut h = array(6, true, &[1, 2], "H", big);
        h.extend(element(9, &doubles(&[1.0, 2.0], big), big));
        h.extend(element(9, &doubles(&[-1.0, -2.0], big), big));
        // Doubles stored as 16-bit integers, in a small element.
        let mut small = array(6, false, &[2, 1], "n", big);
        small.extend(words(&[4 << 16 | 3], big));
        small.extend(
            [-5_i16, 300]
                .iter()
                .flat_map(|v| if big { v.to_be_bytes() } else { v.to_le_bytes() }),
        );
        let elements = [
            real("f", &[1.0, 2.0], big),
            element(MATRIX, &h, big),
            element(MATRIX, &small, big),
        ];
        let (found, warnings) = read_all(&file(big, &elements));
        let found = found.unwrap();
        assert!(warnings.is_empty(), "{warnings:?}");
        assert_eq!(
            (found[1].name.as_str(), found[1].size.as_slice()),
            ("H", &[1, 2][..])
        );
        assert_eq!(found[1].im.as_deref(), Some(&[-1.0, -2.0][..]));
        assert_eq!(found[2].re, [-5.0, 300.0]);
    }
    let (found, _) = read_all(&file(
        false,
        &[packed(&real("f", &[1.0, 2.0], false)), real("g", &[3.0], false)],
    ));
    let found = found.unwrap();
    assert_eq!((found[0].name.as_str(), found[1].name.as_str()), ("f", "g"));
}

#[test]
fn structs_cells_and_objects() {
    let inner = |v: &[f64]| real("", v, false);
    let mut cell = array(u32::from(CELL), false, &[1, 2], "c", false);
    cell.extend([inner(&[1.0]), inner(&[2.0, 3.0])].concat());
    let mut structure = array(u32::from(STRUCT), false, &[1, 1], "s", false);
    structure.extend(words(&[4 << 16 | 5, 8], false));
    structure.extend(element(1, b"a\0\0\0\0\0\0\0bb\0\0\0\0\0\0", false));
    structure.extend([inner(&[4.0]), element(MATRIX, &cell.clone(), false)].concat());
    let mut opaque = element(6, &words(&[u32::from(OPAQUE), 0], false), false);
    for text in ["tbl", "MCOS", "table"] {
        opaque.extend(element(1, text.as_bytes(), false));
    }
    let elements = [
        element(MATRIX, &opaque, false),
        element(MATRIX, &structure, false),
        real("x", &[9.0], false),
    ];
    let (found, warnings) = read_all(&file(false, &elements));
    let names: Vec<String> = found.unwrap().into_iter().map(|v| v.name).collect();
    assert_eq!(names, ["s.a", "s.bb{1}", "s.bb{2}", "x"]);
    assert!(
        warnings.len() == 1 && warnings[0].contains("tbl: a MATLAB object of class table"),
        "{warnings:?}"
    );
}

#[test]
fn every_variable_that_is_lost_is_named() {
    let whole = file(
        false,
        &[
            real("f", &[1.0, 2.0], false),
            packed(&real("g", &[3.0, 4.0], false)),
            real("h", &[5.0], false),
        ],
    );
    let all = read_all(&whole).0.unwrap();
    for end in HEADER..whole.len() {
        match read_all(&whole[..end]) {
            (Ok(found), warnings) => {
                let lost = found.len() < all.len();
                let between = found.is_empty() || found.last() == all.get(found.len() - 1);
                assert!(between, "{end}");
                // Only a cut exactly between two variables cannot be seen.
                let at_end = [HEADER].into_iter().chain(ends(&whole)).any(|e| e == end);
                assert!(
                    !lost || at_end || !warnings.is_empty(),
                    "cut at {end}: {warnings:?}"
                );
            }
            (Err(error), _) => assert!(error.problem.contains("no variable"), "{error}"),
        }
    }
    for at in HEADER..whole.len() {
        let mut damaged = whole.clone();
        damaged[at] ^= 0xFF;
        let _ = read_all(&damaged);
    }
}

/// Where the elements of a file end.
fn ends(bytes: &[u8]) -> Vec<usize> {
    let mut cursor = Cursor {
        bytes,
        at: HEADER,
        big: false,
    };
    let mut ends = Vec::new();
    while let Some(tag) = cursor.tag() {
        cursor.at += if tag.kind == COMPRESSED {
            tag.size
        } else {
            tag.padded()
        };
        ends.push(cursor.at);
    }
    ends
}

#[test]
fn text_is_read_row_by_row() {
    let one = [
        array(4, false, &[2, 3], "Unit", false),
        element(16, b"Ngm /s", false),
    ]
    .concat();
    let wide: Vec<u8> = "µg".encode_utf16().flat_map(u16::to_le_bytes).collect();
    let two = [array(4, false, &[1, 2], "mark", false), element(17, &wide, false)].concat();
    // One character of two.
    let cut = [array(4, false, &[1, 2], "cut", false), element(16, b"a", false)].concat();
    let all = [one, two, cut].map(|text| element(MATRIX, &text, false));
    let bytes = file(false, &[real("n", &[1.0, 2.0], false), all.concat()]);
    let (_, labels) = read(&bytes, &mut Budget::for_file(bytes.len()), &mut Notes::default()).unwrap();
    let rows: Vec<&[String]> = labels.iter().map(|l| l.rows.as_slice()).collect();
    assert_eq!(
        rows,
        [&["Nm/".to_string(), "g s".to_string()][..], &["µg".to_string()]]
    );
}
