//! FRFs as text: the campaign's FRF CSV, plain `Hz Re Im`, and CutPro-style `.frf`.

use std::collections::HashMap;

use num_complex::Complex64;

use crate::InputError;
use crate::data::{Dof, FrfRecord, Quantity};
use crate::ingest::checks;
use crate::ingest::dof_names;
use crate::ingest::tables::table::{Header, is_row};
use crate::ingest::text::{Lines, Notes, decode};
use crate::ingest::units;

/// What a column of an FRF table holds; the text names the FRF (empty where there is one only).
#[derive(Debug, Clone, PartialEq)]
enum Column {
    /// A running number in front of all others.
    Index,
    Frequency {
        factor: f64,
    },
    Re(String),
    Im(String),
    Magnitude(String, Scale),
    Phase(String, Angle),
    Coherence(String),
    Unknown,
}

/// How a column of magnitudes counts, as far as its heading says.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Scale {
    Unsaid,
    Linear,
    /// 20 log10 of the value over this reference.
    Decibel {
        reference: f64,
    },
}

/// What a column of phases counts in, as far as its heading says.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Angle {
    Unsaid,
    Degrees,
    Radians,
}

impl Angle {
    fn named(label: &str) -> Option<Angle> {
        match label.trim().trim_end_matches('.').to_lowercase().as_str() {
            "deg" | "degree" | "degrees" | "°" => Some(Angle::Degrees),
            "rad" | "radian" | "radians" => Some(Angle::Radians),
            _ => None,
        }
    }
}

/// `dB`, `dB re 1 m/N`, `dB (m/s²)/N`: the reference, and the unit where there is one.
fn decibel(label: &str) -> Option<(f64, &str)> {
    let label = label.trim();
    let rest = label
        .get(..2)
        .filter(|start| start.eq_ignore_ascii_case("db"))
        .map(|_| label[2..].trim_start())?;
    let rest = ["rel.", "rel", "ref.", "ref", "re:", "re"]
        .iter()
        .find_map(|word| {
            rest.strip_prefix(word)
                .filter(|r| !r.starts_with(char::is_alphabetic))
        })
        .unwrap_or(rest)
        .trim_start_matches([' ', ':']);
    let end = rest.find([' ', '(', '[']).unwrap_or(rest.len());
    match rest[..end].parse::<f64>() {
        Ok(reference) if reference.is_finite() && reference > 0.0 => Some((reference, rest[end..].trim())),
        _ => Some((1.0, rest)),
    }
}

/// The unit at the end of a column's name and the name without it: `Magnitude (dB)`, `Real [(m/s²)/N]`. Round brackets may
/// hold anything (the name of the FRF, mostly), so they count only where they hold a unit.
fn unit_behind(name: &str) -> (&str, Option<&str>) {
    let name = name.trim();
    let open = match name.chars().last() {
        Some(']') => name.find('['),
        Some(')') => opening_bracket(name),
        _ => None,
    };
    let Some(open) = open else { return (name, None) };
    let (bare, unit) = (name[..open].trim_end(), name[open + 1..name.len() - 1].trim());
    let known = || {
        decibel(unit).is_some()
            || Angle::named(unit).is_some()
            || units::parse(unit).is_some_and(|u| u.dimension.frf().is_some())
    };
    if !bare.is_empty() && (name.ends_with(']') || known()) {
        (bare, Some(unit))
    } else {
        (name, None)
    }
}

/// Where the round bracket opens that the last one closes.
fn opening_bracket(name: &str) -> Option<usize> {
    let mut depth = 0;
    for (at, c) in name.char_indices().rev() {
        match c {
            ')' => depth += 1,
            '(' => depth -= 1,
            _ => (),
        }
        if depth == 0 {
            return Some(at);
        }
    }
    None
}

/// Reads a column name such as `frequency_hz`, `re(1X/1Y)`, `im`, `phase_deg`, `Magnitude (dB)`.
fn column(name: &str) -> Column {
    let (bare, unit) = unit_behind(name);
    let read = column_without_unit(bare);
    let read = if unit.is_some() && read == Column::Unknown {
        column_without_unit(name)
    } else {
        read
    };
    in_unit(read, unit)
}

