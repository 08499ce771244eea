//! Writer of dataset 58 (ASCII) and 58b (IEEE binary).

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use crate::data::{ChannelRole, Dof, FrfRecord, Quantity, TimeRecord};
use crate::ingest::formats::uff::dataset58::{Abscissa, Dataset58, EntityDof, Ordinate, UnitAxis};
use crate::ingest::units;
use crate::{Error, Result};

/// Order of the bytes of a number in a binary dataset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ByteOrder {
    /// Least significant byte first.
    Little,
    /// Most significant byte first.
    Big,
}

/// How the ordinate is stored. Abscissa and spacing have six digits (`E13.5`, in binary single precision):
/// that is the format's own limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Encoding58 {
    /// `None`: ASCII.
    pub binary: Option<ByteOrder>,
    /// Double precision (`E20.12` or 8 bytes), else single (`E13.5` or 4 bytes).
    pub double: bool,
}

/// Writes FRFs (SI units) as one universal file, atomically.
///
/// # Errors
/// The operating system's, and FRFs whose frequency and value lengths differ.
pub fn write_uff58(path: &Path, frfs: &[FrfRecord], encoding: Encoding58) -> Result<()> {
    if let Some(frf) = frfs.iter().find(|f| f.frequency_hz.len() != f.value.len()) {
        return Err(Error::computation(format!(
            "FRF {}: {} frequencies and {} values",
            frf.name,
            frf.frequency_hz.len(),
            frf.value.len()
        )));
    }
    write_datasets58(path, &frfs.iter().map(frf_dataset).collect::<Vec<_>>(), encoding)
}

/// Writes datasets as they are, atomically.
pub fn write_datasets58(path: &Path, datasets: &[Dataset58], encoding: Encoding58) -> Result<()> {
    let folder = path
        .parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let save = || {
        let mut file = tempfile::NamedTempFile::new_in(folder)?;
        file.write_all(&uff58_bytes(datasets, encoding))?;
        file.persist(path).map_err(|e| e.error)
    };
    save().map(|_| ()).map_err(|e| Error::io(path, e))
}

/// The dataset of an FRF in SI units.
pub fn frf_dataset(frf: &FrfRecord) -> Dataset58 {
    let (kind, unit) = match frf.quantity {
        Some(Quantity::Receptance) => (8, "m"),
        Some(Quantity::Mobility) => (11, "m/s"),
        Some(Quantity::Accelerance) => (12, "m/s^2"),
        None => (0, "NONE"),
    };
    Dataset58 {
        id_lines: vec![frf.name.clone()],
        function_type: 4,
        response: entity(frf.response),
        reference: entity(frf.reference),
        axes: [
            axis(18, "Frequency", "Hz"),
            axis(kind, "NONE", unit),
            axis(13, "Force", "N"),
            axis(0, "NONE", "NONE"),
        ],
        abscissa: abscissa(&frf.frequency_hz),
        ordinate: Ordinate::Complex(frf.value.clone()),
    }
}

/// One dataset for each channel of a time record, in the SI unit of the channel.
pub fn time_datasets(record: &TimeRecord) -> Vec<Dataset58> {
    let step = 1.0 / record.sample_rate_hz;
    let dataset = |channel: &crate::ingest::Channel| {
        let unit = units::parse(&channel.file_unit)
            .and_then(|u| u.dimension.describe())
            .map_or("NONE", |(_, si)| si);
        let (kind, direction) = match channel.role {
            ChannelRole::ForceX => (13, 1),
            ChannelRole::ForceY => (13, 2),
            ChannelRole::ForceZ => (13, 3),
            ChannelRole::TorqueZ | ChannelRole::Other => (0, 0),
        };
        Dataset58 {
            id_lines: vec![channel.name.clone()],
            function_type: 1,
            response: EntityDof {
                name: "NONE".into(),
                node: 1,
                direction,
            },
            reference: EntityDof {
                name: "NONE".into(),
                node: 0,
                direction: 0,
            },
            axes: [
                axis(17, "Time", "s"),
                axis(kind, &channel.name, unit),
                axis(0, "NONE", "NONE"),
                axis(0, "NONE", "NONE"),
            ],
            abscissa: Abscissa::Even {
                start: record.start_s,
                step,
            },
            ordinate: Ordinate::Real(channel.samples.clone()),
        }
    };
    record.channels.iter().map(dataset).collect()
}

