//! Universal files of the odd shapes that are met, and every form written and read back.

use num_complex::Complex64;

use crate::data::{Channel, ChannelRole, Dof, FrfRecord, Quantity, TimeRecord};
use crate::ingest::contents::Contents;
use crate::ingest::decode::read_bytes;
use crate::ingest::formats::uff::*;
use crate::ingest::text::Notes;

/// Header of a dataset 58; `axes` are data type, label and unit of abscissa, numerator, denominator.
fn header(record6: &str, record7: &str, axes: [(i32, &str, &str); 3]) -> String {
    let mut text = String::from("    -1\n    58\nid one\nNONE\n01-JAN-26\nNONE\nNONE\n");
    text += &format!("{record6}\n{record7}\n");
    for (kind, label, unit) in axes.into_iter().chain([(0, "NONE", "NONE")]) {
        text += &format!("{kind:10}    0    0    0 {label:20} {unit:20}\n");
    }
    text
}

const FRF_1X_1X: &str = "    4         0    0         0 NONE               1   1 NONE               1   1";
const HZ: (i32, &str, &str) = (18, "Frequency", "Hz");
const NEWTON: (i32, &str, &str) = (13, "Force", "N");

fn contents_of(bytes: &[u8]) -> (Contents, Vec<String>) {
    let mut notes = Notes::default();
    let (_, _, contents) = read_bytes(bytes, false, &mut notes).unwrap();
    (contents, notes.into_warnings())
}

fn problem_of(bytes: &[u8]) -> String {
    read_bytes(bytes, false, &mut Notes::default())
        .unwrap_err()
        .to_string()
}

/// One FRF over 3 lines from 10 Hz in steps of 0.5 Hz.
fn frf_file(numerator: (i32, &str, &str), denominator: (i32, &str, &str)) -> String {
    let record7 = "         5         3         1  1.00000e+01  5.00000e-01  0.00000e+00";
    header(FRF_1X_1X, record7, [HZ, numerator, denominator])
        + "  1.00000e+00 -2.00000e+00  3.00000e+00 -4.00000e+00  5.00000e+00 -6.00000e+00\n    -1\n"
}

#[test]
fn an_ascii_frf_in_si() {
    let (contents, warnings) = contents_of(frf_file((8, "Displacement", "m"), NEWTON).as_bytes());
    assert!(warnings.is_empty(), "{warnings:?}");
    let [frf] = contents.frfs.as_slice() else { panic!() };
    assert_eq!(
        (frf.name.as_str(), frf.quantity),
        ("1X/1X", Some(Quantity::Receptance))
    );
    assert_eq!(frf.frequency_hz, [10.0, 10.5, 11.0]);
    assert_eq!(frf.value[2], Complex64::new(5.0, -6.0));
}

#[test]
fn quantity_and_factor_by_type_and_label() {
    let lbf = 4.4482216152605;
    for (numerator, denominator, quantity, factor, warning) in [
        (
            (8, "NONE", "mm"),
            NEWTON,
            Some(Quantity::Receptance),
            1e-3,
            "converted",
        ),
        (
            (12, "NONE", "g"),
            NEWTON,
            Some(Quantity::Accelerance),
            9.80665,
            "converted",
        ),
        (
            (12, "NONE", "g"),
            (13, "F", "lbf"),
            Some(Quantity::Accelerance),
            9.80665 / lbf,
            "converted",
        ),
        (
            (11, "NONE", "m/s"),
            (13, "F", "kN"),
            Some(Quantity::Mobility),
            1e-3,
            "converted",
        ),
        (
            (0, "NONE", "(m/s)/N"),
            (0, "NONE", "NONE"),
            Some(Quantity::Mobility),
            1.0,
            "",
        ),
        (
            (12, "NONE", "V"),
            NEWTON,
            Some(Quantity::Accelerance),
            1.0,
            "counts in volts",
        ),
        (
            (12, "NONE", "NONE"),
            (13, "NONE", "NONE"),
            Some(Quantity::Accelerance),
            1.0,
            "SI assumed",
        ),
        (
            (12, "NONE", "parsec"),
            NEWTON,
            Some(Quantity::Accelerance),
            1.0,
            "not understood",
        ),
        (
            (12, "NONE", "m/s^2"),
            (13, "F", "NONE"),
            Some(Quantity::Accelerance),
            1.0,
            "N assumed",
        ),
        (
            (0, "Receptance", "(m/s)/N"),
            (0, "NONE", "NONE"),
            None,
            1.0,
            "quantity left open",
        ),
        ((8, "NONE", "m/s^2"), NEWTON, None, 1.0, "quantity left open"),
        (
            (12, "NONE", "m/s^2"),
            (12, "Base", "m/s^2"),
            None,
            1.0,
            "not a force",
        ),
        ((0, "NONE", "NONE"), (0, "NONE", "NONE"), None, 1.0, "SI assumed"),
    ] {
        let (contents, warnings) = contents_of(frf_file(numerator, denominator).as_bytes());
        let frf = &contents.frfs[0];
        assert_eq!(frf.quantity, quantity, "{numerator:?}");
        approx::assert_relative_eq!(frf.value[0].re, factor, max_relative = 1e-12);
        let found = if warning.is_empty() {
            warnings.is_empty()
        } else {
            warnings.iter().any(|w| w.contains(warning))
        };
        assert!(found, "{numerator:?} {denominator:?}: {warnings:?}");
    }
}