/// The column, with what its unit says of it.
fn in_unit(column: Column, unit: Option<&str>) -> Column {
    let Some(unit) = unit.filter(|u| !u.is_empty()) else {
        return column;
    };
    match column {
        Column::Frequency { .. } => Column::Frequency {
            factor: units::frequency_factor(unit).unwrap_or(1.0),
        },
        Column::Magnitude(of, Scale::Unsaid) => {
            let linear = units::parse_named(unit).map_or(Scale::Unsaid, |_| Scale::Linear);
            Column::Magnitude(
                of,
                decibel(unit).map_or(linear, |(reference, _)| Scale::Decibel { reference }),
            )
        }
        Column::Phase(of, Angle::Unsaid) => Column::Phase(of, Angle::named(unit).unwrap_or(Angle::Unsaid)),
        other => other,
    }
}

fn column_without_unit(name: &str) -> Column {
    let lower = name.trim().to_lowercase();
    let (head, inside) = match (lower.find('('), lower.rfind(')')) {
        (Some(open), Some(close)) if open < close => {
            (lower[..open].trim(), name.trim()[open + 1..close].trim())
        }
        _ => (lower.as_str(), ""),
    };
    let of = inside.to_owned();
    let db = Scale::Decibel { reference: 1.0 };
    match head {
        "re" | "real" | "re_h" => Column::Re(of),
        "im" | "imag" | "imaginary" | "im_h" => Column::Im(of),
        "mag" | "magnitude" | "abs" | "amplitude" => Column::Magnitude(of, Scale::Unsaid),
        "mag_db" | "magnitude_db" | "amplitude_db" | "db" => Column::Magnitude(of, db),
        "phase_deg" => Column::Phase(of, Angle::Degrees),
        "phase_rad" => Column::Phase(of, Angle::Radians),
        "phase" | "phase angle" => Column::Phase(of, Angle::Unsaid),
        "coherence" | "coh" | "gamma2" => Column::Coherence(of),
        // A nameless first column, `Unnamed: 0`: what pandas writes.
        "" | "unnamed: 0" | "index" | "line" | "no" | "no." | "nr" | "nr." | "n" | "#" | "row" => {
            Column::Index
        }
        "f" | "freq" | "frq" | "freq." | "frequency" | "frequency_hz" | "freq_hz" | "f_hz" | "hz"
        | "frequenz" => Column::Frequency {
            factor: units::frequency_factor(inside).unwrap_or(1.0),
        },
        _ => part_behind_name(name).unwrap_or(Column::Unknown),
    }
}

/// `amp_real`, `H1_2_imag`, `1X/1X re`, `Signal 2 (Imag.)`: the part stands behind the name of the FRF.
fn part_behind_name(name: &str) -> Option<Column> {
    let name = name.trim();
    let (name, unit) = ["_deg", "_rad", "_db", "_dB"]
        .iter()
        .find_map(|unit| Some((name.strip_suffix(unit)?, Some(&unit[1..]))))
        .unwrap_or((name, None));
    let (of, part) = name.rsplit_once(['_', ' '])?;
    let part = part.to_lowercase();
    // These name no FRF but the value itself.
    let of = of.trim();
    let bare = ["amp", "amplitude", "frf", "h", "value", "y"].contains(&of.to_lowercase().as_str());
    let of = if bare { String::new() } else { of.to_owned() };
    let part = match part.trim_matches(|c: char| "()[].".contains(c)) {
        "re" | "real" => Column::Re(of),
        "im" | "imag" | "imaginary" => Column::Im(of),
        "mag" | "magnitude" => Column::Magnitude(of, Scale::Unsaid),
        "phase" => Column::Phase(of, Angle::Unsaid),
        "coh" | "coherence" => Column::Coherence(of),
        _ => return None,
    };
    Some(in_unit(part, unit))
}