fn entity(dof: Option<Dof>) -> EntityDof {
    let (node, direction) = dof.map_or((0, 0), |dof| {
        let direction = dof.axis.index() as i32 + 1;
        (dof.node, if dof.negative { -direction } else { direction })
    });
    EntityDof {
        name: "NONE".into(),
        node,
        direction,
    }
}

fn axis(kind: i32, label: &str, unit: &str) -> UnitAxis {
    UnitAxis {
        kind,
        label: label.into(),
        unit: unit.into(),
    }
}

/// Even spacing only where start and step survive their six digits.
fn abscissa(values: &[f64]) -> Abscissa {
    let [start, second, .., last] = *values else {
        return Abscissa::Uneven(values.to_vec());
    };
    let rounded = |value: f64| format!("{value:.5e}").parse::<f64>().unwrap_or(value);
    let step = rounded((last - start) / (values.len() - 1) as f64);
    let start = rounded(start);
    let tolerance = 1e-6 * (second - start).abs();
    let even = step > 0.0
        && values
            .iter()
            .enumerate()
            .all(|(i, f)| (start + step * i as f64 - f).abs() <= tolerance.max(1e-9 * f.abs()));
    if even {
        Abscissa::Even { start, step }
    } else {
        Abscissa::Uneven(values.to_vec())
    }
}

/// The bytes of a universal file with these datasets.
pub fn uff58_bytes(datasets: &[Dataset58], encoding: Encoding58) -> Vec<u8> {
    let mut bytes = Vec::new();
    for dataset in datasets {
        push_dataset(&mut bytes, dataset, encoding);
    }
    bytes
}

fn push_dataset(bytes: &mut Vec<u8>, dataset: &Dataset58, encoding: Encoding58) {
    let complex = matches!(dataset.ordinate, Ordinate::Complex(_));
    let form = match (complex, encoding.double) {
        (false, false) => 2,
        (false, true) => 4,
        (true, false) => 5,
        (true, true) => 6,
    };
    let points = dataset.ordinate.len();
    let (even, start, step) = match &dataset.abscissa {
        Abscissa::Even { start, step } => (true, *start, *step),
        Abscissa::Uneven(_) => (false, 0.0, 0.0),
    };
    let width = match (even, encoding.double) {
        (true, _) => 0,
        (false, _) => 4,
    } + (1 + usize::from(complex)) * if encoding.double { 8 } else { 4 };
    let mut head = String::from("    -1\n");
    let _ = match encoding.binary {
        None => writeln!(head, "{:6}{:74}", 58, ""),
        Some(order) => {
            let order = if order == ByteOrder::Little { 1 } else { 2 };
            writeln!(
                head,
                "{:6}b{order:6}{:6}{:12}{:12}{:6}{:6}{:12}{:12}",
                58,
                2,
                11,
                points * width,
                0,
                0,
                0,
                0
            )
        }
    };
    for i in 0..5 {
        let _ = writeln!(
            head,
            "{:80}",
            one_line(dataset.id_lines.get(i).map_or("NONE", |l| l), 80)
        );
    }
    let _ = writeln!(
        head,
        "{:5}{:10}{:5}{:10} {:10}{:10}{:4} {:10}{:10}{:4}",
        dataset.function_type,
        0,
        0,
        0,
        one_line(&dataset.response.name, 10),
        dataset.response.node,
        dataset.response.direction,
        one_line(&dataset.reference.name, 10),
        dataset.reference.node,
        dataset.reference.direction
    );
    let _ = writeln!(
        head,
        "{form:10}{points:10}{:10}{}{}{}",
        i32::from(even),
        scientific(start, 13, 5),
        scientific(step, 13, 5),
        scientific(0.0, 13, 5)
    );
    for axis in &dataset.axes {
        let _ = writeln!(
            head,
            "{:10}{:5}{:5}{:5} {:20} {:20}",
            axis.kind,
            0,
            0,
            0,
            one_line(&axis.label, 20),
            one_line(&axis.unit, 20)
        );
    }
    bytes.extend_from_slice(head.as_bytes());
    match encoding.binary {
        None => push_ascii(bytes, dataset, encoding.double),
        Some(order) => push_binary(bytes, dataset, encoding.double, order),
    }
    bytes.extend_from_slice(b"    -1\n");
}