#[test]
fn dataset_164_scales_what_has_no_label() {
    let units = "    -1\n   164\n         7Inch (pound f)               2\n  3.93700787401574814D+01  \
                 2.24808943099710489D-01  1.80000000000000000D+00\n  4.59670000000000000D+02\n    -1\n";
    let inches = units.to_owned() + &frf_file((12, "NONE", "NONE"), (13, "NONE", "NONE"));
    let (contents, warnings) = contents_of(inches.as_bytes());
    approx::assert_relative_eq!(
        contents.frfs[0].value[0].re,
        0.0254 / 4.4482216152605,
        max_relative = 1e-9
    );
    assert!(warnings[0].contains("dataset 164"), "{warnings:?}");
    let labelled = units.to_owned() + &frf_file((12, "NONE", "m/s^2"), NEWTON);
    let (contents, warnings) = contents_of(labelled.as_bytes());
    assert_eq!(contents.frfs[0].value[0].re, 1.0);
    assert!(warnings[0].contains("disagree"), "{warnings:?}");
}

#[test]
fn a_separator_inside_the_header_is_no_separator() {
    let record6 = "    1         1    1         0 PWL Mic            1   1 NONE              -1   0";
    let record7 = "         2   2508876         1  1.11858E-05  1.95312E-05  0.00000E+00";
    let mut text = header(
        record6,
        record7,
        [(17, "Time", "s"), (15, "Pressure", "Pa"), (0, "NONE", "NONE")],
    );
    text = text.replace("01-JAN-26", "    -1");
    text += " -6.73633E-03 -4.45648E-03\n    -1";
    let short = problem_of(text.as_bytes());
    assert!(short.contains("announces 2508876 points and holds 2"), "{short}");
    let whole = text.replace("   2508876", "         2");
    let (contents, _) = contents_of(whole.as_bytes());
    let record = &contents.times[0];
    assert_eq!(record.channels[0].samples, [-6.73633e-3, -4.45648e-3]);
    assert_eq!(record.sample_rate_hz, 51200.0);
}

#[test]
fn touching_columns_and_fortran_exponents() {
    let record6 = "    1         0    0         0 NONE               1   1 NONE               0   0";
    let axes = [(17, "Time", "s"), (13, "Force", "N"), (0, "NONE", "NONE")];
    let file = |data: &str| {
        let record7 = "         2         6         1  0.00000E+00  1.00000E-03  0.00000E+00";
        header(record6, record7, axes) + data + "\n    -1\n"
    };
    for (data, values) in [
        (
            "-3.09944E-004-2.74181E-004  -0.00115633-6.31809E-004 4.76837E-005 0.00000E+000",
            [
                -3.09944e-4,
                -2.74181e-4,
                -0.00115633,
                -6.31809e-4,
                4.76837e-5,
                0.0,
            ],
        ),
        (
            "1.000000E+0002.000000E+0003.000000E+0004.000000E+0005.000000E+0006.000000E-001",
            [1.0, 2.0, 3.0, 4.0, 5.0, 0.6],
        ),
        (
            "  1.0D-01  2.0d+00 -3.0D0\n 4. 5 6",
            [0.1, 2.0, -3.0, 4.0, 5.0, 6.0],
        ),
        ("1.5E-1-2.5E1-3 4 5 6", [0.15, -25.0, -3.0, 4.0, 5.0, 6.0]),
    ] {
        let (contents, _) = contents_of(file(data).as_bytes());
        assert_eq!(contents.times[0].channels[0].samples, values, "{data}");
        assert_eq!(contents.times[0].channels[0].role, ChannelRole::ForceX);
    }
    assert!(problem_of(file("1.0 2.0 three 4.0").as_bytes()).contains("not numbers"));
}

#[test]
fn more_values_than_announced_and_padding() {
    let padded = frf_file((8, "NONE", "m"), NEWTON).replace("         5         3 ", "         5         2 ");
    let (contents, warnings) = contents_of(padded.as_bytes());
    assert_eq!((contents.frfs[0].value.len(), warnings.len()), (2, 0));
    let line = "  1.00000e+00 -2.00000e+00  3.00000e+00 -4.00000e+00  5.00000e+00 -6.00000e+00\n";
    let more = frf_file((8, "NONE", "m"), NEWTON).replace(line, &line.repeat(3));
    let (contents, warnings) = contents_of(more.as_bytes());
    assert_eq!(contents.frfs[0].value.len(), 3);
    assert!(warnings[0].contains("more values"), "{warnings:?}");
}