/// The names line of a SignalCalc export (Data Physics), put together: its signals (`H1,2`) stand above the parts (`Real`,
/// `Imag`), and the units under a line `Units:`. Such a header is changed to what other tables have.
pub(crate) fn join_signalcalc(header: &mut Header) {
    let split = |line: &String| -> Vec<String> { line.split('\t').map(|f| f.trim().to_owned()).collect() };
    let Some(units_at) = header.lines.iter().rposition(|l| l.trim() == "Units:") else {
        return;
    };
    let parts_at = header.lines[..units_at].iter().rposition(|l| {
        let fields = split(l);
        fields.len() >= 2 && matches!(column(&fields[0]), Column::Frequency { .. })
    });
    let Some(parts_at) = parts_at else { return };
    let parts = split(&header.lines[parts_at]);
    let signals = parts_at
        .checked_sub(1)
        .map(|at| split(&header.lines[at]))
        .unwrap_or_default();
    let mut units: Vec<String> = header.lines.get(units_at + 1).map(split).unwrap_or_default();
    if units.is_empty() && header.names.len() > 1 {
        units = header.names.clone();
    }
    let named: Vec<&String> = signals.iter().filter(|s| !s.is_empty()).collect();
    let each = (parts.len() - 1) / named.len().max(1);
    let name = |k: usize| {
        let part = parts[k].to_lowercase();
        let signal = (k > 0 && !named.is_empty() && each > 0)
            .then(|| named.get((k - 1) / each))
            .flatten();
        match signal {
            Some(signal) if part.starts_with("phase") => format!("phase_deg({signal})"),
            Some(signal) => format!("{part}({signal})"),
            None if part.starts_with("phase") => "phase_deg".into(),
            None => part,
        }
    };
    header.names = (0..parts.len()).map(name).collect();
    header.columns = header.names.len();
    units.resize(header.columns, String::new());
    header.units = units;
}

/// Header lines of a table without column names, or with none for the first column, that say what its columns are: the
/// text exports of Simcenter Testlab (`X axis unit`, `Value type`, `DOF id`, …; frequency, real and imaginary part
/// below) and those whose first column is the `AxisUnit`. Such a header is changed to what other tables have.
///
/// # Errors
/// Where they say that the columns are spectra without phases.
pub(crate) fn join_said_above(header: &mut Header) -> Result<(), InputError> {
    let mut said: HashMap<String, String> = HashMap::new();
    let last = header.names.join("\t");
    for line in header.lines.iter().chain([&last]) {
        let mut fields = line.split(['\t', ';']).map(str::trim);
        if let (Some(key), Some(value)) = (fields.next(), fields.next())
            && !key.is_empty()
            && !value.is_empty()
        {
            said.entry(key.to_lowercase()).or_insert_with(|| value.to_owned());
        }
    }
    let get = |key: &str| said.get(key).map(String::as_str);
    let is = |key: &str, value: &str| get(key).is_some_and(|v| v.eq_ignore_ascii_case(value));
    if is("function class", "frf") && is("x axis unit", "hz") && is("value type", "complex") {
        // The last of them is no line of names.
        header.lines.push(last);
        header.names = ["frequency_hz", "re", "im"].map(String::from).to_vec();
        header.columns = header.names.len();
        let unit = get("y axis unit").unwrap_or_default();
        header.units = ["Hz", unit, unit].map(String::from).to_vec();
        // Behind what the keys of other programs say, so in front of all lines that hold the same words.
        for (name, key) in [("Reference", "reference dof id"), ("Response", "dof id")] {
            if let Some(dof) = get(key).and_then(testlab_dof) {
                header.lines.insert(0, format!("{name}: {dof}"));
            }
        }
    } else if is("axisunit", "hz")
        && header.names.len() > 1
        && !header.names[0].chars().any(char::is_alphanumeric)
    {
        if header.names[1..].iter().any(|n| column(n) == Column::Unknown) {
            let of = get("functiontype").map_or(String::new(), |of| format!(" ({of})"));
            return Err(InputError::new(format!(
                "spectra over Hz{of} without phases: no frequency responses"
            ))
            .line(header.data_line)
            .remedy("export the FRFs (H1) with real and imaginary part, or the time signals"));
        }
        header.names[0] = "frequency_hz".into();
    }
    Ok(())
}

/// `Point:10:-Z` of Testlab: component, node, direction.
fn testlab_dof(id: &str) -> Option<String> {
    let mut from_the_end = id.rsplit(':');
    let (direction, node) = (from_the_end.next()?, from_the_end.next()?);
    let dof = format!("{}{}", node.trim(), direction.trim());
    dof.parse::<Dof>().ok().map(|dof| dof.to_string())
}

