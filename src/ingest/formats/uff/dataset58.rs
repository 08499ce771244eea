//! Dataset 58 and 58b as they stand in the file: header records by their columns, ordinates as printed.

use num_complex::Complex64;

use crate::InputError;
use crate::ingest::formats::uff::binary::{BinaryHeader, read_binary};
use crate::ingest::formats::uff::ordinate_form::{OrdinateForm, named, too_short};
use crate::ingest::formats::uff::separator::is_separator;
use crate::ingest::tables::number;
use crate::ingest::text::{Lines, Notes, decode};

/// One side of record 6: entity name, node number and direction (±1..3 translation, ±4..6 rotation, 0 scalar).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct EntityDof {
    /// Entity name, ten characters in the file; `NONE` where there is none.
    pub name: String,
    /// Node number; 0 where there is none.
    pub node: i64,
    /// ±1 to ±3 along, ±4 to ±6 about X, Y, Z; 0 for a scalar.
    pub direction: i32,
}

/// Records 8 to 11: what an axis holds.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct UnitAxis {
    /// Specific data type: 8 displacement, 11 velocity, 12 acceleration, 13 excitation force, 17 time, 18 frequency, …
    pub kind: i32,
    /// What the axis is called, twenty characters in the file.
    pub label: String,
    /// Unit label, twenty characters in the file; `NONE` or blank where there is none.
    pub unit: String,
}

/// Where the values of a dataset stand, in the unit of its first axis.
#[derive(Debug, Clone, PartialEq)]
pub enum Abscissa {
    /// At even distances.
    Even {
        /// Abscissa of the first value.
        start: f64,
        /// Distance from one value to the next.
        step: f64,
    },
    /// Same length as the ordinate.
    Uneven(Vec<f64>),
}

/// The values of a dataset, in the units of the file.
#[derive(Debug, Clone, PartialEq)]
pub enum Ordinate {
    /// One number a point: time signals, coherences, power spectra.
    Real(Vec<f64>),
    /// Real and imaginary part of each point: FRFs, cross spectra.
    Complex(Vec<Complex64>),
}

impl Ordinate {
    /// Number of values.
    pub fn len(&self) -> usize {
        match self {
            Ordinate::Real(values) => values.len(),
            Ordinate::Complex(values) => values.len(),
        }
    }

    /// Are there no values?
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// One function at nodal degrees of freedom, in the units of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct Dataset58 {
    /// Five lines of text.
    pub id_lines: Vec<String>,
    /// 1 time response, 2 auto, 3 cross spectrum, 4 FRF, 6 coherence, …
    pub function_type: i32,
    /// Where and along what was measured.
    pub response: EntityDof,
    /// Where and along what was excited; node 0 where that does not apply.
    pub reference: EntityDof,
    /// Abscissa, ordinate numerator, ordinate denominator, z axis.
    pub axes: [UnitAxis; 4],
    /// Times, frequencies or whatever the first of `axes` says.
    pub abscissa: Abscissa,
    /// One value for each abscissa.
    pub ordinate: Ordinate,
}

impl Dataset58 {
    /// Abscissa values, one for each ordinate value.
    pub fn abscissa_values(&self) -> Vec<f64> {
        match &self.abscissa {
            Abscissa::Even { start, step } => (0..self.ordinate.len())
                .map(|i| start + step * i as f64)
                .collect(),
            Abscissa::Uneven(values) => values.clone(),
        }
    }

    /// `1X/1Y`-like name from entity names and nodes, for messages.
    pub fn title(&self) -> String {
        let side = |dof: &EntityDof| match (dof.node, dof.direction) {
            (0, 0) if !dof.name.is_empty() && !dof.name.eq_ignore_ascii_case("none") => dof.name.clone(),
            (0, 0) => String::new(),
            (node, direction) => {
                let axis = ["", "X", "Y", "Z", "RX", "RY", "RZ"].get(direction.unsigned_abs() as usize);
                format!(
                    "{node}{}{}",
                    if direction < 0 { "-" } else { "" },
                    axis.unwrap_or(&"?")
                )
            }
        };
        let (response, reference) = (side(&self.response), side(&self.reference));
        match (response.is_empty(), reference.is_empty()) {
            (false, false) => format!("{response}/{reference}"),
            (false, true) => response,
            _ => self
                .id_lines
                .iter()
                .find(|l| !crate::ingest::units::is_blank(l))
                .cloned()
                .unwrap_or_default(),
        }
    }
}