#[test]
fn a_record_that_is_cut_off_is_an_error_with_both_counts() {
    let text = frf_file((8, "NONE", "m"), NEWTON);
    let line = "  1.00000e+00 -2.00000e+00\n  3.00000e+00 -4.0000";
    let cut = text[..text.find("  1.00000e+00 -2").unwrap()].to_owned() + line;
    let problem = problem_of(cut.as_bytes());
    assert!(
        problem.contains("1X/1X: dataset 58 announces 3 points and holds 1: the file ends"),
        "{problem}"
    );
    let lost = text.replace("  3.00000e+00 -4.00000e+00  5.00000e+00 -6.00000e+00\n", "\n");
    let problem = problem_of(lost.as_bytes());
    assert!(
        problem.contains("announces 3 points and holds 1: lines of it are lost"),
        "{problem}"
    );
}

#[test]
fn a_spacing_that_does_not_rise_is_an_error() {
    for spacing in ["0.00000e+00", "-5.00000e-01"] {
        let text = frf_file((8, "NONE", "m"), NEWTON).replace("5.00000e-01", spacing);
        assert!(
            problem_of(text.as_bytes()).contains("1X/1X: dataset 58 with a spacing of"),
            "{spacing}"
        );
    }
}

fn example() -> FrfRecord {
    let dof: Dof = "7-Y".parse().unwrap();
    FrfRecord {
        name: "7-Y/12Z".into(),
        response: Some(dof),
        reference: Some("12Z".parse().unwrap()),
        quantity: Some(Quantity::Mobility),
        frequency_hz: vec![3.0, 3.2, 3.4, 3.6],
        value: (0..4)
            .map(|i| Complex64::new(1e-6 * f64::from(i), -2.5e-7))
            .collect(),
        coherence: None,
    }
}

const LITTLE: Encoding58 = Encoding58 {
    binary: Some(ByteOrder::Little),
    double: true,
};

#[test]
fn binary_ends_in_all_their_ways() {
    let mut other = example();
    other.value[0].re = 3e-6;
    let bytes = uff58_bytes(&[frf_dataset(&example()), frf_dataset(&other)], LITTLE);
    let end = bytes.len() - "    -1\n".len();
    for tail in [
        "    -1\n",
        "    -1",
        "\n    -1\n",
        "\r\n    -1\r\n",
        "    -1                    \n",
    ] {
        let mut file = bytes[..end].to_vec();
        file.extend_from_slice(tail.as_bytes());
        let (contents, warnings) = contents_of(&file);
        assert!(
            warnings.is_empty() && contents.frfs.len() == 2,
            "{tail:?}: {warnings:?}"
        );
        assert_eq!(contents.frfs[1].value, other.value);
    }
    let problem = problem_of(&bytes[..end - 20]);
    assert!(problem.contains("announces 4 points and holds 2"), "{problem}");
}

#[test]
fn binary_without_byte_count_and_with_double_abscissa() {
    let mut frf = example();
    frf.frequency_hz = vec![3.0, 3.25, 4.0, 7.5];
    let bytes = uff58_bytes(&[frf_dataset(&frf)], LITTLE);
    let header = String::from_utf8_lossy(&bytes[..87]).into_owned();
    assert!(
        header.contains("          80 "),
        "4 points of 4 + 16 bytes: {header}"
    );
    let mut no_count = bytes.clone();
    let at = header.find("          80 ").unwrap();
    no_count[at..at + 12].fill(b' ');
    assert_eq!(contents_of(&no_count).0.frfs[0].frequency_hz, frf.frequency_hz);
    // The same with an abscissa of eight bytes, as some programs write it.
    let data = bytes.len() - 80 - "    -1\n".len();
    let mut wide = bytes[..data].to_vec();
    wide[at + 10..at + 12].copy_from_slice(b"96");
    for (f, v) in frf.frequency_hz.iter().zip(&frf.value) {
        [*f, v.re, v.im].iter().for_each(|x| wide.extend(x.to_le_bytes()));
    }
    wide.extend_from_slice(b"    -1\n");
    let (contents, warnings) = contents_of(&wide);
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(
        (&contents.frfs[0].frequency_hz, &contents.frfs[0].value),
        (&frf.frequency_hz, &frf.value)
    );
}