/// A column's unit as the file writes it: under its name, or in brackets behind it.
fn unit_label(header: &Header, at: usize) -> Option<String> {
    let in_brackets = || unit_behind(header.names.get(at)?).1.map(str::to_owned);
    let below = header.units.get(at).filter(|u| !u.is_empty());
    below.cloned().or_else(in_brackets)
}

/// What a column's unit says of the FRF: quantity and factor to SI. `(m/s2)(N)`, as SignalCalc writes it, is a ratio.
fn quantity_of_unit(header: &Header, at: usize) -> Option<(Quantity, f64)> {
    let label = unit_label(header, at)?;
    let label = decibel(&label).map_or(label.as_str(), |(_, unit)| unit);
    let of = |label: &str| units::parse_named(label).and_then(|u| Some((u.dimension.frf()?, u.factor)));
    of(label).or_else(|| of(&label.replacen(")(", ")/(", 1)))
}

/// Response and reference that the lines above the table say: `Response: 3Z`, `Reference DOF,1X`, `DOFs: 3Z:1X`.
fn dofs_of_header(header: &Header) -> (Option<Dof>, Option<Dof>) {
    let said = |keys: &[&str]| {
        header
            .entry(keys)
            .and_then(|(_, value)| value.trim().parse::<Dof>().ok())
    };
    let (response, reference) = (said(&["response", "roving"]), said(&["reference", "excitation"]));
    if response.is_some() || reference.is_some() {
        return (response, reference);
    }
    let Some((_, both)) = header.entry(&["dof"]) else {
        return (None, None);
    };
    let both = both.split('[').next().unwrap_or_default();
    let Some((response, reference)) = both.split_once([':', '/']) else {
        return (both.trim().parse().ok(), None);
    };
    (response.trim().parse().ok(), reference.trim().parse().ok())
}

/// True where the column names are those of FRFs.
pub(crate) fn is_frf_table(header: &Header) -> bool {
    let columns: Vec<Column> = header.names.iter().map(|n| column(n)).collect();
    matches!(
        columns.get(frequency_at(&columns)),
        Some(Column::Frequency { .. })
    ) && columns
        .iter()
        .any(|c| matches!(c, Column::Re(_) | Column::Magnitude(..)))
}

/// The frequency is the first column, or the second behind a running number.
fn frequency_at(columns: &[Column]) -> usize {
    usize::from(columns.first() == Some(&Column::Index))
}

/// True where three columns of numbers stand alone, or under a heading that speaks of frequency.
pub(crate) fn is_plain_frf(header: &Header) -> bool {
    let mut above = header.lines.iter().chain(&header.names);
    header.columns == 3 && (above.all(|l| l.trim().is_empty()) || speaks_of_frequency(header))
}

/// Whether the lines above the numbers name a frequency.
pub(crate) fn speaks_of_frequency(header: &Header) -> bool {
    let mut above = header.lines.iter().chain(&header.names);
    above.any(|text| text.to_lowercase().contains("freq"))
}

/// True for a rising column that is rather the time of a recording than a frequency axis: no FRF of a machine has lines
/// every few millihertz, and no vibration is sampled less often than fifty times a second.
fn looks_like_time(rising: &[f64]) -> bool {
    let [first, .., last] = rising else { return false };
    let step = (last - first) / (rising.len() - 1) as f64;
    step <= 2e-3 || step < 0.02 && *last < 50.0
}

struct Parts {
    name: String,
    re: Option<usize>,
    im: Option<usize>,
    magnitude: Option<(usize, Scale)>,
    phase: Option<(usize, Angle)>,
    coherence: Option<usize>,
}