/// Reads one dataset after its number line; `binary` is that line where it is a 58b. `None` where the file ends
/// before the first value.
pub(crate) fn read(
    lines: &mut Lines,
    binary: Option<&str>,
    notes: &mut Notes,
) -> Result<Option<Dataset58>, InputError> {
    let first = lines.number;
    let mut header = || lines.next().map(decode);
    let short = || {
        InputError::new("the file ends within the header of a dataset 58")
            .line(first)
            .remedy("the file is cut short: export or copy it again")
    };
    let mut records = Vec::with_capacity(11);
    for _ in 0..11 {
        records.push(header().ok_or_else(short)?);
    }
    let id_lines: Vec<String> = records[..5].iter().map(|l| l.trim().to_owned()).collect();
    let (function_type, response, reference) = record6(&records[5]).ok_or_else(|| {
        InputError::new(format!(
            "record 6 of dataset 58 (function type, nodes) cannot be read: {:?}",
            clip(&records[5])
        ))
        .line(first + 6)
    })?;
    let (form, announced, start, step) = record7(&records[6]).map_err(|problem| {
        InputError::new(format!(
            "record 7 of dataset 58 (form, number of points, spacing): {problem}: {:?}",
            clip(&records[6])
        ))
        .line(first + 7)
    })?;
    let axes = [0, 1, 2, 3].map(|i| unit_axis(&records[7 + i]));
    let mut dataset = Dataset58 {
        id_lines,
        function_type,
        response,
        reference,
        axes,
        abscissa: Abscissa::Even { start, step },
        ordinate: Ordinate::Real(Vec::new()),
    };
    let title = dataset.title();
    if form.even && announced > 1 && !(step > 0.0) && EVENLY_SPACED.contains(&function_type) {
        return Err(InputError::new(format!(
            "{}: dataset 58 with a spacing of {step} (record 7): frequencies and times must rise",
            named(&title)
        ))
        .line(first + 7)
        .remedy("export it again; a spacing of 0 is what some programs write where they mean uneven data"));
    }
    let numbers = match binary {
        None => read_ascii(lines, form, announced, &title, notes)?,
        Some(line) => {
            let binary = BinaryHeader::read(line).map_err(|e| e.line(first))?;
            // The number line says how many header lines follow it; a writer may have added some.
            for _ in 11..binary.header_lines.clamp(11, 100) {
                lines.next();
            }
            read_binary(lines, form, announced, binary, &title, notes)?
        }
    };
    let points = numbers.chunks_exact(form.numbers_per_point());
    let skip = usize::from(!form.even);
    if !form.even {
        dataset.abscissa = Abscissa::Uneven(points.clone().map(|p| p[0]).collect());
    }
    dataset.ordinate = if form.complex {
        Ordinate::Complex(points.map(|p| Complex64::new(p[skip], p[skip + 1])).collect())
    } else {
        Ordinate::Real(points.map(|p| p[skip]).collect())
    };
    if dataset.ordinate.is_empty() {
        notes.about(&title, "dataset without values, left out");
        return Ok(None);
    }
    Ok(Some(dataset))
}

/// Function types whose abscissa is used: time response, FRF, coherence.
const EVENLY_SPACED: [i32; 3] = [1, 4, 6];

fn clip(text: &str) -> String {
    text.trim_end().chars().take(80).collect()
}

/// Characters `from..to` of a line, blank beyond its end.
fn column(line: &str, from: usize, to: usize) -> String {
    line.chars()
        .skip(from)
        .take(to - from)
        .collect::<String>()
        .trim()
        .to_owned()
}