fn one_line(text: &str, length: usize) -> String {
    text.chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .take(length)
        .collect()
}

/// Fortran `E{width}.{digits}`-like: `1.00000e-05`, two exponent digits at least.
fn scientific(value: f64, width: usize, digits: usize) -> String {
    let text = format!("{value:.digits$e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let (sign, exponent) = match exponent.strip_prefix('-') {
        Some(exponent) => ('-', exponent),
        None => ('+', exponent),
    };
    format!("{:>width$}", format!("{mantissa}e{sign}{exponent:0>2}"))
}

/// Numbers of one point: abscissa where uneven, then the ordinate.
fn points(dataset: &Dataset58) -> impl Iterator<Item = (Option<f64>, f64, Option<f64>)> + '_ {
    (0..dataset.ordinate.len()).map(|i| {
        let abscissa = match &dataset.abscissa {
            Abscissa::Even { .. } => None,
            Abscissa::Uneven(values) => values.get(i).copied(),
        };
        match &dataset.ordinate {
            Ordinate::Real(values) => (abscissa, values[i], None),
            Ordinate::Complex(values) => (abscissa, values[i].re, Some(values[i].im)),
        }
    })
}

fn push_ascii(bytes: &mut Vec<u8>, dataset: &Dataset58, double: bool) {
    let (width, digits) = if double { (20, 12) } else { (13, 5) };
    let even = matches!(dataset.abscissa, Abscissa::Even { .. });
    let complex = matches!(dataset.ordinate, Ordinate::Complex(_));
    let points_per_line = match (even, complex, double) {
        (true, false, false) => 6,
        (true, false, true) => 4,
        (true, true, false) | (false, false, false) => 3,
        (true, true, true) | (false, true, false) | (false, false, true) => 2,
        (false, true, true) => 1,
    };
    let mut text = String::new();
    for (i, (abscissa, re, im)) in points(dataset).enumerate() {
        if let Some(abscissa) = abscissa {
            text.push_str(&scientific(abscissa, 13, 5));
        }
        for value in std::iter::once(re).chain(im) {
            text.push_str(&scientific(value, width, digits));
        }
        if (i + 1) % points_per_line == 0 || i + 1 == dataset.ordinate.len() {
            text.push('\n');
        }
    }
    bytes.extend_from_slice(text.as_bytes());
}

fn push_binary(bytes: &mut Vec<u8>, dataset: &Dataset58, double: bool, order: ByteOrder) {
    let mut push = |value: f64, double: bool| match (double, order) {
        (true, ByteOrder::Little) => bytes.extend(value.to_le_bytes()),
        (true, ByteOrder::Big) => bytes.extend(value.to_be_bytes()),
        (false, ByteOrder::Little) => bytes.extend((value as f32).to_le_bytes()),
        (false, ByteOrder::Big) => bytes.extend((value as f32).to_be_bytes()),
    };
    for (abscissa, re, im) in points(dataset) {
        if let Some(abscissa) = abscissa {
            push(abscissa, false);
        }
        for value in std::iter::once(re).chain(im) {
            push(value, double);
        }
    }
}