/// Reads the FRF CSV of a campaign.
pub(crate) fn read_table(
    bytes: &[u8],
    header: &Header,
    notes: &mut Notes,
) -> Result<Vec<FrfRecord>, InputError> {
    let names_line = header
        .data_line
        .saturating_sub(1 + usize::from(!header.units.is_empty()))
        .max(1);
    let below = |at: usize| header.units.get(at).map(String::as_str);
    let columns: Vec<Column> = header
        .names
        .iter()
        .enumerate()
        .map(|(at, name)| match column(name) {
            // The factor of the frequency comes from its heading, as ever.
            frequency @ Column::Frequency { .. } => frequency,
            other => in_unit(other, below(at)),
        })
        .collect();
    let frequency_at = frequency_at(&columns);
    let Some(Column::Frequency { factor }) = columns.get(frequency_at).cloned() else {
        return Err(InputError::new("the first column is not the frequency").line(names_line));
    };
    let mut parts: Vec<Parts> = Vec::new();
    let mut index: HashMap<&str, usize> = HashMap::new();
    for (at, column) in columns.iter().enumerate().skip(frequency_at + 1) {
        let name = match column {
            Column::Re(n) | Column::Im(n) | Column::Magnitude(n, _) => n,
            Column::Phase(n, _) | Column::Coherence(n) => n,
            Column::Index | Column::Frequency { .. } | Column::Unknown => {
                return Err(
                    InputError::new(format!("column {:?} is not part of an FRF", header.names[at]))
                        .line(names_line)
                        .remedy(
                            "use frequency_hz, then re(1X/1X),im(1X/1X) or magnitude,phase_deg for each FRF (magnitude_db: in dB)",
                        ),
                );
            }
        };
        let i = *index.entry(name).or_insert(parts.len());
        if i == parts.len() {
            let name = name.clone();
            parts.push(Parts {
                name,
                re: None,
                im: None,
                magnitude: None,
                phase: None,
                coherence: None,
            });
        }
        let part = &mut parts[i];
        let twice = match column {
            Column::Re(_) => part.re.replace(at).is_some(),
            Column::Im(_) => part.im.replace(at).is_some(),
            Column::Magnitude(_, scale) => part.magnitude.replace((at, *scale)).is_some(),
            Column::Phase(_, angle) => part.phase.replace((at, *angle)).is_some(),
            _ => part.coherence.replace(at).is_some(),
        };
        if twice {
            return Err(
                InputError::new(format!("column {:?} comes twice", header.names[at])).line(names_line),
            );
        }
    }
    let table = header.read(bytes, None, notes)?;
    let frequency_hz: Vec<f64> = table.columns[frequency_at].iter().map(|f| f * factor).collect();
    let mut frfs = Vec::with_capacity(parts.len());
    for part in parts {
        let pair = |a: usize, b: usize| table.columns[a].iter().zip(&table.columns[b]);
        let value: Vec<Complex64> = match (part.re, part.im, part.magnitude, part.phase) {
            // Magnitude and phase beside them say the same.
            (Some(re), Some(im), ..) => pair(re, im).map(|(re, im)| Complex64::new(*re, *im)).collect(),
            (None | Some(_), None, Some((magnitude, scale)), Some((phase, angle))) => {
                let radians = radians_of(&table.columns[phase], angle, &part.name, notes)
                    .map_err(|e| e.line(names_line))?;
                let linear = linear_of(&table.columns[magnitude], scale, &part.name, notes);
                linear
                    .iter()
                    .zip(radians)
                    .map(|(m, p)| Complex64::from_polar(*m, p))
                    .collect()
            }
            _ => {
                let whose = if part.name.is_empty() {
                    String::new()
                } else {
                    format!(" of {}", part.name)
                };
                return Err(InputError::new(format!("the columns{whose} do not make an FRF"))
                    .line(names_line)
                    .remedy("give re and im, or magnitude and phase_deg, under the same name"));
            }
        };
        let coherence = part.coherence.map(|at| &table.columns[at]);
        let coherence = coherence.filter(|c| c.iter().all(|v| (-0.01..=1.01).contains(v)));
        if part.coherence.is_some() && coherence.is_none() {
            notes.about(&part.name, "coherence outside 0..1: left out");
        }
        let (response, reference) = match dofs(&part.name, notes) {
            (None, None) => dofs_of_header(header),
            both => both,
        };
        let value_column = part.re.or(part.magnitude.map(|(at, _)| at));
        let unit = value_column.and_then(|at| quantity_of_unit(header, at));
        let label = value_column.and_then(|at| unit_label(header, at));
        if let Some(remark) = label.and_then(|label| units::no_motion_per_force(&label)) {
            notes.about(&part.name, remark);
        }
        let factor = unit.map_or(1.0, |u| u.1);
        if (factor - 1.0).abs() > 1e-12 {
            notes.about(&part.name, format!("converted to SI, factor {factor:.6}"));
        }
        let value: Vec<Complex64> = value.into_iter().map(|v| v * factor).collect();
        frfs.extend(checks::tidy_frf(
            FrfRecord {
                name: if part.name.is_empty() {
                    "FRF".into()
                } else {
                    part.name
                },
                response,
                reference,
                quantity: unit.map(|u| u.0),
                frequency_hz: frequency_hz.clone(),
                value,
                coherence: coherence.map(|c| c.iter().map(|v| v.clamp(0.0, 1.0)).collect()),
            },
            notes,
        )?);
    }
    Ok(frfs)
}