/// `FORMAT(2(I5,I10),2(1X,10A1,I10,I4))`; by words where the columns do not hold.
fn record6(line: &str) -> Option<(i32, EntityDof, EntityDof)> {
    let by_columns = || {
        let dof = |at: usize| {
            Some(EntityDof {
                name: column(line, at, at + 10),
                node: column(line, at + 10, at + 20).parse().ok()?,
                direction: column(line, at + 20, at + 24).parse().ok()?,
            })
        };
        Some((column(line, 0, 5).parse().ok()?, dof(31)?, dof(56)?))
    };
    let by_words = || {
        let words: Vec<&str> = line.split_whitespace().collect();
        let [kind, _, _, _, name, node, direction, rest @ ..] = words.as_slice() else {
            return None;
        };
        let dof = |name: &str, node: &str, direction: &str| {
            Some(EntityDof {
                name: name.to_owned(),
                node: node.parse().ok()?,
                direction: direction.parse().ok()?,
            })
        };
        let reference = match rest {
            [name, node, direction, ..] => dof(name, node, direction)?,
            _ => EntityDof::default(),
        };
        Some((kind.parse().ok()?, dof(name, node, direction)?, reference))
    };
    by_columns().or_else(by_words)
}

/// `FORMAT(3I10,3E13.5)`: form, points, even or uneven, start, step.
fn record7(line: &str) -> Result<(OrdinateForm, usize, f64, f64), String> {
    let words: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
    let read = |fields: &[String]| -> Option<(i64, i64, i64, f64, f64)> {
        let real = |at: usize| match fields.get(at).map(|f| f.trim()) {
            None | Some("") => Some(0.0),
            Some(text) => number::field(text.as_bytes(), b'.'),
        };
        let integer = |at: usize| fields.get(at)?.parse().ok();
        Some((integer(0)?, integer(1)?, integer(2)?, real(3)?, real(4)?))
    };
    let columns = [(0, 10), (10, 20), (20, 30), (30, 43), (43, 56)].map(|(a, b)| column(line, a, b));
    let (form, points, spacing, start, step) =
        read(&words).or_else(|| read(&columns)).ok_or("cannot be read")?;
    let (complex, double) = match form {
        2 => (false, false),
        4 => (false, true),
        5 => (true, false),
        6 => (true, true),
        other => return Err(format!("unknown data form {other} (2, 4, 5 or 6 is expected)")),
    };
    let even = match spacing {
        0 => false,
        1 => true,
        other => {
            return Err(format!(
                "unknown spacing {other} (0 uneven or 1 even is expected)"
            ));
        }
    };
    let points = usize::try_from(points).map_err(|_| format!("{points} points"))?;
    if even && !(start.is_finite() && step.is_finite()) {
        return Err("start or step is not a number".to_owned());
    }
    Ok((
        OrdinateForm {
            complex,
            double,
            even,
        },
        points,
        start,
        step,
    ))
}

/// `FORMAT(I10,3I5,2(1X,20A1))`; label and unit by gaps where the columns cut a word.
fn unit_axis(line: &str) -> UnitAxis {
    let kind = column(line, 0, 10).parse().ok();
    let kind = kind
        .or_else(|| line.split_whitespace().next()?.parse().ok())
        .unwrap_or(0);
    let characters: Vec<char> = line.chars().collect();
    let blank_at = |at: usize| characters.get(at).is_none_or(|c| c.is_whitespace());
    if blank_at(25) && blank_at(46) {
        return UnitAxis {
            kind,
            label: column(line, 26, 46),
            unit: column(line, 47, 67),
        };
    }
    let text: String = characters.iter().skip(25).collect();
    let mut parts = text.split("  ").map(str::trim).filter(|p| !p.is_empty());
    UnitAxis {
        kind,
        label: parts.next().unwrap_or_default().to_owned(),
        unit: parts.next().unwrap_or_default().to_owned(),
    }
}

