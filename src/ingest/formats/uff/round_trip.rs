//! Every form of dataset 58 written and read back, whole and damaged.

use num_complex::Complex64;
use proptest::prelude::*;

use crate::ingest::decode::read_bytes;
use crate::ingest::formats::uff::datasets::read;
use crate::ingest::formats::uff::*;
use crate::ingest::text::Notes;

/// A value as the file can hold it: `digits` after the point in ASCII, single or double in binary.
fn stored(value: f64, encoding: Encoding58, double: bool) -> f64 {
    match (encoding.binary, double) {
        (None, true) => format!("{value:.12e}").parse().unwrap(),
        (None, false) => format!("{value:.5e}").parse().unwrap(),
        (Some(_), true) => value,
        (Some(_), false) => f64::from(value as f32),
    }
}

fn datasets() -> impl Strategy<Value = Dataset58> {
    let number = prop_oneof![
        Just(0.0),
        -1e3..1e3_f64,
        (-30..30_i32, -9.9..9.9_f64).prop_map(|(e, m)| m * 10_f64.powi(e))
    ];
    let points = 1..40_usize;
    let even = (any::<bool>(), -1e3..1e3_f64, 1e-6..1e3_f64);
    let names = ("[A-Za-z0-9 .+-]{0,10}", -99_999_i64..99_999, -6..7_i32);
    (
        points,
        any::<bool>(),
        even,
        prop::collection::vec((number.clone(), number), 40),
        names,
        "\\PC{0,70}",
    )
        .prop_map(
            |(points, complex, (even, start, step), values, (name, node, direction), id)| {
                let entity = EntityDof {
                    name: name.trim().to_owned(),
                    node,
                    direction,
                };
                Dataset58 {
                    id_lines: std::iter::once(id.trim().to_owned())
                        .chain((0..4).map(|_| "NONE".to_owned()))
                        .collect(),
                    function_type: 4,
                    response: entity.clone(),
                    reference: entity,
                    axes: [
                        (18, "Frequency", "Hz"),
                        (12, "NONE", "m/s^2"),
                        (13, "Force", "N"),
                        (0, "NONE", "NONE"),
                    ]
                    .map(|(kind, label, unit)| UnitAxis {
                        kind,
                        label: label.into(),
                        unit: unit.into(),
                    }),
                    abscissa: if even {
                        Abscissa::Even { start, step }
                    } else {
                        Abscissa::Uneven((0..points).map(|i| start + step * (i * i) as f64).collect())
                    },
                    ordinate: if complex {
                        Ordinate::Complex(
                            values[..points]
                                .iter()
                                .map(|v| Complex64::new(v.0, v.1))
                                .collect(),
                        )
                    } else {
                        Ordinate::Real(values[..points].iter().map(|v| v.0).collect())
                    },
                }
            },
        )
}

/// What must come back: numbers rounded as the form stores them.
fn as_stored(mut dataset: Dataset58, encoding: Encoding58) -> Dataset58 {
    let short = Encoding58 {
        binary: None,
        double: false,
    };
    match &mut dataset.abscissa {
        Abscissa::Even { start, step } => [start, step]
            .into_iter()
            .for_each(|v| *v = stored(*v, short, false)),
        Abscissa::Uneven(values) => values.iter_mut().for_each(|v| *v = stored(*v, encoding, false)),
    }
    match &mut dataset.ordinate {
        Ordinate::Real(values) => values
            .iter_mut()
            .for_each(|v| *v = stored(*v, encoding, encoding.double)),
        Ordinate::Complex(values) => values.iter_mut().for_each(|v| {
            *v = Complex64::new(
                stored(v.re, encoding, encoding.double),
                stored(v.im, encoding, encoding.double),
            );
        }),
    }
    dataset
}

proptest! {
    /// Eight cases of record 12 (real or complex, single or double, even or uneven), ASCII and both byte orders.
    #[test]
    fn every_form_comes_back(first in datasets(), second in datasets(), double: bool, crlf: bool) {
        for binary in [None, Some(ByteOrder::Little), Some(ByteOrder::Big)] {
            let encoding = Encoding58 { binary, double };
            let mut bytes = uff58_bytes(&[first.clone(), second.clone()], encoding);
            if crlf && binary.is_none() {
                bytes = String::from_utf8_lossy(&bytes).replace('\n', "\r\n").into_bytes();
            }
            let mut notes = Notes::default();
            let file = read(&bytes, &mut notes).unwrap();
            prop_assert_eq!(notes.into_warnings(), Vec::<String>::new());
            prop_assert_eq!(file.found.len(), 2);
            prop_assert_eq!(&file.found[0].dataset, &as_stored(first.clone(), encoding));
            prop_assert_eq!(&file.found[1].dataset, &as_stored(second.clone(), encoding));
        }
    }

    /// Cut anywhere and with bytes turned over: an answer or an error, and never a number that is none.
    #[test]
    fn damaged_files_do_no_harm(
        dataset in datasets(),
        double: bool,
        binary in prop_oneof![Just(None), Just(Some(ByteOrder::Little)), Just(Some(ByteOrder::Big))],
        keep in 0.0..1.0_f64,
        hits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..8),
    ) {
        let mut bytes = uff58_bytes(&[dataset.clone(), dataset], Encoding58 { binary, double });
        bytes.truncate((bytes.len() as f64 * keep) as usize + 40);
        for (at, byte) in hits {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if let Ok((_, _, contents)) = read_bytes(&bytes, false, &mut Notes::default()) {
            crate::ingest::tests::assert_sound(&contents);
        }
    }
}