/// Magnitudes as they are, from decibels where the heading says so, or where they fall below zero, which no magnitude does.
fn linear_of(magnitude: &[f64], scale: Scale, name: &str, notes: &mut Notes) -> Vec<f64> {
    let below_zero = || magnitude.iter().any(|m| *m < 0.0);
    let reference = match scale {
        Scale::Decibel { reference } => reference,
        Scale::Unsaid if below_zero() => {
            notes.about(name, "magnitudes below zero: taken as dB (20 log10), reference 1");
            1.0
        }
        Scale::Unsaid | Scale::Linear => return magnitude.to_vec(),
    };
    magnitude
        .iter()
        .map(|db| reference * 10_f64.powf(db / 20.0))
        .collect()
}

/// Phases in radians. Where the heading says no unit, the values do: radians stay within one turn, or, where they were
/// unwrapped, within half a turn from line to line.
fn radians_of(phase: &[f64], angle: Angle, name: &str, notes: &mut Notes) -> Result<Vec<f64>, InputError> {
    /// One turn, and what rounding adds.
    const TURN: f64 = std::f64::consts::TAU * 1.02;
    /// Over fifty modes would have to pass for radians to go so far.
    const HALF_A_TURN_IN_DEGREES: f64 = 170.0;
    let finite: Vec<f64> = phase.iter().copied().filter(|p| p.is_finite()).collect();
    let (least, most) = finite
        .iter()
        .fold((f64::MAX, f64::MIN), |(a, b), p| (a.min(*p), b.max(*p)));
    let range = most - least;
    let jumps = finite.windows(2).any(|w| (w[1] - w[0]).abs() > TURN / 2.0);
    let degrees = match angle {
        Angle::Degrees => true,
        Angle::Radians => false,
        Angle::Unsaid if range <= TURN => {
            notes.about(name, "unit of the phase not said: radians, by its values");
            false
        }
        Angle::Unsaid if jumps || range >= HALF_A_TURN_IN_DEGREES => {
            notes.about(name, "unit of the phase not said: degrees, by its values");
            true
        }
        Angle::Unsaid => {
            return Err(InputError::new(format!(
                "the phase goes from {least:.4} to {most:.4}: degrees, or radians that were unwrapped"
            ))
            .remedy("name the column phase_deg or phase_rad"));
        }
    };
    let factor = if degrees {
        std::f64::consts::PI / 180.0
    } else {
        1.0
    };
    Ok(phase.iter().map(|p| p * factor).collect())
}

/// `1X/1Y` → response and reference.
fn dofs(name: &str, notes: &mut Notes) -> (Option<Dof>, Option<Dof>) {
    if name.is_empty() {
        return (None, None);
    }
    let both = name
        .split_once('/')
        .and_then(|(a, b)| Some((a.parse::<Dof>().ok()?, b.parse::<Dof>().ok()?)));
    let both = both.or_else(|| dof_names::both(name));
    if both.is_none() {
        notes.about(
            name,
            "not of the form 1X/1X (node and axis of response / excitation)",
        );
    }
    both.unzip()
}