/// Numbers of an ASCII dataset, up to its closing separator: at most the announced ones, whole points only.
fn read_ascii(
    lines: &mut Lines,
    form: OrdinateForm,
    announced: usize,
    title: &str,
    notes: &mut Notes,
) -> Result<Vec<f64>, InputError> {
    let per_point = form.numbers_per_point();
    let columns = form.columns();
    let wanted = announced.saturating_mul(per_point);
    // A number takes two bytes at least, so an announced count beyond the file cannot claim memory.
    let mut numbers: Vec<f64> = Vec::with_capacity(wanted.min(lines.rest().len() / 2 + 1));
    let mut before_line = 0;
    let mut closed = false;
    let mut line_before_end = false;
    while let Some(line) = lines.next() {
        if is_separator(line) {
            closed = true;
            break;
        }
        before_line = numbers.len();
        line_before_end = lines.at_unfinished_end();
        if numbers.len() > wanted {
            // Counted, not kept.
            numbers.truncate(wanted + 1);
            before_line = wanted + 1;
        }
        if !push_free(line, &mut numbers) {
            numbers.truncate(before_line);
            let read = push_columns(line, &columns, &mut numbers) || push_split(line, &mut numbers);
            if !(read || line_before_end) {
                return Err(InputError::new(format!(
                    "not numbers of a dataset 58: {:?}",
                    clip(&decode(line))
                ))
                .line(lines.number)
                .remedy("the dataset is damaged: export it again"));
            }
        }
    }
    if !closed && line_before_end {
        // The last number may be cut in the middle of its digits.
        numbers.truncate(before_line);
    }
    let read = numbers.len();
    // Some writers fill the last line up with zeros: at most a line's worth.
    let padding = if form.double { 4 } else { 6 };
    if read < wanted {
        return Err(too_short(title, read / per_point, announced, !closed).line(lines.number));
    }
    if !closed {
        notes.about(
            title,
            "the closing -1 is missing: the file may have been cut off behind this record",
        );
    }
    if read - wanted >= padding {
        notes.about(
            title,
            format!("more values than the {announced} points announced: the rest is left out"),
        );
    }
    numbers.truncate(wanted.min(read / per_point * per_point));
    Ok(numbers)
}

/// Blank-separated numbers. False (and perhaps some pushed) where two numbers touch.
fn push_free(line: &[u8], numbers: &mut Vec<f64>) -> bool {
    let mut at = 0;
    loop {
        while line.get(at).is_some_and(u8::is_ascii_whitespace) {
            at += 1;
        }
        if at >= line.len() {
            return true;
        }
        match number::scan(line, at, b'.') {
            Some((value, end)) if line.get(end).is_none_or(u8::is_ascii_whitespace) => {
                numbers.push(value);
                at = end;
            }
            _ => return false,
        }
    }
}

/// Numbers by the columns of the form, where they touch each other.
fn push_columns(line: &[u8], columns: &[usize], numbers: &mut Vec<f64>) -> bool {
    let line = line.trim_ascii_end();
    let before = numbers.len();
    let mut at = 0;
    // Writers that print three-digit exponents drop the leading blank: the widths stay.
    for width in columns.iter().cycle() {
        if at >= line.len() {
            return true;
        }
        let end = (at + width).min(line.len());
        match number::field(&line[at..end], b'.') {
            Some(value) => numbers.push(value),
            None => break,
        }
        at = end;
    }
    numbers.truncate(before);
    false
}

/// Numbers of any width that touch at their signs: `-3.1E-004-2.7E-004`.
fn push_split(line: &[u8], numbers: &mut Vec<f64>) -> bool {
    let before = numbers.len();
    let mut at = 0;
    loop {
        while line.get(at).is_some_and(u8::is_ascii_whitespace) {
            at += 1;
        }
        if at >= line.len() {
            return true;
        }
        match number::scan(line, at, b'.') {
            Some((value, end))
                if end > at
                    && line
                        .get(end)
                        .is_none_or(|b| b.is_ascii_whitespace() || matches!(b, b'-' | b'+')) =>
            {
                numbers.push(value);
                at = end;
            }
            _ => {
                numbers.truncate(before);
                return false;
            }
        }
    }
}