#[test]
fn foreign_floating_point_and_invalid_headers_are_one_clear_error() {
    let bytes = uff58_bytes(&[frf_dataset(&example())], LITTLE);
    let with = |from: &str, to: &str| {
        let head = String::from_utf8_lossy(&bytes[..87])
            .replace(from, to)
            .into_bytes();
        [&head, &bytes[87..]].concat()
    };
    assert!(problem_of(&with("58b     1     2", "58b     1     1")).contains("DEC VMS"));
    assert!(problem_of(&with("58b     1     2", "58b     9     2")).contains("byte order"));
    let text = frf_file((8, "NONE", "m"), NEWTON);
    assert!(
        problem_of(
            text.replace("         5         3 ", "         3         3 ")
                .as_bytes()
        )
        .contains("data form 3")
    );
    assert!(problem_of(&text.as_bytes()[..300]).contains("within the header"));
    assert!(problem_of(b"    -1\n    15\n 1 2 3\n    -1\n").contains("dataset 15"));
    assert!(problem_of(b"    -1\n    15\n    -1\n    -1\n  oops\n    -1\n").contains("dataset number"));
}

#[test]
fn values_that_are_no_numbers_do_not_pass() {
    let mut frf = example();
    frf.value[2].im = f64::NAN;
    let bytes = uff58_bytes(&[frf_dataset(&frf)], LITTLE);
    let (contents, warnings) = contents_of(&bytes);
    assert_eq!(contents.frfs[0].frequency_hz.len(), 3);
    assert!(warnings[0].contains("without a valid number"), "{warnings:?}");
}

#[test]
fn coherence_finds_its_frf_and_times_their_record() {
    let mut coherence = frf_dataset(&example());
    coherence.function_type = 6;
    coherence.axes[1] = UnitAxis {
        kind: 0,
        label: "Coherence".into(),
        unit: "NONE".into(),
    };
    coherence.ordinate = Ordinate::Real(vec![0.9, 1.0, 0.5, 0.25]);
    let channel = |name: &str, role, unit: &str| Channel {
        name: name.into(),
        file_unit: unit.into(),
        role,
        samples: vec![0.5, -0.25, 4.0, 8.0],
    };
    let record = TimeRecord {
        filled: Vec::new(),
        sample_rate_hz: 2048.0,
        start_s: 0.25,
        channels: vec![
            channel("Fy", ChannelRole::ForceY, "N"),
            channel("acc", ChannelRole::Other, "m/s²"),
        ],
    };
    let mut datasets = vec![coherence, frf_dataset(&example())];
    datasets.extend(time_datasets(&record));
    for binary in [None, Some(ByteOrder::Big)] {
        let (contents, warnings) = contents_of(&uff58_bytes(&datasets, Encoding58 { binary, double: true }));
        assert!(warnings.is_empty(), "{warnings:?}");
        assert_eq!(contents.frfs[0].coherence, Some(vec![0.9, 1.0, 0.5, 0.25]));
        let [read] = contents.times.as_slice() else {
            panic!("one record expected")
        };
        assert_eq!((read.sample_rate_hz, read.start_s), (2048.0, 0.25));
        assert_eq!(
            read.channel(ChannelRole::ForceY).unwrap().samples,
            record.channels[0].samples
        );
        assert_eq!(read.channels[1].file_unit, "m/s²");
        assert!(contents.others.is_empty());
    }
}

#[test]
fn latin_1_carriage_returns_and_names_as_nodes() {
    let text = frf_file((0, "NONE", "m/s@"), (0, "NONE", "N"))
        .replace(
            "NONE               1   1 NONE               1   1",
            ".1.Z-              0   0 .56.Z              0   0",
        )
        .replace('\n', "\r\n");
    let bytes: Vec<u8> = text.bytes().map(|b| if b == b'@' { 0xB2 } else { b }).collect();
    let (contents, warnings) = contents_of(&bytes);
    let frf = &contents.frfs[0];
    assert_eq!(
        (frf.name.as_str(), frf.quantity),
        ("1-Z/56Z", Some(Quantity::Accelerance))
    );
    assert!(
        warnings.len() == 1 && warnings[0].contains("entity names"),
        "{warnings:?}"
    );
}

#[test]
fn an_frf_is_written_and_read_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.uff");
    write_uff58(&path, &[example()], LITTLE).unwrap();
    let (frfs, warnings) = crate::ingest::read_frfs(&path).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    let (frf, example) = (&frfs[0], example());
    assert_eq!(
        (frf.response, frf.reference, frf.quantity),
        (example.response, example.reference, example.quantity)
    );
    assert_eq!((&frf.name, &frf.value), (&example.name, &example.value));
    for (read, written) in frf.frequency_hz.iter().zip(&example.frequency_hz) {
        approx::assert_relative_eq!(read, written, max_relative = 1e-12);
    }
    let error = crate::ingest::read_time(&path).unwrap_err().to_string();
    assert!(
        error.contains("no time signal") && error.contains("1 FRF"),
        "{error}"
    );
}