/// Three columns without names: frequency, real, imaginary part.
pub(crate) fn read_plain(
    bytes: &[u8],
    header: &Header,
    quantity: Option<Quantity>,
    factor: f64,
    notes: &mut Notes,
) -> Result<Vec<FrfRecord>, InputError> {
    let table = header.read(bytes, None, notes)?;
    let [frequency, re, im] = table.columns.as_slice() else {
        return Err(InputError::new("frequency, real and imaginary part are expected").line(header.data_line));
    };
    if !frequency.is_sorted_by(|a, b| a < b) || frequency.first().is_none_or(|f| *f < 0.0) {
        return Err(InputError::new(
            "three columns of numbers whose first does not rise from 0: no frequency axis",
        )
        .line(header.data_line)
        .remedy("put a line of column names on top: frequency_hz,re,im or time_s,fx_n,fy_n"));
    }
    if quantity.is_none() && !speaks_of_frequency(header) && looks_like_time(frequency) {
        return Err(InputError::new(format!(
            "three columns of numbers without names, the first from {} to {} in steps that fit a time and no frequency",
            frequency.first().copied().unwrap_or(0.0),
            frequency.last().copied().unwrap_or(0.0)
        ))
        .line(header.data_line)
        .remedy("put a line of column names on top: time_s,force_n,acc_m_per_s2 for a record, frequency_hz,re,im for an FRF"));
    }
    let (response, reference) = dofs_of_header(header);
    let record = FrfRecord {
        name: "FRF".into(),
        response,
        reference,
        quantity,
        frequency_hz: frequency.clone(),
        value: re
            .iter()
            .zip(im)
            .map(|(re, im)| Complex64::new(*re, *im) * factor)
            .collect(),
        coherence: None,
    };
    Ok(checks::tidy_frf(record, notes)?.into_iter().collect())
}

/// First line of a CutPro-style file: three numbers, then labels. Gives the labels.
pub(crate) fn cutpro_labels(bytes: &[u8]) -> Option<Vec<String>> {
    let mut lines = Lines::new(bytes);
    let first = decode(lines.next()?);
    let words: Vec<&str> = first.split_whitespace().collect();
    let (numbers, labels) = words.split_at_checked(3)?;
    let has = |word: &str| labels.iter().any(|l| l.to_lowercase().starts_with(word));
    let labelled = has("freq") && has("real") && has("imag");
    (labelled && is_row(numbers.join(" ").as_bytes()) && lines.next().is_none_or(is_row))
        .then(|| labels.iter().map(|l| (*l).to_owned()).collect())
}

/// Reads a CutPro-style file: `0.0 2.0e-07 0.0 Freq Hz Real m/N Imag m/N`, then plain rows.
pub(crate) fn read_cutpro(
    bytes: &[u8],
    labels: &[String],
    notes: &mut Notes,
) -> Result<Vec<FrfRecord>, InputError> {
    let after = |word: &str| {
        let at = labels.iter().position(|l| l.to_lowercase().starts_with(word))?;
        labels.get(at + 1)
    };
    let unit = after("real").and_then(|label| units::parse_named(label));
    let quantity = unit.and_then(|u| u.dimension.frf());
    let factor = unit.filter(|_| quantity.is_some()).map_or(1.0, |u| u.factor);
    if quantity.is_none() {
        notes.file("the unit of the FRF is not understood: SI assumed, quantity left open");
    } else if (factor - 1.0).abs() > 1e-12 {
        notes.file(format!(
            "converted to {}, factor {factor}",
            quantity.map_or("SI", units::frf_unit)
        ));
    }
    let frequency = after("freq")
        .and_then(|label| units::frequency_factor(label))
        .unwrap_or(1.0);
    // The first line without its labels is a row like the others.
    let first = decode(Lines::new(bytes).next().unwrap_or_default());
    let mut plain = first
        .split_whitespace()
        .take(3)
        .collect::<Vec<_>>()
        .join(" ")
        .into_bytes();
    plain.push(b'\n');
    for line in Lines::new(bytes).skip(1) {
        plain.extend(line.iter().map(|b| if *b == b'\t' { b' ' } else { *b }));
        plain.push(b'\n');
    }
    let header = Header::find(&plain).ok_or_else(|| InputError::new("no rows of three numbers"))?;
    let mut frfs = read_plain(&plain, &header, quantity, factor, notes)?;
    for frf in &mut frfs {
        frf.frequency_hz.iter_mut().for_each(|f| *f *= frequency);
    }
    Ok(frfs)
}
